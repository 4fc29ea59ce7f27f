//! The schedule of the detector of changed light (`kernels/change.rs`), over what the frame before left: cells, then row by row.

use crate::kernels::change::{CELL, Change};
use crate::kernels::change_cpu::{Column, KEPT, SUMS, Tents, add_cell, add_row, cell, changed};
use crate::kernels::math::three;
use crate::phased::layout::{Colours, Phases, channel};
use crate::phased::rows;
use crate::plane::Size;
use crate::simd::dispatch;
use crate::stages::young_filter::cpu::luminances;
use fearless_simd::Level;

/// What the frame before left of a signal, in phase order.
#[derive(Clone, Copy)]
pub(crate) struct Left<'a> {
    pub colours: &'a Colours,
    /// History length, frames.
    pub length: &'a [f32],
    /// The fast history.
    pub fast: &'a [f32],
}

/// Room for what is made on the way: luminance, and the cells.
#[derive(Clone, Debug, Default)]
pub(crate) struct Room {
    light: Vec<f32>,
    cells: Vec<f32>,
}

/// c of every pixel, in phase order.
#[inline(never)] // benchmarks/instructions.py counts it
pub(crate) fn run(level: Level, phases: &Phases, change: &Change, left: Left<'_>, room: &mut Room, out: &mut [f32]) {
    let Size { width, height } = phases.size;
    let Room { light, cells } = room;
    light.resize(width * height, 0.0);
    rows::each(light, width, |y, light| {
        let row = left.colours.row(width, y);
        dispatch!(level, _simd => luminances(three(|c| channel(row, width, 0, c)), light));
    });
    let light = &*light;
    let stride = KEPT * width.div_ceil(CELL);
    cells.resize(stride * height.div_ceil(CELL), 0.0);
    rows::each(cells, stride, |y, cells| {
        dispatch!(level, _simd => row_of_cells(phases, change, left, light, y, cells));
    });
    let cells = &*cells;
    let tents = Tents::new(change);
    rows::each(out, width, |y, out| {
        dispatch!(level, _simd => a_row(phases, change, &tents, cells, y, out));
    });
}

#[inline(always)]
fn row_of_cells(phases: &Phases, change: &Change, left: Left<'_>, light: &[f32], y: usize, cells: &mut [f32]) {
    let Size { width, height } = phases.size;
    let row = |y: usize| {
        let row = y * width..(y + 1) * width;
        (&left.length[row.clone()], (&light[row.clone()], &left.fast[row]))
    };
    let (_, first) = row(CELL * y);
    let mut columns = vec![0.0; SUMS * width];
    let mut parts = columns.chunks_exact_mut(width);
    let mut columns: [&mut [f32]; SUMS] = std::array::from_fn(|_| parts.next().unwrap_or_default());
    let spacing = change.spacing as usize;
    for ty in (CELL * y..height.min(CELL * (y + 1))).step_by(spacing) {
        let (length, taps) = row(ty);
        add_row(columns.each_mut().map(|sum| &mut **sum), change, length, taps, first);
    }
    for (x, kept) in cells.chunks_exact_mut(KEPT).enumerate() {
        let taps = (CELL * x..width.min(CELL * (x + 1))).step_by(spacing).map(|x| {
            let i = phases.element(x);
            Column { sums: columns.each_ref().map(|sum| sum[i]), first: [first.0[i], first.1[i]] }
        });
        kept.copy_from_slice(&cell(change, taps));
    }
}

#[inline(always)]
fn a_row(phases: &Phases, change: &Change, tents: &Tents, cells: &[f32], y: usize, out: &mut [f32]) {
    let Size { width, height } = phases.size;
    let (wide, high) = (width.div_ceil(CELL), height.div_ceil(CELL));
    let radius = change.radius as usize;
    // The neighbour with this index among those of a cell, where the picture has it.
    let neighbour = |own: usize, k: usize, count: usize| (own + k).checked_sub(radius).filter(|there| *there < count);
    let mut sums = vec![[0.0; KEPT]; wide];
    for (k, (weight, squared)) in tents.weight.iter().zip(&tents.squared).enumerate() {
        let Some(there) = neighbour(y / CELL, k, high) else { continue };
        let (w, w2) = (weight[y % CELL], squared[y % CELL]);
        let row = cells[KEPT * wide * there..][..KEPT * wide].chunks_exact(KEPT);
        for (sum, cell) in sums.iter_mut().zip(row) {
            for (sum, (value, w)) in sum.iter_mut().zip(cell.iter().zip([w, w, w, w2])) {
                *sum += w * value;
            }
        }
    }
    if sums.iter().all(|sum| sum[0] <= 0.0) {
        out.fill(0.0);
        return;
    }
    for x in 0..wide {
        let mut pixels = [[0.0; CELL]; KEPT];
        for (k, (weight, squared)) in tents.weight.iter().zip(&tents.squared).enumerate() {
            if let Some(there) = neighbour(x, k, wide) {
                add_cell(&mut pixels, sums[there], weight, squared);
            }
        }
        let found = changed(change, &pixels);
        for (x, found) in (CELL * x..width.min(CELL * (x + 1))).zip(found) {
            out[phases.element(x)] = found;
        }
    }
}
