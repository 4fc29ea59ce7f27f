// A joint plane, corrected as the light that it goes with.
@compute @workgroup_size(8, 8)
fn apply_changes(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let p = index_of(pixel);
        let before = joint[p];
        joint[p] = vec4f(corrected(pixel, filtered[p].xyz, before.xyz), before.w);
    }
}
