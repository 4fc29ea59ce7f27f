//! The schedule of the detector of changed light (`kernels/change.rs`), over what the frame before left: row by row, phase by phase.

use super::sparse_bilateral::{Pieces, RunOf};
use crate::kernels::change::Change;
use crate::kernels::change_cpu::Sums;
use crate::kernels::edge_cpu::{RUN, run_length};
use crate::kernels::math::three;
use crate::kernels::spiral::PERIOD;
use crate::phased::layout::{Colours, Phases, channel};
use crate::phased::rows;
use crate::settings::OffScreen;
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
    let width = phases.size.width;
    let (radius, spacing) = (change.radius as i32, change.spacing as i32);
    let mut sums = Sums::new();
    let longest = run_length(phases.longest());
    for phase in 0..PERIOD {
        for first in (0..phases.count(phase)).step_by(longest) {
            let len = longest.min(phases.count(phase) - first);
            let begin = phases.range(phase).start + first;
            // What lies beside a run is read along with its taps: a vector on each side.
            let own = |plane: &[f32]| {
                let mut run = [0.0; RUN];
                run[..len].copy_from_slice(&plane[y * width + begin..][..len]);
                run
            };
            let (own_light, own_fast) = (own(light), own(left.fast));
            let length = &left.length[y * width + begin..][..len];
            let out = &mut out[begin..][..len];
            if length.iter().all(|n| change.weight(change.frames(*n)) <= 0.0) {
                out.fill(0.0);
                continue;
            }
            sums.clear();
            for (dx, dy) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy))) {
                let run = RunOf { y, phase, first, len };
                let mut pieces = Pieces::of(phases, run, (dx * spacing, dy * spacing), OffScreen::Skip);
                while let Some(piece) = pieces.next() {
                    let there = piece.at..piece.at + piece.len;
                    let lights = (&light[there.clone()], &left.fast[there.clone()]);
                    let own = (&own_light[..], &own_fast[..]);
                    sums.add(change, piece.first, piece.real, &left.length[there], lights, own);
                }
            }
            sums.finish(change, length, (&own_light, &own_fast), out);
        }
    }
}
