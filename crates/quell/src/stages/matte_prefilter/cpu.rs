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

/// Adds a tap: from edge weights to weights, and their sum.
#[inline(always)]
pub(crate) fn admit(gaussian: f32, weights: &mut [f32], total: &mut [f32]) {
    for (w, sum) in weights.iter_mut().zip(total) {
        *w *= gaussian;
        *sum += *w;
    }
}

/// Adds a tap's colour channel to the sums.
#[inline(always)]
pub(crate) fn gather(weights: &[f32], source: &[f32], sums: &mut [f32]) {
    for ((w, q), sum) in weights.iter().zip(source).zip(sums) {
        *sum += *w * *q;
    }
}

/// The filtered channel; background passes through.
#[inline(always)]
pub(crate) fn finish(sums: &[f32], total: &[f32], depth: &[f32], centre: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (sums, total, depth, centre) = (&sums[..n], &total[..n], &depth[..n], &centre[..n]);
    for i in 0..n {
        let mean = sums[i] / total[i];
        out[i] = if depth[i] < f32::INFINITY { mean } else { centre[i] };
    }
}
