//! A pixel's window as vectors.

use super::super::offline::image::{Image, LANES};
use super::{COUNT, RADIUS, SIDE, VECTORS};
use fearless_simd::f32x16;
use fearless_simd::prelude::*;

/// Elements of a window in reading order; 0 beyond the last.
pub(super) type Window = [f32; VECTORS * LANES];

/// Copies a window, row by row.
#[inline(always)]
pub(super) fn gather(image: &Image, centre: usize, window: &mut Window) {
    let begin = centre - RADIUS * image.stride() - RADIUS;
    for row in 0..SIDE {
        window[row * SIDE..][..SIDE].copy_from_slice(&image.data()[begin + row * image.stride()..][..SIDE]);
    }
}

#[inline(always)]
pub(super) fn vector<S: Simd>(simd: S, window: &Window, v: usize) -> f32x16<S> {
    f32x16::from_slice(simd, &window[v * LANES..(v + 1) * LANES])
}

/// The sum of all lanes, in one order on every machine.
#[inline(always)]
pub(super) fn total<S: Simd>(v: f32x16<S>) -> f32 {
    let mut quarters = [0.0; 4];
    for l in 0..4 {
        quarters[l] = (v[l] + v[l + 8]) + (v[l + 4] + v[l + 12]);
    }
    (quarters[0] + quarters[2]) + (quarters[1] + quarters[3])
}

/// Sums of a b_i over a window for several b.
#[inline(always)]
pub(super) fn products<S: Simd, const T: usize>(simd: S, a: &Window, b: [&Window; T]) -> [f32; T] {
    let mut sums = [f32x16::splat(simd, 0.0); T];
    for v in 0..VECTORS {
        let a = vector(simd, a, v);
        for t in 0..T {
            sums[t] = a.mul_add(vector(simd, b[t], v), sums[t]);
        }
    }
    let mut totals = [0.0; T];
    for t in 0..T {
        totals[t] = total(sums[t]);
    }
    totals
}

/// dx and dy in units of the radius.
pub(super) static POSITIONS: [Window; 2] = {
    let mut positions = [[0.0; VECTORS * LANES]; 2];
    let mut i = 0;
    while i < COUNT {
        positions[0][i] = (i % SIDE) as f32 / RADIUS as f32 - 1.0;
        positions[1][i] = (i / SIDE) as f32 / RADIUS as f32 - 1.0;
        i += 1;
    }
    positions
};
