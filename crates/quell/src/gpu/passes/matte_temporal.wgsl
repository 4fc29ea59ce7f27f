// Stage 3, one pixel an invocation.
@compute @workgroup_size(16, 16)
fn accumulate_matte(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let pixel = vec2i(id.xy);
    let here = Invocation(pixel, group.xy, index);
    let changed = changed_light(settings.matte_blend, here, history, history_length);
    if contains(pixel) {
        let result = matte_temporal(pixel, changed, current, history, history_length);
        textureStore(output, pixel, texel_of(result, is_surface(pixel)));
        textureStore(new_length, pixel, vec4f(result.texel));
    }
}
