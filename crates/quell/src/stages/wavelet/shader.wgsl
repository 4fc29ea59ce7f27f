// Twin of reference.rs: stage 3 of the sequence filter, one level for one light.
//
// The pass supplies `features_at`, `light_at` (a colour, and the variance of the light's luminance) and `compared_at` (what
// `compared_mean` made: a mean, its variance, and the luminance stop squared).

// Differences of luminance, squared, that are beyond any stop, and finite over LEAST_VARIANCE.
const MOST_DIFFERENCE: f32 = 1e24;

// The luminance stop squared, where the compared mean is `mean` with that variance: low where there is little noise.
fn stop_by_noise(squared: f32, mean: f32, variance: f32) -> f32 {
    let low = min(settings.low_tolerance, squared);
    let scale = settings.low_noise * mean;
    return low + (squared - low) * variance / (variance + scale * scale + LEAST_VARIANCE);
}

// How far a pixel counts in the compared mean of another: not where their luminances differ by more than their variances explain.
fn same_light(difference: f32, variance: f32) -> f32 {
    let most = settings.mean_step * variance + LEAST_VARIANCE;
    return clamp(2.0 - min(difference * difference, MOST_DIFFERENCE) / most, 0.0, 1.0);
}

// Mean luminance over 3x3 pixels of the same surface, and its variance. The stop is that of the first level.
fn compared_mean(pixel: vec2i) -> vec4f {
    let p = index_of(pixel);
    let here = features_at(p);
    let own = light_at(p);
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
            var distance = 0.0;
            if q != p {
                distance = guide_distance(here, features_at(q), vec2f(offset), settings.stops);
            }
            let colour = light_at(q);
            let value = luminance(colour.xyz);
            let g = TENT[abs(dx)] * TENT[abs(dy)] * weight(distance) * same_light(value - luminance(own.xyz), colour.w + own.w);
            total += g;
            mean += g * value;
            spread += g * g * colour.w;
        }
    }
    mean /= total;
    spread /= total * total;
    var stop = compared_at(p).z;
    if settings.step == 1 {
        let squared = select(settings.tolerance, settings.mirror_tolerance, here.colour.w > 0.0);
        stop = stop_by_noise(squared, mean, spread);
    }
    return vec4f(mean, spread, stop, 0.0);
}

// The colour after this level, and the variance of the light's luminance.
fn filtered_level(pixel: vec2i) -> vec4f {
    let p = index_of(pixel);
    let here = features_at(p);
    let mean = compared_at(p);
    let contrast = settings.least_contrast * mean.x;
    var total = 0.0;
    var sum = vec4f(0.0);
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let offset = vec2i(dx, dy) * settings.step;
            if !contains(pixel + offset) {
                continue;
            }
            let q = index_of(pixel + offset);
            var w = TENT[abs(dx)] * TENT[abs(dy)];
            if q != p {
                let there = compared_at(q);
                let d = mean.x - there.x;
                let v = settings.correlation * (mean.y + min(there.y, settings.variance_ratio * mean.y));
                let beyond = clamp(d * d - v, 0.0, MOST_DIFFERENCE);
                let stop = beyond / (mean.z * v + contrast * contrast + LEAST_VARIANCE);
                w *= weight(guide_distance(here, features_at(q), vec2f(offset), settings.stops) + stop);
            }
            let colour = light_at(q);
            total += w;
            sum += vec4f(w * colour.xyz, w * w * colour.w);
        }
    }
    let scale = 1.0 / total;
    return vec4f(scale * sum.xyz, scale * scale * sum.w);
}
