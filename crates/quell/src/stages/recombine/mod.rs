//! Sequence filter, around `stabilise` and `blend`: light and colour multiplied and added up to a picture (`sum`; of the light as it came:
//! `input`); then every pass made of what it was and what it became, as the picture is (`rescale`).
//!
//! | | |
//! |---|---|
//! | reads | light as it came and filtered, the colours that multiply it, the picture before and after `stabilise`, the shares and gains of `blend` |
//! | writes | the picture, the input; the passes |
//! | reach | 1 pixel, where the picture was black |
//! | equation | picture = sum light * weight * mirror colour; pass' = mirror colour * gain * (filtered + s_0 (raw - filtered) + s_2 (after / before - 1) filtered), channel by channel, s: the shares, whose sum is 1 |
//! | source | \[S] of the paper, "multiplied back"; the scale ours: `docs/sequence.md` |
//!
//! One factor a pixel and channel for all passes: they add up to the blended picture as they did before. Where the picture is
//! not positive after, after / before counts as 1. No factor gives light to a channel that was black (at few samples the rims
//! of mirrors and glass: no path found light, and no pixel shows the same). Its passes take after / around times their means
//! over the 3x3 pixels around, where around is the picture that these means would make in this pixel. Light without noise stays
//! as it is.

mod black;
#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Rgb;
use crate::reach::Reach;
use crate::stages::blend::Blend;
use crate::window::{Class, Features, LightSlot, PreparedFrame, Samples, Sparse};

/// A picture darker than this has no factor: 1.
pub(crate) const LEAST_PICTURE: f32 = 1e-8;

/// `sum` and `input` look at the pixel alone.
pub(crate) fn sum_reach() -> Reach {
    Reach::NONE
}

/// How far `rescale` looks.
pub(crate) fn rescale_reach() -> Reach {
    Reach::around(1)
}

/// The colour that a light was divided by in mirrors and clear glass; `None`: 1.
pub(crate) fn mirror_colour<'a>(features: &'a Features, slot: &LightSlot) -> Option<&'a Sparse<Rgb>> {
    features.mirror_colour.as_ref().filter(|_| Class::of(slot.kind) == Class::Seen)
}

/// The same in a pixel.
pub(crate) fn mirror_colour_at(features: &Features, slot: &LightSlot, pixel: usize) -> Rgb {
    mirror_colour(features, slot).and_then(|colour| colour.get(pixel)).unwrap_or([1.0; 3])
}

/// The colour that multiplies a light in the picture, without that of mirrors.
pub(crate) fn weight_at(frame: &PreparedFrame, slot: &LightSlot, pixel: usize) -> Rgb {
    frame.weights[slot.light].as_ref().map_or([1.0; 3], |weight| weight.at(pixel))
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
