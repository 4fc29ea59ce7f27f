//! The border: planes as a host gives them become planes that every stage may trust. Whatever is repaired is counted.

use crate::camera::Projection;
use crate::error::Error;
use crate::frame::{Frame, Rgb};
use crate::kernels::edge::Surface;
use crate::par;
use crate::plane::{Plane, PlaneRef, Size};
use glam::{Vec2, Vec3};
use std::sync::atomic::{AtomicU64, Ordering};

/// A plane of the frame, as the report of repairs names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names of the planes of `Frame`")]
pub enum PlaneName {
    Direct,
    Matte,
    Glossy,
    DirectMatte,
    DirectGlossy,
    MatteWeight,
    GlossyWeight,
    Passes,
    ViewDepth,
    Normal,
    Roughness,
    Motion,
    GlossyHitDistance,
    ConfidenceIn,
}

impl PlaneName {
    /// All of them, in the order of the report.
    pub const ALL: [Self; 14] = [
        Self::Direct,
        Self::Matte,
        Self::Glossy,
        Self::DirectMatte,
        Self::DirectGlossy,
        Self::MatteWeight,
        Self::GlossyWeight,
        Self::Passes,
        Self::ViewDepth,
        Self::Normal,
        Self::Roughness,
        Self::Motion,
        Self::GlossyHitDistance,
        Self::ConfidenceIn,
    ];

    /// The plane's name in the frame contract.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Matte => "matte",
            Self::Glossy => "glossy",
            Self::DirectMatte => "direct_matte",
            Self::DirectGlossy => "direct_glossy",
            Self::MatteWeight => "matte_weight",
            Self::GlossyWeight => "glossy_weight",
            Self::Passes => "passes",
            Self::ViewDepth => "view_depth",
            Self::Normal => "normal",
            Self::Roughness => "roughness",
            Self::Motion => "motion",
            Self::GlossyHitDistance => "glossy_hit_distance",
            Self::ConfidenceIn => "confidence_in",
        }
    }
}

/// What was wrong with a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repair {
    /// NaN or an infinity where none is allowed: taken as 0 (depth: background; roughness: 1).
    NotFinite,
    /// A negative colour: kept, only counted.
    Negative,
    /// A normal that is not unit: normalised.
    NotUnit,
    /// Outside the plane's range: clamped (depth at or below 0: background).
    OutOfRange,
}

impl Repair {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::NotFinite, Self::Negative, Self::NotUnit, Self::OutOfRange];

    /// For messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotFinite => "not finite",
            Self::Negative => "negative (kept)",
            Self::NotUnit => "not unit",
            Self::OutOfRange => "out of range",
        }
    }
}

/// How many values of each plane were repaired, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sanitised {
    counts: [[u64; Repair::ALL.len()]; PlaneName::ALL.len()],
}

impl Sanitised {
    /// Values of `plane` that were repaired so.
    pub fn count(&self, plane: PlaneName, repair: Repair) -> u64 {
        self.counts[plane as usize][repair as usize]
    }

    /// Everything that was found, without zeros.
    pub fn iter(&self) -> impl Iterator<Item = (PlaneName, Repair, u64)> + '_ {
        PlaneName::ALL
            .into_iter()
            .flat_map(|p| Repair::ALL.into_iter().map(move |r| (p, r)))
            .map(|(p, r)| (p, r, self.count(p, r)))
            .filter(|(_, _, n)| *n > 0)
    }

    /// True where nothing was found.
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    /// From counts in the order of [`PlaneName::ALL`], for each those of [`Repair::ALL`]; what is missing counts as 0.
    #[cfg(feature = "gpu")]
    pub(crate) fn from_counts(counts: &[u64]) -> Self {
        let mut sanitised = Self::default();
        sanitised.counts.iter_mut().flatten().zip(counts).for_each(|(to, from)| *to = *from);
        sanitised
    }

    pub(crate) fn add(&mut self, plane: PlaneName, tally: &Tally) {
        for (sum, count) in self.counts[plane as usize].iter_mut().zip(&tally.0) {
            *sum += count.load(Ordering::Relaxed);
        }
    }
}

/// Counts of one plane, added to by many threads.
#[derive(Default)]
pub(crate) struct Tally([AtomicU64; Repair::ALL.len()]);

impl Tally {
    pub(crate) fn add(&self, row: RowTally) {
        for (total, n) in self.0.iter().zip(row) {
            if n > 0 {
                total.fetch_add(n, Ordering::Relaxed);
            }
        }
    }
}

/// Counts of one row.
pub(crate) type RowTally = [u64; Repair::ALL.len()];

#[inline(always)]
fn note(row: &mut RowTally, repair: Repair) {
    row[repair as usize] += 1;
}

/// Colours beyond it would overflow where stages square and add them up.
pub(crate) const COLOUR_LIMIT: f32 = 1e15;

#[inline(always)]
pub(crate) fn clean_colour(c: Rgb, row: &mut RowTally) -> Rgb {
    let mut out = c;
    if !(c[0].is_finite() && c[1].is_finite() && c[2].is_finite()) {
        note(row, Repair::NotFinite);
        out = c.map(|v| if v.is_finite() { v } else { 0.0 });
    }
    if out.iter().any(|v| v.abs() > COLOUR_LIMIT) {
        note(row, Repair::OutOfRange);
        out = out.map(|v| v.clamp(-COLOUR_LIMIT, COLOUR_LIMIT));
    }
    if out.iter().any(|v| *v < 0.0) {
        note(row, Repair::Negative);
    }
    out
}

#[inline(always)]
pub(crate) fn clean_unit_range(v: f32, when_not_finite: f32, row: &mut RowTally) -> f32 {
    if !v.is_finite() {
        note(row, Repair::NotFinite);
        return when_not_finite;
    }
    if !(0.0..=1.0).contains(&v) {
        note(row, Repair::OutOfRange);
    }
    v.clamp(0.0, 1.0)
}

/// Normals whose squared length differs from 1 by more are normalised; half-float rounding stays within.
pub(crate) const UNIT_TOLERANCE: f32 = 4e-3;

/// [`clean_unit_range`] has nothing to do.
#[cfg(feature = "cpu")]
#[inline(always)]
pub(crate) fn is_in_unit_range(v: f32) -> bool {
    (0.0..=1.0).contains(&v)
}

/// [`clean_normal`] has nothing to do.
#[cfg(feature = "cpu")]
#[inline(always)]
pub(crate) fn is_normal(n: [f32; 3]) -> bool {
    let squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    // Not finite: false in both.
    (squared == 0.0) | ((squared - 1.0).abs() <= UNIT_TOLERANCE)
}

/// [`clean_motion`] has nothing to do.
#[cfg(feature = "cpu")]
#[inline(always)]
pub(crate) fn is_motion(v: [f32; 2]) -> bool {
    !v[0].is_infinite() & !v[1].is_infinite()
}

#[inline(always)]
pub(crate) fn clean_normal(n: [f32; 3], row: &mut RowTally) -> [f32; 3] {
    if !n.iter().all(|v| v.is_finite()) {
        note(row, Repair::NotFinite);
        return [0.0; 3];
    }
    let squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    if squared == 0.0 || (squared - 1.0).abs() <= UNIT_TOLERANCE {
        return n;
    }
    note(row, Repair::NotUnit);
    let v = Vec3::from(n).as_dvec3().normalize_or_zero().as_vec3();
    v.to_array()
}

#[inline(always)]
pub(crate) fn clean_depth(z: f32, row: &mut RowTally) -> f32 {
    if z.is_nan() {
        note(row, Repair::NotFinite);
        return f32::INFINITY;
    }
    if z <= 0.0 {
        note(row, Repair::OutOfRange);
        return f32::INFINITY;
    }
    z
}

#[inline(always)]
pub(crate) fn clean_hit(v: f32, row: &mut RowTally) -> f32 {
    if v.is_nan() {
        note(row, Repair::NotFinite);
        0.0 // unknown: as if the reflection lay in the surface
    } else if v < 0.0 {
        note(row, Repair::OutOfRange);
        0.0
    } else {
        v
    }
}

#[inline(always)]
pub(crate) fn clean_motion(v: [f32; 2], row: &mut RowTally) -> [f32; 2] {
    if v[0].is_infinite() || v[1].is_infinite() {
        note(row, Repair::NotFinite);
        [f32::NAN; 2]
    } else {
        v
    }
}

fn copy_clean<T: Copy + Send + Sync>(
    source: PlaneRef<'_, T>,
    target: &mut Plane<T>,
    name: PlaneName,
    sanitised: &mut Sanitised,
    clean: impl Fn(T, &mut RowTally) -> T + Sync + Send,
) {
    let tally = Tally::default();
    let width = target.size().width;
    par::rows(target.data_mut(), width, |y, row| {
        let mut counts = RowTally::default();
        for (out, value) in row.iter_mut().zip(source.row(y)) {
            *out = clean(*value, &mut counts);
        }
        tally.add(counts);
    });
    sanitised.add(name, &tally);
}

/// Copies a colour plane, or fills it with `absent`.
pub(crate) fn copy_colour(
    source: Option<PlaneRef<'_, Rgb>>,
    absent: f32,
    target: &mut Plane<Rgb>,
    name: PlaneName,
    sanitised: &mut Sanitised,
) {
    match source {
        Some(source) => copy_clean(source, target, name, sanitised, clean_colour),
        None => target.data_mut().fill([absent; 3]),
    }
}

/// The guides of one frame, cleaned, absent ones filled in by the contract.
#[derive(Clone, Debug)]
pub struct Guides {
    /// Extent.
    pub size: Size,
    /// View depth; +inf: background.
    pub depth: Plane<f32>,
    /// World normal.
    pub normal: Plane<[f32; 3]>,
    /// Perceptual roughness.
    pub roughness: Plane<f32>,
    /// Object or material.
    pub id: Plane<u32>,
    /// Previous = current + motion, pixels; NaN: unknown.
    pub motion: Plane<[f32; 2]>,
    /// Glossy hit distance; only meaningful where `has_glossy_hit`.
    pub glossy_hit: Plane<f32>,
    /// The host's trust in history.
    pub confidence_in: Plane<f32>,
    /// The host gave glossy hit distances.
    pub has_glossy_hit: bool,
    /// The host gave roughness.
    pub has_roughness: bool,
    /// This frame's camera.
    pub view: Projection,
    /// The camera of the frame before, for the motion of what does not move by itself.
    pub previous_view: Projection,
    /// This frame's sample positions relative to pixel centres.
    pub(crate) jitter: Vec2,
}

impl Guides {
    /// Room for frames of `size`.
    pub(crate) fn new(size: Size, view: Projection) -> Self {
        Self {
            size,
            depth: Plane::filled(size, f32::INFINITY),
            normal: Plane::filled(size, [0.0; 3]),
            roughness: Plane::filled(size, 1.0),
            id: Plane::filled(size, 0),
            motion: Plane::filled(size, [0.0; 2]),
            glossy_hit: Plane::filled(size, 0.0),
            confidence_in: Plane::filled(size, 1.0),
            has_glossy_hit: false,
            has_roughness: false,
            view,
            previous_view: view,
            jitter: Vec2::ZERO,
        }
    }

    /// The guides of a frame, for hosts that hand them to another device.
    ///
    /// # Errors
    /// What [`Frame::check`] finds.
    pub fn of(frame: &Frame<'_>, sanitised: &mut Sanitised) -> Result<Self, Error> {
        frame.check(frame.size)?;
        let view = frame.camera.projection(frame.size).ok_or(Error::Camera { which: "camera" })?;
        let mut guides = Self::new(frame.size, view);
        guides.read(frame, sanitised)?;
        Ok(guides)
    }

    /// Reads a checked frame.
    pub(crate) fn read(&mut self, frame: &Frame<'_>, sanitised: &mut Sanitised) -> Result<(), Error> {
        let size = self.size;
        self.view = frame.camera.projection(size).ok_or(Error::Camera { which: "camera" })?;
        self.previous_view =
            frame.previous_camera.projection(size).ok_or(Error::Camera { which: "previous_camera" })?;
        self.jitter = Vec2::from(frame.camera.jitter);
        match frame.view_depth {
            Some(p) => copy_clean(p, &mut self.depth, PlaneName::ViewDepth, sanitised, clean_depth),
            None => self.depth.data_mut().fill(1.0),
        }
        match frame.normal {
            Some(p) => copy_clean(p, &mut self.normal, PlaneName::Normal, sanitised, clean_normal),
            None => self.normal.data_mut().fill((-self.view.forward).to_array()),
        }
        // A normal of (0, 0, 0) says background, whatever the depth.
        let normal = &self.normal;
        par::rows(self.depth.data_mut(), size.width, |y, row| {
            for (depth, n) in row.iter_mut().zip(normal.row(y)) {
                if *n == [0.0; 3] {
                    *depth = f32::INFINITY;
                }
            }
        });
        self.has_roughness = frame.roughness.is_some();
        match frame.roughness {
            Some(p) => {
                copy_clean(p, &mut self.roughness, PlaneName::Roughness, sanitised, |v, t| clean_unit_range(v, 1.0, t))
            }
            None => self.roughness.data_mut().fill(1.0),
        }
        match frame.surface_id {
            // Any number is an identity: nothing to repair.
            Some(p) => par::rows(self.id.data_mut(), size.width, |y, row| row.copy_from_slice(p.row(y))),
            None => self.id.data_mut().fill(0),
        }
        self.has_glossy_hit = frame.glossy_hit_distance.is_some();
        match frame.glossy_hit_distance {
            Some(p) => {
                copy_clean(p, &mut self.glossy_hit, PlaneName::GlossyHitDistance, sanitised, clean_hit);
            }
            None => self.glossy_hit.data_mut().fill(0.0),
        }
        match frame.confidence_in {
            Some(p) => copy_clean(p, &mut self.confidence_in, PlaneName::ConfidenceIn, sanitised, |v, t| {
                clean_unit_range(v, 0.0, t)
            }),
            None => self.confidence_in.data_mut().fill(1.0),
        }
        match frame.motion {
            Some(p) => copy_clean(p, &mut self.motion, PlaneName::Motion, sanitised, clean_motion),
            None => {
                let (view, previous, jitter, depth) = (self.view, self.previous_view, self.jitter, &self.depth);
                par::rows(self.motion.data_mut(), size.width, |y, row| {
                    for (x, motion) in row.iter_mut().enumerate() {
                        *motion = camera_motion(&view, &previous, sample_position(x, y, jitter), depth.at(x, y))
                            .map_or([f32::NAN; 2], |m| m.to_array());
                    }
                });
            }
        }
        Ok(())
    }

    /// Where pixel (x, y) was sampled.
    #[inline(always)]
    pub fn sample_position(&self, x: usize, y: usize) -> Vec2 {
        sample_position(x, y, self.jitter)
    }

    /// World position of pixel (x, y), whose depth must be finite.
    #[inline(always)]
    pub fn world(&self, x: usize, y: usize) -> Vec3 {
        self.view.world(self.sample_position(x, y), self.depth.at(x, y))
    }

    /// The surface of pixel (x, y), relative to the eye; its position is only meaningful where the depth is finite.
    #[inline(always)]
    pub fn surface(&self, x: usize, y: usize) -> Surface {
        let (origin, direction) = self.ray(x, y);
        let view_depth = self.depth.at(x, y);
        Surface {
            position: origin + direction * view_depth,
            normal: Vec3::from(self.normal.at(x, y)),
            view_depth,
            roughness: self.roughness.at(x, y),
            id: self.id.at(x, y),
        }
    }

    /// The ray of pixel (x, y): origin relative to the eye, direction scaled to one unit of view depth.
    #[inline(always)]
    pub fn ray(&self, x: usize, y: usize) -> (Vec3, Vec3) {
        let pixel = self.sample_position(x, y);
        (self.view.ray_origin(pixel) - self.view.eye, self.view.ray_direction(pixel))
    }

    /// True where pixel (x, y) shows a surface.
    #[inline(always)]
    pub fn is_surface(&self, x: usize, y: usize) -> bool {
        self.depth.at(x, y).is_finite()
    }
}

/// Centre of pixel (x, y) plus jitter.
#[inline(always)]
pub(crate) fn sample_position(x: usize, y: usize, jitter: Vec2) -> Vec2 {
    Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + jitter
}

/// Motion that the camera alone gives to what is seen at `pixel`; `None` behind the previous eye.
#[inline(always)]
pub(crate) fn camera_motion(view: &Projection, previous: &Projection, pixel: Vec2, depth: f32) -> Option<Vec2> {
    let before = if depth.is_finite() {
        previous.pixel(view.world(pixel, depth))
    } else {
        previous.pixel_of_direction(view.ray_direction(pixel))
    };
    before.map(|p| p - pixel).filter(|m| m.is_finite())
}
