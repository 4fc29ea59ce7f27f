// Twin of reference.rs: temporal anti-aliasing of the picture. The frame has jitter.
//
// The pass supplies `picture_at` and `picture_history_at`.

// Whether the image of the frame before shows a coordinate that lies in the picture: a tile may not.
fn antialiasing_reaches(corner: vec2f) -> bool {
    let first = own_pixel(vec2i(floor(corner)));
    return all(first >= vec2i(-1)) && all(first < vec2i(frame.before_size));
}

// Frames that count of `frames`, where the clamp took a luminance from `before` to `after`.
fn antialiasing_believed(frames: f32, before: f32, after: f32) -> f32 {
    let scale = max(abs(before), abs(after));
    var change = 0.0;
    if scale > 0.0 {
        change = abs(after - before) / scale;
    }
    return frames / (1.0 + settings.antialiasing.change_falloff * change);
}

// Share of the new frame where history holds `frames` and lies at `t` between pixels.
fn antialiasing_share(frames: f32, t: vec2f) -> f32 {
    let between = 2.0 * (t.x * (1.0 - t.x) + t.y * (1.0 - t.y));
    let least = settings.antialiasing.least + settings.antialiasing.resampling * between;
    return min(max(1.0 / (frames + 1.0), least), 1.0);
}

// The depth of a pixel; FAR: it shows the background.
fn antialiasing_depth(pixel: vec2i) -> f32 {
    let depth = depth_at(pixel);
    return select(depth, FAR, depth == BACKGROUND);
}

// `bounds`, made to hold the colours of what stands before the farthest surface and moves as history was fetched.
fn antialiasing_widened(bounds: ColourBox, pixel: vec2i, farthest: f32, motion: vec2f) -> ColourBox {
    var widened = bounds;
    let radius = i32(settings.antialiasing.thin_radius);
    if radius == 0 {
        return bounds;
    }
    let first = max(pixel - radius, vec2i(0));
    let last = min(pixel + radius, vec2i(frame.size) - 1);
    for (var ty = first.y; ty <= last.y; ty++) {
        for (var tx = first.x; tx <= last.x; tx++) {
            let q = vec2i(tx, ty);
            let depth = antialiasing_depth(q);
            if depth * (1.0 + settings.antialiasing.thin_depth) < farthest {
                // Unknown motion compares false.
                if all(abs(moving_at(q, depth).motion - motion) <= vec2f(settings.antialiasing.thin_motion)) {
                    widened = colour_box_add(widened, picture_at(q));
                }
            }
        }
    }
    return widened;
}

// The picture at one pixel, and how many frames it holds.
fn antialiasing(pixel: vec2i) -> vec4f {
    let now = picture_at(pixel);
    let alone = vec4f(now, 1.0);
    if frame.picture_history == 0u {
        return alone;
    }
    let first = max(pixel - 1, vec2i(0));
    let last = min(pixel + 1, vec2i(frame.size) - 1);
    var nearest = pixel;
    var depth = FAR;
    var farthest = 0.0;
    var gathered = colour_box_empty();
    for (var ty = first.y; ty <= last.y; ty++) {
        for (var tx = first.x; tx <= last.x; tx++) {
            let q = vec2i(tx, ty);
            let there = antialiasing_depth(q);
            if there < depth {
                depth = there;
                nearest = q;
            }
            farthest = max(farthest, there);
            gathered = colour_box_add(gathered, picture_at(q));
        }
    }
    let motion = moving_at(nearest, depth).motion;
    let coordinate = pixel_centre(pixel) + motion;
    // Unknown motion compares false everywhere.
    if !(all(coordinate >= vec2f(0.0)) && all(coordinate <= vec2f(frame.whole))) {
        return alone;
    }
    let corner = to_before(coordinate) - 0.5;
    if !antialiasing_reaches(corner) {
        return alone;
    }
    let base = floor(corner);
    let t = corner - base;
    let around = own_pixel(vec2i(base));
    let end = vec2i(frame.before_size) - 1;
    let along = catmull_rom(t.x);
    let across = catmull_rom(t.y);
    let along_frames = vec4f(0.0, 1.0 - t.x, t.x, 0.0);
    let across_frames = vec4f(0.0, 1.0 - t.y, t.y, 0.0);
    var fetched = vec3f(0.0);
    var held = 0.0;
    for (var j = 0; j < 4; j++) {
        for (var i = 0; i < 4; i++) {
            let there = picture_history_at(clamp(around + vec2i(i - 1, j - 1), vec2i(0), end));
            fetched += along[i] * across[j] * there.xyz;
            held += along_frames[i] * across_frames[j] * there.w;
        }
    }
    held *= moving_at(pixel, depth_at(pixel)).confidence_in;
    if !(held > 0.0) {
        return alone;
    }
    // The spline may overshoot.
    fetched = max(fetched, vec3f(0.0));
    let bounds = antialiasing_widened(
        colour_box_of(gathered, CLIP_SIGMA, settings.antialiasing.gamma),
        pixel,
        farthest,
        motion,
    );
    let clamped = colour_box_clamp(bounds, fetched);
    let frames = antialiasing_believed(held, luminance(fetched), luminance(clamped));
    let a = antialiasing_share(frames, t);
    return vec4f((1.0 - a) * clamped + a * now, min(frames + 1.0, 1.0 / settings.antialiasing.least));
}
