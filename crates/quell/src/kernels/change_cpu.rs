//! Where light has changed (`change.rs`) on runs of pixels. A cell's sums are made of those of its columns. Light is taken as the
//! difference to that of the column's first tap, then of the cell's: nothing cancels.

use super::change::{CELL, Change, LEAST_TAPS, LEAST_VARIANCE};

/// How many sums a column of taps has: of g and g n; of g x and g x^2, x the long mean's difference to the first tap's; of g y and g y^2, y
/// that of the fast mean less the long one.
pub(crate) const SUMS: usize = 6;
/// What is kept of a cell: G, G s, G f, G v.
pub(crate) const KEPT: usize = 4;

/// Adds a row of taps to the sums of columns. `first`: long and fast mean of the columns' first taps; `tap`: those of the taps.
#[inline(always)]
pub(crate) fn add_row(
    columns: [&mut [f32]; SUMS],
    change: &Change,
    length: &[f32],
    (long, quick): (&[f32], &[f32]),
    (first_long, first_quick): (&[f32], &[f32]),
) {
    let n = length.len();
    let (long, quick, first_long, first_quick) = (&long[..n], &quick[..n], &first_long[..n], &first_quick[..n]);
    let [g, gn, x1, x2, y1, y2] = columns.map(|sum| &mut sum[..n]);
    for i in 0..n {
        let frames = change.frames(length[i]);
        let w = change.weight(frames);
        let (x, y) = (long[i] - first_long[i], (quick[i] - long[i]) - (first_quick[i] - first_long[i]));
        g[i] += w;
        gn[i] += w * frames;
        x1[i] += w * x;
        x2[i] += w * x * x;
        y1[i] += w * y;
        y2[i] += w * y * y;
    }
}

/// A column's sums, and long and fast mean of its first tap.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    pub sums: [f32; SUMS],
    pub first: [f32; 2],
}

/// A cell from its columns.
#[inline(always)]
pub(crate) fn cell(change: &Change, columns: impl Iterator<Item = Column>) -> [f32; KEPT] {
    let mut sums = [0.0; SUMS];
    let mut about = None;
    for Column { sums: [g, gn, x1, x2, y1, y2], first: [long, quick] } in columns {
        let [own_long, own_quick] = *about.get_or_insert([long, quick]);
        // x + d about the cell's first tap is x about the column's.
        let d = long - own_long;
        let e = (quick - long) - (own_quick - own_long);
        let more = [g, gn, x1 + d * g, x2 + d * (2.0 * x1 + d * g), y1 + e * g, y2 + e * (2.0 * y1 + e * g)];
        for k in 0..SUMS {
            sums[k] += more[k];
        }
    }
    let [g, gn, x1, x2, y1, y2] = sums;
    let Some([long, quick]) = about.filter(|_| g > 0.0) else { return [0.0; KEPT] };
    let part = 1.0 / g;
    let (x, y) = (x1 * part, y1 * part);
    let of_long = (x2 * part - x * x) * (gn * part / change.fast_frames);
    let of_quick = y2 * part - y * y;
    let noise = if of_quick > of_long { of_quick } else { of_long };
    let noise = if noise > 0.0 { noise } else { 0.0 };
    let s = long + x;
    let f = s + (quick - long) + y;
    [g, g * s, g * f, g * noise]
}

/// Weights of the cells around a cell along an axis, for each of its pixels: w and w^2.
#[derive(Debug)]
pub(crate) struct Tents {
    pub weight: Vec<[f32; CELL]>,
    pub squared: Vec<[f32; CELL]>,
}

impl Tents {
    pub fn new(change: &Change) -> Self {
        let radius = change.radius as i32;
        let middle = (CELL - 1) as f32 / 2.0;
        let of = |k: i32| std::array::from_fn(|i| change.tent((CELL as i32 * k) as f32 + middle - i as f32));
        let weight: Vec<[f32; CELL]> = (-radius..=radius).map(of).collect();
        let squared = weight.iter().map(|w| w.map(|w| w * w)).collect();
        Self { weight, squared }
    }
}

/// Adds a column of cells, whose sums along the other axis these are, to those of a cell's pixels.
#[inline(always)]
pub(crate) fn add_cell(
    pixels: &mut [[f32; CELL]; KEPT],
    [g, s, f, v]: [f32; KEPT],
    weight: &[f32; CELL],
    squared: &[f32; CELL],
) {
    let [total, long, quick, noise] = pixels;
    for i in 0..CELL {
        total[i] += weight[i] * g;
        long[i] += weight[i] * s;
        quick[i] += weight[i] * f;
        noise[i] += squared[i] * v;
    }
}

/// c of each pixel of a cell's row.
#[inline(always)]
pub(crate) fn changed(change: &Change, [total, long, quick, noise]: &[[f32; CELL]; KEPT]) -> [f32; CELL] {
    let mut out = [0.0; CELL];
    for i in 0..CELL {
        let part = 1.0 / if total[i] < LEAST_TAPS { 1.0 } else { total[i] };
        let (s, f) = (long[i] * part, quick[i] * part);
        let floor = change.least * (s + f);
        let variance = noise[i] * (part * part) + floor * floor + LEAST_VARIANCE;
        let c = change.certainty((f - s).abs() / variance.sqrt());
        out[i] = if total[i] >= LEAST_TAPS { c } else { 0.0 };
    }
    out
}
