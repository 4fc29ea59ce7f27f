// What of the kernel's change is kept: the factor of each channel of the mixture, and the coverage.
@compute @workgroup_size(8, 8)
fn gain(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    var sum = 0.0;
    var count = 0.0;
    for (var dy = -NOISE_NEAR; dy <= NOISE_NEAR; dy++) {
        for (var dx = -NOISE_NEAR; dx <= NOISE_NEAR; dx++) {
            let q = pixel + vec2i(dx, dy);
            if contains(q) {
                sum += squared(relative_to(changed[index_of(q)].xyz, judged[index_of(q)].z));
                count += 1.0;
            }
        }
    }
    let i = index_of(pixel);
    let judgement = judged[i];
    let kept = kept_of(sum / count, judgement.x, judgement.y);
    let change = select(vec4f(0.0), changed[i] * kept, kept > 0.0);
    let before = mixture[i];
    gains[i] = vec4f(
        gain_of(before.x, change.x),
        gain_of(before.y, change.y),
        gain_of(before.z, change.z),
        before.w + change.w,
    );
}
