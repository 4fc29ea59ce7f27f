//! Mathematics that gives the same bits on every machine: no `exp`, `sin` or `cos` of the platform's library.

use crate::frame::Rgb;

/// Weights of red, green and blue in the luminance of linear Rec. 709 RGB (ITU-R BT.709).
pub(crate) const LUMINANCE: Rgb = [0.2126, 0.7152, 0.0722];

/// Luminance of linear Rec. 709 RGB. The workspace has no other copy.
#[inline(always)]
pub fn luminance(c: Rgb) -> f32 {
    LUMINANCE[0] * c[0] + LUMINANCE[1] * c[1] + LUMINANCE[2] * c[2]
}

/// A value for each of three channels or axes. Unlike `array::map` it is always inlined: in vectorised code a call would
/// lose the instruction set.
#[inline(always)]
pub fn three<T>(f: impl Fn(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}

/// Hermite step: 0 up to `low`, 1 from `high` on.
#[inline(always)]
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    if high <= low {
        return if x < low { 0.0 } else { 1.0 };
    }
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// `a` at t = 0, `b` at t = 1, both to the bit.
#[inline(always)]
pub fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// Luma, orange-blue, green-magenta. Linear and invertible.
#[inline(always)]
pub fn ycocg_from_rgb(c: Rgb) -> [f32; 3] {
    [0.25 * c[0] + 0.5 * c[1] + 0.25 * c[2], 0.5 * c[0] - 0.5 * c[2], -0.25 * c[0] + 0.5 * c[1] - 0.25 * c[2]]
}

/// Inverse of [`ycocg_from_rgb`].
#[inline(always)]
pub fn rgb_from_ycocg(c: [f32; 3]) -> Rgb {
    let t = c[0] - c[2];
    [t + c[1], c[0] + c[2], t - c[1]]
}

/// Weights of four pixels in a row for a place at `t` (0 to 1) between the second and the third (Catmull and Rom 1974); their sum is 1.
#[inline(always)]
pub(crate) fn catmull_rom(t: f32) -> [f32; 4] {
    [
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    ]
}

/// e^x for x <= 0 in single precision: relative error under 3e-7 down to -80, 0 below.
///
/// Range reduction by ln 2 and a polynomial of degree 6; plain multiplications and additions, so every instruction
/// set gives the same bits.
#[inline(always)]
pub fn exp_negative(x: f32) -> f32 {
    const LN_2_HIGH: f32 = 0.693_359_4; // 355 / 512, exact in few bits
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x_clamped = x.clamp(-80.0, 0.0);
    // Truncation after subtracting a half rounds to nearest for arguments that are not positive.
    let k = (x_clamped * std::f32::consts::LOG2_E - 0.5) as i32;
    let r = x_clamped - k as f32 * LN_2_HIGH - k as f32 * LN_2_LOW;
    let p = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    let scale = f32::from_bits(((k + 127) as u32) << 23);
    if x < -80.0 { 0.0 } else { p * scale }
}

/// Sine and cosine of an angle in turns, by Taylor's series in double precision after reduction to an eighth.
pub fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let fraction = turns - turns.floor();
    let octant = (fraction * 8.0).floor();
    let a = (fraction - (octant + 0.5) / 8.0) * std::f64::consts::TAU;
    let a2 = a * a;
    let s = a * (1.0 - a2 / 6.0 * (1.0 - a2 / 20.0 * (1.0 - a2 / 42.0 * (1.0 - a2 / 72.0 * (1.0 - a2 / 110.0)))));
    let c = 1.0
        - a2 / 2.0 * (1.0 - a2 / 12.0 * (1.0 - a2 / 30.0 * (1.0 - a2 / 56.0 * (1.0 - a2 / 90.0 * (1.0 - a2 / 132.0)))));
    // Rotate by the middle of the octant.
    const SIN_EIGHTH: f64 = 0.382_683_432_365_089_8;
    const COS_EIGHTH: f64 = 0.923_879_532_511_286_7;
    let (sm, cm) = match octant as i32 {
        0 => (SIN_EIGHTH, COS_EIGHTH),
        1 => (COS_EIGHTH, SIN_EIGHTH),
        2 => (COS_EIGHTH, -SIN_EIGHTH),
        3 => (SIN_EIGHTH, -COS_EIGHTH),
        4 => (-SIN_EIGHTH, -COS_EIGHTH),
        5 => (-COS_EIGHTH, -SIN_EIGHTH),
        6 => (-COS_EIGHTH, SIN_EIGHTH),
        _ => (-SIN_EIGHTH, COS_EIGHTH),
    };
    (sm * c + cm * s, cm * c - sm * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_functions_agree_with_the_library() {
        for i in 0..8000 {
            let x = -(i as f32) * 0.01;
            let expected = f64::from(x).exp();
            assert!((f64::from(exp_negative(x)) - expected).abs() <= 3e-7 * expected, "{x}");
            let turns = f64::from(i) * 0.001_37 - 3.0;
            let (s, c) = sin_cos_turns(turns);
            let angle = turns * std::f64::consts::TAU;
            assert!((s - angle.sin()).abs() < 1e-9 && (c - angle.cos()).abs() < 1e-9, "{turns}");
        }
        assert_eq!(exp_negative(0.0), 1.0);
        assert_eq!(exp_negative(-81.0), 0.0);
        assert_eq!(exp_negative(f32::NEG_INFINITY), 0.0);
    }

    #[test]
    fn colour_transform_inverts() {
        let rgb = [0.3, 1.7, -0.2];
        let back = rgb_from_ycocg(ycocg_from_rgb(rgb));
        for c in 0..3 {
            assert!((back[c] - rgb[c]).abs() < 1e-6);
        }
    }
}
