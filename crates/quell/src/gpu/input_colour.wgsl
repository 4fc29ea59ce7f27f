// A colour as the host's texture holds it.
fn input_colour(texel: vec4f) -> vec3f {
    return texel.xyz;
}
