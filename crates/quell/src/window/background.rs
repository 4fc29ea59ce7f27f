//! The background as mirrors show it, less its noise.
//!
//! Cycles' albedo of a mirror is that of what the mirror shows, a mean of samples. Where it shows the background, that is the
//! background's light: on waves as noisy as the reflection, since it is the reflection. Light that
//! is divided by it has no noise left, nothing is filtered, and the product has all of it again. So there the divisor is a mean over the
//! pixels around that show the background, too, as far as they differ by no more than noise does: edges of clouds stay.
//!
//! The noise is the least of second differences along four directions, pooled over 5x5 pixels: along an edge or a
//! stripe there is none.

use super::light_means::SECOND_DIFFERENCE;
use super::mirrors::WHITE;
use super::rows::Rows;
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Mirrors;
#[cfg(feature = "cpu")]
use crate::simd::widest;
use std::ops::Range;

#[cfg(not(feature = "cpu"))]
macro_rules! widest {
    ($call:expr) => {
        $call
    };
}

/// Half the side of the window of the noise.
const POOLED: usize = 2;
/// Columns and rows from the first of three pixels to the second.
const DIRECTIONS: [(usize, isize); 4] = [(1, 0), (0, 1), (1, 1), (1, -1)];
/// Channels of the image: a colour, and 1 where the pixel takes part.
const SHOWS: usize = 3;
const CHANNELS: usize = 4;
/// Channels of its noise: squared, summed over the colour's channels; and 1 where it is known.
const NOISE: usize = 0;
const KNOWN: usize = 1;

/// Smooths the colours that are seen in mirrors ([`WHITE`]: no mirror) where the normal seen there is short: most of the pixel's
/// samples left the scene.
pub(super) fn smooth(size: Size, colours: &mut [Rgb], seen_normal: &Plane<[f32; 3]>, s: &Mirrors) {
    let (w, radius) = (size.width, s.background_pixels as usize);
    let longest = s.background_normal * s.background_normal;
    let shows = |p: usize| colours[p] != WHITE && seen_normal.data()[p].iter().map(|v| v * v).sum::<f32>() < longest;
    if radius == 0 || !(0..colours.len()).any(shows) {
        return;
    }
    let mut image = Rows::new(size, CHANNELS);
    par::rows(image.data_mut(), CHANNELS * w, |y, row| {
        for x in (0..w).filter(|x| shows(y * w + x)) {
            (0..3).for_each(|c| row[c * w + x] = colours[y * w + x][c]);
            row[SHOWS * w + x] = 1.0;
        }
    });
    let mut noise = Rows::new(size, 2);
    par::rows(noise.data_mut(), 2 * w, |y, row| widest!(least_differences(&image, y, row)));
    par::rows(colours, w, |y, row| {
        if image.row(y, SHOWS).contains(&1.0) {
            widest!(smooth_row((&image, &noise), (y, radius), s.background_deviations, row));
        }
    });
}

/// Of a row the least second difference of each pixel, and 1 where all four directions are known: at the border of the picture and of
/// the mirror an edge would be taken for noise. `out` is 0 before.
#[inline(always)]
fn least_differences(image: &Rows, y: usize, out: &mut [f32]) {
    let Size { width: w, height: h } = image.size();
    let (least, known) = out.split_at_mut(w);
    least.fill(f32::MAX);
    for (dx, dy) in DIRECTIONS {
        let rows = (y.checked_add_signed(-dy), y.checked_add_signed(dy).filter(|y| *y < h));
        let (Some(before), Some(after)) = rows else { continue };
        let Some(n) = w.checked_sub(2 * dx).filter(|n| before < h && *n > 0) else { continue };
        let of =
            |c: usize| [&image.row(before, c)[..n], &image.row(y, c)[dx..][..n], &image.row(after, c)[2 * dx..][..n]];
        let ([red, green, blue], shows) = ([of(0), of(1), of(2)], of(SHOWS));
        let (least, known) = (&mut least[dx..][..n], &mut known[dx..][..n]);
        for i in 0..n {
            let r = red[0][i] - 2.0 * red[1][i] + red[2][i];
            let g = green[0][i] - 2.0 * green[1][i] + green[2][i];
            let b = blue[0][i] - 2.0 * blue[1][i] + blue[2][i];
            let all = shows[0][i] * shows[1][i] * shows[2][i];
            let found = (r * r + g * g + b * b) / SECOND_DIFFERENCE;
            least[i] = least[i].min(found);
            known[i] += all;
        }
    }
    for (least, known) in least.iter_mut().zip(known) {
        let all = *known == DIRECTIONS.len() as f32;
        (*least, *known) = if all { (*least, 1.0) } else { (0.0, 0.0) };
    }
}

/// The colours of a row after the mean; those of pixels that take no part stay.
#[inline(always)]
fn smooth_row((image, noise): (&Rows, &Rows), (y, radius): (usize, usize), deviations: f32, row: &mut [Rgb]) {
    let Size { width: w, height: h } = image.size();
    let mut kept = par::scratch(6 * w);
    let (tolerance, rest) = kept.split_at_mut(w);
    let (known, rest) = rest.split_at_mut(w);
    let (count, rest) = rest.split_at_mut(w);
    let (red, rest) = rest.split_at_mut(w);
    let (green, blue) = rest.split_at_mut(w);
    for v in y.saturating_sub(POOLED)..(y + POOLED + 1).min(h) {
        for d in 0..=2 * POOLED {
            let Overlap { here, there } = Overlap::of(w, d, POOLED);
            let (found, is_known) = (&noise.row(v, NOISE)[there.clone()], &noise.row(v, KNOWN)[there]);
            tolerance[here.clone()].iter_mut().zip(found).for_each(|(sum, v)| *sum += v);
            known[here].iter_mut().zip(is_known).for_each(|(sum, v)| *sum += v);
        }
    }
    // Squared differences of two pixels have twice the noise of one. A pixel that stands out alone is noise that the others do not have.
    let squared = 2.0 * deviations * deviations;
    let own = noise.row(y, NOISE);
    for ((sum, known), own) in tolerance.iter_mut().zip(&*known).zip(own) {
        *sum = squared * (*sum / known.max(1.0)).max(*own) + f32::MIN_POSITIVE;
    }
    for v in y.saturating_sub(radius)..(y + radius + 1).min(h) {
        for d in 0..=2 * radius {
            let Overlap { here, there } = Overlap::of(w, d, radius);
            let n = here.len();
            let at = |y: usize, c: usize, columns: &Range<usize>| &image.row(y, c)[columns.clone()][..n];
            let (own_red, own_green, own_blue) = (at(y, 0, &here), at(y, 1, &here), at(y, 2, &here));
            let (its_red, its_green, its_blue) = (at(v, 0, &there), at(v, 1, &there), at(v, 2, &there));
            let shows = at(v, SHOWS, &there);
            let tolerance = &tolerance[here.clone()][..n];
            let (count, red) = (&mut count[here.clone()][..n], &mut red[here.clone()][..n]);
            let (green, blue) = (&mut green[here.clone()][..n], &mut blue[here.clone()][..n]);
            for i in 0..n {
                let (r, g, b) = (own_red[i] - its_red[i], own_green[i] - its_green[i], own_blue[i] - its_blue[i]);
                let weight = (1.0 - (r * r + g * g + b * b) / tolerance[i]).max(0.0) * shows[i];
                count[i] += weight;
                red[i] += weight * its_red[i];
                green[i] += weight * its_green[i];
                blue[i] += weight * its_blue[i];
            }
        }
    }
    let shows = image.row(y, SHOWS);
    for (x, colour) in row.iter_mut().enumerate().filter(|(x, _)| shows[*x] > 0.0) {
        *colour = [red[x] / count[x], green[x] / count[x], blue[x] / count[x]];
    }
}

/// The pixels of a row whose neighbour lies in it, and these neighbours.
struct Overlap {
    here: Range<usize>,
    there: Range<usize>,
}

impl Overlap {
    /// Of neighbours `d` - `radius` columns to the right.
    fn of(w: usize, d: usize, radius: usize) -> Self {
        let (left, right) = (radius.saturating_sub(d).min(w), d.saturating_sub(radius).min(w));
        Self { here: left..(w - right).max(left), there: right.min(w - left)..w - left }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size::new(37, 21);

    fn smoothed(at: impl Fn(usize, usize) -> Rgb, normal: impl Fn(usize, usize) -> [f32; 3]) -> (Vec<Rgb>, Vec<Rgb>) {
        let before: Vec<Rgb> = (0..SIZE.pixels()).map(|p| at(p % SIZE.width, p / SIZE.width)).collect();
        let mut after = before.clone();
        smooth(SIZE, &mut after, &Plane::from_fn(SIZE, normal), &Mirrors::default());
        (before, after)
    }

    /// White noise of deviation 0.1 or so.
    fn noise(x: usize, y: usize) -> f32 {
        let mixed = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
        let mixed = (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d);
        0.35 * (((mixed ^ mixed >> 12) >> 8) as f32 / (1 << 24) as f32 - 0.5)
    }

    fn deviation(colours: &[Rgb]) -> (f32, f32) {
        let mean = colours.iter().map(|c| c[0]).sum::<f32>() / colours.len() as f32;
        (mean, (colours.iter().map(|c| (c[0] - mean).powi(2)).sum::<f32>() / colours.len() as f32).sqrt())
    }

    #[test]
    fn noise_of_an_even_background_goes_and_its_mean_stays() {
        let (before, after) = smoothed(|x, y| [0.5 + noise(x, y); 3], |_, _| [0.0; 3]);
        let ((mean, noisy), (kept, left)) = (deviation(&before), deviation(&after));
        assert!(noisy > 0.08 && left < 0.4 * noisy, "{noisy} {left}");
        assert!((kept / mean - 1.0).abs() < 0.01, "{mean} {kept}");
    }

    #[test]
    fn edges_and_slopes_without_noise_stay() {
        let edge = |x: usize, _: usize| if x < 17 { [0.2f32, 0.3, 0.6] } else { [0.8, 0.8, 0.9] };
        let slope = |x: usize, y: usize| [0.1 + 0.01 * x as f32, 0.2 + 0.02 * y as f32, 0.5f32];
        for (name, at) in [("edge", &edge as &dyn Fn(usize, usize) -> Rgb), ("slope", &slope)] {
            let (before, after) = smoothed(at, |_, _| [0.0; 3]);
            for (i, (before, after)) in before.iter().zip(&after).enumerate() {
                assert!((0..3).all(|c| (before[c] - after[c]).abs() < 1e-3), "{name}, {i}: {before:?} {after:?}");
            }
        }
    }

    /// A thing in the mirror, and what is no mirror, neither change nor count.
    #[test]
    fn only_the_background_takes_part() {
        let thing = |x: usize| x >= 20;
        let at = |x: usize, y: usize| match x {
            0..=4 => WHITE,
            _ if thing(x) => [5.0 + noise(x, y); 3],
            _ => [0.5 + noise(x, y); 3],
        };
        let (before, after) = smoothed(at, |x, _| if thing(x) { [0.0, 0.6, 0.8] } else { [0.1, 0.0, 0.2] });
        for (i, (before, after)) in before.iter().zip(&after).enumerate() {
            let x = i % SIZE.width;
            assert_eq!(before == after, x < 5 || thing(x), "{i}: {before:?} {after:?}");
            assert!(thing(x) || after[0] < 1.1, "{i}: {after:?}");
        }
    }
}
