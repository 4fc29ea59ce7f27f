//! Boxes for the colour clamp (`clip.rs`) of a run of pixels: least and greatest values, or sums, down columns first,
//! then along rows.

use super::math::{three, ycocg_from_rgb};
use super::reproject_cpu::{LANES, Lanes3};
use crate::kernels::spiral::PERIOD;
use crate::phased::layout::{Colours, Phases, channel, copy};

/// Lanes with one more on either side (windows reach at most [`PERIOD`] columns), filled up to whole vectors.
const PADDED: usize = LANES + 16;
type Padded = [f32; PADDED];

/// One row's colours, YCoCg, and depths around a block of pixels of one phase.
#[repr(align(64))]
struct Line {
    colour: [Padded; 3],
    /// +inf: does not count.
    depth: Padded,
}

impl Line {
    #[inline(always)]
    fn new() -> Self {
        Self { colour: [[0.0; PADDED]; 3], depth: [f32::INFINITY; PADDED] }
    }

    /// Pixels `first - 1` up to `first + LANES` of a phase; false where there are none. `depth`: of the whole image;
    /// `None`: all pixels count.
    #[inline(always)]
    fn load(
        &mut self,
        phases: &Phases,
        current: &Colours,
        depth: Option<&[f32]>,
        (y, first): (usize, usize),
        phase: usize,
    ) -> bool {
        let width = phases.size.width;
        let begin = first.saturating_sub(1);
        let end = (first + LANES + 1).min(phases.count(phase));
        if begin >= end {
            return false;
        }
        let (n, lane) = (end - begin, begin + 1 - first);
        let at = phases.range(phase).start + begin;
        let row = current.row(width, y);
        let mut rgb = [[0.0; PADDED]; 3];
        for c in 0..3 {
            copy::<{ LANES + 2 }, _>(&mut rgb[c][lane..][..n], &channel(row, width, 0, c)[at..][..n]);
        }
        self.depth = [f32::INFINITY; PADDED];
        match depth {
            Some(depth) => copy::<{ LANES + 2 }, _>(&mut self.depth[lane..][..n], &depth[y * width + at..][..n]),
            None => self.depth[lane..][..n].fill(0.0),
        }
        for i in 0..PADDED {
            let c = ycocg_from_rgb([rgb[0][i], rgb[1][i], rgb[2][i]]);
            self.colour[0][i] = c[0];
            self.colour[1][i] = c[1];
            self.colour[2][i] = c[2];
        }
        true
    }
}

/// Least and greatest values, YCoCg, of the columns around a block of `LANES` pixels of each phase.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Columns {
    low: [[Padded; 3]; PERIOD],
    high: [[Padded; 3]; PERIOD],
}

impl Columns {
    pub fn new() -> Self {
        Self { low: [[[f32::INFINITY; PADDED]; 3]; PERIOD], high: [[[f32::NEG_INFINITY; PADDED]; 3]; PERIOD] }
    }

    /// Of the pixels `first..first + LANES` of each phase, rows within `radius` of `y`. `depth`: only surfaces count;
    /// `None`: all pixels do.
    #[inline(always)]
    pub fn fill(
        &mut self,
        phases: &Phases,
        current: &Colours,
        depth: Option<&[f32]>,
        (y, first): (usize, usize),
        radius: usize,
    ) {
        let rows = y.saturating_sub(radius)..(y + radius + 1).min(phases.size.height);
        let mut line = Line::new();
        for phase in 0..PERIOD {
            let (low, high) = (&mut self.low[phase], &mut self.high[phase]);
            *low = [[f32::INFINITY; PADDED]; 3];
            *high = [[f32::NEG_INFINITY; PADDED]; 3];
            for ty in rows.clone() {
                if !line.load(phases, current, depth, (ty, first), phase) {
                    continue;
                }
                for c in 0..3 {
                    for i in 0..PADDED {
                        let (value, counts) = (line.colour[c][i], line.depth[i] < f32::INFINITY);
                        low[c][i] = if counts & (value < low[c][i]) { value } else { low[c][i] };
                        high[c][i] = if counts & (value > high[c][i]) { value } else { high[c][i] };
                    }
                }
            }
        }
    }

    /// The boxes of one phase's pixels: columns within `radius` (at most [`PERIOD`]).
    #[inline(always)]
    pub fn boxes(&self, phase: usize, radius: usize, low: &mut Lanes3, high: &mut Lanes3) {
        *low = [[f32::INFINITY; LANES]; 3];
        *high = [[f32::NEG_INFINITY; LANES]; 3];
        let radius = radius.min(PERIOD) as isize;
        for d in -radius..=radius {
            let target = phase as isize + d;
            let (of, shift) = (target.rem_euclid(PERIOD as isize) as usize, target.div_euclid(PERIOD as isize));
            let from = (1 + shift) as usize;
            for c in 0..3 {
                let (l, h) = (&self.low[of][c][from..][..LANES], &self.high[of][c][from..][..LANES]);
                for i in 0..LANES {
                    low[c][i] = if l[i] < low[c][i] { l[i] } else { low[c][i] };
                    high[c][i] = if h[i] > high[c][i] { h[i] } else { high[c][i] };
                }
            }
        }
    }
}

/// Most rows of a band, and rows of the widest window.
const MOST_ROWS: usize = 9;

/// What a row adds to the sums: YCoCg and the number of surfaces; 0 where there is none.
type Terms = [Padded; 4];
/// Three sums, three sums of squares, the number.
type Sums = [Padded; 7];

/// Sums over the columns around a block of `LANES` pixels of each phase, for a band of rows.
///
/// A band is as high as a window, so the windows of all its rows hold the band's last row before the middle: each is
/// the end of a run of sums upwards from there and the beginning of one downwards. A row is then read twice, not once
/// for every window, and nothing is subtracted.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Moments {
    sums: [[Sums; PERIOD]; MOST_ROWS],
}

impl Moments {
    pub fn new() -> Self {
        Self { sums: [[[[0.0; PADDED]; 7]; PERIOD]; MOST_ROWS] }
    }

    /// Rows of a band, for windows of `radius` (at most [`PERIOD`]).
    pub const fn band(radius: usize) -> usize {
        if radius < PERIOD { 2 * radius + 1 } else { MOST_ROWS }
    }

    /// As [`Columns::fill`], for `rows` rows from `y` on; only surfaces count.
    #[inline(always)]
    pub fn fill(
        &mut self,
        phases: &Phases,
        current: &Colours,
        depth: &[f32],
        (y, rows, first): (usize, usize, usize),
        radius: usize,
    ) {
        let radius = radius.min(PERIOD);
        let rows = rows.min(Self::band(radius));
        let height = phases.size.height;
        let mut terms = [[0.0; PADDED]; 4];
        for phase in 0..PERIOD {
            let mut sums = [[0.0; PADDED]; 7];
            for k in (0..=2 * radius).rev() {
                // Wraps above the image.
                let ty = (y + k).wrapping_sub(radius);
                if ty < height && load_terms(&mut terms, phases, current, depth, (ty, first), phase) {
                    add_terms(&terms, &mut sums);
                }
                if k < rows {
                    self.sums[k][phase] = sums;
                }
            }
            let mut sums = [[0.0; PADDED]; 7];
            for k in 1..rows {
                let ty = y + k + radius;
                if ty < height && load_terms(&mut terms, phases, current, depth, (ty, first), phase) {
                    add_terms(&terms, &mut sums);
                }
                for (window, sums) in self.sums[k][phase].iter_mut().zip(&sums) {
                    for i in 0..PADDED {
                        window[i] += sums[i];
                    }
                }
            }
        }
    }

    /// The boxes of one phase's pixels in row `k` of the band: mean and `gamma` deviations.
    #[inline(always)]
    pub fn boxes(&self, (k, phase): (usize, usize), radius: usize, gamma: f32, low: &mut Lanes3, high: &mut Lanes3) {
        let columns = &self.sums[k];
        let mut sums = [[0.0f32; LANES]; 7];
        let radius = radius.min(PERIOD) as isize;
        for d in -radius..=radius {
            let target = phase as isize + d;
            let (of, shift) = (target.rem_euclid(PERIOD as isize) as usize, target.div_euclid(PERIOD as isize));
            for c in 0..7 {
                let column = &columns[of][c][(1 + shift) as usize..][..LANES];
                for i in 0..LANES {
                    sums[c][i] += column[i];
                }
            }
        }
        let mut share = [0.0f32; LANES];
        for i in 0..LANES {
            share[i] = 1.0 / sums[6][i];
        }
        for c in 0..3 {
            for i in 0..LANES {
                let mean = sums[c][i] * share[i];
                let variance = sums[3 + c][i] * share[i] - mean * mean;
                let deviation = if variance > 0.0 { variance } else { 0.0 }.sqrt();
                low[c][i] = mean - gamma * deviation;
                high[c][i] = mean + gamma * deviation;
            }
        }
    }
}

/// The terms of pixels `first - 1` up to `first + LANES` of a phase; false where there are none.
#[inline(always)]
fn load_terms(
    terms: &mut Terms,
    phases: &Phases,
    current: &Colours,
    depth: &[f32],
    (y, first): (usize, usize),
    phase: usize,
) -> bool {
    let width = phases.size.width;
    let begin = first.saturating_sub(1);
    let end = (first + LANES + 1).min(phases.count(phase));
    if begin >= end {
        return false;
    }
    let (n, lane) = (end - begin, begin + 1 - first);
    let at = phases.range(phase).start + begin;
    let row = current.row(width, y);
    let [r, g, b] = three(|c| &channel(row, width, 0, c)[at..][..n]);
    let depth = &depth[y * width + at..][..n];
    *terms = [[0.0; PADDED]; 4];
    let [luma, orange, green, count] = terms;
    let (luma, orange) = (&mut luma[lane..][..n], &mut orange[lane..][..n]);
    let (green, count) = (&mut green[lane..][..n], &mut count[lane..][..n]);
    for i in 0..n {
        let colour = ycocg_from_rgb([r[i], g[i], b[i]]);
        let counts = depth[i] < f32::INFINITY;
        luma[i] = if counts { colour[0] } else { 0.0 };
        orange[i] = if counts { colour[1] } else { 0.0 };
        green[i] = if counts { colour[2] } else { 0.0 };
        count[i] = if counts { 1.0 } else { 0.0 };
    }
    true
}

#[inline(always)]
fn add_terms(terms: &Terms, sums: &mut Sums) {
    for c in 0..3 {
        for i in 0..PADDED {
            let value = terms[c][i];
            sums[c][i] += value;
            sums[3 + c][i] += value * value;
        }
    }
    for i in 0..PADDED {
        sums[6][i] += terms[3][i];
    }
}
