// The same pictures as they came.
fn input_of(there: WindowFrame, pixel: vec2i) -> vec3f {
    return textureLoad(inputs, pixel, there.picture, 0).xyz;
}
