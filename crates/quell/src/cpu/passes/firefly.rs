//! The schedule of stage 6: for each run of pixels its nine neighbours, then the median of each lane.

use crate::kernels::math::luminance;
use crate::kernels::spiral::PERIOD;
use crate::phased::guides::{CpuGuides, field};
use crate::phased::layout::{Colours, Phases, channel};
use crate::phased::rows;
use crate::settings::{Firefly, Median};
use crate::simd::dispatch;
use crate::stages::firefly::MIDDLE;
use crate::stages::firefly::cpu::{NEIGHBOURS, is_replaced, median, rank};
use fearless_simd::Level;

/// Pixels whose medians are found together.
const RUN: usize = 64;
type Run = [f32; RUN];

pub(crate) fn run(level: Level, guides: &CpuGuides, settings: &Firefly, input: &Colours, output: &mut Colours) {
    let phases = guides.phases;
    let stride = output.stride(phases.size.width);
    rows::each(output.elements_mut(), stride, |y, out| {
        dispatch!(level, _simd => {
            if settings.median == Median::Channel && input.planes == 1 {
                values(guides, &phases, settings, input, y, out);
            } else {
                choices(guides, &phases, settings, input, y, out);
            }
        });
    });
}

/// One lane of nine runs.
#[inline(always)]
fn lane(v: &[Run; NEIGHBOURS], i: usize) -> [f32; NEIGHBOURS] {
    [v[0][i], v[1][i], v[2][i], v[3][i], v[4][i], v[5][i], v[6][i], v[7][i], v[8][i]]
}

/// Which of nine a pixel takes.
#[inline(always)]
fn choose(settings: &Firefly, values: [f32; NEIGHBOURS]) -> u32 {
    if is_replaced(settings, values[MIDDLE], median(values)) { rank(values) } else { MIDDLE as u32 }
}

/// Where the neighbours of a run lie, and which of them are surfaces.
struct Around {
    y: usize,
    phase: usize,
    first: usize,
    n: usize,
    /// 1 where a neighbour counts, 0 where the centre stands in for it.
    counts: [[u32; RUN]; NEIGHBOURS],
}

impl Around {
    #[inline(always)]
    fn new(guides: &CpuGuides, phases: &Phases, y: usize, phase: usize, first: usize, n: usize) -> Self {
        let (width, height) = (phases.size.width, phases.size.height);
        let mut around = Self { y, phase, first, n, counts: [[0; RUN]; NEIGHBOURS] };
        let own = &field(&guides.now.depth, width, 1, y, 0)[phases.range(phase).start + first..][..n];
        for k in 0..NEIGHBOURS {
            let (dx, ty) = (k as i32 % 3 - 1, (y + k / 3).wrapping_sub(1));
            if ty >= height {
                continue;
            }
            let Some(span) = phases.shifted(phase, first, n, dx) else { continue };
            let depth = &field(&guides.now.depth, width, 1, ty, 0)[span.source..][..span.len];
            let counts = &mut around.counts[k][span.first..][..span.len];
            let own = &own[span.first..][..span.len];
            for i in 0..span.len {
                counts[i] = u32::from((depth[i] < f32::INFINITY) & (own[i] < f32::INFINITY));
            }
        }
        around
    }

    /// One channel of the neighbours; the centre's where they do not count.
    #[inline(always)]
    fn load(&self, phases: &Phases, input: &Colours, plane: usize, c: usize, values: &mut [Run; NEIGHBOURS]) {
        let (width, height) = (phases.size.width, phases.size.height);
        let begin = phases.range(self.phase).start + self.first;
        let own = &channel(input.row(width, self.y), width, plane, c)[begin..][..self.n];
        for k in 0..NEIGHBOURS {
            values[k][..self.n].copy_from_slice(own);
            let (dx, ty) = (k as i32 % 3 - 1, (self.y + k / 3).wrapping_sub(1));
            if ty >= height {
                continue;
            }
            let Some(span) = phases.shifted(self.phase, self.first, self.n, dx) else { continue };
            let source = &channel(input.row(width, ty), width, plane, c)[span.source..][..span.len];
            let counts = &self.counts[k][span.first..][..span.len];
            let out = &mut values[k][span.first..][..span.len];
            for i in 0..span.len {
                // By bits: a choice between two values is compiled to a branch at each.
                let counts = counts[i].wrapping_neg();
                out[i] = f32::from_bits((source[i].to_bits() & counts) | (out[i].to_bits() & !counts));
            }
        }
    }
}

#[inline(always)]
fn values(guides: &CpuGuides, phases: &Phases, settings: &Firefly, input: &Colours, y: usize, out: &mut [f32]) {
    let (width, height) = (phases.size.width, phases.size.height);
    let mut v = [[0.0; RUN]; NEIGHBOURS];
    for phase in 0..PERIOD {
        for first in (0..phases.count(phase)).step_by(RUN) {
            let n = RUN.min(phases.count(phase) - first);
            let around = Around::new(guides, phases, y, phase, first, n);
            let begin = phases.range(phase).start + first;
            let whole = |dx| phases.shifted(phase, first, n, dx).filter(|s| s.len == RUN).map(|s| s.source);
            for c in 0..3 {
                let mut result = [0.0; RUN];
                // Away from the edges the neighbours are read where they lie.
                if let (Some(left), Some(middle), Some(right), true) =
                    (whole(-1), whole(0), whole(1), y > 0 && y + 1 < height)
                {
                    let source = |k: usize| {
                        let row = channel(input.row(width, y + k / 3 - 1), width, 0, c);
                        &row[[left, middle, right][k % 3]..][..RUN]
                    };
                    let [s0, s1, s2] = [source(0), source(1), source(2)];
                    let [s3, s4, s5] = [source(3), source(4), source(5)];
                    let [s6, s7, s8] = [source(6), source(7), source(8)];
                    let counts = &around.counts;
                    for i in 0..RUN {
                        let own = s4[i];
                        let pick = |k: usize, value: f32| if counts[k][i] != 0 { value } else { own };
                        let middle = median([
                            pick(0, s0[i]),
                            pick(1, s1[i]),
                            pick(2, s2[i]),
                            pick(3, s3[i]),
                            own,
                            pick(5, s5[i]),
                            pick(6, s6[i]),
                            pick(7, s7[i]),
                            pick(8, s8[i]),
                        ]);
                        result[i] = if is_replaced(settings, own, middle) { middle } else { own };
                    }
                } else {
                    around.load(phases, input, 0, c, &mut v);
                    for i in 0..RUN {
                        let (own, middle) = (v[MIDDLE][i], median(lane(&v, i)));
                        result[i] = if is_replaced(settings, own, middle) { middle } else { own };
                    }
                }
                out[c * width + begin..][..n].copy_from_slice(&result[..n]);
            }
        }
    }
}

#[inline(always)]
fn choices(guides: &CpuGuides, phases: &Phases, settings: &Firefly, input: &Colours, y: usize, out: &mut [f32]) {
    let width = phases.size.width;
    let mut v = [[0.0; RUN]; NEIGHBOURS];
    for phase in 0..PERIOD {
        for first in (0..phases.count(phase)).step_by(RUN) {
            let n = RUN.min(phases.count(phase) - first);
            let around = Around::new(guides, phases, y, phase, first, n);
            let mut chosen = [[0u32; RUN]; 3];
            match settings.median {
                Median::Channel => {
                    for c in 0..3 {
                        around.load(phases, input, 0, c, &mut v);
                        for i in 0..RUN {
                            chosen[c][i] = choose(settings, lane(&v, i));
                        }
                    }
                }
                Median::Luminance => {
                    let mut colours = [[[0.0; RUN]; NEIGHBOURS]; 3];
                    for c in 0..3 {
                        around.load(phases, input, 0, c, &mut colours[c]);
                    }
                    for k in 0..NEIGHBOURS {
                        for i in 0..RUN {
                            v[k][i] = luminance([colours[0][k][i], colours[1][k][i], colours[2][k][i]]);
                        }
                    }
                    for i in 0..RUN {
                        chosen[0][i] = choose(settings, lane(&v, i));
                    }
                    chosen = [chosen[0]; 3];
                }
            }
            for plane in 0..input.planes {
                for c in 0..3 {
                    around.load(phases, input, plane, c, &mut v);
                    let out = &mut out[(plane * 3 + c) * width + phases.range(phase).start + first..][..n];
                    for i in 0..n {
                        out[i] = v[chosen[c][i] as usize % NEIGHBOURS][i];
                    }
                }
            }
        }
    }
}
