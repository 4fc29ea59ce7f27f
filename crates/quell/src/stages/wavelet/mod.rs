//! Sequence filter: edge-avoiding a-trous levels with a luminance stop.
//!
//! | | |
//! |---|---|
//! | reads | a light's colour planes, the variance of its luminance, [`LocalFeatures`](crate::window::LocalFeatures) |
//! | writes | the filtered planes |
//! | reach | sum over levels i of 2 * 2^i + 1 pixels |
//! | equation | out = sum h w c / sum h w; variance' = sum (h w)^2 v / (sum h w)^2; w = weight(guide distance + stop) |
//! | luminance stop | max(0, (m_p - m_q)^2 - v) / (k^2 v + (`least_contrast` m_p)^2), m: means over 3x3 of the same surface, v: v_p + min(v_q, `variance_ratio` v_p) of their variances, k: in deviations |
//! | k^2 | from `low`^2 to the light's own (`wavelet.matte` ...)^2 as the first level's v_p passes (`low_noise` m_p)^2 |
//! | source | Dammertz, Sewtz, Hanika, Lensch (HPG 2010); stop by variance: SVGF (Schied et al., HPG 2017) 4.4; 3x3 means and "- v" ours |
//! | parameters | `wavelet.*` |
//!
//! The squared difference counts only beyond its expectation for equal light, v (if the noise of pixels is independent), so that noise alone
//! stops little: at three deviations and k = 4 the weight is 0.6. With few samples a pixel the noise has rare bright ones, which a
//! narrow stop would keep; with many a wide stop is a bias of as many deviations. Light without noise of its own passes, whatever
//! noise its neighbours have.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;
use crate::sequence::LightKind;
use crate::sequence::settings::Wavelet;

/// Half of the B3 spline's kernel, from the centre outwards (Dammertz et al. 2010).
pub(crate) const SPLINE: [f32; 3] = [0.375, 0.25, 0.0625];
/// Kernel of the compared means, from the centre outwards; they are normalised.
pub(crate) const TENT: [f32; 2] = [2.0, 1.0];
/// Keeps the stop's quotient finite where nothing varies.
pub(crate) const LEAST_VARIANCE: f32 = 1e-12;

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

/// How far some levels look: each compares means over 3x3 pixels, and takes taps two steps away.
pub(crate) fn reach_of(levels: u32) -> Reach {
    Reach::around((0..levels).map(|level| 2 * (1usize << level) + 1).sum())
}

/// How far the stage looks.
pub(crate) fn reach(s: &Wavelet) -> Reach {
    reach_of(s.levels.max(s.transmission_levels))
}
