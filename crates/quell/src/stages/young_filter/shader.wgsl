// Twin of reference.rs: a level of the filter of young history.
//
// The pass supplies `young_light`, the signal and, in the fourth value, the deviation that the level before left;
// `young_colour`, the plane that is filtered, which may be the signal itself; and `young_length`.

// What a level makes of a pixel.
struct Young {
    colour: vec3f,
    // Deviation of the noise of the signal's luminance; of meaning where there is a luminance stop.
    deviation: f32,
}

// How much a pixel counts: its frames.
fn young_frames(pixel: vec2i) -> f32 {
    return min(young_length(pixel), settings.young.frames);
}

// The share that neighbours have: by the history length, and by the lobe where there is one.
fn young_share(pixel: vec2i, end: f32, lobe: f32) -> f32 {
    return clamp((end - young_length(pixel)) * (1.0 / (end - 1.0)), 0.0, 1.0) * lobe;
}

// The least of 1 and the footprint of a lobe in distances between taps.
fn young_lobe(pixel: vec2i, gain: f32, step: i32) -> f32 {
    if frame.has_roughness == 0u {
        return 1.0;
    }
    let roughness = surface_of(pixel).roughness;
    return min((gain * (roughness * roughness) + settings.young.least_lobe) / f32(step), 1.0);
}

// The luminance stop between two means of luminance; `allowed`: the squared difference, of noise alone, from which a neighbour counts nothing.
fn young_stop(p: f32, q: f32, allowed: f32) -> f32 {
    let off = p - q;
    let least = YOUNG_SAME_LIGHT * (p + q);
    let most = allowed + least * least;
    let left = max(1.0 - off * off / (most + YOUNG_LEAST_VARIANCE), 0.0);
    return left * left;
}

// The variance of the difference of two luminances over the squared contrast, by their frames: all that the first level knows.
fn young_prior(p: f32, p_frames: f32, q: f32, q_frames: f32) -> f32 {
    let mean = 0.5 * (p + q);
    return mean * mean * ((p_frames + q_frames) / (p_frames * q_frames));
}

// What noise leaves of the contact stop between two means of luminance; `variance`: of their difference.
fn young_noisy_contact(w: f32, p: f32, q: f32, variance: f32) -> f32 {
    let most = settings.young.contact_noise;
    if most <= 0.0 {
        return w;
    }
    let both = p + q;
    return 1.0 - max(1.0 - variance / (most * (0.25 * both * both + YOUNG_LEAST_VARIANCE)), 0.0) * (1.0 - w);
}

// The contact stop along an axis.
fn young_contact(pixel: vec2i, p: Surface, axis: vec2i, contact: f32) -> f32 {
    let q = pixel + axis;
    if !contains(q) {
        return 1.0;
    }
    let depth = depth_at(q);
    if depth == BACKGROUND {
        return 1.0;
    }
    let there = world(frame.view, sample_position(q), depth);
    let to_p = closeness_at(p.position, p.normal, pixel - axis);
    let to_q = closeness_at(there, p.normal, q + axis);
    return contact_stop(there - p.position, max(to_p, to_q), contact);
}

// A level whose taps lie `step` pixels apart, at one pixel. The first finds the noise, also where it filters nothing,
// and stops by `contrast`, where that is above 0, of which a part bounds the noise of the others;
// all stop at contacts, where that stop has one.
fn young_filter(pixel: vec2i, stops: EdgeStops, step: i32, share: f32, contrast: f32) -> Young {
    let own = young_light(pixel);
    let centre = young_colour(pixel, own);
    let p = surface_of(pixel);
    let has_stop = settings.young.deviations > 0.0;
    let finds = has_stop && step == 1;
    let light = luminance(own.xyz);
    if p.view_depth == BACKGROUND || (share <= 0.0 && !finds) {
        return Young(centre, select(own.w, light, finds));
    }
    let pixel_size = pixel_size_at(frame.view, p.view_depth);
    let further = settings.young.further_contrast * contrast;
    let frames = young_frames(pixel);
    var total = frames;
    // What the first stop refuses: the pixel's own light stands in for it.
    var refused = 0.0;
    var sum = frames * centre;
    var varied = frames * frames * own.w * own.w;
    // Sums of edge weights w and w^2; of w N times 1, x and x^2, x the difference in luminance to the centre; of w^2 N.
    var edges = vec2f(1.0);
    var moments = vec3f(frames, 0.0, 0.0);
    var squares = 0.0;
    // Frames that neighbours of other surfaces count at most, where none shows this one; sums of these frames m, of m times the colour,
    // and of m times the weights of the same tap and of m^2 / N.
    let most = select(0.0, max(settings.young.isolated - frames, 0.0), step == 1);
    var alike = 0.0;
    var others = 0.0;
    var others_sum = vec3f(0.0);
    var others_squares = vec2f(0.0);
    var stops_across = vec3f(1.0);
    var stops_down = vec3f(1.0);
    if stops.contact > 0.0 {
        stops_across.x = young_contact(pixel, p, vec2i(-step, 0), stops.contact);
        stops_across.z = young_contact(pixel, p, vec2i(step, 0), stops.contact);
        stops_down.x = young_contact(pixel, p, vec2i(0, -step), stops.contact);
        stops_down.z = young_contact(pixel, p, vec2i(0, step), stops.contact);
    }
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let q = pixel + vec2i(dx, dy) * step;
            if (dx == 0 && dy == 0) || !contains(q) {
                continue;
            }
            let origin = ray_origin(frame.view, sample_position(q));
            let direction = ray_direction(frame.view, sample_position(q));
            let s = surface_of(q);
            var edge = edge_weight(stops, p, s, origin, direction, pixel_size);
            if edge <= 0.0 && (most <= 0.0 || s.view_depth == BACKGROUND) {
                continue;
            }
            let there = young_light(q);
            let counted = young_frames(q);
            let light_there = luminance(there.xyz);
            // Of the difference in luminance: as the level before left it, else as far as frames tell, over a squared contrast.
            let known = own.w * own.w + there.w * there.w;
            let unknown = young_prior(light, frames, light_there, counted);
            if stops.contact > 0.0 {
                let variance = select(YOUNG_OF_A_FRAME * unknown, known, has_stop && step > 1);
                let stopped = stops_across[dx + 1] * stops_down[dy + 1];
                edge *= young_noisy_contact(stopped, light, light_there, variance);
            }
            alike += edge;
            let whole = share * edge * counted;
            var like = 1.0;
            if step == 1 {
                if contrast > 0.0 {
                    like = young_stop(light, light_there, contrast * contrast * unknown);
                    refused += whole * (1.0 - like);
                }
            } else if has_stop {
                let squared = settings.young.deviations * settings.young.deviations;
                var allowed = squared * known;
                if further > 0.0 {
                    // As far as the pair's mean allows, or as noise is found at both: what is found at one is a firefly.
                    let mean = 0.5 * (light + light_there);
                    let found = YOUNG_NOISE_ALIKE * squared * min(own.w * own.w * frames, there.w * there.w * counted);
                    let most = max(further * further * (mean * mean), found);
                    allowed = min(allowed, most * ((frames + counted) / (frames * counted)));
                }
                like = young_stop(light, light_there, allowed);
            }
            if finds {
                let x = light_there - light;
                edges += vec2f(edge, edge * edge);
                moments += edge * counted * vec3f(1.0, x, x * x);
                squares += (edge * like) * (edge * like) * counted;
            }
            if most > 0.0 {
                let m = min(counted, most);
                others += m;
                others_sum += m * young_colour(q, there);
                others_squares += m * vec2f(edge * like, m / counted);
            }
            let w = whole * like;
            if w > 0.0 {
                sum += w * young_colour(q, there);
                total += w;
                varied += w * w * there.w * there.w;
            }
        }
    }
    total += refused;
    sum += refused * centre;
    if others > 0.0 {
        let lack = max(1.0 - alike, 0.0);
        total += share * lack * others;
        sum += share * lack * others_sum;
        squares += 2.0 * lack * others_squares.x + lack * lack * others_squares.y;
    }
    if finds {
        let count = edges.x * edges.x / edges.y;
        let spread = max(moments.z - moments.y * moments.y / moments.x, 0.0);
        var of_a_frame = frames * light * light;
        if count >= YOUNG_LEAST_NEIGHBOURS {
            of_a_frame = spread / edges.x * (count / (count - 1.0));
        }
        let own_weight = frames + refused;
        varied = of_a_frame * (own_weight * own_weight / frames + share * share * squares);
    }
    return Young(sum / total, sqrt(varied) / total);
}
