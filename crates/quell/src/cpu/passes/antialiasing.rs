//! The schedule of the picture's anti-aliasing. As the composite it works in the host's order; guides come from phase order.

use crate::frame::Rgb;
use crate::kernels::spiral::PERIOD;
use crate::par;
use crate::phased::guides::{CpuGuides, field};
use crate::phased::layout::Phases;
use crate::plane::Plane;
use crate::settings::Antialiasing;
use crate::simd::dispatch;
use crate::stages::antialiasing;
use crate::stages::antialiasing::cpu::{
    CHANNELS, Fetched, History, Line, Lines, MARGIN, Places, Target, add_line, boxes, complete_line, fetch,
    nearest_motion, ranges_before, resolve,
};
use fearless_simd::Level;
use std::ops::Range;

/// Rows that are done together, so that those between them are brought into order once. With the rows around them they stay in the L2 cache.
const BAND: usize = 8;

/// The picture that is shown goes to `output`, history and how many frames it holds to `kept`.
#[inline(never)] // benchmarks/instructions.py counts it
pub(crate) fn run(
    level: Level,
    guides: &CpuGuides,
    settings: &Antialiasing,
    (current, history): (&Plane<Rgb>, Option<&History>),
    output: &mut Plane<Rgb>,
    kept: &mut History,
) {
    let w = current.size().width;
    kept.rows.resize(CHANNELS * w * current.size().height, 0.0);
    par::two_rows(output.data_mut(), BAND * w, &mut kept.rows, BAND * CHANNELS * w, |i, out, kept| {
        dispatch!(level, _simd => {
            match history {
                Some(history) => band(guides, settings, (current, history), i * BAND, out, kept),
                None => {
                    for (y, (out, kept)) in out.chunks_exact_mut(w).zip(kept.chunks_exact_mut(CHANNELS * w)).enumerate() {
                        out.copy_from_slice(current.row(i * BAND + y));
                        kept[3 * w..].fill(1.0);
                    }
                }
            }
            for (out, kept) in out.chunks_exact(w).zip(kept.chunks_exact_mut(CHANNELS * w)) {
                for (x, colour) in out.iter().enumerate() {
                    (kept[x], kept[w + x], kept[2 * w + x]) = (colour[0], colour[1], colour[2]);
                }
            }
        });
    });
}

/// The rows from `first` on.
#[inline(always)]
fn band(
    guides: &CpuGuides,
    settings: &Antialiasing,
    (current, history): (&Plane<Rgb>, &History),
    first: usize,
    out: &mut [Rgb],
    kept: &mut [f32],
) {
    let phases = &guides.phases;
    let (w, h) = (phases.size.width, phases.size.height);
    let rows = first..first + out.len() / w;
    let reach = antialiasing::reach(settings).pixels[1];
    let around = |rows: Range<usize>, reach: usize| rows.start.saturating_sub(reach)..(rows.end + reach).min(h);
    let lines = around(rows.clone(), reach);
    let numbers = Line::numbers(w);
    let mut room = par::unset_scratch(lines.len() * numbers);
    for (y, rows) in lines.clone().zip(room.chunks_exact_mut(numbers)) {
        let columns = |k: usize| k * (w + 2 * MARGIN) + MARGIN..k * (w + 2 * MARGIN) + MARGIN + w;
        in_order(phases, field(&guides.now.depth, w, 1, y, 0), &mut rows[columns(0)]);
        in_order(phases, field(&guides.motion, w, 2, y, 0), &mut rows[columns(1)]);
        in_order(phases, field(&guides.motion, w, 2, y, 1), &mut rows[columns(2)]);
        complete_line(current.row(y), rows);
    }
    let line = |y: usize| Line::new(&room[(y - lines.start) * numbers..][..numbers], w);
    let mut beside = [line(first); 2 * MARGIN + 1];
    for (y, (out, kept)) in rows.zip(out.chunks_exact_mut(w).zip(kept.chunks_exact_mut(CHANNELS * w))) {
        let three = [y.checked_sub(1), Some(y), Some(y + 1).filter(|y| *y < h)].map(|y| y.map(line));
        let within = around(y..y + 1, settings.thin_radius as usize);
        let count = within.len();
        for (to, y) in beside.iter_mut().zip(within) {
            *to = line(y);
        }
        row(guides, settings, (current, history), y, (three, &beside[..count]), out, &mut kept[3 * w..]);
    }
}

/// `three`: the lines above, here and below; `within`: those within `thin_radius`.
#[inline(always)]
fn row(
    guides: &CpuGuides,
    settings: &Antialiasing,
    (current, history): (&Plane<Rgb>, &History),
    y: usize,
    (three, within): (Lines<'_>, &[Line<'_>]),
    out: &mut [Rgb],
    held: &mut [f32],
) {
    let phases = &guides.phases;
    let (w, h) = (phases.size.width, phases.size.height);
    // The nearest and the farthest depth; places; sums; ranges; what is fetched; trust.
    let mut room = par::unset_scratch((2 + 2 + 7 + 6 + 6 + 1) * w + 2 * MARGIN);
    let (nearest, rest) = room.split_at_mut(w + 2 * MARGIN);
    let (farthest, rest) = rest.split_at_mut(w);
    let (coordinate, rest) = rest.split_at_mut(2 * w);
    let (sums, rest) = rest.split_at_mut(7 * w);
    let (ranges, rest) = rest.split_at_mut(6 * w);
    let (colour, rest) = rest.split_at_mut(3 * w);
    let (frames, rest) = rest.split_at_mut(w);
    let (between, trusted) = rest.split_at_mut(2 * w);
    sums.fill(0.0);
    for line in three.into_iter().flatten() {
        add_line(line, sums);
    }
    let (px, py) = coordinate.split_at_mut(w);
    nearest_motion(three, &mut nearest[..w], farthest, [px, py]);
    ranges_before(settings, within, farthest, [px, py], nearest, ranges);
    boxes(settings, sums, ranges);
    for x in 0..w {
        px[x] += x as f32 + 0.5;
        py[x] += y as f32 + 0.5;
    }
    let trusted = (!guides.confidence_in.is_empty()).then(|| {
        in_order(phases, &guides.confidence_in[y * w..][..w], trusted);
        &*trusted
    });
    let places = Places { coordinate, trusted };
    fetch(history, (w, h), &places, &mut Target { colour, frames, between });
    resolve(settings, current.row(y), &Fetched { colour, frames, between }, ranges, out, held);
}

/// A row in the host's order.
#[inline(always)]
fn in_order(phases: &Phases, row: &[f32], out: &mut [f32]) {
    for phase in 0..PERIOD {
        let from = &row[phases.range(phase)];
        for (out, value) in out.iter_mut().skip(phase).step_by(PERIOD).zip(from) {
            *out = *value;
        }
    }
}
