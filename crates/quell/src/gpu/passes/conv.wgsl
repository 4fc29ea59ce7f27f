@compute @workgroup_size(8, 8)
fn convolve(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        var values = convolved(pixel);
        for (var o = 0u; o < WRITES; o++) {
            textureStore(written, pixel, o, values[o]);
        }
    }
}
