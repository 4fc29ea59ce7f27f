//! The filter of young history on runs of pixels.

use super::{Lobe, counted, fade};
use crate::kernels::edge_cpu::Run;

/// Fade and frames of a run of pixels; says whether any of them is filtered.
#[inline(always)]
pub(crate) fn shares(
    length: &[f32],
    roughness: &[f32],
    (end, lobe, most): (f32, Option<Lobe>, f32),
    share: &mut Run,
    frames: &mut Run,
) -> bool {
    let n = length.len();
    let (roughness, share, frames) = (&roughness[..n], &mut share[..n], &mut frames[..n]);
    let mut any = 0.0;
    for i in 0..n {
        let room = lobe.map_or(1.0, |lobe| lobe.room(roughness[i]));
        share[i] = fade(length[i], end) * room;
        frames[i] = counted(length[i], most);
        any += share[i];
    }
    any > 0.0
}

/// From a tap's edge weights to its weights: times the centre's share and the tap's own frames.
#[inline(always)]
pub(crate) fn by_frames(weights: &mut [f32], share: &[f32], length: &[f32], most: f32) {
    let n = weights.len();
    let (share, length) = (&share[..n], &length[..n]);
    for i in 0..n {
        weights[i] *= share[i] * counted(length[i], most);
    }
}

/// The filtered channel; background, and what has history enough, passes through. `part`: of one unit of weight.
#[inline(always)]
pub(crate) fn finish(sums: &[f32], part: &[f32], share: &[f32], depth: &[f32], centre: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (sums, part, share) = (&sums[..n], &part[..n], &share[..n]);
    let (depth, centre) = (&depth[..n], &centre[..n]);
    for i in 0..n {
        let mean = sums[i] * part[i];
        out[i] = if (depth[i] < f32::INFINITY) & (share[i] > 0.0) { mean } else { centre[i] };
    }
}
