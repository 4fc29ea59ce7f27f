//! What is known of the noise of a frame's input: statistics of its differences to filtered pictures, sixteen pixels of a row at once.

use super::over_time::{ALONG_CHANGES, ALONG_CHANNELS, ALONG_SEEN, along_row};
use super::{
    ALONG, BlendFrame, DIRECTIONS, FRAMES, HIGH_PASS, INPUTS, LEAST, LEAST_BRIGHTNESS, LEAST_SEEN, MOST_RATIO, NEAR,
    NOISE_NEAR, NOISE_WIDE, Pooled, SECOND_DIFFERENCE, WIDE,
};
use crate::frame::Rgb;
use crate::kernels::bands_cpu::{Band, around, pool};
use crate::kernels::lanes::{BLOCK, load, load_within, log2, store};
use crate::plane::Plane;
use crate::sequence::settings::{Blend as Settings, Gather};
use crate::simd::{dispatch, widest};
use crate::window::Features;
use fearless_simd::{Simd, f32x16, prelude::*};
use std::ops::Range;

/// What is known of the noise of a frame's input, from its difference to filtered pictures; of some rows.
pub(crate) struct PictureNoise {
    inverse: Band,
    stats: Statistics,
    /// 1 where something stands in front within 3x3, else 0.
    silhouettes: Band,
}

impl PictureNoise {
    /// `steady`: another filtered picture, or again the wavelet's. `nearer`: that of `stabilise`.
    pub(crate) fn new(
        window: &[BlendFrame<'_>],
        centre: usize,
        steady: &Plane<Rgb>,
        (gather, nearer): (&Gather, f32),
        rows: Range<usize>,
    ) -> Self {
        let here = &window[centre];
        let size = here.input.size();
        let w = size.width;
        // Windows of squares, which look at the rows beside them.
        let squared = around(&rows, NOISE_WIDE, size.height);
        let differing = around(&squared, 1, size.height);
        let inverse = inverse_brightness(here.picture, steady, &differing);
        let found = here.along.is_none().then(|| {
            Band::filled(
                &differing,
                w,
                ALONG_CHANNELS,
                |y, out| dispatch!(crate::simd::level(), simd => along_row(simd, (window, centre), gather, y, out)),
            )
        });
        let differences = Band::filled(&differing, w, DIFFERENCES, |y, out| {
            let along = match (here.along, &found) {
                (Some(whole), _) => &whole.data()[whole.start(y, 0)..][..ALONG_CHANNELS * w],
                (None, Some(band)) => band.channels(y),
                (None, None) => return out.fill(0.0),
            };
            widest!(differences_row((here, steady), inverse.row(y, 0), along, y, out));
        });
        let apart = Apart::new(here, steady, &differences, &differing);
        let squares = Band::filled(&squared, w, SQUARES, |y, out| {
            dispatch!(crate::simd::level(), simd => apart.squares_row(simd, &differences, inverse.row(y, 0), y, out));
        });
        drop(apart);
        let silhouettes = silhouettes(here.features, nearer, &rows);
        let stats = Statistics::new(&differences, &squares, rows, size.height);
        Self { inverse, stats, silhouettes }
    }

    /// What is known at a pixel, and one over the brightness that it is relative to.
    pub(crate) fn at(&self, x: usize, y: usize) -> (Pooled, f32) {
        (self.stats.at(x, y, self.silhouettes.at(x, y, 0) > 0.0), self.inverse.at(x, y, 0))
    }

    /// [`Self::at`] for sixteen pixels from column `x` on. Beyond the end of the row all is 0.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(&self, simd: S, (x, y): (usize, usize)) -> (PooledLanes<S>, f32x16<S>) {
        let silhouette = self.silhouettes.lanes(simd, (x, y), 0);
        let inverse = self.inverse.lanes(simd, (x, y), 0);
        (self.stats.lanes(simd, (x, y), silhouette), inverse)
    }

    /// One over the brightness around a pixel.
    #[cfg(feature = "internals")]
    pub(crate) fn inverse(&self, x: usize, y: usize) -> f32 {
        self.inverse.at(x, y, 0)
    }

    #[inline(always)]
    pub(super) fn known_row<S: Simd>(&self, simd: S, y: usize, s: &Settings, out: &mut [Known]) {
        let mut x = 0;
        for out in out.chunks_mut(BLOCK) {
            let (pooled, inverse) = self.lanes(simd, (x, y));
            let inverse: [f32; BLOCK] = inverse.into();
            let noise: [f32; BLOCK] = pooled.noise(simd, 1).into();
            let least_noise: [f32; BLOCK] = pooled.least_noise(simd, s).into();
            for (i, out) in out.iter_mut().enumerate() {
                *out = Known { inverse: inverse[i], noise: noise[i], least_noise: least_noise[i] };
            }
            x += BLOCK;
        }
    }
}

/// What is kept of a pixel's statistics until the net has spoken.
#[derive(Clone, Copy, Default)]
pub(super) struct Known {
    /// One over the brightness around.
    pub(super) inverse: f32,
    /// See [`Pooled`].
    pub(super) noise: f32,
    pub(super) least_noise: f32,
}

/// 1 where something stands in front within 3x3, else 0: [`silhouette`](super::silhouette) of these rows.
fn silhouettes(features: &Features, nearer: f32, rows: &Range<usize>) -> Band {
    let (w, h) = (features.size.width, features.size.height);
    // Of a pixel more at either end, and room for the last sixteen. Beyond the border the border counts: what is nearer in 3x3 stays so.
    let depths = Band::filled(&around(rows, 1, h), w + 2 + BLOCK, 1, |y, out| {
        for (out, surface) in out[1..=w].iter_mut().zip(&features.surface[y * w..][..w]) {
            *out = surface.inverse_depth;
        }
        (out[0], out[w + 1]) = (out[1], out[w]);
        out[w + 2..].fill(0.0);
    });
    Band::filled(rows, w, 1, |y, out| {
        let lines = [y.saturating_sub(1), y, (y + 1).min(h - 1)].map(|y| depths.row(y, 0));
        dispatch!(crate::simd::level(), simd => silhouettes_row(simd, &lines, nearer, out));
    })
}

#[inline(always)]
fn silhouettes_row<S: Simd>(simd: S, lines: &[&[f32]; 3], nearer: f32, out: &mut [f32]) {
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    for x in (0..out.len()).step_by(BLOCK) {
        let own = load::<false, _>(simd, lines[1], x as isize + 1);
        let limit = own * nearer;
        let mut found = zero;
        for dy in 0..3 {
            for dx in 0..3 {
                let other = load::<false, _>(simd, lines[dy], (x + dx) as isize);
                let apart = other.simd_gt(limit) | own.simd_gt(other * nearer);
                found = apart.select(one, found);
            }
        }
        store(found, out, x);
    }
}

/// One over the brightness around a pixel: the mean over 5x5 of both filtered pictures.
fn inverse_brightness(picture: &Plane<Rgb>, steady: &Plane<Rgb>, rows: &Range<usize>) -> Band {
    let (w, h) = (picture.size().width, picture.size().height);
    let both = Band::filled(&around(rows, NOISE_NEAR, h), w, 1, |y, row| {
        for ((value, a), b) in row.iter_mut().zip(picture.row(y)).zip(steady.row(y)) {
            *value = (a[0] + a[1] + a[2] + b[0] + b[1] + b[2]) / 6.0;
        }
    });
    let mut mean = pool(&both, &[0], NOISE_NEAR, rows, h);
    for value in mean.data_mut() {
        *value = 1.0 / (value.max(0.0) + LEAST_BRIGHTNESS);
    }
    mean
}

/// Three channels each: input less wavelet, input less stabilised, input less wavelet averaged over time; then the
/// squared changes over time and the share of neighbours seen.
const DIFFERENCES: usize = 11;

/// `along`: the row of [`along_row`].
#[inline(always)]
fn differences_row(
    (here, steady): (&BlendFrame<'_>, &Plane<Rgb>),
    inverse: &[f32],
    along: &[f32],
    y: usize,
    out: &mut [f32],
) {
    let w = inverse.len();
    let (input, picture, steady) = (here.input.row(y), here.picture.row(y), steady.row(y));
    let (changes, seen) = (&along[ALONG_CHANGES * w..][..w], &along[ALONG_SEEN * w..][..w]);
    for c in 0..3 {
        let own = &mut out[c * w..];
        for x in 0..w {
            own[x] = (input[x][c] - picture[x][c]) * inverse[x];
        }
        for x in 0..w {
            own[3 * w + x] = (input[x][c] - steady[x][c]) * inverse[x];
        }
        let sums = &along[c * w..][..w];
        for x in 0..w {
            own[6 * w + x] = sums[x] * inverse[x] / (1.0 + seen[x]);
        }
    }
    let all = (2 * FRAMES) as f32;
    for x in 0..w {
        out[9 * w + x] = changes[x] * inverse[x] * inverse[x] / all;
    }
    for x in 0..w {
        out[10 * w + x] = seen[x] / all;
    }
}

/// Squared, relative to the brightness: noise over space; input to wavelet, input to stabilised, wavelet to stabilised; detail
/// of the stabilised picture and of the wavelet's; changes of the input over space; second
/// differences along four directions, of the input and of input less wavelet.
const SQUARES: usize = 15;

/// Three channels each: the stabilised picture, the wavelet's, the input, and input less wavelet relative to the brightness. Each
/// row begins and ends with its border once more, and has room for the last sixteen pixels.
struct Apart(Band);

impl Apart {
    fn new(here: &BlendFrame<'_>, steady: &Plane<Rgb>, differences: &Band, rows: &Range<usize>) -> Self {
        let w = here.input.size().width;
        let stride = w + 2 + BLOCK;
        Self(Band::filled(rows, stride, 12, |y, out| {
            for (k, picture) in [steady, here.picture, here.input].into_iter().enumerate() {
                for (x, colour) in picture.row(y).iter().enumerate() {
                    for c in 0..3 {
                        out[(3 * k + c) * stride + 1 + x] = colour[c];
                    }
                }
            }
            for (c, out) in out.chunks_exact_mut(stride).enumerate() {
                if c >= 9 {
                    out[1..=w].copy_from_slice(differences.row(y, c - 9));
                }
                (out[0], out[w + 1]) = (out[1], out[w]);
                out[w + 2..].fill(0.0);
            }
        }))
    }

    /// A row of [`SQUARES`].
    #[inline(always)]
    fn squares_row<S: Simd>(&self, simd: S, differences: &Band, inverse: &[f32], y: usize, out: &mut [f32]) {
        let w = inverse.len();
        let here = self.0.here();
        // Beyond the picture its border counts.
        let lines = [y.max(here.start + 1) - 1, y, (y + 1).min(here.end - 1)];
        let near = Near {
            rows: [self.0.channels(lines[0]), self.0.channels(lines[1]), self.0.channels(lines[2])],
            stride: self.0.width(),
        };
        for x in (0..w).step_by(BLOCK) {
            let scale = load::<true, _>(simd, inverse, x as isize);
            let mut sums = [f32x16::splat(simd, 0.0); SQUARES];
            for c in 0..3 {
                let e = near.at(simd, 9 + c, x, [0, 0]);
                let f = differences.lanes(simd, (x, y), 3 + c);
                sums[1] += e * e;
                sums[2] += f * f;
                sums[3] += (e - f) * (e - f);
                let d = near.detail(simd, 9 + c, x);
                sums[0] += d * d / HIGH_PASS;
                let d = near.detail(simd, c, x);
                sums[4] += d * d * scale * scale;
                let d = near.detail(simd, 3 + c, x);
                sums[5] += d * d * scale * scale;
                let d = near.detail(simd, 6 + c, x);
                sums[6] += d * d * scale * scale / HIGH_PASS;
                for k in 0..DIRECTIONS.len() {
                    let input = near.bend(simd, 6 + c, x, DIRECTIONS[k]) * scale;
                    let difference = near.bend(simd, 9 + c, x, DIRECTIONS[k]);
                    sums[7 + k] += input * input / SECOND_DIFFERENCE;
                    sums[11 + k] += difference * difference / SECOND_DIFFERENCE;
                }
            }
            for k in 0..SQUARES {
                store(sums[k], &mut out[k * w..][..w], x);
            }
        }
    }
}

/// Three rows of [`Apart`], all channels one after the other.
struct Near<'a> {
    rows: [&'a [f32]; 3],
    stride: usize,
}

impl Near<'_> {
    /// Channel `c` of the pixels beside sixteen from column `x` on.
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, c: usize, x: usize, [dx, dy]: [isize; 2]) -> f32x16<S> {
        load_within(simd, self.rows[(1 + dy) as usize], c * self.stride + x + (1 + dx) as usize)
    }

    /// What a binomial 3x3 takes away.
    #[inline(always)]
    fn detail<S: Simd>(&self, simd: S, c: usize, x: usize) -> f32x16<S> {
        let above = self.across(simd, c, x, -1);
        let here = self.across(simd, c, x, 0);
        let below = self.across(simd, c, x, 1);
        self.at(simd, c, x, [0, 0]) - (above * 0.25 + here * 0.5 + below * 0.25)
    }

    #[inline(always)]
    fn across<S: Simd>(&self, simd: S, c: usize, x: usize, dy: isize) -> f32x16<S> {
        self.at(simd, c, x, [-1, dy]) * 0.25 + self.at(simd, c, x, [0, dy]) * 0.5 + self.at(simd, c, x, [1, dy]) * 0.25
    }

    /// The second difference along a direction.
    #[inline(always)]
    fn bend<S: Simd>(&self, simd: S, c: usize, x: usize, [dx, dy]: [isize; 2]) -> f32x16<S> {
        self.at(simd, c, x, [-dx, -dy]) - self.at(simd, c, x, [0, 0]) * 2.0 + self.at(simd, c, x, [dx, dy])
    }
}

/// Means over windows.
struct Statistics {
    /// Of the three differences, near.
    means: Band,
    /// Changes over time and neighbours seen, near and wide.
    time: [Band; 2],
    /// Noise over space, and changes of the input, near and wide.
    space: [Band; 2],
    /// Squared differences and details, near; differences, wide.
    near: Band,
    wide: Band,
    /// Second differences along the direction in which they are least, of the input and of input less wavelet.
    along: Band,
}

impl Statistics {
    fn new(differences: &Band, squares: &Band, rows: Range<usize>, height: usize) -> Self {
        let of = |band: &Band, channels: &[usize], radius: usize| pool(band, channels, radius, &rows, height);
        let along = of(squares, &[7, 8, 9, 10, 11, 12, 13, 14], NOISE_NEAR);
        let w = along.width();
        Self {
            means: of(differences, &[0, 1, 2, 3, 4, 5, 6, 7, 8], NOISE_NEAR),
            time: [NOISE_NEAR, NOISE_WIDE].map(|r| of(differences, &[9, 10], r)),
            space: [NOISE_NEAR, NOISE_WIDE].map(|r| of(squares, &[0, 6], r)),
            near: of(squares, &[1, 2, 3, 4, 5], NEAR),
            wide: of(squares, &[1, 2, 3], WIDE),
            along: Band::filled(&rows, w, 2, |y, out| {
                out.fill(f32::MAX);
                for (k, out) in out.chunks_exact_mut(w).enumerate() {
                    for c in 4 * k..4 * k + 4 {
                        out.iter_mut().zip(along.row(y, c)).for_each(|(least, value)| *least = least.min(*value));
                    }
                }
            }),
        }
    }

    /// [`Self::at`] for sixteen pixels from column `x` on.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, (x, y): (usize, usize), silhouette: f32x16<S>) -> PooledLanes<S> {
        let at = (x, y);
        let [near, far] = &self.time;
        let [space, far_space] = &self.space;
        let (close, wide) = (&self.near, &self.wide);
        let mut mean = [f32x16::splat(simd, 0.0); 3];
        for k in 0..3 {
            let a = self.means.lanes(simd, at, 3 * k);
            let b = self.means.lanes(simd, at, 3 * k + 1);
            let c = self.means.lanes(simd, at, 3 * k + 2);
            mean[k] = a * a + b * b + c * c;
        }
        PooledLanes {
            over_time: [near.lanes(simd, at, 0), far.lanes(simd, at, 0)],
            seen: [near.lanes(simd, at, 1), far.lanes(simd, at, 1)],
            over_space: [space.lanes(simd, at, 0), far_space.lanes(simd, at, 0)],
            input: [space.lanes(simd, at, 1), far_space.lanes(simd, at, 1)],
            along: [self.along.lanes(simd, at, 0), self.along.lanes(simd, at, 1)],
            apart: [
                close.lanes(simd, at, 0),
                close.lanes(simd, at, 1),
                close.lanes(simd, at, 2),
                wide.lanes(simd, at, 0),
                wide.lanes(simd, at, 1),
                wide.lanes(simd, at, 2),
            ],
            detail: [close.lanes(simd, at, 3), close.lanes(simd, at, 4)],
            mean,
            silhouette,
        }
    }

    fn at(&self, x: usize, y: usize, silhouette: bool) -> Pooled {
        let mean = |k: usize| (0..3).map(|c| self.means.at(x, y, 3 * k + c)).map(|v| v * v).sum::<f32>();
        let [near, wide] = [&self.near, &self.wide].map(|rows| [0, 1, 2].map(|k| rows.at(x, y, k)));
        Pooled {
            over_time: [0, 1].map(|k| self.time[k].at(x, y, 0)),
            seen: [0, 1].map(|k| self.time[k].at(x, y, 1)),
            over_space: [0, 1].map(|k| self.space[k].at(x, y, 0)),
            input: [0, 1].map(|k| self.space[k].at(x, y, 1)),
            along: [0, 1].map(|k| self.along.at(x, y, k)),
            apart: [near[0], near[1], near[2], wide[0], wide[1], wide[2]],
            detail: [self.near.at(x, y, 3), self.near.at(x, y, 4)],
            mean: [mean(0), mean(1), mean(2)],
            silhouette,
        }
    }
}

/// [`Pooled`] of sixteen pixels. What is no number counts as it does there.
#[derive(Clone, Copy)]
pub(crate) struct PooledLanes<S: Simd> {
    over_time: [f32x16<S>; 2],
    seen: [f32x16<S>; 2],
    over_space: [f32x16<S>; 2],
    input: [f32x16<S>; 2],
    along: [f32x16<S>; 2],
    apart: [f32x16<S>; 6],
    pub detail: [f32x16<S>; 2],
    mean: [f32x16<S>; 3],
    silhouette: f32x16<S>,
}

impl<S: Simd> PooledLanes<S> {
    /// [`Pooled::noise`].
    #[inline(always)]
    pub(crate) fn noise(&self, simd: S, wide: usize) -> f32x16<S> {
        let space = self.over_space[wide].min_precise(self.input[wide]);
        let time = (self.over_time[wide] / self.seen[wide]).min_precise(space);
        let known = self.seen[wide].simd_gt(f32x16::splat(simd, LEAST_SEEN));
        known.select(time, space).max_precise(f32x16::splat(simd, LEAST))
    }

    /// [`Pooled::least_noise`].
    #[inline(always)]
    fn least_noise(&self, simd: S, s: &Settings) -> f32x16<S> {
        let [input, removed] = self.along;
        let input = input.min_precise(self.input[0]);
        let noise = self.noise(simd, 0).min_precise(removed).max_precise(input * s.guard_input);
        noise.min_precise(input).max_precise(f32x16::splat(simd, LEAST))
    }

    /// [`Pooled::along_edges`].
    #[inline(always)]
    pub(super) fn along_edges(&self, simd: S) -> [f32x16<S>; ALONG] {
        let of_noise = log2(simd, self.noise(simd, 1));
        [ratio(simd, self.along[0], of_noise), ratio(simd, self.along[1], of_noise)]
    }

    /// [`Pooled::inputs`].
    #[inline(always)]
    pub(crate) fn inputs(&self, simd: S) -> [f32x16<S>; INPUTS] {
        let of_noise = log2(simd, self.noise(simd, 1));
        let least = f32x16::splat(simd, LEAST_SEEN);
        let mut time = self.over_space;
        for k in 0..2 {
            time[k] = self.seen[k].simd_gt(least).select(self.over_time[k] / self.seen[k], time[k]);
        }
        [
            ratio(simd, time[0], of_noise),
            ratio(simd, time[1], of_noise),
            ratio(simd, self.over_space[0], of_noise),
            ratio(simd, self.over_space[1], of_noise),
            ratio(simd, self.apart[0], of_noise),
            ratio(simd, self.apart[1], of_noise),
            ratio(simd, self.apart[2], of_noise),
            ratio(simd, self.apart[3], of_noise),
            ratio(simd, self.apart[4], of_noise),
            ratio(simd, self.apart[5], of_noise),
            ratio(simd, self.detail[0], of_noise),
            ratio(simd, self.detail[1], of_noise),
            ratio(simd, self.mean[0], of_noise),
            ratio(simd, self.mean[1], of_noise),
            ratio(simd, self.mean[2], of_noise),
            self.seen[0],
            self.silhouette,
        ]
    }
}

/// The logarithm of a ratio to the noise, whose logarithm is `of_noise`.
#[inline(always)]
fn ratio<S: Simd>(simd: S, v: f32x16<S>, of_noise: f32x16<S>) -> f32x16<S> {
    let most = f32x16::splat(simd, MOST_RATIO);
    let found = log2(simd, v.max_precise(f32x16::splat(simd, LEAST))) - of_noise;
    found.max(-most).min(most)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::plane::Size;

    /// Statistics of sixteen pixels, some of them none, infinite or no number, and the same on lanes.
    pub(crate) fn pooled<S: Simd>(simd: S, seed: u32) -> (Vec<Pooled>, PooledLanes<S>) {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
        let mut value = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let some = (state >> 8) as f32 / (1 << 24) as f32;
            match state >> 8 & 63 {
                0 => 0.0,
                1 => f32::NAN,
                2 => f32::INFINITY,
                _ => (30.0 * (some - 0.7)).exp2(),
            }
        };
        let mut one = Vec::new();
        for i in 0..BLOCK {
            let mut pooled = Pooled { silhouette: i % 3 == 0, ..Pooled::default() };
            let Pooled { over_time, over_space, input, along, apart, detail, mean, .. } = &mut pooled;
            for values in [&mut over_time[..], over_space, input, along, apart, detail, mean] {
                values.fill_with(&mut value);
            }
            pooled.seen = [0.25 * (i % 5) as f32, 0.02 * i as f32];
            one.push(pooled);
        }
        let lanes = |of: &dyn Fn(&Pooled) -> f32| -> f32x16<S> {
            let values: [f32; BLOCK] = std::array::from_fn(|i| of(&one[i]));
            values.simd_into(simd)
        };
        let lanes = PooledLanes {
            over_time: [0, 1].map(|k| lanes(&|p| p.over_time[k])),
            seen: [0, 1].map(|k| lanes(&|p| p.seen[k])),
            over_space: [0, 1].map(|k| lanes(&|p| p.over_space[k])),
            input: [0, 1].map(|k| lanes(&|p| p.input[k])),
            along: [0, 1].map(|k| lanes(&|p| p.along[k])),
            apart: [0, 1, 2, 3, 4, 5].map(|k| lanes(&|p| p.apart[k])),
            detail: [0, 1].map(|k| lanes(&|p| p.detail[k])),
            mean: [0, 1, 2].map(|k| lanes(&|p| p.mean[k])),
            silhouette: lanes(&|p| f32::from(u8::from(p.silhouette))),
        };
        (one, lanes)
    }

    #[test]
    fn statistics_of_sixteen_pixels_have_the_bits_of_one() {
        let s = Settings::default();
        dispatch!(crate::simd::level(), simd => {
            for seed in 0..40 {
                let (one, lanes) = pooled(simd, seed);
                let inputs = lanes.inputs(simd);
                let noise = [lanes.noise(simd, 0), lanes.noise(simd, 1), lanes.least_noise(simd, &s)];
                for (i, pooled) in one.into_iter().enumerate() {
                    let expected = [pooled.noise(0), pooled.noise(1), pooled.least_noise(&s)];
                    for (found, expected) in noise.iter().zip(expected).chain(inputs.iter().zip(pooled.inputs())) {
                        assert_eq!(found.as_slice()[i].to_bits(), expected.to_bits(), "{pooled:?}");
                    }
                }
            }
        });
    }

    /// Also at the ends of rows that are no multiple of sixteen.
    #[test]
    fn silhouettes_are_those_of_the_definition() {
        let frame = crate::sequence::testing::frame(0, Size::new(37, 21));
        let mut features = Features::new(&frame, &crate::sequence::SequenceSettings::default());
        for (i, surface) in features.surface.iter_mut().enumerate() {
            surface.inverse_depth = [1.0, 1.05, 1.3, 0.0, f32::NAN][i * i % 11 % 5];
        }
        for rows in [0..21, 5..9] {
            let found = silhouettes(&features, 1.1, &rows);
            for (x, y) in rows.flat_map(|y| (0..37).map(move |x| (x, y))) {
                let expected = super::super::silhouette(&features, x, y, 1.1);
                assert_eq!(found.at(x, y, 0) > 0.0, expected, "{x} {y}");
            }
        }
    }
}
