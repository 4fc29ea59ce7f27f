//! Reprojection (`reproject.rs`) on runs of pixels: arithmetic lane by lane, in the reference's order of operations, so
//! that both find the same places to the bit. Previous pixels lie anywhere: they are collected one by one.

use super::math::three;
use super::reproject::{LEAST_FOOTPRINT, kept_trust};
use crate::camera::Projection;
use crate::kernels::spiral::PERIOD;
use crate::phased::guides::{CpuGuides, Surfaces, field};
use crate::phased::layout::copy;
use crate::settings::{Rejection, Settings, SurfaceSettings};
use glam::{DVec3, Vec2, Vec3};

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
        let (row, jitter) = (y as f32 + 0.5, now.jitter);
        let v = row + jitter.y;
        let screen = Screen::new(&guides.previous_view);
        let (guard, static_motion) = (settings.guard_band, settings.static_motion);
        let (right, bottom) = (width as f32 - guard, size.height as f32 - guard);
        self.place(guides, v, (x, stride));
        self.was_at = self.position;
        self.was_facing = self.normal;
        for i in 0..LANES {
            let column = self.x[i] + 0.5;
            let u = column + jitter.x;
            let z = self.depth[i];
            let (mx, my) = (self.motion[0][i], self.motion[1][i]);
            let (cx, cy) = (column + mx, row + my);
            let on_screen = (cx >= guard) & (cy >= guard) & (cx <= right) & (cy <= bottom);
            let alive = (z < f32::INFINITY) & !mx.is_nan() & !my.is_nan() & on_screen;
            let (px, py, ahead) = screen.pixel(lane(&self.position, i), 1.0);
            let (ex, ey) = (px - u - mx, py - v - my);
            let moved = !ahead | ((ex * ex + ey * ey).sqrt() > static_motion);
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
        self.place(guides, y as f32 + 0.5 + now.jitter.y, (x, stride));
        self.was_at = self.position;
        self.was_facing = self.normal;
        self.moved = [0; LANES];
        self.bent = [0; LANES];
    }

    /// Columns and world positions of the lanes; `v`: the row's pixel coordinate.
    #[inline(always)]
    fn place(&mut self, guides: &CpuGuides, v: f32, (x, stride): (usize, usize)) {
        let (rays, jitter) = (Rays::new(&guides.now.view), guides.now.jitter.x);
        for i in 0..LANES {
            // 32 bits: vectors of the older instruction sets convert no others.
            self.x[i] = (x as i32 + stride as i32 * i as i32) as f32;
        }
        for i in 0..LANES {
            let [px, py, pz] = rays.world(self.x[i] + 0.5 + jitter, v, self.depth[i]);
            self.position[0][i] = px;
            self.position[1][i] = py;
            self.position[2][i] = pz;
        }
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

/// [`Projection::world`] for loops over lanes: a copy, so that it is plain to the compiler that no lane changes it. Without it such a
/// loop goes lane by lane.
#[derive(Clone, Copy)]
struct Rays {
    origin: [[f32; 3]; 3],
    direction: [[f32; 3]; 3],
    perspective: bool,
}

impl Rays {
    #[inline(always)]
    fn new(view: &Projection) -> Self {
        let of = |axes: &[Vec3; 3]| three(|k| axes[k].to_array());
        Self { origin: of(&view.origin), direction: of(&view.direction), perspective: view.perspective }
    }

    #[inline(always)]
    fn world(&self, u: f32, v: f32, depth: f32) -> [f32; 3] {
        let Self { origin, direction, perspective } = *self;
        let axis = |a: &[[f32; 3]; 3], c: usize| a[0][c] + a[1][c] * u + a[2][c] * v;
        // All rays of a perspective camera come from one point: its other terms are zero.
        let origin = three(|c| if perspective { origin[0][c] } else { axis(&origin, c) });
        three(|c| origin[c] + axis(&direction, c) * depth)
    }
}

/// [`Projection::pixel`] of points (`w` = 1), [`Projection::pixel_of_direction`] (`w` = 0); a copy as [`Rays`] is.
#[derive(Clone, Copy)]
pub(super) struct Screen {
    u: [f64; 4],
    v: [f64; 4],
    w: [f64; 4],
}

impl Screen {
    #[inline(always)]
    pub fn new(view: &Projection) -> Self {
        let of = |row: &(DVec3, f64)| [row.0.x, row.0.y, row.0.z, row.1];
        Self { u: of(&view.u), v: of(&view.v), w: of(&view.w) }
    }

    /// The pixel coordinate; false: behind the eye.
    #[inline(always)]
    pub fn pixel(&self, point: [f32; 3], w: f64) -> (f32, f32, bool) {
        let (x, y, z) = (f64::from(point[0]), f64::from(point[1]), f64::from(point[2]));
        let of = |row: &[f64; 4]| row[0] * x + row[1] * y + row[2] * z + row[3] * w;
        let (pu, pv, pw) = (of(&self.u), of(&self.v), of(&self.w));
        ((pu / pw) as f32, (pv / pw) as f32, pw > 0.0)
    }
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
    /// Living lanes in no run, to be read by themselves, and their number.
    singles: [usize; LANES],
    alone: usize,
}

impl Segments {
    pub fn new() -> Self {
        Self { runs: [(0, 0); LANES], count: 0, singles: [0; LANES], alone: 0 }
    }

    /// Shorter ones cost more than single lanes.
    const SHORTEST: usize = 4;

    /// Finds the runs among living lanes of a phase; `base`: column and row of the first of the four pixels.
    #[inline(always)]
    pub fn find(&mut self, base: &[[i32; LANES]; 2], alive: &[u32; LANES], width: i32, height: i32) {
        (self.count, self.alone) = (0, 0);
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
                continue;
            }
            for (lane, alive) in (first..i).zip(&alive[first..i]) {
                if *alive != 0 {
                    self.singles[self.alone] = lane;
                    self.alone += 1;
                }
            }
        }
    }

    /// Living lanes in no run, in ascending order.
    #[inline(always)]
    pub fn singles(&self) -> &[usize] {
        &self.singles[..self.alone]
    }
}

/// The four pixels of each lane's footprint: where they are and what they show.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Footprint {
    pub segments: Segments,
    weight: [Lanes; 4],
    pub(crate) column: [Lanes; 4],
    pub(crate) row: [Lanes; 4],
    pub place: [LaneTap; 4],
    pub(super) depth: [Lanes; 4],
    /// World positions, as the last lookup found them.
    pub(super) position: [Lanes3; 4],
    pub(super) normal: [Lanes3; 4],
    roughness: [Lanes; 4],
    pub(super) id: [[u32; LANES]; 4],
}

/// What lanes reflect.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Reflected {
    /// The reflected points, world space; of no meaning where `distance` is not finite.
    pub point: Lanes3,
    /// Filtered hit distances.
    pub distance: Lanes,
    /// 1: the lane shows a mirror.
    pub mirror: [u32; LANES],
    /// Some lane does.
    pub any: bool,
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
    /// 1: colours are fetched from 4x4 pixels by Catmull and Rom's spline.
    pub spline: [u32; LANES],
    /// Some lane's are.
    pub any_spline: bool,
}

impl Lookup {
    pub fn new() -> Self {
        Self { weight: [[0.0; LANES]; 4], trust: [0.0; LANES], spline: [0; LANES], any_spline: false }
    }
}

impl Reflected {
    pub fn new() -> Self {
        Self { point: [[0.0; LANES]; 3], distance: [0.0; LANES], mirror: [0; LANES], any: false }
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
        for &i in self.segments.singles() {
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

    /// Each of the four pixels tested singly. `reflector`: the pixel must show the same reflector, and where it is a mirror the
    /// same reflected point.
    #[inline(always)]
    pub fn look_up(
        &mut self,
        guides: &CpuGuides,
        settings: &Settings,
        e: &Expected,
        reflector: Option<&Reflected>,
        found: &mut Lookup,
    ) {
        let mirrors = reflector.filter(|hit| hit.any && guides.glossy_hit_before.len() == guides.phases.size.pixels());
        let reflector = reflector.is_some();
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
        let spline_below = if reflector { glossy.spline_below() } else { 0.0 };
        let mut whole = [1u32; LANES];
        let (least_difference, near) = match rejection {
            Rejection::Point => (0.0, surface.point_distance),
            _ => (surface.pixel_distance, surface.plane_distance),
        };
        let no_rejection = rejection == Rejection::Off;
        let by_point = rejection == Rejection::Point;
        let roughness_limit = if reflector { glossy.reflector_roughness } else { f32::INFINITY };
        let view = &guides.now.view;
        let (rays, jitter) = (Rays::new(&before.view), before.jitter);
        let mut begin = [0.0; LANES];
        for i in 0..LANES {
            let z = e.depth[i];
            let size = if view.perspective { z } else { 1.0 } / view.focal_px;
            let (a, b) = (near * z, least_difference * size);
            begin[i] = if b > a { b } else { a };
        }
        for k in 0..4 {
            let mut distance = [0.0; LANES];
            let (column, row, depth) = (&self.column[k], &self.row[k], &self.depth[k]);
            let [px, py, pz] = &mut self.position[k];
            for i in 0..LANES {
                let (u, v) = (column[i] + 0.5 + jitter.x, row[i] + 0.5 + jitter.y);
                let [x, y, z] = rays.world(u, v, depth[i]);
                px[i] = x;
                py[i] = y;
                pz[i] = z;
                let was_at = lane(&e.was_at, i);
                let offset = [x - was_at[0], y - was_at[1], z - was_at[2]];
                distance[i] = dot(offset, lane(&e.was_facing, i)).abs();
            }
            if by_point {
                for i in 0..LANES {
                    let (there, was_at) = (lane(&self.position[k], i), lane(&e.was_at, i));
                    let offset = three(|c| there[c] - was_at[c]);
                    distance[i] = dot(offset, offset).sqrt();
                }
            }
            let mut of_hit = [1.0; LANES];
            if let Some(hit) = mirrors {
                self.same_hits(guides, settings, (e, hit), k, &mut of_hit);
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
                let trust = trust * of_hit[i];
                let counts = same & (trust > 0.0);
                let weight = if counts { self.weight[k][i] } else { 0.0 };
                whole[i] &= u32::from(counts | (self.weight[k][i] <= 0.0));
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
        if !reflector && surface.lost_footprint > 0.0 {
            for i in 0..LANES {
                let kept = kept_trust(total[i], surface.lost_footprint);
                found.trust[i] *= if found.trust[i] > 0.0 { kept } else { 0.0 };
            }
        }
        found.any_spline = false;
        if spline_below > 0.0 {
            let (right, bottom) = (guides.phases.size.width as f32 - 2.0, guides.phases.size.height as f32 - 2.0);
            let mut any = 0;
            for i in 0..LANES {
                let (x, y) = (self.column[0][i], self.row[0][i]);
                let inside = (x >= 1.0) & (y >= 1.0) & (x < right) & (y < bottom);
                let wanted = (found.trust[i] > 0.0) & (e.roughness[i] < spline_below);
                found.spline[i] = whole[i] & u32::from(inside & wanted);
                any |= found.spline[i];
            }
            found.any_spline = any != 0;
        }
    }

    /// How far the footprint's pixel `k` is to be trusted where lanes show mirrors: `same_hit` of `mirror_image.rs`.
    #[inline(never)]
    fn same_hits(
        &self,
        guides: &CpuGuides,
        settings: &Settings,
        (e, hit): (&Expected, &Reflected),
        k: usize,
        out: &mut Lanes,
    ) {
        let (width, place) = (guides.phases.size.width, &self.place[k]);
        let (tolerance, falloff) = (settings.glossy_temporal.hit_tolerance, settings.surface.falloff);
        let (before, view) = (&guides.glossy_hit_before, &guides.now.view);
        let least = settings.surface.pixel_distance / view.focal_px;
        // 0: no evidence.
        let mut then = [0.0; LANES];
        for &(first, n) in &self.segments.runs[..self.segments.count] {
            let source = &before[place.row[first] as usize * width + place.element[first] as usize..][..n];
            copy::<LANES, _>(&mut then[first..][..n], source);
        }
        for &i in self.segments.singles() {
            if self.depth[k][i] < f32::INFINITY {
                then[i] = before[place.row[i] as usize * width + place.element[i] as usize];
            }
        }
        for i in 0..LANES {
            let (now, then) = (hit.distance[i], then[i]);
            let away = three(|c| hit.point[c][i] - self.position[k][c][i]);
            let wanted = dot(away, away).sqrt();
            let begin = (tolerance * wanted).max(least * if view.perspective { e.depth[i] } else { 1.0 });
            let trust = 1.0 - step(begin, falloff * begin, (wanted - then).abs());
            let (ends, ended) = (now < f32::INFINITY, then < f32::INFINITY);
            let both = if ends == ended { 1.0 } else { 0.0 };
            let trust = if ends & ended { trust } else { both };
            out[i] = if (hit.mirror[i] != 0) & (then > 0.0) { trust } else { 1.0 };
        }
    }
}
