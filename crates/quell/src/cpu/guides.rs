//! The frame's planes, cleaned as `border.rs` says and laid out for this back end.

use super::layout::{Colours, Phases};
use super::rows;
use crate::border::{
    COLOUR_LIMIT, PlaneName, RowTally, Sanitised, Tally, camera_motion, clean_colour, clean_depth, clean_hit,
    clean_motion, clean_normal, clean_unit_range, sample_position,
};
use crate::camera::Projection;
use crate::error::Error;
use crate::frame::{Frame, Rgb};
use crate::kernels::spiral::PERIOD;
use crate::plane::{Plane, PlaneRef};
use glam::Vec2;

/// What each pixel of a frame shows: the part of the guides that the next frame looks back at.
#[derive(Clone, Debug)]
pub(crate) struct Surfaces {
    /// View depth; +inf: background.
    pub depth: Vec<f32>,
    /// World normal: row by row x, y, z.
    pub normal: Vec<f32>,
    /// Perceptual roughness.
    pub roughness: Vec<f32>,
    /// Object or material.
    pub id: Vec<u32>,
    /// The camera that took the frame.
    pub view: Projection,
    /// Sample positions relative to pixel centres.
    pub jitter: Vec2,
}

impl Surfaces {
    fn new(phases: &Phases, view: Projection) -> Self {
        let n = phases.size.pixels();
        Self {
            depth: vec![f32::INFINITY; n],
            normal: vec![0.0; 3 * n],
            roughness: vec![1.0; n],
            id: vec![0; n],
            view,
            jitter: Vec2::ZERO,
        }
    }
}

/// The guides of a frame and the surfaces of the frame before.
#[derive(Clone, Debug)]
pub(crate) struct CpuGuides {
    pub phases: Phases,
    pub now: Surfaces,
    pub before: Surfaces,
    /// The camera of the frame before, as this frame tells it.
    pub previous_view: Projection,
    /// Previous = current + motion, pixels; NaN: unknown. Row by row x, y.
    pub motion: Vec<f32>,
    /// Glossy hit distance; empty where the host gave none.
    pub glossy_hit: Vec<f32>,
    /// The host's trust in history; empty where it gave none, which means 1.
    pub confidence_in: Vec<f32>,
    pub has_roughness: bool,
}

/// Row `y` of an image of `fields` scalars a pixel: field `k`.
#[inline(always)]
pub(crate) fn field<T>(data: &[T], width: usize, fields: usize, y: usize, k: usize) -> &[T] {
    &data[(y * fields + k) * width..][..width]
}

impl CpuGuides {
    pub fn new(phases: Phases, view: Projection) -> Self {
        Self {
            phases,
            now: Surfaces::new(&phases, view),
            before: Surfaces::new(&phases, view),
            previous_view: view,
            motion: vec![0.0; 2 * phases.size.pixels()],
            glossy_hit: Vec::new(),
            confidence_in: Vec::new(),
            has_roughness: false,
        }
    }

    /// The host gave glossy hit distances.
    pub fn has_glossy_hit(&self) -> bool {
        !self.glossy_hit.is_empty()
    }

    /// Reads a checked frame; what was `now` becomes `before`.
    pub fn read(&mut self, frame: &Frame<'_>, sanitised: &mut Sanitised) -> Result<(), Error> {
        let (phases, size) = (self.phases, self.phases.size);
        let view = frame.camera.projection(size).ok_or(Error::Camera { which: "camera" })?;
        let previous_view = frame.previous_camera.projection(size).ok_or(Error::Camera { which: "previous_camera" })?;
        std::mem::swap(&mut self.now, &mut self.before);
        let now = &mut self.now;
        now.view = view;
        now.jitter = Vec2::from(frame.camera.jitter);
        self.previous_view = previous_view;
        match frame.view_depth {
            Some(p) => {
                read_scalars(&phases, p, &mut now.depth, Some(PlaneName::ViewDepth), sanitised, clean_depth);
            }
            None => now.depth.fill(1.0),
        }
        match frame.normal {
            Some(p) => {
                read_vectors(&phases, p, &mut now.normal, PlaneName::Normal, sanitised, clean_normal);
                // A normal of (0, 0, 0) says background, whatever the depth.
                let normal = &now.normal;
                rows::each(&mut now.depth, size.width, |y, row| {
                    let [x, y, z] = [0, 1, 2].map(|c| field(normal, size.width, 3, y, c));
                    for i in 0..row.len() {
                        let none = (x[i] == 0.0) & (y[i] == 0.0) & (z[i] == 0.0);
                        row[i] = if none { f32::INFINITY } else { row[i] };
                    }
                });
            }
            None => {
                let facing = (-view.forward).to_array();
                rows::each(&mut now.normal, 3 * size.width, |_, row| {
                    for (field, value) in row.chunks_mut(size.width).zip(facing) {
                        field.fill(value);
                    }
                });
            }
        }
        self.has_roughness = frame.roughness.is_some();
        match frame.roughness {
            Some(p) => {
                read_scalars(&phases, p, &mut now.roughness, Some(PlaneName::Roughness), sanitised, |v, t| {
                    clean_unit_range(v, 1.0, t)
                });
            }
            None => now.roughness.fill(1.0),
        }
        match frame.surface_id {
            Some(p) => read_scalars(&phases, p, &mut now.id, None, sanitised, |v, _| v),
            None => now.id.fill(0),
        }
        resize(&mut self.glossy_hit, frame.glossy_hit_distance.is_some(), size.pixels());
        if let Some(p) = frame.glossy_hit_distance {
            read_scalars(&phases, p, &mut self.glossy_hit, Some(PlaneName::GlossyHitDistance), sanitised, clean_hit);
        }
        resize(&mut self.confidence_in, frame.confidence_in.is_some(), size.pixels());
        if let Some(p) = frame.confidence_in {
            read_scalars(&phases, p, &mut self.confidence_in, Some(PlaneName::ConfidenceIn), sanitised, |v, t| {
                clean_unit_range(v, 0.0, t)
            });
        }
        match frame.motion {
            Some(p) => read_vectors(&phases, p, &mut self.motion, PlaneName::Motion, sanitised, clean_motion),
            None => {
                let (depth, jitter) = (&self.now.depth, self.now.jitter);
                rows::each(&mut self.motion, 2 * size.width, |y, row| {
                    let depth = field(depth, size.width, 1, y, 0);
                    let (mx, my) = row.split_at_mut(size.width);
                    for phase in 0..PERIOD {
                        for (i, e) in phases.range(phase).enumerate() {
                            let position = sample_position(PERIOD * i + phase, y, jitter);
                            let motion = camera_motion(&view, &previous_view, position, depth[e]);
                            [mx[e], my[e]] = motion.map_or([f32::NAN; 2], |m| m.to_array());
                        }
                    }
                });
            }
        }
        Ok(())
    }
}

fn resize(data: &mut Vec<f32>, wanted: bool, len: usize) {
    if wanted {
        data.resize(len, 0.0);
    } else if !data.is_empty() {
        *data = Vec::new();
    }
}

fn read_scalars<T: Copy + Send + Sync>(
    phases: &Phases,
    source: PlaneRef<'_, T>,
    target: &mut [T],
    name: Option<PlaneName>,
    sanitised: &mut Sanitised,
    clean: impl Fn(T, &mut RowTally) -> T + Sync + Send,
) {
    let tally = Tally::default();
    rows::each(target, phases.size.width, |y, row| {
        let mut counts = RowTally::default();
        let source = source.row(y);
        for phase in 0..PERIOD {
            let of_phase = source.iter().skip(phase).step_by(PERIOD);
            for (out, value) in row[phases.range(phase)].iter_mut().zip(of_phase) {
                *out = clean(*value, &mut counts);
            }
        }
        tally.add(counts);
    });
    if let Some(name) = name {
        sanitised.add(name, &tally);
    }
}

fn read_vectors<const N: usize>(
    phases: &Phases,
    source: PlaneRef<'_, [f32; N]>,
    target: &mut [f32],
    name: PlaneName,
    sanitised: &mut Sanitised,
    clean: impl Fn([f32; N], &mut RowTally) -> [f32; N] + Sync + Send,
) {
    let tally = Tally::default();
    let width = phases.size.width;
    rows::each(target, N * width, |y, row| {
        let mut counts = RowTally::default();
        scatter(phases, source.row(y), row, |v| clean(v, &mut counts));
        tally.add(counts);
    });
    sanitised.add(name, &tally);
}

/// Vectors in the host's order to a row of fields in phase order.
#[inline(always)]
fn scatter<const N: usize>(
    phases: &Phases,
    source: &[[f32; N]],
    row: &mut [f32],
    mut clean: impl FnMut([f32; N]) -> [f32; N],
) {
    let width = phases.size.width;
    for phase in 0..PERIOD {
        let n = phases.count(phase);
        let mut fields = row.chunks_exact_mut(width).map(|f| &mut f[phases.range(phase)]);
        // Slices of one known length: no bounds check is left in the loop.
        let fields: [&mut [f32]; N] = std::array::from_fn(|_| fields.next().map_or(&mut [][..], |f| &mut f[..n]));
        for (i, value) in source.iter().skip(phase).step_by(PERIOD).take(n).enumerate() {
            let value = clean(*value);
            for c in 0..N {
                fields[c][i] = value[c];
            }
        }
    }
}

/// True where no value of a row needs attention: none negative, none too large, all numbers.
#[inline(always)]
fn is_clean(row: &[Rgb]) -> bool {
    row.as_flattened().iter().fold(true, |clean, v| clean & (*v >= 0.0) & (*v <= COLOUR_LIMIT))
}

/// Reads plane `plane` of `target`.
pub(crate) fn read_colours(
    phases: &Phases,
    source: PlaneRef<'_, Rgb>,
    target: &mut Colours,
    plane: usize,
    name: PlaneName,
    sanitised: &mut Sanitised,
) {
    let tally = Tally::default();
    let width = phases.size.width;
    let stride = target.stride(width);
    rows::each(target.elements_mut(), stride, |y, row| {
        let row = &mut row[3 * width * plane..][..3 * width];
        let source = source.row(y);
        if is_clean(source) {
            scatter(phases, source, row, |v| v);
        } else {
            let mut counts = RowTally::default();
            scatter(phases, source, row, |v| clean_colour(v, &mut counts));
            tally.add(counts);
        }
    });
    sanitised.add(name, &tally);
}

/// Cleans one row in the host's order.
pub(crate) fn clean_row(source: &[Rgb], target: &mut [Rgb], tally: &Tally) {
    if is_clean(source) {
        target.copy_from_slice(source);
    } else {
        let mut counts = RowTally::default();
        for (out, value) in target.iter_mut().zip(source) {
            *out = clean_colour(*value, &mut counts);
        }
        tally.add(counts);
    }
}

/// Plane `plane` of `source` in the order in which hosts read it.
pub(crate) fn show(phases: &Phases, source: &Colours, plane: usize, target: &mut Plane<Rgb>) {
    let width = phases.size.width;
    rows::each(target.data_mut(), width, |y, row| {
        let source = &source.row(width, y)[3 * width * plane..][..3 * width];
        for phase in 0..PERIOD {
            let of_phase = row.iter_mut().skip(phase).step_by(PERIOD);
            for (e, out) in phases.range(phase).zip(of_phase) {
                *out = [source[e], source[width + e], source[2 * width + e]];
            }
        }
    });
}
