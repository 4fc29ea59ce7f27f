// Needs the plane `geometry`.

// Where a pixel was sampled.
fn sample_position(pixel: vec2i) -> vec2f {
    return pixel_centre(pixel) + frame.jitter;
}

fn depth_at(pixel: vec2i) -> f32 {
    return geometry_depth(textureLoad(geometry, pixel, 0));
}

fn is_surface(pixel: vec2i) -> bool {
    return depth_at(pixel) != BACKGROUND;
}

// Position of a pixel, whose depth must be finite.
fn world_of(pixel: vec2i) -> vec3f {
    return world(frame.view, sample_position(pixel), depth_at(pixel));
}
