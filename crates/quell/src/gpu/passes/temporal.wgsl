// Stages 3 and 8 in one, one pixel an invocation: they read the same guides, now and before.
@compute @workgroup_size(16, 16)
fn accumulate_both(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let pixel = vec2i(id.xy);
    let here = Invocation(pixel, group.xy, index);
    let matte_changed = changed_light(settings.matte_blend, here, matte_history, matte_history_length);
    let glossy_changed = changed_light(settings.glossy_blend, here, glossy_history, glossy_history_length);
    if !contains(pixel) {
        return;
    }
    let on_surface = is_surface(pixel);
    let matte = matte_temporal(pixel, matte_changed, matte_current, matte_history, matte_history_length);
    textureStore(matte_output, pixel, texel_of(matte, on_surface));
    textureStore(matte_length, pixel, vec4f(matte.texel));
    let glossy = glossy_temporal(pixel, glossy_changed, glossy_current, glossy_history, glossy_history_length);
    textureStore(glossy_output, pixel, texel_of(glossy, on_surface));
    textureStore(glossy_length, pixel, vec4f(glossy.texel));
}
