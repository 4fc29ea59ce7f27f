//! What the noise-free feature buffers show: which pixels show the same surface, and where a surface was a frame ago.

use crate::error::Error;
use glam::{Vec2, Vec3};
use quell::{Camera, FrameBuf, Plane, Projection, Rgb, Size};
use std::borrow::Cow;

/// Normals whose cosine is below this belong to different surfaces.
const SAME_NORMAL: f32 = 0.9;
/// Points further from a surface's plane than this part of the view depth belong to another one ...
const PLANE_DEPTH: f32 = 0.01;
/// ... unless they are closer than so many pixels.
const PLANE_PX: f32 = 1.5;
/// A moving object may have come nearer by this part of its view depth in one frame.
const MOVED_DEPTH: f32 = 0.1;
/// Motion beyond that of the camera, in pixels: the object itself moved.
const OWN_MOTION_PX: f32 = 0.1;
/// A surface is seen again where at least this share of the bilinear footprint shows it.
const LEAST_SEEN: f32 = 0.25;

/// The guides of one frame, with the meaning of absent planes filled in.
pub struct Surfaces<'a> {
    size: Size,
    view: Projection,
    previous_view: Projection,
    depth: Option<Cow<'a, [f32]>>,
    normal: Option<Cow<'a, [[f32; 3]]>>,
    id: Option<Cow<'a, [u32]>>,
    motion: Option<Cow<'a, [[f32; 2]]>>,
    /// World position of every pixel; of background: not finite.
    world: Vec<Vec3>,
}

/// One pixel's surface.
pub struct Element {
    world: Vec3,
    normal: Option<Vec3>,
    id: u32,
    tolerance: f32,
}

impl<'a> Surfaces<'a> {
    /// Reads a frame's guides.
    ///
    /// # Errors
    /// [`Error::Quell`] where planes differ in extent or a camera cannot be used.
    pub fn new(frame: &'a FrameBuf) -> Result<Self, Error> {
        let size = frame.size;
        frame.frame(&[]).check(size)?;
        let usable =
            |which, camera: &quell::Camera| camera.projection(size).ok_or(Error::Quell(quell::Error::Camera { which }));
        let view = usable("camera", &frame.camera)?;
        let previous_view = usable("previous_camera", &frame.previous_camera)?;
        let mut surfaces = Self {
            size,
            view,
            previous_view,
            depth: frame.view_depth.as_ref().map(|p| p.data().into()),
            normal: frame.normal.as_ref().map(|p| p.data().into()),
            id: frame.surface_id.as_ref().map(|p| p.data().into()),
            motion: frame.motion.as_ref().map(|p| p.data().into()),
            world: Vec::new(),
        };
        surfaces.place();
        Ok(surfaces)
    }

    fn place(&mut self) {
        self.world = (0..self.size.pixels()).map(|i| self.view.world(centre(self.size, i), self.depth(i))).collect();
    }

    /// Extent.
    pub fn size(&self) -> Size {
        self.size
    }

    fn depth(&self, i: usize) -> f32 {
        self.depth.as_ref().map_or(1.0, |d| d[i])
    }

    fn id(&self, i: usize) -> u32 {
        self.id.as_ref().map_or(0, |d| d[i])
    }

    fn normal(&self, i: usize) -> Option<Vec3> {
        self.normal.as_ref().map(|n| Vec3::from(n[i]))
    }

    /// Whether the pixel shows a surface: its depth is finite and positive.
    pub fn is_surface(&self, i: usize) -> bool {
        let depth = self.depth(i);
        depth.is_finite() && depth > 0.0
    }

    /// The pixel's surface; `None`: background.
    pub fn element(&self, i: usize) -> Option<Element> {
        self.is_surface(i).then(|| {
            let depth = self.depth(i);
            Element {
                world: self.world[i],
                normal: self.normal(i),
                id: self.id(i),
                tolerance: (PLANE_DEPTH * depth).max(PLANE_PX * self.view.pixel_size(depth)),
            }
        })
    }

    /// Whether pixel `tap` shows the same surface as `here`: same id, normals within 26 degrees, and a point within 1 %
    /// of the view depth (or 1.5 pixels) of the plane. Without normals: within 5 % in depth.
    #[inline]
    pub fn continues(&self, here: &Element, tap: usize) -> bool {
        if self.id(tap) != here.id || !self.is_surface(tap) {
            return false;
        }
        let offset = self.world[tap] - here.world;
        match (here.normal, self.normal(tap)) {
            (Some(a), Some(b)) => a.dot(b) >= SAME_NORMAL && offset.dot(a).abs() <= here.tolerance,
            _ => offset.dot(self.view.forward().into()).abs() <= 5.0 * here.tolerance,
        }
    }

    /// Pixels with a neighbour (right, below, left or above) that shows another surface.
    pub fn edges(&self) -> Plane<bool> {
        let Size { width, height } = self.size;
        let mut edges = Plane::filled(self.size, false);
        for y in 0..height {
            for x in 0..width {
                let i = y * width + x;
                let here = self.element(i);
                let mut compare = |tap: usize| {
                    let same = match &here {
                        Some(here) => self.continues(here, tap),
                        None => !self.is_surface(tap),
                    };
                    if !same {
                        edges.data_mut()[i] = true;
                        edges.data_mut()[tap] = true;
                    }
                };
                if x + 1 < width {
                    compare(i + 1);
                }
                if y + 1 < height {
                    compare(i + width);
                }
            }
        }
        edges
    }

    /// Where the pixel's surface was in the previous image, continuous pixel coordinate, on screen or not. `None`:
    /// unknown.
    pub fn previous(&self, i: usize) -> Option<Vec2> {
        let here = centre(self.size, i);
        let found = match &self.motion {
            Some(motion) => Some(here + Vec2::from(motion[i])),
            None if self.is_surface(i) => self.previous_view.pixel(self.world[i]),
            None => self.previous_view.pixel_of_direction(self.view.ray_direction(here)),
        };
        found.filter(|p| p.is_finite())
    }

    /// Of the four pixels around the surface's old place that show it, the one with most weight; `None` where less than
    /// a quarter of the footprint shows it, or it was off screen.
    pub fn seen_before(&self, before: &Surfaces<'_>, i: usize) -> Option<usize> {
        if !self.is_surface(i) {
            return None;
        }
        let old = self.previous(i)?;
        let (world, normal, depth) = (self.world[i], self.normal(i), self.depth(i));
        let own_motion = self.previous_view.pixel(world).is_none_or(|p| (p - old).length() > OWN_MOTION_PX);
        let tolerance = (PLANE_DEPTH * depth).max(PLANE_PX * self.view.pixel_size(depth));
        let shows = |tap: usize| {
            if before.id(tap) != self.id(i) || !before.is_surface(tap) {
                return false;
            }
            let offset = before.world[tap] - world;
            match (own_motion, normal, before.normal(tap)) {
                (false, Some(a), Some(b)) => a.dot(b) >= SAME_NORMAL && offset.dot(a).abs() <= tolerance,
                (false, ..) => offset.dot(self.view.forward().into()).abs() <= 5.0 * tolerance,
                // It has moved by itself: its plane then is not known, its depth roughly is.
                (true, a, b) => {
                    let same_normal = a.zip(b).is_none_or(|(a, b)| a.dot(b) >= SAME_NORMAL);
                    same_normal && (before.depth(tap) - depth).abs() <= MOVED_DEPTH * depth
                }
            }
        };
        let mut seen = 0.0;
        let mut best = (0.0, None);
        for (tap, weight) in footprint(self.size, old) {
            if weight > 0.0 && shows(tap) {
                seen += weight;
                if weight > best.0 {
                    best = (weight, Some(tap));
                }
            }
        }
        if seen >= LEAST_SEEN { best.1 } else { None }
    }
}

/// What [`Surfaces::continues`] needs, in 11 bytes a pixel: normals in steps of 1/127, which is a third of a degree.
#[derive(Debug)]
pub struct Kept {
    size: Size,
    camera: Camera,
    depth: Option<Vec<f32>>,
    normal: Option<Vec<[i8; 3]>>,
    id: Option<Vec<u32>>,
}

impl Kept {
    /// Of a frame.
    pub fn new(frame: &FrameBuf) -> Self {
        let rounded = |n: &[f32; 3]| n.map(|v| (127.0 * v).round() as i8);
        Self {
            size: frame.size,
            camera: frame.camera,
            depth: frame.view_depth.as_ref().map(|p| p.data().to_vec()),
            normal: frame.normal.as_ref().map(|p| p.data().iter().map(rounded).collect()),
            id: frame.surface_id.as_ref().map(|p| p.data().to_vec()),
        }
    }

    /// The surfaces, without their motion; `None` where the camera cannot be used.
    pub fn surfaces(&self) -> Option<Surfaces<'_>> {
        let view = self.camera.projection(self.size)?;
        let unit = |n: &[i8; 3]| Vec3::from(n.map(f32::from)).normalize_or_zero().to_array();
        let mut surfaces = Surfaces {
            size: self.size,
            view,
            previous_view: view,
            depth: self.depth.as_deref().map(Cow::Borrowed),
            normal: self.normal.as_ref().map(|n| n.iter().map(unit).collect()),
            id: self.id.as_deref().map(Cow::Borrowed),
            motion: None,
            world: Vec::new(),
        };
        surfaces.place();
        Some(surfaces)
    }
}

/// The centre of a pixel.
pub fn centre(size: Size, i: usize) -> Vec2 {
    Vec2::new((i % size.width) as f32 + 0.5, (i / size.width) as f32 + 0.5)
}

/// The pixel that a continuous coordinate lies in; `None` off screen.
pub fn pixel_at(size: Size, p: Vec2) -> Option<usize> {
    let inside = p.x >= 0.0 && p.y >= 0.0 && p.x < size.width as f32 && p.y < size.height as f32;
    inside.then(|| p.y as usize * size.width + p.x as usize)
}

/// The four pixels around a coordinate with their bilinear weights; those off screen have weight 0.
pub fn footprint(size: Size, p: Vec2) -> [(usize, f32); 4] {
    let corner = p - 0.5;
    let base = corner.floor();
    let t = corner - base;
    std::array::from_fn(|k| {
        let (i, j) = (k & 1, k >> 1);
        // Far beyond any picture the conversion saturates, and the pixel is off screen.
        let (x, y) = ((base.x as isize).saturating_add(i as isize), (base.y as isize).saturating_add(j as isize));
        if !size.contains(x, y) {
            return (0, 0.0);
        }
        let weight = (if i == 0 { 1.0 - t.x } else { t.x }) * (if j == 0 { 1.0 - t.y } else { t.y });
        (y as usize * size.width + x as usize, weight)
    })
}

/// Weights of the cubic of Catmull and Rom for the taps -1, 0, 1, 2 at the fraction t.
fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (-t3 + 2.0 * t2 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0), 0.5 * (-3.0 * t3 + 4.0 * t2 + t), 0.5 * (t3 - t2)]
}

/// A map at a continuous coordinate by the cubic of Catmull and Rom; beyond the border the last pixel repeats.
pub fn cubic(map: &Plane<f32>, p: Vec2) -> f32 {
    let [v] = cubic_by(map.size(), p, |i| [map.data()[i]]);
    v
}

/// [`cubic`] of a colour.
pub fn cubic_rgb(map: &Plane<Rgb>, p: Vec2) -> Rgb {
    cubic_by(map.size(), p, |i| map.data()[i])
}

fn cubic_by<const N: usize>(size: Size, p: Vec2, at: impl Fn(usize) -> [f32; N]) -> [f32; N] {
    let corner = p - 0.5;
    let base = corner.floor();
    let t = corner - base;
    let (wx, wy) = (catmull_rom(t.x), catmull_rom(t.y));
    let clamped = |v: f32, extent: usize| (v.max(0.0) as usize).min(extent - 1);
    let columns: [usize; 4] = std::array::from_fn(|k| clamped(base.x + k as f32 - 1.0, size.width));
    let mut sum = [0.0; N];
    for (j, wy) in wy.iter().enumerate() {
        let row = clamped(base.y + j as f32 - 1.0, size.height) * size.width;
        for (&column, wx) in columns.iter().zip(&wx) {
            let value = at(row + column);
            for (s, v) in sum.iter_mut().zip(value) {
                *s += wx * wy * v;
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cubic_goes_through_pixels_and_keeps_lines() {
        let map = Plane::from_fn(Size::new(9, 7), |x, y| 2.0 * x as f32 - 3.0 * y as f32);
        assert_eq!(cubic(&map, Vec2::new(4.5, 3.5)), map.at(4, 3));
        assert!((cubic(&map, Vec2::new(4.75, 3.25)) - (2.0 * 4.25 - 3.0 * 2.75)).abs() < 1e-5);
        // Off screen the border repeats; nothing is read out of range.
        assert_eq!(cubic(&map, Vec2::new(-1e30, -5.0)), map.at(0, 0));
        assert_eq!(cubic(&map, Vec2::new(1e30, 1e30)), map.at(8, 6));
        assert!(footprint(map.size(), Vec2::new(1e30, -1e30)).iter().all(|t| t.1 == 0.0));
    }
}
