//! The schedule of the picture's anti-aliasing. As the composite it works in the host's order; guides come from phase order.

use crate::frame::Rgb;
use crate::kernels::spiral::PERIOD;
use crate::par;
use crate::phased::guides::{CpuGuides, field};
use crate::phased::layout::Phases;
use crate::plane::Plane;
use crate::settings::Antialiasing;
use crate::simd::dispatch;
use crate::stages::antialiasing::cpu::{
    CHANNELS, Fetched, History, Places, Target, add_line, fetch, nearest_motion, resolve,
};
use fearless_simd::Level;

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
    par::two_rows(output.data_mut(), w, &mut kept.rows, CHANNELS * w, |y, out, kept| {
        dispatch!(level, _simd => {
            match history {
                Some(history) => row(guides, settings, (current, history), y, out, &mut kept[3 * w..]),
                None => {
                    out.copy_from_slice(current.row(y));
                    kept[3 * w..].fill(1.0);
                }
            }
            for (x, colour) in out.iter().enumerate() {
                (kept[x], kept[w + x], kept[2 * w + x]) = (colour[0], colour[1], colour[2]);
            }
        });
    });
}

#[inline(always)]
fn row(
    guides: &CpuGuides,
    settings: &Antialiasing,
    (current, history): (&Plane<Rgb>, &History),
    y: usize,
    out: &mut [Rgb],
    held: &mut [f32],
) {
    let phases = &guides.phases;
    let (w, h) = (phases.size.width, phases.size.height);
    let lines = [y.checked_sub(1), Some(y), Some(y + 1).filter(|y| *y < h)];
    // Of three rows depth and motion; the nearest depth; places; converted colours; sums; what is fetched; trust.
    let mut room = par::unset_scratch((9 + 1 + 2 + 3 + 7 + 6 + 1) * w);
    let (guide_rows, rest) = room.split_at_mut(9 * w);
    let (nearest, rest) = rest.split_at_mut(w);
    let (coordinate, rest) = rest.split_at_mut(2 * w);
    let (converted, rest) = rest.split_at_mut(3 * w);
    let (sums, rest) = rest.split_at_mut(7 * w);
    let (colour, rest) = rest.split_at_mut(3 * w);
    let (frames, rest) = rest.split_at_mut(w);
    let (between, trusted) = rest.split_at_mut(2 * w);
    sums.fill(0.0);
    for (line, rows) in lines.into_iter().zip(guide_rows.chunks_exact_mut(3 * w)) {
        let Some(y) = line else { continue };
        let (depth, motion) = rows.split_at_mut(w);
        in_order(phases, field(&guides.now.depth, w, 1, y, 0), depth);
        for (axis, motion) in motion.chunks_exact_mut(w).enumerate() {
            in_order(phases, field(&guides.motion, w, 2, y, axis), motion);
        }
        add_line(current.row(y), converted, sums);
    }
    let of = |line: usize, from: usize, to: usize| lines[line].map(|_| &guide_rows[(3 * line + from) * w..][..to * w]);
    let depth = [of(0, 0, 1), of(1, 0, 1), of(2, 0, 1)];
    let motion = [of(0, 1, 2), of(1, 1, 2), of(2, 1, 2)];
    let (px, py) = coordinate.split_at_mut(w);
    nearest_motion(depth, motion, nearest, [px, py]);
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
    resolve(settings, current.row(y), &Fetched { colour, frames, between }, sums, out, held);
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
