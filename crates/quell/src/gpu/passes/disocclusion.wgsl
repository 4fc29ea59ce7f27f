// Stage 5, one pixel an invocation.
const BORDER: i32 = 0;

@compute @workgroup_size(8, 8)
fn blend(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
) {
    gather_distrust(group.xy, vec2i(local.xy));
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let result = blended_at(pixel, textureLoad(temporal, pixel, 0).xyz);
        textureStore(blended, pixel, vec4f(stored_colour(result.shown), 0.0));
        textureStore(floored, pixel, vec4f(stored_colour(result.floored), 0.0));
    }
}
