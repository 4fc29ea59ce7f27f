// Stage 8, one pixel an invocation.
@compute @workgroup_size(8, 8)
fn accumulate_glossy(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        store(pixel, glossy_temporal(pixel));
    }
}
