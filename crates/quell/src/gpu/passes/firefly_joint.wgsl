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
        var chosen = firefly_choice(pixel);
        var colour: vec3f;
        for (var c = 0; c < 3; c++) {
            colour[c] = first_colour(textureLoad(pass_input, chosen[c], 0))[c];
        }
        textureStore(output, pixel, vec4f(stored_colour(colour), 0.0));
    }
}
