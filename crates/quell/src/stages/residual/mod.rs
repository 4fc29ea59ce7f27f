//! Sequence filter: what the filtered light, and later the stabilised picture, misses of the frame's own samples,
//! smoothed, is given back.
//!
//! | | |
//! |---|---|
//! | reads | light as it came (I) and filtered (O); input (I) and stabilised picture (O) |
//! | writes | the filtered light, corrected; the stabilised picture, corrected |
//! | reach | light 52 pixels: of three levels a triangle of 6, 6 and 2 cells of 4, 2 and 2 pixels, and one and a half cells between which values are interpolated; picture 61, without the second level, but with the triangle once more in the first |
//! | equation | O' = O (1 + R s), R = sum k (I - O) / sum k O; k: triangle over cells, then bilinear between cells |
//! | s | n / (n + `residual.noise`^2) max(0, 1 - `residual.sure` V / \|R\|^2); n = N / 3 and V = N sum k^2 with N = sum_c sum k (I - O)^2 / (sum k O)^2, k of sum 1, but at least the mean by k of the cells' own (I - O)^2 / O^2 in the coarsest level: shrinkage by James and Stein (1961), one for the three channels. Of the picture: `residual.picture_sure`, noise 0, and in the coarsest level s is at least T / (T + V'), V' as V, but with the terms of N over 1 + R_c; T = max(0, m(min(16, \|R\|^2 / V')) - `residual.picture_around`) / m(1 / V'), m: mean by k over the windows around (empirical Bayes: Efron and Morris 1973) |
//! | source | the residual of the frame's own samples: ours, `docs/sequence.md` |
//! | parameters | `residual.*` |
//!
//! Neighbours in time bring light of other times: a lamp that was switched, a headlight that comes nearer. Where that
//! changes slowly over the picture no test of single samples finds it among their noise, but the mean of the residual
//! (I - O) over many pixels does. It is an independent judge: the frame's own samples are few among those that made O.
//! It is taken as a ratio, so that textures and edges stay, from coarse to fine windows, and only as far as it is
//! larger than its own noise. Small windows take the noise around into account: one which by chance has none of the
//! rare bright samples is too dark and looks certain. Light is corrected only where the samples have noise: of light
//! without it every stage sees itself that it changed, and what a residual then holds is shape. Sums are not weighted
//! by the brightness: O holds noise of I, and weights that fall with it lose energy (8 % of a night at 4 samples). A
//! light's joint planes are scaled with it. A pixel that came out as it went in stays.
//!
//! `stabilise` averages pictures of neighbouring frames, corrected each to its own time, so what it makes is corrected
//! once more. What one window alone does not show for certain, many windows side by side do: where light changes, the mean of their
//! squared residuals over their variances is above 1, and says how much residual to expect in each.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;
use crate::sequence::settings::Residual;

/// Of each level, from coarse to fine, the side of a cell in pixels, and the radius r in cells of the box that gives the
/// triangle when it is applied twice: the triangle reaches 2 r cells to each side.
pub(crate) const LEVELS: [(usize, usize); 3] = [(4, 3), (2, 3), (2, 1)];
/// Those of the picture: bands of rows are to need few rows around them.
pub(crate) const PICTURE_LEVELS: [(usize, usize); 2] = [LEVELS[0], LEVELS[2]];
/// Keeps quotients finite where light is black.
pub(crate) const LEAST: f32 = 1e-12;
/// The least variance of a residual, and the most that its square counts for among the windows around, in variances: a single one
/// decides nothing.
pub(crate) const LEAST_VARIANCE: f32 = 1e-9;
pub(crate) const MOST_SURE: f32 = 16.0;
/// Least of [`shown`].
pub(crate) const LEAST_SHOWN: f32 = 0.25;

/// How far a residual is trusted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trust {
    /// Its squared size below which nothing is corrected, in variances.
    pub sure: f32,
    /// In the coarsest level, the mean over the windows around above which light is taken to change there; `None`: each window decides
    /// alone.
    pub around: Option<f32>,
    /// Squared deviation of the samples, as a share of the light, at which half is corrected.
    pub noise: f32,
    /// What a level changes light by at the least and at the most, as a share of it.
    pub change: [f32; 2],
}

impl Trust {
    /// Of the filtered light.
    pub fn of_lights(s: &Residual) -> Self {
        Self { sure: s.sure, around: None, noise: s.noise * s.noise, change: [1.0 / s.most - 1.0, s.most - 1.0] }
    }

    /// Of the stabilised picture.
    pub fn of_picture(s: &Residual) -> Self {
        let around = (s.picture_around < MOST_SURE).then_some(s.picture_around);
        Self { sure: s.picture_sure, around, noise: 0.0, ..Self::of_lights(s) }
    }
}

/// How far the stage looks, of light.
pub(crate) fn reach() -> Reach {
    Reach::around(pixels(&LEVELS))
}

/// How far it looks in the stabilised picture.
pub(crate) fn picture_reach() -> Reach {
    // In the coarsest level the windows around as well.
    let (cell, radius) = PICTURE_LEVELS[0];
    Reach::around(pixels(&PICTURE_LEVELS) + cell * 2 * radius)
}

/// Of each level the triangle, and what lies at most between a pixel and the far end of the cells between which it is interpolated: half
/// a cell and the one beside it.
fn pixels(levels: &[(usize, usize)]) -> usize {
    levels.iter().map(|(cell, radius)| cell * 2 * radius + cell * 3 / 2).sum()
}

/// The triangle's weights, from its middle outwards; over the whole they add up to 1.
pub(crate) fn triangle(radius: usize) -> Vec<f32> {
    let side = (2 * radius + 1) as f32;
    (0..=2 * radius).map(|d| (side - d as f32) / (side * side)).collect()
}

/// Sum of the squares of the triangle's weights over both axes.
pub(crate) fn squares(triangle: &[f32]) -> f32 {
    let one: f32 = triangle[0] * triangle[0] + 2.0 * triangle[1..].iter().map(|k| k * k).sum::<f32>();
    one * one
}

/// The light that a window's samples show, over the filtered light. Where bright samples are rare, noise grows with it: over it, a
/// window that by chance has few of them is as uncertain as one with many, and energy is kept.
#[inline(always)]
pub(crate) fn shown(ratio: f32) -> f32 {
    (1.0 + ratio).clamp(LEAST_SHOWN, 1.0 / LEAST_SHOWN)
}

/// Cells that hold `extent` pixels from `first` on.
pub(crate) fn cells(first: usize, extent: usize, cell: usize) -> usize {
    (first + extent).div_ceil(cell) - first / cell
}

/// The cell of the coarsest level that holds cell `at` (as for [`between`]).
pub(crate) fn holding(first: usize, at: usize, cell: usize) -> usize {
    let coarsest = LEVELS[0].0;
    (first / cell + at) * cell / coarsest - first / coarsest
}

/// The two cells between which pixel `at` lies (of cells from the one that holds `first` on), and the share of the second.
pub(crate) fn between(first: usize, at: usize, cell: usize, cells: usize) -> (usize, usize, f32) {
    let twice = 2 * (first % cell + at) + 1;
    // Twice the distance from the first cell's middle, in pixels.
    if twice <= cell {
        return (0, 0, 0.0);
    }
    let (before, rest) = ((twice - cell) / (2 * cell), (twice - cell) % (2 * cell));
    let last = cells - 1;
    (before.min(last), (before + 1).min(last), rest as f32 / (2 * cell) as f32)
}

#[cfg(all(test, feature = "cpu"))]
mod tests {
    use super::*;
    use crate::frame::Rgb;
    use crate::plane::{Plane, Size};
    use crate::sequence::{Light, LightKind, SequenceFrame, SequenceSettings};
    use crate::window::{PreparedFrame, Rows};

    /// A ramp over cells comes back as a ramp over pixels, whatever row the image begins with; so do bands of a picture alike.
    #[test]
    fn cells_lie_where_the_picture_has_them() {
        for (cell, first) in [1, 2, 4].into_iter().flat_map(|cell| (0..9).map(move |first| (cell, first))) {
            let number = cells(first, 30, cell);
            let middle = |k: usize| ((first / cell + k) * cell) as f32 + cell as f32 / 2.0;
            for at in cell..30 - cell {
                let (a, b, t) = between(first, at, cell, number);
                let value = middle(a) + (middle(b) - middle(a)) * t;
                assert_eq!(value, (first + at) as f32 + 0.5, "{cell} {first} {at}");
            }
        }
    }

    #[test]
    fn the_triangle_is_a_mean() {
        for (_, radius) in LEVELS {
            let kernel = triangle(radius);
            assert!((kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }

    /// Samples of 0 or 2 by chance, mean 1, filtered to `filtered`; the last four columns came out as they went in. The corrected light.
    fn corrected(filtered: f32) -> Rows {
        let size = Size::new(96, 64);
        let mut state = 7u32;
        let own = Plane::from_fn(size, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            [if state >> 31 == 0 { 0.0 } else { 2.0 }; 3]
        });
        let mut colours = Rows::new(size, 3);
        for (x, y, c) in (0..64).flat_map(|y| (0..96).flat_map(move |x| (0..3).map(move |c| (x, y, c)))) {
            colours.set(x, y, c, if x < 92 { filtered } else { own.at(x, y)[c] });
        }
        let mut frame = SequenceFrame::new(0, size);
        frame.lights.push(Light::new("diffuse", LightKind::MatteDirect, own));
        let settings = SequenceSettings::default();
        let frame = PreparedFrame::new(frame, &settings).unwrap();
        let before = colours.clone();
        let after = cpu::run(&frame, &frame.slots, colours, &settings.residual);
        for (x, y) in (0..64).flat_map(|y| (92..96).map(move |x| (x, y))) {
            assert_eq!(after.colour(x, y, 0), before.colour(x, y, 0), "{x}, {y}");
        }
        after
    }

    fn mean(rows: &Rows, of: impl Fn(f32) -> f32) -> f32 {
        (0..64).flat_map(|y| (0..88).map(move |x| (x, y))).map(|(x, y)| of(rows.at(x, y, 1))).sum::<f32>()
            / (64.0 * 88.0)
    }

    /// Light of other times, a third too bright or too dark, goes; light that is right stays, and gets next to no noise.
    #[test]
    fn a_bias_goes_and_what_is_right_stays() {
        for filtered in [1.35, 0.7] {
            let after = mean(&corrected(filtered), |v| v);
            assert!((after - 1.0).abs() < 0.3 * (filtered - 1.0).abs(), "{filtered}: {after}");
        }
        let right = corrected(1.0);
        assert!((mean(&right, |v| v) - 1.0).abs() < 0.01);
        assert!(mean(&right, |v| (v - 1.0).powi(2)).sqrt() < 0.05);
    }

    /// One sample in `rare` is as bright, the others are black, and the filtered light is right: windows without bright samples look
    /// certain, and are not to be darkened.
    #[test]
    fn sparse_light_keeps_its_energy() {
        let (size, s) = (Size::new(192, 128), SequenceSettings::default().residual);
        let mut state = 3u32;
        for rare in [30, 100, 300] {
            let input = Plane::from_fn(size, |_, _| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                [if (state >> 8).is_multiple_of(rare) { rare as f32 } else { 0.0 }; 3]
            });
            let after = cpu::picture(0, &input, Plane::filled(size, [1.0; 3]), &s);
            let mean = after.data().iter().map(|c| c[1]).sum::<f32>() / size.pixels() as f32;
            assert!((mean - 1.0).abs() < 0.06, "one in {rare}: {mean}");
        }
    }

    /// The stabilised picture is corrected as light is, also where its samples have little noise.
    #[test]
    fn a_picture_of_other_times_is_corrected() {
        let size = Size::new(96, 64);
        let input = Plane::from_fn(size, |x, y| [1.0 + 0.02 * ((x * 7 + y * 3) % 5) as f32; 3]);
        let after = cpu::picture(0, &input, Plane::filled(size, [1.3; 3]), &SequenceSettings::default().residual);
        let mean = after.data().iter().map(|c| c[1]).sum::<f32>() / size.pixels() as f32;
        assert!((mean - 1.04).abs() < 0.01, "{mean}");
    }

    /// Bands of rows, wherever they begin, have the bits of the whole picture in the rows that lie so far within them.
    #[test]
    fn reach_is_what_decides() {
        let s = SequenceSettings::default().residual;
        let (width, height, reach) = (40, 180, picture_reach().pixels[1]);
        let mut state = 11u32;
        let input = Plane::from_fn(Size::new(width, height), |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            [if state >> 31 == 0 { 0.0 } else { 2.0 }; 3]
        });
        let corrected = |rows: std::ops::Range<usize>| {
            let band = Plane::from_fn(Size::new(width, rows.len()), |x, y| input.at(x, rows.start + y));
            // So little too bright that the windows around decide.
            cpu::picture(rows.start, &band, Plane::filled(band.size(), [1.07; 3]), &s)
        };
        let whole = corrected(0..height);
        let same = |core: usize, reach: usize| {
            let band = corrected(core - reach..core + 1 + reach);
            band.row(reach) == whole.row(core)
        };
        for core in 80..88 {
            assert!(same(core, reach), "row {core}");
        }
        assert!(!same(80, reach - 16));
    }

    /// A picture a twentieth too bright, which no window can tell from the noise of its samples, all of them can.
    #[test]
    fn windows_side_by_side_see_what_one_does_not() {
        let size = Size::new(192, 128);
        let mut state = 5u32;
        let input = Plane::from_fn(size, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            [if state >> 31 == 0 { 0.0 } else { 2.0 }; 3]
        });
        let mean = |plane: &Plane<Rgb>| plane.data().iter().map(|c| c[1]).sum::<f32>() / size.pixels() as f32;
        let left = |picture_around: f32| {
            let s = Residual { picture_around, ..SequenceSettings::default().residual };
            mean(&cpu::picture(0, &input, Plane::filled(size, [1.05; 3]), &s)) - mean(&input)
        };
        let (around, alone) = (left(SequenceSettings::default().residual.picture_around), left(MOST_SURE));
        assert!(around.abs() < 0.02 && alone > 0.025, "{around} {alone}");
    }
}
