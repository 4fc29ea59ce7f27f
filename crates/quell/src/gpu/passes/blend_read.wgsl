// What the net of `blend` reads of every pixel, and its first layer, which reads no other.
fn steady_at(q: vec2i) -> vec3f {
    return steady[index_of(q)].xyz;
}

fn inverse_depth_of(there: WindowFrame, pixel: vec2i) -> f32 {
    return textureLoad(surfaces, pixel, there.layer, 0).x;
}

// How 1 / depth differs from its mean over 5x5, relative to the sum of both.
fn depth_step(pixel: vec2i) -> f32 {
    let here = frame_at(settings.centre);
    var sum = 0.0;
    var count = 0.0;
    for (var dy = -NOISE_NEAR; dy <= NOISE_NEAR; dy++) {
        for (var dx = -NOISE_NEAR; dx <= NOISE_NEAR; dx++) {
            let q = pixel + vec2i(dx, dy);
            if contains(q) {
                sum += inverse_depth_of(here, q);
                count += 1.0;
            }
        }
    }
    let around = sum / count;
    let own = inverse_depth_of(here, pixel);
    let both = own + around;
    return select(0.0, (own - around) / both, both > 0.0);
}

fn relative(colour: vec3f, bright: f32) -> vec3f {
    let v = colour / bright;
    return v / (1.0 + abs(v));
}

fn leaky(v: vec4f) -> vec4f {
    return select(v, CONV_LEAK * v, v < vec4f(0.0));
}

var<private> hidden: array<vec4f, 4>;

// Adds what input `i` brings, made standard.
fn add(i: u32, value: f32) {
    let at = 4u + 5u * i;
    let standard = clamp((value - weights[at].x) * weights[at].y, -MOST_INPUT, MOST_INPUT);
    hidden[0] += weights[at + 1u] * standard;
    hidden[1] += weights[at + 2u] * standard;
    hidden[2] += weights[at + 3u] * standard;
    hidden[3] += weights[at + 4u] * standard;
}

fn add_three(i: u32, value: vec3f) {
    add(i, value.x);
    add(i + 1u, value.y);
    add(i + 2u, value.z);
}

@compute @workgroup_size(8, 8)
fn read_by_net(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let pixel = vec2i(id.xy);
    let noise = means(NOISE_VALUES, pixel, local.xy, NOISE_NEAR, NOISE_WIDE);
    let input_along = means(INPUT_ALONG, pixel, local.xy, NOISE_NEAR, NOISE_NEAR);
    let wavelet_along = means(WAVELET_ALONG, pixel, local.xy, NOISE_NEAR, NOISE_NEAR);
    let apart = means(APART_VALUES, pixel, local.xy, DIFFERENCES_NEAR, DIFFERENCES_WIDE);
    let detail = means(DETAIL_VALUES, pixel, local.xy, DIFFERENCES_NEAR, DIFFERENCES_NEAR);
    let wavelet = means(WAVELET_MEAN, pixel, local.xy, NOISE_NEAR, NOISE_NEAR);
    let stabilised = means(STEADY_MEAN, pixel, local.xy, NOISE_NEAR, NOISE_NEAR);
    let time = means(TIME_MEAN, pixel, local.xy, NOISE_NEAR, NOISE_NEAR);
    if !contains(pixel) {
        return;
    }
    let outlier = known_at(pixel);
    var p: Pooled;
    p.over_time = vec2f(noise[0].x, noise[1].x);
    p.seen = vec2f(noise[0].y, noise[1].y);
    p.over_space = vec2f(noise[0].z, noise[1].z);
    p.input = vec2f(noise[0].w, noise[1].w);
    p.along = vec2f(least_of(input_along[0]), least_of(wavelet_along[0]));
    p.apart_near = apart[0].xyz;
    p.apart_wide = apart[1].xyz;
    p.detail = detail[0].xy;
    p.mean = vec3f(squared(wavelet[0].xyz), squared(stabilised[0].xyz), squared(time[0].xyz));
    p.silhouette = outlier.w;
    let bright = brightness_at(pixel);
    let here = frame_at(settings.centre);
    hidden = array<vec4f, 4>(weights[0], weights[1], weights[2], weights[3]);
    add_three(0u, relative(input_at(pixel), bright));
    add_three(3u, relative(picture_at(pixel), bright));
    add_three(6u, relative(steady_at(pixel), bright));
    var statistics = inputs_of(p);
    for (var i = 0u; i < 17u; i++) {
        add(9u + i, statistics[i]);
    }
    let of_noise = log2_of(noise_of(p, 1u));
    add(26u, ratio(p.along.x, of_noise));
    add(27u, ratio(p.along.y, of_noise));
    add_three(28u, guide_albedo(here, pixel));
    add_three(31u, guide_normal(here, pixel));
    add(34u, depth_step(pixel));
    for (var o = 0u; o < 4u; o++) {
        textureStore(written, pixel, o, leaky(hidden[o]));
    }
    let strong = noise_of(p, 1u);
    let share = select(0.0, strong / (strong + settings.outlier_noise), strong > 0.0);
    judged[index_of(pixel)] = vec4f(strong, least_noise(p), bright, share * outlier.z);
}
