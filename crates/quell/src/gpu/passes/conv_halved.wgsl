// A layer that reads an image of twice its size.
fn source(group: u32, pixel: vec2i) -> vec4f {
    let q = 2 * pixel;
    return mean_of_four(
        textureLoad(layer_read, q, group, 0),
        textureLoad(layer_read, q + vec2i(1, 0), group, 0),
        textureLoad(layer_read, q + vec2i(0, 1), group, 0),
        textureLoad(layer_read, q + vec2i(1, 1), group, 0),
    );
}
