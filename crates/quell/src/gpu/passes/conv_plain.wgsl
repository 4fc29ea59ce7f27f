// A layer that reads an image of its own size, or the picture, whose border is repeated beyond it.
fn source(group: u32, pixel: vec2i) -> vec4f {
    let q = clamp(pixel - vec2i(0, settings.above), vec2i(0), vec2i(settings.inside) - 1);
    return textureLoad(layer_read, q, group, 0);
}
