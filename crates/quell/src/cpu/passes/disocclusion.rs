//! The schedule of stage 5: maximum and blur along rows and down columns, then the blend.

use crate::cpu::layout::{Colours, Phases};
use crate::cpu::rows;
use crate::kernels::spiral::PERIOD;
use crate::plane::Plane;
use crate::settings::Disocclusion;
use crate::stages::disocclusion::cpu::{add, blend, blurred, keep_greater, widest};
use fearless_simd::{Level, dispatch};

/// Columns whose order is changed at once.
const BLOCK: usize = 64 * PERIOD;

/// Distrust k of every pixel, in phase order, in `result`; `scratch` is as long: one scalar a pixel.
pub(crate) fn distrust(
    level: Level,
    phases: &Phases,
    confidence: &Plane<f32>,
    settings: &Disocclusion,
    result: &mut [f32],
    scratch: &mut [f32],
) {
    let (width, height) = (phases.size.width, phases.size.height);
    let (radius, blur) = (settings.radius as usize, settings.blur as usize);
    let window = |y: usize, radius: usize| y.saturating_sub(radius)..(y + radius + 1).min(height);
    rows::each(scratch, width, |y, out| dispatch!(level, _simd => widest(confidence.row(y), radius, out)));
    let source = &*scratch;
    rows::each(result, width, |y, out| {
        dispatch!(level, _simd => {
            out.fill(0.0);
            for ty in window(y, radius) {
                keep_greater(out, &source[ty * width..][..width]);
            }
        });
    });
    let source = &*result;
    rows::each(scratch, width, |y, out| dispatch!(level, _simd => blurred(&source[y * width..][..width], blur, out)));
    let source = &*scratch;
    rows::each(result, width, |y, out| {
        dispatch!(level, _simd => {
            let rows = window(y, blur);
            let count = rows.len() as f32;
            for begin in (0..width).step_by(BLOCK) {
                let n = BLOCK.min(width - begin);
                let mut sums = [0.0f32; BLOCK];
                for ty in rows.clone() {
                    add(&mut sums[..n], &source[ty * width + begin..][..n]);
                }
                for phase in 0..PERIOD.min(n) {
                    let out = &mut out[phases.element(begin + phase)..];
                    for (out, sum) in out.iter_mut().zip(sums[..n].iter().skip(phase).step_by(PERIOD)) {
                        *out = *sum / count;
                    }
                }
            }
        });
    });
}

/// The blend with at least `floor` of `prefiltered`.
pub(crate) fn run(
    level: Level,
    phases: &Phases,
    (temporal, prefiltered): (&Colours, &Colours),
    distrust: &[f32],
    floor: f32,
    output: &mut Colours,
) {
    let width = phases.size.width;
    let stride = output.stride(width);
    rows::each(output.elements_mut(), stride, |y, out| {
        let distrust = &distrust[y * width..][..width];
        let (temporal, prefiltered) = (temporal.row(width, y), prefiltered.row(width, y));
        dispatch!(level, _simd => {
            for ((out, a), b) in
                out.chunks_mut(width).zip(temporal.chunks(width)).zip(prefiltered.chunks(width))
            {
                blend(a, b, distrust, floor, out);
            }
        });
    });
}
