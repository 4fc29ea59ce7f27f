//! Reprojection (`reproject.rs`) on runs of pixels: arithmetic lane by lane, in the reference's order of operations, so
//! that both find the same places to the bit. Previous pixels lie anywhere: they are collected one by one.

use super::math::three;
use crate::camera::Projection;
use crate::cpu::guides::{CpuGuides, Surfaces, field};
use crate::cpu::layout::copy;
use crate::kernels::reproject::{FARTHEST_BENT_PX, LEAST_BENT_DETERMINANT};
use crate::kernels::spiral::PERIOD;
use crate::settings::{HitFilter, REFERENCE_ROWS, Rejection, Settings, Surface as SurfaceSettings};
use glam::{Vec2, Vec3};

/// Pixels that are looked up together.
pub(crate) const LANES: usize = 64;
/// One value for each of them.
pub(crate) type Lanes = [f32; LANES];
/// Likewise of a vector.
pub(crate) type Lanes3 = [Lanes; 3];

/// Weights under this share of the bilinear footprint are no evidence: rounding of a coordinate.
const LEAST_FOOTPRINT: f32 = 1e-3;

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

    /// Steps 1 and 6, matte, for the `n` pixels of row `y` from element `begin` on, the first in column `x`, every
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

    /// Motion tells the pixel but not the depth: the nearest previous pixel of the same object anchors the plane.
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
fn pixel(view: &Projection, point: [f32; 3], w: f64) -> (f32, f32, bool) {
    let (x, y, z) = (f64::from(point[0]), f64::from(point[1]), f64::from(point[2]));
    let (ru, rv, rw) = (&view.u, &view.v, &view.w);
    let pu = ru.0.x * x + ru.0.y * y + ru.0.z * z + ru.1 * w;
    let pv = rv.0.x * x + rv.0.y * y + rv.0.z * z + rv.1 * w;
    let pw = rw.0.x * x + rw.0.y * y + rw.0.z * z + rw.1 * w;
    ((pu / pw) as f32, (pv / pw) as f32, pw > 0.0)
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn lane(v: &Lanes3, i: usize) -> [f32; 3] {
    [v[0][i], v[1][i], v[2][i]]
}

/// Where a pixel of the previous image is stored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Element of a row in phase order.
    pub element: [u32; LANES],
    pub row: [u32; LANES],
}

impl Default for Place {
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
    column: [Lanes; 4],
    row: [Lanes; 4],
    pub place: [Place; 4],
    depth: [Lanes; 4],
    /// World positions, as the last lookup found them.
    position: [Lanes3; 4],
    normal: [Lanes3; 4],
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
            place: [Place::default(); 4],
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

    /// Steps 4 and 6: each of the four pixels tested singly. `reflector`: by the tests of 6b.
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

/// Normals that differ by less (length of the difference) are the same up to rounding.
const SAME_NORMAL: f32 = 1e-5;
/// Planes apart by less, in sizes of a pixel, are the same up to rounding.
const SAME_PLANE_PX: f32 = 0.01;

/// The reflectors as the four pixels at their old places show them, where `alive`: `visible` is the lookup of
/// `footprint`. Reflectors at rest stay as they are, the others become the mean of the four.
#[inline(always)]
pub(crate) fn previous_reflectors(
    guides: &CpuGuides,
    footprint: &Footprint,
    visible: &Lookup,
    alive: &[u32; LANES],
    e: &mut Expected,
) {
    for i in 0..LANES {
        let (mut position, mut normal) = ([0.0; 3], [0.0; 3]);
        for k in 0..4 {
            let weight = visible.weight[k][i];
            let there = lane(&footprint.position[k], i);
            for c in 0..3 {
                position[c] = if weight > 0.0 { position[c] + weight * there[c] } else { position[c] };
                normal[c] = if weight > 0.0 { normal[c] + weight * footprint.normal[k][c][i] } else { normal[c] };
            }
        }
        let mut first = [0.0; 3];
        for k in [3, 2, 1, 0] {
            let seen = visible.weight[k][i] > 0.0;
            first = three(|c| if seen { footprint.normal[k][c][i] } else { first[c] });
        }
        let scale = 1.0 / dot(normal, normal).sqrt();
        let known = (scale > 0.0) & (scale < f32::INFINITY);
        let normal = three(|c| if known { normal[c] * scale } else { 0.0 });
        let squared_distance = |n: [f32; 3]| {
            let d = three(|c| n[c] - normal[c]);
            dot(d, d)
        };
        let mut spread = 0.0;
        for k in 0..4 {
            let d = squared_distance(lane(&footprint.normal[k], i));
            spread = if (visible.weight[k][i] > 0.0) & (d > spread) { d } else { spread };
        }
        let mut bent = false;
        for k in 0..4 {
            let difference = three(|c| footprint.normal[k][c][i] - first[c]);
            bent |= (visible.weight[k][i] > 0.0) & (dot(difference, difference).sqrt() > SAME_NORMAL);
        }
        e.bent[i] = u32::from(bent) & alive[i];
        let turned = squared_distance(lane(&e.normal, i)).sqrt() > spread.sqrt() + SAME_NORMAL;
        let offset = three(|c| e.position[c][i] - position[c]);
        let shifted = dot(offset, normal).abs() > SAME_PLANE_PX * guides.now.view.pixel_size(e.depth[i]);
        let moved = (e.moved[i] != 0) | turned | shifted;
        e.moved[i] = u32::from(moved) & alive[i];
        for c in 0..3 {
            e.was_at[c][i] = if moved { position[c] } else { e.was_at[c][i] };
            e.was_facing[c][i] = if moved { normal[c] } else { e.was_facing[c][i] };
        }
    }
}

/// Step 2, glossy: where the mirror images of the lanes were, into `coordinate`; `alive` goes to 0 where that is
/// unknown or off screen. `hit`: filtered hit distances. `MOVED`: lanes may have moved.
#[inline(always)]
pub(crate) fn virtual_coordinates<const MOVED: bool>(
    guides: &CpuGuides,
    settings: &Settings,
    e: &Expected,
    hit: &Lanes,
    coordinate: &mut [Lanes; 2],
    alive: &mut [u32; LANES],
) {
    let (now, previous) = (&guides.now, &guides.previous_view);
    let (width, height) = (guides.phases.size.width as f32, guides.phases.size.height as f32);
    let (guard, furthest) = (settings.surface.guard_band, settings.glossy_temporal.max_hit_distance);
    let v = e.y as f32 + 0.5 + now.jitter.y;
    let d = &now.view.direction;
    for i in 0..LANES {
        let u = e.x[i] + 0.5 + now.jitter.x;
        let ray = three(|c| d[0][c] + d[1][c] * u + d[2][c] * v);
        let scale = 1.0 / dot(ray, ray).sqrt();
        let ray = three(|c| ray[c] * scale);
        let limit = furthest * e.depth[i];
        let finite = hit[i] < f32::INFINITY;
        let distance = if limit < hit[i] { limit } else { hit[i] };
        let (position, normal) = (lane(&e.position, i), lane(&e.normal, i));
        // At rest: the image of a plane mirror lies behind it, on the eye ray. Else mirrored in the plane of then.
        let moved = MOVED & (e.moved[i] != 0);
        let (was_at, was_facing) = (lane(&e.was_at, i), lane(&e.was_facing, i));
        let twice = 2.0 * dot(ray, normal);
        let reflected = three(|c| ray[c] - twice * normal[c]);
        let direction = three(|c| if moved { reflected[c] } else { ray[c] });
        let point = three(|c| position[c] + direction[c] * distance);
        let from_plane = three(|c| if finite { point[c] - was_at[c] } else { direction[c] });
        let twice = 2.0 * dot(from_plane, was_facing);
        let unmirrored = three(|c| if finite { point[c] } else { direction[c] });
        let mirrored = three(|c| if moved { unmirrored[c] - twice * was_facing[c] } else { unmirrored[c] });
        let (px, py, ahead) = pixel(previous, mirrored, if finite { 1.0 } else { 0.0 });
        let (cx, cy) = (px - now.jitter.x, py - now.jitter.y);
        coordinate[0][i] = cx;
        coordinate[1][i] = cy;
        let on_screen = (cx >= guard) & (cy >= guard) & (cx <= width - guard) & (cy <= height - guard);
        alive[i] &= u32::from(ahead & on_screen);
    }
}

/// `bent_coordinate` of lanes that show a curved reflector, over what `coordinate` holds for plane ones. `footprint`
/// and `visible` are those of the surface's own place; `hit`: filtered hit distances.
#[inline(always)]
pub(crate) fn bent_coordinates(
    guides: &CpuGuides,
    settings: &Settings,
    e: &Expected,
    (footprint, visible): (&Footprint, &Lookup),
    hit: &Lanes,
    coordinate: &mut [Lanes; 2],
    alive: &mut [u32; LANES],
) {
    let (now, before) = (&guides.now, &guides.before);
    let (width, height) = (guides.phases.size.width as f32, guides.phases.size.height as f32);
    let guard = settings.surface.guard_band;
    let farthest = FARTHEST_BENT_PX * height / REFERENCE_ROWS;
    let direction = |view: &Projection, u: f32, v: f32| {
        let d = &view.direction;
        let ray = three(|c| d[0][c] + d[1][c] * u + d[2][c] * v);
        let scale = 1.0 / dot(ray, ray).sqrt();
        three(|c| ray[c] * scale)
    };
    let v = e.y as f32 + 0.5 + now.jitter.y;
    // Where the reflected previous eye rays miss the hit points, at each of the four pixels.
    let mut misses = [[[0.0; LANES]; 3]; 4];
    let mut reflected = [[0.0; LANES]; 3];
    let mut hits = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let ray = direction(&now.view, e.x[i] + 0.5 + now.jitter.x, v);
        let normal = lane(&e.normal, i);
        let twice = 2.0 * dot(ray, normal);
        for c in 0..3 {
            reflected[c][i] = ray[c] - twice * normal[c];
            hits[c][i] = e.position[c][i] + reflected[c][i] * hit[i];
        }
    }
    for (k, miss) in misses.iter_mut().enumerate() {
        for i in 0..LANES {
            let (u, v) = (footprint.column[k][i] + 0.5 + before.jitter.x, footprint.row[k][i] + 0.5 + before.jitter.y);
            let ray = direction(&before.view, u, v);
            let normal = lane(&footprint.normal[k], i);
            let twice = 2.0 * dot(ray, normal);
            let to_hit = three(|c| hits[c][i] - footprint.position[k][c][i]);
            let scale = 1.0 / dot(to_hit, to_hit).sqrt();
            let finite = hit[i] < f32::INFINITY;
            for c in 0..3 {
                let wanted = if finite { to_hit[c] * scale } else { reflected[c][i] };
                miss[c][i] = wanted - (ray[c] - twice * normal[c]);
            }
        }
    }
    for i in 0..LANES {
        let [f0, f1, f2, f3] = [0, 1, 2, 3].map(|k| lane(&misses[k], i));
        let middle = three(|c| 0.25 * ((f0[c] + f1[c]) + (f2[c] + f3[c])));
        let du = three(|c| 0.5 * ((f1[c] - f0[c]) + (f3[c] - f2[c])));
        let dv = three(|c| 0.5 * ((f2[c] - f0[c]) + (f3[c] - f1[c])));
        let (a, b, c) = (dot(du, du), dot(du, dv), dot(dv, dv));
        let (p, q) = (dot(du, middle), dot(dv, middle));
        let determinant = a * c - b * b;
        let (sx, sy) = (e.coordinate[0][i], e.coordinate[1][i]);
        let x = (sx - 0.5).floor() + 1.0 + (b * q - c * p) / determinant;
        let y = (sy - 0.5).floor() + 1.0 + (b * p - a * q) / determinant;
        let (dx, dy) = (x - sx, y - sy);
        let whole = (visible.weight[0][i] > 0.0)
            & (visible.weight[1][i] > 0.0)
            & (visible.weight[2][i] > 0.0)
            & (visible.weight[3][i] > 0.0);
        let solved = (determinant > LEAST_BENT_DETERMINANT * a * c) & ((dx * dx + dy * dy).sqrt() <= farthest);
        let (x, y) = if whole & solved { (x, y) } else { (sx, sy) };
        let bent = e.bent[i] != 0;
        coordinate[0][i] = if bent { x } else { coordinate[0][i] };
        coordinate[1][i] = if bent { y } else { coordinate[1][i] };
        let on_screen = (x >= guard) & (y >= guard) & (x <= width - guard) & (y <= height - guard);
        alive[i] = if bent { u32::from((visible.trust[i] > 0.0) & on_screen) } else { alive[i] };
    }
}

/// The glossy hit distances of the lanes after the 3x3 filter over the same reflector.
#[inline(always)]
pub(crate) fn filtered_hits(
    guides: &CpuGuides,
    filter: HitFilter,
    e: &Expected,
    (phase, first): (usize, usize),
    hits: &mut Lanes,
) {
    let (phases, size) = (&guides.phases, guides.phases.size);
    let row = |y: usize| &guides.glossy_hit[y * size.width..][..size.width];
    let begin = phases.range(phase).start + first;
    copy::<LANES, _>(&mut hits[..e.n], &row(e.y)[begin..][..e.n]);
    let mut values = [[0.0f32; LANES]; 9];
    let mut counts = [[0u32; LANES]; 9];
    if filter == HitFilter::Off {
        return;
    }
    for k in 0..9 {
        let (dx, ty) = (k as i32 % 3 - 1, (e.y + k / 3).wrapping_sub(1));
        if ty >= size.height {
            continue;
        }
        let Some(span) = phases.shifted(phase, first, e.n, dx) else { continue };
        let n = span.len;
        let source = &row(ty)[span.source..][..n];
        let depth = &field(&guides.now.depth, size.width, 1, ty, 0)[span.source..][..n];
        let id = &field(&guides.now.id, size.width, 1, ty, 0)[span.source..][..n];
        let own = &e.id[span.first..][..n];
        if filter == HitFilter::Min {
            let hits = &mut hits[span.first..][..n];
            for i in 0..n {
                let counts = (depth[i] < f32::INFINITY) & (id[i] == own[i]) & (source[i] < hits[i]);
                hits[i] = if counts { source[i] } else { hits[i] };
            }
        } else {
            values[k][span.first..][..n].copy_from_slice(source);
            let counts = &mut counts[k][span.first..][..n];
            for i in 0..n {
                counts[i] = u32::from((depth[i] < f32::INFINITY) & (id[i] == own[i]));
            }
        }
    }
    if filter == HitFilter::Median {
        for i in 0..e.n {
            let mut around = [0.0; 9];
            let mut count = 0;
            for k in 0..9 {
                if counts[k][i] != 0 {
                    around[count] = values[k][i];
                    count += 1;
                }
            }
            around[..count].sort_unstable_by(f32::total_cmp);
            hits[i] = around[..count].get(count / 2).copied().unwrap_or(hits[i]);
        }
    }
}
