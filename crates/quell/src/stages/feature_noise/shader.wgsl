// Twin of reference.rs: slopes of the depth, and how noisy the feature buffers are themselves.
//
// The pass supplies `contains`, `inverse_depth_at` and `normal_at`.

// More than any noise.
const LARGE: f32 = 1e30;

// Of the two one-sided differences the smaller: the other may cross an edge.
fn slope(pixel: vec2i, along: vec2i, here: f32) -> f32 {
    if here <= 0.0 {
        return 0.0;
    }
    var back = 0.0;
    if contains(pixel - along) {
        back = inverse_depth_at(pixel - along);
    }
    var forward = 0.0;
    if contains(pixel + along) {
        forward = inverse_depth_at(pixel + along);
    }
    let a = here - back;
    let b = forward - here;
    if back > 0.0 && forward > 0.0 {
        return select(b, a, abs(a) < abs(b));
    }
    if back > 0.0 {
        return a;
    }
    return select(0.0, b, forward > 0.0);
}

// Noise of the depth and of the normal: along an edge a clean feature buffer is smooth; where it is smooth in no
// direction it is noisy.
fn feature_noise(pixel: vec2i, here: f32, facing: vec3f) -> vec2f {
    if !contains(pixel - vec2i(1)) || !contains(pixel + vec2i(1)) {
        return vec2f(0.0);
    }
    var least = vec2f(LARGE);
    for (var k = 0; k < 4; k++) {
        var along = vec2i(1, 0);
        switch k {
            case 1: { along = vec2i(0, 1); }
            case 2: { along = vec2i(1, 1); }
            case 3: { along = vec2i(1, -1); }
            default: {}
        }
        var rough = 0.0;
        if here > 0.0 {
            rough = abs(inverse_depth_at(pixel - along) + inverse_depth_at(pixel + along) - 2.0 * here) / (2.0 * here);
        }
        let d = 0.5 * (normal_at(pixel - along).xyz + normal_at(pixel + along).xyz) - facing;
        least = min(least, vec2f(rough, 0.5 * dot(d, d)));
    }
    return least;
}
