// `Storage::Float`: every number as 32 bits, exactly.

// A colour as its plane will hold it.
fn stored_colour(c: vec3f) -> vec3f {
    return c;
}

// Normals that differ by less (length of the difference) are the same up to rounding.
const SAME_NORMAL: f32 = EXACT_SAME_NORMAL;

fn pack_geometry(normal: vec3f, depth: f32) -> vec4u {
    return bitcast<vec4u>(vec4f(normal, depth));
}

fn geometry_depth(shape: vec4u) -> f32 {
    return bitcast<f32>(shape.w);
}

fn geometry_normal(shape: vec4u, skin: vec4u) -> vec3f {
    return bitcast<vec3f>(shape.xyz);
}

fn pack_surface(id: u32, roughness: f32, normal: vec3f) -> vec4u {
    return vec4u(id, bitcast<u32>(roughness), 0u, 0u);
}

fn surface_id(skin: vec4u) -> u32 {
    return skin.x;
}

fn surface_roughness(skin: vec4u) -> f32 {
    return bitcast<f32>(skin.y);
}

fn pack_moving(moves: Moving, depth: f32) -> vec4u {
    return bitcast<vec4u>(vec4f(moves.motion, moves.glossy_hit, moves.confidence_in));
}

fn moving_of(bits: vec4u, depth: f32) -> Moving {
    let v = bitcast<vec4f>(bits);
    return Moving(v.xy, v.z, v.w);
}
