// The variance of a light's mean, pooled over the surface around each pixel: twin of variance.rs.

// A light's mean, and as the fourth number the variance of one sample's luminance.
@group(0) @binding(5) var<storage, read> light: array<vec4f>;
// The samples that the means of four planes are worth.
@group(0) @binding(6) var<storage, read> counts: array<vec4f>;
// Variance that the renderer gave, in units of the light; below 0: unknown.
@group(0) @binding(7) var<storage, read> given: array<f32>;
// The mean, and the variance of its luminance.
@group(0) @binding(8) var<storage, read_write> pooled: array<vec4f>;

@compute @workgroup_size(8, 8)
fn variance(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = index_of(pixel);
    let here = guides_at(p);
    let radius = level.radius;
    // Pooled spread, its degrees of freedom, and the moments of the means with their weight.
    var spread = 0.0;
    var freedom = 0.0;
    var first = 0.0;
    var second = 0.0;
    var total = 0.0;
    for (var dy = -radius; dy <= radius; dy++) {
        for (var dx = -radius; dx <= radius; dx++) {
            let offset = vec2i(dx, dy);
            if !contains(pixel + offset) {
                continue;
            }
            let q = index_of(pixel + offset);
            var e = 0.0;
            if q != p {
                e = energy(here, guides_at(q), vec2f(offset), level);
            }
            let g = weight(e);
            let free = g * max(counts[q][level.place] - 1.0, 0.0);
            let colour = light[q];
            let mean = luminance(colour.xyz);
            spread += free * colour.w;
            freedom += free;
            first += g * mean;
            second += g * mean * mean;
            total += g;
        }
    }
    let count = counts[p][level.place];
    var over_time = 0.0;
    if freedom > 0.0 {
        over_time = spread / freedom;
    }
    let mean = first / total;
    var otherwise = max(second / total - mean * mean, 0.0) * count;
    if level.given != 0u && given[p] >= 0.0 {
        otherwise = given[p];
    }
    let trust = min(freedom / level.trusted_samples, 1.0);
    pooled[p] = vec4f(light[p].xyz, (over_time * trust + otherwise * (1.0 - trust)) / max(count, 1.0));
}
