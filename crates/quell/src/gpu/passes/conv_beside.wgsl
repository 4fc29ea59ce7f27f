// A layer that reads an image of its own size and one of half its size.
fn source(group: u32, pixel: vec2i) -> vec4f {
    if group < WHOLE {
        return textureLoad(layer_read, pixel, group, 0);
    }
    return textureLoad(layer_half, pixel / 2, group - WHOLE, 0);
}
