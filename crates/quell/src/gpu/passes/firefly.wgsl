// Stage 6, one pixel an invocation.
fn firefly_input(pixel: vec2i) -> vec3f {
    return first_colour(textureLoad(input, pixel, 0));
}

fn firefly_is_surface(pixel: vec2i) -> bool {
    return is_surface(pixel);
}

@compute @workgroup_size(8, 8)
fn suppress(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        textureStore(output, pixel, vec4f(stored_colour(firefly(pixel)), 0.0));
    }
}
