// Stage 11, one pixel an invocation.
fn direct_at(pixel: vec2i) -> vec3f {
    return input_colour(textureLoad(input, pixel, 0));
}

fn direct_history_at(pixel: vec2i) -> vec3f {
    return textureLoad(history, pixel, 0).xyz;
}

@compute @workgroup_size(8, 8)
fn antialias(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        textureStore(output, pixel, vec4f(stored_colour(direct_taa(pixel)), 0.0));
    }
}
