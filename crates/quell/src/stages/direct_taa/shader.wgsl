// Twin of reference.rs: stage 11. The frame has jitter.
//
// The pass supplies `direct_at` and `direct_history_at`.

// Whether the image of the frame before shows a coordinate that lies in the picture: a tile may not.
fn direct_taa_reaches(coordinate: vec2f) -> bool {
    let first = own_pixel(vec2i(floor(to_before(coordinate) - 0.5)));
    return all(first >= vec2i(-1)) && all(first < vec2i(frame.before_size));
}

// Bilinear fetch, clamped to the edge.
fn direct_taa_fetch(coordinate: vec2f) -> vec3f {
    let corner = to_before(coordinate) - 0.5;
    let base = floor(corner);
    let t = corner - base;
    let last = vec2i(frame.before_size) - 1;
    let first = clamp(own_pixel(vec2i(base)), vec2i(0), last);
    let second = clamp(own_pixel(vec2i(base)) + 1, vec2i(0), last);
    let a = direct_history_at(first);
    let b = direct_history_at(vec2i(second.x, first.y));
    let c = direct_history_at(vec2i(first.x, second.y));
    let d = direct_history_at(second);
    return lerp(lerp(a, b, t.x), lerp(c, d, t.x), t.y);
}

// Stage 11 at one pixel.
fn direct_taa(pixel: vec2i) -> vec3f {
    let now = direct_at(pixel);
    if frame.direct_history == 0u {
        return now;
    }
    let first = max(pixel - 1, vec2i(0));
    let last = min(pixel + 1, vec2i(frame.size) - 1);
    var nearest = pixel;
    var depth = FAR;
    var gathered = colour_box_empty();
    for (var ty = first.y; ty <= last.y; ty++) {
        for (var tx = first.x; tx <= last.x; tx++) {
            let q = vec2i(tx, ty);
            let there = depth_at(q);
            if there != BACKGROUND && there < depth {
                depth = there;
                nearest = q;
            }
            gathered = colour_box_add(gathered, direct_at(q));
        }
    }
    let motion = moving_at(nearest, depth).motion;
    let speed = length(motion);
    let coordinate = pixel_centre(pixel) + motion;
    let trust = settings.direct_taa.history
        * max(1.0 - speed / settings.direct_taa.falloff_px, 0.0)
        * moving_at(pixel, depth_at(pixel)).confidence_in;
    if trust <= 0.0 || any(coordinate < vec2f(0.0)) || any(coordinate > vec2f(frame.whole)) {
        return now;
    }
    if !direct_taa_reaches(coordinate) {
        return now;
    }
    let fetched = direct_taa_fetch(coordinate);
    let clamped = colour_box_clamp(gathered, fetched);
    let change = abs(luminance(clamped) - luminance(fetched));
    let scale = max(abs(luminance(clamped)), abs(luminance(fetched)));
    var relative = 0.0;
    if scale > 0.0 {
        relative = change / scale;
    }
    let w = trust / (1.0 + settings.direct_taa.clamp_falloff * relative);
    return w * clamped + (1.0 - w) * now;
}
