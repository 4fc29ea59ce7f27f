//! Sequence filter: a picture averaged with its neighbours in time, each fetched along the motion of what is in
//! front and limited to the picture's own range in 3x3.
//!
//! | | |
//! |---|---|
//! | reads | filtered pictures, the same as they came, and coverage of the frames around, their depth, motion and mirrors |
//! | writes | the steadier picture, and its coverage |
//! | reach | `stabilise.frames` frames before and after; 6 pixels in a frame: 3 of the cubic, 1 of the range, 2 of what is in front before and after motion; 2 rows where motion is rounded |
//! | equation | out = (c + sum_k w_k clamp(c_k, low, high)) / (1 + sum_k w_k), w_k = decay^(k - 1) * likeness of what a mirror shows * t / (t + \|G - G_k\|^2) |
//! | t | sum over both pictures of min(`likeness` v, `residue` n (n / (n + (`low_noise` G)^2))^2); G: binomial 3x3 of the median in 3x3; v: mean over 3x3 of \|P - binomial P\|^2; n: mean over 5x5 of \|P - P as it came\|^2 |
//! | source | temporal anti-aliasing (Karis 2014) with both neighbours in time; ours: `docs/sequence.md` |
//! | parameters | `stabilise.*`, `gather.travel`, `gather.future` |
//!
//! A neighbour counts where it shows the same. How far it may differ shrinks with the noise that the frame came with.
//! Silhouettes gain samples, and what the wavelet decided differently from frame to frame evens out.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
#[cfg(feature = "cpu")]
pub(crate) mod likeness;
pub mod reference;

use crate::frame::Rgb;
use crate::plane::Plane;
use crate::reach::Reach;
use crate::sequence::settings::Stabilise;
use crate::window::Features;

/// What a filtered picture shows without its noise: by it a neighbour in time counts. Made once a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Likeness {
    /// Binomial 3x3 of the median in 3x3: for weights alone, so that no energy is lost.
    pub guide: Plane<Rgb>,
    /// Squared difference of two guides that noise may make, this picture's part.
    pub tolerance: Plane<f32>,
}

/// Pixels around, each way, over which the noise of the frame as it came is pooled.
const POOL: usize = 2;
/// Keeps a quotient finite where there is neither light nor noise.
const LEAST_NOISE: f32 = 1e-20;

/// A frame as the stage reads it.
#[derive(Clone, Copy, Debug)]
pub struct StabiliseFrame<'a> {
    /// Feature buffers and motion.
    pub features: &'a Features,
    /// The filtered picture, scene-linear.
    pub picture: &'a Plane<Rgb>,
    /// What it shows without its noise; `None`: neighbours count whatever they show.
    pub likeness: Option<&'a Likeness>,
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
