// Twin of reference.rs: stage 5.
//
// The pass supplies `confidence_at`, `widest_row_at`, `widest_at` and `rows_at`.

// First and last pixel of a window along one axis, cut at the image's edge.
fn disocclusion_window(centre: i32, radius: i32, extent: u32) -> vec2i {
    return vec2i(max(centre - radius, 0), min(centre + radius, i32(extent) - 1));
}

// The maximum of 1 - confidence along the row.
fn disocclusion_widest_row(pixel: vec2i) -> f32 {
    let range = disocclusion_window(pixel.x, settings.disocclusion.radius, frame.size.x);
    var k = 0.0;
    for (var tx = range.x; tx <= range.y; tx++) {
        k = max(k, 1.0 - confidence_at(vec2i(tx, pixel.y)));
    }
    return k;
}

// The maximum of that along the column: of the square window.
fn disocclusion_widest(pixel: vec2i) -> f32 {
    let range = disocclusion_window(pixel.y, settings.disocclusion.radius, frame.size.y);
    var k = 0.0;
    for (var ty = range.x; ty <= range.y; ty++) {
        k = max(k, widest_row_at(vec2i(pixel.x, ty)));
    }
    return k;
}

// The mean of that along the row.
fn disocclusion_rows(pixel: vec2i) -> f32 {
    let range = disocclusion_window(pixel.x, settings.disocclusion.blur, frame.size.x);
    var sum = 0.0;
    for (var tx = range.x; tx <= range.y; tx++) {
        sum += widest_at(vec2i(tx, pixel.y));
    }
    return sum / f32(range.y - range.x + 1);
}

// The mean of that along the column: distrust k, 0..1.
fn disocclusion_distrust(pixel: vec2i) -> f32 {
    let range = disocclusion_window(pixel.y, settings.disocclusion.blur, frame.size.y);
    var sum = 0.0;
    for (var ty = range.x; ty <= range.y; ty++) {
        sum += rows_at(vec2i(pixel.x, ty));
    }
    return sum / f32(range.y - range.x + 1);
}

// Stage 5 with at least `least` of the prefiltered image.
fn disocclusion(temporal: vec3f, prefiltered: vec3f, distrust: f32, least: f32) -> vec3f {
    return lerp(temporal, prefiltered, max(distrust, least));
}
