//! Sequence filter: what the filtered light misses of the frame's own samples, smoothed, is given back.
//!
//! | | |
//! |---|---|
//! | reads | light as it came (I) and filtered (O) |
//! | writes | the filtered light, corrected |
//! | reach | 56 pixels: of three levels a triangle of 6, 6 and 2 cells of 4, 2 and 2 pixels, a cell and the interpolation between cells |
//! | equation | O' = O (1 + R s), R = sum k (I - O) / sum k O; k: triangle over cells, then bilinear between cells |
//! | s | n / (n + `residual.noise`^2) max(0, 1 - `residual.sure` V / \|R\|^2), n = mean over the channels of sum k (I - O)^2 / (sum k O)^2, k of sum 1, V = sum_c of sum k^2 (I - O)^2 / (sum k O)^2: shrinkage by James and Stein (1961), one for the three channels |
//! | source | the residual of the frame's own samples: ours, `docs/sequence.md` |
//! | parameters | `residual.*` |
//!
//! Neighbours in time bring light of other times: a lamp that was switched, a headlight that comes nearer. Where that changes slowly
//! over the picture no test of single samples finds it among their noise, but the mean of the residual I - O over many pixels does. It is an
//! independent judge: the frame's own samples are few among those that made O. It is taken as a ratio, so that textures and edges stay, from coarse to fine
//! windows, and only as far as it is larger than its own noise, and where the
//! samples have noise: of light without it every stage sees itself that it changed, and what a residual then holds is shape. Sums are not weighted by the brightness: O holds noise of I, and weights that
//! fall with it lose energy (8 % of a night at 4 samples). A light's joint planes are scaled with it. A pixel that came out as it went in stays.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;

/// Side of a cell in pixels, and half the side of the triangle in pairs of cells: it reaches twice as many.
pub(crate) const LEVELS: [(usize, usize); 3] = [(4, 3), (2, 3), (2, 1)];
/// Keeps quotients finite where light is black.
pub(crate) const LEAST: f32 = 1e-12;
/// A level changes light by no less and no more than this.
pub(crate) const CHANGE: [f32; 2] = [-0.5, 1.0];

/// How far the stage looks.
pub(crate) fn reach() -> Reach {
    // Of a level: the triangle, the cell that a pixel lies in, and the cell beside it, between which values are interpolated.
    Reach::around(LEVELS.iter().map(|(cell, radius)| cell * (2 * radius + 2)).sum())
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

/// Cells that hold `extent` pixels from `first` on.
pub(crate) fn cells(first: usize, extent: usize, cell: usize) -> usize {
    (first + extent).div_ceil(cell) - first / cell
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
