// What statistics are relative to: the mean over 5x5 pixels of the pictures' grey.
fn grey(pixel: vec2i) -> f32 {
    let picture = sum_of(picture_of(frame_at(settings.centre), pixel).xyz) / 3.0;
    if settings.stabilised == 0u {
        return picture;
    }
    return 0.5 * (picture + sum_of(steady[index_of(pixel)].xyz) / 3.0);
}

@compute @workgroup_size(8, 8)
fn brightness_around(@builtin(global_invocation_id) id: vec3u) {
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
                sum += grey(q);
                count += 1.0;
            }
        }
    }
    brightness[index_of(pixel)] = max(sum / count, 0.0) + LEAST_BRIGHTNESS;
}
