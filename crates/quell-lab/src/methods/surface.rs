//! What the baselines share: signals and guides laid out for vector loops, and the pixels of the previous frame that
//! show the same surface.

use quell::{Frame, Plane, PlaneRef, Projection, Rgb, Size};
use rayon::prelude::*;

/// View depth of the background: finite, so that differences of depth are never NaN.
pub(super) const BACKGROUND: f32 = 1e30;

/// Channels of f32, interleaved by rows: channel c of row y is one slice, and all channels of a row are one chunk, so
/// that threads write whole rows and loops along a row are loops over slices.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    size: Size,
    channels: usize,
    data: Vec<f32>,
}

impl Rows {
    /// Zeros.
    pub(super) fn new(size: Size, channels: usize) -> Self {
        Self { size, channels, data: vec![0.0; size.pixels() * channels] }
    }

    pub(super) fn size(&self) -> Size {
        self.size
    }

    /// Channel `c` of row `y`.
    #[inline(always)]
    pub(super) fn row(&self, y: usize, c: usize) -> &[f32] {
        &self.data[(y * self.channels + c) * self.size.width..][..self.size.width]
    }

    /// Channel `c` of pixel (x, y).
    #[inline(always)]
    pub(super) fn at(&self, x: usize, y: usize, c: usize) -> f32 {
        self.data[(y * self.channels + c) * self.size.width + x]
    }

    /// Calls `f(y, row)` for every row on all threads; channel c of `row` begins at c * width.
    pub(super) fn fill(&mut self, f: impl Fn(usize, &mut [f32]) + Sync + Send) {
        let stride = (self.channels * self.size.width).max(1);
        self.data.par_chunks_mut(stride).enumerate().for_each(|(y, row)| f(y, row));
    }

    /// Calls `f(y, own row, others' row)` for every row of two images of equal extent.
    pub(super) fn fill_both(&mut self, other: &mut Self, f: impl Fn(usize, &mut [f32], &mut [f32]) + Sync + Send) {
        let strides = [self.channels, other.channels].map(|c| (c * self.size.width).max(1));
        let rows = self.data.par_chunks_mut(strides[0]).zip(other.data.par_chunks_mut(strides[1]));
        rows.enumerate().for_each(|(y, (a, b))| f(y, a, b));
    }

    /// Channels `c`, `c + 1`, `c + 2` as a picture.
    pub(super) fn picture(&self, c: usize) -> Plane<Rgb> {
        let mut picture = Plane::filled(self.size, [0.0; 3]);
        picture.data_mut().par_chunks_mut(self.size.width.max(1)).enumerate().for_each(|(y, out)| {
            let [r, g, b] = [c, c + 1, c + 2].map(|c| self.row(y, c));
            for (x, out) in out.iter_mut().enumerate() {
                *out = [r[x], g[x], b[x]];
            }
        });
        picture
    }
}

/// Both signals without their weights: six channels, matte red, green, blue, glossy red, green, blue. What is absent
/// is black, and so are values that are not finite or below 0.
pub(super) fn signals(frame: &Frame<'_>, out: &mut Rows) {
    let width = frame.size.width;
    out.fill(|y, row| {
        for (signal, out) in [frame.matte, frame.glossy].into_iter().zip(row.chunks_mut((3 * width).max(1))) {
            match signal {
                Some(signal) => {
                    for (x, colour) in signal.row(y).iter().enumerate() {
                        for c in 0..3 {
                            out[c * width + x] = if colour[c].is_finite() { colour[c].max(0.0) } else { 0.0 };
                        }
                    }
                }
                None => out.fill(0.0),
            }
        }
    });
}

/// Channel of [`Guides::surface`]: view depth, [`BACKGROUND`] where there is no surface.
pub(super) const DEPTH: usize = 0;
/// First of three channels of [`Guides::surface`]: the normal, (0, 0, 0) where there is no surface.
pub(super) const NORMAL: usize = 1;
/// First of two channels of [`Guides::slope`]: change of view depth a pixel along x and y, within the object.
pub(super) const GRADIENT: usize = 0;
/// Channel of [`Guides::slope`]: |dn/dx| + |dn/dy|, the `fwidth` of the normal, within the object.
pub(super) const NORMAL_WIDTH: usize = 2;

/// The guides of one frame that separate surfaces.
#[derive(Clone, Debug)]
pub(super) struct Guides {
    pub(super) surface: Rows,
    pub(super) slope: Rows,
    id: Vec<u32>,
}

impl Guides {
    pub(super) fn new(size: Size) -> Self {
        Self { surface: Rows::new(size, 4), slope: Rows::new(size, 3), id: vec![0; size.pixels()] }
    }

    pub(super) fn size(&self) -> Size {
        self.surface.size
    }

    #[inline(always)]
    pub(super) fn normal(&self, x: usize, y: usize) -> [f32; 3] {
        std::array::from_fn(|c| self.surface.at(x, y, NORMAL + c))
    }

    #[inline(always)]
    pub(super) fn id(&self, x: usize, y: usize) -> u32 {
        self.id[y * self.surface.size.width + x]
    }

    #[inline(always)]
    pub(super) fn is_surface(&self, x: usize, y: usize) -> bool {
        self.surface.at(x, y, DEPTH) < BACKGROUND
    }

    /// Reads a frame's guides; absent ones as the contract of [`Frame`] says.
    pub(super) fn read(&mut self, frame: &Frame<'_>) {
        let Size { width, height } = self.surface.size;
        self.surface.fill(|y, row| {
            for x in 0..width {
                let depth = frame.view_depth.map_or(1.0, |p| p.at(x, y));
                let is_surface = depth.is_finite() && depth > 0.0;
                row[DEPTH * width + x] = if is_surface { depth.min(BACKGROUND * 0.5) } else { BACKGROUND };
                let normal = frame.normal.map_or([0.0, 0.0, 1.0], |p| p.at(x, y));
                let known = is_surface && normal.iter().all(|v| v.is_finite());
                for c in 0..3 {
                    row[(NORMAL + c) * width + x] = if known { normal[c] } else { 0.0 };
                }
            }
        });
        if let Some(id) = frame.surface_id {
            self.id.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, out)| out.copy_from_slice(id.row(y)));
        } else {
            self.id.fill(0);
        }
        let (surface, id) = (&self.surface, &self.id);
        let length = |a: [f32; 3], b: [f32; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt();
        let normal = |x: usize, y: usize| -> [f32; 3] { std::array::from_fn(|c| surface.at(x, y, NORMAL + c)) };
        self.slope.fill(|y, row| {
            for x in 0..width {
                // Of the two neighbours along an axis, the one that differs less: an edge is no slope.
                let (z, n, own) = (surface.at(x, y, DEPTH), normal(x, y), id[y * width + x]);
                let mut normal_width = 0.0;
                for axis in 0..2 {
                    let (mut gradient, mut turn) = (f32::INFINITY, f32::INFINITY);
                    for side in [-1.0f32, 1.0] {
                        let step = |at: usize, on| at.wrapping_add_signed(if on { side as isize } else { 0 });
                        let (qx, qy) = (step(x, axis == 0), step(y, axis == 1));
                        if qx < width && qy < height && id[qy * width + qx] == own {
                            let change = side * (surface.at(qx, qy, DEPTH) - z);
                            gradient = if change.abs() < gradient.abs() { change } else { gradient };
                            turn = turn.min(length(normal(qx, qy), n));
                        }
                    }
                    row[(GRADIENT + axis) * width + x] = if gradient.is_finite() { gradient } else { 0.0 };
                    normal_width += if turn.is_finite() { turn } else { 0.0 };
                }
                row[NORMAL_WIDTH * width + x] = normal_width;
            }
        });
    }
}

/// Where the background lies: so far off that a weight by distance is 0.
pub(super) const FAR: f32 = 1e15;

/// World positions of the surfaces; of the background [`FAR`].
pub(super) fn positions(frame: &Frame<'_>, guides: &Guides, out: &mut Rows) {
    let (width, view) = (frame.size.width, frame.camera.projection(frame.size));
    out.fill(|y, row| {
        for x in 0..width {
            let pixel = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let world = match &view {
                Some(view) if guides.is_surface(x, y) => view.world(pixel, guides.surface.at(x, y, DEPTH)).to_array(),
                _ => [FAR; 3],
            };
            for c in 0..3 {
                row[c * width + x] = world[c];
            }
        }
    });
}

/// Largest difference of view depth between a pixel and its history, in sizes of `fwidth z` plus [`DEPTH_SLACK`]
/// (Schied et al., later code: 10).
const DEPTH_WIDTHS: f32 = 10.0;
/// Part of the view depth that counts as slope everywhere. The later code has 0.01 of its scenes' unit, which nothing
/// here assumes; this is the same at a depth of 5 units.
const DEPTH_SLACK: f32 = 0.002;
/// Largest difference of normals, in sizes of `fwidth n` plus [`NORMAL_SLACK`] (later code: 16).
const NORMAL_WIDTHS: f32 = 16.0;
/// Later code: 0.01.
const NORMAL_SLACK: f32 = 0.01;
/// Consistent taps that weigh less in all are no history (rounding of a coordinate).
const LEAST_WEIGHT: f32 = 0.01;

/// Pixels of the previous frame that show the surface of a pixel, and their weights, which add up to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taps {
    pixels: [(u32, u32); 9],
    weights: [f32; 9],
    count: usize,
}

impl Taps {
    /// No history.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The weighted mean of a channel.
    #[inline(always)]
    pub(super) fn mean(&self, rows: &Rows, c: usize) -> f32 {
        let mut sum = 0.0;
        for k in 0..self.count {
            sum += self.weights[k] * rows.at(self.pixels[k].0 as usize, self.pixels[k].1 as usize, c);
        }
        sum
    }

    fn push(&mut self, x: usize, y: usize, weight: f32) {
        if let (Some(p), Some(w)) = (self.pixels.get_mut(self.count), self.weights.get_mut(self.count)) {
            (*p, *w) = ((x as u32, y as u32), weight);
            self.count += 1;
        }
    }

    /// Makes the weights add up to 1, or empties.
    fn normalised(mut self) -> Self {
        let sum: f32 = self.weights[..self.count].iter().sum();
        if sum < LEAST_WEIGHT {
            return Self::default();
        }
        self.weights.iter_mut().for_each(|w| *w /= sum);
        self
    }
}

/// Finds each pixel's surface in the previous frame.
pub(super) struct Reprojection<'a> {
    now: &'a Guides,
    before: &'a Guides,
    motion: Option<PlaneRef<'a, [f32; 2]>>,
    /// Of this frame and of the one before.
    views: Option<[Projection; 2]>,
}

impl<'a> Reprojection<'a> {
    pub(super) fn new(frame: &Frame<'a>, now: &'a Guides, before: &'a Guides) -> Self {
        let [a, b] = [frame.camera, frame.previous_camera].map(|c| c.projection(frame.size));
        Self { now, before, motion: frame.motion, views: a.zip(b).map(Into::into) }
    }

    /// SVGF, section 4.1: the 2x2 pixels about the old place, each tested for the same surface, bilinear weights
    /// renormalised; where none holds, 3x3, which finds thin things; else nothing.
    pub(super) fn taps(&self, x: usize, y: usize) -> Taps {
        let Some(([u, v], depths)) = self.expected(x, y) else { return Taps::default() };
        let (fx, fy) = (u.floor(), v.floor());
        let (tx, ty) = (u - fx, v - fy);
        let mut taps = Taps::default();
        for (dx, dy, weight) in
            [(0, 0, (1.0 - tx) * (1.0 - ty)), (1, 0, tx * (1.0 - ty)), (0, 1, (1.0 - tx) * ty), (1, 1, tx * ty)]
        {
            self.test((x, y), (fx as isize + dx, fy as isize + dy), depths, weight, &mut taps);
        }
        let taps = taps.normalised();
        if !taps.is_empty() {
            return taps;
        }
        let (cx, cy) = (u.round() as isize, v.round() as isize);
        let mut taps = Taps::default();
        for k in 0..9 {
            self.test((x, y), (cx + k % 3 - 1, cy + k / 3 - 1), depths, 1.0, &mut taps);
        }
        taps.normalised()
    }

    /// The index coordinate (centres at integers) where the surface of pixel (x, y) was, and the two view depths that
    /// it may have had: if it rested, and if it moved with the camera (motion has no depth). `None`: background,
    /// unknown motion, far off screen.
    fn expected(&self, x: usize, y: usize) -> Option<([f32; 2], [f32; 2])> {
        let z = self.now.surface.at(x, y, DEPTH);
        if z >= BACKGROUND {
            return None;
        }
        let pixel = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let [now, before] = self.views.as_ref()?;
        let world = now.world(pixel, z);
        let motion = match self.motion {
            Some(motion) => glam::Vec2::from(motion.at(x, y)),
            None => before.pixel(world)? - pixel,
        };
        let place = pixel + motion - 0.5;
        let Size { width, height } = self.now.surface.size;
        let near = |v: f32, extent: usize| v > -2.0 && v < extent as f32 + 1.0;
        let on_screen = near(place.x, width) && near(place.y, height);
        on_screen.then(|| (place.to_array(), [before.view_depth(world), z]))
    }

    /// Adds a pixel of the previous frame if it shows the surface of `own`: same object, depth and normal.
    #[inline(always)]
    fn test(&self, own: (usize, usize), tap: (isize, isize), depths: [f32; 2], weight: f32, taps: &mut Taps) {
        let (x, y) = own;
        if weight <= 0.0 || !self.now.surface.size.contains(tap.0, tap.1) {
            return;
        }
        let (qx, qy) = (tap.0 as usize, tap.1 as usize);
        if !self.before.is_surface(qx, qy) || self.before.id(qx, qy) != self.now.id(x, y) {
            return;
        }
        let slope = |c| self.now.slope.at(x, y, c);
        let z = self.before.surface.at(qx, qy, DEPTH);
        let off = (z - depths[0]).abs().min((z - depths[1]).abs());
        let depth_width = slope(GRADIENT).abs() + slope(GRADIENT + 1).abs() + DEPTH_SLACK * depths[1];
        let (a, b) = (self.now.normal(x, y), self.before.normal(qx, qy));
        let turn = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt();
        if off <= DEPTH_WIDTHS * depth_width && turn <= NORMAL_WIDTHS * (slope(NORMAL_WIDTH) + NORMAL_SLACK) {
            taps.push(qx, qy, weight);
        }
    }
}
