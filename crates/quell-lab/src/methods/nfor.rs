//! `nfor`: nonlinearly weighted first-order regression (Bitterli, Rousselle, Moon, Iglesias-Guitian, Adler, Mitchell,
//! Jarosz, Novak, EGSR 2016).
//!
//! Weights come from colour alone, the regression from features alone: features that say nothing about colour then do
//! no harm. Constants and departures: docs/baselines-offline.md.

use super::offline::image::{Colour, Image, LANES};
use super::offline::noisy::{FEATURES, FilteredFeature, Halves, features, finished, sample_variance};
use super::offline::solve::{solve, sums};
use super::offline::weights::{Guide, Kernel, Noisy, TILE, Tile, each_offset, each_tile, filter};
use super::{Input, Method};
use crate::error::Error;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use quell::{Plane, Rgb};

/// Step 1: non-local means of features.
const FEATURE_KERNEL: Kernel = Kernel { radius: 5, patch: 3, k: 0.5 };
/// Step 2: the two strengths of which one is chosen by its error.
const CANDIDATES: [f32; 2] = [0.5, 1.0];
const REGRESSION: Kernel = Kernel { radius: 9, patch: 3, k: 1.0 };
/// Steps 3 and 4: non-local means of error estimates and of the selection.
const ERROR_KERNEL: Kernel = Kernel { radius: 9, patch: 1, k: 1.0 };
/// Step 5: non-local means of the features' residual noise.
const SECOND_FEATURE_KERNEL: Kernel = Kernel { radius: 2, patch: 3, k: 0.5 };

/// Columns of the regression: 1, dx, dy, features.
const COLUMNS: usize = 3 + FEATURES;
/// Columns and right-hand sides: red, green, blue.
const WIDTH: usize = COLUMNS + 3;
const SUMS: usize = sums(COLUMNS, 3);
/// Neighbours whose products are added up before a sum is stored.
const RUN: usize = 4;

/// The method.
#[derive(Debug)]
pub struct Nfor {
    level: Level,
}

impl Default for Nfor {
    fn default() -> Self {
        Self { level: Level::new() }
    }
}

impl Method for Nfor {
    fn name(&self) -> String {
        "nfor".to_owned()
    }

    fn needs_halves(&self) -> bool {
        true
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let noisy = Halves::of("nfor", input)?;
        let variance = noisy.variance(sample_variance(input).as_ref());
        // Section 5.1: prefiltered features (noise-free ones stay as they are).
        let features = features(input).map(|f| f.prefiltered(self.level, &FEATURE_KERNEL));
        let denoised = self.denoise_colour(&noisy, &variance, &features);
        Ok(finished(input, &denoised))
    }
}

/// The blended candidates, and what the choice was made from.
#[cfg_attr(not(test), expect(dead_code, reason = "the tests look at errors and shares"))]
pub(crate) struct Selection {
    /// Blended halves.
    pub(crate) halves: Halves,
    /// Estimated mean squared error of each candidate, mean over channels, filtered.
    pub(crate) errors: [Image; 2],
    /// Share of the first candidate, 0..1.
    pub(crate) share: Image,
}

impl Nfor {
    fn denoise_colour(&self, noisy: &Halves, variance: &Colour, features: &[FilteredFeature; 3]) -> Colour {
        let of_half = |h: usize| features.iter().flat_map(|f| f.halves[h].clone()).collect::<Vec<_>>();
        // Section 5.2: collaborative regression of each half with weights and features from the other.
        let half_variance: Colour = std::array::from_fn(|c| variance[c].map(|v| 2.0 * v));
        let (features_a, features_b) = (of_half(0), of_half(1));
        let candidates = CANDIDATES.map(|k| {
            let kernel = Kernel { k, ..REGRESSION };
            Halves {
                a: self.regress(&noisy.a, &features_b, &noisy.b, &half_variance, &kernel),
                b: self.regress(&noisy.b, &features_a, &noisy.a, &half_variance, &kernel),
            }
        });
        let Selection { halves, .. } = self.select(noisy, variance, &candidates);
        // Section 5.4: the second pass, on the mean of the halves and with the variance that is left.
        let second: Vec<Image> = features.iter().flat_map(|f| self.residual(f)).collect();
        self.regress(&halves.mean(), &second, &halves.mean(), &halves.raw_variance(), &REGRESSION)
    }

    /// Section 5.4: the mean of a feature's halves, its residual noise filtered.
    fn residual(&self, feature: &FilteredFeature) -> Vec<Image> {
        let mean = feature.mean();
        let Some(variance) = &feature.variance else { return mean };
        let channels = mean.iter().zip(variance).map(|(value, variance)| Noisy { value, variance }).collect();
        let guide = Guide { colour: channels, features: vec![] };
        mean.iter().flat_map(|m| filter(self.level, &guide, &SECOND_FEATURE_KERNEL, [m]).channels).collect()
    }

    /// Section 5.3: estimates each candidate's error, and blends where one is better.
    pub(crate) fn select(&self, noisy: &Halves, variance: &Colour, candidates: &[Halves; 2]) -> Selection {
        let mean = noisy.mean();
        let raw = noisy.raw_variance();
        let errors = [0, 1].map(|i| squared_error(noisy, &raw, &candidates[i]));
        let channels = mean.iter().zip(variance).map(|(value, variance)| Noisy { value, variance }).collect();
        let guide = Guide { colour: channels, features: vec![] };
        let smooth = |image: [&Image; 1]| {
            let [image] = filter(self.level, &guide, &ERROR_KERNEL, image).channels;
            image
        };
        let errors = filter(self.level, &guide, &ERROR_KERNEL, [&errors[0], &errors[1]]).channels;
        let first = errors[0].zip(&errors[1], |a, b| f32::from(u8::from(a < b)));
        let share = smooth([&first]);
        let blend = |a: &Colour, b: &Colour| -> Colour {
            std::array::from_fn(|c| {
                let towards = a[c].zip(&share, |a, s| a * s);
                let other = b[c].zip(&share, |b, s| b * (1.0 - s));
                towards.zip(&other, |x, y| x + y)
            })
        };
        let halves =
            Halves { a: blend(&candidates[0].a, &candidates[1].a), b: blend(&candidates[0].b, &candidates[1].b) };
        Selection { halves, errors, share }
    }

    /// First-order regression of `input` on `features` with weights from `guide`; every pixel's model fills its whole
    /// window, and what the models say about a pixel is averaged (section 5.2, collaborative).
    pub(crate) fn regress(
        &self,
        input: &Colour,
        features: &[Image],
        guide: &Colour,
        variance: &Colour,
        kernel: &Kernel,
    ) -> Colour {
        let size = input[0].size();
        let inside = Image::filled(size, 1.0);
        let Ok(planes): Result<[&Image; FEATURES + 3], _> = features.iter().chain(input).collect::<Vec<_>>().try_into()
        else {
            // Every caller brings all features.
            return input.clone();
        };
        let guide = guide.iter().zip(variance).map(|(value, variance)| Noisy { value, variance }).collect();
        let problem = Problem {
            planes,
            guide: Guide { colour: guide, features: vec![] },
            kernel: *kernel,
            taps: taps(kernel.radius, inside.stride()),
            inside: &inside,
        };
        let mut sum: [Image; 4] = std::array::from_fn(|_| Image::filled(size, 0.0));
        each_tile(
            size,
            |tile| dispatch!(self.level, simd => problem.tile(simd, tile)),
            |tile, splats| {
                let radius = kernel.radius;
                let (width, height) = splat_size(radius);
                for (image, splat) in sum.iter_mut().zip(splats.chunks_exact(width * height)) {
                    for row in 0..tile.rows + 2 * radius {
                        let begin =
                            inside.index(tile.x, tile.y) + row * inside.stride() - radius * inside.stride() - radius;
                        let columns = tile.groups * LANES + 2 * radius;
                        let source = &splat[row * width..][..columns];
                        image.data_mut()[begin..][..columns].iter_mut().zip(source).for_each(|(a, b)| *a += b);
                    }
                }
            },
        );
        let [r, g, b, weight] = sum;
        [r, g, b].map(|channel| {
            let mut mean = channel.zip(&weight, |c, w| if w > 0.0 { c / w } else { 0.0 });
            mean.repeat_edges();
            mean
        })
    }
}

/// Section 5.3: the squared error of a collaborative estimate, mean over channels, before any filter. The error of each
/// filtered half against the other noisy half, less that half's variance, is that of the filtered half; the mean of both
/// halves has less variance, by a quarter of their squared difference. `raw` is the unsmoothed variance of the mean.
pub(crate) fn squared_error(noisy: &Halves, raw: &Colour, filtered: &Halves) -> Image {
    let of_channel = |c: usize| {
        let against = |noisy: &Image, filtered: &Image| noisy.zip(filtered, |n, f| (n - f) * (n - f));
        let ma = against(&noisy.b[c], &filtered.a[c]).zip(&raw[c], |e, v| e - 2.0 * v);
        let mb = against(&noisy.a[c], &filtered.b[c]).zip(&raw[c], |e, v| e - 2.0 * v);
        let apart = against(&filtered.a[c], &filtered.b[c]);
        ma.zip(&mb, |a, b| 0.5 * (a + b)).zip(&apart, |m, d| m - 0.25 * d)
    };
    let [r, g, b] = [0, 1, 2].map(of_channel);
    r.zip(&g, |r, g| r + g).zip(&b, |rg, b| (rg + b) / 3.0)
}

/// A neighbour in the window.
#[derive(Clone, Copy)]
struct Tap {
    dx: isize,
    dy: isize,
    /// Elements from the centre.
    offset: isize,
}

/// The window in reading order, as [`each_offset`] goes through it.
fn taps(radius: usize, stride: usize) -> Vec<Tap> {
    let r = radius as isize;
    let tap = |dy: isize, dx: isize| Tap { dx, dy, offset: dy * stride as isize + dx };
    (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| tap(dy, dx))).collect()
}

/// Columns and rows of what a tile's models fill.
const fn splat_size(radius: usize) -> (usize, usize) {
    (TILE.width + 2 * radius, TILE.height + 2 * radius)
}

struct Problem<'a> {
    /// Features, then colour.
    planes: [&'a Image; FEATURES + 3],
    guide: Guide<'a>,
    kernel: Kernel,
    taps: Vec<Tap>,
    inside: &'a Image,
}

impl Problem<'_> {
    /// Fits all models of a tile: four images of [`splat_size`], colour times weight and weight.
    #[inline(always)]
    fn tile<S: Simd>(&self, simd: S, tile: Tile) -> Vec<f32> {
        let count = self.taps.len();
        // A pixel's weights lie together, in vectors of neighbouring pixels.
        let mut weights = vec![0.0_f32; tile.rows * tile.groups * count * LANES];
        each_offset(
            simd,
            &self.guide,
            &self.kernel,
            self.inside,
            tile,
            #[inline(always)]
            |number, _, _, w| {
                for row in 0..tile.rows {
                    for group in 0..tile.groups {
                        let to = ((row * tile.groups + group) * count + number) * LANES;
                        weights[to..to + LANES].copy_from_slice(&w[row * TILE.width + group * LANES..][..LANES]);
                    }
                }
            },
        );
        let (width, height) = splat_size(self.kernel.radius);
        let mut splats = vec![0.0_f32; 4 * width * height];
        for (i, weights) in weights.chunks_exact(count * LANES).enumerate() {
            let (row, group) = (i / tile.groups, i % tile.groups);
            let centre = self.inside.index(tile.x + group * LANES, tile.y + row);
            // Lanes beyond the right edge belong to no pixel.
            let mine = f32x16::from_slice(simd, &self.inside.data()[centre..centre + LANES]);
            let model = solve::<S, COLUMNS, 3>(simd, &self.normal_equations(simd, centre, weights));
            self.splat(simd, centre, weights, mine, &model, &mut splats, row * width + group * LANES);
        }
        splats
    }

    /// 1, dx, dy, features relative to the centre, colour.
    #[inline(always)]
    fn row<S: Simd>(&self, simd: S, centre: usize, own: &[f32x16<S>; FEATURES], tap: Tap) -> [f32x16<S>; WIDTH] {
        let r = self.kernel.radius as f32;
        let q = centre.wrapping_add_signed(tap.offset);
        let mut row = [f32x16::splat(simd, 1.0); WIDTH];
        row[1] = f32x16::splat(simd, tap.dx as f32 / r);
        row[2] = f32x16::splat(simd, tap.dy as f32 / r);
        for i in 0..FEATURES {
            row[3 + i] = f32x16::from_slice(simd, &self.planes[i].data()[q..q + LANES]) - own[i];
        }
        for i in FEATURES..FEATURES + 3 {
            row[3 + i] = f32x16::from_slice(simd, &self.planes[i].data()[q..q + LANES]);
        }
        row
    }

    #[inline(always)]
    fn own_features<S: Simd>(&self, simd: S, centre: usize) -> [f32x16<S>; FEATURES] {
        let mut own = [f32x16::splat(simd, 0.0); FEATURES];
        for i in 0..FEATURES {
            own[i] = f32x16::from_slice(simd, &self.planes[i].data()[centre..centre + LANES]);
        }
        own
    }

    /// Equation 4's normal equations: sums of w x_i x_j and w x_i y over the window.
    #[inline(always)]
    fn normal_equations<S: Simd>(&self, simd: S, centre: usize, weights: &[f32]) -> [f32x16<S>; SUMS] {
        let own = self.own_features(simd, centre);
        let mut sums = [f32x16::splat(simd, 0.0); SUMS];
        let mut rows = [[f32x16::splat(simd, 0.0); WIDTH]; RUN];
        let mut taps = self.taps.chunks_exact(RUN);
        let mut weights_of = weights.chunks_exact(RUN * LANES);
        for (taps, weights) in (&mut taps).zip(&mut weights_of) {
            // Loops and not closures: a closure that is not inlined loses the instruction set.
            let mut w = [f32x16::splat(simd, 0.0); RUN];
            for t in 0..RUN {
                rows[t] = self.row(simd, centre, &own, taps[t]);
                w[t] = f32x16::from_slice(simd, &weights[t * LANES..(t + 1) * LANES]);
            }
            add_products(&mut sums, &rows, &w);
        }
        for (&tap, weights) in taps.remainder().iter().zip(weights_of.remainder().chunks_exact(LANES)) {
            let rows = [self.row(simd, centre, &own, tap)];
            add_products(&mut sums, &rows, &[f32x16::from_slice(simd, weights)]);
        }
        sums
    }

    /// Adds what the models of [`LANES`] neighbouring pixels say about their windows.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "called from one place")]
    fn splat<S: Simd>(
        &self,
        simd: S,
        centre: usize,
        weights: &[f32],
        mine: f32x16<S>,
        model: &[[f32x16<S>; 3]; COLUMNS],
        splats: &mut [f32],
        first: usize,
    ) {
        let own = self.own_features(simd, centre);
        let (width, height) = splat_size(self.kernel.radius);
        let side = 2 * self.kernel.radius + 1;
        // Column by column: a row's vectors overlap, and would wait for one another's stores.
        for column in 0..side {
            for row in 0..side {
                let tap = row * side + column;
                let w = f32x16::from_slice(simd, &weights[tap * LANES..(tap + 1) * LANES]) * mine;
                let x = self.row(simd, centre, &own, self.taps[tap]);
                let to = first + row * width + column;
                for c in 0..4 {
                    let mut value = f32x16::splat(simd, 1.0);
                    if c < 3 {
                        value = model[0][c];
                        for i in 1..COLUMNS {
                            value = model[i][c].mul_add(x[i], value);
                        }
                    }
                    let sum = &mut splats[c * width * height + to..][..LANES];
                    value.mul_add(w, f32x16::from_slice(simd, sum)).store_slice(sum);
                }
            }
        }
    }
}

/// Adds w x_i x_j of several neighbours to each sum at once: one load and one store of a sum for all of them.
#[inline(always)]
fn add_products<S: Simd, const T: usize>(
    sums: &mut [f32x16<S>; SUMS],
    rows: &[[f32x16<S>; WIDTH]; T],
    weights: &[f32x16<S>; T],
) {
    let mut next = 0;
    for i in 0..COLUMNS {
        let mut weighted = *weights;
        for t in 0..T {
            weighted[t] *= rows[t][i];
        }
        for j in i..WIDTH {
            let mut sum = sums[next];
            for t in 0..T {
                sum = weighted[t].mul_add(rows[t][j], sum);
            }
            sums[next] = sum;
            next += 1;
        }
    }
}
