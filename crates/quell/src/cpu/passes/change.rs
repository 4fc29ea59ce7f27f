//! The schedule of the detector of changed light (`kernels/change.rs`), over what the frame before left: row by row, phase by phase.

use crate::kernels::change::Change;
use crate::kernels::change_cpu::{SUMS, Sums, add_row};
use crate::kernels::edge_cpu::run_length;
use crate::kernels::math::three;
use crate::kernels::spiral::PERIOD;
use crate::phased::layout::{Colours, Phases, channel};
use crate::phased::rows;
use crate::plane::Size;
use crate::stages::young_filter::cpu::luminances;
use fearless_simd::{Level, dispatch};

/// What the frame before left of a signal, in phase order.
#[derive(Clone, Copy)]
pub(crate) struct Left<'a> {
    pub colours: &'a Colours,
    /// History length, frames.
    pub length: &'a [f32],
    /// The fast history.
    pub fast: &'a [f32],
}

/// c of every pixel of that frame. `light`: room for its luminance.
pub(crate) fn run(level: Level, phases: &Phases, change: &Change, left: Left<'_>, light: &mut [f32], out: &mut [f32]) {
    let width = phases.size.width;
    rows::each(light, width, |y, light| {
        let row = left.colours.row(width, y);
        dispatch!(level, _simd => luminances(three(|c| channel(row, width, 0, c)), light));
    });
    let light = &*light;
    rows::each(out, width, |y, out| {
        dispatch!(level, _simd => a_row(phases, change, left, light, y, out));
    });
}

#[inline(always)]
fn a_row(phases: &Phases, change: &Change, left: Left<'_>, light: &[f32], y: usize, out: &mut [f32]) {
    let Size { width, height } = phases.size;
    let (radius, spacing) = (change.radius as i32, change.spacing as i32);
    let row = |y: usize| {
        let row = y * width..(y + 1) * width;
        (&left.length[row.clone()], (&light[row.clone()], &left.fast[row]))
    };
    let (length, own) = row(y);
    let says_nothing = |length: &[f32]| length.iter().all(|n| change.weight(change.frames(*n)) <= 0.0);
    if says_nothing(length) {
        out.fill(0.0);
        return;
    }
    let mut columns = vec![0.0; SUMS * width];
    let mut parts = columns.chunks_exact_mut(width);
    let mut columns: [&mut [f32]; SUMS] = std::array::from_fn(|_| parts.next().unwrap_or_default());
    for ty in (-radius..=radius).map(|dy| y as i32 + dy * spacing).filter(|ty| (0..height as i32).contains(ty)) {
        let (length, taps) = row(ty as usize);
        add_row(columns.each_mut().map(|sum| &mut **sum), change, length, taps, own);
    }
    let longest = run_length(phases.longest());
    for phase in 0..PERIOD {
        for first in (0..phases.count(phase)).step_by(longest) {
            let len = longest.min(phases.count(phase) - first);
            let here = phases.range(phase).start + first..phases.range(phase).start + first + len;
            let (length, own) = (&length[here.clone()], (&own.0[here.clone()], &own.1[here.clone()]));
            let out = &mut out[here];
            if says_nothing(length) {
                out.fill(0.0);
                continue;
            }
            let mut sums = Sums::new();
            for span in (-radius..=radius).filter_map(|dx| phases.shifted(phase, first, len, dx * spacing)) {
                let there = span.source..span.source + span.len;
                let theirs = (&light[y * width..][there.clone()], &left.fast[y * width..][there.clone()]);
                sums.add(span.first, columns.each_ref().map(|sum| &sum[there.clone()]), theirs, own);
            }
            sums.finish(change, length, own, out);
        }
    }
}
