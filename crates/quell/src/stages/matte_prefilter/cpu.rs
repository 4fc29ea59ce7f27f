//! Stages 4 and 7 on runs of pixels: weights before colours.

use crate::kernels::edge_cpu::{RUN, Run};

/// Most taps of a spiral (`matte_prefilter.taps`).
pub(crate) const MOST_TAPS: usize = 64;

/// The weights of all taps of a run of pixels, and their sum with the centre's.
#[derive(Debug)]
#[repr(align(64))] // vectors that straddle cache lines cost twice
pub(crate) struct Weights {
    pub taps: [Run; MOST_TAPS],
    pub total: Run,
}

impl Weights {
    pub fn new() -> Self {
        Self { taps: [[0.0; RUN]; MOST_TAPS], total: [1.0; RUN] }
    }
}

/// Adds a tap and the first plane's colour: from edge weights to weights, and their sum. One loop: what it loads and
/// stores is its cost.
#[inline(always)]
pub(crate) fn admit(
    gaussian: f32,
    weights: &mut [f32],
    total: &mut [f32],
    [q0, q1, q2]: [&[f32]; 3],
    [s0, s1, s2]: [&mut [f32]; 3],
) {
    let n = weights.len();
    let (q0, q1, q2, total) = (&q0[..n], &q1[..n], &q2[..n], &mut total[..n]);
    let (s0, s1, s2) = (&mut s0[..n], &mut s1[..n], &mut s2[..n]);
    for i in 0..n {
        let w = weights[i] * gaussian;
        weights[i] = w;
        total[i] += w;
        s0[i] += w * q0[i];
        s1[i] += w * q1[i];
        s2[i] += w * q2[i];
    }
}

/// Adds a tap's colour to the sums.
#[inline(always)]
pub(crate) fn gather(weights: &[f32], [q0, q1, q2]: [&[f32]; 3], [s0, s1, s2]: [&mut [f32]; 3]) {
    let n = weights.len();
    let (q0, q1, q2) = (&q0[..n], &q1[..n], &q2[..n]);
    let (s0, s1, s2) = (&mut s0[..n], &mut s1[..n], &mut s2[..n]);
    for i in 0..n {
        s0[i] += weights[i] * q0[i];
        s1[i] += weights[i] * q1[i];
        s2[i] += weights[i] * q2[i];
    }
}

/// From the sum of the weights to its reciprocal: one division for all channels of all planes.
#[inline(always)]
pub(crate) fn invert(total: &mut [f32]) {
    for total in total {
        *total = 1.0 / *total;
    }
}

/// The filtered channel; background passes through. `share`: of one unit of weight, from [`invert`].
#[inline(always)]
pub(crate) fn finish(sums: &[f32], share: &[f32], depth: &[f32], centre: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (sums, share, depth, centre) = (&sums[..n], &share[..n], &depth[..n], &centre[..n]);
    for i in 0..n {
        let mean = sums[i] * share[i];
        out[i] = if depth[i] < f32::INFINITY { mean } else { centre[i] };
    }
}
