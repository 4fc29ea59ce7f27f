//! Stages 3 and 8 once they know where history lies, on runs of pixels: fetch, clamp, blend.

use crate::kernels::change::{Change, kept_light, rounded_light};
use crate::kernels::clip::{ColourBox, follow_itself};
use crate::kernels::reproject_cpu::{Footprint, LANES, Lanes, Lanes3, Lookup};
use crate::kernels::temporal::{Blend, blend, clamp_history};
use crate::phased::layout::{Colours, channel, copy};

/// How much history counts in each lane, and what is remembered of it.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Shares {
    /// Share of history, 0..1.
    pub history: Lanes,
    /// Share of the fast history, 0..1.
    pub fast: Lanes,
    /// Confidence, 0..1.
    pub confidence: Lanes,
    /// New history length, frames.
    pub length: Lanes,
}

impl Shares {
    pub fn new() -> Self {
        Self { history: [0.0; LANES], fast: [0.0; LANES], confidence: [0.0; LANES], length: [1.0; LANES] }
    }

    /// `depth`: background needs no help, its confidence is 1. `DETECTS`: as [`Blend::weigh`] has it.
    #[inline(always)]
    pub fn weigh<const DETECTS: bool>(&mut self, weights: &Blend, trust: &Lanes, length: &Lanes, depth: &Lanes) {
        // A copy, so that it is plain to the compiler that no lane changes it: else it goes lane by lane.
        let weights = *weights;
        for i in 0..LANES {
            let weighed = weights.weigh::<DETECTS>(trust[i], length[i]);
            self.history[i] = weighed.history;
            if DETECTS {
                self.fast[i] = weighed.fast;
            }
            self.confidence[i] = if depth[i] < f32::INFINITY { weighed.confidence } else { 1.0 };
            self.length[i] = weighed.length;
        }
    }
}

/// Weighted mean of up to four previous pixels of a scalar.
#[inline(always)]
pub(crate) fn fetch_scalar(data: &[f32], width: usize, (footprint, lookup): (&Footprint, &Lookup), out: &mut Lanes) {
    *out = [0.0; LANES];
    for k in 0..4 {
        let (place, weight) = (&footprint.place[k], &lookup.weight[k]);
        for &(first, n) in &footprint.segments.runs[..footprint.segments.count] {
            let source = &data[place.row[first] as usize * width + place.element[first] as usize..][..n];
            for ((out, weight), value) in out[first..][..n].iter_mut().zip(&weight[first..][..n]).zip(source) {
                *out += if *weight > 0.0 { weight * value } else { 0.0 };
            }
        }
        for &i in footprint.segments.singles() {
            if weight[i] > 0.0 {
                out[i] += weight[i] * data[place.row[i] as usize * width + place.element[i] as usize];
            }
        }
    }
}

/// Shortens history where light has changed.
#[inline(always)]
pub(crate) fn shorten(change: &Change, changed: &[f32], length: &mut Lanes) {
    let change = *change;
    for (length, changed) in length.iter_mut().zip(changed) {
        *length = change.left(*length, *changed);
    }
}

/// What stands for a fast history that is not there.
#[inline(always)]
pub(crate) fn keep_light(history: &Lanes3, out: &mut Lanes) {
    for i in 0..LANES {
        out[i] = kept_light([history[0][i], history[1][i], history[2][i]]);
    }
}

/// The new fast history from the current colours and the old one.
#[inline(always)]
pub(crate) fn blend_fast(current: &Lanes3, old: &Lanes, share: &Lanes, out: &mut [f32]) {
    for (i, out) in out.iter_mut().enumerate() {
        let now = kept_light([current[0][i], current[1][i], current[2][i]]);
        *out = rounded_light(share[i] * old[i] + (1.0 - share[i]) * now);
    }
}

/// Weighted mean of up to four previous pixels of a plane.
#[inline(always)]
pub(crate) fn fetch(
    history: &Colours,
    width: usize,
    plane: usize,
    (footprint, lookup): (&Footprint, &Lookup),
    out: &mut Lanes3,
) {
    let data = history.elements();
    let stride = history.stride(width);
    *out = [[0.0; LANES]; 3];
    for k in 0..4 {
        let (place, weight) = (&footprint.place[k], &lookup.weight[k]);
        for &(first, n) in &footprint.segments.runs[..footprint.segments.count] {
            let at = place.row[first] as usize * stride + plane * 3 * width + place.element[first] as usize;
            for c in 0..3 {
                let source = &data[at + c * width..][..n];
                for ((out, weight), value) in out[c][first..][..n].iter_mut().zip(&weight[first..][..n]).zip(source) {
                    *out += if *weight > 0.0 { weight * value } else { 0.0 };
                }
            }
        }
        for &i in footprint.segments.singles() {
            if weight[i] > 0.0 {
                let at = place.row[i] as usize * stride + plane * 3 * width + place.element[i] as usize;
                for c in 0..3 {
                    out[c][i] += weight[i] * data[at + c * width];
                }
            }
        }
    }
}

/// Loads `n` pixels of a plane.
#[inline(always)]
pub(crate) fn load(row: &[f32], width: usize, plane: usize, begin: usize, n: usize, out: &mut Lanes3) {
    for c in 0..3 {
        copy::<LANES, _>(&mut out[c][..n], &channel(row, width, plane, c)[begin..][..n]);
    }
}

/// The beauty's history held to the boxes.
#[inline(always)]
pub(crate) fn clamp(history: &Lanes3, current: &Lanes3, low: &Lanes3, high: &Lanes3, out: &mut Lanes3) {
    for i in 0..LANES {
        let at = |v: &Lanes3| [v[0][i], v[1][i], v[2][i]];
        let clamped = clamp_history(at(history), at(current), &ColourBox { low: at(low), high: at(high) });
        for c in 0..3 {
            out[c][i] = clamped[c];
        }
    }
}

/// One plane blended with its history, which follows the beauty's clamp. `beauty`: history before and after the clamp,
/// and the current value.
#[inline(always)]
pub(crate) fn blend_lanes(
    current: &Lanes3,
    history: &Lanes3,
    share: &Lanes,
    beauty: (&Lanes3, &Lanes3, &Lanes3),
    out: &mut Lanes3,
) {
    for i in 0..LANES {
        let at = |v: &Lanes3| [v[0][i], v[1][i], v[2][i]];
        let now = at(current);
        let blended = blend(now, at(history), share[i], (at(beauty.0), at(beauty.1), at(beauty.2)));
        for c in 0..3 {
            out[c][i] = if share[i] > 0.0 { blended[c] } else { now[c] };
        }
    }
}

/// As [`blend_lanes`] where nothing was clamped.
#[inline(always)]
pub(crate) fn blend_unclamped(current: &Lanes3, history: &Lanes3, share: &Lanes, out: &mut Lanes3) {
    for c in 0..3 {
        for i in 0..LANES {
            let blended = share[i] * history[c][i] + (1.0 - share[i]) * current[c][i];
            out[c][i] = if share[i] > 0.0 { blended } else { current[c][i] };
        }
    }
}

/// As [`blend_lanes`] of the beauty itself, which shares its clamped value with nobody.
#[inline(always)]
pub(crate) fn blend_beauty(current: &Lanes3, history: &Lanes3, clamped: &Lanes3, share: &Lanes, out: &mut Lanes3) {
    for c in 0..3 {
        for i in 0..LANES {
            let held = follow_itself(history[c][i], clamped[c][i]);
            let blended = share[i] * held + (1.0 - share[i]) * current[c][i];
            out[c][i] = if share[i] > 0.0 { blended } else { current[c][i] };
        }
    }
}
