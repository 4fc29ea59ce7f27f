// Twin of math.rs. WGSL has no f64: what needs it there (spiral, cameras) is computed on the CPU and handed over.

// Luminance of linear Rec. 709 RGB.
fn luminance(c: vec3f) -> f32 {
    return LUMINANCE.x * c.x + LUMINANCE.y * c.y + LUMINANCE.z * c.z;
}

// Hermite step: 0 up to `low`, 1 from `high` on.
fn hermite_step(low: f32, high: f32, x: f32) -> f32 {
    if high <= low {
        return select(1.0, 0.0, x < low);
    }
    let t = clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// `a` at t = 0, `b` at t = 1, both to the bit.
fn lerp(a: vec3f, b: vec3f, t: f32) -> vec3f {
    return a * (1.0 - t) + b * t;
}

// Luma, orange-blue, green-magenta. Linear and invertible.
fn ycocg_from_rgb(c: vec3f) -> vec3f {
    return vec3f(
        0.25 * c.x + 0.5 * c.y + 0.25 * c.z,
        0.5 * c.x - 0.5 * c.z,
        -0.25 * c.x + 0.5 * c.y - 0.25 * c.z,
    );
}

// Inverse of `ycocg_from_rgb`.
fn rgb_from_ycocg(c: vec3f) -> vec3f {
    let t = c.x - c.z;
    return vec3f(t + c.y, c.x + c.z, t - c.y);
}

// e^x for x <= 0, 0 below -80: the polynomial of math.rs, because the `exp` of a device may be off by more.
fn exp_negative(x: f32) -> f32 {
    const LN_2_HIGH = 0.6933594;
    const LN_2_LOW = -2.1219444e-4;
    const LOG2_E = 1.442695;
    let x_clamped = clamp(x, -80.0, 0.0);
    // Truncation after subtracting a half rounds to nearest for arguments that are not positive.
    let k = i32(x_clamped * LOG2_E - 0.5);
    let r = x_clamped - f32(k) * LN_2_HIGH - f32(k) * LN_2_LOW;
    let p = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    let scale = bitcast<f32>(u32(k + 127) << 23u);
    return select(p * scale, 0.0, x < -80.0);
}

// Weights of four pixels in a row for a place at `t` (0 to 1) between the second and the third.
fn catmull_rom(t: f32) -> vec4f {
    return vec4f(
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    );
}
