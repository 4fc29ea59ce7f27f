//! The schedule of stages 3 and 8: row by row, block by block, phase by phase; what a run needs of the previous image
//! is collected, then computed on together.

use crate::cpu::guides::{CpuGuides, field};
use crate::cpu::layout::{Colours, Phases, copy};
use crate::cpu::rows;
use crate::frame::Signal;
use crate::kernels::clip_cpu::{Columns, Moments};
use crate::kernels::reproject_cpu::{Expected, Footprint, LANES, Lookup};
use crate::kernels::spiral::PERIOD;
use crate::kernels::temporal::Blend;
use crate::plane::Plane;
use crate::settings::{Clip, Settings};
use crate::stages::glossy_temporal::cpu::reflect;
use crate::stages::matte_temporal::cpu::{
    Shares, blend_beauty, blend_lanes, blend_unclamped, clamp, fetch, fetch_scalar, load,
};
use fearless_simd::{Level, dispatch};

/// What a pass needs besides its images.
#[derive(Clone, Copy)]
pub(crate) struct Filter<'a> {
    pub level: Level,
    pub guides: &'a CpuGuides,
    pub settings: &'a Settings,
    pub signal: Signal,
}

/// What a temporal stage remembers of the frame before.
#[derive(Clone, Copy)]
pub(crate) struct Remembered<'a> {
    pub colours: &'a Colours,
    pub length: &'a Plane<f32>,
}

/// What it writes besides colours.
pub(crate) struct Memory<'a> {
    pub confidence: &'a mut Plane<f32>,
    pub length: &'a mut Plane<f32>,
}

/// Without history: confidence and length; the colours are the current ones.
pub(crate) fn begin(guides: &CpuGuides, memory: Memory<'_>) {
    let phases = guides.phases;
    let width = phases.size.width;
    memory.length.data_mut().fill(1.0);
    rows::each(memory.confidence.data_mut(), width, |y, row| {
        let depth = field(&guides.now.depth, width, 1, y, 0);
        for (x, confidence) in row.iter_mut().enumerate() {
            *confidence = if depth[phases.element(x)] < f32::INFINITY { 0.0 } else { 1.0 };
        }
    });
}

pub(crate) fn run(
    filter: &Filter<'_>,
    current: &Colours,
    history: Remembered<'_>,
    output: &mut Colours,
    memory: Memory<'_>,
) {
    let phases = filter.guides.phases;
    let width = phases.size.width;
    let frames = filter.settings.surface.confidence_frames;
    let weights = match filter.signal {
        Signal::Matte => Blend::matte(&filter.settings.matte_temporal, frames),
        Signal::Glossy => Blend::glossy(&filter.settings.glossy_temporal, frames),
    };
    let strides = [output.stride(width), width, width];
    let targets = (output.elements_mut(), memory.confidence.data_mut(), memory.length.data_mut());
    rows::zip3(targets, strides, |y, out, confidence, length| {
        dispatch!(filter.level, _simd => {
            row(filter, &phases, &weights, current, history, y, (&mut *out, &mut *confidence, &mut *length));
        });
    });
}

#[inline(always)]
fn row(
    filter: &Filter<'_>,
    phases: &Phases,
    weights: &Blend,
    current: &Colours,
    history: Remembered<'_>,
    y: usize,
    (out, confidence, length): (&mut [f32], &mut [f32], &mut [f32]),
) {
    let (guides, settings) = (filter.guides, filter.settings);
    let width = phases.size.width;
    let now = current.row(width, y);
    let mirrors =
        filter.signal == Signal::Glossy && settings.glossy_temporal.virtual_reprojection && guides.has_glossy_hit();
    let radius = weights.clip_radius as usize;
    let mut expected = Expected::new();
    let mut footprint = Footprint::new();
    let mut lookup = Lookup::new();
    let mut columns = Columns::new();
    let mut moments = Moments::new();
    let mut shares = Shares::new();
    let mut old_length = [0.0; LANES];
    let (mut low, mut high) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    let (mut beauty_now, mut beauty_then, mut beauty_clamped) =
        ([[0.0; LANES]; 3], [[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    let (mut value, mut then, mut result) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    for first in (0..phases.longest()).step_by(LANES) {
        if weights.clip == Clip::Box {
            columns.fill(phases, current, Some(&guides.now.depth), (y, first), radius);
        }
        if weights.clip == Clip::Sigma {
            moments.fill(phases, current, &guides.now.depth, (y, first), radius);
        }
        for phase in 0..PERIOD {
            let count = phases.count(phase);
            if first >= count {
                continue;
            }
            let n = LANES.min(count - first);
            let begin = phases.range(phase).start + first;
            let x = PERIOD * first + phase;
            expected.find(guides, &settings.surface, (y, begin, n), (x, PERIOD));
            footprint.collect(guides, &expected.coordinate, &expected.alive, false);
            footprint.look_up(guides, settings, &expected, false, &mut lookup);
            if mirrors {
                reflect(guides, settings, &mut expected, (phase, first), &mut footprint, &mut lookup);
            }
            if !guides.confidence_in.is_empty() {
                let trust = &guides.confidence_in[y * width + begin..][..n];
                for i in 0..n {
                    lookup.trust[i] *= trust[i];
                }
            }
            fetch_scalar(history.length, (&footprint, &lookup), &mut old_length);
            shares.weigh(weights, &lookup.trust, &old_length, &expected.depth);
            for i in 0..n {
                confidence[x + PERIOD * i] = shares.confidence[i];
                length[x + PERIOD * i] = shares.length[i];
            }

            load(now, width, 0, begin, n, &mut beauty_now);
            fetch(history.colours, width, 0, (&footprint, &lookup), &mut beauty_then);
            match weights.clip {
                Clip::Off => {}
                Clip::Box => columns.boxes(phase, radius, &mut low, &mut high),
                Clip::Sigma => moments.boxes(phase, radius, weights.clip_gamma, &mut low, &mut high),
            }
            if weights.clip != Clip::Off {
                clamp(&beauty_then, &beauty_now, &low, &high, &mut beauty_clamped);
            }
            for plane in 0..current.planes {
                load(now, width, plane, begin, n, &mut value);
                if plane == 0 {
                    then = beauty_then;
                } else {
                    fetch(history.colours, width, plane, (&footprint, &lookup), &mut then);
                }
                if weights.clip == Clip::Off {
                    blend_unclamped(&value, &then, &shares.history, &mut result);
                } else if plane == 0 {
                    blend_beauty(&value, &then, &beauty_clamped, &shares.history, &mut result);
                } else {
                    let beauty = (&beauty_then, &beauty_clamped, &beauty_now);
                    blend_lanes(&value, &then, &shares.history, beauty, &mut result);
                }
                for c in 0..3 {
                    copy::<LANES, _>(&mut out[(plane * 3 + c) * width + begin..][..n], &result[c][..n]);
                }
            }
        }
    }
}
