//! The residual's means over cells, row by row on all threads: the fast twin of [`super::reference`].

use super::{LEAST, LEVELS, between, cells, change, squares, triangle};
use crate::par;
use crate::plane::Size;
use crate::sequence::settings::Residual;
use crate::simd::widest;
use crate::stages::recombine::raw;
use crate::window::{LightSlot, PreparedFrame, Rows, Samples};

/// As [`super::reference::run`].
pub(crate) fn run(frame: &PreparedFrame, slots: &[LightSlot], mut colours: Rows, s: &Residual) -> Rows {
    let size = frame.features.size;
    let w = size.width;
    let noisy = |slot: &&LightSlot| matches!(frame.stored[slot.light], Samples::Black | Samples::Packed(_));
    for slot in slots.iter().filter(noisy) {
        let mut own = Rows::new(size, 3);
        par::rows(own.data_mut(), 3 * w, |y, row| widest!(own_row(frame, slot, y, row)));
        for (cell, radius) in LEVELS {
            let level = Level {
                first: frame.features.first_row,
                cell,
                kernel: triangle(radius),
                sure: s.sure,
                noise: s.noise,
                change: change(s),
            };
            let changes = level.changes(&own, &colours, slot);
            level.apply(&own, &mut colours, slot, &changes);
        }
    }
    colours
}

/// A row of the light as it came.
#[inline(always)]
fn own_row(frame: &PreparedFrame, slot: &LightSlot, y: usize, row: &mut [f32]) {
    let w = row.len() / 3;
    let [red, green, blue] = three_parts(row, w);
    for (x, ((red, green), blue)) in red.iter_mut().zip(green).zip(blue).enumerate() {
        let value = raw(frame, slot, 0, y * w + x).unwrap_or([0.0; 3]);
        (*red, *green, *blue) = (value[0], value[1], value[2]);
    }
}

#[inline(always)]
fn three_parts(row: &mut [f32], w: usize) -> [&mut [f32]; 3] {
    let (red, rest) = row.split_at_mut(w);
    let (green, blue) = rest.split_at_mut(w);
    [red, green, blue]
}

/// What [`between`] finds.
type Between = (usize, usize, f32);

/// Sums of a cell: of the filtered light, of the residual and of its square, each of three channels.
const SUMS: usize = 9;

struct Level {
    /// Row of the picture at which the images begin.
    first: usize,
    cell: usize,
    kernel: Vec<f32>,
    sure: f32,
    noise: f32,
    change: [f32; 2],
}

impl Level {
    /// What each cell is multiplied by, less 1: three channels.
    fn changes(&self, own: &Rows, colours: &Rows, slot: &LightSlot) -> Rows {
        let Size { width: w, height: h } = own.size();
        let (cell, first) = (self.cell, self.first % self.cell);
        let size = Size::new(cells(0, w, cell), cells(self.first, h, cell));
        let mut sums = Rows::new(size, SUMS);
        par::rows(sums.data_mut(), SUMS * size.width, |v, out| {
            let rows = (v * cell).saturating_sub(first)..((v + 1) * cell - first).min(h);
            widest!(self.sums_row(own, colours, slot, rows.clone(), out));
        });
        let mut across = Rows::new(size, SUMS);
        par::rows(across.data_mut(), SUMS * size.width, |v, out| {
            for (c, out) in out.chunks_exact_mut(size.width).enumerate() {
                widest!(smooth_across(sums.row(v, c), &self.kernel, out));
            }
        });
        let mut changes = Rows::new(size, 3);
        par::rows(changes.data_mut(), 3 * size.width, |v, out| {
            let mut smooth = vec![0.0f32; SUMS * size.width];
            let reach = self.kernel.len() - 1;
            for u in v.saturating_sub(reach)..(v + reach + 1).min(size.height) {
                let k = self.kernel[u.abs_diff(v)];
                for (c, sums) in smooth.chunks_exact_mut(size.width).enumerate() {
                    sums.iter_mut().zip(across.row(u, c)).for_each(|(sum, value)| *sum += k * value);
                }
            }
            widest!(self.changes_row(&smooth, out));
        });
        changes
    }

    /// Sums of a row of cells, which hold `rows` of pixels.
    #[inline(always)]
    fn sums_row(&self, own: &Rows, colours: &Rows, slot: &LightSlot, rows: std::ops::Range<usize>, out: &mut [f32]) {
        let (w, cell) = (own.size().width, self.cell);
        let across = w.div_ceil(cell);
        let mut residuals = vec![0.0f32; 2 * w];
        for (y, c) in rows.flat_map(|y| (0..3).map(move |c| (y, c))) {
            let (filtered, own) = (colours.row(y, 3 * slot.first + c), own.row(y, c));
            let (residual, squared) = residuals.split_at_mut(w);
            for x in 0..w {
                residual[x] = own[x] - filtered[x];
                squared[x] = residual[x] * residual[x];
            }
            for (k, values) in [filtered, &*residual, &*squared].into_iter().enumerate() {
                let out = &mut out[(3 * c + k) * across..][..across];
                match cell {
                    2 => add_cells::<2>(values, out),
                    4 => add_cells::<4>(values, out),
                    _ => {
                        for (out, values) in out.iter_mut().zip(values.chunks(cell)) {
                            *out += values.iter().sum::<f32>();
                        }
                    }
                }
            }
        }
    }

    /// Shrunk ratios of a row of cells.
    #[inline(always)]
    fn changes_row(&self, smooth: &[f32], out: &mut [f32]) {
        let w = smooth.len() / SUMS;
        let (squares, pixels) = (squares(&self.kernel), (self.cell * self.cell) as f32);
        for x in 0..w {
            let at = |c: usize, k: usize| smooth[(3 * c + k) * w + x];
            let (mut size, mut variance, mut noise) = (0.0f32, 0.0f32, 0.0f32);
            let mut ratio = [0.0f32; 3];
            for c in 0..3 {
                let light = at(c, 0) + LEAST;
                ratio[c] = at(c, 1) / light;
                size += ratio[c] * ratio[c];
                variance += squares * at(c, 2) / (light * light);
                noise += pixels * at(c, 2) / (light * light) / 3.0;
            }
            let doubt = self.sure * variance;
            // NaN, of infinities, is no agreement.
            let kept = if doubt < size { 1.0 - doubt / size } else { 0.0 };
            let share = if noise.is_finite() { noise / (noise + self.noise * self.noise + LEAST) } else { 0.0 };
            let kept = kept * share;
            for c in 0..3 {
                out[c * w + x] = (ratio[c] * kept).max(self.change[0]).min(self.change[1]);
            }
        }
    }

    /// Multiplies a light's planes.
    fn apply(&self, own: &Rows, colours: &mut Rows, slot: &LightSlot, changes: &Rows) {
        let w = own.size().width;
        let (across, down) = (changes.size().width, changes.size().height);
        let columns: Vec<_> = (0..w).map(|x| between(0, x, self.cell, across)).collect();
        let channels = colours.channels();
        par::rows(colours.data_mut(), channels * w, |y, out| {
            let rows = between(self.first, y, self.cell, down);
            let out = &mut out[3 * slot.first * w..][..3 * slot.planes * w];
            widest!(self.apply_row((own, y), changes, (&columns, rows), out));
        });
    }

    /// A row of pixels, between two rows of cells.
    #[inline(always)]
    fn apply_row(
        &self,
        (own, y): (&Rows, usize),
        changes: &Rows,
        (columns, (above, below, ty)): (&[Between], Between),
        out: &mut [f32],
    ) {
        let (w, across) = (columns.len(), changes.size().width);
        // 0 where a pixel came out as it went in.
        let mut changed = vec![0.0f32; w];
        for c in 0..3 {
            for (changed, (filtered, own)) in changed.iter_mut().zip(out[c * w..].iter().zip(own.row(y, c))) {
                *changed = if filtered == own { *changed } else { 1.0 };
            }
        }
        let mut row = vec![0.0f32; across];
        let mut factor = vec![0.0f32; w];
        for c in 0..3 {
            for (row, (a, b)) in row.iter_mut().zip(changes.row(above, c).iter().zip(changes.row(below, c))) {
                *row = a + (b - a) * ty;
            }
            match self.cell {
                2 => spread::<2>(&row, columns, &mut factor),
                4 => spread::<4>(&row, columns, &mut factor),
                _ => spread_some(&row, columns, &mut factor),
            }
            for plane in out.chunks_exact_mut(3 * w) {
                for ((value, factor), changed) in plane[c * w..][..w].iter_mut().zip(&factor).zip(&changed) {
                    *value *= 1.0 + factor * changed;
                }
            }
        }
    }
}

/// Adds to each cell's sum those of its `N` pixels; the last cell may have fewer.
#[inline(always)]
fn add_cells<const N: usize>(values: &[f32], out: &mut [f32]) {
    let (whole, rest) = values.as_chunks::<N>();
    for (out, values) in out.iter_mut().zip(whole) {
        let mut sum = 0.0;
        for value in values {
            sum += value;
        }
        *out += sum;
    }
    if let (Some(out), false) = (out.get_mut(whole.len()), rest.is_empty()) {
        *out += rest.iter().sum::<f32>();
    }
}

/// What each pixel of a row of cells is multiplied by, less 1: `columns` has the two cells of a pixel and the share of the second.
#[inline(always)]
fn spread_some(row: &[f32], columns: &[Between], out: &mut [f32]) {
    for (out, (left, right, tx)) in out.iter_mut().zip(columns) {
        *out = row[*left] + (row[*right] - row[*left]) * tx;
    }
}

/// [`spread_some`] for cells of `N` pixels, an even number: between the middles of two cells lie as many pixels, always at the same shares.
#[inline(always)]
fn spread<const N: usize>(row: &[f32], columns: &[Between], out: &mut [f32]) {
    let head = (N / 2).min(out.len());
    spread_some(row, &columns[..head], &mut out[..head]);
    let (columns, out) = (&columns[head..], &mut out[head..]);
    let (whole, _) = out.as_chunks_mut::<N>();
    let mut done = 0;
    if let Some(shares) = columns.first_chunk::<N>() {
        let shares = shares.map(|column| column.2);
        for (out, (a, b)) in whole.iter_mut().zip(row.iter().zip(row.iter().skip(1))) {
            for (out, share) in out.iter_mut().zip(shares) {
                *out = a + (b - a) * share;
            }
            done += N;
        }
    }
    spread_some(row, &columns[done..], &mut out[done..]);
}

/// A row smoothed by a triangle, as far as it goes.
#[inline(always)]
fn smooth_across(row: &[f32], kernel: &[f32], out: &mut [f32]) {
    let w = row.len();
    for (out, value) in out.iter_mut().zip(row) {
        *out = kernel[0] * value;
    }
    for (d, k) in kernel.iter().enumerate().skip(1).take_while(|(d, _)| *d < w) {
        out[d..].iter_mut().zip(row).for_each(|(sum, value)| *sum += k * value);
        out[..w - d].iter_mut().zip(&row[d..]).for_each(|(sum, value)| *sum += k * value);
    }
}
