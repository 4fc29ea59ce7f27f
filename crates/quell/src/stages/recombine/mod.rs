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

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Rgb;
use crate::plane::Plane;
use crate::reach::Reach;
use crate::sequence::LightKind;
use crate::stages::blend::Blend;
use crate::window::{Class, Features, LightSlot, PreparedFrame, Rows, Samples, Sparse};

/// A picture darker than this has no factor: 1.
pub(crate) const LEAST_PICTURE: f32 = 1e-8;

/// The most that light around is multiplied by to stand for that of a black pixel: where the colour is nearly black so is the picture around.
const MOST_AROUND: f32 = 16.0;

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

/// A pixel whose picture was black in some channels, and is not any more.
pub(crate) struct Black {
    pub at: (usize, usize),
    /// What the mean of a light over the 3x3 pixels around is multiplied by and added to what it is; 0 in the other channels.
    pub gain: Rgb,
}

/// The black pixels to which the stabilised picture gives light. Arguments as those of [`reference::rescale`].
pub(crate) fn black_pixels(
    frame: &PreparedFrame,
    slots: &[LightSlot],
    colours: &Rows,
    [before, after]: [&Plane<Rgb>; 2],
    blend: Option<&Blend>,
) -> Vec<Black> {
    let width = frame.features.size.width;
    let gains = |c: usize, before: Rgb, after: Rgb| before[c] <= LEAST_PICTURE && after[c] > LEAST_PICTURE;
    let pixels = before.data().iter().zip(after.data()).enumerate();
    let dark = pixels.filter(|(_, (before, after))| (0..3).any(|c| gains(c, **before, **after)));
    let black = dark.filter_map(|(p, (before, after))| {
        let at = (p % width, p / width);
        let mut around = [0.0f32; 3];
        for slot in slots.iter().filter(|slot| frame.in_beauty[slot.light]) {
            let light = light_around(slot, 0, colours, at);
            let weight = frame.weights[slot.light].as_ref().map_or([1.0; 3], |weight| weight.at(p));
            let mirror = mirror_colour(&frame.features, slot).and_then(|colour| colour.get(p)).unwrap_or([1.0; 3]);
            for c in 0..3 {
                around[c] += light[c] * weight[c] * mirror[c];
            }
        }
        let (share, whole) = blend.map_or((1.0, [1.0; 3]), |blend| {
            (blend.shares.at(at.0, at.1)[2], blend.gain.as_ref().map_or([1.0; 3], |gain| gain.at(at.0, at.1)))
        });
        let gain = [0, 1, 2].map(|c| {
            let lit = gains(c, *before, *after) && around[c] > LEAST_PICTURE;
            if lit { share * whole[c] * (after[c] / around[c]).min(MOST_AROUND) } else { 0.0 }
        });
        (gain != [0.0; 3]).then_some(Black { at, gain })
    });
    black.collect()
}

/// Mean of plane `k` of a light over the 3x3 pixels around; 0 of light without noise.
pub(crate) fn light_around(slot: &LightSlot, k: usize, colours: &Rows, (x, y): (usize, usize)) -> Rgb {
    if slot.kind == LightKind::NoiseFree {
        return [0.0; 3];
    }
    let (size, mut sum, mut count) = (colours.size(), [0.0f32; 3], 0.0f32);
    for qy in y.saturating_sub(1)..(y + 2).min(size.height) {
        for qx in x.saturating_sub(1)..(x + 2).min(size.width) {
            let light = colours.colour(qx, qy, 3 * (slot.first + k));
            (0..3).for_each(|c| sum[c] += light[c]);
            count += 1.0;
        }
    }
    sum.map(|v| v / count)
}

#[cfg(all(test, feature = "cpu"))]
mod tests {
    use super::*;
    use crate::plane::Size;
    use crate::sequence::{SequenceSettings, testing::frame};
    use crate::stages::gather::Gathered;

    /// Light as it came, but for one pixel that found none: the passes add up to the picture that it becomes, with the colours of what is
    /// around. Emission stays as it is, and nothing comes from nowhere.
    #[test]
    fn a_black_pixel_takes_the_light_around() {
        let s = SequenceSettings::default();
        let here = PreparedFrame::new(frame(0, Size::new(24, 18)), &s).unwrap();
        let Gathered { slots, colours, .. } = crate::stages::gather::cpu::run(&[&here], 0, &s.gather);
        let (x, y) = (15, 8);
        let mut dark = colours.clone();
        let planes = slots.iter().filter(|slot| slot.kind != LightKind::NoiseFree);
        for channel in planes.flat_map(|slot| 3 * slot.first..3 * (slot.first + slot.planes)) {
            dark.set(x, y, channel, 0.0);
        }
        let lit: Vec<_> = slots.iter().filter(|slot| slot.kind != LightKind::NoiseFree).copied().collect();
        let before = cpu::sum(&here, &lit, &dark);
        assert_eq!(before.at(x, y), [0.0; 3]);
        let wanted = [0.4, 0.3, 0.2];
        let mut after = before.clone();
        let p = y * here.features.size.width + x;
        after.data_mut()[p] = wanted;
        let passes = cpu::rescale(&here, &lit, &dark, [&before, &after], None);
        let mut total = [0.0f32; 3];
        for slot in lit.iter().filter(|slot| here.in_beauty[slot.light]) {
            let weight = here.weights[slot.light].as_ref().map_or([1.0; 3], |weight| weight.at(p));
            let light = passes[slot.light][0].at(x, y);
            (0..3).for_each(|c| total[c] += light[c] * weight[c]);
        }
        assert!((0..3).all(|c| (total[c] - wanted[c]).abs() < 1e-4 * wanted[c]), "{total:?} for {wanted:?}");
        let unchanged = cpu::rescale(&here, &lit, &dark, [&before, &before], None);
        for (now, then) in passes.iter().flatten().zip(unchanged.iter().flatten()) {
            assert!((0..now.data().len()).filter(|q| *q != p).all(|p| now.data()[p] == then.data()[p]));
        }
        let nothing = Rows::new(here.features.size, colours.channels());
        let passes = cpu::rescale(&here, &slots, &nothing, [&before, &after], None);
        assert!(passes.iter().flatten().all(|plane| plane.at(x, y) == [0.0; 3]));
    }
}
