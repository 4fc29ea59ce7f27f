// What cells are multiplied by, less 1; in the coarsest level also the noise around them, which finer ones read.

// The cell of the coarsest level that holds cell `at`.
fn holding(first: i32, at: i32) -> i32 {
    return (first / settings.side + at) * settings.side / RESIDUAL_COARSEST - first / RESIDUAL_COARSEST;
}

@compute @workgroup_size(8, 8)
fn find_changes(@builtin(global_invocation_id) id: vec3u) {
    let cell = vec2i(id.xy);
    if !all(cell < settings.cells) {
        return;
    }
    var smooth_sums = Sums(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    var around = 0.0;
    var whole = 0.0;
    for (var dy = -settings.reach; dy <= settings.reach; dy++) {
        for (var dx = -settings.reach; dx <= settings.reach; dx++) {
            let q = cell + vec2i(dx, dy);
            if any(q < vec2i(0)) || any(q >= settings.cells) {
                continue;
            }
            let i = u32(q.y * settings.cells.x + q.x);
            let k = triangle(abs(dx)) * triangle(abs(dy));
            let light = cell_light[i];
            smooth_sums.light += k * light.xyz;
            smooth_sums.residual += k * cell_residual[i].xyz;
            smooth_sums.squared += k * cell_squared[i].xyz;
            around += k * light.w;
            whole += k;
        }
    }
    var noise = around / whole;
    if settings.begins == 0u {
        noise = coarse[holding(settings.first_row, cell.y) * settings.coarse_cells + holding(0, cell.x)].w;
    }
    changes[cell.y * settings.cells.x + cell.x] = vec4f(change_of(smooth_sums, noise), noise);
}
