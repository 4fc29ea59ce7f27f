// Twin of border.rs (`clean_colour`): a colour as every stage may trust it. prepare.wgsl counts what it changes.

// By the bits: WGSL lets a compiler assume that there are no infinities and no NaN.
fn is_finite(v: f32) -> bool {
    return (bitcast<u32>(v) & 0x7f800000u) != 0x7f800000u;
}

// A colour as the host's texture holds it: what is not finite counts as 0, negative values are kept.
fn input_colour(texel: vec4f) -> vec3f {
    let finite = (bitcast<vec3u>(texel.xyz) & vec3u(0x7f800000u)) != vec3u(0x7f800000u);
    return clamp(select(vec3f(0.0), texel.xyz, finite), vec3f(-COLOUR_LIMIT), vec3f(COLOUR_LIMIT));
}
