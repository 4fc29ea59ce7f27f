//! Feature buffers (AOVs) of a frame, as they wait in a window of frames.
//!
//! Feature buffers of other renderers are means over the pixel's samples (or one sample of it) and may be absent. Planes
//! in space are linear in 1/z over the image, so a slope of 1/z predicts a neighbour's depth without any camera.

use super::local::Class;
use super::mirrors::{WHITE, mirror_colour};
use super::packed::Packed;
use super::sparse::Sparse;
use super::vectors::Vectors;
use crate::frame::Rgb;
use crate::par;
use crate::plane::Size;
use crate::sequence::{LightKind, SequenceFrame, SequenceSettings};

/// What a pixel shows first.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct SurfacePoint {
    /// 1 / depth, depth along the camera's axis; 0: background, or no depth at all.
    pub inverse_depth: f32,
    /// Unit shading normal in world space, or zeros.
    pub normal: [f32; 3],
    /// World position, or zeros.
    pub position: [f32; 3],
}

/// Where a pixel's surface lies in the neighbouring frames: pixel + motion, in pixels, y down. NaN: unknown.
#[derive(Clone, Debug, Default)]
pub struct MotionPlanes {
    /// Motion of surfaces to the frame before.
    pub to_previous: Option<Vectors>,
    /// Motion of surfaces to the next frame.
    pub to_next: Option<Vectors>,
    /// Motion of what mirrors and clear glass show, to the frame before, where it is not the surface's. `None`: the surface's
    /// everywhere.
    pub reflection_to_previous: Option<Sparse<[f32; 2]>>,
    /// The same to the next frame.
    pub reflection_to_next: Option<Sparse<[f32; 2]>>,
}

/// Motion in one direction of time, of surfaces or of what mirrors and glass show.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    pub(crate) surface: &'a Vectors,
    pub(crate) reflection: Option<&'a Sparse<[f32; 2]>>,
}

impl Motion<'_> {
    /// Of a pixel.
    #[inline(always)]
    pub fn at(self, pixel: usize) -> [f32; 2] {
        if let Some(reflection) = self.reflection
            && let Some(motion) = reflection.get(pixel)
        {
            return motion;
        }
        self.surface.at(pixel)
    }
}

impl MotionPlanes {
    /// Motion forward or backward in time, of surfaces or of what mirrors and glass show.
    #[inline(always)]
    pub fn get(&self, forward: bool, reflected: bool) -> Option<Motion<'_>> {
        let (surface, reflection) = if forward {
            (&self.to_next, &self.reflection_to_next)
        } else {
            (&self.to_previous, &self.reflection_to_previous)
        };
        let reflection = if reflected { reflection.as_ref() } else { None };
        Some(Motion { surface: surface.as_ref()?, reflection })
    }
}

/// Feature buffers of a frame, or of a band of its rows.
#[derive(Clone, Debug)]
pub struct Features {
    /// Extent of what is here.
    pub size: Size,
    /// Row of the picture at which the band begins.
    pub first_row: usize,
    /// Rows of the picture.
    pub picture_height: usize,
    /// Row by row.
    pub surface: Vec<SurfacePoint>,
    /// Motion to the neighbouring frames.
    pub motion: MotionPlanes,
    /// True where motion is the camera's alone.
    pub(crate) camera_motion: bool,
    /// Tone-mapped albedo and unit normal seen in mirrors and through glass; `None`: absent.
    pub(crate) seen: Option<Packed>,
    /// Which of the two there are.
    pub(crate) has_seen: [bool; 2],
    /// Mean over 3x3 of that albedo, or of the surface's where that is absent: without the aliasing of mirrors and edges.
    pub(crate) albedo_around: Option<Packed>,
    /// Tone-mapped colour of the surface, where none seen in mirrors is known.
    pub(crate) surface_albedo: Option<Packed>,
    /// Tone-mapped colour of the surface, where a light needs it.
    pub(crate) albedo: Option<Packed>,
    /// The colour that light in mirrors and clear glass was divided by, in half precision; 1 where none is kept. `None`: nothing was
    /// divided.
    pub(crate) mirror_colour: Option<Sparse<Rgb>>,
    /// World-space size of a pixel per unit of depth; 0 where positions are unknown.
    pub pixel_angle: f32,
}

/// Depths beyond it are background, by convention of the formats that hold them: Cycles writes 1e10, others 1e30 or infinity.
const FAR: f32 = 1e9;

impl Features {
    /// The feature buffers of a frame, whose planes must have the frame's extent.
    pub fn new(frame: &SequenceFrame, settings: &SequenceSettings) -> Self {
        let (w, h) = (frame.size.width, frame.size.height);
        let mut surface = vec![SurfacePoint::default(); frame.size.pixels()];
        par::rows(&mut surface, w, |y, row| {
            for (x, s) in row.iter_mut().enumerate() {
                if let Some(depth) = &frame.depth {
                    let z = depth.at(x, y);
                    s.inverse_depth = if z > 0.0 && z < FAR { 1.0 / z } else { 0.0 };
                }
                s.normal = frame.normal.as_ref().map_or([0.0; 3], |n| unit(n.at(x, y)));
                if let Some(position) = &frame.position {
                    let p = position.at(x, y);
                    if p.iter().all(|c| c.is_finite()) {
                        s.position = p;
                    }
                }
            }
        });
        let pixel_angle = if frame.position.is_some() { pixel_angle(&surface, w, h) } else { 0.0 };
        let (albedo, normal) = (frame.seen_albedo.as_ref(), frame.seen_normal.as_ref());
        let has_seen = [albedo.is_some(), normal.is_some()];
        let seen = has_seen.contains(&true).then(|| {
            Packed::new(frame.size, 2, |k, i| {
                if k == 0 {
                    albedo.map_or([0.0; 3], |p| tone_mapped(p.data()[i]))
                } else {
                    normal.map_or([0.0; 3], |p| unit(p.data()[i]))
                }
            })
        });
        let own = frame.albedo.as_ref().filter(|_| !has_seen[0]);
        let own = own.map(|p| Packed::new(frame.size, 1, |_, i| tone_mapped(p.data()[i])));
        let albedo_around = own.as_ref().or(seen.as_ref().filter(|_| has_seen[0])).map(|p| mean_around(p, frame.size));
        let coloured = frame.lights.iter().any(|light| Class::of(light.kind) == Class::Coloured);
        let albedo = frame.albedo.as_ref().filter(|_| coloured);
        let albedo = albedo.map(|p| Packed::new(frame.size, 1, |_, i| tone_mapped(p.data()[i])));
        Self {
            size: frame.size,
            first_row: 0,
            picture_height: h,
            surface,
            motion: MotionPlanes {
                to_previous: frame.motion_to_previous.clone().map(Vectors::new),
                to_next: frame.motion_to_next.clone().map(Vectors::new),
                ..MotionPlanes::default()
            },
            camera_motion: frame.camera_motion,
            seen,
            has_seen,
            albedo_around,
            surface_albedo: own,
            albedo,
            mirror_colour: mirror_colour(frame, &settings.mirrors),
            pixel_angle,
        }
    }

    /// [`Features::albedo_around`] where it is the albedo seen in mirrors and through glass.
    pub(crate) fn seen_albedo_around(&self) -> Option<&Packed> {
        self.albedo_around.as_ref().filter(|_| self.has_seen[0])
    }

    /// Tone-mapped albedo of pixel `p` as seen in mirrors and through glass, else the surface's, else 0.
    #[inline(always)]
    pub(crate) fn guide_albedo(&self, p: usize) -> Rgb {
        match (&self.seen, &self.surface_albedo) {
            (Some(seen), _) if self.has_seen[0] => seen.at(0, p),
            (_, Some(albedo)) => albedo.at(0, p),
            _ => [0.0; 3],
        }
    }

    /// Unit normal of pixel `p` as seen in mirrors and through glass, else the surface's, else 0.
    #[inline(always)]
    pub(crate) fn guide_normal(&self, p: usize) -> Rgb {
        match &self.seen {
            Some(seen) if self.has_seen[1] => seen.at(1, p),
            _ => self.surface[p].normal,
        }
    }

    /// [`Self::is_mirror`] of every pixel, a bit each: for loops that ask often. Empty where no pixel is one.
    #[cfg(feature = "cpu")]
    pub(crate) fn mirror_bits(&self) -> Vec<u64> {
        let Some(colour) = &self.mirror_colour else { return Vec::new() };
        let mut bits = vec![0; self.size.pixels().div_ceil(64)];
        for (first, values) in colour.kept() {
            for p in (first..first + values.len()).filter(|p| self.is_mirror(*p)) {
                bits[p / 64] |= 1 << (p % 64);
            }
        }
        bits
    }

    /// True where pixel `p` is a mirror or clear glass.
    #[inline(always)]
    pub fn is_mirror(&self, p: usize) -> bool {
        // No closure: it would be a function of its own, called in the innermost loops.
        let Some(colour) = &self.mirror_colour else { return false };
        let Some([r, g, b]) = colour.get(p) else { return false };
        r != 1.0 || g != 1.0 || b != 1.0
    }

    /// The colour that light in mirrors and clear glass was divided by at pixel `p`; 1 where it was not.
    #[inline(always)]
    pub(crate) fn mirror_colour_at(&self, p: usize) -> Rgb {
        match &self.mirror_colour {
            Some(colour) => colour.get(p).unwrap_or(WHITE),
            None => WHITE,
        }
    }

    /// True where light of that kind is the image of other things in a mirror or glass: it has a motion of its own.
    pub fn reflects(&self, p: usize, kind: LightKind) -> bool {
        Self::can_reflect(kind) && self.is_mirror(p)
    }

    /// True where mirrors and glass show light of that kind.
    #[inline(always)]
    pub fn can_reflect(kind: LightKind) -> bool {
        matches!(kind, LightKind::GlossyIndirect | LightKind::Transmission)
    }

    /// The row here of a row of the picture, where it is here.
    #[inline(always)]
    pub(crate) fn row_here(&self, y: isize) -> Option<usize> {
        let here = y - self.first_row as isize;
        (here >= 0 && here < self.size.height as isize).then_some(here as usize)
    }

    /// Rows that motion leads up or down at most, to the frame before and to the next, as far as it stays in the picture.
    pub(crate) fn rows_moved(&self) -> [f32; 2] {
        let height = self.picture_height as f32;
        let most = |forward: bool, reflected: bool| {
            let Some(motion) = self.motion.get(forward, reflected) else { return 0.0 };
            let mut rows = vec![0.0f32; self.size.height];
            par::rows(&mut rows, 1, |y, most| {
                let moved = (y * self.size.width..(y + 1) * self.size.width).map(|i| {
                    let m = motion.at(i);
                    let y = (self.first_row + y) as f32 + m[1];
                    if y > -2.0 && y < height + 1.0 { m[1].abs() } else { 0.0 }
                });
                most[0] = moved.fold(0.0, f32::max);
            });
            rows.into_iter().fold(0.0, f32::max)
        };
        [false, true].map(|forward| most(forward, false).max(most(forward, true)))
    }

    /// Motion to the next frame from that frame's motion to this one: each of its pixels says where it was; of those
    /// that meet in a pixel the nearest to the eye wins. Known motion stays.
    pub(crate) fn derive_motion_to_next(&mut self, next: &Self) {
        let (w, h) = (self.size.width, self.size.height);
        let Some(back) = &next.motion.to_previous else { return };
        // Bands of rows, each of which looks at the rows of `next` that may lead there, in their order.
        let reach = next.rows_moved()[0].ceil() as usize + 1;
        let rows = h.div_ceil(par::threads()).max(4 * reach).max(1);
        let mut found = vec![([f32::NAN; 2], f32::MIN); w * h];
        par::rows(&mut found, (rows * w).max(1), |band, found| {
            let band = band * rows..band * rows + found.len() / w;
            for y in band.start.saturating_sub(reach)..(band.end + reach).min(h) {
                for x in 0..w {
                    let m = back.at(y * w + x);
                    let (px, py) = ((x as f32 + m[0]).round(), (y as f32 + m[1]).round());
                    if !(px >= 0.0 && py >= band.start as f32 && px < w as f32 && py < band.end as f32) {
                        continue;
                    }
                    let (motion, nearest) = &mut found[(py as usize - band.start) * w + px as usize];
                    let closeness = next.surface[y * w + x].inverse_depth;
                    if closeness > *nearest {
                        (*motion, *nearest) = ([-m[0], -m[1]], closeness);
                    }
                }
            }
        });
        let mut motion = self
            .motion
            .to_next
            .take()
            .map_or_else(|| par::plane(self.size, |_, _| [f32::NAN; 2]), |known| known.plane());
        par::rows(motion.data_mut(), w, |y, row| {
            for (known, (found, _)) in row.iter_mut().zip(&found[y * w..]) {
                if known.iter().any(|v| v.is_nan()) {
                    *known = *found;
                }
            }
        });
        self.motion.to_next = Some(Vectors::new(motion));
    }

    /// True where motion to the next frame is unknown somewhere: files hold none for the sky.
    pub(crate) fn lacks_motion_to_next(&self) -> bool {
        self.motion.to_next.as_ref().is_none_or(Vectors::lacks_some)
    }
}

/// Means over 3x3.
fn mean_around(albedo: &Packed, size: Size) -> Packed {
    let (w, h) = (size.width, size.height);
    Packed::by_rows(size, 1, |y, out| {
        let rows = y.saturating_sub(1)..(y + 2).min(h);
        let mut colours = vec![[0.0; 3]; rows.len() * w];
        for (row, y) in colours.chunks_exact_mut(w).zip(rows.clone()) {
            albedo.row(0, y, row);
        }
        for (x, out) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let columns = x.saturating_sub(1)..(x + 2).min(w);
            let mut sum = [0.0f32; 3];
            for row in colours.chunks_exact(w) {
                for colour in &row[columns.clone()] {
                    for c in 0..3 {
                        sum[c] += colour[c];
                    }
                }
            }
            let n = (rows.len() * columns.len()) as f32;
            *out = sum.map(|s| s / n);
        }
    })
}

/// Colour in 0..2.
fn tone_mapped(colour: Rgb) -> Rgb {
    colour.map(|v| if v.is_finite() && v > 0.0 { 2.0 * (v / (1.0 + v)) } else { 0.0 })
}

fn unit(n: [f32; 3]) -> [f32; 3] {
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 1e-3 && length.is_finite() { n.map(|c| c / length) } else { [0.0; 3] }
}

/// World-space distance of neighbouring pixels over their depth, of the surfaces that face the camera most directly.
fn pixel_angle(surface: &[SurfacePoint], w: usize, h: usize) -> f32 {
    let mut ratios: Vec<f32> = Vec::new();
    for y in (0..h).step_by(4) {
        for x in (0..w.saturating_sub(1)).step_by(3) {
            let (a, b) = (&surface[y * w + x], &surface[y * w + x + 1]);
            let d = (0..3).map(|c| (a.position[c] - b.position[c]).powi(2)).sum::<f32>().sqrt();
            let ratio = d * a.inverse_depth;
            if ratio > 0.0 && ratio.is_finite() {
                ratios.push(ratio);
            }
        }
    }
    if ratios.is_empty() {
        return 0.0;
    }
    let rank = ratios.len() / 10;
    *ratios.select_nth_unstable_by(rank, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Plane;

    #[test]
    fn albedo_around_is_the_surfaces_where_none_is_seen() {
        let size = Size::new(4, 3);
        let settings = SequenceSettings::default();
        let plane = |value: f32| Some(Plane::from_fn(size, |x, _| [if x < 2 { value } else { 0.0 }, 0.1, 0.0]));
        let mut frame = SequenceFrame::new(1, size);
        let around = |frame: &SequenceFrame| Features::new(frame, &settings).albedo_around.map(|a| a.at(0, 5)[0]);
        assert_eq!(around(&frame), None);
        frame.albedo = plane(1.0);
        // Tone-mapped to 1 in two of three columns.
        let own = around(&frame).expect("the surface's");
        assert!((own - 2.0 / 3.0).abs() < 1e-3, "{own}");
        frame.seen_albedo = plane(3.0);
        let seen = around(&frame).expect("what is seen");
        assert!((seen - 1.0).abs() < 1e-3, "{seen}");
    }
}
