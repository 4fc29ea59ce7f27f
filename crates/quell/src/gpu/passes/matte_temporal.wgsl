// Stage 3, one pixel an invocation.
@compute @workgroup_size(8, 8)
fn accumulate_matte(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let result = matte_temporal(pixel, current, history, history_length);
        textureStore(output, pixel, texel_of(result, is_surface(pixel)));
        textureStore(new_length, pixel, vec4f(result.texel));
    }
}
