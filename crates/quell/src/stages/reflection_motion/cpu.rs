//! Motion of what mirrors and glass show, matched on all threads.

use super::ReflectionMotion;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Reflections;
use crate::window::Features;

/// Colour and normal that a pixel shows.
type Seen = [f32; 6];

/// One level of the pyramid.
struct Level {
    size: Size,
    seen: Vec<Seen>,
    /// How much of the pixel is mirror or glass, 0..1.
    share: Vec<f32>,
}

impl Level {
    fn finest(features: &Features) -> Option<Self> {
        let (seen, colour) = (features.seen.as_ref()?, features.mirror_colour.as_ref()?);
        let size = features.size;
        let share = |i: usize| if colour.at(0, i) == [1.0; 3] { 0.0 } else { 1.0 };
        let share: Vec<f32> = (0..size.pixels()).map(share).collect();
        let seen = |i: usize| {
            let ([r, g, b], [x, y, z]) = (seen.at(0, i), seen.at(1, i));
            [r, g, b, x, y, z]
        };
        share.contains(&1.0).then(|| Self { size, seen: (0..size.pixels()).map(seen).collect(), share })
    }

    /// Means over 2x2, of the mirror's part alone.
    fn coarser(&self) -> Self {
        let size = Size::new(self.size.width.div_ceil(2), self.size.height.div_ceil(2));
        let (mut seen, mut share) = (Vec::with_capacity(size.pixels()), Vec::with_capacity(size.pixels()));
        for y in 0..size.height {
            for x in 0..size.width {
                let (mut sum, mut weight, mut pixels) = ([0.0f32; 6], 0.0f32, 0.0f32);
                for qy in 2 * y..(2 * y + 2).min(self.size.height) {
                    for qx in 2 * x..(2 * x + 2).min(self.size.width) {
                        let q = qy * self.size.width + qx;
                        for (sum, value) in sum.iter_mut().zip(&self.seen[q]) {
                            *sum += self.share[q] * value;
                        }
                        weight += self.share[q];
                        pixels += 1.0;
                    }
                }
                seen.push(if weight > 0.0 { sum.map(|s| s / weight) } else { [0.0; 6] });
                share.push(weight / pixels);
            }
        }
        Self { size, seen, share }
    }

    fn at(&self, x: i32, y: i32) -> Option<usize> {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.size.width && (y as usize) < self.size.height;
        inside.then(|| y as usize * self.size.width + x as usize)
    }
}

fn pyramid(finest: Level, s: &Reflections) -> Vec<Level> {
    let mut levels = vec![finest];
    while let Some(last) = levels.last()
        && last.size.width.min(last.size.height) >= 2 * s.coarsest as usize
    {
        let next = last.coarser();
        levels.push(next);
    }
    levels
}

/// Motion of reflections from `next` to `previous`, and back; each `None` where the surface's is unknown. `None`: one
/// of the frames has no mirror.
pub(crate) fn run(previous: &Features, next: &Features, s: &Reflections) -> Option<ReflectionMotion> {
    let (a, b) = (pyramid(Level::finest(previous)?, s), pyramid(Level::finest(next)?, s));
    Some(ReflectionMotion {
        to_previous: next.motion.to_previous.as_ref().map(|m| follow(&b, &a, m.clone(), s)),
        to_next: previous.motion.to_next.as_ref().map(|m| follow(&a, &b, m.clone(), s)),
    })
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
        found = par::plane(size, |x, y| pair.best(x as i32, y as i32, &coarse, above)).into_vec();
        above = size;
        found = pair.calm(&found);
    }
    let pair = Pair { here: &here[0], there: &there[0], surface: &surface[0], s };
    let size = pair.here.size;
    let fine = par::plane(size, |x, y| pair.between_pixels(x as i32, y as i32, &found));
    let known = |m: &[f32; 2]| m.iter().all(|c| c.is_finite());
    for ((m, fine), share) in motion.data_mut().iter_mut().zip(fine.data()).zip(&here[0].share) {
        if *share > 0.0 && known(m) {
            *m = *fine;
        }
    }
    motion
}

/// The surface's motion at each level, in its pixels; means over the mirror's part.
fn motions(levels: &[Level], motion: &Plane<[f32; 2]>) -> Vec<Vec<[f32; 2]>> {
    let known = |m: &[f32; 2]| if m.iter().all(|c| c.is_finite()) { *m } else { [0.0; 2] };
    let mut all = vec![motion.data().iter().map(known).collect::<Vec<_>>()];
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
    /// Pixels of mirror in the patch.
    fn population(&self, x: i32, y: i32) -> usize {
        let patch = self.s.patch as i32;
        let around = (-patch..=patch).flat_map(|dy| (-patch..=patch).map(move |dx| (x + dx, y + dy)));
        around.filter_map(|(x, y)| self.here.at(x, y)).filter(|&p| self.here.share[p] >= self.s.least_share).count()
    }

    /// Mean difference of the patches round (x, y) here and round (x, y) + `offset` there, and the cost of departing.
    fn cost(&self, x: i32, y: i32, offset: [i32; 2]) -> f32 {
        let (mut sum, mut n) = (0.0f32, 0.0f32);
        let Reflections { least_share, most_difference, departure: rate, .. } = *self.s;
        let patch = self.s.patch as i32;
        for dy in -patch..=patch {
            for dx in -patch..=patch {
                let Some(p) = self.here.at(x + dx, y + dy).filter(|&p| self.here.share[p] >= least_share) else {
                    continue;
                };
                let q = self.there.at(x + dx + offset[0], y + dy + offset[1]);
                let difference = match q.filter(|&q| self.there.share[q] >= least_share) {
                    Some(q) => {
                        let (a, b) = (&self.here.seen[p], &self.there.seen[q]);
                        (0..6).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().min(most_difference)
                    }
                    None => most_difference,
                };
                sum += difference;
                n += 1.0;
            }
        }
        let Some(p) = self.here.at(x, y).filter(|_| n > 0.0) else { return f32::MAX };
        let departure = [0, 1].map(|c| offset[c] as f32 - self.surface[p][c]);
        sum / n + rate * (departure[0] * departure[0] + departure[1] * departure[1])
    }

    /// The best offset of a pixel, from those of the level above.
    fn best(&self, x: i32, y: i32, coarse: &[[i32; 2]], above: Size) -> [i32; 2] {
        let Some(p) = self.here.at(x, y) else { return [0; 2] };
        let start = self.surface[p].map(|m| m.round() as i32);
        if self.here.share[p] < self.s.least_share || self.population(x, y) < self.s.least_patch as usize {
            return start;
        }
        let mut best = (self.s.surface_bonus * self.cost(x, y, start), start);
        let attempt = |offset: [i32; 2], best: &mut (f32, [i32; 2])| {
            let cost = self.cost(x, y, offset);
            if cost < best.0 {
                *best = (cost, offset);
            }
        };
        if coarse.is_empty() {
            let search = self.s.search as i32;
            for dy in -search..=search {
                for dx in -search..=search {
                    attempt([start[0] + dx, start[1] + dy], &mut best);
                }
            }
            return best.1;
        }
        for (dx, dy) in [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)] {
            let (qx, qy) = (x / 2 + dx, y / 2 + dy);
            if qx >= 0 && qy >= 0 && (qx as usize) < above.width && (qy as usize) < above.height {
                attempt(coarse[qy as usize * above.width + qx as usize].map(|c| 2 * c), &mut best);
            }
        }
        let middle = best.1;
        best.0 *= self.s.stay;
        for dy in -1..=1 {
            for dx in -1..=1 {
                attempt([middle[0] + dx, middle[1] + dy], &mut best);
            }
        }
        best.1
    }

    /// Medians over 3x3 of the mirror's part, component by component: single patches err.
    fn calm(&self, found: &[[i32; 2]]) -> Vec<[i32; 2]> {
        let size = self.here.size;
        let median = |x: usize, y: usize| {
            let p = y * size.width + x;
            let (x, y) = (x as i32, y as i32);
            if self.population(x, y) < self.s.least_patch as usize || self.here.share[p] < self.s.least_share {
                return found[p];
            }
            let mut around = [Vec::new(), Vec::new()];
            for q in (-1..=1).flat_map(|dy| (-1..=1).filter_map(move |dx| self.here.at(x + dx, y + dy))) {
                if self.here.share[q] >= self.s.least_share {
                    around[0].push(found[q][0]);
                    around[1].push(found[q][1]);
                }
            }
            around.map(|mut v| {
                v.sort_unstable();
                v[v.len() / 2]
            })
        };
        par::plane(size, median).into_vec()
    }

    /// The least of the parabolas through the best offset's cost and its neighbours'.
    fn between_pixels(&self, x: i32, y: i32, found: &[[i32; 2]]) -> [f32; 2] {
        let Some(p) = self.here.at(x, y).filter(|&p| self.here.share[p] >= self.s.least_share) else { return [0.0; 2] };
        if found[p] == self.surface[p].map(|m| m.round() as i32) {
            return self.surface[p];
        }
        let best = found[p];
        let middle = self.cost(x, y, best);
        [0, 1].map(|c| {
            let beside = |step: i32| {
                let mut offset = best;
                offset[c] += step;
                self.cost(x, y, offset)
            };
            let (before, after) = (beside(-1), beside(1));
            let bend = before + after - 2.0 * middle;
            let shift = if bend > 1e-12 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
            best[c] as f32 + shift
        })
    }
}
