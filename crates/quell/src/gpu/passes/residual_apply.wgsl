// The light or picture, corrected, one pixel an invocation.
@compute @workgroup_size(8, 8)
fn apply_changes(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let p = index_of(pixel);
        let before = filtered[p];
        filtered[p] = vec4f(corrected(pixel, before.xyz, before.xyz), before.w);
    }
}
