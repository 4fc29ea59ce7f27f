// Stage 8 of a plane that is tied to the glossy signal, one pixel an invocation. The lookup is worked out anew.
@compute @workgroup_size(16, 16)
fn accumulate_glossy_joint(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let pixel = vec2i(id.xy);
    let blend = settings.glossy_blend;
    let changed = changed_light(blend, Invocation(pixel, group.xy, index), history, history_length);
    if contains(pixel) {
        let lookup = glossy_temporal_lookup(pixel);
        let result =
            accumulate_joint(blend, pixel, lookup, changed, current, history, history_length, pass_current, pass_history);
        textureStore(output, pixel, texel_of(result, is_surface(pixel)));
    }
}
