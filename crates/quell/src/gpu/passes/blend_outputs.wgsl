// The last two layers of the net of `blend`: the shares that it wants, the expected error, the kernel.
@compute @workgroup_size(8, 8)
fn net_outputs(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !all(id.xy < settings.inside) {
        return;
    }
    var hidden = convolved(pixel + vec2i(0, settings.above));
    var at = LAST_LAYER;
    var numbers = array<vec4f, 4>(weights[at], weights[at + 1u], weights[at + 2u], weights[at + 3u]);
    at += 4u;
    for (var group = 0u; group < 4u; group++) {
        for (var c = 0u; c < 4u; c++) {
            let value = hidden[group][c];
            for (var o = 0u; o < 4u; o++) {
                numbers[o] += weights[at + o] * value;
            }
            at += 4u;
        }
    }
    let a = numbers[1];
    let b = numbers[2];
    let kernel = kernel_weights(array<f32, 9>(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, numbers[3].x));
    textureStore(written, pixel, 0u, vec4f(wanted_shares(numbers[0]), 0.0));
    textureStore(written, pixel, 1u, vec4f(kernel[0], kernel[1], kernel[2], kernel[3]));
    textureStore(written, pixel, 2u, vec4f(kernel[4], kernel[5], kernel[6], kernel[7]));
    textureStore(written, pixel, 3u, vec4f(kernel[8], 0.0, 0.0, 0.0));
}
