// Twin of temporal.rs: what stages 3 and 8 share once they know where history lies: fetch, clamp, blend.
//
// `current`: the host's colours; `history`, `history_length`: what the frame before left; `changed`: c of change.wgsl.

// What stage 3 or 8 writes at one pixel.
struct Accumulated {
    colour: vec3f,
    // 0..1.
    confidence: f32,
    // Frames, at least 1.
    length: f32,
    // What the plane of history lengths holds: the length, and the fast history beside it where there is one.
    texel: f32,
}

// How one pixel blends.
struct Weighed {
    // Share of history, 0..1.
    history: f32,
    // Share of the fast history, 0..1.
    fast: f32,
    confidence: f32,
    // New history length, frames.
    length: f32,
}

// How much history counts, the confidence, and the new history length, from trust rho and the old length N.
fn weigh(blend: Blend, trust: f32, frames: f32) -> Weighed {
    if trust <= 0.0 || frames <= 0.0 {
        return Weighed(0.0, 0.0, 0.0, 1.0);
    }
    let growing = frames / (frames + 1.0);
    var alpha = blend.alpha;
    if blend.ramp != 0u {
        alpha = min(blend.alpha, growing);
    }
    return Weighed(
        trust * alpha,
        trust * min(blend.fast, growing),
        trust * min(frames / blend.confidence_frames, 1.0),
        min(trust * frames + 1.0, LONGEST_HISTORY),
    );
}

// The clamp's box at a pixel: of the surfaces within the radius, in the unfiltered current signal.
fn colour_box_at(blend: Blend, pixel: vec2i, current: texture_2d<f32>) -> ColourBox {
    let first = max(pixel - blend.clip_radius, vec2i(0));
    let last = min(pixel + blend.clip_radius, vec2i(frame.size) - 1);
    var gathered = colour_box_empty();
    for (var ty = first.y; ty <= last.y; ty++) {
        for (var tx = first.x; tx <= last.x; tx++) {
            let q = vec2i(tx, ty);
            if is_surface(q) {
                gathered = colour_box_add(gathered, input_colour(textureLoad(current, q, 0)));
            }
        }
    }
    return colour_box_of(gathered, blend.clip, blend.clip_gamma);
}

// What a previous pixel adds to a weighted mean; without a weight it is not read.
fn share_of(image: texture_2d<f32>, pixel: vec2i, weight: f32) -> vec3f {
    if weight > 0.0 {
        return weight * textureLoad(image, pixel, 0).xyz;
    }
    return vec3f(0.0);
}

// Weighted mean of up to four previous pixels.
fn fetch(found: Lookup, history: texture_2d<f32>) -> vec3f {
    return share_of(history, footprint_pixel(found.first, 0), found.weight.x)
        + share_of(history, footprint_pixel(found.first, 1), found.weight.y)
        + share_of(history, footprint_pixel(found.first, 2), found.weight.z)
        + share_of(history, footprint_pixel(found.first, 3), found.weight.w);
}

// What history shows at the place: the weighted mean of up to four previous pixels, or Catmull and Rom's spline through 4x4 of
// them. Linear in the colours.
fn fetch_colour(found: Lookup, history: texture_2d<f32>) -> vec3f {
    if !found.spline {
        return fetch(found, history);
    }
    let along = catmull_rom(found.weight.y + found.weight.w);
    let across = catmull_rom(found.weight.z + found.weight.w);
    var sum = vec3f(0.0);
    for (var j = 0; j < 4; j++) {
        for (var i = 0; i < 4; i++) {
            sum += along[i] * across[j] * textureLoad(history, found.first + vec2i(i - 1, j - 1), 0).xyz;
        }
    }
    return sum;
}

// What `fetch_colour` fetched, held to the range of the four pixels around the place: the spline may overshoot.
fn hold_to_range(found: Lookup, history: texture_2d<f32>, fetched: vec3f) -> vec3f {
    if !found.spline {
        return fetched;
    }
    let a = textureLoad(history, footprint_pixel(found.first, 0), 0).xyz;
    let b = textureLoad(history, footprint_pixel(found.first, 1), 0).xyz;
    let c = textureLoad(history, footprint_pixel(found.first, 2), 0).xyz;
    let d = textureLoad(history, footprint_pixel(found.first, 3), 0).xyz;
    return clamp(fetched, min(min(a, b), min(c, d)), max(max(a, b), max(c, d)));
}

// Weighted mean of the history length.
fn fetch_length(found: Lookup, history_length: texture_2d<f32>) -> f32 {
    return fetch(found, history_length).x;
}

// Fetch, clamp and blend at the place that was looked up: `accumulate` of stage 3's reference.rs.
fn accumulate(
    blend: Blend,
    pixel: vec2i,
    lookup: Lookup,
    changed: f32,
    current: texture_2d<f32>,
    history: texture_2d<f32>,
    history_length: texture_2d<f32>,
) -> Accumulated {
    let now = input_colour(textureLoad(current, pixel, 0));
    let depth = depth_at(pixel);
    let trust = lookup.trust * moving_at(pixel, depth).confidence_in;
    let weighed = weigh(blend, trust, frames_left(blend, lookup, changed, history, history_length));
    let confidence = select(1.0, weighed.confidence, depth != BACKGROUND);
    var texel = weighed.length;
    if looks_for_change(blend) {
        let fast = fetch_both(lookup, history, history_length).y;
        texel = beside(weighed.length, weighed.fast * fast + (1.0 - weighed.fast) * kept_light(now));
    }
    if weighed.history <= 0.0 {
        return Accumulated(now, confidence, weighed.length, texel);
    }
    let fetched = fetch_colour(lookup, history);
    var held = fetched;
    if blend.clip != CLIP_OFF {
        let within = hold_to_range(lookup, history, fetched);
        let clamped = colour_box_clamp(colour_box_at(blend, pixel, current), within);
        held = vec3f(
            follow_itself(fetched.x, shareable(fetched.x, clamped.x, now.x)),
            follow_itself(fetched.y, shareable(fetched.y, clamped.y, now.y)),
            follow_itself(fetched.z, shareable(fetched.z, clamped.z, now.z)),
        );
    }
    return Accumulated(weighed.history * held + (1.0 - weighed.history) * now, confidence, weighed.length, texel);
}
