//! The schedule of stages 4 and 7: tile by tile, row by row, phase by phase; every tap of a run is a run of memory.

use crate::kernels::edge::CONTACT_STEPS;
use crate::kernels::edge_cpu::{Centres, Gains, GuideRun, RUN, Run, Tap, closeness_to_centres, run_length, weights};
use crate::kernels::math::three;
use crate::kernels::spiral::{PERIOD, Spiral, SpiralShape, land};
use crate::phased::guides::CpuGuides;
use crate::phased::layout::{Colours, Phases, Span, channel};
use crate::phased::rows;
use crate::settings::OffScreen;
use crate::simd::dispatch;
use crate::stages::matte_prefilter::cpu::{MOST_TAPS, Weights, admit, finish, gather, invert};
use fearless_simd::Level;
use std::ops::Range;

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
    let gains = &filter.gains;
    let kind = (filter.guides.now.view.perspective, gains.reads_roughness(), gains.stops_at_contacts());
    rows::each(output.elements_mut(), BAND * stride, |band, out| {
        let y = band * BAND;
        dispatch!(filter.level, _simd => match kind {
            (true, false, false) => rows_of::<true, false, false>(filter, &phases, input, y, out),
            (true, false, true) => rows_of::<true, false, true>(filter, &phases, input, y, out),
            (true, true, false) => rows_of::<true, true, false>(filter, &phases, input, y, out),
            (true, true, true) => rows_of::<true, true, true>(filter, &phases, input, y, out),
            (false, false, false) => rows_of::<false, false, false>(filter, &phases, input, y, out),
            (false, false, true) => rows_of::<false, false, true>(filter, &phases, input, y, out),
            (false, true, false) => rows_of::<false, true, false>(filter, &phases, input, y, out),
            (false, true, true) => rows_of::<false, true, true>(filter, &phases, input, y, out),
        });
    });
}

/// Rows that are filtered together, tile by tile: what the taps of one tile reach stays in the second-level cache.
const BAND: usize = 32;

/// Guides of `len` pixels of row `y` from element `at` of an image of one scalar a pixel on.
#[inline(always)]
pub(crate) fn guide_run(guides: &CpuGuides, y: usize, at: usize, len: usize) -> GuideRun<'_> {
    let width = guides.phases.size.width;
    let now = &guides.now;
    GuideRun {
        depth: &now.depth[at..][..len],
        normal: three(|c| &now.normal[of_fields(at, width, 3, y, c)..][..len]),
        roughness: &now.roughness[at..][..len],
        id: &now.id[at..][..len],
    }
}

/// Where element `at` of an image of one scalar a pixel lies, row `y`, in one of `fields`: field `k`.
#[inline(always)]
pub(crate) fn of_fields(at: usize, width: usize, fields: usize, y: usize, k: usize) -> usize {
    at + (y * (fields - 1) + k) * width
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
    /// Element of an image of one scalar a pixel.
    pub at: usize,
    /// Lanes of these that have a source: the others must get no weight.
    pub real: (usize, usize),
    /// From the pixel to the source, pixels.
    pub offset: (i32, i32),
}

/// The same lanes of three runs.
#[inline(always)]
pub(crate) fn lanes_of([a, b, c]: &mut [Run; 3], lanes: Range<usize>) -> [&mut [f32]; 3] {
    [&mut a[lanes.clone()], &mut b[lanes.clone()], &mut c[lanes]]
}

impl Piece {
    /// Takes the weight of lanes that have no source.
    #[inline(always)]
    pub fn mask(&self, weights: &mut [f32]) {
        if self.real != (0, self.len) {
            weights[..self.real.0].fill(0.0);
            weights[self.real.1..].fill(0.0);
        }
    }
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
                    return Some(self.piece(span, y));
                }
                _ if !self.mirrored => return None,
                _ => {}
            }
            let first = self.lane;
            self.lane += 1;
            let x = (PERIOD * (self.run.first + first) + self.run.phase) as i32;
            if let Some(qx) = land(x + self.dx, self.phases.size.width, OffScreen::Mirror) {
                let at = self.phases.index(qx, y);
                return Some(Piece { first, len: 1, y, at, real: (0, 1), offset: (qx as i32 - x, self.dy) });
            }
        }
        None
    }

    /// The run, made up to whole vectors where memory allows: what lies beside it is read along and gets no weight.
    /// The remainders of loops would cost more.
    #[inline(always)]
    fn piece(&self, span: Span, y: usize) -> Piece {
        const VECTOR: usize = 16;
        let Span { first, len, source } = span;
        let at = y * self.phases.size.width + source;
        let offset = (self.dx, self.dy);
        let before = first % VECTOR;
        let wide = (before + len).next_multiple_of(VECTOR);
        if self.mirrored || at < before || at - before + wide > self.phases.size.pixels() {
            return Piece { first, len, y, at, real: (0, len), offset };
        }
        Piece { first: first - before, len: wide, y, at: at - before, real: (before, before + len), offset }
    }
}

#[inline(always)]
fn rows_of<const PERSPECTIVE: bool, const GLOSS: bool, const CONTACT: bool>(
    filter: &Filter<'_>,
    phases: &Phases,
    input: &Colours,
    first_row: usize,
    out: &mut [f32],
) {
    let mut scratch =
        Scratch { centres: Centres::new(), computed: Weights::new(), sums: [[0.0; RUN]; 3], close: [0.0; RUN] };
    let stride = input.stride(phases.size.width);
    let length = run_length(phases.longest());
    for first in (0..phases.longest()).step_by(length) {
        for (k, out) in out.chunks_mut(stride).enumerate() {
            for phase in 0..PERIOD {
                if first < phases.count(phase) {
                    let len = length.min(phases.count(phase) - first);
                    let run = RunOf { y: first_row + k, phase, first, len };
                    filter_run::<PERSPECTIVE, GLOSS, CONTACT>(filter, phases, input, run, &mut scratch, out);
                }
            }
        }
    }
}

/// K of the contact stop of a run.
#[inline(always)]
fn find_nearest<const PERSPECTIVE: bool>(
    filter: &Filter<'_>,
    phases: &Phases,
    run: RunOf,
    centres: &mut Centres,
    close: &mut Run,
) {
    let (guides, view) = (filter.guides, &filter.guides.now.view);
    centres.nearest = [0.0; RUN];
    for (dx, dy) in CONTACT_STEPS.into_iter().flat_map(|s| [(-s, 0), (s, 0), (0, -s), (0, s)]) {
        let geometry = Tap::new(view, dx, dy);
        let mut pieces = Pieces::of(phases, run, (dx, dy), OffScreen::Skip);
        while let Some(piece) = pieces.next() {
            let depth = guide_run(guides, piece.y, piece.at, piece.len).depth;
            let close = &mut close[..piece.len];
            closeness_to_centres::<PERSPECTIVE>(centres, piece.first, depth, &geometry, close);
            piece.mask(close);
            let nearest = &mut centres.nearest[piece.first..][..piece.len];
            nearest.iter_mut().zip(&*close).for_each(|(k, h)| *k = if *h > *k { *h } else { *k });
        }
    }
}

#[repr(align(64))]
struct Scratch {
    centres: Centres,
    computed: Weights,
    sums: [Run; 3],
    /// How close what lies in one direction is.
    close: Run,
}

#[inline(always)]
fn filter_run<const PERSPECTIVE: bool, const GLOSS: bool, const CONTACT: bool>(
    filter: &Filter<'_>,
    phases: &Phases,
    input: &Colours,
    run: RunOf,
    scratch: &mut Scratch,
    out: &mut [f32],
) {
    let Scratch { centres, computed, sums, close } = scratch;
    let guides = filter.guides;
    let width = phases.size.width;
    let view = &guides.now.view;
    let RunOf { y, phase, first, len: n } = run;
    let (own, colours) = (input.row(width, y), input.elements());
    let taps = filter.spiral.phase((y % PERIOD) * PERIOD + phase);
    let begin = phases.range(phase).start + first;
    let p = guide_run(guides, y, y * width + begin, n);
    let x = (PERIOD * first + phase) as f32;
    centres.fill(view, &filter.gains, &p, x + 0.5 + guides.now.jitter.x, y as f32 + 0.5 + guides.now.jitter.y);
    if CONTACT {
        find_nearest::<PERSPECTIVE>(filter, phases, run, centres, close);
    }
    computed.total = [1.0; RUN];
    let start = |plane: usize, sums: &mut [Run; 3]| {
        for c in 0..3 {
            sums[c][..n].copy_from_slice(&channel(own, width, plane, c)[begin..][..n]);
        }
    };
    let colour = |piece: &Piece, plane: usize| {
        three(|c| &colours[of_fields(piece.at, width, 3 * input.planes, piece.y, plane * 3 + c)..][..piece.len])
    };
    start(0, sums);
    for (k, tap) in taps.iter().enumerate() {
        let mut pieces = Pieces::of(phases, run, (tap.dx, tap.dy), filter.shape.off_screen);
        while let Some(piece) = pieces.next() {
            let q = guide_run(guides, piece.y, piece.at, piece.len);
            let lanes = piece.first..piece.first + piece.len;
            let of_tap = &mut computed.taps[k][lanes.clone()];
            let geometry = Tap::new(view, piece.offset.0, piece.offset.1);
            weights::<PERSPECTIVE, GLOSS, CONTACT>(centres, piece.first, &q, &geometry, &filter.gains, of_tap);
            piece.mask(of_tap);
            let total = &mut computed.total[lanes.clone()];
            admit(tap.weight, of_tap, total, colour(&piece, 0), lanes_of(sums, lanes));
        }
    }
    invert(&mut computed.total[..n]);
    for plane in 0..input.planes {
        if plane > 0 {
            start(plane, sums);
            for (k, tap) in taps.iter().enumerate() {
                let mut pieces = Pieces::of(phases, run, (tap.dx, tap.dy), filter.shape.off_screen);
                while let Some(piece) = pieces.next() {
                    let lanes = piece.first..piece.first + piece.len;
                    gather(&computed.taps[k][lanes.clone()], colour(&piece, plane), lanes_of(sums, lanes));
                }
            }
        }
        for c in 0..3 {
            let centre = &channel(own, width, plane, c)[begin..][..n];
            let out = &mut out[(plane * 3 + c) * width + begin..][..n];
            finish(&sums[c], &computed.total, p.depth, centre, out);
        }
    }
}
