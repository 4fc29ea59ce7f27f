//! Of each light of a frame its mean around each pixel, and how sure that mean is: what tells whether another frame shows
//! the same light there.
//!
//! Two steps. First the mean luminance over 5x5 pixels of the same surface, in which pixels count less as they differ by more than their noise:
//! stripes, edges of shadows and what mirrors show stay apart as samples grow. Then the mean of 25 such windows side by side, again as far as they
//! are equal but for noise: with few samples a lamp that was switched off is seen only over many pixels. The noise of
//! a pixel is found from second differences along the direction in which they are least, so that structure is not taken for
//! noise. Mean and the deviation of that mean are kept in half precision, scaled where a frame holds colours beyond it.
//! What a surface or the sky emits has noise only behind a medium, where a ray gets there by chance: where no medium is
//! lit in 5x5 pixels its deviation is [`FREE`].
//! All is made for the whole frame, so that a band of rows finds the same.

#[cfg(feature = "cpu")]
mod cpu;
#[cfg(any(test, not(feature = "cpu")))]
mod reference;

use super::features::Features;
use super::local::Class;
use super::packed::Packed;
use super::prepared::{LightSlot, Samples};
use crate::kernels::halves::widen;
use crate::sequence::LightKind;
use crate::sequence::settings::Gather;
use half::f16;

/// Pixels around a pixel, each way.
const RADIUS: isize = 2;
/// Sides of these windows, and how many of them to each side are looked at.
const WINDOW: isize = 2 * RADIUS + 1;
const STEPS: isize = 2;
/// Keeps the tolerance finite where the light is next to nothing beside its noise.
const STRONGEST: f32 = 1e4;
/// Keeps quotients finite where nothing varies.
const LEAST: f32 = 1e-20;
/// Variance of the second difference a - 2 b + c of independent values of variance 1.
pub(super) const SECOND_DIFFERENCE: f32 = 6.0;
/// Luminances beyond it count as it: squares stay finite.
const MOST: f32 = 1e15;
/// Means and deviations are no larger than the largest sample, and half precision holds twice this.
const LARGEST: f32 = 32768.0;
/// Stands for a deviation where a light has no noise at all.
const FREE: f32 = -1.0;

/// A light whose means are asked for.
struct Asked {
    /// Its first plane.
    first: usize,
    /// Surfaces bound it.
    bounded: bool,
    /// It has noise only behind a medium.
    behind: bool,
}

/// Means of the lights of a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightMeans {
    /// Lights that have samples; 0: nothing is known.
    pub lights: usize,
    /// Of each light of the frame its place below.
    pub places: Vec<Option<usize>>,
    /// What the numbers below are multiplied by: a power of two, 1 where half precision holds every colour.
    pub scale: f32,
    /// Of each pixel the means of all lights, then their deviations.
    pub data: Vec<f16>,
}

impl LightMeans {
    /// `behind`: of each light whether it has noise only behind a medium.
    pub(crate) fn new(
        f: &Features,
        slots: &[LightSlot],
        behind: &[bool],
        stored: &[Samples],
        samples: &Packed,
        s: &Gather,
    ) -> Self {
        let mut places = vec![None; stored.len()];
        let mut lights: Vec<Asked> = Vec::new();
        // First planes of the light of media.
        let mut media: Vec<usize> = Vec::new();
        for (slot, behind) in slots.iter().zip(behind) {
            if let Samples::Packed(first) = stored[slot.light] {
                places[slot.light] = Some(lights.len());
                lights.push(Asked { first, bounded: Class::of(slot.kind) != Class::Free, behind: *behind });
                if slot.kind == LightKind::Volume {
                    media.push(first);
                }
            }
        }
        let brightest = samples.beyond.iter().flat_map(|(_, c)| c).fold(0.0f32, |most, v| most.max(v.abs()));
        let mut scale = 1.0f32;
        while brightest.min(MOST) / scale > LARGEST {
            scale *= 2.0;
        }
        let n = lights.len();
        #[cfg(feature = "cpu")]
        let data = cpu::data(f, &lights, &media, samples, scale, s);
        #[cfg(not(feature = "cpu"))]
        let data = reference::data(f, &lights, &media, samples, scale, s);
        Self { lights: n, places, scale, data }
    }

    /// Mean and its deviation, which is below 0 where the light has no noise.
    #[inline(always)]
    pub(crate) fn at(&self, place: usize, pixel: usize) -> [f32; 2] {
        self.halves(place, pixel).map(|v| widen(v) * self.scale)
    }

    /// The same as it is kept.
    #[inline(always)]
    pub(crate) fn halves(&self, place: usize, pixel: usize) -> [f16; 2] {
        let run = &self.data[2 * pixel * self.lights..][..2 * self.lights];
        [run[place], run[self.lights + place]]
    }
}

#[cfg(all(test, feature = "cpu"))]
mod tests {
    use super::*;
    use crate::plane::Size;
    use crate::sequence::SequenceSettings;
    use crate::sequence::testing::frame;
    use crate::window::PreparedFrame;

    /// At every edge, in mirrors, behind media, with colours beyond half precision.
    #[test]
    fn the_twin_on_vectors_gives_the_same_bits() {
        let settings = SequenceSettings::default();
        for (w, h) in [(53, 31), (16, 3), (1, 1), (33, 2), (40, 12)] {
            for beyond in [false, true] {
                let mut frame = frame(3, Size::new(w, h));
                if beyond {
                    frame.lights[1].light.data_mut()[w * h / 2] = [1e9, 2e7, 3.0];
                }
                let made = PreparedFrame::new(frame, &settings).unwrap();
                let (f, samples) = (&made.features, &made.samples);
                assert_eq!(samples.beyond.is_empty(), !beyond);
                let packed = made.slots.iter().filter_map(|slot| match made.stored[slot.light] {
                    Samples::Packed(first) => Some((slot, first)),
                    _ => None,
                });
                let (mut lights, mut media) = (Vec::new(), Vec::new());
                for (slot, first) in packed {
                    let bounded = Class::of(slot.kind) != Class::Free;
                    lights.push(Asked { first, bounded, behind: lights.len() % 3 == 1 });
                    if slot.kind == LightKind::Volume {
                        media.push(first);
                    }
                }
                assert!(lights.len() > 5 || w * h < 9);
                // Means must fit half precision.
                let scale = if beyond { 65536.0 } else { 1.0 };
                for media in [&media[..], &[]] {
                    let of = |data: Vec<f16>| data.into_iter().map(f16::to_bits).collect::<Vec<_>>();
                    let expected = of(reference::data(f, &lights, media, samples, scale, &settings.gather));
                    let found = of(cpu::data(f, &lights, media, samples, scale, &settings.gather));
                    assert!(found == expected, "{w}x{h}, beyond {beyond}");
                }
            }
        }
    }
}
