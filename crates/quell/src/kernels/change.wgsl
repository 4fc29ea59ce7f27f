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

// Cells around a workgroup, of which each of its first invocations sums one. `changed_light.radius` is at most 3, and a workgroup of 16x16
// pixels touches three cells along an axis where it does not begin with one.
const GROUP: i32 = 16;
const CELLS: i32 = 9;
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

// t: along an axis the weights of four cells, at the least 0, whose centres lie so far off.
fn tent(blend: Blend, distance: vec4f) -> vec4f {
    return max(1.0 - abs(distance) * (1.0 / f32(CHANGE_CELL * blend.change_radius)), vec4f(0.0));
}

// What a cell of weight w adds.
fn weighed_cell(w: f32, k: i32) -> vec4f {
    return vec4f(w, w, w, w * w) * cells[k];
}

// c, 0..1, of a pixel of this frame. All invocations of a workgroup come here together.
fn changed_light(blend: Blend, here: Invocation, history: texture_2d<f32>, history_length: texture_2d<f32>) -> f32 {
    if !looks_for_change(blend) {
        return 0.0;
    }
    let corner = vec2i(floor(place_before(vec2i(here.workgroup) * GROUP) + 0.5));
    let first = corner / CHANGE_CELL - blend.change_radius;
    // The other signal's may still be read.
    workgroupBarrier();
    let own = vec2i(i32(here.invocation) % CELLS, i32(here.invocation) / CELLS);
    if own.y < CELLS {
        cells[here.invocation] = cell_at(blend, first + own, history, history_length);
    }
    workgroupBarrier();
    let place = place_before(here.pixel);
    let middle = vec2f(first * CHANGE_CELL) + f32(CHANGE_CELL - 1) / 2.0 - place;
    let columns = vec4f(0.0, 1.0, 2.0, 3.0) * f32(CHANGE_CELL) + middle.x;
    let left = tent(blend, columns);
    let right = tent(blend, columns + 4.0 * f32(CHANGE_CELL));
    let last = tent(blend, columns + 8.0 * f32(CHANGE_CELL)).x;
    var sums = vec4f(0.0);
    for (var row = 0; row < CELLS; row++) {
        let along = tent(blend, vec4f(f32(row * CHANGE_CELL) + middle.y)).x;
        if along > 0.0 {
            let k = row * CELLS;
            sums += weighed_cell(left.x * along, k);
            sums += weighed_cell(left.y * along, k + 1);
            sums += weighed_cell(left.z * along, k + 2);
            sums += weighed_cell(left.w * along, k + 3);
            sums += weighed_cell(right.x * along, k + 4);
            sums += weighed_cell(right.y * along, k + 5);
            sums += weighed_cell(right.z * along, k + 6);
            sums += weighed_cell(right.w * along, k + 7);
            sums += weighed_cell(last * along, k + 8);
        }
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
    return share_of_both(history, history_length, footprint_pixel(found.first, 0), found.weight.x)
        + share_of_both(history, history_length, footprint_pixel(found.first, 1), found.weight.y)
        + share_of_both(history, history_length, footprint_pixel(found.first, 2), found.weight.z)
        + share_of_both(history, history_length, footprint_pixel(found.first, 3), found.weight.w);
}

fn share_of_both(history: texture_2d<f32>, history_length: texture_2d<f32>, pixel: vec2i, weight: f32) -> vec2f {
    if !(weight > 0.0) {
        return vec2f(0.0);
    }
    let texel = textureLoad(history_length, pixel, 0).x;
    var fast = fast_beside(texel);
    if fast < 0.0 {
        fast = kept_light(textureLoad(history, pixel, 0).xyz);
    }
    return weight * vec2f(length_beside(texel), fast);
}
