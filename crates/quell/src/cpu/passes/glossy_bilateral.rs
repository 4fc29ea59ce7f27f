//! The schedule of stages 9 and 10: as that of stages 4 and 7, with taps along one axis.

use super::sparse_bilateral::{Pieces, RunOf, guide_run};
use crate::cpu::guides::CpuGuides;
use crate::cpu::layout::{Colours, Phases, channel};
use crate::cpu::rows;
use crate::kernels::edge_cpu::{Centres, Gains, RUN, Run, Tap, weights};
use crate::kernels::spiral::PERIOD;
use crate::settings::{OffScreen, Settings};
use crate::stages::glossy_bilateral::KernelSize;
use crate::stages::glossy_bilateral::cpu::{admit, exponents, finish, gaussian, radii};
use crate::stages::glossy_bilateral::reference::Axis;
use crate::stages::matte_prefilter::cpu::gather;
use fearless_simd::{Level, dispatch};

/// What a pass needs besides its images.
#[derive(Clone, Copy)]
pub(crate) struct Filter<'a> {
    pub level: Level,
    pub guides: &'a CpuGuides,
    pub settings: &'a Settings,
    pub axis: Axis,
}

pub(crate) fn run(filter: &Filter<'_>, input: &Colours, output: &mut Colours) {
    let phases = filter.guides.phases;
    let stride = output.stride(phases.size.width);
    let gains = Gains::glossy(&filter.settings.edge);
    let kind = (filter.guides.now.view.perspective, gains.reads_roughness());
    rows::each(output.elements_mut(), stride, |y, out| {
        dispatch!(filter.level, _simd => match kind {
            (true, false) => row::<true, false>(filter, &gains, &phases, input, y, out),
            (true, true) => row::<true, true>(filter, &gains, &phases, input, y, out),
            (false, false) => row::<false, false>(filter, &gains, &phases, input, y, out),
            (false, true) => row::<false, true>(filter, &gains, &phases, input, y, out),
        });
    });
}

#[inline(always)]
fn row<const PERSPECTIVE: bool, const GLOSS: bool>(
    filter: &Filter<'_>,
    gains: &Gains,
    phases: &Phases,
    input: &Colours,
    y: usize,
    out: &mut [f32],
) {
    let (guides, settings) = (filter.guides, &filter.settings.glossy_bilateral);
    let (width, height) = (phases.size.width, phases.size.height);
    let kernel = KernelSize::new(settings, height);
    let view = &guides.now.view;
    let own = input.row(width, y);
    let mut centres = Centres::new();
    for phase in 0..PERIOD {
        let begin = phases.range(phase).start;
        let count = phases.count(phase);
        for first in (0..count).step_by(RUN) {
            let n = RUN.min(count - first);
            let p = guide_run(guides, y, begin + first, n);
            let hit = if guides.has_glossy_hit() { &guides.glossy_hit[y * width..][begin + first..][..n] } else { &[] };
            let mut radius: Run = [0.0; RUN];
            let camera = (view.focal_px, view.perspective);
            let planes = (p.depth, p.roughness, hit);
            radii(settings, &kernel, camera, guides.has_roughness, planes, &mut radius[..n]);
            let widest = radius.iter().fold(0.0f32, |a, b| if a > *b { a } else { *b });
            let reach = (1..=kernel.reach).take_while(|k| (k * kernel.step_px) as f32 <= widest).count();
            let x = (PERIOD * first + phase) as f32;
            centres.fill(view, &p, x + 0.5 + guides.now.jitter.x, y as f32 + 0.5 + guides.now.jitter.y);
            let exponent = exponents(settings.sigma, &radius);
            let run = RunOf { y, phase, first, len: n };
            // Weights live only as long as their tap; the sums of a few planes as long as the run.
            let mut plane = 0;
            while plane < input.planes {
                let together = PLANES.min(input.planes - plane);
                let mut sums = [[[0.0f32; RUN]; 3]; PLANES];
                for k in 0..together {
                    for c in 0..3 {
                        sums[k][c][..n].copy_from_slice(&channel(own, width, plane + k, c)[begin + first..][..n]);
                    }
                }
                let mut total: Run = [1.0; RUN];
                let mut ceilings = [[f32::INFINITY; RUN]; 2];
                for tap in 1..=reach {
                    let offset = (tap * kernel.step_px) as i32;
                    let falloff = gaussian(offset as f32, &exponent, &radius);
                    for (side, ceiling) in [-1i32, 1].into_iter().zip(&mut ceilings) {
                        let offset = match filter.axis {
                            Axis::Horizontal => (side * offset, 0),
                            Axis::Vertical => (0, side * offset),
                        };
                        let mut pieces = Pieces::of(phases, run, offset, OffScreen::Skip);
                        while let Some(piece) = pieces.next() {
                            let q = guide_run(guides, piece.y, piece.source, piece.len);
                            let lanes = piece.first..piece.first + piece.len;
                            let mut of_tap: Run = [0.0; RUN];
                            let of_tap = &mut of_tap[..piece.len];
                            let geometry = Tap::new(view, offset.0, offset.1);
                            weights::<PERSPECTIVE, GLOSS>(&centres, piece.first, &q, &geometry, gains, of_tap);
                            let ceiling =
                                if filter.settings.edge.monotone { Some(&mut ceiling[lanes.clone()]) } else { None };
                            admit(&falloff[lanes.clone()], ceiling, of_tap, &mut total[lanes.clone()]);
                            let source = input.row(width, piece.y);
                            for k in 0..together {
                                for c in 0..3 {
                                    let colour = &channel(source, width, plane + k, c)[piece.source..][..piece.len];
                                    gather(of_tap, colour, &mut sums[k][c][lanes.clone()]);
                                }
                            }
                        }
                    }
                }
                for k in 0..together {
                    for c in 0..3 {
                        let centre = &channel(own, width, plane + k, c)[begin + first..][..n];
                        let out = &mut out[((plane + k) * 3 + c) * width..][..width][begin + first..][..n];
                        finish(&sums[k][c], &total, &radius, centre, out);
                    }
                }
                plane += together;
            }
        }
    }
}

/// Planes whose sums are kept at once.
const PLANES: usize = 4;
