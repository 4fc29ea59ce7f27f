// A layer of the net of kernels/conv.rs, one pixel an invocation: a window of 3x3 pixels, four channels at a time. The pass
// supplies how many groups of four channels it reads (READS) and writes (WRITES), `source` (a group of a pixel of the layer's
// image) and `weights`: what is added, then for each group, pixel of the window and channel the weights of all that is written.

fn leaky(v: vec4f) -> vec4f {
    return select(v, CONV_LEAK * v, v < vec4f(0.0));
}

// A group of channels of an image at full size, halved: the mean of four pixels.
fn mean_of_four(a: vec4f, b: vec4f, c: vec4f, d: vec4f) -> vec4f {
    return 0.25 * (a + b + c + d);
}

fn convolved(pixel: vec2i) -> array<vec4f, WRITES> {
    var sums: array<vec4f, WRITES>;
    for (var o = 0u; o < WRITES; o++) {
        sums[o] = weights[o];
    }
    var at = WRITES;
    let last = vec2i(settings.size) - 1;
    for (var group = 0u; group < READS; group++) {
        for (var dy = -1; dy <= 1; dy++) {
            for (var dx = -1; dx <= 1; dx++) {
                let values = source(group, clamp(pixel + vec2i(dx, dy), vec2i(0), last));
                for (var o = 0u; o < WRITES; o++) {
                    sums[o] += weights[at + o] * values.x + weights[at + WRITES + o] * values.y;
                    sums[o] += weights[at + 2u * WRITES + o] * values.z + weights[at + 3u * WRITES + o] * values.w;
                }
                at += 4u * WRITES;
            }
        }
    }
    for (var o = 0u; o < WRITES; o++) {
        sums[o] = leaky(sums[o]);
    }
    return sums;
}
