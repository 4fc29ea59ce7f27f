//! Sequence filter: the samples met along each surface's motion trajectory, averaged.
//!
//! | | |
//! |---|---|
//! | reads | light, feature buffers and motion of the frames of the window ([`PreparedFrame`]) |
//! | writes | [`Gathered`]: of each light its mean, the variance of one sample, and the samples that the mean is worth |
//! | reach | `gather.frames` frames before and after; 2 rows around where motion leads |
//! | equation | mean = sum w c / sum w; n = (sum w)^2 / sum w^2; variance of a sample = weighted spread * n / (n - 1) |
//! | weight | trust in the surface * decay^distance * likeness of what mirrors show * likeness of the light |
//! | likeness of the light | 1 where d^2 <= t, else (t / d^2)^2; d: difference of the means of equal light around the two pixels, on the same surface (`window/light_means.rs`); t = k^2 (v + v') + (`light_contrast` m)^2, v: variances of these means; k^2 from `light_deviations`^2 to `light_deviations_high`^2 as (v + v') / m^2 passes `light_noise`^2 |
//! | source | ours: `docs/sequence.md` |
//! | parameters | `gather.*` |
//!
//! A sample is a pixel of one frame: the mean of its paths. A pixel's surface is followed by its motion, frame by frame
//! (`trajectory.rs`). Of the four pixels around the place where it leads in a frame, the nearest that shows the surface is
//! taken as it is, not their bilinear mean: that costs half as much, and noise and blur are no worse (docs/trials.md). In
//! mirrors and glass one that shows the same there goes first (`seen_alike`; `seen.rs`).
//!
//! A pixel there shows the same surface where it lies on the tangent plane of the surface here and normals agree (it stands).
//! Off that plane, it must have about the same depth and normal, and motion there and back again must end where it began,
//! where there is motion back (it moves; `moving_weight`). Where motion is the camera's alone, `camera_plane_distance` and
//! `camera_moving_weight` take their place.
//!
//! Light that changed is other light, however sure the surface: a shadow or a lamp that moves, a highlight on what turns. What
//! a surface or the sky emits passes as it is where no medium is lit.
//! Where one seed was used for all frames, samples of a pixel that stands are left out: they have the same noise.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;
#[cfg(feature = "cpu")]
mod seen;
#[cfg(feature = "cpu")]
pub(crate) mod trajectory;

use crate::kernels::guide_distance::APART;
use crate::reach::Reach;
use crate::sequence::LightKind;
use crate::sequence::settings::Gather;
use crate::window::{Features, LightSlot, PreparedFrame, Rows, Samples};

/// Pixels that are followed at once, and planes that are averaged at once.
#[cfg(feature = "cpu")]
const LANES: usize = 8;

/// The worth of a mean in samples from which its spread says something of its variance.
pub(crate) const LEAST_COUNT: f32 = 1.01;

/// Samples that a pixel without noise is worth: its variance is 0, and beside it that of pixels with noise still counts.
pub(crate) const FREE_COUNT: f32 = 16.0;
/// Keeps a quotient finite where there is neither light nor noise.
pub(crate) const LEAST_NOISE: f32 = 1e-20;

/// What is known of every light before any filter over the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Gathered {
    /// The lights that are not black all over the window, with their places in the images below.
    pub slots: Vec<LightSlot>,
    /// Three channels a colour plane: the means.
    pub colours: Rows,
    /// Two channels a light: variance of one sample's luminance, and the samples that the mean is worth.
    pub moments: Rows,
}

/// How far the stage looks.
pub(crate) fn reach(s: &Gather) -> Reach {
    Reach { frames: s.frames, footprint: FOOTPRINT, ..Reach::NONE }
}

/// Rows around the place that motion leads to from which a pixel is taken, and one more.
const FOOTPRINT: usize = 2;

/// The settings of a frame. Where motion is the camera's alone, a surface is followed only while it stays where it was in
/// the world, more strictly, and nothing is followed by motion alone.
pub(crate) fn settings_of(s: &Gather, features: &Features) -> Gather {
    if features.camera_motion {
        Gather { plane_distance: s.camera_plane_distance, moving_weight: s.camera_moving_weight, ..*s }
    } else {
        s.clone()
    }
}

/// Weight of a sample one frame further away.
pub(crate) fn decay(gather: &Gather, kind: LightKind) -> f32 {
    match kind {
        LightKind::GlossyDirect => gather.glossy_direct_decay,
        LightKind::GlossyIndirect => gather.glossy_decay,
        LightKind::Transmission => gather.transmission_decay,
        LightKind::NoiseFree => 0.0,
        LightKind::MatteDirect | LightKind::MatteIndirect | LightKind::Volume | LightKind::Beauty => gather.matte_decay,
    }
}

/// Where a frame of the window has a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// It is black there.
    Black,
    /// Among its samples, from this plane on.
    At(usize),
    /// It was noise-free there and is not kept.
    Unknown,
}

impl Place {
    pub(crate) fn of(frame: &PreparedFrame, light: usize) -> Self {
        match frame.stored[light] {
            Samples::Packed(first) => Self::At(first),
            Samples::Black => Self::Black,
            Samples::Own(_) | Samples::Gone => Self::Unknown,
        }
    }
}

/// The lights that are not black all over the window, one after the other.
pub(crate) fn lit(window: &[&PreparedFrame], centre: usize) -> Vec<LightSlot> {
    let black = |frame: &PreparedFrame, light: usize| matches!(frame.stored[light], Samples::Black);
    let mut first = 0;
    let lit = window[centre].slots.iter().filter(|slot| match slot.kind {
        LightKind::NoiseFree => !black(window[centre], slot.light),
        _ => window.iter().any(|frame| !black(frame, slot.light)),
    });
    let packed = lit.map(|slot| {
        let slot = LightSlot { first, ..*slot };
        first += slot.planes;
        slot
    });
    packed.collect()
}

/// How unlike the things are that pixel `p` shows here, and pixel `q` of another frame there, in a mirror or through
/// glass, as the exponent of a weight.
pub(crate) fn seen_distance(here: &Features, p: usize, other: &Features, q: usize, gather: &Gather) -> f32 {
    let (Some(a), Some(b)) = (&here.seen, &other.seen) else { return 0.0 };
    // Light that was divided by what it shows never mixes with light that was not.
    if here.is_mirror(p) != other.is_mirror(q) {
        return APART;
    }
    let (ca, cb) = (a.at(0, p), b.at(0, q));
    let (na, nb) = (a.at(1, p), b.at(1, q));
    let colour = (0..3).map(|c| (ca[c] - cb[c]).powi(2)).sum::<f32>() * 0.5 / (gather.seen_albedo * gather.seen_albedo);
    let cosine = na[0] * nb[0] + na[1] * nb[1] + na[2] * nb[2];
    let has_normals = na != [0.0; 3] || nb != [0.0; 3];
    colour + if has_normals { gather.seen_normal * (1.0 - cosine) } else { 0.0 }
}

/// Mean of a light around a pixel of a frame, and its deviation; where the frame has none of it, or nothing is known, 0.
#[inline(always)]
pub(crate) fn mean_of(frame: &PreparedFrame, place: Option<usize>, pixel: usize) -> [f32; 2] {
    place.map_or([0.0; 2], |place| frame.means.at(place, pixel))
}
