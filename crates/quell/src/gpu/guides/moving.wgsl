// Needs the plane `moving`.

// `depth`: the pixel's view depth.
fn moving_at(pixel: vec2i, depth: f32) -> Moving {
    return moving_of(textureLoad(moving, pixel, 0), depth);
}
