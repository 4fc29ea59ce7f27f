// Sums of a cell, one cell an invocation.
@compute @workgroup_size(8, 8)
fn sum_cells(@builtin(global_invocation_id) id: vec3u) {
    let cell = vec2i(id.xy);
    if !all(cell < settings.cells) {
        return;
    }
    var sums = Sums(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    let first = cell * settings.side - vec2i(0, settings.first_row % settings.side);
    for (var y = 0; y < settings.side; y++) {
        for (var x = 0; x < settings.side; x++) {
            let pixel = first + vec2i(x, y);
            if contains(pixel) {
                let light = filtered[index_of(pixel)].xyz;
                let residual = own_at(pixel) - light;
                sums.light += light;
                sums.residual += residual;
                sums.squared += residual * residual;
            }
        }
    }
    let i = u32(cell.y * settings.cells.x + cell.x);
    cell_light[i] = vec4f(sums.light, relative_noise(sums));
    cell_residual[i] = vec4f(sums.residual, 0.0);
    cell_squared[i] = vec4f(sums.squared, 0.0);
}
