// Needs the plane `moving_before`: that of the frame before where hit distances are compared, else any.

// The glossy hit distance of a pixel of the frame before; `depth`: its view depth then.
fn hit_before(pixel: vec2i, depth: f32) -> f32 {
    return moving_of(textureLoad(moving_before, pixel, 0), depth).glossy_hit;
}
