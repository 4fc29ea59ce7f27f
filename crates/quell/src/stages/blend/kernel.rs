//! A weighted mean of the mixture over the pixels around, with weights that the net predicts for each pixel (Bako et al. 2017).
//!
//! What it changes, D = sum_k w_k min(1, c b / b_k) m_k - m, b the brightness, is noise of edges: c keeps the little that a weight is off
//! from a lamp (`blend.kernel_contrast`). It is kept as far as the noise of the input explains it, by the rule that
//! binds the mixture itself ([`drawn_back`]), and the less the weaker that noise is (`blend.kernel_noise`): with many samples little is
//! left to remove, and what looks like an edge's noise is detail more often. It comes out as a factor (m + D) / m for each channel, so that
//! passes that are multiplied by it still add up.

use super::{drawn_back, exp2};
use crate::frame::Rgb;
#[cfg(feature = "cpu")]
use crate::kernels::lanes;
use crate::sequence::settings::Blend as Settings;
#[cfg(feature = "cpu")]
use crate::window::Rows;
#[cfg(feature = "cpu")]
use fearless_simd::{Simd, f32x16, prelude::*};

/// Half the side of the kernel.
pub(crate) const RADIUS: usize = 1;
/// Pixels of the kernel, row by row.
pub(crate) const TAPS: usize = (2 * RADIUS + 1) * (2 * RADIUS + 1);
/// The first output of the net that is a weight.
pub(crate) const SAID: usize = 4;
/// The most that a channel is multiplied by or divided by: what the mixture lacks no factor can give.
pub(crate) const MOST: f32 = 16.0;
/// A channel darker than this has no factor.
pub(crate) const LEAST: f32 = 1e-8;

/// The kernel's weights, which add up to 1, of what the net gives.
#[inline(always)]
pub(crate) fn weights(said: [f32; TAPS]) -> [f32; TAPS] {
    let most = said.into_iter().fold(f32::MIN, f32::max);
    let raised = said.map(|v| exp2((v - most) * std::f32::consts::LOG2_E));
    let total: f32 = raised.iter().sum();
    raised.map(|v| v / total)
}

/// [`weights`] of sixteen pixels from column `x` on of row `y`, to the bit.
#[cfg(feature = "cpu")]
#[inline(always)]
pub(crate) fn weight_lanes<S: Simd>(simd: S, said: &Rows, (x, y): (usize, usize)) -> [f32x16<S>; TAPS] {
    let zero = f32x16::splat(simd, 0.0);
    let (mut raised, mut most, mut total) = ([zero; TAPS], f32x16::splat(simd, f32::MIN), zero);
    for k in 0..TAPS {
        raised[k] = lanes::load::<true, _>(simd, said.row(y, SAID + k), x as isize);
        most = most.max_precise(raised[k]);
    }
    for k in 0..TAPS {
        raised[k] = lanes::exp2(simd, (raised[k] - most) * std::f32::consts::LOG2_E);
        total += raised[k];
    }
    for k in 0..TAPS {
        raised[k] /= total;
    }
    raised
}

/// What another pixel counts as for the kernel of a pixel: no more than so many times as bright as that. `own`: [`brightness`].
#[inline(always)]
pub(crate) fn limited(other: Rgb, own: f32, s: &Settings) -> Rgb {
    let (most, bright) = (s.kernel_contrast * own, brightness(other));
    if bright > most { other.map(|v| v * (most / bright)) } else { other }
}

/// The sum of the channels, of what is positive.
#[inline(always)]
pub(crate) fn brightness([r, g, b]: Rgb) -> f32 {
    r.max(0.0) + g.max(0.0) + b.max(0.0)
}

/// [`brightness`] of sixteen pixels, to the bit.
#[cfg(feature = "cpu")]
#[inline(always)]
pub(crate) fn brightness_lanes<S: Simd>(simd: S, [r, g, b]: &[f32x16<S>; 3]) -> f32x16<S> {
    let zero = f32x16::splat(simd, 0.0);
    r.max_precise(zero) + g.max_precise(zero) + b.max_precise(zero)
}

/// How much of a change is kept whose square, mean over 5x5, is `difference`. `noise` and the least that it may be: squared, relative to
/// the brightness, summed over the channels, as `difference`.
#[inline(always)]
pub(crate) fn kept(difference: f32, noise: f32, least_noise: f32, s: &Settings) -> f32 {
    let strong = noise / (noise + 3.0 * s.kernel_noise * s.kernel_noise);
    s.strength.min(1.0) * s.kernel * strong * drawn_back(difference, least_noise, s)
}

/// What a channel of the mixture is multiplied by to be changed by `change`.
#[inline(always)]
pub(crate) fn gain(mixture: Rgb, change: Rgb) -> Rgb {
    [0, 1, 2].map(|c| {
        let (before, after) = (mixture[c], mixture[c] + change[c]);
        // NaN is not greater.
        if before > LEAST && after > 0.0 { (after / before).clamp(1.0 / MOST, MOST) } else { 1.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_shares() {
        for said in [[0.0; TAPS], std::array::from_fn(|k| 40.0 * k as f32 - 90.0)] {
            let weights = weights(said);
            assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)), "{weights:?}");
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{weights:?}");
            assert!(weights.is_sorted(), "{weights:?}");
        }
    }

    /// What nothing changes comes out to the bit; what no factor can make stays.
    #[test]
    fn gains_are_finite() {
        assert_eq!(gain([0.3, 1e-30, f32::MAX], [0.0; 3]), [1.0; 3]);
        assert_eq!(gain([0.5, 0.0, 1.0], [0.25, 1.0, -2.0]), [1.5, 1.0, 1.0]);
        assert_eq!(gain([1e-3, f32::NAN, 1.0], [1.0, 0.0, f32::NAN]), [MOST, 1.0, 1.0]);
    }
}
