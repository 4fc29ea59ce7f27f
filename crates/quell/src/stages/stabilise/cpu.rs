//! A pixel of the steadier picture.

use super::likeness::share;
use super::{Likeness, StabiliseFrame, may_miss, noise_unit, seen_difference};
use crate::frame::Rgb;
use crate::kernels::bands_cpu::Band;
use crate::kernels::guide_distance::weight;
use crate::kernels::lanes::{BLOCK, load};
use crate::kernels::math::catmull_rom;
use crate::kernels::motion_cpu::{motion_of, nearest};
use crate::par;
use crate::plane::Plane;
use crate::sequence::settings::{Gather, Stabilise};
use crate::simd::dispatch;
use crate::window::Features;
use fearless_simd::{Simd, f32x16, i32x16, mask32x16, prelude::*};

/// One picture and its neighbours in time.
pub(crate) struct Neighbourhood<'a> {
    pub window: &'a [StabiliseFrame<'a>],
    /// Of every frame of the window.
    pub fronts: &'a [Fronts],
    pub centre: usize,
    /// Coverage is averaged too: every frame has it.
    pub has_alpha: bool,
    pub gather: &'a Gather,
    pub settings: &'a Stabilise,
}

/// Range of the picture around a pixel.
struct Range {
    low: Rgb,
    high: Rgb,
    low_alpha: f32,
    high_alpha: f32,
}

impl Neighbourhood<'_> {
    /// Colour and coverage of a pixel, averaged over time. Without coverage that is 0.
    pub(crate) fn pixel(&self, x: usize, y: usize) -> (Rgb, f32) {
        let here = &self.window[self.centre];
        let range = self.range(x, y);
        let (mut sum, mut total) = (here.picture.at(x, y), 1.0);
        let mut sum_alpha = match (self.has_alpha, here.alpha) {
            (true, Some(alpha)) => alpha.at(x, y),
            _ => 0.0,
        };
        for forward in [false, true] {
            if forward && !self.gather.future {
                continue;
            }
            let ahead = if forward { self.window.len() - 1 - self.centre } else { self.centre };
            let mut track =
                Track::new((here.features, &self.fronts[self.centre]), (x, y), 0.0, self.gather, self.settings);
            let mut decayed = 1.0;
            for k in 1..=ahead.min(self.settings.frames as usize) {
                let (from, to) = if forward {
                    (self.centre + k - 1, self.centre + k)
                } else {
                    (self.centre + 1 - k, self.centre - k)
                };
                let other = &self.window[to];
                let there = (other.features, &self.fronts[to]);
                let Some(likeness) = track.step(self.window[from].features, there, forward) else { break };
                let mut weight = decayed * likeness;
                if let (Some(a), Some(b)) = (here.likeness, other.likeness) {
                    let there = linear(other.features, track.at, b);
                    weight *= share((a.guide.at(x, y), a.tolerance.at(x, y)), there);
                }
                let taps = CubicTaps::new(other.features, track.at);
                let c = taps.fetch(|i| other.picture.data()[i]);
                for i in 0..3 {
                    sum[i] += weight * c[i].max(range.low[i]).min(range.high[i]);
                }
                if let (true, Some(a)) = (self.has_alpha, other.alpha) {
                    let [a, ..] = taps.fetch(|i| [a.data()[i]; 3]);
                    sum_alpha += weight * a.max(range.low_alpha).min(range.high_alpha);
                }
                total += weight;
                decayed *= self.settings.decay;
            }
        }
        (sum.map(|c| c / total), sum_alpha / total)
    }

    fn range(&self, x: usize, y: usize) -> Range {
        let here = &self.window[self.centre];
        let size = here.picture.size();
        let mut range = Range { low: [f32::MAX; 3], high: [f32::MIN; 3], low_alpha: f32::MAX, high_alpha: f32::MIN };
        for qy in y.saturating_sub(1)..(y + 2).min(size.height) {
            for qx in x.saturating_sub(1)..(x + 2).min(size.width) {
                let c = here.picture.at(qx, qy);
                for i in 0..3 {
                    range.low[i] = range.low[i].min(c[i]);
                    range.high[i] = range.high[i].max(c[i]);
                }
                if let (true, Some(a)) = (self.has_alpha, here.alpha) {
                    range.low_alpha = range.low_alpha.min(a.at(qx, qy));
                    range.high_alpha = range.high_alpha.max(a.at(qx, qy));
                }
            }
        }
        range
    }
}

/// A pixel's silhouette on its trajectory through the frames.
pub(super) struct Track<'a> {
    here: &'a Features,
    pixel: usize,
    settings: &'a Stabilise,
    /// Pixels by which motion may miss.
    may_miss: f32,
    mirror: bool,
    origin: (f32, f32),
    /// Rows that the trajectory may lead up or down.
    farthest: f32,
    pub(super) at: (f32, f32),
    front: Front,
}

impl<'a> Track<'a> {
    #[inline(always)]
    pub(super) fn new(
        (here, fronts): (&'a Features, &Fronts),
        (x, y): (usize, usize),
        noise: f32,
        gather: &Gather,
        settings: &'a Stabilise,
    ) -> Self {
        let pixel = y * here.size.width + x;
        // A band counts rows as the whole picture does: sums of floats are the same.
        let origin = ((x as f32), (here.first_row + y) as f32);
        Self {
            here,
            pixel,
            settings,
            may_miss: may_miss(settings, noise),
            mirror: here.is_mirror(pixel),
            origin,
            farthest: gather.travel * here.picture_height as f32,
            at: origin,
            front: fronts.at(here, x, y),
        }
    }

    /// Goes one frame further; the weight of what is there. `None`: it is lost.
    #[inline(always)]
    pub(super) fn step(&mut self, from: &Features, there: (&Features, &Fronts), forward: bool) -> Option<f32> {
        let (to, _) = there;
        // What a mirror or a glass shows has its own motion; where that is unsure, the surface's counts, unless both
        // differ.
        let mut tolerance = self.settings.seen_albedo;
        let mut next = self.along(from, there, forward, self.mirror);
        if next.is_none() && self.mirror && departs(from, forward, self.front.pixel) <= self.settings.departure {
            tolerance = self.settings.surface_seen_albedo;
            next = self.along(from, there, forward, false);
        }
        (self.at, self.front) = next?;
        let row = to.row_here(self.at.1.round() as isize)?;
        let q = row * self.here.size.width + self.at.0.round() as usize;
        let unlike = if self.mirror { seen_difference(self.here, self.pixel, to, q) } else { 0.0 };
        Some(weight(unlike / (2.0 * tolerance * tolerance)))
    }

    /// Where it lies one frame further by the motion of surfaces, or of what mirrors show.
    #[inline(always)]
    fn along(
        &self,
        from: &Features,
        there: (&Features, &Fronts),
        forward: bool,
        reflected: bool,
    ) -> Option<((f32, f32), Front)> {
        let next = step(from, there, forward, reflected, self.at, &self.front, (self.settings, self.may_miss))?;
        if (next.0.1 - self.origin.1).abs() <= self.farthest { Some(next) } else { None }
    }
}

/// [`Track`] of sixteen pixels of a row, of those whose motion is their surface's.
pub(super) struct Tracks<'a, S: Simd> {
    settings: &'a Stabilise,
    /// Pixels by which motion may miss.
    may_miss: f32x16<S>,
    /// Row of the picture.
    origin: f32,
    /// Rows that the trajectories may lead up or down.
    farthest: f32,
    at: [f32x16<S>; 2],
    /// Of each pixel its [`Front`].
    pixels: [i32; BLOCK],
    inverse_depths: f32x16<S>,
    alive: mask32x16<S>,
}

impl<'a, S: Simd> Tracks<'a, S> {
    /// Of the pixels from column `x` on that are `wanted` (1, else 0). `noise`: as [`may_miss`] takes it.
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        (here, fronts): (&Features, &Fronts),
        (x, y): (usize, usize),
        (wanted, noise): (&[f32; BLOCK], f32x16<S>),
        gather: &Gather,
        settings: &'a Stabilise,
    ) -> Self {
        let (mut columns, mut pixels, mut depths) = ([0.0; BLOCK], [0; BLOCK], [0.0; BLOCK]);
        for i in (0..BLOCK).filter(|i| wanted[*i] > 0.0) {
            let front = fronts.at(here, x + i, y);
            (columns[i], pixels[i], depths[i]) = ((x + i) as f32, front.pixel as i32, front.inverse_depth);
        }
        // A band counts rows as the whole picture does: sums of floats are the same.
        let origin = (here.first_row + y) as f32;
        let noisy = noise * noise_unit(settings);
        Self {
            settings,
            may_miss: noisy * noisy + settings.round_trip,
            origin,
            farthest: gather.travel * here.picture_height as f32,
            at: [columns.simd_into(simd), f32x16::splat(simd, origin)],
            pixels,
            inverse_depths: depths.simd_into(simd),
            alive: f32x16::from_slice(simd, wanted).simd_gt(f32x16::splat(simd, 0.0)),
        }
    }

    /// Goes one frame further, as [`step`] does. `None`: all are lost.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        simd: S,
        from: &Features,
        (to, fronts): (&Features, &Fronts),
        forward: bool,
    ) -> Option<Reached> {
        let (splat, int) = (|v: f32| f32x16::splat(simd, v), |v: usize| i32x16::splat(simd, v as i32));
        let (w, h, s) = (from.size.width, from.picture_height, self.settings);
        let motion = from.motion.get(forward, false).filter(|_| self.alive.any_true())?;
        let m = motion_of(simd, motion, &self.pixels);
        self.at = [self.at[0] + m[0], self.at[1] + m[1]];
        let [x, y] = self.at;
        let (column, row) = (nearest(simd, x), nearest(simd, y));
        let here = row.to_int::<i32x16<S>>() - int(to.first_row);
        // NaN fails too: unknown motion ends the trajectory.
        let inside = x.simd_ge(splat(0.0)) & x.simd_le(splat((w - 1) as f32)) & y.simd_ge(splat(0.0));
        let near = y.simd_le(splat((h - 1) as f32)) & (y - self.origin).abs().simd_le(splat(self.farthest));
        let there = here.simd_ge(int(0)) & here.simd_lt(int(to.size.height));
        let mut alive = self.alive & inside & near & there;
        let place: [i32; BLOCK] = alive.select(here * int(w) + column.to_int::<i32x16<S>>(), int(0)).into();
        let mut depths = [0.0; BLOCK];
        for i in 0..BLOCK {
            let front = fronts.of(to, place[i] as usize);
            (self.pixels[i], depths[i]) = (front.pixel as i32, front.inverse_depth);
        }
        let depths = f32x16::from_slice(simd, &depths);
        alive &= (depths - self.inverse_depths).abs().simd_le(self.inverse_depths * s.depth_change);
        if let Some(back) = to.motion.get(!forward, false) {
            let r = motion_of(simd, back, &self.pixels);
            let length = (m[0] * m[0] + m[1] * m[1]).sqrt();
            let (x, y) = (m[0] + r[0], m[1] + r[1]);
            alive &= (x * x + y * y).sqrt().simd_le(length * s.round_trip_share + self.may_miss);
        }
        (self.inverse_depths, self.alive) = (depths, alive);
        Some(Reached {
            at: [x.into(), y.into()],
            column: column.into(),
            row: row.into(),
            found: alive.select(splat(1.0), splat(0.0)).into(),
        })
    }
}

/// Where [`Tracks`] lead in a frame.
pub(super) struct Reached {
    pub(super) at: [[f32; BLOCK]; 2],
    /// The pixels nearest to it, in the picture.
    pub(super) column: [f32; BLOCK],
    pub(super) row: [f32; BLOCK],
    /// 1 where the trajectory goes on, else 0.
    pub(super) found: [f32; BLOCK],
}

/// The surface nearest to the eye around a pixel: a silhouette moves with it.
struct Front {
    pixel: usize,
    inverse_depth: f32,
}

impl Front {
    #[inline(always)]
    fn same(&self, other: &Self, s: &Stabilise) -> bool {
        (self.inverse_depth - other.inverse_depth).abs() <= s.depth_change * other.inverse_depth
    }
}

/// Where a silhouette lies one frame further, and what is in front there; `None`: it is lost.
#[inline(always)]
fn step(
    from: &Features,
    (to, fronts): (&Features, &Fronts),
    forward: bool,
    reflected: bool,
    at: (f32, f32),
    front: &Front,
    (s, may_miss): (&Stabilise, f32),
) -> Option<((f32, f32), Front)> {
    let (w, h) = (from.size.width, from.picture_height);
    let m = from.motion.get(forward, reflected)?.at(front.pixel);
    let at = (at.0 + m[0], at.1 + m[1]);
    // NaN fails too: unknown motion ends the trajectory.
    if !(at.0 >= 0.0 && at.1 >= 0.0 && at.0 <= (w - 1) as f32 && at.1 <= (h - 1) as f32) {
        return None;
    }
    let there = fronts.at(to, at.0.round() as usize, to.row_here(at.1.round() as isize)?);
    (there.same(front, s) && returns(to, forward, reflected, there.pixel, m, (s, may_miss))).then_some((at, there))
}

fn departs(features: &Features, forward: bool, pixel: usize) -> f32 {
    let at = |reflected: bool| features.motion.get(forward, reflected).map_or([0.0; 2], |m| m.at(pixel));
    let (seen, surface) = (at(true), at(false));
    ((seen[0] - surface[0]).powi(2) + (seen[1] - surface[1]).powi(2)).sqrt()
}

/// True where the motion at `pixel` leads back by `motion`, or is unknown.
#[inline(always)]
fn returns(
    features: &Features,
    forward: bool,
    reflected: bool,
    pixel: usize,
    motion: [f32; 2],
    (s, may_miss): (&Stabilise, f32),
) -> bool {
    let back = features.motion.get(!forward, reflected);
    let Some(back) = back else { return true };
    let r = back.at(pixel);
    let length = (motion[0] * motion[0] + motion[1] * motion[1]).sqrt();
    let miss = ((motion[0] + r[0]).powi(2) + (motion[1] + r[1]).powi(2)).sqrt();
    miss <= may_miss + s.round_trip_share * length
}

/// Of each pixel of a frame the one of the 3x3 around whose surface is nearest to the eye: 0 to 8, row by row. Found once, since many
/// trajectories meet there.
pub(crate) struct Fronts(Plane<u8>);

impl Fronts {
    /// The pixel itself.
    const ITSELF: i32 = 4;

    /// `nearer`: the pixel itself counts where the others are nearer by no more than this factor.
    pub(crate) fn new(features: &Features, nearer: f32) -> Self {
        let (w, h) = (features.size.width, features.size.height);
        // What is no number is not nearer than anything: a pixel more at either end, and room for the last sixteen.
        let depths = Band::filled(&(0..h), w + 2 + BLOCK, 1, |y, out| {
            out.fill(f32::NAN);
            for (out, surface) in out[1..=w].iter_mut().zip(&features.surface[y * w..][..w]) {
                *out = surface.inverse_depth;
            }
        });
        let mut found = Plane::filled(features.size, 0);
        par::rows(found.data_mut(), w, |y, out| {
            let lines = [y.checked_sub(1), Some(y), Some(y + 1).filter(|y| *y < h)];
            let lines = lines.map(|y| y.map(|y| depths.row(y, 0)));
            dispatch!(crate::simd::level(), simd => fronts_row(simd, lines, nearer, out));
        });
        Self(found)
    }

    #[inline(always)]
    fn at(&self, features: &Features, x: usize, y: usize) -> Front {
        self.of(features, y * features.size.width + x)
    }

    #[inline(always)]
    fn of(&self, features: &Features, own: usize) -> Front {
        let w = features.size.width;
        let place = usize::from(self.0.data()[own]);
        let pixel = (own + (place / 3) * w + place % 3) - (w + 1);
        Front { pixel, inverse_depth: features.surface[pixel].inverse_depth }
    }
}

/// A row of [`Fronts`], of the rows above, here and below, as far as there are any.
#[inline(always)]
fn fronts_row<S: Simd>(simd: S, lines: [Option<&[f32]>; 3], nearer: f32, out: &mut [u8]) {
    let mut x = 0;
    for out in out.chunks_mut(BLOCK) {
        let own = lines[1].unwrap_or_default();
        let mut best = load::<false, _>(simd, own, x as isize + 1);
        let mut place = i32x16::splat(simd, Fronts::ITSELF);
        for dy in 0..3 {
            let Some(line) = lines[dy] else { continue };
            for dx in 0..3 {
                let other: f32x16<S> = load::<false, _>(simd, line, (x + dx) as isize);
                let front = other.simd_gt(best * nearer);
                best = front.select(other, best);
                place = front.select(i32x16::splat(simd, (3 * dy + dx) as i32), place);
            }
        }
        let place: [i32; BLOCK] = place.into();
        for (out, place) in out.iter_mut().zip(place) {
            *out = place as u8;
        }
        x += BLOCK;
    }
}

/// Guide and tolerance between pixels; beyond the border the border counts.
fn linear(f: &Features, (x, y): (f32, f32), likeness: &Likeness) -> (Rgb, f32) {
    let (fx, fy) = (x.floor(), y.floor());
    let column = |i: usize| (fx as usize + i).min(f.size.width - 1);
    let row = |j: usize| (fy as usize + j).min(f.picture_height - 1).saturating_sub(f.first_row).min(f.size.height - 1);
    let (tx, ty) = (x - fx, y - fy);
    let mut sum = ([0.0f32; 3], 0.0f32);
    for (j, v) in [1.0 - ty, ty].into_iter().enumerate() {
        for (i, u) in [1.0 - tx, tx].into_iter().enumerate() {
            let (at, share) = ((column(i), row(j)), u * v);
            let guide = likeness.guide.at(at.0, at.1);
            for c in 0..3 {
                sum.0[c] += share * guide[c];
            }
            sum.1 += share * likeness.tolerance.at(at.0, at.1);
        }
    }
    sum
}

/// Catmull-Rom's sixteen taps; beyond the border the border counts.
struct CubicTaps {
    x: [usize; 4],
    y: [usize; 4],
    weights: [[f32; 4]; 2],
    width: usize,
}

impl CubicTaps {
    fn new(features: &Features, (x, y): (f32, f32)) -> Self {
        let place = |v: f32, limit: usize| {
            [0isize, 1, 2, 3].map(|i| (v.floor() as isize + i - 1).clamp(0, limit as isize - 1) as usize)
        };
        let last = features.size.height.saturating_sub(1);
        Self {
            x: place(x, features.size.width),
            y: place(y, features.picture_height).map(|row| row.saturating_sub(features.first_row).min(last)),
            weights: [catmull_rom(x - x.floor()), catmull_rom(y - y.floor())],
            width: features.size.width,
        }
    }

    fn fetch(&self, at: impl Fn(usize) -> Rgb) -> Rgb {
        let mut sum = [0.0; 3];
        for (j, y) in self.y.iter().enumerate() {
            for (i, x) in self.x.iter().enumerate() {
                let weight = self.weights[0][i] * self.weights[1][j];
                let c = at(y * self.width + x);
                for k in 0..3 {
                    sum[k] += weight * c[k];
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Size;
    use crate::sequence::SequenceSettings;

    /// Also of bands that begin elsewhere in the two frames, with motion that leads out of the picture or is unknown, and surfaces that hide others.
    #[test]
    fn sixteen_trajectories_are_those_of_one() {
        let (size, settings) = (Size::new(37, 21), SequenceSettings::default());
        let frames: Vec<_> = (0..2)
            .map(|t| {
                let mut frame = crate::sequence::testing::frame(t, size);
                let motion = |sign: f32| {
                    let of = |i: usize, motion: f32| match i % 41 {
                        5 => f32::NAN,
                        7 => 9.0,
                        i => sign * (motion + 0.4 * (i * i % 7) as f32),
                    };
                    Some(Plane::from_fn(size, |x, y| [of(x + 5 * y, 1.3), of(3 * x + y, -0.6)]))
                };
                (frame.motion_to_next, frame.motion_to_previous) = (motion(1.0), motion(-1.0));
                let mut features = Features::new(&frame, &settings);
                (features.first_row, features.picture_height) = (3 * t as usize, 26);
                for (i, surface) in features.surface.iter_mut().enumerate() {
                    surface.inverse_depth = [1.0, 1.01, 1.02, 1.4, 0.0][i / 50 % 5];
                }
                let fronts = Fronts::new(&features, 1.1);
                (features, fronts)
            })
            .collect();
        let (gather, s) = (&settings.gather, &settings.stabilise);
        let mut met = [0; 2];
        crate::simd::dispatch!(crate::simd::level(), simd => {
            for (x, y) in [(0, 0), (16, 3), (21, 9), (21, 20), (4, 12)] {
                let mut wanted = [1.0; BLOCK];
                wanted[3] = 0.0;
                let (here, there) = (&frames[0], &frames[1]);
                let noise: [f32; BLOCK] = std::array::from_fn(|i| 0.1 * (i % 5) as f32);
                let noises = f32x16::from_slice(simd, &noise);
                let mut tracks = Tracks::new(simd, (&here.0, &here.1), (x, y), (&wanted, noises), gather, s);
                let mut one: Vec<_> =
                    (0..BLOCK).map(|i| Some(Track::new((&here.0, &here.1), (x + i, y), noise[i], gather, s))).collect();
                one[3] = None;
                for k in 0..3 {
                    let (from, to, forward) = if k % 2 == 0 { (here, there, true) } else { (there, here, false) };
                    let found = tracks.step(simd, &from.0, (&to.0, &to.1), forward);
                    for (i, track) in one.iter_mut().enumerate() {
                        let goes_on = track.as_mut().and_then(|t| t.step(&from.0, (&to.0, &to.1), forward)).is_some();
                        assert_eq!(goes_on, found.as_ref().is_some_and(|found| found.found[i] > 0.0), "{x} {y} {i} {k}");
                        met[usize::from(goes_on)] += 1;
                        let Some(Track { at, .. }) = track.as_ref().filter(|_| goes_on) else {
                            *track = None;
                            continue;
                        };
                        let found = found.as_ref().unwrap();
                        assert_eq!(*at, (found.at[0][i], found.at[1][i]));
                        assert_eq!((at.0.round(), at.1.round()), (found.column[i], found.row[i]));
                    }
                }
            }
        });
        assert!(met.iter().all(|n| *n > 40), "{met:?}");
    }

    /// Also at the borders, with several surfaces before each other, and with depths that are no numbers.
    #[test]
    fn fronts_are_those_of_the_definition() {
        let size = Size::new(37, 21);
        let frame = crate::sequence::testing::frame(0, size);
        let mut features = Features::new(&frame, &SequenceSettings::default());
        for (i, surface) in features.surface.iter_mut().enumerate() {
            surface.inverse_depth = [1.0, 1.05, 1.3, 0.0, f32::NAN, 1.7, 2.5][i * i % 31 % 7];
        }
        let fronts = Fronts::new(&features, 1.1);
        for (x, y) in (0..21).flat_map(|y| (0..37).map(move |x| (x, y))) {
            let expected = crate::stages::stabilise::reference::front(&features, x, y, 1.1);
            assert_eq!(fronts.at(&features, x, y).pixel, expected, "{x} {y}");
        }
    }
}
