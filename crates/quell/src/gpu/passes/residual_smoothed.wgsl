// Sums around a cell, smoothed by the triangle; the mean of the cells' own noise.
struct Smoothed {
    sums: Sums,
    noise: f32,
}

fn smoothed(cell: vec2i) -> Smoothed {
    var sums = Sums(vec3f(0.0), vec3f(0.0), vec3f(0.0));
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
            sums.light += k * light.xyz;
            sums.residual += k * cell_residual[i].xyz;
            sums.squared += k * cell_squared[i].xyz;
            around += k * light.w;
            whole += k;
        }
    }
    return Smoothed(sums, around / whole);
}
