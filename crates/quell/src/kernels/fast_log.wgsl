// Twin of `log2` and `exp2` of stages/blend/mod.rs: their polynomials, not the device's functions.

// log2 of positive numbers, to 2.2e-5.
fn log2_of(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = i32(bits >> 23u) - 127;
    let m = bitcast<f32>((bits & 0x007fffffu) | 0x3f800000u) - 1.0;
    let p = 1.0 + (m - 1.0) * (-0.4417403 + m * (0.2660299 + m * (-0.1463143 + m * 0.0440047)));
    return f32(exponent) + m * p;
}

// 2^x, to 1.7e-4 relative; x counts as -60 at the least and 60 at the most.
fn exp2_of(x: f32) -> f32 {
    let held = clamp(x, -60.0, 60.0);
    let whole = floor(held);
    let t = held - whole;
    let p = 1.0 + t * (0.6959285 + t * (0.2249463 + t * 0.0791252));
    return bitcast<f32>(u32(i32(whole) + 127) << 23u) * p;
}
