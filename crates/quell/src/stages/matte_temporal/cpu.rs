//! Stages 3 and 8 once they know where history lies, on runs of pixels: fetch, clamp, blend.

use crate::kernels::change::{Change, kept_light, rounded_light};
use crate::kernels::clip::{ColourBox, follow_itself};
use crate::kernels::math::catmull_rom;
use crate::kernels::reproject_cpu::{Footprint, LANES, Lanes, Lanes3, Lookup};
use crate::kernels::spiral::PERIOD;
use crate::kernels::temporal::{Blend, blend, clamp_history, hold};
use crate::phased::layout::{Colours, Phases, channel, copy};

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

/// What [`fetch_spline`] needs of the lanes, the same for every plane.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Splines {
    along: [Lanes; 4],
    across: [Lanes; 4],
}

impl Splines {
    pub fn new() -> Self {
        Self { along: [[0.0; LANES]; 4], across: [[0.0; LANES]; 4] }
    }

    /// Weights of four columns and four rows around each lane's place.
    #[inline(always)]
    pub fn weigh(&mut self, lookup: &Lookup) {
        for i in 0..LANES {
            let (b, c, d) = (lookup.weight[1][i], lookup.weight[2][i], lookup.weight[3][i]);
            let (along, across) = (catmull_rom(b + d), catmull_rom(c + d));
            for k in 0..4 {
                self.along[k][i] = along[k];
                self.across[k][i] = across[k];
            }
        }
    }
}

/// What the spline found of a plane, lane by lane.
struct Splined {
    sum: Lanes3,
    /// Range of the four pixels around the place.
    low: Lanes3,
    high: Lanes3,
}

impl Splined {
    /// Adds 4x4 pixels of plane `plane` to `n` lanes from `first` on, whose places lie in one row, four columns apart. Not a closure:
    /// one would be compiled apart, without the instruction set of the loop around it.
    #[inline(always)]
    fn add(
        &mut self,
        (history, phases, plane): (&Colours, &Phases, usize),
        (footprint, splines): (&Footprint, &Splines),
        (first, n): (usize, usize),
    ) {
        let (data, width) = (history.elements(), phases.size.width);
        let stride = history.stride(width);
        let (x, y) = (footprint.column[0][first] as usize, footprint.row[0][first] as usize);
        for j in 0..4 {
            for k in 0..4 {
                let at = (y + j - 1) * stride + plane * 3 * width + phases.element(x + k - 1);
                let (along, across) = (&splines.along[k][first..][..n], &splines.across[j][first..][..n]);
                let inner = (k == 1 || k == 2) && (j == 1 || j == 2);
                for c in 0..3 {
                    let source = &data[at + c * width..][..n];
                    let sum = &mut self.sum[c][first..][..n];
                    for i in 0..n {
                        sum[i] += along[i] * across[i] * source[i];
                    }
                    if inner {
                        let (low, high) = (&mut self.low[c][first..][..n], &mut self.high[c][first..][..n]);
                        for i in 0..n {
                            low[i] = if source[i] < low[i] { source[i] } else { low[i] };
                            high[i] = if source[i] > high[i] { source[i] } else { high[i] };
                        }
                    }
                }
            }
        }
    }
}

/// Colours by the spline of the lanes that ask for it, in place of what [`fetch`] found for them; `held`: what both found, those of
/// the spline held to the range of the four pixels around the place.
#[inline(always)]
pub(crate) fn fetch_spline(
    (history, phases): (&Colours, &Phases),
    plane: usize,
    (footprint, lookup, splines): (&Footprint, &Lookup, &Splines),
    out: &mut Lanes3,
    held: Option<&mut Lanes3>,
) {
    let size = phases.size;
    let mut found =
        Splined { sum: [[0.0; LANES]; 3], low: [[f32::INFINITY; LANES]; 3], high: [[f32::NEG_INFINITY; LANES]; 3] };
    let (image, at) = ((history, phases, plane), (footprint, splines));
    for &(first, n) in &footprint.segments.runs[..footprint.segments.count] {
        let wanted = lookup.spline[first..][..n].iter().fold(0, |any, lane| any | lane);
        if wanted == 0 {
            continue;
        }
        let (x, y) = (footprint.column[0][first], footprint.row[0][first]);
        let last = x + (PERIOD * (n - 1)) as f32;
        if (x >= 1.0) & (y >= 1.0) & (last + 2.0 < size.width as f32) & (y + 2.0 < size.height as f32) {
            found.add(image, at, (first, n));
            continue;
        }
        for i in first..first + n {
            if lookup.spline[i] != 0 {
                found.add(image, at, (i, 1));
            }
        }
    }
    for &i in footprint.segments.singles() {
        if lookup.spline[i] != 0 {
            found.add(image, at, (i, 1));
        }
    }
    if let Some(held) = held {
        for c in 0..3 {
            for i in 0..LANES {
                let within = hold(found.sum[c][i], found.low[c][i], found.high[c][i]);
                held[c][i] = if lookup.spline[i] != 0 { within } else { out[c][i] };
            }
        }
    }
    for c in 0..3 {
        for i in 0..LANES {
            out[c][i] = if lookup.spline[i] != 0 { found.sum[c][i] } else { out[c][i] };
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

/// The beauty's history held to the boxes; `held`: as [`fetch_spline`] has it.
#[inline(always)]
pub(crate) fn clamp(
    (history, held): (&Lanes3, &Lanes3),
    current: &Lanes3,
    (low, high): (&Lanes3, &Lanes3),
    out: &mut Lanes3,
) {
    for i in 0..LANES {
        let at = |v: &Lanes3| [v[0][i], v[1][i], v[2][i]];
        let clamped = clamp_history(at(history), at(held), at(current), &ColourBox { low: at(low), high: at(high) });
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
