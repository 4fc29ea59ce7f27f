//! Sequence filter: edge-avoiding a-trous levels with a luminance stop.
//!
//! | | |
//! |---|---|
//! | reads | a light's colour planes, the variance of its luminance, [`LocalFeatures`](crate::window::LocalFeatures) |
//! | writes | the filtered planes |
//! | reach | sum over levels i of 2^i + 1 pixels |
//! | equation | out = sum h w c / sum h w over 3x3 taps, h = (1 2 1)^2; variance' = sum (h w)^2 v / (sum h w)^2; w = weight(guide distance + stop) |
//! | luminance stop | max(0, (m_p - m_q)^2 - v) / (k^2 v + (`least_contrast` m_p)^2), m: means over 3x3 of the same surface and light, v: v_p + min(v_q, `variance_ratio` v_p) of their variances, times `correlation` (of the level), k: in deviations |
//! | k^2 | from `low`^2 to the light's own (`wavelet.matte` ...)^2 as the first level's v_p passes (`low_noise` m_p)^2 |
//! | same light | (c_p - c_q)^2 <= t, the pixel's counts less up to 2 t, t = `step`^2 (v_p + v_q), v: their variances |
//! | source | Dammertz, Sewtz, Hanika, Lensch (HPG 2010); stop by variance: SVGF (Schied et al., HPG 2017) 4.4; 3x3 means and "- v" ours |
//! | parameters | `wavelet.*` |
//!
//! The squared difference counts only beyond its expectation for equal light, v (if the noise of pixels is independent), so that noise alone
//! stops little: at three deviations and k = 2.2 the weight is 0.2. With few samples a pixel the noise has rare bright ones, which a
//! narrow stop would keep; with many a wide stop is a bias of as many deviations. Light without noise of its own passes, whatever
//! noise its neighbours have.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;
use crate::sequence::LightKind;
use crate::sequence::settings::Wavelet;

/// Kernel of a level and of the compared means, from the centre outwards; what it sums is normalised. The B3 spline of Dammertz et
/// al. 2010 is this kernel applied twice at one level: 25 taps where these are 9, and no better (docs/trials.md).
pub(crate) const TENT: [f32; 2] = [2.0, 1.0];
/// Keeps the stop's quotient finite where nothing varies.
pub(crate) const LEAST_VARIANCE: f32 = 1e-12;

/// Variance of a mean over 3x3 pixels after `level` levels, over that of as many independent pixels: neighbours share samples. Found from
/// [`TENT`] where nothing stops it. That the taps of a level share samples too is left out: with it later levels average
/// light that differs (docs/trials.md).
pub(crate) fn correlation(level: u32) -> f32 {
    const OF_LEVEL: [f32; 8] = [1.0, 3.780_864, 5.987_661, 6.799_359, 7.030_121, 7.090_547, 7.105_935, 7.109_813];
    OF_LEVEL[(level as usize).min(OF_LEVEL.len() - 1)]
}

/// How far a pixel counts in the compared mean of another, whose luminances differ by `difference`: not where it is beyond what their
/// `variance` (the sum of both) explains, times `squared`. A lamp beside a dark gap is another light, on the same surface or not.
pub(crate) fn same_light(difference: f64, variance: f64, squared: f64) -> f64 {
    let most = squared * variance + f64::from(LEAST_VARIANCE);
    (2.0 - difference * difference / most).clamp(0.0, 1.0)
}

/// Levels of a kind of light; noise-free light has none.
pub(crate) fn levels(s: &Wavelet, kind: LightKind) -> u32 {
    match kind {
        LightKind::NoiseFree => 0,
        LightKind::Transmission => s.transmission_levels,
        _ => s.levels,
    }
}

/// Luminance stop of a kind of light, in standard deviations.
pub(crate) fn tolerance(s: &Wavelet, kind: LightKind) -> f32 {
    match kind {
        LightKind::MatteDirect => s.matte_direct,
        LightKind::MatteIndirect | LightKind::NoiseFree => s.matte,
        LightKind::GlossyDirect | LightKind::GlossyIndirect => s.glossy,
        LightKind::Transmission | LightKind::Volume | LightKind::Beauty => s.transmission,
    }
}

/// How far some levels look: each compares means over 3x3 pixels, and takes taps a step away.
pub(crate) fn reach_of(levels: u32) -> Reach {
    Reach::around((0..levels).map(|level| (1usize << level) + 1).sum())
}

/// How far the stage looks.
pub(crate) fn reach(s: &Wavelet) -> Reach {
    reach_of(s.levels.max(s.transmission_levels))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the kernels themselves, in one dimension and then squared.
    #[test]
    fn correlation_is_that_of_the_kernels() {
        let convolved = |a: &[f64], b: &[f64]| {
            let mut out = vec![0.0; a.len() + b.len() - 1];
            for (i, a) in a.iter().enumerate() {
                b.iter().enumerate().for_each(|(k, b)| out[i + k] += a * b);
            }
            out
        };
        let squares = |kernel: &[f64]| kernel.iter().map(|v| v * v).sum::<f64>();
        let tent: Vec<f64> = [1, 0, 1].map(|k: usize| f64::from(TENT[k]) / 4.0).to_vec();
        let mut filtered = vec![1.0];
        for level in 0..8u32 {
            let factor = (squares(&convolved(&filtered, &tent)) / (squares(&filtered) * squares(&tent))).powi(2);
            assert!((f64::from(correlation(level)) - factor).abs() < 1e-4, "{level}: {factor}");
            let mut taps = vec![0.0; (2 << level) + 1];
            for (k, tap) in tent.iter().enumerate() {
                taps[k << level] = *tap;
            }
            filtered = convolved(&filtered, &taps);
        }
    }
}
