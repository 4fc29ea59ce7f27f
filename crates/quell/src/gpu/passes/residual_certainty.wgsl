// Of a cell of the coarsest level its relative residual and one over the variance of that; 0 where either is unknown.
@compute @workgroup_size(8, 8)
fn find_certainty(@builtin(global_invocation_id) id: vec3u) {
    let cell = vec2i(id.xy);
    if !all(cell < settings.cells) {
        return;
    }
    let i = cell.y * settings.cells.x + cell.x;
    let sums = smoothed(cell).sums;
    let ratio = residual_of(sums);
    let variance = variance_of(sums, ratio, changes[i].w);
    if finite(dot(ratio, ratio)) && finite(variance) {
        certainty[i] = vec4f(ratio, 1.0 / variance);
    } else {
        certainty[i] = vec4f(0.0);
    }
}
