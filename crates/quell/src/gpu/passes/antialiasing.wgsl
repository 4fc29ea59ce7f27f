// The picture's anti-aliasing, one pixel an invocation. How many frames history holds is its fourth value.
fn picture_at(pixel: vec2i) -> vec3f {
    return textureLoad(input, pixel, 0).xyz;
}

fn picture_history_at(pixel: vec2i) -> vec4f {
    return textureLoad(history, pixel, 0);
}

@compute @workgroup_size(8, 8)
fn antialias(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let found = antialiasing(pixel);
        let colour = stored_colour(found.xyz);
        textureStore(output, pixel, vec4f(colour, 0.0));
        textureStore(kept, pixel, vec4f(colour, found.w));
    }
}
