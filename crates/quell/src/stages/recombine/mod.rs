//! Sequence filter, on both sides of `stabilise`: light and colour multiplied and added up to a picture (`sum`); then every pass scaled to
//! what `stabilise` made of it (`rescale`).
//!
//! | | |
//! |---|---|
//! | reads | filtered light, the colours that multiply it, the picture before and after `stabilise` |
//! | writes | the picture; the passes |
//! | reach | none |
//! | equation | picture = sum light * weight * mirror colour; pass' = pass * mirror colour * after / before, channel by channel |
//! | source | \[S] of the paper, "multiplied back"; the scale ours: `docs/sequence.md` |
//!
//! One factor a pixel and channel for all passes: they add up to the steadier picture as they did before. Where the picture was
//! black or is not positive after, the factor is 1, and passes stay.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Rgb;
use crate::reach::Reach;
use crate::window::{Class, Features, LightSlot, Packed};

/// A picture darker than this has no factor: 1.
pub(crate) const LEAST_PICTURE: f32 = 1e-8;

/// The stage looks at the pixel alone.
pub(crate) fn reach() -> Reach {
    Reach::NONE
}

/// The colour that a light was divided by in mirrors and clear glass; `None`: 1.
pub(crate) fn mirror_colour<'a>(features: &'a Features, slot: &LightSlot) -> Option<&'a Packed> {
    features.mirror_colour.as_ref().filter(|_| Class::of(slot.kind) == Class::Seen)
}

/// What a pixel's passes are multiplied by.
#[inline(always)]
pub(crate) fn factor(before: Rgb, after: Rgb) -> Rgb {
    [0, 1, 2].map(|c| if before[c] > LEAST_PICTURE && after[c] > 0.0 { after[c] / before[c] } else { 1.0 })
}
