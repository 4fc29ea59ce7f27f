//! Where light has changed (`change.rs`) on runs of pixels. Light is taken as the difference to the centre's: nothing cancels.

use super::change::{Change, LEAST_TAPS, LEAST_VARIANCE};
use crate::kernels::edge_cpu::{RUN, Run};

/// The sums over a window's taps.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Sums {
    /// Of g, g^2 and g n.
    weights: [Run; 3],
    /// Of g x and g x^2, x the long mean.
    long: [Run; 2],
    /// The same of the fast one.
    quick: [Run; 2],
    /// g of the tap at hand.
    weight: Run,
}

impl Sums {
    pub fn new() -> Self {
        let zero = [0.0; RUN];
        Self { weights: [zero; 3], long: [zero; 2], quick: [zero; 2], weight: zero }
    }

    pub fn clear(&mut self) {
        *self = Self::new();
    }

    /// Adds a tap from lane `first` on. `centre`: long and fast mean of the centres; `tap`: those of the taps. Lanes outside `real`
    /// have no tap.
    #[inline(always)]
    pub fn add(
        &mut self,
        change: &Change,
        first: usize,
        real: (usize, usize),
        length: &[f32],
        (long, quick): (&[f32], &[f32]),
        (own_long, own_quick): (&[f32], &[f32]),
    ) {
        let n = length.len();
        let (long, quick) = (&long[..n], &quick[..n]);
        let (own_long, own_quick) = (&own_long[first..][..n], &own_quick[first..][..n]);
        let weight = &mut self.weight[..n];
        for i in 0..n {
            weight[i] = change.weight(change.frames(length[i]));
        }
        weight[..real.0].fill(0.0);
        weight[real.1..].fill(0.0);
        let [g, g2, gn] = self.weights.each_mut().map(|v| &mut v[first..][..n]);
        let [x1, x2] = self.long.each_mut().map(|v| &mut v[first..][..n]);
        let [y1, y2] = self.quick.each_mut().map(|v| &mut v[first..][..n]);
        for i in 0..n {
            let w = weight[i];
            let (x, y) = (long[i] - own_long[i], quick[i] - own_quick[i]);
            g[i] += w;
            g2[i] += w * w;
            gn[i] += w * change.frames(length[i]);
            x1[i] += w * x;
            x2[i] += w * x * x;
            y1[i] += w * y;
            y2[i] += w * y * y;
        }
    }

    /// c of each lane.
    #[inline(always)]
    pub fn finish(&self, change: &Change, length: &[f32], (long, quick): (&[f32], &[f32]), out: &mut [f32]) {
        let n = out.len();
        let (length, long, quick) = (&length[..n], &long[..n], &quick[..n]);
        let [g, g2, gn] = self.weights.each_ref().map(|v| &v[..n]);
        let [x1, x2] = self.long.each_ref().map(|v| &v[..n]);
        let [y1, y2] = self.quick.each_ref().map(|v| &v[..n]);
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
