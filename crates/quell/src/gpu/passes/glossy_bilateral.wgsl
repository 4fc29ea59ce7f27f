// Stages 9 and 10, one pixel an invocation.
fn glossy_input(pixel: vec2i) -> vec3f {
    return first_colour(textureLoad(input, pixel, 0));
}

fn store(pixel: vec2i, colour: vec3f) {
    textureStore(output, pixel, vec4f(stored_colour(colour), 0.0));
}

@compute @workgroup_size(8, 8)
fn horizontal(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        store(pixel, glossy_bilateral(vec2i(1, 0), pixel));
    }
}

@compute @workgroup_size(8, 8)
fn vertical(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        store(pixel, glossy_bilateral(vec2i(0, 1), pixel));
    }
}
