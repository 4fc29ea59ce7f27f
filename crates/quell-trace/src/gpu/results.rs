//! Planes of a band, read back: into frames and references.

use super::layout;
use crate::integrator::RayCounts;
use crate::primary::Views;
use crate::tracer::{HalfSignals, Reference, ReferenceKind, RenderOptions, Rendered};
use quell::{FrameBuf, Plane, Rgb, Size};
use std::ops::Range;

/// The planes of one band's results.
struct Read<'a> {
    numbers: &'a [u32],
    pixels: usize,
}

impl Read<'_> {
    fn bits(&self, plane: u32, i: usize) -> u32 {
        self.numbers.get(plane as usize * self.pixels + i).copied().unwrap_or(0)
    }

    fn number(&self, plane: u32, i: usize) -> f32 {
        f32::from_bits(self.bits(plane, i))
    }

    fn rgb(&self, plane: u32, i: usize) -> Rgb {
        [0, 1, 2].map(|c| self.number(plane + c, i))
    }

    fn distance(&self, plane: u32, i: usize) -> f32 {
        let distance = self.number(plane, i);
        if distance >= layout::INFINITE { f32::INFINITY } else { distance }
    }

    fn motion(&self, i: usize) -> [f32; 2] {
        let motion = [0, 1].map(|c| self.number(layout::MOTION + c, i));
        motion.map(|v| if v == layout::UNKNOWN_MOTION { f32::NAN } else { v })
    }

    fn rays(&self) -> RayCounts {
        let sum = |plane| (0..self.pixels).map(|i| u64::from(self.bits(plane, i))).sum();
        RayCounts { closest: sum(layout::CLOSEST_RAYS), shadow: sum(layout::SHADOW_RAYS) }
    }
}

/// A frame that is filled band by band.
#[derive(Debug)]
pub(super) struct FrameResult {
    frame: FrameBuf,
    halves: Option<[HalfSignals; 2]>,
    rays: RayCounts,
    notes: Vec<String>,
}

/// A plane that every frame of the tracer has.
fn of<T>(plane: &mut Option<Plane<T>>, x: usize, y: usize, value: T)
where
    T: Copy,
{
    if let Some(plane) = plane {
        plane.set(x, y, value);
    }
}

impl FrameResult {
    /// An empty frame.
    pub(super) fn new(options: &RenderOptions, views: &Views, number: i64, notes: Vec<String>) -> Self {
        let size = options.size;
        let black = || Some(Plane::filled(size, [0.0; 3]));
        let zero = || Some(Plane::filled(size, 0.0));
        let variances = options.variances && options.samples > 1;
        let mut frame = FrameBuf::new(size, views.camera);
        frame.previous_camera = views.previous_camera;
        frame.index = number;
        frame.direct = black();
        frame.matte = black();
        frame.glossy = black();
        frame.matte_weight = black();
        frame.glossy_weight = black();
        frame.normal = black();
        frame.view_depth = zero();
        frame.roughness = zero();
        frame.motion = Some(Plane::filled(size, [0.0; 2]));
        frame.surface_id = Some(Plane::filled(size, 0));
        frame.matte_hit_distance = zero();
        frame.glossy_hit_distance = zero();
        frame.matte_variance = zero().filter(|_| variances);
        frame.glossy_variance = zero().filter(|_| variances);
        let half = || HalfSignals { matte: Plane::filled(size, [0.0; 3]), glossy: Plane::filled(size, [0.0; 3]) };
        let halves = options.separate_halves().then(|| [half(), half()]);
        Self { frame, halves, rays: RayCounts::default(), notes }
    }

    /// Takes the results of a band: what its planes held.
    pub(super) fn take(&mut self, rows: &Range<usize>, bytes: &[u8]) {
        let width = self.frame.size.width;
        let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
        let read = Read { numbers: &numbers, pixels: rows.len() * width };
        self.rays.add(read.rays());
        let frame = &mut self.frame;
        for i in 0..read.pixels {
            let (x, y) = (i % width, rows.start + i / width);
            of(&mut frame.direct, x, y, read.rgb(layout::DIRECT, i));
            of(&mut frame.matte, x, y, read.rgb(layout::MATTE, i));
            of(&mut frame.glossy, x, y, read.rgb(layout::GLOSSY, i));
            of(&mut frame.matte_weight, x, y, read.rgb(layout::MATTE_WEIGHT, i));
            of(&mut frame.glossy_weight, x, y, read.rgb(layout::GLOSSY_WEIGHT, i));
            of(&mut frame.normal, x, y, read.rgb(layout::NORMAL, i));
            of(&mut frame.view_depth, x, y, read.distance(layout::VIEW_DEPTH, i));
            of(&mut frame.roughness, x, y, read.number(layout::ROUGHNESS, i));
            of(&mut frame.motion, x, y, read.motion(i));
            of(&mut frame.surface_id, x, y, read.bits(layout::SURFACE_ID, i));
            of(&mut frame.matte_hit_distance, x, y, read.distance(layout::MATTE_DISTANCE, i));
            of(&mut frame.glossy_hit_distance, x, y, read.distance(layout::GLOSSY_DISTANCE, i));
            of(&mut frame.matte_variance, x, y, read.number(layout::MATTE_VARIANCE, i));
            of(&mut frame.glossy_variance, x, y, read.number(layout::GLOSSY_VARIANCE, i));
            if let Some([a, b]) = &mut self.halves {
                a.matte.set(x, y, read.rgb(layout::MATTE_HALF_A, i));
                b.matte.set(x, y, read.rgb(layout::MATTE_HALF_B, i));
                a.glossy.set(x, y, read.rgb(layout::GLOSSY_HALF_A, i));
                b.glossy.set(x, y, read.rgb(layout::GLOSSY_HALF_B, i));
            }
        }
    }

    /// The whole frame, after all bands.
    pub(super) fn finish(self) -> Rendered {
        let Self { frame, halves, rays, notes } = self;
        Rendered { frame, rays, halves, notes }
    }
}

/// A reference that is filled band by band.
#[derive(Debug)]
pub(super) struct ReferenceResult(Reference);

impl ReferenceResult {
    /// An empty one of so many samples.
    pub(super) fn new(size: Size, kind: ReferenceKind, samples: &Range<u32>) -> Self {
        let black = || Plane::filled(size, [0.0; 3]);
        Self(Reference {
            size,
            kind,
            samples: samples.len() as u64,
            beauty: black(),
            direct: black(),
            matte: black(),
            glossy: black(),
            variance: black(),
            rays: RayCounts::default(),
        })
    }

    /// Takes the results of a band: what its planes held.
    pub(super) fn take(&mut self, rows: &Range<usize>, bytes: &[u8]) {
        let reference = &mut self.0;
        let width = reference.size.width;
        let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
        let read = Read { numbers: &numbers, pixels: rows.len() * width };
        reference.rays.add(read.rays());
        let n = reference.samples as f32;
        let factored = reference.kind == ReferenceKind::Factored;
        for i in 0..read.pixels {
            let (x, y) = (i % width, rows.start + i / width);
            reference.beauty.set(x, y, read.rgb(layout::BEAUTY_MEAN, i));
            let squares = read.rgb(layout::BEAUTY_SQUARES, i);
            reference.variance.set(x, y, squares.map(|s| if n > 1.0 { s / (n * (n - 1.0)) } else { 0.0 }));
            if factored {
                reference.direct.set(x, y, read.rgb(layout::DIRECT_MEAN, i));
                reference.matte.set(x, y, read.rgb(layout::MATTE_MEAN, i));
                reference.glossy.set(x, y, read.rgb(layout::GLOSSY_MEAN, i));
            }
        }
    }

    /// The whole reference, after all bands.
    pub(super) fn finish(self) -> Reference {
        self.0
    }
}
