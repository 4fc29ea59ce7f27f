//! The schedule of stages 4 and 7: row by row, phase by phase, run by run; every tap of a run is a run of memory.

use crate::cpu::guides::{CpuGuides, field};
use crate::cpu::layout::{Colours, Phases, Span, channel};
use crate::cpu::rows;
use crate::kernels::edge_cpu::{Centres, Gains, GuideRun, RUN, Tap, run_length, weights};
use crate::kernels::math::three;
use crate::kernels::spiral::{PERIOD, Spiral, SpiralShape, land};
use crate::settings::OffScreen;
use crate::stages::matte_prefilter::cpu::{MOST_TAPS, Weights, admit, finish, gather};
use fearless_simd::{Level, dispatch};

/// What a pass needs besides its images.
#[derive(Clone, Copy)]
pub(crate) struct Filter<'a> {
    pub level: Level,
    pub guides: &'a CpuGuides,
    pub gains: Gains,
    pub spiral: &'a Spiral,
    pub shape: SpiralShape,
}

pub(crate) fn run(filter: &Filter<'_>, input: &Colours, output: &mut Colours) {
    let phases = filter.guides.phases;
    let width = phases.size.width;
    let stride = output.stride(width);
    debug_assert!(filter.shape.taps as usize <= MOST_TAPS);
    let kind = (filter.guides.now.view.perspective, filter.gains.reads_roughness());
    rows::each(output.elements_mut(), stride, |y, out| {
        dispatch!(filter.level, _simd => match kind {
            (true, false) => row::<true, false>(filter, &phases, input, y, out),
            (true, true) => row::<true, true>(filter, &phases, input, y, out),
            (false, false) => row::<false, false>(filter, &phases, input, y, out),
            (false, true) => row::<false, true>(filter, &phases, input, y, out),
        });
    });
}

/// Guides of `len` pixels of row `y` from element `first` on.
#[inline(always)]
pub(crate) fn guide_run(guides: &CpuGuides, y: usize, first: usize, len: usize) -> GuideRun<'_> {
    let width = guides.phases.size.width;
    let now = &guides.now;
    GuideRun {
        depth: &field(&now.depth, width, 1, y, 0)[first..][..len],
        normal: three(|c| &field(&now.normal, width, 3, y, c)[first..][..len]),
        roughness: &field(&now.roughness, width, 1, y, 0)[first..][..len],
        id: &field(&now.id, width, 1, y, 0)[first..][..len],
    }
}

/// The part of a tap that comes from one run of memory.
#[derive(Clone, Copy)]
pub(crate) struct Piece {
    /// First lane.
    pub first: usize,
    /// Lanes.
    pub len: usize,
    /// Source row.
    pub y: usize,
    /// Element of the source row.
    pub source: usize,
    /// From the pixel to the source, pixels.
    pub offset: (i32, i32),
}

/// The pieces of a tap: one run, and where taps are mirrored, single pixels beside it.
pub(crate) struct Pieces<'a> {
    phases: &'a Phases,
    run: RunOf,
    dx: i32,
    dy: i32,
    /// Source row; `None`: off the image.
    y: Option<usize>,
    span: Option<Span>,
    mirrored: bool,
    lane: usize,
}

/// A run of pixels of one phase of one row.
#[derive(Clone, Copy)]
pub(crate) struct RunOf {
    pub y: usize,
    pub phase: usize,
    /// First pixel of the phase.
    pub first: usize,
    pub len: usize,
}

impl<'a> Pieces<'a> {
    #[inline(always)]
    pub fn of(phases: &'a Phases, run: RunOf, (dx, dy): (i32, i32), off_screen: OffScreen) -> Self {
        let y = land(run.y as i32 + dy, phases.size.height, off_screen);
        let span = phases.shifted(run.phase, run.first, run.len, dx);
        let dy = y.map_or(dy, |y| y as i32 - run.y as i32);
        Self { phases, run, dx, dy, y, span, mirrored: off_screen == OffScreen::Mirror, lane: 0 }
    }

    #[inline(always)]
    pub fn next(&mut self) -> Option<Piece> {
        let y = self.y?;
        while self.lane < self.run.len {
            match self.span {
                Some(span) if !self.mirrored || self.lane == span.first => {
                    self.lane = if self.mirrored { span.first + span.len } else { self.run.len };
                    let Span { first, len, source } = span;
                    return Some(Piece { first, len, y, source, offset: (self.dx, self.dy) });
                }
                _ if !self.mirrored => return None,
                _ => {}
            }
            let first = self.lane;
            self.lane += 1;
            let x = (PERIOD * (self.run.first + first) + self.run.phase) as i32;
            if let Some(qx) = land(x + self.dx, self.phases.size.width, OffScreen::Mirror) {
                let source = self.phases.element(qx);
                return Some(Piece { first, len: 1, y, source, offset: (qx as i32 - x, self.dy) });
            }
        }
        None
    }
}

#[inline(always)]
fn row<const PERSPECTIVE: bool, const GLOSS: bool>(
    filter: &Filter<'_>,
    phases: &Phases,
    input: &Colours,
    y: usize,
    out: &mut [f32],
) {
    let guides = filter.guides;
    let width = phases.size.width;
    let view = &guides.now.view;
    let own = input.row(width, y);
    let mut centres = Centres::new();
    let mut computed = Weights::new();
    for phase in 0..PERIOD {
        let taps = filter.spiral.phase((y % PERIOD) * PERIOD + phase);
        let begin = phases.range(phase).start;
        let count = phases.count(phase);
        let length = run_length(count);
        for first in (0..count).step_by(length) {
            let n = length.min(count - first);
            let p = guide_run(guides, y, begin + first, n);
            let x = (PERIOD * first + phase) as f32;
            centres.fill(view, &filter.gains, &p, x + 0.5 + guides.now.jitter.x, y as f32 + 0.5 + guides.now.jitter.y);
            computed.total = [1.0; RUN];
            let run = RunOf { y, phase, first, len: n };
            for (k, tap) in taps.iter().enumerate() {
                let mut pieces = Pieces::of(phases, run, (tap.dx, tap.dy), filter.shape.off_screen);
                while let Some(piece) = pieces.next() {
                    let q = guide_run(guides, piece.y, piece.source, piece.len);
                    let lanes = piece.first..piece.first + piece.len;
                    let of_tap = &mut computed.taps[k][lanes.clone()];
                    let geometry = Tap::new(view, piece.offset.0, piece.offset.1);
                    weights::<PERSPECTIVE, GLOSS>(&centres, piece.first, &q, &geometry, &filter.gains, of_tap);
                    admit(tap.weight, of_tap, &mut computed.total[lanes]);
                }
            }
            for plane in 0..input.planes {
                let mut sums = [[0.0f32; RUN]; 3];
                for c in 0..3 {
                    sums[c][..n].copy_from_slice(&channel(own, width, plane, c)[begin + first..][..n]);
                }
                for (k, tap) in taps.iter().enumerate() {
                    let mut pieces = Pieces::of(phases, run, (tap.dx, tap.dy), filter.shape.off_screen);
                    while let Some(piece) = pieces.next() {
                        let source = input.row(width, piece.y);
                        let lanes = piece.first..piece.first + piece.len;
                        let of_tap = &computed.taps[k][lanes.clone()];
                        for c in 0..3 {
                            let colour = &channel(source, width, plane, c)[piece.source..][..piece.len];
                            gather(of_tap, colour, &mut sums[c][lanes.clone()]);
                        }
                    }
                }
                for c in 0..3 {
                    let centre = &channel(own, width, plane, c)[begin + first..][..n];
                    let out = &mut out[(plane * 3 + c) * width..][..width][begin + first..][..n];
                    finish(&sums[c], &computed.total, p.depth, centre, out);
                }
            }
        }
    }
}
