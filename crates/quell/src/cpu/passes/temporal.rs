//! The schedule of stages 3 and 8: band by band, block by block, row by row, phase by phase; what a run needs of the
//! previous image is collected, then computed on together.
//!
//! Both stages ask where the surface was. Stage 8 reads what stage 3 found.

use crate::frame::Signal;
use crate::kernels::change::{kept_light, rounded_light};
use crate::kernels::clip_cpu::{Columns, Moments};
use crate::kernels::math::three;
use crate::kernels::reproject_cpu::{Expected, Footprint, LANES, Lanes, Lanes3, Lookup};
use crate::kernels::spiral::PERIOD;
use crate::kernels::temporal::Blend;
use crate::phased::guides::{CpuGuides, field};
use crate::phased::layout::{Colours, Phases, channel, copy, interleave};
use crate::phased::rows;
use crate::plane::Plane;
use crate::settings::{Clip, Settings};
use crate::simd::dispatch;
use crate::stages::glossy_temporal::cpu::{reflect, visible};
use crate::stages::matte_temporal::cpu::{
    Shares, Splines, blend_beauty, blend_fast, blend_lanes, blend_unclamped, clamp, fetch, fetch_scalar, fetch_spline,
    keep_light, load, shorten,
};
use fearless_simd::Level;

/// What a pass needs besides its images.
#[derive(Clone, Copy)]
pub(crate) struct Filter<'a> {
    pub level: Level,
    pub guides: &'a CpuGuides,
    pub settings: &'a Settings,
    pub signal: Signal,
    /// Where stage 3 found the surfaces of this frame ([`visible`]), phase order.
    pub seen: Option<&'a [f32]>,
}

/// What a temporal stage remembers of the frame before.
#[derive(Clone, Copy)]
pub(crate) struct Remembered<'a> {
    pub colours: &'a Colours,
    /// History length, phase order.
    pub length: &'a [f32],
    /// Where light has changed, and the fast history, phase order.
    pub change: Option<(&'a [f32], &'a [f32])>,
}

/// What it writes besides colours.
pub(crate) struct Memory<'a> {
    pub confidence: &'a mut Plane<f32>,
    /// For the caller.
    pub length: &'a mut Plane<f32>,
    /// The same in phase order, for the next frame.
    pub kept: &'a mut [f32],
    /// What stage 8 will want to know of the surfaces, where it will.
    pub seen: Option<&'a mut [f32]>,
    /// The fast history for the next frame, phase order.
    pub fast: Option<&'a mut [f32]>,
}

/// Rows whose windows overlap are done together where boxes need no more of them.
const BAND: usize = 8;

/// Whether stage 8 asks for more than where the surface was.
pub(crate) fn mirrors(settings: &Settings, guides: &CpuGuides) -> bool {
    settings.glossy_temporal.virtual_reprojection && guides.has_glossy_hit()
}

/// Without history: confidence, length and fast history; the colours are the current ones.
pub(crate) fn begin(guides: &CpuGuides, current: &Colours, memory: Memory<'_>) {
    let phases = guides.phases;
    let width = phases.size.width;
    if let Some(fast) = memory.fast {
        rows::each(fast, width, |y, fast| {
            let row = current.row(width, y);
            let [r, g, b] = three(|c| channel(row, width, 0, c));
            for (x, fast) in fast.iter_mut().enumerate() {
                *fast = rounded_light(kept_light([r[x], g[x], b[x]]));
            }
        });
    }
    memory.length.data_mut().fill(1.0);
    memory.kept.fill(1.0);
    rows::each(memory.confidence.data_mut(), width, |y, row| {
        let depth = field(&guides.now.depth, width, 1, y, 0);
        for (x, confidence) in row.iter_mut().enumerate() {
            *confidence = if depth[phases.element(x)] < f32::INFINITY { 0.0 } else { 1.0 };
        }
    });
}

#[inline(never)] // benchmarks/instructions.py counts it
pub(crate) fn run(
    filter: &Filter<'_>,
    current: &Colours,
    history: Remembered<'_>,
    output: &mut Colours,
    memory: Memory<'_>,
) {
    let phases = filter.guides.phases;
    let width = phases.size.width;
    let weights = match filter.signal {
        Signal::Matte => Blend::matte(filter.settings),
        Signal::Glossy => Blend::glossy(filter.settings),
    };
    let height = match weights.clip {
        Clip::Sigma => Moments::band(weights.clip_radius as usize),
        Clip::Off | Clip::Box => BAND,
    };
    let strides = [output.stride(width), width, width, width].map(|row| height * row);
    let targets = [output.elements_mut(), memory.confidence.data_mut(), memory.length.data_mut(), memory.kept];
    rows::bands(
        targets,
        strides,
        [memory.seen, memory.fast],
        |k, [colours, confidence, length, kept], [seen, fast]| {
            let mut out = Out { colours, confidence, length, kept, seen, fast };
            dispatch!(filter.level, _simd => band(filter, &phases, &weights, current, history, k * height, &mut out));
        },
    );
}

/// Rows that a band writes.
struct Out<'a> {
    colours: &'a mut [f32],
    confidence: &'a mut [f32],
    length: &'a mut [f32],
    kept: &'a mut [f32],
    seen: Option<&'a mut [f32]>,
    fast: Option<&'a mut [f32]>,
}

/// Lanes of one phase of one row.
#[derive(Clone, Copy)]
struct PixelRun {
    /// Row of the image, and of the band.
    y: usize,
    k: usize,
    phase: usize,
    /// First lane within the phase, how many are filled, and the row's element where they begin.
    first: usize,
    n: usize,
    begin: usize,
}

/// What a band needs for the lanes at hand.
struct Scratch {
    expected: Expected,
    footprint: Footprint,
    lookup: Lookup,
    splines: Splines,
    columns: Columns,
    moments: Moments,
    shares: Shares,
    old_length: Lanes,
    old_fast: Lanes,
    surfaces: Lanes,
    low: Lanes3,
    high: Lanes3,
    beauty_now: Lanes3,
    beauty_then: Lanes3,
    beauty_held: Lanes3,
    beauty_clamped: Lanes3,
    value: Lanes3,
    then: Lanes3,
    result: Lanes3,
}

impl Scratch {
    #[inline(always)]
    fn new() -> Self {
        let three = [[0.0; LANES]; 3];
        Self {
            expected: Expected::new(),
            footprint: Footprint::new(),
            lookup: Lookup::new(),
            splines: Splines::new(),
            columns: Columns::new(),
            moments: Moments::new(),
            shares: Shares::new(),
            old_length: [0.0; LANES],
            old_fast: [0.0; LANES],
            surfaces: [0.0; LANES],
            low: three,
            high: three,
            beauty_now: three,
            beauty_then: three,
            beauty_held: three,
            beauty_clamped: three,
            value: three,
            then: three,
            result: three,
        }
    }

    /// Finds where the surfaces, or what they mirror, were; fills `lookup` and `footprint`.
    #[inline(always)]
    fn look_up(&mut self, filter: &Filter<'_>, mirrors: bool, at: PixelRun, out: &mut Out<'_>) {
        let Self { expected, footprint, lookup, surfaces, .. } = self;
        let (guides, settings) = (filter.guides, filter.settings);
        let PixelRun { y, k, phase, first, n, begin } = at;
        let width = guides.phases.size.width;
        let x = PERIOD * first + phase;
        let found = filter.seen.map(|seen| &seen[y * width + begin..][..n]).filter(|_| mirrors);
        match found.filter(|found| found.iter().fold(true, |all, trust| all & (*trust >= 0.0))) {
            Some(found) => {
                *surfaces = [0.0; LANES];
                copy::<LANES, _>(&mut surfaces[..n], found);
                expected.rest(guides, (y, begin, n), (x, PERIOD));
                let rest = (&*expected, &*surfaces);
                reflect::<false>(guides, settings, rest, (phase, first), footprint, lookup);
            }
            None => {
                expected.find(guides, &settings.surface, (y, begin, n), (x, PERIOD));
                footprint.collect(guides, &expected.coordinate, &expected.alive, false);
                footprint.look_up(guides, settings, expected, None, lookup);
                if mirrors || out.seen.is_some() {
                    visible(guides, settings, (footprint, lookup), expected, surfaces);
                }
                if let Some(seen) = &mut out.seen {
                    copy::<LANES, _>(&mut seen[k * width + begin..][..n], &surfaces[..n]);
                }
                if mirrors {
                    let moved = (&*expected, &*surfaces);
                    reflect::<true>(guides, settings, moved, (phase, first), footprint, lookup);
                }
            }
        }
        if !guides.confidence_in.is_empty() {
            let trust = &guides.confidence_in[y * width + begin..][..n];
            for i in 0..n {
                lookup.trust[i] *= trust[i];
            }
        }
    }

    /// Blends every plane with its history.
    #[inline(always)]
    fn blend(
        &mut self,
        (filter, weights): (&Filter<'_>, &Blend),
        (current, history): (&Colours, Remembered<'_>),
        at: PixelRun,
        out: &mut Out<'_>,
    ) {
        let PixelRun { y, k, phase, n, begin, .. } = at;
        let phases = &filter.guides.phases;
        let width = phases.size.width;
        let (now, stride, radius) = (current.row(width, y), current.stride(width), weights.clip_radius as usize);
        let found = (&self.footprint, &self.lookup);
        load(now, width, 0, begin, n, &mut self.beauty_now);
        fetch(history.colours, width, 0, found, &mut self.beauty_then);
        if out.fast.is_some() && history.change.is_none() {
            keep_light(&self.beauty_then, &mut self.old_fast);
        }
        let splined = self.lookup.any_spline;
        if splined {
            self.splines.weigh(&self.lookup);
            let found = (&self.footprint, &self.lookup, &self.splines);
            let held = Some(&mut self.beauty_held);
            fetch_spline((history.colours, phases), 0, found, &mut self.beauty_then, held);
        }
        match weights.clip {
            Clip::Off => {}
            Clip::Box => self.columns.boxes(phase, radius, &mut self.low, &mut self.high),
            Clip::Sigma => {
                self.moments.boxes((k, phase), radius, weights.clip_gamma, &mut self.low, &mut self.high);
            }
        }
        if weights.clip != Clip::Off {
            let held = if splined { &self.beauty_held } else { &self.beauty_then };
            clamp((&self.beauty_then, held), &self.beauty_now, (&self.low, &self.high), &mut self.beauty_clamped);
        }
        for plane in 0..current.planes {
            load(now, width, plane, begin, n, &mut self.value);
            if plane == 0 {
                self.then = self.beauty_then;
            } else {
                fetch(history.colours, width, plane, found, &mut self.then);
                if splined {
                    let found = (&self.footprint, &self.lookup, &self.splines);
                    fetch_spline((history.colours, phases), plane, found, &mut self.then, None);
                }
            }
            let (value, then, share) = (&self.value, &self.then, &self.shares.history);
            if weights.clip == Clip::Off {
                blend_unclamped(value, then, share, &mut self.result);
            } else if plane == 0 {
                blend_beauty(value, then, &self.beauty_clamped, share, &mut self.result);
            } else {
                let beauty = (&self.beauty_then, &self.beauty_clamped, &self.beauty_now);
                blend_lanes(value, then, share, beauty, &mut self.result);
            }
            for c in 0..3 {
                let at = k * stride + (plane * 3 + c) * width + begin;
                copy::<LANES, _>(&mut out.colours[at..][..n], &self.result[c][..n]);
            }
        }
    }
}

#[inline(always)]
fn band(
    filter: &Filter<'_>,
    phases: &Phases,
    weights: &Blend,
    current: &Colours,
    history: Remembered<'_>,
    first_row: usize,
    out: &mut Out<'_>,
) {
    let guides = filter.guides;
    let width = phases.size.width;
    let mirrors = filter.signal == Signal::Glossy && mirrors(filter.settings, guides);
    let radius = weights.clip_radius as usize;
    let height = out.kept.len() / width;
    let mut scratch = Scratch::new();
    let (mut confidence, mut length) = ([[0.0; LANES]; PERIOD], [[0.0; LANES]; PERIOD]);
    for first in (0..phases.longest()).step_by(LANES) {
        if weights.clip == Clip::Sigma {
            scratch.moments.fill(phases, current, &guides.now.depth, (first_row, height, first), radius);
        }
        for k in 0..height {
            let y = first_row + k;
            if weights.clip == Clip::Box {
                scratch.columns.fill(phases, current, Some(&guides.now.depth), (y, first), radius);
            }
            for phase in 0..PERIOD {
                let count = phases.count(phase);
                if first >= count {
                    continue;
                }
                let n = LANES.min(count - first);
                let begin = phases.range(phase).start + first;
                let at = PixelRun { y, k, phase, first, n, begin };
                scratch.look_up(filter, mirrors, at, out);
                let Scratch { footprint, lookup, expected, shares, old_length, old_fast, .. } = &mut scratch;
                fetch_scalar(history.length, width, (&*footprint, &*lookup), old_length);
                if let Some((changed, fast)) = history.change {
                    if let Some(change) = &weights.change {
                        shorten(change, &changed[y * width + begin..][..n], old_length);
                    }
                    fetch_scalar(fast, width, (&*footprint, &*lookup), old_fast);
                }
                match out.fast {
                    Some(_) => shares.weigh::<true>(weights, &lookup.trust, old_length, &expected.depth),
                    None => shares.weigh::<false>(weights, &lookup.trust, old_length, &expected.depth),
                }
                confidence[phase] = shares.confidence;
                length[phase] = shares.length;
                copy::<LANES, _>(&mut out.kept[k * width + begin..][..n], &shares.length[..n]);
                scratch.blend((filter, weights), (current, history), at, out);
                if let Some(fast) = &mut out.fast {
                    let Scratch { beauty_now, old_fast, shares, .. } = &mut scratch;
                    blend_fast(beauty_now, old_fast, &shares.fast, &mut fast[k * width + begin..][..n]);
                }
            }
            let columns = k * width + PERIOD * first..k * width + width.min(PERIOD * (first + LANES));
            interleave(&confidence, &mut out.confidence[columns.clone()]);
            interleave(&length, &mut out.length[columns]);
        }
    }
}
