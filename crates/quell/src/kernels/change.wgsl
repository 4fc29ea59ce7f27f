// Twin of change.rs: where light has changed. beside.wgsl says how the fast history is kept.

// Where an invocation stands: its pixel, its workgroup, its number in that.
struct Invocation {
    pixel: vec2i,
    workgroup: vec2u,
    invocation: u32,
}

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

// Cells around a workgroup: each of its invocations sums one. `changed_light.radius` is at most 3, and a workgroup touches two cells along
// an axis where it does not begin with one.
const CELLS: i32 = 8;
var<workgroup> cells: array<vec4f, CELLS * CELLS>;

// The place in the frame before, in pixels of the whole picture, that has a pixel's place in this one.
fn place_before(pixel: vec2i) -> vec2f {
    return to_before(vec2f(pixel) + 0.5) + vec2f(frame.origin) - 0.5;
}

// G, G s, G f and G v of a cell.
fn cell_at(blend: Blend, cell: vec2i, history: texture_2d<f32>, history_length: texture_2d<f32>) -> vec4f {
    let first = own_pixel(cell * CHANGE_CELL);
    // Sums of g and g n; of g x and g x^2, x the differences of S and of F - S to the first tap's: nothing cancels.
    var weights = vec2f(0.0);
    var about = vec2f(0.0);
    var once = vec2f(0.0);
    var twice = vec2f(0.0);
    for (var dy = 0; dy < CHANGE_CELL; dy += blend.change_spacing) {
        for (var dx = 0; dx < CHANGE_CELL; dx += blend.change_spacing) {
            let q = first + vec2i(dx, dy);
            if !contains_before(q) {
                continue;
            }
            let texel = textureLoad(history_length, q, 0).x;
            let fast = fast_beside(texel);
            let frames = change_frames(blend, length_beside(texel));
            let g = change_weight(blend, frames);
            if g > 0.0 && fast >= 0.0 {
                let long = luminance(textureLoad(history, q, 0).xyz);
                let light = vec2f(long, fast - long);
                if weights.x == 0.0 {
                    about = light;
                }
                weights += g * vec2f(1.0, frames);
                once += g * (light - about);
                twice += g * (light - about) * (light - about);
            }
        }
    }
    if weights.x <= 0.0 {
        return vec4f(0.0);
    }
    let mean = once / weights.x;
    let spread = max(twice / weights.x - mean * mean, vec2f(0.0));
    let noise = max(spread.y, spread.x * (weights.y / weights.x / blend.fast_frames));
    let long = about.x + mean.x;
    return weights.x * vec4f(1.0, long, long + about.y + mean.y, noise);
}

// t: along each axis the weight of a cell whose centre lies so far off.
fn tent(blend: Blend, distance: vec2f) -> vec2f {
    return max(1.0 - abs(distance) * (1.0 / f32(CHANGE_CELL * blend.change_radius)), vec2f(0.0));
}

// c, 0..1, of a pixel of this frame. All invocations of a workgroup of 8x8 pixels come here together.
fn changed_light(blend: Blend, here: Invocation, history: texture_2d<f32>, history_length: texture_2d<f32>) -> f32 {
    if !looks_for_change(blend) {
        return 0.0;
    }
    let corner = vec2i(floor(place_before(vec2i(here.workgroup) * 8) + 0.5));
    let first = corner / CHANGE_CELL - blend.change_radius;
    // The other signal's may still be read.
    workgroupBarrier();
    let own = vec2i(i32(here.invocation) % CELLS, i32(here.invocation) / CELLS);
    cells[here.invocation] = cell_at(blend, first + own, history, history_length);
    workgroupBarrier();
    let place = place_before(here.pixel);
    var sums = vec4f(0.0);
    for (var k = 0; k < CELLS * CELLS; k++) {
        let centre = vec2f((first + vec2i(k % CELLS, k / CELLS)) * CHANGE_CELL) + f32(CHANGE_CELL - 1) / 2.0;
        let along = tent(blend, centre - place);
        let w = along.x * along.y;
        sums += vec4f(w, w, w, w * w) * cells[k];
    }
    if sums.x < CHANGE_LEAST_TAPS {
        return 0.0;
    }
    let mean = sums.yz / sums.x;
    let least = blend.change_least * (mean.x + mean.y);
    let variance = sums.w / (sums.x * sums.x) + least * least + CHANGE_LEAST_VARIANCE;
    let deviations = abs(mean.y - mean.x) / sqrt(variance);
    return clamp((deviations - blend.change_begin) * blend.change_slope, 0.0, 1.0);
}

// The history length at the place that was looked up, shortened where light has changed by c.
fn frames_left(
    blend: Blend,
    found: Lookup,
    changed: f32,
    history: texture_2d<f32>,
    history_length: texture_2d<f32>,
) -> f32 {
    if !looks_for_change(blend) {
        return fetch_length(found, history_length);
    }
    if found.trust <= 0.0 {
        return 0.0;
    }
    let length = fetch_both(found, history, history_length).x;
    let own = min(CHANGE_OWN * change_weight(blend, change_frames(blend, length)), 1.0);
    return length * (1.0 - changed * own);
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
