//! Sequence filter: a picture averaged with its neighbours in time, each fetched along the motion of what is in
//! front and limited to the picture's own range in 3x3.
//!
//! | | |
//! |---|---|
//! | reads | filtered pictures and coverage of the frames around, their depth, motion and mirrors |
//! | writes | the steadier picture, and its coverage |
//! | reach | `stabilise.frames` frames before and after; 6 pixels in a frame: 3 of the cubic, 1 of the range, 2 of what is in front before and after motion; 2 rows where motion is rounded |
//! | equation | out = (c + sum_k w_k clamp(c_k, low, high)) / (1 + sum_k w_k), w_k = decay^(k - 1) * likeness of what a mirror shows |
//! | source | temporal anti-aliasing (Karis 2014) with both neighbours in time; ours: `docs/sequence.md` |
//! | parameters | `stabilise.*`, `gather.travel`, `gather.future` |
//!
//! Silhouettes gain samples, and what the wavelet decided differently from frame to frame evens out.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Rgb;
use crate::plane::Plane;
use crate::reach::Reach;
use crate::sequence::settings::Stabilise;
use crate::window::Features;

/// A frame as the stage reads it.
#[derive(Clone, Copy, Debug)]
pub struct StabiliseFrame<'a> {
    /// Feature buffers and motion.
    pub features: &'a Features,
    /// The filtered picture, scene-linear.
    pub picture: &'a Plane<Rgb>,
    /// Coverage, 0..1.
    pub alpha: Option<&'a Plane<f32>>,
}

/// Squared difference of the tone-mapped colours that mirrors or glass show around two pixels.
pub(crate) fn seen_difference(here: &Features, p: usize, other: &Features, q: usize) -> f32 {
    let (Some(a), Some(b)) = (&here.seen_around, &other.seen_around) else { return 0.0 };
    let (a, b) = (a.at(0, p), b.at(0, q));
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

/// Pixels read within a frame: the cubic, the range in 3x3, what is in front in 3x3 before and after motion.
const WINDOW: usize = 3 + 1 + 2;
/// Rows that rounding adds where motion leads.
const FOOTPRINT: usize = 2;

/// How far the stage looks.
pub(crate) fn reach(s: &Stabilise) -> Reach {
    Reach { frames: s.frames, footprint: FOOTPRINT, ..Reach::around(WINDOW) }
}
