//! Sequence filter: the variance of every light's mean, pooled over the surface around each pixel.
//!
//! | | |
//! |---|---|
//! | reads | the means and moments of [`gather`](crate::stages::gather), [`LocalFeatures`](crate::window::LocalFeatures), the variance that the renderer gave |
//! | writes | of each light the variance of the luminance of its mean |
//! | reach | `variance.radius` pixels |
//! | equation | (t v_time + (1 - t) v_other) / n; v_time: spread of samples, weighted by guide distance and degrees of freedom; t = min(1, freedom / `trusted_samples`) |
//! | source | SVGF (Schied et al. 2017) 4.2, for samples gathered at once; pooling ours: `docs/sequence.md` |
//! | parameters | `variance.*`, edge-stopping functions of `wavelet.*` |
//!
//! v_other, where samples are few (a first frame, what was just uncovered), is the spread of the means over the window times
//! n, or the variance that the renderer gave. Where the window has few pixels that show the same (less than `least_window`),
//! the spread over the 3x3 pixels around counts too: a lone black pixel, at the rim of a mirror or of glass, would else have
//! no noise.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;
use crate::sequence::settings::Variance;

/// How far the stage looks.
pub(crate) fn reach(s: &Variance) -> Reach {
    Reach::around(s.radius as usize)
}
