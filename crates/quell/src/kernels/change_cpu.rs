//! Where light has changed (`change.rs`) on runs of pixels. A window's sums are made of those of its columns. Light is taken as the
//! difference to the centre's, of the column first, then of the window: nothing cancels.

use super::change::{Change, LEAST_TAPS, LEAST_VARIANCE};
use crate::kernels::edge_cpu::{RUN, Run};

/// How many sums there are: of g, g^2 and g n; of g x and g x^2, x the long mean's difference to the centre's; of g y and g y^2, y that
/// of the fast one.
pub(crate) const SUMS: usize = 7;

/// Adds a row of taps to the sums of columns. `centre`: long and fast mean of the columns' centres; `tap`: those of the taps.
#[inline(always)]
pub(crate) fn add_row(
    columns: [&mut [f32]; SUMS],
    change: &Change,
    length: &[f32],
    (long, quick): (&[f32], &[f32]),
    (own_long, own_quick): (&[f32], &[f32]),
) {
    let n = length.len();
    let (long, quick, own_long, own_quick) = (&long[..n], &quick[..n], &own_long[..n], &own_quick[..n]);
    let [g, g2, gn, x1, x2, y1, y2] = columns.map(|sum| &mut sum[..n]);
    for i in 0..n {
        let frames = change.frames(length[i]);
        let w = change.weight(frames);
        let (x, y) = (long[i] - own_long[i], quick[i] - own_quick[i]);
        g[i] += w;
        g2[i] += w * w;
        gn[i] += w * frames;
        x1[i] += w * x;
        x2[i] += w * x * x;
        y1[i] += w * y;
        y2[i] += w * y * y;
    }
}

/// The sums over the windows of a run of pixels.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Sums([Run; SUMS]);

impl Sums {
    pub fn new() -> Self {
        Self([[0.0; RUN]; SUMS])
    }

    /// Adds a column of each lane from `first` on. `theirs`: long and fast mean of the columns' centres; `own`: of the windows'.
    #[inline(always)]
    pub fn add(
        &mut self,
        first: usize,
        columns: [&[f32]; SUMS],
        (long, quick): (&[f32], &[f32]),
        (own_long, own_quick): (&[f32], &[f32]),
    ) {
        let n = long.len();
        let (quick, own_long, own_quick) = (&quick[..n], &own_long[first..][..n], &own_quick[first..][..n]);
        let [h, h2, hn, u1, u2, v1, v2] = columns.map(|sum| &sum[..n]);
        let [g, g2, gn, x1, x2, y1, y2] = self.0.each_mut().map(|sum| &mut sum[first..][..n]);
        for i in 0..n {
            // x + d about the window's centre is x about the column's.
            let (d, e) = (long[i] - own_long[i], quick[i] - own_quick[i]);
            g[i] += h[i];
            g2[i] += h2[i];
            gn[i] += hn[i];
            x1[i] += u1[i] + d * h[i];
            x2[i] += u2[i] + d * (2.0 * u1[i] + d * h[i]);
            y1[i] += v1[i] + e * h[i];
            y2[i] += v2[i] + e * (2.0 * v1[i] + e * h[i]);
        }
    }

    /// c of each lane.
    #[inline(always)]
    pub fn finish(&self, change: &Change, length: &[f32], (long, quick): (&[f32], &[f32]), out: &mut [f32]) {
        let n = out.len();
        let (length, long, quick) = (&length[..n], &long[..n], &quick[..n]);
        let [g, g2, gn, x1, x2, y1, y2] = self.0.each_ref().map(|v| &v[..n]);
        for i in 0..n {
            let part = 1.0 / if g[i] < LEAST_TAPS { 1.0 } else { g[i] };
            let (x, y) = (x1[i] * part, y1[i] * part);
            let of_long = (x2[i] * part - x * x) * (gn[i] * part / change.fast_frames);
            let of_quick = y2[i] * part - y * y;
            let noise = if of_quick > of_long { of_quick } else { of_long };
            let noise = if noise > 0.0 { noise } else { 0.0 };
            let (s, f) = (long[i] + x, quick[i] + y);
            let floor = change.least * (s + f);
            let variance = noise * (g2[i] * (part * part)) + floor * floor + LEAST_VARIANCE;
            let c = change.certainty((f - s).abs() / variance.sqrt());
            let known = (g[i] >= LEAST_TAPS) & (change.weight(change.frames(length[i])) > 0.0);
            out[i] = if known { c } else { 0.0 };
        }
    }
}
