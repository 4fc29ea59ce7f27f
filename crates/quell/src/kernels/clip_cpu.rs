//! Boxes for the colour clamp (`clip.rs`) of a run of pixels: least and greatest values, or sums, down columns first,
//! then along rows.

use super::math::{three, ycocg_from_rgb};
use super::reproject_cpu::{LANES, Lanes3};
use crate::cpu::layout::{Colours, Phases, channel};
use crate::kernels::spiral::PERIOD;

/// Lanes with one more on either side: windows reach at most [`PERIOD`] columns.
const PADDED: usize = LANES + 2;

/// Least and greatest values, YCoCg, of the columns around a block of `LANES` pixels of each phase.
#[derive(Debug)]
pub(crate) struct Columns {
    low: [[[f32; PADDED]; 3]; PERIOD],
    high: [[[f32; PADDED]; 3]; PERIOD],
}

impl Columns {
    pub fn new() -> Self {
        Self { low: [[[f32::INFINITY; PADDED]; 3]; PERIOD], high: [[[f32::NEG_INFINITY; PADDED]; 3]; PERIOD] }
    }

    /// Of the pixels `first..first + LANES` of each phase, rows within `radius` of `y`. `depth`: only surfaces count;
    /// `None`: all pixels do.
    #[inline(always)]
    pub fn fill(
        &mut self,
        phases: &Phases,
        current: &Colours,
        depth: Option<&[f32]>,
        (y, first): (usize, usize),
        radius: usize,
    ) {
        let (width, height) = (phases.size.width, phases.size.height);
        for phase in 0..PERIOD {
            let (low, high) = (&mut self.low[phase], &mut self.high[phase]);
            *low = [[f32::INFINITY; PADDED]; 3];
            *high = [[f32::NEG_INFINITY; PADDED]; 3];
            let begin = first.saturating_sub(1);
            let end = (first + LANES + 1).min(phases.count(phase));
            if begin >= end {
                continue;
            }
            let (n, lane) = (end - begin, begin + 1 - first);
            let at = phases.range(phase).start + begin;
            for ty in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                let row = current.row(width, ty);
                let [r, g, b] = three(|c| &channel(row, width, 0, c)[at..][..n]);
                let depth = depth.map(|d| &d[ty * width + at..][..n]);
                let [l0, l1, l2] = &mut *low;
                let [h0, h1, h2] = &mut *high;
                let [l0, l1, l2] = [&mut l0[lane..][..n], &mut l1[lane..][..n], &mut l2[lane..][..n]];
                let [h0, h1, h2] = [&mut h0[lane..][..n], &mut h1[lane..][..n], &mut h2[lane..][..n]];
                for i in 0..n {
                    let c = ycocg_from_rgb([r[i], g[i], b[i]]);
                    let counts = depth.is_none_or(|d| d[i] < f32::INFINITY);
                    l0[i] = if counts & (c[0] < l0[i]) { c[0] } else { l0[i] };
                    l1[i] = if counts & (c[1] < l1[i]) { c[1] } else { l1[i] };
                    l2[i] = if counts & (c[2] < l2[i]) { c[2] } else { l2[i] };
                    h0[i] = if counts & (c[0] > h0[i]) { c[0] } else { h0[i] };
                    h1[i] = if counts & (c[1] > h1[i]) { c[1] } else { h1[i] };
                    h2[i] = if counts & (c[2] > h2[i]) { c[2] } else { h2[i] };
                }
            }
        }
    }

    /// The boxes of one phase's pixels: columns within `radius` (at most [`PERIOD`]).
    #[inline(always)]
    pub fn boxes(&self, phase: usize, radius: usize, low: &mut Lanes3, high: &mut Lanes3) {
        *low = [[f32::INFINITY; LANES]; 3];
        *high = [[f32::NEG_INFINITY; LANES]; 3];
        let radius = radius.min(PERIOD) as isize;
        for d in -radius..=radius {
            let target = phase as isize + d;
            let (of, shift) = (target.rem_euclid(PERIOD as isize) as usize, target.div_euclid(PERIOD as isize));
            let from = (1 + shift) as usize;
            for c in 0..3 {
                let (l, h) = (&self.low[of][c][from..][..LANES], &self.high[of][c][from..][..LANES]);
                for i in 0..LANES {
                    low[c][i] = if l[i] < low[c][i] { l[i] } else { low[c][i] };
                    high[c][i] = if h[i] > high[c][i] { h[i] } else { high[c][i] };
                }
            }
        }
    }
}

/// Sums over the columns around a block of `LANES` pixels of each phase: YCoCg, their squares, surfaces.
#[derive(Debug)]
pub(crate) struct Moments {
    /// Three sums, three sums of squares, the number.
    sums: [[[f32; PADDED]; 7]; PERIOD],
}

impl Moments {
    pub fn new() -> Self {
        Self { sums: [[[0.0; PADDED]; 7]; PERIOD] }
    }

    /// As [`Columns::fill`]; only surfaces count.
    #[inline(always)]
    pub fn fill(
        &mut self,
        phases: &Phases,
        current: &Colours,
        depth: &[f32],
        (y, first): (usize, usize),
        radius: usize,
    ) {
        let (width, height) = (phases.size.width, phases.size.height);
        for phase in 0..PERIOD {
            let sums = &mut self.sums[phase];
            *sums = [[0.0; PADDED]; 7];
            let begin = first.saturating_sub(1);
            let end = (first + LANES + 1).min(phases.count(phase));
            if begin >= end {
                continue;
            }
            let (n, lane) = (end - begin, begin + 1 - first);
            let at = phases.range(phase).start + begin;
            let [s0, s1, s2, q0, q1, q2, count] = sums;
            let [s0, s1, s2] = [&mut s0[lane..][..n], &mut s1[lane..][..n], &mut s2[lane..][..n]];
            let [q0, q1, q2] = [&mut q0[lane..][..n], &mut q1[lane..][..n], &mut q2[lane..][..n]];
            let count = &mut count[lane..][..n];
            for ty in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                let row = current.row(width, ty);
                let [r, g, b] = three(|c| &channel(row, width, 0, c)[at..][..n]);
                let depth = &depth[ty * width + at..][..n];
                for i in 0..n {
                    let counts = depth[i] < f32::INFINITY;
                    let c = ycocg_from_rgb([r[i], g[i], b[i]]);
                    let (c0, c1, c2) = if counts { (c[0], c[1], c[2]) } else { (0.0, 0.0, 0.0) };
                    s0[i] += c0;
                    s1[i] += c1;
                    s2[i] += c2;
                    q0[i] += c0 * c0;
                    q1[i] += c1 * c1;
                    q2[i] += c2 * c2;
                    count[i] += if counts { 1.0 } else { 0.0 };
                }
            }
        }
    }

    /// The boxes of one phase's pixels: mean and `gamma` deviations.
    #[inline(always)]
    pub fn boxes(&self, phase: usize, radius: usize, gamma: f32, low: &mut Lanes3, high: &mut Lanes3) {
        let mut sums = [[0.0f32; LANES]; 7];
        let radius = radius.min(PERIOD) as isize;
        for d in -radius..=radius {
            let target = phase as isize + d;
            let (of, shift) = (target.rem_euclid(PERIOD as isize) as usize, target.div_euclid(PERIOD as isize));
            for c in 0..7 {
                let column = &self.sums[of][c][(1 + shift) as usize..][..LANES];
                for i in 0..LANES {
                    sums[c][i] += column[i];
                }
            }
        }
        for c in 0..3 {
            for i in 0..LANES {
                let mean = sums[c][i] / sums[6][i];
                let variance = sums[3 + c][i] / sums[6][i] - mean * mean;
                let deviation = if variance > 0.0 { variance } else { 0.0 }.sqrt();
                low[c][i] = mean - gamma * deviation;
                high[c][i] = mean + gamma * deviation;
            }
        }
    }
}
