//! The schedule of stage 11: as that of the temporal stages.

use crate::kernels::clip_cpu::Columns;
use crate::kernels::reproject_cpu::{LANES, Lanes, Lanes3, Segments};
use crate::kernels::spiral::PERIOD;
use crate::phased::guides::{CpuGuides, field};
use crate::phased::layout::{Colours, Phases, copy};
use crate::phased::rows;
use crate::settings::{DirectTaa, REFERENCE_ROWS};
use crate::simd::dispatch;
use crate::stages::direct_taa::cpu::{resolve, trust};
use crate::stages::matte_temporal::cpu::load;
use fearless_simd::Level;

pub(crate) fn run(
    level: Level,
    guides: &CpuGuides,
    settings: &DirectTaa,
    (current, history): (&Colours, &Colours),
    output: &mut Colours,
) {
    let phases = guides.phases;
    let stride = output.stride(phases.size.width);
    rows::each(output.elements_mut(), stride, |y, out| {
        dispatch!(level, _simd => row(guides, &phases, settings, (current, history), y, out));
    });
}

#[inline(always)]
fn row(
    guides: &CpuGuides,
    phases: &Phases,
    settings: &DirectTaa,
    (current, history): (&Colours, &Colours),
    y: usize,
    out: &mut [f32],
) {
    let (width, height) = (phases.size.width, phases.size.height);
    let falloff_px = settings.motion_falloff * height as f32 / REFERENCE_ROWS;
    let extent = (width as f32, height as f32);
    let mut columns = Columns::new();
    for first in (0..phases.longest()).step_by(LANES) {
        columns.fill(phases, current, None, (y, first), 1);
        for phase in 0..PERIOD {
            let count = phases.count(phase);
            if first >= count {
                continue;
            }
            let n = LANES.min(count - first);
            let begin = phases.range(phase).start + first;
            let motion = nearest_motion(guides, phases, (y, phase, first, n));
            let mut coordinate = [[0.0; LANES]; 2];
            for i in 0..LANES {
                coordinate[0][i] = (PERIOD * (first + i) + phase) as f32 + 0.5 + motion[0][i];
                coordinate[1][i] = y as f32 + 0.5 + motion[1][i];
            }
            let mut trusted = [1.0; LANES];
            if !guides.confidence_in.is_empty() {
                copy::<LANES, _>(&mut trusted[..n], &guides.confidence_in[y * width + begin..][..n]);
            }
            let mut share = [0.0; LANES];
            trust(settings, falloff_px, &motion, &coordinate, extent, &trusted, &mut share);
            let fetched = bilinear(phases, history, &coordinate, &share, n);
            let mut now = [[0.0; LANES]; 3];
            load(current.row(width, y), width, 0, begin, n, &mut now);
            let (mut low, mut high) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            columns.boxes(phase, 1, &mut low, &mut high);
            let mut result = [[0.0; LANES]; 3];
            resolve(settings, &share, &now, &fetched, (&low, &high), &mut result);
            for c in 0..3 {
                copy::<LANES, _>(&mut out[c * width + begin..][..n], &result[c][..n]);
            }
        }
    }
}

/// Motion of the nearest depth in 3x3; of equally near ones the first in reading order.
#[inline(always)]
fn nearest_motion(
    guides: &CpuGuides,
    phases: &Phases,
    (y, phase, first, n): (usize, usize, usize, usize),
) -> [Lanes; 2] {
    let (width, height) = (phases.size.width, phases.size.height);
    let mut motion = [[f32::NAN; LANES]; 2];
    let begin = phases.range(phase).start + first;
    for c in 0..2 {
        copy::<LANES, _>(&mut motion[c][..n], &field(&guides.motion, width, 2, y, c)[begin..][..n]);
    }
    let mut nearest = [f32::INFINITY; LANES];
    let [mx, my] = &mut motion;
    for k in 0..9 {
        let (dx, ty) = (k as i32 % 3 - 1, (y + k / 3).wrapping_sub(1));
        if ty >= height {
            continue;
        }
        let Some(span) = phases.shifted(phase, first, n, dx) else { continue };
        let n = span.len;
        let depth = &field(&guides.now.depth, width, 1, ty, 0)[span.source..][..n];
        let sx = &field(&guides.motion, width, 2, ty, 0)[span.source..][..n];
        let sy = &field(&guides.motion, width, 2, ty, 1)[span.source..][..n];
        let nearest = &mut nearest[span.first..][..n];
        let (mx, my) = (&mut mx[span.first..][..n], &mut my[span.first..][..n]);
        for i in 0..n {
            let nearer = depth[i] < nearest[i];
            mx[i] = if nearer { sx[i] } else { mx[i] };
            my[i] = if nearer { sy[i] } else { my[i] };
            nearest[i] = if nearer { depth[i] } else { nearest[i] };
        }
    }
    motion
}

/// Bilinear fetch, clamped to the edge, where history counts.
#[inline(always)]
fn bilinear(phases: &Phases, history: &Colours, coordinate: &[Lanes; 2], share: &Lanes, n: usize) -> Lanes3 {
    let (width, height) = (phases.size.width, phases.size.height);
    let data = history.elements();
    let stride = history.stride(width);
    let mut out = [[0.0; LANES]; 3];
    let mut counts = [0u32; LANES];
    let (mut base, mut corner, mut part) = ([[0i32; LANES]; 2], [[0.0; LANES]; 2], [[0.0; LANES]; 2]);
    for axis in 0..2 {
        for i in 0..LANES {
            counts[i] = u32::from((i < n) & (share[i] > 0.0));
            let c = if counts[i] != 0 { coordinate[axis][i] } else { 0.0 } - 0.5;
            corner[axis][i] = c.floor();
            part[axis][i] = c - corner[axis][i];
            base[axis][i] = corner[axis][i] as i32;
        }
    }
    let mix = |a: f32, b: f32, t: f32| a * (1.0 - t) + b * t;
    let mut segments = Segments::new();
    segments.find(&base, &counts, width as i32, height as i32);
    for &(first, n) in &segments.runs[..segments.count] {
        let (x, y) = (base[0][first] as usize, base[1][first] as usize);
        let (left, right) = (y * stride + phases.element(x), y * stride + phases.element(x + 1));
        let (tx, ty) = (&part[0][first..][..n], &part[1][first..][..n]);
        for c in 0..3 {
            let row = |at: usize| &data[at + c * width..][..n];
            let (a, b, p, q) = (row(left), row(right), row(left + stride), row(right + stride));
            let out = &mut out[c][first..][..n];
            for i in 0..n {
                out[i] = mix(mix(a[i], b[i], tx[i]), mix(p[i], q[i], tx[i]), ty[i]);
            }
        }
    }
    for &i in segments.singles() {
        let (bx, by, tx, ty) = (corner[0][i], corner[1][i], part[0][i], part[1][i]);
        let hold = |v: f32, extent: usize| (v.max(0.0) as usize).min(extent - 1);
        let (x0, x1) = (phases.element(hold(bx, width)), phases.element(hold(bx + 1.0, width)));
        let (y0, y1) = (hold(by, height) * stride, hold(by + 1.0, height) * stride);
        for c in 0..3 {
            let at = |x: usize, y: usize| data[y + c * width + x];
            out[c][i] = mix(mix(at(x0, y0), at(x1, y0), tx), mix(at(x0, y1), at(x1, y1), tx), ty);
        }
    }
    out
}
