//! Where the surfaces of eight pixels of a row lie in the other frames of the window, and which of their pixels show them.

use super::LANES;
use super::seen::{Eight, Seen};
use crate::kernels::motion_cpu::motion_of_eight;
use crate::sequence::settings::Gather;
use crate::window::{Features, Motion, PreparedFrame, SurfacePoint};
use fearless_simd::{Simd, f32x8, i32x8, mask32x8, prelude::*};

/// The pixels of a frame that show the surfaces of eight pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Met {
    /// Indices of the pixels; 0 where the weight is 0.
    pub pixels: [i32; LANES],
    /// Trust in the surface, 0..1; 0: none shows it.
    pub weights: [f32; LANES],
    /// How alike the things are that mirrors and glass show, 0..1.
    pub alike: [f32; LANES],
}

/// Two neighbouring frames of a window.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    pub from: &'a PreparedFrame,
    pub to: &'a PreparedFrame,
    pub forward: bool,
    /// What mirrors show is followed, not their surface.
    pub reflected: bool,
}

/// The way of the surfaces of eight pixels through the frames of a window, frame by frame.
pub(super) struct Way<S: Simd> {
    origin: [f32x8<S>; 2],
    at: [f32x8<S>; 2],
    alive: mask32x8<S>,
    /// Nearest pixels of the frame that was reached.
    nearest: [i32; LANES],
    tracked: Points<S>,
}

impl<S: Simd> Way<S> {
    /// Of the pixels from `first` on that are `wanted`; all lie in one row.
    #[inline(always)]
    pub(super) fn new(simd: S, here: &Features, first: usize, wanted: &[bool; LANES]) -> Self {
        let w = here.size.width;
        let (mut nearest, mut columns, mut alive) = ([0i32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        for i in 0..LANES {
            if wanted[i] {
                nearest[i] = (first + i) as i32;
                columns[i] = (first % w + i) as f32;
                alive[i] = 1.0;
            }
        }
        let row = f32x8::splat(simd, (here.first_row + first / w) as f32);
        let origin: [f32x8<S>; 2] = [columns.simd_into(simd), row];
        let alive: f32x8<S> = alive.simd_into(simd);
        let alive = alive.simd_gt(f32x8::splat(simd, 0.0));
        Self { origin, at: origin, alive, nearest, tracked: Points::load(simd, &here.surface, &nearest) }
    }

    /// True where some of the pixels are still followed.
    #[inline(always)]
    pub(super) fn goes_on(&self) -> bool {
        self.alive.any_true()
    }

    /// One frame further; the pixels there that show the surfaces. `shown`: what the eight pixels show in mirrors and through glass, and the
    /// frame, where that is compared.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        simd: S,
        pair: Pair<'_>,
        shown: Option<(&Eight, Seen<'_>)>,
        gather: &Gather,
        met: &mut Met,
    ) {
        let splat = |v: f32| f32x8::splat(simd, v);
        let int = |v: usize| i32x8::splat(simd, v as i32);
        let zero = splat(0.0);
        *met = Met::default();
        let Pair { from, to: member, forward, reflected } = pair;
        let (origin, tracked) = (&self.origin, &self.tracked);
        // A band counts rows as the whole picture does: sums of floats are the same.
        let (w, h) = (from.features.size.width, from.features.picture_height);
        let farthest = splat(gather.travel * h as f32);
        let Some(motion) = from.features.motion.get(forward, reflected) else {
            self.alive = zero.simd_lt(zero);
            return;
        };
        let m = motion_of_eight(simd, motion, &self.nearest);
        let at = [self.at[0] + m[0], self.at[1] + m[1]];
        // NaN fails too: unknown motion ends the trajectory.
        let alive = self.alive
            & at[0].simd_gt(splat(-0.5))
            & at[1].simd_gt(splat(-0.5))
            & at[0].simd_lt(splat(w as f32 - 0.5))
            & at[1].simd_lt(splat(h as f32 - 0.5))
            & !(at[1] - origin[1]).abs().simd_gt(farthest);
        if !alive.any_true() {
            self.alive = alive;
            return;
        }
        let mut counts = alive;
        if from.repeats_noise || member.repeats_noise {
            let same = splat(gather.same_noise);
            counts = alive & !((at[0] - origin[0]).abs().simd_lt(same) & (at[1] - origin[1]).abs().simd_lt(same));
        }
        let step = Step {
            pixel_size: tracked
                .inverse_depth
                .simd_gt(zero)
                .select(splat(member.features.pixel_angle) / tracked.inverse_depth, zero),
            back: member.features.motion.get(!forward, reflected),
            motion: m,
        };
        let corner = [at[0].floor(), at[1].floor()];
        let (tx, ty) = (at[0] - corner[0], at[1] - corner[1]);
        let (ux, uy) = (splat(1.0) - tx, splat(1.0) - ty);
        let (left, top) = (corner[0].to_int::<i32x8<S>>(), corner[1].to_int::<i32x8<S>>());
        // Of the four pixels around, the nearest that shows the surface: the one with the largest bilinear share. Mostly that is the
        // nearest of all, and the others are not asked.
        let (right, below) = (tx.simd_gt(splat(0.5)), ty.simd_gt(splat(0.5)));
        let (near_x, far_x) = (right.select(tx, ux), right.select(ux, tx));
        let (near_y, far_y) = (below.select(ty, uy), below.select(uy, ty));
        let across_first = (far_x * near_y).simd_ge(near_x * far_y);
        let never = zero.simd_lt(zero);
        let candidates =
            [(never, never), (across_first, !across_first), (!across_first, across_first), (!never, !never)];
        let (mut place, mut weight, mut likeness) = (int(0), zero, splat(1.0));
        let ranked = shown.filter(|_| reflected);
        let (mut found, mut pending) = (never, alive);
        // The surfaces that were found.
        let mut now = Points::none(simd);
        for (other_x, other_y) in candidates {
            let share = other_x.select(far_x, near_x) * other_y.select(far_y, near_y);
            let (dx, dy) = (right ^ other_x, below ^ other_y);
            let (x, row) =
                (left + dx.select(int(1), int(0)), top + dy.select(int(1), int(0)) - int(member.features.first_row));
            let valid = pending
                & share.simd_gt(zero)
                & share.simd_ge(splat(gather.least_share))
                & x.simd_ge(int(0))
                & x.simd_lt(int(w))
                & row.simd_ge(int(0))
                & row.simd_lt(int(member.features.size.height));
            if !valid.any_true() {
                continue;
            }
            let q = valid.select(row * int(w) + x, int(0));
            let places: [i32; LANES] = q.into();
            let there = Points::load(simd, &member.features.surface, &places);
            let (same, trust) = step.same_surface(simd, &there, tracked, &places, gather);
            let same = valid & same;
            // One that shows the same in a mirror takes the place of one that is nearer.
            let shows = match ranked {
                Some((own, seen)) => own.likeness(simd, gather, seen, &places),
                None => splat(1.0),
            };
            let alike = shows.simd_ge(splat(gather.seen_alike));
            let taken = same & (alike | !found);
            likeness = taken.select(shows, likeness);
            place = taken.select(q, place);
            weight = taken.select(trust, weight);
            now = now.unless(!taken, &there);
            found |= same;
            pending &= !(same & alike);
            if !pending.any_true() {
                break;
            }
        }
        met.pixels = place.into();
        if let (Some((own, seen)), None) = (shown, ranked) {
            likeness = own.likeness(simd, gather, seen, &met.pixels);
        }
        met.alike = likeness.into();
        met.weights = counts.select(weight, zero).into();
        self.at = at;
        self.alive = alive & found;
        self.nearest = met.pixels;
        // A surface that moves carries its reference along; one that stands keeps the first, so that errors do not add.
        let stands =
            step.pixel_size.simd_gt(zero) & now.off_plane(tracked).simd_lt(step.pixel_size * gather.plane_distance);
        self.tracked = tracked.unless(stands, &now);
    }
}

/// The surfaces that eight pixels show.
struct Points<S: Simd> {
    inverse_depth: f32x8<S>,
    normal: [f32x8<S>; 3],
    position: [f32x8<S>; 3],
}

impl<S: Simd> Points<S> {
    #[inline(always)]
    fn none(simd: S) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        Self { inverse_depth: zero, normal: [zero; 3], position: [zero; 3] }
    }

    #[inline(always)]
    fn load(simd: S, surface: &[SurfacePoint], places: &[i32; LANES]) -> Self {
        let mut v = [[0.0f32; LANES]; 7];
        for i in 0..LANES {
            let SurfacePoint { inverse_depth, normal, position } = &surface[places[i] as usize];
            v[0][i] = *inverse_depth;
            (v[1][i], v[2][i], v[3][i]) = (normal[0], normal[1], normal[2]);
            (v[4][i], v[5][i], v[6][i]) = (position[0], position[1], position[2]);
        }
        Self {
            inverse_depth: v[0].simd_into(simd),
            normal: [v[1].simd_into(simd), v[2].simd_into(simd), v[3].simd_into(simd)],
            position: [v[4].simd_into(simd), v[5].simd_into(simd), v[6].simd_into(simd)],
        }
    }

    /// These where `keep`, else `other`.
    #[inline(always)]
    fn unless(&self, keep: mask32x8<S>, other: &Self) -> Self {
        let (n, p) = (&self.normal, &self.position);
        let (m, q) = (&other.normal, &other.position);
        Self {
            inverse_depth: keep.select(self.inverse_depth, other.inverse_depth),
            normal: [keep.select(n[0], m[0]), keep.select(n[1], m[1]), keep.select(n[2], m[2])],
            position: [keep.select(p[0], q[0]), keep.select(p[1], q[1]), keep.select(p[2], q[2])],
        }
    }

    #[inline(always)]
    fn difference(&self, other: &Self) -> [f32x8<S>; 3] {
        let (a, b) = (&self.position, &other.position);
        [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
    }

    /// Distance from the tangent planes of `reference`.
    #[inline(always)]
    fn off_plane(&self, reference: &Self) -> f32x8<S> {
        dot(&self.difference(reference), &reference.normal).abs()
    }
}

#[inline(always)]
fn dot<S: Simd>(a: &[f32x8<S>; 3], b: &[f32x8<S>; 3]) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// What one step along the trajectories knows.
struct Step<'a, S: Simd> {
    /// World-space size of a pixel at the surface; 0: unknown.
    pixel_size: f32x8<S>,
    /// Motion back again, where it is known.
    back: Option<Motion<'a>>,
    motion: [f32x8<S>; 2],
}

impl<S: Simd> Step<'_, S> {
    /// Which pixels of another frame are believed to show the tracked surface, and how far.
    #[inline(always)]
    fn same_surface(
        &self,
        simd: S,
        s: &Points<S>,
        tracked: &Points<S>,
        places: &[i32; LANES],
        gather: &Gather,
    ) -> (mask32x8<S>, f32x8<S>) {
        let splat = |v: f32| f32x8::splat(simd, v);
        let (zero, one) = (splat(0.0), splat(1.0));
        let solid = tracked.inverse_depth.simd_gt(zero);
        let alike = !(s.inverse_depth.simd_gt(zero) ^ solid);
        let no_normals = (s.normal[0].simd_eq(zero) & s.normal[1].simd_eq(zero) & s.normal[2].simd_eq(zero))
            & (tracked.normal[0].simd_eq(zero) & tracked.normal[1].simd_eq(zero) & tracked.normal[2].simd_eq(zero));
        let cosine = no_normals.select(one, dot(&s.normal, &tracked.normal));
        let size = self.pixel_size;
        let (off, d) = (s.off_plane(tracked), s.difference(tracked));
        let reach = size.max(off) * gather.standing_reach;
        let near = dot(&d, &d).simd_lt(reach * reach) | cosine.simd_gt(splat(gather.plane_normal));
        let stands = size.simd_gt(zero) & off.simd_lt(size * gather.plane_distance) & near;
        // It moves, or positions are unknown: the surface there must come from here.
        let change = (s.inverse_depth / tracked.inverse_depth - one).abs();
        let change = solid.select(change, zero);
        let mut moves =
            change.simd_le(splat(gather.moving_depth)) & cosine.simd_ge(splat(gather.moving_normal)) & !stands;
        if let (Some(back), true) = (self.back, moves.any_true()) {
            let (m, r) = (&self.motion, motion_of_eight(simd, back, places));
            let length = (m[0] * m[0] + m[1] * m[1]).sqrt();
            let (x, y) = (m[0] + r[0], m[1] + r[1]);
            let miss = (x * x + y * y).sqrt();
            // NaN is no agreement.
            moves &= miss.simd_le(length * gather.round_trip_share + gather.round_trip);
        }
        let same = alike & (moves | (stands & cosine.simd_ge(splat(gather.standing_normal))));
        (same, stands.select(one, splat(gather.moving_weight)))
    }
}
