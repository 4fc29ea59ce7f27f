// Stage 6 of a plane that is tied to the matte signal, one pixel an invocation: it takes the pixels that the signal takes.
fn firefly_input(pixel: vec2i) -> vec3f {
    return first_colour(textureLoad(input, pixel, 0));
}

fn firefly_is_surface(pixel: vec2i) -> bool {
    return is_surface(pixel);
}

@compute @workgroup_size(8, 8)
fn suppress_joint(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let chosen = firefly_choice(pixel);
        let colour = vec3f(
            first_colour(textureLoad(pass_input, chosen[0], 0)).x,
            first_colour(textureLoad(pass_input, chosen[1], 0)).y,
            first_colour(textureLoad(pass_input, chosen[2], 0)).z,
        );
        textureStore(output, pixel, vec4f(stored_colour(colour), 0.0));
    }
}
