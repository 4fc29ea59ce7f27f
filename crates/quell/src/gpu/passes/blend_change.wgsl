// What the kernel changes of the mixture, and of the coverage.
@compute @workgroup_size(8, 8)
fn change_by_kernel(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let a = textureLoad(outputs, pixel, 1, 0);
    let b = textureLoad(outputs, pixel, 2, 0);
    let c = textureLoad(outputs, pixel, 3, 0);
    var kernel = array<f32, 9>(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x);
    let own = mixture[index_of(pixel)];
    let bright = positive_sum(own.xyz);
    let here = limited(own.xyz, bright);
    var change = vec4f(0.0);
    for (var k = 0; k < 9; k++) {
        let other = mixture[index_of(clamped(pixel + vec2i(k % 3 - 1, k / 3 - 1)))];
        change += kernel[k] * vec4f(limited(other.xyz, bright) - here, other.w - own.w);
    }
    changed[index_of(pixel)] = change;
}
