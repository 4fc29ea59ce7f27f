//! Reprojection (`reproject.rs`) on runs of pixels: arithmetic lane by lane, in the reference's order of operations, so
//! that both find the same places to the bit. Previous pixels lie anywhere: they are collected one by one.

use super::math::three;
use super::reproject::LEAST_FOOTPRINT;
use crate::camera::Projection;
use crate::kernels::spiral::PERIOD;
use crate::phased::guides::{CpuGuides, Surfaces, field};
use crate::phased::layout::copy;
use crate::settings::{Rejection, Settings, SurfaceSettings};
use glam::{Vec2, Vec3};

/// Pixels that are looked up together.
pub(crate) const LANES: usize = 64;
/// One value for each of them.
pub(crate) type Lanes = [f32; LANES];
/// The same of a vector.
pub(crate) type Lanes3 = [Lanes; 3];

/// The pixels of a run, what they show, and what history must show there.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Expected {
    /// Lanes that hold a pixel.
    pub n: usize,
    /// Columns.
    pub x: Lanes,
    /// The row.
    pub y: usize,
    pub depth: Lanes,
    pub normal: Lanes3,
    pub roughness: Lanes,
    pub id: [u32; LANES],
    motion: [Lanes; 2],
    /// World position now.
    pub position: Lanes3,
    /// Place in the previous image.
    pub coordinate: [Lanes; 2],
    /// A point of the surface and its normal at the previous frame's time.
    pub was_at: Lanes3,
    pub was_facing: Lanes3,
    /// 1: there may be history.
    pub alive: [u32; LANES],
    /// 1: it moved by itself.
    pub moved: [u32; LANES],
    /// 1: its previous pixels have different normals, as [`previous_reflectors`] finds.
    pub bent: [u32; LANES],
}

impl Expected {
    pub fn new() -> Self {
        Self {
            n: 0,
            x: [0.0; LANES],
            y: 0,
            depth: [f32::INFINITY; LANES],
            normal: [[0.0; LANES]; 3],
            roughness: [0.0; LANES],
            id: [0; LANES],
            motion: [[0.0; LANES]; 2],
            position: [[0.0; LANES]; 3],
            coordinate: [[0.0; LANES]; 2],
            was_at: [[0.0; LANES]; 3],
            was_facing: [[0.0; LANES]; 3],
            alive: [0; LANES],
            moved: [0; LANES],
            bent: [0; LANES],
        }
    }

    /// Matte light: for the `n` pixels of row `y` from element `begin` on, the first in column `x`, every
    /// `stride`-th column.
    #[inline(always)]
    pub fn find(
        &mut self,
        guides: &CpuGuides,
        settings: &SurfaceSettings,
        (y, begin, n): (usize, usize, usize),
        (x, stride): (usize, usize),
    ) {
        let size = guides.phases.size;
        let width = size.width;
        let now = &guides.now;
        self.n = n;
        self.y = y;
        self.depth = [f32::INFINITY; LANES];
        copy::<LANES, _>(&mut self.depth[..n], &field(&now.depth, width, 1, y, 0)[begin..][..n]);
        for c in 0..3 {
            copy::<LANES, _>(&mut self.normal[c][..n], &field(&now.normal, width, 3, y, c)[begin..][..n]);
        }
        for c in 0..2 {
            copy::<LANES, _>(&mut self.motion[c][..n], &field(&guides.motion, width, 2, y, c)[begin..][..n]);
        }
        copy::<LANES, _>(&mut self.roughness[..n], &field(&now.roughness, width, 1, y, 0)[begin..][..n]);
        copy::<LANES, _>(&mut self.id[..n], &field(&now.id, width, 1, y, 0)[begin..][..n]);
        let row = y as f32 + 0.5;
        let v = row + now.jitter.y;
        let (view, previous) = (&now.view, &guides.previous_view);
        let guard = settings.guard_band;
        let (right, bottom) = (width as f32 - guard, size.height as f32 - guard);
        for i in 0..LANES {
            self.x[i] = (x + stride * i) as f32;
            let column = self.x[i] + 0.5;
            let u = column + now.jitter.x;
            let z = self.depth[i];
            let (mx, my) = (self.motion[0][i], self.motion[1][i]);
            let position = world(view, u, v, z);
            let (cx, cy) = (column + mx, row + my);
            let on_screen = (cx >= guard) & (cy >= guard) & (cx <= right) & (cy <= bottom);
            let alive = (z < f32::INFINITY) & !mx.is_nan() & !my.is_nan() & on_screen;
            let (px, py, ahead) = pixel(previous, position, 1.0);
            let (ex, ey) = (px - u - mx, py - v - my);
            let moved = !ahead | ((ex * ex + ey * ey).sqrt() > settings.static_motion);
            for c in 0..3 {
                self.position[c][i] = position[c];
                self.was_at[c][i] = position[c];
                self.was_facing[c][i] = self.normal[c][i];
            }
            self.coordinate[0][i] = cx;
            self.coordinate[1][i] = cy;
            self.alive[i] = u32::from(alive);
            self.moved[i] = u32::from(alive & moved);
        }
        for i in 0..n {
            if self.moved[i] != 0 {
                self.anchor(guides, settings, i);
            }
        }
    }

    /// What [`Expected::find`] finds of pixels that are known not to have moved by themselves, but for their place in
    /// the previous image.
    #[inline(always)]
    pub fn rest(&mut self, guides: &CpuGuides, (y, begin, n): (usize, usize, usize), (x, stride): (usize, usize)) {
        let width = guides.phases.size.width;
        let now = &guides.now;
        self.n = n;
        self.y = y;
        self.depth = [f32::INFINITY; LANES];
        copy::<LANES, _>(&mut self.depth[..n], &field(&now.depth, width, 1, y, 0)[begin..][..n]);
        for c in 0..3 {
            copy::<LANES, _>(&mut self.normal[c][..n], &field(&now.normal, width, 3, y, c)[begin..][..n]);
        }
        copy::<LANES, _>(&mut self.roughness[..n], &field(&now.roughness, width, 1, y, 0)[begin..][..n]);
        copy::<LANES, _>(&mut self.id[..n], &field(&now.id, width, 1, y, 0)[begin..][..n]);
        let v = y as f32 + 0.5 + now.jitter.y;
        for i in 0..LANES {
            self.x[i] = (x + stride * i) as f32;
            let u = self.x[i] + 0.5 + now.jitter.x;
            let position = world(&now.view, u, v, self.depth[i]);
            for c in 0..3 {
                self.position[c][i] = position[c];
                self.was_at[c][i] = position[c];
            }
        }
        self.was_facing = self.normal;
        self.moved = [0; LANES];
        self.bent = [0; LANES];
    }

    /// Motion gives the pixel but not the depth: the nearest previous pixel of the same object anchors the plane.
    #[inline(never)]
    fn anchor(&mut self, guides: &CpuGuides, settings: &SurfaceSettings, i: usize) {
        let before = &guides.before;
        let corner = Vec2::new(self.coordinate[0][i], self.coordinate[1][i]) - 0.5;
        let base = corner.floor();
        let t = corner - base;
        let mut nearest: Option<(f32, usize, usize, usize)> = None;
        for k in 0..4 {
            let (x, y) = (base.x as isize + (k & 1), base.y as isize + (k >> 1));
            if !guides.phases.size.contains(x, y) {
                continue;
            }
            let weight = (if k & 1 == 0 { 1.0 - t.x } else { t.x }) * (if k >> 1 == 0 { 1.0 - t.y } else { t.y });
            let (x, y) = (x as usize, y as usize);
            let e = guides.phases.index(x, y);
            let known = before.depth[e].is_finite() && before.id[e] == self.id[i];
            if known && nearest.is_none_or(|best| weight.total_cmp(&best.0).is_ge()) {
                nearest = Some((weight, e, x, y));
            }
        }
        let Some((_, e, x, y)) = nearest else {
            self.alive[i] = 0;
            return;
        };
        let anchor = before.view.world(crate::border::sample_position(x, y, before.jitter), before.depth[e]);
        let position = Vec3::from(three(|c| self.position[c][i]));
        let previous = &guides.previous_view;
        let travelled = (previous.view_depth(anchor) - previous.view_depth(position)).abs();
        if travelled > settings.moving_depth * self.depth[i] {
            self.alive[i] = 0;
            return;
        }
        let width = guides.phases.size.width;
        let normal = normal_at(before, width, y, e - y * width);
        for c in 0..3 {
            self.was_at[c][i] = anchor[c];
            self.was_facing[c][i] = normal[c];
        }
    }
}

#[inline(always)]
fn normal_at(surfaces: &Surfaces, width: usize, y: usize, element: usize) -> [f32; 3] {
    three(|c| surfaces.normal[(3 * y + c) * width + element])
}

/// [`Projection::world`].
#[inline(always)]
fn world(view: &Projection, u: f32, v: f32, depth: f32) -> [f32; 3] {
    let axis = |a: &[Vec3; 3], c: usize| a[0][c] + a[1][c] * u + a[2][c] * v;
    // All rays of a perspective camera come from one point: its other terms are zero.
    let origin = three(|c| if view.perspective { view.origin[0][c] } else { axis(&view.origin, c) });
    three(|c| origin[c] + axis(&view.direction, c) * depth)
}

/// [`Projection::pixel`] of a point (`w` = 1), [`Projection::pixel_of_direction`] (`w` = 0); false: behind the eye.
#[inline(always)]
pub(super) fn pixel(view: &Projection, point: [f32; 3], w: f64) -> (f32, f32, bool) {
    let (x, y, z) = (f64::from(point[0]), f64::from(point[1]), f64::from(point[2]));
    let (ru, rv, rw) = (&view.u, &view.v, &view.w);
    let pu = ru.0.x * x + ru.0.y * y + ru.0.z * z + ru.1 * w;
    let pv = rv.0.x * x + rv.0.y * y + rv.0.z * z + rv.1 * w;
    let pw = rw.0.x * x + rw.0.y * y + rw.0.z * z + rw.1 * w;
    ((pu / pw) as f32, (pv / pw) as f32, pw > 0.0)
}

#[inline(always)]
pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn lane(v: &Lanes3, i: usize) -> [f32; 3] {
    [v[0][i], v[1][i], v[2][i]]
}

/// Where a pixel of the previous image is stored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneTap {
    /// Element of a row in phase order.
    pub element: [u32; LANES],
    pub row: [u32; LANES],
}

impl Default for LaneTap {
    fn default() -> Self {
        Self { element: [0; LANES], row: [0; LANES] }
    }
}

/// `smoothstep` without branches.
#[inline(always)]
fn step(low: f32, high: f32, x: f32) -> f32 {
    let t = (x - low) / (high - low);
    let t = if t > 0.0 { t } else { 0.0 };
    let t = if t < 1.0 { t } else { 1.0 };
    let smooth = t * t * (3.0 - 2.0 * t);
    let hard = if x < low { 0.0 } else { 1.0 };
    if high <= low { hard } else { smooth }
}

/// Lanes whose footprints lie side by side in memory, all four pixels inside the image: they are read as runs. Where
/// motion is smooth, that is nearly all of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segments {
    /// First lane and number of lanes.
    pub runs: [(usize, usize); LANES],
    pub count: usize,
    /// 1: in no run, to be read by itself.
    pub single: [u32; LANES],
}

impl Segments {
    pub fn new() -> Self {
        Self { runs: [(0, 0); LANES], count: 0, single: [0; LANES] }
    }

    /// Shorter ones cost more than single lanes.
    const SHORTEST: usize = 4;

    /// Finds the runs among living lanes of a phase; `base`: column and row of the first of the four pixels.
    #[inline(always)]
    pub fn find(&mut self, base: &[[i32; LANES]; 2], alive: &[u32; LANES], width: i32, height: i32) {
        self.count = 0;
        self.single = *alive;
        let mut joins = [0u32; LANES];
        let mut inside = [0u32; LANES];
        for i in 0..LANES {
            let (x, y) = (base[0][i], base[1][i]);
            inside[i] = u32::from((x >= 0) & (y >= 0) & (x < width - 1) & (y < height - 1)) & alive[i];
        }
        for i in 1..LANES {
            let beside = (base[0][i] == base[0][i - 1] + PERIOD as i32) & (base[1][i] == base[1][i - 1]);
            joins[i] = u32::from(beside) & inside[i] & inside[i - 1];
        }
        let mut i = 0;
        while i < LANES {
            let first = i;
            i += 1;
            while i < LANES && joins[i] != 0 {
                i += 1;
            }
            if i - first >= Self::SHORTEST {
                self.runs[self.count] = (first, i - first);
                self.count += 1;
                self.single[first..i].fill(0);
            }
        }
    }
}

/// The four pixels of each lane's footprint: where they are and what they show.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Footprint {
    pub segments: Segments,
    weight: [Lanes; 4],
    pub(super) column: [Lanes; 4],
    pub(super) row: [Lanes; 4],
    pub place: [LaneTap; 4],
    depth: [Lanes; 4],
    /// World positions, as the last lookup found them.
    pub(super) position: [Lanes3; 4],
    pub(super) normal: [Lanes3; 4],
    roughness: [Lanes; 4],
    id: [[u32; LANES]; 4],
}

/// Up to four pixels of the previous image for each lane, with weights that add up to 1, and how far they are to be
/// trusted.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Lookup {
    /// Weights of the footprint's pixels; 0 for those that show something else.
    pub weight: [Lanes; 4],
    /// rho, 0..1; 0: there is no history.
    pub trust: Lanes,
}

impl Lookup {
    pub fn new() -> Self {
        Self { weight: [[0.0; LANES]; 4], trust: [0.0; LANES] }
    }
}

impl Footprint {
    pub fn new() -> Self {
        Self {
            segments: Segments::new(),
            weight: [[0.0; LANES]; 4],
            column: [[0.0; LANES]; 4],
            row: [[0.0; LANES]; 4],
            place: [LaneTap::default(); 4],
            depth: [[f32::INFINITY; LANES]; 4],
            position: [[[0.0; LANES]; 3]; 4],
            normal: [[[0.0; LANES]; 3]; 4],
            roughness: [[0.0; LANES]; 4],
            id: [[0; LANES]; 4],
        }
    }

    /// Collects what the previous image shows around `coordinate`, for the lanes that are alive.
    #[inline(always)]
    pub fn collect(&mut self, guides: &CpuGuides, coordinate: &[Lanes; 2], alive: &[u32; LANES], roughness: bool) {
        let (size, before) = (guides.phases.size, &guides.before);
        let mut base = [[0i32; LANES]; 2];
        for i in 0..LANES {
            // Dead lanes may hold anything.
            let cx = if alive[i] != 0 { coordinate[0][i] } else { 0.0 } - 0.5;
            let cy = if alive[i] != 0 { coordinate[1][i] } else { 0.0 } - 0.5;
            let (bx, by) = (cx.floor(), cy.floor());
            let (tx, ty) = (cx - bx, cy - by);
            base[0][i] = bx as i32;
            base[1][i] = by as i32;
            for k in 0..4 {
                let wx = if k & 1 == 0 { 1.0 - tx } else { tx };
                let wy = if k >> 1 == 0 { 1.0 - ty } else { ty };
                self.weight[k][i] = wx * wy;
                self.column[k][i] = bx + (k & 1) as f32;
                self.row[k][i] = by + (k >> 1) as f32;
            }
        }
        let width = size.width;
        self.segments.find(&base, alive, width as i32, size.height as i32);
        self.depth = [[f32::INFINITY; LANES]; 4];
        for k in 0..4 {
            let (right, down) = ((k & 1) as i32, (k >> 1) as i32);
            for &(first, n) in &self.segments.runs[..self.segments.count] {
                let (x, y) = ((base[0][first] + right) as usize, (base[1][first] + down) as usize);
                let element = guides.phases.element(x);
                self.place[k].element[first] = element as u32;
                self.place[k].row[first] = y as u32;
                copy::<LANES, _>(
                    &mut self.depth[k][first..][..n],
                    &field(&before.depth, width, 1, y, 0)[element..][..n],
                );
                copy::<LANES, _>(&mut self.id[k][first..][..n], &field(&before.id, width, 1, y, 0)[element..][..n]);
                for c in 0..3 {
                    let source = &field(&before.normal, width, 3, y, c)[element..][..n];
                    copy::<LANES, _>(&mut self.normal[k][c][first..][..n], source);
                }
                if roughness {
                    let source = &field(&before.roughness, width, 1, y, 0)[element..][..n];
                    copy::<LANES, _>(&mut self.roughness[k][first..][..n], source);
                }
            }
        }
        for i in 0..LANES {
            if self.segments.single[i] == 0 {
                continue;
            }
            for k in 0..4 {
                let (x, y) = (base[0][i] + (k & 1) as i32, base[1][i] + (k >> 1) as i32);
                if x < 0 || y < 0 || x as usize >= width || y as usize >= size.height {
                    continue;
                }
                let (x, y) = (x as usize, y as usize);
                let element = guides.phases.element(x);
                let index = y * width + element;
                self.place[k].element[i] = element as u32;
                self.place[k].row[i] = y as u32;
                self.depth[k][i] = before.depth[index];
                self.id[k][i] = before.id[index];
                let normal = normal_at(before, width, y, element);
                for c in 0..3 {
                    self.normal[k][c][i] = normal[c];
                }
                if roughness {
                    self.roughness[k][i] = before.roughness[index];
                }
            }
        }
    }

    /// Each of the four pixels tested singly. `reflector`: the pixel must show the same reflector.
    #[inline(always)]
    pub fn look_up(
        &mut self,
        guides: &CpuGuides,
        settings: &Settings,
        e: &Expected,
        reflector: bool,
        found: &mut Lookup,
    ) {
        let (surface, glossy) = (&settings.surface, &settings.glossy_temporal);
        let least_cosine = if reflector { glossy.reflector_normal_min } else { surface.normal_min };
        // Never by point distance on a reflector: there the previous surface is another point of the mirror.
        let rejection = match surface.rejection {
            Rejection::Off => Rejection::Off,
            Rejection::Point if !reflector => Rejection::Point,
            Rejection::Point | Rejection::Plane => Rejection::Plane,
        };
        let before = &guides.before;
        let mut total = [0.0; LANES];
        let mut trusted = [0.0; LANES];
        let (least_difference, near) = match rejection {
            Rejection::Point => (0.0, surface.point_distance),
            _ => (surface.pixel_distance, surface.plane_distance),
        };
        let no_rejection = rejection == Rejection::Off;
        let by_point = rejection == Rejection::Point;
        let roughness_limit = if reflector { glossy.reflector_roughness } else { f32::INFINITY };
        let view = &guides.now.view;
        let mut begin = [0.0; LANES];
        for i in 0..LANES {
            let z = e.depth[i];
            let size = if view.perspective { z } else { 1.0 } / view.focal_px;
            let (a, b) = (near * z, least_difference * size);
            begin[i] = if b > a { b } else { a };
        }
        for k in 0..4 {
            let mut distance = [0.0; LANES];
            for i in 0..LANES {
                let (u, v) = (self.column[k][i] + 0.5 + before.jitter.x, self.row[k][i] + 0.5 + before.jitter.y);
                let there = world(&before.view, u, v, self.depth[k][i]);
                self.position[k][0][i] = there[0];
                self.position[k][1][i] = there[1];
                self.position[k][2][i] = there[2];
                let (was_at, was_facing) = (lane(&e.was_at, i), lane(&e.was_facing, i));
                let offset = three(|c| there[c] - was_at[c]);
                distance[i] = dot(offset, was_facing).abs();
                if by_point {
                    distance[i] = dot(offset, offset).sqrt();
                }
            }
            for i in 0..LANES {
                let depth = self.depth[k][i];
                let cosine = dot(lane(&self.normal[k], i), lane(&e.was_facing, i));
                // Without the reflector's test the roughness here is that of an earlier lookup: a number, any number.
                let difference = (self.roughness[k][i] - e.roughness[i]).abs();
                let same = (depth < f32::INFINITY)
                    & (self.id[k][i] == e.id[i])
                    & (cosine >= least_cosine)
                    & (difference <= roughness_limit);
                let trust = 1.0 - step(begin[i], surface.falloff * begin[i], distance[i]);
                let trust = if no_rejection { 1.0 } else { trust };
                let counts = same & (trust > 0.0);
                let weight = if counts { self.weight[k][i] } else { 0.0 };
                found.weight[k][i] = weight;
                total[i] += weight;
                trusted[i] += if counts { weight * trust } else { 0.0 };
            }
        }
        for i in 0..LANES {
            let enough = total[i] >= LEAST_FOOTPRINT;
            for k in 0..4 {
                found.weight[k][i] = if enough { found.weight[k][i] / total[i] } else { 0.0 };
            }
            found.trust[i] = if enough { trusted[i] / total[i] } else { 0.0 };
        }
    }
}
