// Twin of reference.rs: a level of the filter of young history.
//
// The pass supplies `young_input` and `young_length`.

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

// A level whose taps lie `step` pixels apart, at one pixel.
fn young_filter(pixel: vec2i, stops: EdgeStops, step: i32, share: f32) -> vec3f {
    let centre = young_input(pixel);
    let p = surface_of(pixel);
    if p.view_depth == BACKGROUND || share <= 0.0 {
        return centre;
    }
    let pixel_size = pixel_size_at(frame.view, p.view_depth);
    var total = young_frames(pixel);
    var sum = total * centre;
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let q = pixel + vec2i(dx, dy) * step;
            if (dx == 0 && dy == 0) || !contains(q) {
                continue;
            }
            let origin = ray_origin(frame.view, sample_position(q));
            let direction = ray_direction(frame.view, sample_position(q));
            let edge = edge_weight(stops, p, surface_of(q), origin, direction, pixel_size);
            let w = share * edge * young_frames(q);
            if w > 0.0 {
                sum += w * young_input(q);
                total += w;
            }
        }
    }
    return sum / total;
}
