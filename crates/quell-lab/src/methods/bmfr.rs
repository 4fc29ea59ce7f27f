//! Blockwise multi-order feature regression (Koskela, Immonen, Mäkitalo, Foi, Viitanen, Jääskeläinen, Kultala, Takala: "Blockwise
//! Multi-Order Feature Regression for Real-Time Path-Tracing Reconstruction", ACM Transactions on Graphics 38(5), 2019).
//!
//! Light is accumulated over time, fitted by least squares in blocks of 32x32 pixels to normals, positions and their squares, and what
//! was fitted is accumulated again. Constants are those of the code that the authors published. Departures: `docs/baselines.md`.

use super::surface::{Guides, NORMAL, Reprojection, Rows, Taps, positions, signals};
use super::{Input, Method, composite};
use crate::error::Error;
use quell::{Frame, Plane, Rgb, Size};
use rayon::prelude::*;

/// Edge of a block, pixels.
const BLOCK: usize = 32;
/// Least weight of the newest frame before the fit, and after it.
const ALPHA: f32 = 0.2;
const SECOND_ALPHA: f32 = 0.1;
/// Frames that are counted at most.
const LONGEST: f32 = 256.0;
/// Largest disturbance of a feature, of its range of 1: features that depend on each other become independent (the paper's stochastic
/// regularisation).
const DISTURBANCE: f32 = 0.01;
/// Least squared remainder of a feature that the features before it do not explain, mean over the block's pixels. Below it the
/// feature depends on them up to rounding, and is left out of the fit.
const LEAST_REST: f64 = 1e-9;
/// The grid of blocks is shifted from frame to frame, so that its edges average out; the shifts repeat after so many frames.
const SHIFTS: i64 = 16;

/// Features: 1, normal, position, squares of the position's parts.
const FEATURES: usize = 10;
/// Colours: both signals'.
const COLOURS: usize = 6;
/// Channel of the number of frames, after those of light.
const LENGTH: usize = COLOURS;

/// The method.
#[derive(Default)]
pub struct Bmfr {
    state: Option<State>,
}

struct State {
    index: i64,
    /// The frame before: its guides, its light before the fit and after it, each with the number of frames in it.
    guides: Guides,
    noisy: Rows,
    fitted: Rows,
    /// Buffers of this frame.
    now: (Guides, Rows, Rows),
    position: Rows,
    signals: Rows,
}

impl State {
    fn new(size: Size) -> Self {
        let light = || Rows::new(size, LENGTH + 1);
        Self {
            index: 0,
            guides: Guides::new(size),
            noisy: light(),
            fitted: light(),
            now: (Guides::new(size), light(), light()),
            position: Rows::new(size, 3),
            signals: Rows::new(size, COLOURS),
        }
    }
}

impl Method for Bmfr {
    fn name(&self) -> String {
        "bmfr".to_owned()
    }

    fn reset(&mut self) {
        self.state = None;
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let frame = input.frame;
        let kept = self.state.take().filter(|s| s.guides.size() == frame.size);
        let follows = kept.as_ref().is_some_and(|s| s.index.abs_diff(frame.index) == 1);
        let mut state = kept.unwrap_or_else(|| State::new(frame.size));
        let State {
            guides: before, noisy, fitted, now: (guides, accumulated, result), position, signals: light, ..
        } = &mut state;
        guides.read(frame);
        signals(frame, light);
        positions(frame, guides, position);
        let reprojection = follows.then(|| Reprojection::new(frame, guides, before));
        let taps = |x, y| reprojection.as_ref().map(|r| r.taps(x, y)).unwrap_or_default();
        accumulate(light, noisy, ALPHA, taps, accumulated);
        let fit = fit(frame, guides, position, accumulated);
        accumulate(&fit, fitted, SECOND_ALPHA, taps, result);
        let [matte, glossy] = [0, 3].map(|c| result.picture(c));
        state.index = frame.index;
        std::mem::swap(&mut state.guides, &mut state.now.0);
        std::mem::swap(&mut state.noisy, &mut state.now.1);
        std::mem::swap(&mut state.fitted, &mut state.now.2);
        self.state = Some(state);
        Ok(composite(frame, Some(matte.view()), Some(glossy.view())))
    }
}

/// The mean over frames: plain at first, exponential from where the newest frame's share would fall below `alpha`.
fn accumulate(new: &Rows, old: &Rows, alpha: f32, taps: impl Fn(usize, usize) -> Taps + Sync + Send, out: &mut Rows) {
    let width = new.size().width;
    out.fill(|y, row| {
        for x in 0..width {
            let taps = taps(x, y);
            let length = (taps.mean(old, LENGTH) + 1.0).min(LONGEST);
            let share = if taps.is_empty() { 1.0 } else { alpha.max(1.0 / length) };
            for c in 0..COLOURS {
                let (new, old) = (new.at(x, y, c), taps.mean(old, c));
                row[c * width + x] = old + (new - old) * share;
            }
            row[LENGTH * width + x] = length;
        }
    });
}

/// Light fitted block by block. The background keeps its own.
fn fit(frame: &Frame<'_>, guides: &Guides, position: &Rows, light: &Rows) -> Rows {
    let Size { width, height } = frame.size;
    let shift = halton(frame.index.rem_euclid(SHIFTS)).map(|v| (v * BLOCK as f32) as usize % BLOCK);
    // Block k along an axis covers the pixels from k BLOCK - shift on.
    let blocks = |extent: usize, shift: usize| (extent + shift).div_ceil(BLOCK);
    let (columns, rows) = (blocks(width, shift[0]), blocks(height, shift[1]));
    let range = |k: usize, extent: usize, shift: usize| {
        (k * BLOCK).saturating_sub(shift)..((k + 1) * BLOCK).saturating_sub(shift).min(extent)
    };
    let fitted: Vec<Vec<Pixel>> = (0..columns * rows)
        .into_par_iter()
        .map(|block| {
            let (xs, ys) = (range(block % columns, width, shift[0]), range(block / columns, height, shift[1]));
            let pixels = ys.flat_map(|y| xs.clone().map(move |x| (x, y))).filter(|&(x, y)| guides.is_surface(x, y));
            fit_block(frame.index, guides, position, light, pixels.collect())
        })
        .collect();
    let mut found = vec![None; frame.size.pixels()];
    for pixel in fitted.into_iter().flatten() {
        found[pixel.y * width + pixel.x] = Some(pixel.colours);
    }
    let mut out = Rows::new(frame.size, COLOURS);
    out.fill(|y, row| {
        for x in 0..width {
            for c in 0..COLOURS {
                row[c * width + x] = found[y * width + x].map_or_else(|| light.at(x, y, c), |colours| colours[c]);
            }
        }
    });
    out
}

struct Pixel {
    x: usize,
    y: usize,
    colours: [f32; COLOURS],
}

/// The pixels of a block with their colours by the regression, at least 0.
fn fit_block(index: i64, guides: &Guides, position: &Rows, light: &Rows, pixels: Vec<(usize, usize)>) -> Vec<Pixel> {
    let place = |(x, y): (usize, usize)| -> [f32; 3] { std::array::from_fn(|c| position.at(x, y, c)) };
    let mut low = [f32::INFINITY; 6];
    let mut high = [f32::NEG_INFINITY; 6];
    let squares = |p: [f32; 3]| [p[0], p[1], p[2], p[0] * p[0], p[1] * p[1], p[2] * p[2]];
    for &pixel in &pixels {
        for (c, v) in squares(place(pixel)).into_iter().enumerate() {
            (low[c], high[c]) = (low[c].min(v), high[c].max(v));
        }
    }
    let features = |(x, y): (usize, usize)| -> [f64; FEATURES] {
        let mut f = [1.0; FEATURES];
        for c in 0..3 {
            f[1 + c] = f64::from(guides.surface.at(x, y, NORMAL + c));
        }
        for (c, v) in squares(place((x, y))).into_iter().enumerate() {
            let range = high[c] - low[c];
            f[4 + c] = f64::from(if range > 0.0 { (v - low[c]) / range } else { 0.0 });
        }
        f
    };
    let mut normal = [[0.0f64; FEATURES]; FEATURES];
    let mut right = [[0.0f64; COLOURS]; FEATURES];
    for &(x, y) in &pixels {
        let mut f = features((x, y));
        for (c, f) in f.iter_mut().enumerate().skip(1) {
            *f += f64::from(DISTURBANCE * (2.0 * random(index, x, y, c) - 1.0));
        }
        for i in 0..FEATURES {
            for j in 0..=i {
                normal[i][j] += f[i] * f[j];
            }
            for (c, right) in right[i].iter_mut().enumerate() {
                *right += f[i] * f64::from(light.at(x, y, c));
            }
        }
    }
    let weights = solve(normal, right, pixels.len() as f64);
    let fitted = |&(x, y): &(usize, usize)| {
        let f = features((x, y));
        let colours = std::array::from_fn(|c| (0..FEATURES).map(|i| f[i] * weights[i][c]).sum::<f64>().max(0.0) as f32);
        Pixel { x, y, colours }
    };
    pixels.iter().map(fitted).collect()
}

/// Solves the normal equations (lower triangle, of `count` pixels) by Cholesky's decomposition. A feature that the ones before it explain to
/// rounding gets the weight 0.
fn solve(
    mut a: [[f64; FEATURES]; FEATURES],
    mut b: [[f64; COLOURS]; FEATURES],
    count: f64,
) -> [[f64; COLOURS]; FEATURES] {
    let mut kept = [false; FEATURES];
    for i in 0..FEATURES {
        for j in 0..i {
            let sum: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
            a[i][j] = if kept[j] { (a[i][j] - sum) / a[j][j] } else { 0.0 };
        }
        let rest = a[i][i] - (0..i).map(|k| a[i][k] * a[i][k]).sum::<f64>();
        kept[i] = rest > LEAST_REST * count;
        a[i][i] = if kept[i] { rest.sqrt() } else { 1.0 };
        for c in 0..COLOURS {
            let sum: f64 = (0..i).map(|k| a[i][k] * b[k][c]).sum();
            b[i][c] = if kept[i] { (b[i][c] - sum) / a[i][i] } else { 0.0 };
        }
    }
    for i in (0..FEATURES).rev() {
        for c in 0..COLOURS {
            let sum: f64 = (i + 1..FEATURES).map(|k| a[k][i] * b[k][c]).sum();
            b[i][c] = if kept[i] { (b[i][c] - sum) / a[i][i] } else { 0.0 };
        }
    }
    b
}

/// A number in 0..1 for a feature of a pixel of a frame.
fn random(index: i64, x: usize, y: usize, feature: usize) -> f32 {
    let mut state = (index as u64) ^ ((x as u64) << 16) ^ ((y as u64) << 32) ^ ((feature as u64) << 48);
    // The finaliser of splitmix64.
    state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((state ^ (state >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

/// Points in the unit square, evenly spread, in bases 2 and 3.
fn halton(index: i64) -> [f32; 2] {
    [2, 3].map(|base: i64| {
        let (mut value, mut scale, mut rest) = (0.0, 1.0, index);
        while rest > 0 {
            scale /= base as f32;
            value += scale * (rest % base) as f32;
            rest /= base;
        }
        value
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block whose light is a parabola of the position keeps it, though features depend on each other: all normals are the same.
    #[test]
    fn what_the_features_explain_is_fitted() {
        let size = Size::new(BLOCK, BLOCK);
        let mut guides = Guides::new(size);
        guides.surface.fill(|_, row| {
            row[..BLOCK].fill(4.0);
            row[(NORMAL + 2) * BLOCK..][..BLOCK].fill(1.0);
        });
        let mut position = Rows::new(size, 3);
        position.fill(|y, row| {
            for x in 0..BLOCK {
                (row[x], row[BLOCK + x], row[2 * BLOCK + x]) = (0.1 * x as f32 - 1.0, 0.2 * y as f32, 7.0);
            }
        });
        let value =
            |x: usize, y: usize, c: usize| 3.0 + c as f32 * (0.1 * x as f32 - 1.0).powi(2) - 0.1 * y as f32 * 0.2;
        let mut light = Rows::new(size, LENGTH + 1);
        light.fill(|y, row| (0..COLOURS).for_each(|c| (0..BLOCK).for_each(|x| row[c * BLOCK + x] = value(x, y, c))));
        let pixels = (0..BLOCK * BLOCK).map(|i| (i % BLOCK, i / BLOCK)).collect();
        for pixel in fit_block(5, &guides, &position, &light, pixels) {
            for c in 0..COLOURS {
                let expected = value(pixel.x, pixel.y, c);
                let found = pixel.colours[c];
                // The disturbed features leave a little.
                assert!((found - expected).abs() < 0.05 * expected, "{} {} {c}: {found} {expected}", pixel.x, pixel.y);
            }
        }
    }
}
