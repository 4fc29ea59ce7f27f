//! The schedule of the filter of young history: row by row, phase by phase, as stages 4 and 7; runs whose history is long
//! enough are copied.

use super::sparse_bilateral::{Pieces, RunOf, guide_run, lanes_of, of_fields};
use crate::kernels::edge_cpu::{
    Centres, Gains, RUN, Run, Tap, closeness_beyond, closeness_to_centres, contact_stops, run_length, weights,
};
use crate::kernels::math::three;
use crate::kernels::spiral::PERIOD;
use crate::phased::guides::CpuGuides;
use crate::phased::layout::{Colours, Phases, channel};
use crate::phased::rows;
use crate::settings::OffScreen;
use crate::simd::dispatch;
use crate::stages::matte_prefilter::cpu::{gather, invert};
use crate::stages::young_filter::Lobe;
use crate::stages::young_filter::cpu::{
    Others, Spread, alike, by_frames, contact_by_noise, contact_by_prior, divide, finish, lacking, luminances, refuse,
    refuse_within, shares, varied, vary,
};
use fearless_simd::Level;
use std::ops::Range;

/// What a level needs besides its images.
#[derive(Clone, Copy)]
pub(crate) struct Filter<'a> {
    pub level: Level,
    pub guides: &'a CpuGuides,
    pub gains: Gains,
    /// History length, in phase order.
    pub length: &'a [f32],
    /// Pixels between taps.
    pub step: usize,
    /// The history length from which on nothing is filtered.
    pub end: f32,
    /// Of the glossy signal, where roughness is known.
    pub lobe: Option<Lobe>,
    /// Most frames that count.
    pub frames: f32,
    /// Squared deviations of the luminance stop.
    pub squared: f32,
    /// Squared contrast of the first level's luminance stop; 0: none, and on other levels.
    pub first: f32,
    /// Squared contrast that bounds the noise of further levels; 0: none, and on the first one.
    pub further: f32,
    /// Most frames that neighbours count for a pixel that has none of its own surface; 0 on other levels than the first.
    pub isolated: f32,
    /// One over `contact_noise`; 0: the contact stop acts whatever the noise.
    pub contact_noise: f32,
    /// The variance of luminance, in phase order, as the level before left it; `None`: level 0, or `deviations` is 0.
    pub noise: Option<&'a [f32]>,
}

impl Filter<'_> {
    /// Whether this level acts on any of these pixels of a row and phase, as far as their history decides.
    #[inline(always)]
    fn has_young(&self, phases: &Phases, y: usize, phase: usize, pixels: Range<usize>) -> bool {
        let begin = y * phases.size.width + phases.range(phase).start;
        let length = &self.length[begin + pixels.start..begin + pixels.end];
        length.iter().fold(false, |any, n| any | (*n < self.end))
    }
}

/// Pixels that are filtered together, or not: a run of them that are all old enough is copied.
const BLOCK: usize = 16;

/// Taps of a level.
const TAPS: usize = 8;
const OFFSETS: [(i32, i32); TAPS] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

/// `left`: where the variance goes that the next level reads.
#[inline(never)] // benchmarks/instructions.py counts it
pub(crate) fn run(filter: &Filter<'_>, input: &Colours, output: &mut Colours, left: Option<&mut [f32]>) {
    let phases = filter.guides.phases;
    let width = phases.size.width;
    let stride = output.stride(width);
    let kind = (filter.guides.now.view.perspective, filter.gains.reads_roughness());
    let row = |y: usize, out: &mut [f32], left: Option<&mut [f32]>| {
        dispatch!(filter.level, _simd => match kind {
            (true, false) => a_row::<true, false>(filter, &phases, input, y, (out, left)),
            (true, true) => a_row::<true, true>(filter, &phases, input, y, (out, left)),
            (false, false) => a_row::<false, false>(filter, &phases, input, y, (out, left)),
            (false, true) => a_row::<false, true>(filter, &phases, input, y, (out, left)),
        });
    };
    match left {
        Some(left) => {
            rows::zip2((output.elements_mut(), left), [stride, width], |y, out, left| row(y, out, Some(left)));
        }
        None => rows::each(output.elements_mut(), stride, |y, out| row(y, out, None)),
    }
}

#[repr(align(64))]
struct Scratch {
    centres: Centres,
    taps: [Run; TAPS],
    total: Run,
    share: Run,
    frames: Run,
    /// The centres' weights in their means: their frames, and what the first luminance stop refuses.
    own: Run,
    /// What that stop leaves of a tap.
    like: Run,
    sums: [Run; 3],
    /// Luminance of the centres, and of a tap.
    light: Run,
    light_there: Run,
    spread: Spread,
    /// Sums of the edge weights of the taps, then what they lack to 1, for pixels whose neighbours of other surfaces count.
    lack: Run,
    contacts: Contacts,
    /// The contact stop of a tap.
    contact: Run,
    /// Variance of the centres, and the sum that becomes the variance of their means.
    noise: Run,
    varied: Run,
}

#[inline(always)]
fn a_row<const PERSPECTIVE: bool, const GLOSS: bool>(
    filter: &Filter<'_>,
    phases: &Phases,
    input: &Colours,
    y: usize,
    (out, mut left): (&mut [f32], Option<&mut [f32]>),
) {
    let zero = [0.0; RUN];
    let mut scratch = Scratch {
        centres: Centres::new(),
        taps: [zero; TAPS],
        total: zero,
        share: zero,
        frames: zero,
        own: zero,
        like: [1.0; RUN],
        sums: [zero; 3],
        light: zero,
        light_there: zero,
        spread: Spread::new(),
        lack: zero,
        contacts: Contacts::new(),
        contact: [1.0; RUN],
        noise: zero,
        varied: zero,
    };
    let length = run_length(phases.longest());
    for phase in 0..PERIOD {
        for first in (0..phases.count(phase)).step_by(length) {
            let end = first + length.min(phases.count(phase) - first);
            // Runs of blocks that all have a young pixel, or none.
            let mut first = first;
            while first < end {
                let is_young = |block: usize| filter.has_young(phases, y, phase, block..end.min(block + BLOCK));
                let young = is_young(first);
                let mut next = first + BLOCK;
                while next < end && is_young(next) == young {
                    next += BLOCK;
                }
                let run = RunOf { y, phase, first, len: next.min(end) - first };
                filter_run::<PERSPECTIVE, GLOSS>(filter, phases, input, run, &mut scratch, (out, left.as_deref_mut()));
                first = next;
            }
        }
    }
}

/// To the left, to the right, up and down: the other way is the neighbour in this list.
const AXES: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];

/// The contact stop of a run, along the axes.
#[repr(align(64))]
struct Contacts {
    /// Depths of the neighbours; infinite: there is none.
    depth: [Run; 4],
    /// How close each is to the centres.
    close: [Run; 4],
    /// How close what lies beyond one is to it.
    beyond: Run,
    /// Weights, 0..1.
    stop: [Run; 4],
}

impl Contacts {
    fn new() -> Self {
        let zero = [[0.0; RUN]; 4];
        Self { depth: zero, close: zero, beyond: [0.0; RUN], stop: zero }
    }

    #[inline(always)]
    fn find<const PERSPECTIVE: bool>(&mut self, filter: &Filter<'_>, phases: &Phases, run: RunOf, centres: &Centres) {
        let (guides, view, step) = (filter.guides, &filter.guides.now.view, filter.step as i32);
        for (axis, (dx, dy)) in AXES.into_iter().enumerate() {
            let (depth, close) = (&mut self.depth[axis], &mut self.close[axis]);
            (*depth, *close) = ([f32::INFINITY; RUN], [0.0; RUN]);
            let geometry = Tap::new(view, dx * step, dy * step);
            let mut pieces = Pieces::of(phases, run, (dx * step, dy * step), OffScreen::Skip);
            while let Some(piece) = pieces.next() {
                let lanes = piece.first..piece.first + piece.len;
                let there = guide_run(guides, piece.y, piece.at, piece.len).depth;
                closeness_to_centres::<PERSPECTIVE>(centres, piece.first, there, &geometry, &mut close[lanes.clone()]);
                piece.mask(&mut close[lanes.clone()]);
                depth[lanes].copy_from_slice(there);
            }
        }
        for (axis, (dx, dy)) in AXES.into_iter().enumerate() {
            self.beyond = [0.0; RUN];
            let geometry = Tap::new(view, dx * step, dy * step);
            let mut pieces = Pieces::of(phases, run, (2 * dx * step, 2 * dy * step), OffScreen::Skip);
            while let Some(piece) = pieces.next() {
                let lanes = piece.first..piece.first + piece.len;
                let there = guide_run(guides, piece.y, piece.at, piece.len).depth;
                let depths = (&self.depth[axis][lanes.clone()], there);
                let beyond = &mut self.beyond[lanes];
                closeness_beyond::<PERSPECTIVE>(centres, piece.first, depths, &geometry, beyond);
                piece.mask(beyond);
            }
            let near = (&self.close[axis ^ 1][..], &self.beyond[..], &filter.gains);
            let out = &mut self.stop[axis][..run.len];
            contact_stops::<PERSPECTIVE>(centres, &self.depth[axis], &geometry, near, out);
        }
    }

    /// Times what the stops along both axes leave of a tap.
    #[inline(always)]
    fn stop(&self, (dx, dy): (i32, i32), lanes: Range<usize>, weights: &mut [f32]) {
        for (axis, of_axis) in AXES.into_iter().enumerate() {
            if (dx != 0 && of_axis == (dx, 0)) || (dy != 0 && of_axis == (0, dy)) {
                weights.iter_mut().zip(&self.stop[axis][lanes.clone()]).for_each(|(w, stop)| *w *= stop);
            }
        }
    }
}

#[inline(always)]
fn filter_run<const PERSPECTIVE: bool, const GLOSS: bool>(
    filter: &Filter<'_>,
    phases: &Phases,
    input: &Colours,
    run: RunOf,
    scratch: &mut Scratch,
    (out, left): (&mut [f32], Option<&mut [f32]>),
) {
    let Scratch { centres, taps, total, share, frames, own: own_weight, like, sums, .. } = scratch;
    let (light, light_there, spread) = (&mut scratch.light, &mut scratch.light_there, &mut scratch.spread);
    let (noise, varied_sums) = (&mut scratch.noise, &mut scratch.varied);
    let (contacts, contact) = (&mut scratch.contacts, &mut scratch.contact);
    let lack = &mut scratch.lack;
    let guides = filter.guides;
    let width = phases.size.width;
    let view = &guides.now.view;
    let RunOf { y, phase, first, len: n } = run;
    let (own, colours) = (input.row(width, y), input.elements());
    let begin = phases.range(phase).start + first;
    let p = guide_run(guides, y, y * width + begin, n);
    let constants = (filter.end, filter.lobe, filter.frames);
    let mature = !shares(&filter.length[y * width + begin..][..n], p.roughness, constants, share, frames);
    // Level 0 finds the noise, also where it filters nothing.
    let finds = left.is_some() && filter.noise.is_none();
    let known = filter.noise.map(|noise| &noise[y * width + begin..][..n]);
    if mature && !finds {
        for c in 0..3 * input.planes {
            out[c * width + begin..][..n].copy_from_slice(&own[c * width + begin..][..n]);
        }
        if let Some((left, known)) = left.zip(known) {
            left[begin..][..n].copy_from_slice(known);
        }
        return;
    }
    if finds {
        spread.begin(&frames[..n]);
    }
    let stops_at_contact = filter.gains.stops_at_contacts();
    let noise_decides = stops_at_contact && filter.contact_noise > 0.0;
    let reads_light = finds || known.is_some() || filter.first > 0.0 || noise_decides;
    if reads_light {
        luminances(three(|c| &channel(own, width, 0, c)[begin..][..n]), &mut light[..n]);
    }
    if let Some(known) = known {
        // A tap's pieces are whole vectors: they reach beyond the run.
        noise[..n].copy_from_slice(known);
        varied_sums[..n].iter_mut().zip(known).zip(&frames[..n]).for_each(|((sum, v), n)| *sum = n * n * v);
    }
    let x = (PERIOD * first + phase) as f32;
    centres.fill(view, &filter.gains, &p, x + 0.5 + guides.now.jitter.x, y as f32 + 0.5 + guides.now.jitter.y);
    let helps = filter.isolated > 0.0;
    if helps {
        lack[..n].fill(0.0);
    }
    total[..n].copy_from_slice(&frames[..n]);
    own_weight[..n].copy_from_slice(&frames[..n]);
    let pieces = |(dx, dy): (i32, i32)| {
        let step = filter.step as i32;
        Pieces::of(phases, run, (dx * step, dy * step), OffScreen::Skip)
    };
    if stops_at_contact {
        contacts.find::<PERSPECTIVE>(filter, phases, run, centres);
    }
    for (of_tap, offset) in taps.iter_mut().zip(OFFSETS) {
        let mut pieces = pieces(offset);
        while let Some(piece) = pieces.next() {
            let q = guide_run(guides, piece.y, piece.at, piece.len);
            let lanes = piece.first..piece.first + piece.len;
            let of_tap = &mut of_tap[lanes.clone()];
            let geometry = Tap::new(view, piece.offset.0, piece.offset.1);
            weights::<PERSPECTIVE, GLOSS, false>(centres, piece.first, &q, &geometry, &filter.gains, of_tap);
            piece.mask(of_tap);
            let length = &filter.length[piece.at..][..piece.len];
            if reads_light {
                let there =
                    three(|c| &colours[of_fields(piece.at, width, 3 * input.planes, piece.y, c)..][..piece.len]);
                luminances(there, &mut light_there[..piece.len]);
            }
            let lights = (&light_there[..piece.len], &light[lanes.clone()]);
            let there = filter.noise.map(|noise| &noise[piece.at..][..piece.len]);
            if noise_decides {
                let contact = &mut contact[..piece.len];
                contact.fill(1.0);
                contacts.stop(offset, lanes.clone(), contact);
                match there {
                    Some(there) => {
                        contact_by_noise(of_tap, contact, lights, (there, &noise[lanes.clone()]), filter.contact_noise);
                    }
                    None => {
                        let frames = (length, &frames[lanes.clone()]);
                        contact_by_prior(of_tap, contact, lights, frames, (filter.frames, filter.contact_noise));
                    }
                }
            } else if stops_at_contact {
                contacts.stop(offset, lanes.clone(), of_tap);
            }
            if helps {
                lack[lanes.clone()].iter_mut().zip(&*of_tap).for_each(|(sum, w)| *sum += *w);
            }
            if finds {
                spread.add(piece.first, of_tap, length, filter.frames, lights);
            }
            if filter.first > 0.0 {
                let like = &mut like[..piece.len];
                alike(like, lights, (length, &frames[lanes.clone()]), filter.frames, filter.first);
            }
            if finds {
                spread.square(piece.first, (of_tap, like), length, filter.frames);
            }
            if let Some(there) = there {
                let noise = (there, &noise[lanes.clone()]);
                if filter.further > 0.0 {
                    let constants = (filter.frames, filter.squared, filter.further);
                    refuse_within(of_tap, lights, noise, (length, &frames[lanes.clone()]), constants);
                } else {
                    refuse(of_tap, lights, noise, filter.squared);
                }
            }
            by_frames(of_tap, &share[lanes.clone()], length, filter.frames);
            if let Some(there) = there {
                vary(of_tap, there, &mut varied_sums[lanes.clone()]);
            }
            total[lanes.clone()].iter_mut().zip(&*of_tap).for_each(|(total, w)| *total += *w);
            if filter.first > 0.0 {
                divide(of_tap, like, &mut own_weight[lanes]);
            }
        }
    }
    if helps && lacking(&mut lack[..n], (&frames[..n], &share[..n]), p.depth, filter.isolated) {
        for (of_tap, offset) in taps.iter_mut().zip(OFFSETS) {
            let mut pieces = pieces(offset);
            while let Some(piece) = pieces.next() {
                let lanes = piece.first..piece.first + piece.len;
                let there = &mut light_there[..piece.len];
                there.fill(1.0);
                piece.mask(there);
                let others = Others {
                    lack: &lack[lanes.clone()],
                    share: &share[lanes.clone()],
                    frames: &frames[lanes.clone()],
                    length: &filter.length[piece.at..][..piece.len],
                    depth: guide_run(guides, piece.y, piece.at, piece.len).depth,
                    there,
                };
                others.add(
                    (filter.isolated, filter.frames),
                    &mut of_tap[lanes.clone()],
                    &mut total[lanes],
                    spread.squares(piece.first),
                );
            }
        }
    }
    invert(&mut total[..n]);
    if let Some(left) = left {
        let left = &mut left[begin..][..n];
        match known {
            Some(known) => varied(varied_sums, total, p.depth, known, left),
            None => spread.finish((total, share, frames), own_weight, p.depth, light, left),
        }
    }
    for plane in 0..input.planes {
        for c in 0..3 {
            let centre = &channel(own, width, plane, c)[begin..][..n];
            sums[c][..n].iter_mut().zip(centre).zip(&own_weight[..n]).for_each(|((sum, v), n)| *sum = v * n);
        }
        for (of_tap, offset) in taps.iter().zip(OFFSETS) {
            let mut pieces = pieces(offset);
            while let Some(piece) = pieces.next() {
                let lanes = piece.first..piece.first + piece.len;
                let colour = three(|c| {
                    &colours[of_fields(piece.at, width, 3 * input.planes, piece.y, plane * 3 + c)..][..piece.len]
                });
                gather(&of_tap[lanes.clone()], colour, lanes_of(sums, lanes));
            }
        }
        for c in 0..3 {
            let centre = &channel(own, width, plane, c)[begin..][..n];
            let out = &mut out[(plane * 3 + c) * width + begin..][..n];
            finish(&sums[c], total, share, p.depth, centre, out);
        }
    }
}
