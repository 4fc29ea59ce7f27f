//! The specification of the motion of reflections.

use super::ReflectionMotion;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Reflections;
use crate::window::Features;

/// Motion of reflections between two neighbouring frames; `None`: one of them has no mirror.
pub fn run(previous: &Features, next: &Features, s: &Reflections) -> Option<ReflectionMotion> {
    let (a, b) = (Image::of(previous)?, Image::of(next)?);
    Some(ReflectionMotion {
        to_previous: next.motion.to_previous.as_ref().map(|motion| matched(&b, &a, &motion.plane(), s)),
        to_next: previous.motion.to_next.as_ref().map(|motion| matched(&a, &b, &motion.plane(), s)),
    })
}

/// What mirrors show, at one scale.
#[derive(Clone)]
struct Image {
    /// Albedo and normal; means over the mirror's part of the pixel.
    seen: Plane<[f32; 6]>,
    /// Part of the pixel that is a mirror, 0..1.
    share: Plane<f32>,
}

impl Image {
    fn of(f: &Features) -> Option<Self> {
        let seen = f.seen.as_ref()?;
        let w = f.size.width;
        let share = Plane::from_fn(f.size, |x, y| if f.is_mirror(y * w + x) { 1.0 } else { 0.0 });
        let six = |[r, g, b]: [f32; 3], [x, y, z]: [f32; 3]| [r, g, b, x, y, z];
        let seen = Plane::from_fn(f.size, |x, y| six(seen.at(0, y * w + x), seen.at(1, y * w + x)));
        share.data().contains(&1.0).then_some(Self { seen, share })
    }

    fn size(&self) -> Size {
        self.share.size()
    }

    /// Half the size; means over 2x2, of the mirror's part alone.
    fn halved(&self) -> Self {
        let size = Size::new(self.size().width.div_ceil(2), self.size().height.div_ceil(2));
        let share = Plane::from_fn(size, |x, y| {
            let four = self.four(x, y);
            four.iter().map(|&(x, y)| self.share.at(x, y)).sum::<f32>() / four.len() as f32
        });
        let seen = Plane::from_fn(size, |x, y| {
            let four = self.four(x, y);
            let total: f32 = four.iter().map(|&(x, y)| self.share.at(x, y)).sum();
            let mean = |c: usize| four.iter().map(|&(x, y)| self.share.at(x, y) * self.seen.at(x, y)[c]).sum::<f32>();
            std::array::from_fn(|c| if total > 0.0 { mean(c) / total } else { 0.0 })
        });
        Self { seen, share }
    }

    /// The pixels here of a pixel at half the size.
    fn four(&self, x: usize, y: usize) -> Vec<(usize, usize)> {
        let inside = |&(x, y): &(usize, usize)| x < self.size().width && y < self.size().height;
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| (2 * x + i, 2 * y + j)).into_iter().filter(inside).collect()
    }

    /// True where a pixel lies in the image and at least `least_share` of it is a mirror.
    fn is_mirror(&self, x: i32, y: i32, least_share: f32) -> bool {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.size().width && (y as usize) < self.size().height;
        inside && self.share.at(x as usize, y as usize) >= least_share
    }
}

/// One scale of both frames, with the surface's motion there.
struct Scale<'a> {
    s: &'a Reflections,
    here: Image,
    there: Image,
    surface: Plane<[f32; 2]>,
}

/// The surface's motion with that of reflections in its place at mirrors.
fn matched(here: &Image, there: &Image, motion: &Plane<[f32; 2]>, s: &Reflections) -> Plane<[f32; 2]> {
    let is_known = |m: [f32; 2]| m[0].is_finite() && m[1].is_finite();
    let known = Plane::from_fn(here.size(), |x, y| if is_known(motion.at(x, y)) { motion.at(x, y) } else { [0.0; 2] });
    let mut scales = vec![Scale { s, here: here.clone(), there: there.clone(), surface: known }];
    while let Some(next) = scales.last().filter(|last| last.can_be_halved()).map(Scale::halved) {
        scales.push(next);
    }
    let mut found: Option<Plane<[i32; 2]>> = None;
    for scale in scales.iter().rev() {
        let above = found.take();
        let best = Plane::from_fn(scale.here.size(), |x, y| scale.best(x as i32, y as i32, above.as_ref()));
        found = Some(Plane::from_fn(best.size(), |x, y| scale.median(x as i32, y as i32, &best)));
    }
    let Some(found) = found else { return motion.clone() };
    Plane::from_fn(motion.size(), |x, y| {
        let is_mirror = here.share.at(x, y) > 0.0;
        if is_mirror && is_known(motion.at(x, y)) {
            scales[0].refined(x as i32, y as i32, found.at(x, y))
        } else {
            motion.at(x, y)
        }
    })
}

impl Scale<'_> {
    fn can_be_halved(&self) -> bool {
        self.here.size().width.min(self.here.size().height) >= 2 * self.s.coarsest as usize
    }

    fn halved(&self) -> Self {
        let here = self.here.halved();
        let surface = Plane::from_fn(here.size(), |x, y| {
            let four = self.here.four(x, y);
            let total: f32 = four.iter().map(|&(x, y)| self.here.share.at(x, y)).sum();
            let sum =
                |c: usize| four.iter().map(|&(x, y)| self.here.share.at(x, y) * self.surface.at(x, y)[c]).sum::<f32>();
            // Half as many pixels.
            [0, 1].map(|c| if total > 0.0 { 0.5 * sum(c) / total } else { 0.0 })
        });
        Self { s: self.s, here, there: self.there.halved(), surface }
    }

    /// True where a pixel here takes part in the comparison.
    fn is_mirror(&self, x: i32, y: i32) -> bool {
        self.here.is_mirror(x, y, self.s.least_share)
    }

    /// The surface's motion in whole pixels.
    fn start(&self, x: i32, y: i32) -> [i32; 2] {
        self.surface.at(x as usize, y as usize).map(|m| m.round() as i32)
    }

    fn patch(&self, x: i32, y: i32) -> impl Iterator<Item = (i32, i32)> {
        square(self.s.patch as i32).map(move |[dx, dy]| (x + dx, y + dy))
    }

    /// True where the patch around a pixel of a mirror holds enough of it: what is thin says nothing.
    fn can_match(&self, x: i32, y: i32) -> bool {
        self.is_mirror(x, y)
            && self.patch(x, y).filter(|&(x, y)| self.is_mirror(x, y)).count() >= self.s.least_patch as usize
    }

    /// Mean difference of the patches around a pixel here and at an offset there, and what departing from the surface's
    /// motion costs.
    fn cost(&self, x: i32, y: i32, offset: [i32; 2]) -> f32 {
        let (mut sum, mut n) = (0.0, 0.0);
        for (px, py) in self.patch(x, y).filter(|&(x, y)| self.is_mirror(x, y)) {
            let (qx, qy) = (px + offset[0], py + offset[1]);
            sum += if self.there.is_mirror(qx, qy, self.s.least_share) {
                let a = self.here.seen.at(px as usize, py as usize);
                let b = self.there.seen.at(qx as usize, qy as usize);
                a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().min(self.s.most_difference)
            } else {
                self.s.most_difference
            };
            n += 1.0;
        }
        let surface = self.surface.at(x as usize, y as usize);
        let departure: f32 = (0..2).map(|c| (offset[c] as f32 - surface[c]).powi(2)).sum();
        sum / n + self.s.departure * departure
    }

    /// The best offset of a pixel, from those found at half the size.
    fn best(&self, x: i32, y: i32, above: Option<&Plane<[i32; 2]>>) -> [i32; 2] {
        let start = self.start(x, y);
        if !self.can_match(x, y) {
            return start;
        }
        let bonus = self.s.surface_bonus * self.cost(x, y, start);
        let Some(above) = above else {
            let around = square(self.s.search as i32).map(|[dx, dy]| [start[0] + dx, start[1] + dy]);
            return self.least(x, y, (bonus, start), around).1;
        };
        let candidates = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().filter_map(|(dx, dy)| {
            let (ax, ay) = (x / 2 + dx, y / 2 + dy);
            let size = above.size();
            let inside = ax >= 0 && ay >= 0 && (ax as usize) < size.width && (ay as usize) < size.height;
            inside.then(|| above.at(ax as usize, ay as usize).map(|c| 2 * c))
        });
        let (cost, middle) = self.least(x, y, (bonus, start), candidates);
        let around = square(1).map(|[dx, dy]| [middle[0] + dx, middle[1] + dy]);
        self.least(x, y, (self.s.stay * cost, middle), around).1
    }

    /// The offset that costs least; the earlier wins.
    fn least(&self, x: i32, y: i32, first: (f32, [i32; 2]), others: impl Iterator<Item = [i32; 2]>) -> (f32, [i32; 2]) {
        others.fold(first, |best, offset| {
            let cost = self.cost(x, y, offset);
            if cost < best.0 { (cost, offset) } else { best }
        })
    }

    /// Median over 3x3 of the mirror's part, component by component: single patches err.
    fn median(&self, x: i32, y: i32, found: &Plane<[i32; 2]>) -> [i32; 2] {
        if !self.can_match(x, y) {
            return found.at(x as usize, y as usize);
        }
        let around = square(1).map(|[dx, dy]| (x + dx, y + dy)).filter(|&(x, y)| self.is_mirror(x, y));
        let offsets: Vec<[i32; 2]> = around.map(|(x, y)| found.at(x as usize, y as usize)).collect();
        [0, 1].map(|c| {
            let mut sorted: Vec<i32> = offsets.iter().map(|o| o[c]).collect();
            sorted.sort_unstable();
            sorted[sorted.len() / 2]
        })
    }

    /// An offset between pixels: the least of the parabola through its cost and that of its neighbours.
    fn refined(&self, x: i32, y: i32, best: [i32; 2]) -> [f32; 2] {
        if best == self.start(x, y) {
            return self.surface.at(x as usize, y as usize);
        }
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

/// Offsets up to `radius` pixels each way, row by row.
fn square(radius: i32) -> impl Iterator<Item = [i32; 2]> {
    (-radius..=radius).flat_map(move |dy| (-radius..=radius).map(move |dx| [dx, dy]))
}
