//! The schedule of stage 5: maximum and blur along rows and down columns, then the blend.

use crate::kernels::spiral::PERIOD;
use crate::phased::layout::{Colours, Phases};
use crate::phased::rows;
use crate::plane::Plane;
use crate::settings::Disocclusion;
use crate::simd::dispatch;
use crate::stages::disocclusion::cpu::{add, blend, blurred, keep_greater, widest};
use fearless_simd::Level;

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

/// An image to be written: the blend with at least so much of the prefiltered one.
pub(crate) type Floored<'a> = (&'a mut Colours, f32);

/// The blends. Both in one go: they read the same rows.
pub(crate) fn run(
    level: Level,
    phases: &Phases,
    (temporal, prefiltered): (&Colours, &Colours),
    distrust: &[f32],
    (output, floor): Floored<'_>,
    feedback: Option<Floored<'_>>,
) {
    let width = phases.size.width;
    let stride = output.stride(width);
    let blended = |y: usize, out: &mut [f32], also: Option<(&mut [f32], f32)>| {
        let distrust = &distrust[y * width..][..width];
        let channels = || temporal.row(width, y).chunks(width).zip(prefiltered.row(width, y).chunks(width));
        dispatch!(level, _simd => {
            for ((a, b), out) in channels().zip(out.chunks_mut(width)) {
                blend(a, b, distrust, floor, out);
            }
            if let Some((also, floor)) = also {
                for ((a, b), out) in channels().zip(also.chunks_mut(width)) {
                    blend(a, b, distrust, floor, out);
                }
            }
        });
    };
    match feedback {
        Some((also, floor)) => {
            let images = (output.elements_mut(), also.elements_mut());
            rows::zip2(images, [stride; 2], |y, out, also| blended(y, out, Some((also, floor))));
        }
        None => rows::each(output.elements_mut(), stride, |y, out| blended(y, out, None)),
    }
}
