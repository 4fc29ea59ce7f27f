// Stage 3 of a plane that is tied to the matte signal, one pixel an invocation. The lookup is worked out anew.
@compute @workgroup_size(16, 16)
fn accumulate_matte_joint(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let pixel = vec2i(id.xy);
    let blend = settings.matte_blend;
    let changed = changed_light(blend, Invocation(pixel, group.xy, index), history, history_length);
    if contains(pixel) {
        let lookup = matte_temporal_lookup(pixel);
        let result =
            accumulate_joint(blend, pixel, lookup, changed, current, history, history_length, pass_current, pass_history);
        textureStore(output, pixel, texel_of(result, is_surface(pixel)));
    }
}
