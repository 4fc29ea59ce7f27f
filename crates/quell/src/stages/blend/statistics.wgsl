// Twin of `pooled` of reference.rs: what is known of the noise at every pixel, for a workgroup of 8x8 pixels. Values of the pixels
// around lie in workgroup memory, four kinds at a time, and are summed along rows, then along columns.
//
// The pass supplies `input_at`, `picture_at`, `steady_at`, `brightness_at`, `followed_at` (mean of the differences over time and their
// change) and `known_at` (share of frames seen, outliers, silhouette).

// Pooled statistics of a pixel. All relative to the squared brightness.
struct Pooled {
    // Near and wide: noise over time, share of neighbours seen, noise over space, detail and noise of the input together.
    over_time: vec2f,
    seen: vec2f,
    over_space: vec2f,
    input: vec2f,
    // Second differences along the direction in which they are least, of the input and of input less wavelet.
    along: vec2f,
    // Input to wavelet, input to stabilised, wavelet to stabilised.
    apart_near: vec3f,
    apart_wide: vec3f,
    // Of the stabilised picture and of the wavelet's.
    detail: vec2f,
    // Squared means of differences.
    mean: vec3f,
    silhouette: f32,
}

// Four values of a pixel that are pooled together.
const NOISE_VALUES = 0u;
const INPUT_ALONG = 1u;
const WAVELET_ALONG = 2u;
const APART_VALUES = 3u;
const DETAIL_VALUES = 4u;
const WAVELET_MEAN = 5u;
const STEADY_MEAN = 6u;
const TIME_MEAN = 7u;

const TILE = 8u;
const AROUND = u32(NOISE_WIDE);
const WIDE_TILE = TILE + 2u * AROUND;
var<workgroup> values: array<vec4f, WIDE_TILE * WIDE_TILE>;
var<workgroup> near_rows: array<vec4f, WIDE_TILE * TILE>;
var<workgroup> wide_rows: array<vec4f, WIDE_TILE * TILE>;

fn wavelet_at(q: vec2i) -> vec3f {
    return relative_to(input_at(q) - picture_at(q), brightness_at(q));
}

// Input less wavelet, and the input, each less its binomial mean over 3x3.
struct HighPass {
    wavelet: vec3f,
    input: vec3f,
}

fn high_pass(pixel: vec2i) -> HighPass {
    var high = HighPass(wavelet_at(pixel), input_at(pixel));
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let share = 0.0625 * f32((2 - abs(dx)) * (2 - abs(dy)));
            let q = clamped(pixel + vec2i(dx, dy));
            let input = input_at(q);
            high.wavelet -= share * relative_to(input - picture_at(q), brightness_at(q));
            high.input -= share * input;
        }
    }
    return high;
}

// The same of the stabilised picture and of the wavelet's, squared, relative to a brightness.
fn details(pixel: vec2i, bright: f32) -> vec2f {
    var steady = steady_at(pixel);
    var picture = picture_at(pixel);
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let share = 0.0625 * f32((2 - abs(dx)) * (2 - abs(dy)));
            let q = clamped(pixel + vec2i(dx, dy));
            steady -= share * steady_at(q);
            picture -= share * picture_at(q);
        }
    }
    return vec2f(squared(relative_to(steady, bright)), squared(relative_to(picture, bright)));
}

// Squared second difference along a direction, relative to the middle's brightness, and of input less wavelet, each relative to its own.
fn second_difference(pixel: vec2i, step: vec2i, of_input: bool) -> f32 {
    let before = clamped(pixel - step);
    let after = clamped(pixel + step);
    var d: vec3f;
    if of_input {
        d = relative_to(input_at(before) - 2.0 * input_at(pixel) + input_at(after), brightness_at(pixel));
    } else {
        d = wavelet_at(before) - 2.0 * wavelet_at(pixel) + wavelet_at(after);
    }
    return squared(d) / SECOND_DIFFERENCE;
}

fn second_differences(pixel: vec2i, of_input: bool) -> vec4f {
    return vec4f(
        second_difference(pixel, vec2i(1, 0), of_input),
        second_difference(pixel, vec2i(0, 1), of_input),
        second_difference(pixel, vec2i(1, 1), of_input),
        second_difference(pixel, vec2i(1, -1), of_input),
    );
}

fn values_of(kind: u32, q: vec2i) -> vec4f {
    let bright = brightness_at(q);
    switch kind {
        case NOISE_VALUES: {
            let high = high_pass(q);
            let root = min(sqrt(followed_at(q).w) / bright, MOST_RELATIVE);
            let input = squared(relative_to(high.input, bright));
            return vec4f(root * root, known_at(q).x, squared(high.wavelet) / HIGH_PASS, input / HIGH_PASS);
        }
        case INPUT_ALONG: { return second_differences(q, true); }
        case WAVELET_ALONG: { return second_differences(q, false); }
        case APART_VALUES: {
            let input = input_at(q);
            let picture = picture_at(q);
            let steady = steady_at(q);
            return vec4f(
                squared(relative_to(input - picture, bright)),
                squared(relative_to(input - steady, bright)),
                squared(relative_to(picture - steady, bright)),
                0.0,
            );
        }
        case DETAIL_VALUES: { return vec4f(details(q, bright), 0.0, 0.0); }
        case WAVELET_MEAN: { return vec4f(wavelet_at(q), 0.0); }
        case STEADY_MEAN: { return vec4f(relative_to(input_at(q) - steady_at(q), bright), 0.0); }
        default: { return vec4f(relative_to(followed_at(q).xyz, bright), 0.0); }
    }
}

// Pixels of the picture within `radius` of a pixel.
fn pixels_around(pixel: vec2i, radius: i32) -> f32 {
    let first = max(pixel - radius, vec2i(0));
    let last = min(pixel + radius, vec2i(settings.size) - 1);
    let extent = last - first + 1;
    return f32(extent.x * extent.y);
}

// Means of four values over windows of two radii, of the pixel at `local` of the workgroup. All of the workgroup call it together.
fn means(kind: u32, pixel: vec2i, local: vec2u, near: i32, wide: i32) -> array<vec4f, 2> {
    let origin = pixel - vec2i(local) - NOISE_WIDE;
    let index = local.y * TILE + local.x;
    workgroupBarrier();
    for (var i = index; i < WIDE_TILE * WIDE_TILE; i += TILE * TILE) {
        let q = origin + vec2i(i32(i % WIDE_TILE), i32(i / WIDE_TILE));
        var value = vec4f(0.0);
        if contains(q) {
            value = values_of(kind, q);
        }
        values[i] = value;
    }
    workgroupBarrier();
    for (var i = index; i < WIDE_TILE * TILE; i += TILE * TILE) {
        let middle = (i / TILE) * WIDE_TILE + i % TILE + AROUND;
        var near_sum = vec4f(0.0);
        var wide_sum = vec4f(0.0);
        for (var d = -wide; d <= wide; d++) {
            let value = values[u32(i32(middle) + d)];
            wide_sum += value;
            if abs(d) <= near {
                near_sum += value;
            }
        }
        near_rows[i] = near_sum;
        wide_rows[i] = wide_sum;
    }
    workgroupBarrier();
    var near_sum = vec4f(0.0);
    var wide_sum = vec4f(0.0);
    for (var d = -wide; d <= wide; d++) {
        let i = u32(i32(local.y + AROUND) + d) * TILE + local.x;
        wide_sum += wide_rows[i];
        if abs(d) <= near {
            near_sum += near_rows[i];
        }
    }
    return array<vec4f, 2>(near_sum / pixels_around(pixel, near), wide_sum / pixels_around(pixel, wide));
}

fn least_of(v: vec4f) -> f32 {
    return min(min(v.x, v.y), min(v.z, v.w));
}

// Noise of the input: squared, relative to the brightness.
fn noise_of(p: Pooled, wide: u32) -> f32 {
    let space = min(p.over_space[wide], p.input[wide]);
    let known = p.seen[wide] > LEAST_SEEN;
    return max(select(space, min(p.over_time[wide] / max(p.seen[wide], LEAST_SEEN), space), known), BLEND_LEAST);
}

// The least that the noise near the pixel may be.
fn least_noise(p: Pooled) -> f32 {
    let input = min(p.along.x, p.input.x);
    return max(min(max(min(noise_of(p, 0u), p.along.y), settings.guard_input * input), input), BLEND_LEAST);
}

fn ratio(v: f32, of_noise: f32) -> f32 {
    return clamp(log2_of(max(v, BLEND_LEAST)) - of_noise, -MOST_RATIO, MOST_RATIO);
}

fn time_noise(p: Pooled, wide: u32) -> f32 {
    return select(p.over_space[wide], p.over_time[wide] / max(p.seen[wide], LEAST_SEEN), p.seen[wide] > LEAST_SEEN);
}

// What the nets read of them.
fn inputs_of(p: Pooled) -> array<f32, 17> {
    let of_noise = log2_of(noise_of(p, 1u));
    return array<f32, 17>(
        ratio(time_noise(p, 0u), of_noise),
        ratio(time_noise(p, 1u), of_noise),
        ratio(p.over_space.x, of_noise),
        ratio(p.over_space.y, of_noise),
        ratio(p.apart_near.x, of_noise),
        ratio(p.apart_near.y, of_noise),
        ratio(p.apart_near.z, of_noise),
        ratio(p.apart_wide.x, of_noise),
        ratio(p.apart_wide.y, of_noise),
        ratio(p.apart_wide.z, of_noise),
        ratio(p.detail.x, of_noise),
        ratio(p.detail.y, of_noise),
        ratio(p.mean.x, of_noise),
        ratio(p.mean.y, of_noise),
        ratio(p.mean.z, of_noise),
        p.seen.x,
        p.silhouette,
    );
}
