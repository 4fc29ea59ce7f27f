// Stage 8 of a plane that is tied to the glossy signal, one pixel an invocation. The lookup is worked out anew.
@compute @workgroup_size(8, 8)
fn accumulate_glossy_joint(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let lookup = glossy_temporal_lookup(pixel);
        let blend = settings.glossy_blend;
        let result =
            accumulate_joint(blend, pixel, lookup, current, history, history_length, pass_current, pass_history);
        textureStore(output, pixel, texel_of(result, is_surface(pixel)));
    }
}
