// Stage 3, one level for one light: twin of wavelet.rs. Every image holds a light's colour and, as the fourth number,
// the variance of its luminance.

@group(0) @binding(5) var<storage, read> light: array<vec4f>;
// Mean luminance over 3x3 of the same surface, and its variance.
@group(0) @binding(6) var<storage, read_write> compared: array<vec2f>;
@group(0) @binding(7) var<storage, read_write> filtered: array<vec4f>;

// Half of the B3 spline's kernel, from the centre outwards.
const SPLINE = vec3f(0.375, 0.25, 0.0625);
// Luminances of one pixel that differ by less than this share do not differ.
const LEAST_CONTRAST = 1e-3;

@compute @workgroup_size(8, 8)
fn compare(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = index_of(pixel);
    let here = guides_at(p);
    var total = 0.0;
    var mean = 0.0;
    var spread = 0.0;
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let offset = vec2i(dx, dy);
            if !contains(pixel + offset) {
                continue;
            }
            let q = index_of(pixel + offset);
            var e = 0.0;
            if q != p {
                e = energy(here, guides_at(q), vec2f(offset), level);
            }
            let share = f32((2 - abs(dx)) * (2 - abs(dy)));
            let g = share * weight(e);
            let colour = light[q];
            total += g;
            mean += g * luminance(colour.xyz);
            spread += g * g * colour.w;
        }
    }
    compared[p] = vec2f(mean / total, spread / (total * total));
}

@compute @workgroup_size(8, 8)
fn filter_level(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = index_of(pixel);
    let here = guides_at(p);
    let mean = compared[p];
    let squared = select(level.tolerance, level.mirror_tolerance, here.colour.w > 0.0);
    let contrast = LEAST_CONTRAST * mean.x;
    var total = 0.0;
    var sum = vec4f(0.0);
    for (var dy = -2; dy <= 2; dy++) {
        for (var dx = -2; dx <= 2; dx++) {
            let offset = vec2i(dx, dy) * level.step;
            if !contains(pixel + offset) {
                continue;
            }
            let q = index_of(pixel + offset);
            var w = SPLINE[abs(dx)] * SPLINE[abs(dy)];
            if q != p {
                let there = compared[q];
                let d = mean.x - there.x;
                let v = mean.y + there.y;
                // As energies go, 1e24 over 1e-12 is far enough and finite.
                let beyond = clamp(d * d - v, 0.0, 1e24);
                let stop = beyond / (squared * v + contrast * contrast + 1e-12);
                w *= weight(energy(here, guides_at(q), vec2f(offset), level) + stop);
            }
            let colour = light[q];
            total += w;
            sum += vec4f(w * colour.xyz, w * w * colour.w);
        }
    }
    let scale = 1.0 / total;
    filtered[p] = vec4f(scale * sum.xyz, scale * scale * sum.w);
}
