// Twin of change.rs: where light has changed. beside.wgsl says how the fast history is kept.

// What the fast history keeps of a colour.
fn kept_light(colour: vec3f) -> f32 {
    return clamp(luminance(colour), 0.0, CHANGE_MOST_LIGHT);
}

// The fast history of such a texel; negative: there is none.
fn fast_beside(texel: f32) -> f32 {
    let code = bitcast<u32>(texel) & CODE_BITS;
    if code < 2u {
        return f32(code) - 1.0;
    }
    return bitcast<f32>((code + (CHANGE_DARKEST - 1u)) << 18u);
}

// Both in one, each rounded to nearest.
fn beside(length: f32, fast: f32) -> f32 {
    let frames = bitcast<u32>(length);
    let light = bitcast<u32>(fast);
    let upper = (light + 0x1ffffu + ((light >> 18u) & 1u)) >> 18u;
    let code = max(upper, CHANGE_DARKEST) - (CHANGE_DARKEST - 1u);
    return bitcast<f32>(((frames + 0x3ffu + ((frames >> 11u) & 1u)) & LENGTH_BITS) | code);
}

// Frames of a pixel's long mean.
fn change_frames(blend: Blend, length: f32) -> f32 {
    return min(length, blend.long_frames);
}

// The weight of a tap whose long mean has so many frames.
fn change_weight(blend: Blend, frames: f32) -> f32 {
    return max(1.0 - blend.fast_frames / frames, 0.0);
}

// c, 0..1, of a pixel of the frame before.
fn changed_light(blend: Blend, pixel: vec2i, history: texture_2d<f32>, history_length: texture_2d<f32>) -> f32 {
    let own = textureLoad(history_length, pixel, 0).x;
    let own_fast = fast_beside(own);
    if change_weight(blend, change_frames(blend, length_beside(own))) <= 0.0 || own_fast < 0.0 {
        return 0.0;
    }
    let centre = vec2f(luminance(textureLoad(history, pixel, 0).xyz), own_fast);
    // Sums of g, g^2 and g n; of g x and g x^2, x both means' differences to the centre's: nothing cancels.
    var weights = vec3f(0.0);
    var first = vec2f(0.0);
    var second = vec2f(0.0);
    for (var dy = -blend.change_radius; dy <= blend.change_radius; dy++) {
        for (var dx = -blend.change_radius; dx <= blend.change_radius; dx++) {
            let q = pixel + vec2i(dx, dy) * blend.change_spacing;
            if !contains_before(q) {
                continue;
            }
            let texel = textureLoad(history_length, q, 0).x;
            let frames = change_frames(blend, length_beside(texel));
            let g = change_weight(blend, frames);
            if g > 0.0 {
                let x = vec2f(luminance(textureLoad(history, q, 0).xyz), max(fast_beside(texel), 0.0)) - centre;
                weights += g * vec3f(1.0, g, frames);
                first += g * x;
                second += g * x * x;
            }
        }
    }
    if weights.x < CHANGE_LEAST_TAPS {
        return 0.0;
    }
    let mean = first / weights.x;
    let spread = max(second / weights.x - mean * mean, vec2f(0.0));
    let noise = max(spread.y, spread.x * (weights.z / weights.x / blend.fast_frames));
    let least = blend.change_least * (centre.x + mean.x + centre.y + mean.y);
    let variance = noise * weights.y / (weights.x * weights.x) + least * least + CHANGE_LEAST_VARIANCE;
    let deviations = abs(centre.y + mean.y - centre.x - mean.x) / sqrt(variance);
    return clamp((deviations - blend.change_begin) * blend.change_slope, 0.0, 1.0);
}

// The pixel of a lookup that counts most, the first of equals.
fn nearest_of(found: Lookup) -> vec2i {
    var lookup = found;
    var best = 0;
    for (var k = 1; k < 4; k++) {
        if lookup.weight[k] > lookup.weight[best] {
            best = k;
        }
    }
    return lookup.pixel[best];
}

// The history length at the place that was looked up, shortened where light has changed.
fn frames_left(blend: Blend, found: Lookup, history: texture_2d<f32>, history_length: texture_2d<f32>) -> f32 {
    if !looks_for_change(blend) {
        return fetch_length(found, history_length);
    }
    if found.trust <= 0.0 {
        return 0.0;
    }
    let length = fetch_both(found, history, history_length).x;
    return length * (1.0 - changed_light(blend, nearest_of(found), history, history_length));
}

// Weighted means of the history length and of the fast history, for which the long one serves where there is none.
fn fetch_both(found: Lookup, history: texture_2d<f32>, history_length: texture_2d<f32>) -> vec2f {
    var lookup = found;
    var sum = vec2f(0.0);
    for (var k = 0; k < 4; k++) {
        if lookup.weight[k] > 0.0 {
            let texel = textureLoad(history_length, lookup.pixel[k], 0).x;
            var fast = fast_beside(texel);
            if fast < 0.0 {
                fast = kept_light(textureLoad(history, lookup.pixel[k], 0).xyz);
            }
            sum += lookup.weight[k] * vec2f(length_beside(texel), fast);
        }
    }
    return sum;
}
