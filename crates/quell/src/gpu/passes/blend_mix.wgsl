// Shares of the candidates, bound by the guard, and their mixture.

// Squared, how far the mixture that the net wants lies from the input, relative to the brightness.
fn moved(pixel: vec2i) -> f32 {
    let here = frame_at(settings.centre);
    let i = index_of(pixel);
    let input = input_of(here, pixel);
    let wanted = textureLoad(outputs, pixel, 0, 0);
    let d = wanted.x * (input - picture_of(here, pixel).xyz) + wanted.y * (input - steady[i].xyz);
    return squared(relative_to(d, judged[i].z));
}

@compute @workgroup_size(8, 8)
fn mix_candidates(@builtin(global_invocation_id) id: vec3u) {
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
                sum += moved(q);
                count += 1.0;
            }
        }
    }
    let i = index_of(pixel);
    let judgement = judged[i];
    let wanted = textureLoad(outputs, pixel, 0, 0);
    let held = drawn_back(sum / count, judgement.y);
    // Of an outlier of the input the stabilised picture takes all.
    let kept = 1.0 - min(settings.strength, 1.0) * judgement.w;
    let wavelet = wanted.x * held;
    let input_share = (1.0 - (wavelet + wanted.y * held)) * kept;
    let wavelet_share = wavelet * kept;
    let steady_share = 1.0 - (input_share + wavelet_share);
    let noise = sqrt(wanted.z * judgement.x / 3.0) * judgement.z;
    shares[i] = vec4f(input_share, wavelet_share, steady_share, noise);
    let here = frame_at(settings.centre);
    let picture = picture_of(here, pixel);
    let after = steady[i];
    mixture[i] = vec4f(
        input_share * input_of(here, pixel) + wavelet_share * picture.xyz + steady_share * after.xyz,
        picture.w * (1.0 - steady_share) + after.w * steady_share,
    );
}
