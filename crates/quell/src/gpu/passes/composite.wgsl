// The sum, one pixel an invocation. Terms and weights that the frame lacks may be bound to anything: they do not count.
fn input_at(image: texture_2d<f32>, pixel: vec2i) -> vec3f {
    return input_colour(textureLoad(image, pixel, 0));
}

@compute @workgroup_size(8, 8)
fn composite(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let terms = settings.composite;
    let on_matte = select(vec3f(1.0), input_at(matte_weight, pixel), terms.matte_weight != 0u);
    let on_glossy = select(vec3f(1.0), input_at(glossy_weight, pixel), terms.glossy_weight != 0u);
    var sum = select(vec3f(0.0), input_at(direct, pixel), terms.direct != 0u);
    sum = composite_term(sum, input_at(matte, pixel), on_matte, terms.matte);
    sum = composite_term(sum, input_at(glossy, pixel), on_glossy, terms.glossy);
    sum = composite_term(sum, input_at(direct_matte, pixel), on_matte, terms.direct_matte);
    sum = composite_term(sum, input_at(direct_glossy, pixel), on_glossy, terms.direct_glossy);
    textureStore(output, pixel, vec4f(stored_colour(sum), 0.0));
}
