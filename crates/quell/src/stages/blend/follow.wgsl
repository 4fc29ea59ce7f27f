// Twin of `over_time` of reference.rs and of outlier.rs: what the trajectory of a pixel says of its noise, and whether the pixel is
// brighter than all around it in space and time. Nothing here is relative to a brightness yet.

struct Followed {
    // Input less wavelet's picture, averaged.
    mean: vec3f,
    // Half the squared changes to the pixel's own, over the most frames.
    change: f32,
    // Share of frames that show it.
    seen: f32,
    // By how much the pixel of the picture, and of the input, is an outlier: 0..1.
    outlier: vec2f,
}

// The pixel of `there` that shows what `pixel` of `before` shows, `at` being its place, which is moved along. Negative: it is lost.
fn follow(before: WindowFrame, there: WindowFrame, forward: bool, reflected: bool, at: ptr<function, vec2f>, pixel: vec2i) -> vec2i {
    if !has_motion(before, forward) {
        return vec2i(-1);
    }
    let place = *at + motion_at(before, forward, reflected, pixel);
    *at = place;
    let extent = vec2f(f32(settings.size.x), f32(settings.picture_height));
    if !(all(place > vec2f(-0.5)) && all(place < extent - 0.5)) {
        return vec2i(-1);
    }
    let found = min(rounded(place), vec2i(i32(settings.size.x), settings.picture_height) - 1) - vec2i(0, settings.first_row);
    if !contains(found) {
        return vec2i(-1);
    }
    let a = inverse_depth_of(before, pixel);
    let b = inverse_depth_of(there, found);
    let m = textureLoad(surface_normals, pixel, before.layer, 0).xyz;
    let n = textureLoad(surface_normals, found, there.layer, 0).xyz;
    let has_normals = any(m != vec3f(0.0)) || any(n != vec3f(0.0));
    let same = abs(a - b) <= DEPTH_STEP * max(a, b) && (!has_normals || dot(m, n) >= LEAST_COSINE);
    return select(vec2i(-1), found, same);
}

// The largest sums of the channels in 3x3 of the picture and of the input, with the pixel or without.
fn brightest(there: WindowFrame, pixel: vec2i, itself: bool) -> vec2f {
    var most = vec2f(0.0);
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let q = pixel + vec2i(dx, dy);
            if contains(q) && (itself || dx != 0 || dy != 0) {
                most = max(most, vec2f(sum_of(picture_of(there, q).xyz), sum_of(input_of(there, q))));
            }
        }
    }
    return most;
}

// How far a pixel of brightness `own` is an outlier, where `most` is the brightest around it.
fn excess(own: f32, most: f32) -> f32 {
    let limit = settings.outlier * most;
    if own <= limit {
        return 0.0;
    }
    if limit <= 0.0 {
        return 1.0;
    }
    return min(own / limit - 1.0, 1.0);
}

fn followed(pixel: vec2i) -> Followed {
    let here = frame_at(settings.centre);
    let reflected = is_mirror(here, pixel);
    let picture = picture_of(here, pixel).xyz;
    let own = input_of(here, pixel) - picture;
    let bright = vec2f(sum_of(picture), sum_of(input_of(here, pixel)));
    let origin = vec2f(f32(pixel.x), f32(settings.first_row + pixel.y));
    var most = brightest(here, pixel, false);
    var met = 0.0;
    var total = own;
    var change = 0.0;
    for (var direction = 0u; direction <= settings.future; direction++) {
        let forward = direction == 1u;
        var at = origin;
        var q = pixel;
        var frame = settings.centre;
        for (var step = 0; step < FOLLOWED_FRAMES; step++) {
            let next = frame + select(-1, 1, forward);
            if next < 0 || next >= settings.count {
                break;
            }
            let there = frame_at(next);
            let found = follow(frame_at(frame), there, forward, reflected, &at, q);
            if found.x < 0 || abs(at.y - origin.y) > settings.farthest {
                break;
            }
            q = found;
            frame = next;
            let shown = picture_of(there, q).xyz;
            let ratio = clamp((bright.x + LEAST_BRIGHTNESS) / (sum_of(shown) + LEAST_BRIGHTNESS), 1.0 / MOST_CHANGE, MOST_CHANGE);
            let difference = (input_of(there, q) - shown) * ratio;
            let d = own - difference;
            met += 1.0;
            total += difference;
            change += 0.5 * dot(d, d);
            most = max(most, brightest(there, q, true));
        }
    }
    var outlier = vec2f(0.0);
    if met > 0.0 {
        // A row of one column has no pixel beside it but itself.
        let alone = settings.size.x == 1u;
        outlier = select(vec2f(excess(bright.x, most.x), excess(bright.y, most.y)), vec2f(0.0), alone);
    }
    let all_frames = f32(2 * FOLLOWED_FRAMES);
    return Followed(total / (1.0 + met), change / all_frames, met / all_frames, outlier);
}

// 1 where something stands in front within 3x3.
fn silhouette(pixel: vec2i) -> f32 {
    let here = frame_at(settings.centre);
    let own = inverse_depth_of(here, pixel);
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let q = pixel + vec2i(dx, dy);
            if contains(q) {
                let other = inverse_depth_of(here, q);
                if other > own * settings.nearer || own > other * settings.nearer {
                    return 1.0;
                }
            }
        }
    }
    return 0.0;
}
