// Twin of reference.rs and kernel.rs: shares of the candidates and the kernel's weights of what the net says, and the guards.

// The share of squared noise in itself and the square of a deviation, both summed over the channels.
fn visible_share(noise: f32, deviation: f32) -> f32 {
    return noise / (noise + 3.0 * deviation * deviation);
}

// What draws a mixture back to the input that lies further from it than the noise explains.
fn drawn_back(difference: f32, noise: f32) -> f32 {
    let explained = noise * (settings.guard_low + (settings.guard - settings.guard_low) * visible_share(noise, settings.guard_noise));
    if difference < 2.0 * explained {
        return visible_share(noise, settings.visible) * min(2.0 - difference / explained, 1.0);
    }
    return 0.0;
}

fn pull(y: f32) -> f32 {
    let z = MOST_NUMBER * y / (MOST_NUMBER + abs(y));
    let half_sum = 0.5 * (z + sqrt(z * z + 4.0));
    return half_sum * half_sum;
}

// Shares of wavelet's picture and stabilised one, and the expected squared error over the input's noise.
fn wanted_shares(said: vec4f) -> vec3f {
    let more = max(settings.strength, 1.0);
    let less = min(settings.strength, 1.0);
    let g = vec3f(pull(said.x), pull(said.y) * more * more, pull(said.z) * more * more * more * more);
    let total = g.x + g.y + g.z;
    return vec3f(less * g.y / total, less * g.z / total, exp2_of(said.w));
}

// The kernel's weights, which add up to 1, row by row.
fn kernel_weights(said: array<f32, 9>) -> array<f32, 9> {
    var w = said;
    var most = w[0];
    for (var k = 1; k < 9; k++) {
        most = max(most, w[k]);
    }
    var total = 0.0;
    for (var k = 0; k < 9; k++) {
        w[k] = exp2_of((w[k] - most) * LOG2_E);
        total += w[k];
    }
    for (var k = 0; k < 9; k++) {
        w[k] /= total;
    }
    return w;
}

// The sum of the channels, of what is positive.
fn positive_sum(c: vec3f) -> f32 {
    let held = max(c, vec3f(0.0));
    return held.x + held.y + held.z;
}

// What another pixel counts as for the kernel of a pixel of brightness `own`.
fn limited(other: vec3f, own: f32) -> vec3f {
    let most = settings.kernel_contrast * own;
    let bright = positive_sum(other);
    if bright > most {
        return other * (most / bright);
    }
    return other;
}

// How much of a change is kept whose square, mean over 5x5, is `difference`.
fn kept_of(difference: f32, noise: f32, least: f32) -> f32 {
    let strong = noise / (noise + 3.0 * settings.kernel_noise * settings.kernel_noise);
    return min(settings.strength, 1.0) * settings.kernel * strong * drawn_back(difference, least);
}

fn gain_of(mixture: f32, change: f32) -> f32 {
    // A quotient of equals need not be 1 on a GPU.
    if change == 0.0 {
        return 1.0;
    }
    let after = mixture + change;
    if mixture > KERNEL_LEAST && after > 0.0 {
        return clamp(after / mixture, 1.0 / KERNEL_MOST, KERNEL_MOST);
    }
    return 1.0;
}
