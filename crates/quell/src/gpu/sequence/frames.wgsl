// Surfaces and motion of the frames of a window: a layer of each array is a frame. The pass supplies the arrays and `WindowFrame`.
fn has_motion(there: WindowFrame, forward: bool) -> bool {
    return has(there, select(HAS_TO_PREVIOUS, HAS_TO_NEXT, forward));
}

// True where the pixel is a mirror or glass.
fn is_mirror(there: WindowFrame, pixel: vec2i) -> bool {
    return textureLoad(surface_normals, pixel, there.layer, 0).w > 0.0;
}

// Of the frame's surfaces, or of what mirrors and glass show; unknown motion leads far out of the picture.
fn motion_at(there: WindowFrame, forward: bool, reflected: bool, pixel: vec2i) -> vec2f {
    if forward {
        if reflected && has(there, HAS_REFLECTION_TO_NEXT) {
            return textureLoad(reflection_to_next, pixel, there.layer, 0).xy;
        }
        return textureLoad(to_next, pixel, there.layer, 0).xy;
    }
    if reflected && has(there, HAS_REFLECTION_TO_PREVIOUS) {
        return textureLoad(reflection_to_previous, pixel, there.layer, 0).xy;
    }
    return textureLoad(to_previous, pixel, there.layer, 0).xy;
}

fn inverse_depth_of(there: WindowFrame, pixel: vec2i) -> f32 {
    return textureLoad(surfaces, pixel, there.layer, 0).x;
}
