//! Motion of what mirrors and glass show, matched on all threads, eight pixels of a patch's row at once.

use super::ReflectionMotion;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Reflections;
use crate::simd::dispatch;
use crate::window::Features;
use fearless_simd::{Simd, f32x8, prelude::*};

/// Colour and normal that pixels show.
const SEEN: usize = 6;
/// The same and the share of mirror.
const CHANNELS: usize = SEEN + 1;
/// Pixels of a patch's row that are compared at once.
const LANES: usize = 8;
/// Pixels of the row of a patch of the usual size, which are summed without a loop.
const USUAL: usize = 7;

/// One level of the pyramid.
struct Level {
    size: Size,
    /// Row by row, of each row colour and normal, then the share, channel by channel: with a row of zeros above the picture and one
    /// below, and [`LANES`] zeros before and after each channel. Patches that reach beyond the picture read these.
    shown: Vec<f32>,
    /// How much of the pixel is mirror or glass, 0..1.
    share: Vec<f32>,
    /// Pixels of mirror in the patch around each pixel.
    population: Vec<u32>,
}

impl Level {
    fn finest(features: &Features, s: &Reflections) -> Option<Self> {
        let seen = features.seen.as_ref()?;
        let size = features.size;
        let share = |x: usize, y: usize| if features.is_mirror(y * size.width + x) { 1.0 } else { 0.0 };
        let share: Vec<f32> = par::plane(size, share).into_vec();
        if !par::any(&share, |share| *share == 1.0) {
            return None;
        }
        let of = |i: usize| {
            let ([r, g, b], [x, y, z]) = (seen.at(0, i), seen.at(1, i));
            [r, g, b, x, y, z]
        };
        Some(Self::new(size, of, share, s))
    }

    /// `of(pixel)`: colour and normal of a mirror.
    fn new(size: Size, of: impl Fn(usize) -> [f32; SEEN] + Sync + Send, share: Vec<f32>, s: &Reflections) -> Self {
        let (w, stride) = (size.width, Self::stride(size));
        let mut shown = vec![0.0; CHANNELS * stride * (size.height + 2)];
        par::rows(&mut shown, CHANNELS * stride, |y, row| {
            // The first row and the last lie outside of the picture.
            let Some(share) = y.checked_sub(1).and_then(|y| share.get(y * w..(y + 1) * w)) else { return };
            // What is no mirror counts nowhere.
            for (x, share) in share.iter().enumerate().filter(|(_, share)| **share > 0.0) {
                for (c, value) in of((y - 1) * w + x).into_iter().chain([*share]).enumerate() {
                    row[c * stride + LANES + x] = value;
                }
            }
        });
        let population = population(size, &share, s);
        Self { size, shown, share, population }
    }

    /// Means over 2x2, of the mirror's part alone.
    fn coarser(&self, s: &Reflections) -> Self {
        let size = Size::new(self.size.width.div_ceil(2), self.size.height.div_ceil(2));
        let (mut seen, mut share) = (vec![[0.0; SEEN]; size.pixels()], vec![0.0f32; size.pixels()]);
        par::two_rows(&mut seen, size.width, &mut share, size.width, |y, seen, share_of| {
            for x in 0..size.width {
                let (mut sum, mut weight, mut pixels) = ([0.0f32; SEEN], 0.0f32, 0.0f32);
                for qy in 2 * y..(2 * y + 2).min(self.size.height) {
                    for qx in 2 * x..(2 * x + 2).min(self.size.width) {
                        let share = self.share[qy * self.size.width + qx];
                        pixels += 1.0;
                        if share > 0.0 {
                            for (c, sum) in sum.iter_mut().enumerate() {
                                *sum += share * self.value(c, qx, qy);
                            }
                            weight += share;
                        }
                    }
                }
                seen[x] = sum.map(|sum| if weight > 0.0 { sum / weight } else { 0.0 });
                share_of[x] = weight / pixels;
            }
        });
        Self::new(size, |p| seen[p], share, s)
    }

    fn at(&self, x: i32, y: i32) -> Option<usize> {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.size.width && (y as usize) < self.size.height;
        inside.then(|| y as usize * self.size.width + x as usize)
    }

    /// Numbers of a channel of a row.
    fn stride(size: Size) -> usize {
        size.width + 2 * LANES
    }

    fn value(&self, c: usize, x: usize, y: usize) -> f32 {
        let stride = Self::stride(self.size);
        self.shown[((y + 1) * CHANNELS + c) * stride + LANES + x]
    }

    /// The channels of row `y`, of any row beyond the picture zeros.
    #[inline(always)]
    fn row(&self, y: i32) -> &[f32] {
        let row = CHANNELS * Self::stride(self.size);
        let y = (y.clamp(-1, self.size.height as i32) + 1) as usize;
        &self.shown[y * row..][..row]
    }

    /// Where in a channel of a row [`LANES`] columns lie, from `x` on; where all are beyond the picture, zeros.
    #[inline(always)]
    fn column(&self, x: i32) -> usize {
        (x.clamp(-(LANES as i32), self.size.width as i32) + LANES as i32) as usize
    }
}

/// Pixels of mirror in the patch around each pixel.
fn population(size: Size, share: &[f32], s: &Reflections) -> Vec<u32> {
    let (w, h, patch) = (size.width, size.height, s.patch as usize);
    let mut all = vec![0u32; size.pixels()];
    par::rows(&mut all, w, |y, out| {
        let mut columns = vec![0u32; w];
        for row in share[y.saturating_sub(patch) * w..(y + patch + 1).min(h) * w].chunks_exact(w) {
            columns.iter_mut().zip(row).for_each(|(n, share)| *n += u32::from(*share >= s.least_share));
        }
        for (x, out) in out.iter_mut().enumerate() {
            *out = columns[x.saturating_sub(patch)..(x + patch + 1).min(w)].iter().sum();
        }
    });
    all
}

/// Eight values of a row from `start` on, which all lie there: one comparison, and no function is called, so that a loop around keeps its
/// numbers in registers.
#[inline(always)]
fn load<S: Simd>(simd: S, row: &[f32], start: usize) -> f32x8<S> {
    // That the sum does not overflow is plain to the compiler so.
    let start = start & (usize::MAX >> 1);
    match row.get(start..start + LANES) {
        Some(run) => f32x8::from_slice(simd, run),
        None => f32x8::splat(simd, 0.0),
    }
}

fn pyramid(finest: Level, s: &Reflections) -> Vec<Level> {
    let mut levels = vec![finest];
    while let Some(last) = levels.last()
        && last.size.width.min(last.size.height) >= 2 * s.coarsest as usize
    {
        let next = last.coarser(s);
        levels.push(next);
    }
    levels
}

/// Motion of reflections from `next` to `previous`, and back; each `None` where the surface's is unknown. `None`: one
/// of the frames has no mirror.
pub(crate) fn run(previous: &Features, next: &Features, s: &Reflections) -> Option<ReflectionMotion> {
    let levels = |frame| Level::finest(frame, s).map(|finest| pyramid(finest, s));
    let (a, b) = par::both(|| levels(previous), || levels(next));
    let (a, b) = (a?, b?);
    let (to_previous, to_next) = par::both(
        || next.motion.to_previous.as_ref().map(|m| follow(&b, &a, m.plane(), s)),
        || previous.motion.to_next.as_ref().map(|m| follow(&a, &b, m.plane(), s)),
    );
    Some(ReflectionMotion { to_previous, to_next })
}

/// Replaces `motion` from `here` to `there` at mirrors and glass.
fn follow(here: &[Level], there: &[Level], mut motion: Plane<[f32; 2]>, s: &Reflections) -> Plane<[f32; 2]> {
    let surface = motions(here, &motion);
    let mut found: Vec<[i32; 2]> = Vec::new();
    let mut above = Size::new(0, 0);
    for level in (0..here.len()).rev() {
        let pair = Pair { here: &here[level], there: &there[level], surface: &surface[level], s };
        let size = pair.here.size;
        let coarse = std::mem::take(&mut found);
        found = vec![[0; 2]; size.pixels()];
        par::rows(&mut found, size.width, |y, row| {
            dispatch!(crate::simd::level(), simd => pair.best_of_row(simd, y, &coarse, above, row));
        });
        above = size;
        found = pair.calm(&found);
    }
    let pair = Pair { here: &here[0], there: &there[0], surface: &surface[0], s };
    let size = pair.here.size;
    let mut fine = Plane::filled(size, [0.0; 2]);
    par::rows(fine.data_mut(), size.width, |y, row| {
        dispatch!(crate::simd::level(), simd => pair.row_between_pixels(simd, y, &found, row));
    });
    let known = |m: &[f32; 2]| m.iter().all(|c| c.is_finite());
    par::rows(motion.data_mut(), size.width, |y, row| {
        for ((m, fine), share) in row.iter_mut().zip(fine.row(y)).zip(&here[0].share[y * size.width..]) {
            if *share > 0.0 && known(m) {
                *m = *fine;
            }
        }
    });
    motion
}

/// The surface's motion at each level, in its pixels; means over the mirror's part.
fn motions(levels: &[Level], motion: &Plane<[f32; 2]>) -> Vec<Vec<[f32; 2]>> {
    let known = |m: &[f32; 2]| if m.iter().all(|c| c.is_finite()) { *m } else { [0.0; 2] };
    let mut all = vec![par::map(motion.data(), known)];
    for pair in levels.windows(2) {
        let (fine, coarse) = (&pair[0], &pair[1]);
        let Some(last) = all.last() else { break };
        let mean = |x: usize, y: usize| {
            let (mut sum, mut weight) = ([0.0f32; 2], 0.0f32);
            for qy in 2 * y..(2 * y + 2).min(fine.size.height) {
                for qx in 2 * x..(2 * x + 2).min(fine.size.width) {
                    let q = qy * fine.size.width + qx;
                    sum = [0, 1].map(|c| sum[c] + fine.share[q] * last[q][c]);
                    weight += fine.share[q];
                }
            }
            if weight > 0.0 { sum.map(|s| 0.5 * s / weight) } else { [0.0; 2] }
        };
        all.push(par::plane(coarse.size, mean).into_vec());
    }
    all
}

/// A level of both frames.
struct Pair<'a> {
    here: &'a Level,
    there: &'a Level,
    surface: &'a [[f32; 2]],
    s: &'a Reflections,
}

impl Pair<'_> {
    /// True where the patch of a pixel of mirror holds enough to be matched.
    fn is_matched(&self, p: usize) -> bool {
        self.here.share[p] >= self.s.least_share && self.here.population[p] as usize >= self.s.least_patch as usize
    }

    /// Mean difference of the patches round (x, y) here and round (x, y) + `offset` there, and the cost of departing. From `enough` on
    /// it is not summed up to the end: what is added is never below 0.
    #[inline(always)]
    fn cost<S: Simd>(&self, simd: S, (x, y): (i32, i32), offset: [i32; 2], enough: f32) -> f32 {
        let here = self.here;
        let Some(p) = here.at(x, y).filter(|&p| here.population[p] > 0) else { return f32::MAX };
        let departure = [offset[0] as f32 - self.surface[p][0], offset[1] as f32 - self.surface[p][1]];
        let departure = self.s.departure * (departure[0] * departure[0] + departure[1] * departure[1]);
        let cost = |sum: f32| sum / here.population[p] as f32 + departure;
        let sum = self.difference(simd, (x, y), offset, |sum| cost(sum) >= enough);
        cost(sum)
    }

    /// Sum of the differences of these patches; of their first rows, where that is enough.
    #[inline(always)]
    fn difference<S: Simd>(
        &self,
        simd: S,
        (x, y): (i32, i32),
        offset: [i32; 2],
        is_enough: impl Fn(f32) -> bool,
    ) -> f32 {
        let Reflections { least_share, most_difference, .. } = *self.s;
        let (here, there) = (self.here, self.there);
        let (stride, stride_there) = (Level::stride(here.size), Level::stride(there.size));
        let patch = self.s.patch as i32;
        let (zero, least) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, least_share));
        let most = f32x8::splat(simd, most_difference);
        let mut sum = 0.0f32;
        for row in (y - patch).max(0)..=(y + patch).min(here.size.height as i32 - 1) {
            let (p, q) = (here.row(row), there.row(row.saturating_add(offset[1])));
            let mut column = x - patch;
            while column <= x + patch {
                let (at, at_there) = (here.column(column), there.column(column.saturating_add(offset[0])));
                let mut squared = zero;
                for c in 0..SEEN {
                    let d = load(simd, p, c * stride + at) - load(simd, q, c * stride_there + at_there);
                    squared += d * d;
                }
                let both = load(simd, q, SEEN * stride_there + at_there).simd_ge(least);
                let difference = both.select(squared.min(most), most);
                // Nothing is added for pixels that are no mirror here: one after the other, as their sum has been rounded.
                let counts = load(simd, p, SEEN * stride + at).simd_ge(least);
                let differences: [f32; LANES] = counts.select(difference, zero).into();
                let n = (x + patch + 1 - column) as usize;
                if n == USUAL {
                    for difference in &differences[..USUAL] {
                        sum += difference;
                    }
                } else {
                    for difference in differences.iter().take(n) {
                        sum += difference;
                    }
                }
                column += LANES as i32;
            }
            if is_enough(sum) {
                break;
            }
        }
        sum
    }

    /// The best offsets of a row of pixels, from those of the level above.
    #[inline(always)]
    fn best_of_row<S: Simd>(&self, simd: S, y: usize, coarse: &[[i32; 2]], above: Size, out: &mut [[i32; 2]]) {
        let mut offsets: Vec<[i32; 2]> = Vec::new();
        // An offset that lost loses again: the least cost only falls, its factors are at most 1.
        let mut tried: Vec<[i32; 2]> = Vec::new();
        for (x, out) in out.iter_mut().enumerate() {
            let p = y * self.here.size.width + x;
            let start = self.surface[p].map(|m| m.round() as i32);
            if !self.is_matched(p) {
                *out = start;
                continue;
            }
            // Two rounds: of what may be, then of what is beside the best. A round of its own for the surface's motion.
            let mut best = (0.0, start);
            tried.clear();
            for round in 0..3 {
                offsets.clear();
                match (round, coarse.is_empty()) {
                    (0, _) => offsets.push(start),
                    (1, true) => square(self.s.search as i32, start, &mut offsets),
                    (1, false) => {
                        for (dx, dy) in [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)] {
                            let (qx, qy) = ((x / 2) as i32 + dx, (y / 2) as i32 + dy);
                            if qx >= 0 && qy >= 0 && (qx as usize) < above.width && (qy as usize) < above.height {
                                offsets.push(coarse[qy as usize * above.width + qx as usize].map(|c| 2 * c));
                            }
                        }
                    }
                    (_, true) => break,
                    (_, false) => {
                        square(1, best.1, &mut offsets);
                        best.0 *= self.s.stay;
                    }
                }
                for offset in &offsets {
                    if !coarse.is_empty() {
                        if tried.contains(offset) {
                            continue;
                        }
                        tried.push(*offset);
                    }
                    let enough = if round == 0 { f32::INFINITY } else { best.0 };
                    let cost = self.cost(simd, (x as i32, y as i32), *offset, enough);
                    if round == 0 {
                        best.0 = self.s.surface_bonus * cost;
                    } else if cost < best.0 {
                        best = (cost, *offset);
                    }
                }
            }
            *out = best.1;
        }
    }

    /// Medians over 3x3 of the mirror's part, component by component: single patches err.
    fn calm(&self, found: &[[i32; 2]]) -> Vec<[i32; 2]> {
        let size = self.here.size;
        let median = |x: usize, y: usize| {
            let p = y * size.width + x;
            let (x, y) = (x as i32, y as i32);
            if !self.is_matched(p) {
                return found[p];
            }
            let (mut around, mut n) = ([[0; 9]; 2], 0);
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                let Some(q) = self.here.at(x + dx, y + dy) else { continue };
                if self.here.share[q] >= self.s.least_share {
                    (around[0][n], around[1][n]) = (found[q][0], found[q][1]);
                    n += 1;
                }
            }
            around.map(|mut v| {
                v[..n].sort_unstable();
                v[n / 2]
            })
        };
        par::plane(size, median).into_vec()
    }

    /// Of a row of pixels the least of the parabolas through the best offset's cost and its neighbours'.
    #[inline(always)]
    fn row_between_pixels<S: Simd>(&self, simd: S, y: usize, found: &[[i32; 2]], out: &mut [[f32; 2]]) {
        for (x, out) in out.iter_mut().enumerate() {
            let p = y * self.here.size.width + x;
            if self.here.share[p] < self.s.least_share {
                continue;
            }
            if found[p] == self.surface[p].map(|m| m.round() as i32) {
                *out = self.surface[p];
                continue;
            }
            let best = found[p];
            let mut costs = [0.0; 5];
            for (cost, [dx, dy]) in costs.iter_mut().zip([[0, 0], [-1, 0], [1, 0], [0, -1], [0, 1]]) {
                *cost = self.cost(simd, (x as i32, y as i32), [best[0] + dx, best[1] + dy], f32::INFINITY);
            }
            for c in 0..2 {
                let [middle, before, after] = [costs[0], costs[1 + 2 * c], costs[2 + 2 * c]];
                let bend = before + after - 2.0 * middle;
                let shift = if bend > 1e-12 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
                out[c] = best[c] as f32 + shift;
            }
        }
    }
}

/// All offsets around one, up to `reach` pixels each way, row by row.
fn square(reach: i32, [x, y]: [i32; 2], out: &mut Vec<[i32; 2]>) {
    for dy in -reach..=reach {
        out.extend((-reach..=reach).map(|dx| [x + dx, y + dy]));
    }
}
