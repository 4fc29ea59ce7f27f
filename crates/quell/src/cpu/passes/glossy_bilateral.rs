//! The schedule of stages 9 and 10: as that of stages 4 and 7, with taps along one axis.

use super::sparse_bilateral::{Pieces, RunOf, guide_run, lanes_of, of_fields};
use crate::kernels::edge_cpu::{Centres, Gains, RUN, Run, Tap, run_length, weights};
use crate::kernels::math::three;
use crate::kernels::spiral::PERIOD;
use crate::phased::guides::{CpuGuides, field};
use crate::phased::layout::{Colours, channel};
use crate::phased::rows;
use crate::settings::{GlossyBilateral, OffScreen, Settings};
use crate::simd::dispatch;
use crate::stages::glossy_bilateral::Axis;
use crate::stages::glossy_bilateral::KernelSize;
use crate::stages::glossy_bilateral::cpu::{
    GENTLE_SIGMA, add_neighbours, admit, bend_to, exponents, finish, gaussian, nearness, radii,
};
use crate::stages::matte_prefilter::cpu::{gather, invert};
use fearless_simd::Level;

/// What a pass needs besides its images.
#[derive(Clone, Copy)]
pub(crate) struct Filter<'a> {
    pub level: Level,
    pub guides: &'a CpuGuides,
    pub settings: &'a Settings,
    pub axis: Axis,
    /// Of every pixel along that axis, as [`radii`] finds it.
    pub radius: &'a [f32],
}

/// The kernel's radius at every pixel along both axes, in `across` and `down`; `scratch` is as long.
pub(crate) fn radius(
    level: Level,
    guides: &CpuGuides,
    settings: &GlossyBilateral,
    (across, down): (&mut [f32], &mut [f32]),
    scratch: &mut [f32],
) {
    let phases = guides.phases;
    let (width, height) = (phases.size.width, phases.size.height);
    let (kernel, view) = (KernelSize::new(settings, height), &guides.now.view);
    let hit = guides.has_glossy_hit().then_some(&guides.glossy_hit);
    if let Some(hit) = hit {
        rows::each(scratch, width, |y, out| {
            let at = y * width..(y + 1) * width;
            dispatch!(level, _simd => nearness(view.perspective, &guides.now.depth[at.clone()], &hit[at], out));
        });
    }
    let near = &*scratch;
    let now = &guides.now;
    // Depth, identity and normal of elements `first..first + n` of row `y`.
    let surfaces = |y: usize, first: usize, n: usize| {
        let depth = &field(&now.depth, width, 1, y, 0)[first..][..n];
        let id = &field(&now.id, width, 1, y, 0)[first..][..n];
        (depth, id, three(|c| &field(&now.normal, width, 3, y, c)[first..][..n]))
    };
    rows::zip2((across, down), [width, width], |y, across, down| {
        dispatch!(level, _simd => {
            let own = field(&now.id, width, 1, y, 0);
            for phase in 0..PERIOD {
                let begin = phases.range(phase).start;
                for first in (0..phases.count(phase)).step_by(RUN) {
                    let n = RUN.min(phases.count(phase) - first);
                    let at = begin + first;
                    let (mut sum, mut count): (Run, Run) = ([0.0; RUN], [0.0; RUN]);
                    if hit.is_some() {
                        for ty in y.saturating_sub(1)..(y + 2).min(height) {
                            for dx in -1..=1 {
                                let Some(span) = phases.shifted(phase, first, n, dx) else { continue };
                                let q = ty * width + span.source..ty * width + span.source + span.len;
                                let planes = (&now.depth[q.clone()], &now.id[q.clone()], &near[q]);
                                let lanes = span.first..span.first + span.len;
                                let own = &own[at + span.first..][..span.len];
                                add_neighbours(planes, own, &mut sum[lanes.clone()], &mut count[lanes]);
                            }
                        }
                        for i in 0..RUN {
                            sum[i] /= count[i];
                        }
                    } else {
                        sum = [1.0; RUN];
                    }
                    let (depth, _, normal) = surfaces(y, at, n);
                    let roughness = &field(&now.roughness, width, 1, y, 0)[at..][..n];
                    let sides = [[(-1, 0), (1, 0)], [(0, -1), (0, 1)]];
                    for (neighbours, out) in sides.into_iter().zip([&mut *across, &mut *down]) {
                        let mut bend = [0.0; RUN];
                        for (dx, dy) in neighbours.into_iter().filter(|_| settings.curvature) {
                            let Some(ty) = y.checked_add_signed(dy).filter(|ty| *ty < height) else { continue };
                            let Some(span) = phases.shifted(phase, first, n, dx) else { continue };
                            let lanes = span.first..span.first + span.len;
                            let own_normal = normal.map(|c| &c[lanes.clone()]);
                            let own = (&own[at + span.first..][..span.len], own_normal);
                            bend_to(surfaces(ty, span.source, span.len), own, &mut bend[lanes]);
                        }
                        let planes = (depth, roughness, &sum[..n], &bend[..n]);
                        radii(settings, &kernel, view.focal_px, guides.has_roughness, planes, &mut out[at..][..n]);
                    }
                }
            }
        });
    });
}

pub(crate) fn run(filter: &Filter<'_>, input: &Colours, output: &mut Colours) {
    let phases = filter.guides.phases;
    let stride = output.stride(phases.size.width);
    let gains = Gains::glossy(&filter.settings.edge);
    let kind = (filter.guides.now.view.perspective, gains.reads_roughness());
    rows::each(output.elements_mut(), BAND * stride, |band, out| {
        let y = band * BAND;
        dispatch!(filter.level, _simd => match kind {
            (true, false) => rows_of::<true, false>(filter, &gains, input, y, out),
            (true, true) => rows_of::<true, true>(filter, &gains, input, y, out),
            (false, false) => rows_of::<false, false>(filter, &gains, input, y, out),
            (false, true) => rows_of::<false, true>(filter, &gains, input, y, out),
        });
    });
}

/// Rows that are filtered with one set of runs, which is zeroed only once.
const BAND: usize = 8;

#[inline(always)]
fn rows_of<const PERSPECTIVE: bool, const GLOSS: bool>(
    filter: &Filter<'_>,
    gains: &Gains,
    input: &Colours,
    first_row: usize,
    out: &mut [f32],
) {
    let mut scratch = Scratch {
        centres: Centres::new(),
        radius: [0.0; RUN],
        exponent: [0.0; RUN],
        falloff: [0.0; RUN],
        computed: [0.0; RUN],
        total: [1.0; RUN],
        ceilings: [[f32::INFINITY; RUN]; 2],
        sums: [[[0.0; RUN]; 3]; PLANES],
    };
    let stride = input.stride(filter.guides.phases.size.width);
    for (k, out) in out.chunks_mut(stride).enumerate() {
        row::<PERSPECTIVE, GLOSS>(filter, gains, input, first_row + k, &mut scratch, out);
    }
}

#[inline(always)]
fn row<const PERSPECTIVE: bool, const GLOSS: bool>(
    filter: &Filter<'_>,
    gains: &Gains,
    input: &Colours,
    y: usize,
    scratch: &mut Scratch,
    out: &mut [f32],
) {
    let (guides, settings) = (filter.guides, &filter.settings.glossy_bilateral);
    let phases = &guides.phases;
    let (width, height) = (phases.size.width, phases.size.height);
    let kernel = KernelSize::new(settings, height);
    let gentle = settings.sigma >= GENTLE_SIGMA;
    let view = &guides.now.view;
    let (own, colours) = (input.row(width, y), input.elements());
    let Scratch { centres, radius, exponent, falloff, computed, total, ceilings, sums } = scratch;
    for phase in 0..PERIOD {
        let begin = phases.range(phase).start;
        let count = phases.count(phase);
        let length = run_length(count);
        for first in (0..count).step_by(length) {
            let n = length.min(count - first);
            let p = guide_run(guides, y, y * width + begin + first, n);
            *radius = [0.0; RUN];
            radius[..n].copy_from_slice(&filter.radius[y * width + begin + first..][..n]);
            let widest = radius.iter().fold(0.0f32, |a, b| if a > *b { a } else { *b });
            let reach = (1..=kernel.reach).take_while(|k| (k * kernel.step_px) as f32 <= widest).count();
            let x = (PERIOD * first + phase) as f32;
            centres.fill(view, gains, &p, x + 0.5 + guides.now.jitter.x, y as f32 + 0.5 + guides.now.jitter.y);
            exponents(settings.sigma, &radius[..n], &mut exponent[..n]);
            let run = RunOf { y, phase, first, len: n };
            // Weights live only as long as their tap; the sums of a few planes as long as the run.
            let mut plane = 0;
            while plane < input.planes {
                let together = PLANES.min(input.planes - plane);
                for k in 0..together {
                    for c in 0..3 {
                        sums[k][c][..n].copy_from_slice(&channel(own, width, plane + k, c)[begin + first..][..n]);
                    }
                }
                *total = [1.0; RUN];
                if filter.settings.edge.monotone {
                    *ceilings = [[f32::INFINITY; RUN]; 2];
                }
                for tap in 1..=reach {
                    let offset = (tap * kernel.step_px) as i32;
                    if gentle {
                        gaussian::<true>(offset as f32, exponent, radius, &mut falloff[..n]);
                    } else {
                        gaussian::<false>(offset as f32, exponent, radius, &mut falloff[..n]);
                    }
                    for (side, ceiling) in [-1i32, 1].into_iter().zip(ceilings.iter_mut()) {
                        let offset = match filter.axis {
                            Axis::Horizontal => (side * offset, 0),
                            Axis::Vertical => (0, side * offset),
                        };
                        let mut pieces = Pieces::of(phases, run, offset, OffScreen::Skip);
                        while let Some(piece) = pieces.next() {
                            let q = guide_run(guides, piece.y, piece.at, piece.len);
                            let lanes = piece.first..piece.first + piece.len;
                            let of_tap = &mut computed[..piece.len];
                            let geometry = Tap::new(view, offset.0, offset.1);
                            weights::<PERSPECTIVE, GLOSS, false>(centres, piece.first, &q, &geometry, gains, of_tap);
                            piece.mask(of_tap);
                            let ceiling =
                                if filter.settings.edge.monotone { Some(&mut ceiling[lanes.clone()]) } else { None };
                            admit(&falloff[lanes.clone()], ceiling, of_tap, &mut total[lanes.clone()]);
                            for (k, sums) in sums.iter_mut().enumerate().take(together) {
                                let colour = three(|c| {
                                    let k_th = (plane + k) * 3 + c;
                                    let at = of_fields(piece.at, width, 3 * input.planes, piece.y, k_th);
                                    &colours[at..][..piece.len]
                                });
                                gather(of_tap, colour, lanes_of(sums, lanes.clone()));
                            }
                        }
                    }
                }
                invert(&mut total[..n]);
                for k in 0..together {
                    for c in 0..3 {
                        let centre = &channel(own, width, plane + k, c)[begin + first..][..n];
                        let out = &mut out[((plane + k) * 3 + c) * width..][..width][begin + first..][..n];
                        finish(&sums[k][c], total, radius, centre, out);
                    }
                }
                plane += together;
            }
        }
    }
}

/// What a run needs; vectors that straddle cache lines cost twice.
#[repr(align(64))]
struct Scratch {
    centres: Centres,
    radius: Run,
    exponent: Run,
    falloff: Run,
    computed: Run,
    total: Run,
    ceilings: [Run; 2],
    sums: [[Run; 3]; PLANES],
}

/// Planes whose sums are kept at once.
const PLANES: usize = 4;
