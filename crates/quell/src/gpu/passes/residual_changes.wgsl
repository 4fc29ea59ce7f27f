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
    let around = smoothed(cell);
    var noise = around.noise;
    if settings.begins == 0u {
        noise = coarse[holding(settings.first_row, cell.y) * settings.coarse_cells + holding(0, cell.x)].w;
    }
    changes[cell.y * settings.cells.x + cell.x] = vec4f(change_of(around.sums, noise), noise);
}
