//! Pixels whose picture was black, and is not any more: no factor gives their passes light, so they take that of the pixels around.

use super::{LEAST_PICTURE, mirror_colour_at, weight_at};
use crate::frame::Rgb;
use crate::plane::Plane;
use crate::sequence::LightKind;
use crate::stages::blend::Blend;
use crate::window::{LightSlot, PreparedFrame, Rows};

/// The most that light around is multiplied by: where the colour of a pixel is nearly black, so is the picture that light makes there.
const MOST: f32 = 16.0;

/// A pixel of which some channels were black.
struct Pixel {
    at: (usize, usize),
    /// What the mean of a light around is multiplied by; 0 in the other channels.
    gain: Rgb,
}

/// The black pixels to which the stabilised picture gives light, and the light that they take it from.
pub(super) struct BlackPixels<'a> {
    frame: &'a PreparedFrame,
    colours: &'a Rows,
    pixels: Vec<Pixel>,
}

impl<'a> BlackPixels<'a> {
    /// Arguments as those of [`super::reference::rescale`].
    pub(super) fn new(
        frame: &'a PreparedFrame,
        slots: &[LightSlot],
        colours: &'a Rows,
        [before, after]: [&Plane<Rgb>; 2],
        blend: Option<&Blend>,
    ) -> Self {
        let width = frame.features.size.width;
        let lit = |before: f32, after: f32| before <= LEAST_PICTURE && after > LEAST_PICTURE;
        let pixels = before.data().iter().zip(after.data()).enumerate();
        let black = pixels.filter(|(_, (before, after))| (0..3).any(|c| lit(before[c], after[c])));
        let found = black.map(|(p, (before, after))| {
            let at = (p % width, p / width);
            let mut around = [0.0f32; 3];
            for slot in slots.iter().filter(|slot| frame.in_beauty[slot.light]) {
                let light = mean_around(slot, 0, colours, at);
                let (weight, mirror) = (weight_at(frame, slot, p), mirror_colour_at(&frame.features, slot, p));
                (0..3).for_each(|c| around[c] += light[c] * weight[c] * mirror[c]);
            }
            let share = blend.map_or(1.0, |blend| blend.shares.at(at.0, at.1)[2]);
            let whole = blend.and_then(|blend| blend.gain.as_ref()).map_or([1.0; 3], |gain| gain.at(at.0, at.1));
            let gain = [0, 1, 2].map(|c| {
                let takes = lit(before[c], after[c]) && around[c] > LEAST_PICTURE;
                if takes { share * whole[c] * (after[c] / around[c]).min(MOST) } else { 0.0 }
            });
            Pixel { at, gain }
        });
        Self { frame, colours, pixels: found.filter(|pixel| pixel.gain != [0.0; 3]).collect() }
    }

    /// Adds their light to plane `k` of a light, as it is written.
    pub(super) fn add_to(&self, plane: &mut Plane<Rgb>, slot: &LightSlot, k: usize) {
        let width = plane.size().width;
        for Pixel { at, gain } in &self.pixels {
            let p = at.1 * width + at.0;
            let light = mean_around(slot, k, self.colours, *at);
            let mirror = mirror_colour_at(&self.frame.features, slot, p);
            (0..3).for_each(|c| plane.data_mut()[p][c] += gain[c] * light[c] * mirror[c]);
        }
    }
}

/// Mean of plane `k` of a light over the 3x3 pixels around; 0 of light without noise.
fn mean_around(slot: &LightSlot, k: usize, colours: &Rows, (x, y): (usize, usize)) -> Rgb {
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
    use super::super::{cpu, reference};
    use super::*;
    use crate::plane::Size;
    use crate::sequence::{SequenceSettings, testing::frame};
    use crate::stages::gather::{self, Gathered};

    /// Light as it came, but for one pixel that found none: its passes add up to the picture that it becomes, and hold what is around.
    /// Emission of the pixels beside it stays theirs; the other pixels keep their bits; nothing comes of nothing.
    #[test]
    fn a_black_pixel_takes_the_light_around() {
        let s = SequenceSettings::default();
        let mut frame = frame(0, Size::new(24, 18));
        // Where a volume is lit, emission has noise.
        frame.lights.retain(|light| light.kind != LightKind::Volume);
        let emissive = frame.lights.iter_mut().find(|light| light.kind == LightKind::NoiseFree).unwrap();
        emissive.light = Plane::filled(frame.size, [2.0; 3]);
        let here = PreparedFrame::new(frame, &s).unwrap();
        let Gathered { slots, mut colours, .. } = gather::cpu::run(&[&here], 0, &s.gather);
        let (size, (x, y)) = (here.features.size, (15, 8));
        let p = y * size.width + x;
        (0..colours.channels()).for_each(|channel| colours.set(x, y, channel, 0.0));
        let emission = slots.iter().find(|slot| slot.kind == LightKind::NoiseFree).unwrap();
        assert_eq!(colours.colour(x - 1, y, 3 * emission.first), [2.0; 3]);

        let before = cpu::sum(&here, &slots, &colours);
        assert_eq!(before.at(x, y), [0.0; 3]);
        let wanted = [0.4, 0.3, 0.2];
        let mut after = before.clone();
        after.data_mut()[p] = wanted;
        for rescale in [cpu::rescale, reference::rescale] {
            let passes = rescale(&here, &slots, &colours, [&before, &after], None);
            let mut total = [0.0f32; 3];
            for slot in slots.iter().filter(|slot| here.in_beauty[slot.light]) {
                let (light, weight) = (passes[slot.light][0].at(x, y), weight_at(&here, slot, p));
                (0..3).for_each(|c| total[c] += light[c] * weight[c]);
            }
            assert!((0..3).all(|c| (total[c] - wanted[c]).abs() < 1e-4 * wanted[c]), "{total:?} for {wanted:?}");
            assert_eq!(passes[emission.light][0].at(x, y), [0.0; 3]);
            let black = rescale(&here, &slots, &colours, [&before, &before], None);
            for (now, then) in passes.iter().flatten().zip(black.iter().flatten()) {
                assert_eq!(then.at(x, y), [0.0; 3]);
                assert!((0..size.pixels()).filter(|q| *q != p).all(|q| now.data()[q] == then.data()[q]));
            }
            let nothing = Rows::new(size, colours.channels());
            let passes = rescale(&here, &slots, &nothing, [&before, &after], None);
            assert!(passes.iter().flatten().all(|plane| plane.at(x, y) == [0.0; 3]));
        }
    }
}
