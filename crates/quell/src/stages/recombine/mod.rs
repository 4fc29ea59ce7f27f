//! Sequence filter, around `stabilise` and `blend`: light and colour multiplied and added up to a picture (`sum`; of the light as it came:
//! `input`); then every pass made of what it was and what it became, as the picture is (`rescale`).
//!
//! | | |
//! |---|---|
//! | reads | light as it came and filtered, the colours that multiply it, the picture before and after `stabilise`, the shares and gains of `blend` |
//! | writes | the picture, the input; the passes |
//! | reach | none |
//! | equation | picture = sum light * weight * mirror colour; pass' = mirror colour * gain * (filtered + s_0 (raw - filtered) + s_2 (after / before - 1) filtered), channel by channel, s: the shares, whose sum is 1 |
//! | source | \[S] of the paper, "multiplied back"; the scale ours: `docs/sequence.md` |
//!
//! One factor a pixel and channel for all passes: they add up to the blended picture as they did before. Where the picture was
//! black or is not positive after, after / before counts as 1.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Rgb;
use crate::reach::Reach;
use crate::stages::blend::Blend;
use crate::window::{Class, Features, LightSlot, PreparedFrame, Samples, Sparse};

/// A picture darker than this has no factor: 1.
pub(crate) const LEAST_PICTURE: f32 = 1e-8;

/// The stage looks at the pixel alone.
pub(crate) fn reach() -> Reach {
    Reach::NONE
}

/// The colour that a light was divided by in mirrors and clear glass; `None`: 1.
pub(crate) fn mirror_colour<'a>(features: &'a Features, slot: &LightSlot) -> Option<&'a Sparse<Rgb>> {
    features.mirror_colour.as_ref().filter(|_| Class::of(slot.kind) == Class::Seen)
}

/// What a pixel's passes are multiplied by.
#[inline(always)]
pub(crate) fn factor(before: Rgb, after: Rgb) -> Rgb {
    [0, 1, 2].map(|c| if before[c] > LEAST_PICTURE && after[c] > 0.0 { after[c] / before[c] } else { 1.0 })
}

/// A colour of a light as it came, without the colour seen in mirrors. `None`: the light is not kept, since it comes out as it went in.
#[inline(always)]
pub(crate) fn raw(frame: &PreparedFrame, slot: &LightSlot, k: usize, pixel: usize) -> Option<Rgb> {
    match &frame.stored[slot.light] {
        Samples::Black => Some([0.0; 3]),
        Samples::Packed(first) => Some(frame.samples.at(first + k, pixel)),
        Samples::Own(_) | Samples::Gone => None,
    }
}

/// What is added to a light's filtered colour: of its difference from the input the input's share, and of itself what the
/// stabilised picture's scale changes; and what the sum is multiplied by. Where nothing differs the colour stays to the bit. Without `blend`
/// the stabilised picture is the result.
#[inline(always)]
pub(crate) fn factors(before: Rgb, after: Rgb, blend: Option<&Blend>, (x, y): (usize, usize)) -> (f32, Rgb, Rgb) {
    let shares = blend.map_or([0.0, 0.0, 1.0], |blend| blend.shares.at(x, y));
    let whole = blend.and_then(|blend| blend.gain.as_ref()).map_or([1.0; 3], |gain| gain.at(x, y));
    (shares[0], factor(before, after).map(|factor| shares[2] * (factor - 1.0)), whole)
}
