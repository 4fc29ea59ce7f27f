// Stage 3, one pixel an invocation.
@compute @workgroup_size(8, 8)
fn accumulate_matte(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        store(pixel, matte_temporal(pixel));
    }
}
