// Twin of reference.rs: stage 2 of the sequence filter, the variance of a light's mean, pooled over the surface around
// each pixel.
//
// The pass supplies `features_at`, `light_at` (mean, and the variance of one sample's luminance), `count_at` (samples that
// the mean is worth) and `given_at` (the variance that the renderer gave; below 0: unknown).

// Spread of the means over 3x3 pixels, whatever they show.
fn spread_around(pixel: vec2i) -> f32 {
    var first = 0.0;
    var second = 0.0;
    var total = 0.0;
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            if contains(pixel + vec2i(dx, dy)) {
                let mean = luminance(light_at(index_of(pixel + vec2i(dx, dy))).xyz);
                first += mean;
                second += mean * mean;
                total += 1.0;
            }
        }
    }
    let mean = first / total;
    return max(second / total - mean * mean, 0.0);
}

// The variance of the mean's luminance at a pixel.
fn pooled_variance(pixel: vec2i) -> f32 {
    let p = index_of(pixel);
    let here = features_at(p);
    let radius = settings.radius;
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
            var distance = 0.0;
            if q != p {
                distance = guide_distance(here, features_at(q), vec2f(offset), settings.stops);
            }
            let g = weight(distance);
            let free = g * max(count_at(q) - 1.0, 0.0);
            let colour = light_at(q);
            let mean = luminance(colour.xyz);
            spread += free * colour.w;
            freedom += free;
            first += g * mean;
            second += g * mean * mean;
            total += g;
        }
    }
    let count = count_at(p);
    var over_time = 0.0;
    if freedom > 0.0 {
        over_time = spread / freedom;
    }
    let mean = first / total;
    var otherwise = max(second / total - mean * mean, 0.0) * count;
    if total - 1.0 < settings.least_window {
        otherwise += (1.0 - (total - 1.0) / settings.least_window) * spread_around(pixel) * count;
    }
    let given = given_at(p);
    if given >= 0.0 {
        otherwise = given;
    }
    let trust = min(freedom / settings.trusted_samples, 1.0);
    return (over_time * trust + otherwise * (1.0 - trust)) / max(count, 1.0);
}
