// What a cell of the coarsest level is multiplied by, less 1, by its own residual or by those of the windows around.
@compute @workgroup_size(8, 8)
fn look_around(@builtin(global_invocation_id) id: vec3u) {
    let cell = vec2i(id.xy);
    if !all(cell < settings.cells) {
        return;
    }
    var sure = 0.0;
    var inverse = 0.0;
    var whole = 0.0;
    for (var dy = -settings.reach; dy <= settings.reach; dy++) {
        for (var dx = -settings.reach; dx <= settings.reach; dx++) {
            let q = cell + vec2i(dx, dy);
            if any(q < vec2i(0)) || any(q >= settings.cells) {
                continue;
            }
            let there = certainty[q.y * settings.cells.x + q.x];
            let k = triangle(abs(dx)) * triangle(abs(dy));
            sure += k * min(dot(there.xyz, there.xyz) * there.w, RESIDUAL_MOST_SURE);
            inverse += k * there.w;
            whole += k;
        }
    }
    let beyond = sure - settings.around * whole;
    let i = cell.y * settings.cells.x + cell.x;
    let own = certainty[i];
    if !(beyond > 0.0) || !(own.w > 0.0) {
        return;
    }
    // The squared residual to expect beyond the noise, over the cell's own variance.
    let expected = beyond / inverse * own.w;
    let change = limited(own.xyz * (expected / (expected + 1.0)));
    let before = changes[i];
    if dot(change, change) > dot(before.xyz, before.xyz) {
        changes[i] = vec4f(change, before.w);
    }
}
