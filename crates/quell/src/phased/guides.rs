//! The frame's planes, cleaned as `border.rs` says and laid out for this back end.

use super::layout::{Colours, Phases, channel};
use super::rows;
use crate::border::{
    COLOUR_LIMIT, PlaneName, RowTally, Sanitised, Tally, camera_motion, clean_colour, clean_depth, clean_hit,
    clean_motion, clean_normal, clean_unit_range, is_in_unit_range, is_motion, is_normal, sample_position,
};
use crate::camera::Projection;
use crate::error::Error;
use crate::frame::{Frame, Rgb};
use crate::kernels::math::three;
use crate::kernels::spiral::PERIOD;
use crate::plane::{Plane, PlaneRef};
use crate::simd::dispatch;
use fearless_simd::Level;
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
    /// The camera of the frame before, as this frame has it.
    pub previous_view: Projection,
    /// Previous = current + motion, pixels; NaN: unknown. Row by row x, y.
    pub motion: Vec<f32>,
    /// Glossy hit distance; empty where the host gave none.
    pub glossy_hit: Vec<f32>,
    /// That of the frame before; empty where the host gave none, which means 0 everywhere.
    pub glossy_hit_before: Vec<f32>,
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
            glossy_hit_before: Vec::new(),
            confidence_in: Vec::new(),
            has_roughness: false,
        }
    }

    /// The host gave glossy hit distances.
    pub fn has_glossy_hit(&self) -> bool {
        !self.glossy_hit.is_empty()
    }

    /// Reads a checked frame; what was `now` becomes `before`.
    pub fn read(&mut self, level: Level, frame: &Frame<'_>, sanitised: &mut Sanitised) -> Result<(), Error> {
        let (phases, size) = (self.phases, self.phases.size);
        let mut reading = Reading { level, phases: &phases, sanitised };
        let view = frame.camera.projection(size).ok_or(Error::Camera { which: "camera" })?;
        let previous_view = frame.previous_camera.projection(size).ok_or(Error::Camera { which: "previous_camera" })?;
        std::mem::swap(&mut self.now, &mut self.before);
        std::mem::swap(&mut self.glossy_hit, &mut self.glossy_hit_before);
        let now = &mut self.now;
        now.view = view;
        now.jitter = Vec2::from(frame.camera.jitter);
        self.previous_view = previous_view;
        match frame.view_depth {
            Some(p) => {
                reading.scalars(p, &mut now.depth, Some(PlaneName::ViewDepth), |z| z > 0.0, clean_depth);
            }
            None => now.depth.fill(1.0),
        }
        match frame.normal {
            Some(p) => {
                reading.vectors(p, &mut now.normal, PlaneName::Normal, is_normal, clean_normal);
                // A normal of (0, 0, 0) says background, whatever the depth.
                let normal = &now.normal;
                rows::each(&mut now.depth, size.width, |y, row| {
                    let [x, y, z] = three(|c| &field(normal, size.width, 3, y, c)[..row.len()]);
                    dispatch!(level, _simd => {
                        for i in 0..row.len() {
                            let none = (x[i] == 0.0) & (y[i] == 0.0) & (z[i] == 0.0);
                            row[i] = if none { f32::INFINITY } else { row[i] };
                        }
                    });
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
                reading.scalars(p, &mut now.roughness, Some(PlaneName::Roughness), is_in_unit_range, |v, t| {
                    clean_unit_range(v, 1.0, t)
                });
            }
            None => now.roughness.fill(1.0),
        }
        match frame.surface_id {
            // Any number is an identity.
            Some(p) => reading.scalars(p, &mut now.id, None, |_| true, |v, _| v),
            None => now.id.fill(0),
        }
        resize(&mut self.glossy_hit, frame.glossy_hit_distance.is_some(), size.pixels());
        if let Some(p) = frame.glossy_hit_distance {
            let name = Some(PlaneName::GlossyHitDistance);
            reading.scalars(p, &mut self.glossy_hit, name, |d| d >= 0.0, clean_hit);
        }
        resize(&mut self.confidence_in, frame.confidence_in.is_some(), size.pixels());
        if let Some(p) = frame.confidence_in {
            let name = Some(PlaneName::ConfidenceIn);
            reading.scalars(p, &mut self.confidence_in, name, is_in_unit_range, |v, t| clean_unit_range(v, 0.0, t));
        }
        match frame.motion {
            Some(p) => reading.vectors(p, &mut self.motion, PlaneName::Motion, is_motion, clean_motion),
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

/// Where a plane's values go, and where repairs are counted.
struct Reading<'a> {
    level: Level,
    phases: &'a Phases,
    sanitised: &'a mut Sanitised,
}

impl Reading<'_> {
    /// `fine`: true only of values that `clean` leaves as they are. A row of such is not cleaned: testing is a loop
    /// without branches, cleaning is not.
    fn scalars<T: Copy + Send + Sync>(
        &mut self,
        source: PlaneRef<'_, T>,
        target: &mut [T],
        name: Option<PlaneName>,
        fine: impl Fn(T) -> bool + Sync + Send,
        clean: impl Fn(T, &mut RowTally) -> T + Sync + Send,
    ) {
        let (level, phases, tally) = (self.level, self.phases, Tally::default());
        rows::each(target, phases.size.width, |y, row| {
            let source = source.row(y);
            dispatch!(level, _simd => {
                if source.iter().fold(true, |all, v| all & fine(*v)) {
                    scatter_scalars(phases, source, row, |v| v);
                } else {
                    let mut counts = RowTally::default();
                    scatter_scalars(phases, source, row, |v| clean(v, &mut counts));
                    tally.add(counts);
                }
            });
        });
        if let Some(name) = name {
            self.sanitised.add(name, &tally);
        }
    }

    /// The same of vectors.
    fn vectors<const N: usize>(
        &mut self,
        source: PlaneRef<'_, [f32; N]>,
        target: &mut [f32],
        name: PlaneName,
        fine: impl Fn([f32; N]) -> bool + Sync + Send,
        clean: impl Fn([f32; N], &mut RowTally) -> [f32; N] + Sync + Send,
    ) {
        let (level, phases, tally) = (self.level, self.phases, Tally::default());
        rows::each(target, N * phases.size.width, |y, row| {
            let source = source.row(y);
            dispatch!(level, _simd => {
                if source.iter().fold(true, |all, v| all & fine(*v)) {
                    scatter(phases, source, row);
                } else {
                    let mut counts = RowTally::default();
                    scatter_cleaned(phases, source, row, |v| clean(v, &mut counts));
                    tally.add(counts);
                }
            });
        });
        self.sanitised.add(name, &tally);
    }
}

/// Scalars in the host's order to a row in phase order: four neighbours at a time, one to each phase.
#[inline(always)]
fn scatter_scalars<T: Copy>(phases: &Phases, source: &[T], row: &mut [T], mut clean: impl FnMut(T) -> T) {
    let (groups, rest) = source.as_chunks::<PERIOD>();
    let n = groups.len();
    let (a, row_of_b) = row.split_at_mut(phases.range(1).start);
    let (b, row_of_c) = row_of_b.split_at_mut(phases.count(1));
    let (c, d) = row_of_c.split_at_mut(phases.count(2));
    {
        let (a, b, c, d) = (&mut a[..n], &mut b[..n], &mut c[..n], &mut d[..n]);
        for i in 0..n {
            let group = groups[i];
            a[i] = clean(group[0]);
            b[i] = clean(group[1]);
            c[i] = clean(group[2]);
            d[i] = clean(group[3]);
        }
    }
    for (out, value) in [a, b, c].into_iter().zip(rest) {
        out[n] = clean(*value);
    }
}

/// Vectors in the host's order to a row of fields in phase order.
#[inline(always)]
fn scatter<const N: usize>(phases: &Phases, source: &[[f32; N]], row: &mut [f32]) {
    let width = phases.size.width;
    let n = source.len() / PERIOD;
    let (of_groups, rest) = source.split_at(n * PERIOD);
    let (of_groups, _) = of_groups.as_flattened().as_chunks::<4>();
    let mut quads = [[[0.0f32; 4]; GROUPS]; N];
    for (block, source) in of_groups.chunks(N * GROUPS).enumerate() {
        let m = source.len() / N;
        for i in 0..m {
            for k in 0..N {
                quads[k][i] = source[i * N + k];
            }
        }
        for k in 0..N {
            for l in 0..4 {
                let (phase, c) = ((4 * k + l) / N, (4 * k + l) % N);
                let out = &mut row[c * width + phases.range(phase).start + block * GROUPS..][..m];
                let quads = &quads[k][..m];
                for i in 0..m {
                    out[i] = quads[i][l];
                }
            }
        }
    }
    for (phase, value) in rest.iter().enumerate() {
        for c in 0..N {
            row[c * width + phases.range(phase).start + n] = value[c];
        }
    }
}

/// Groups of [`PERIOD`] pixels whose order is changed together. They go through whole quads of numbers, not single
/// ones: a vector that was stored in parts and is loaded at once would have to wait.
const GROUPS: usize = 64;

/// As [`scatter`], with repairs on the way.
fn scatter_cleaned<const N: usize>(
    phases: &Phases,
    source: &[[f32; N]],
    row: &mut [f32],
    mut clean: impl FnMut([f32; N]) -> [f32; N],
) {
    let width = phases.size.width;
    for (x, value) in source.iter().enumerate() {
        let value = clean(*value);
        for c in 0..N {
            row[c * width + phases.element(x)] = value[c];
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
    level: Level,
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
        dispatch!(level, _simd => {
            if is_clean(source) {
                scatter(phases, source, row);
            } else {
                let mut counts = RowTally::default();
                scatter_cleaned(phases, source, row, |v| clean_colour(v, &mut counts));
                tally.add(counts);
            }
        });
    });
    sanitised.add(name, &tally);
}

/// A plane cleaned, in the host's order; zeros where there is none.
pub(crate) fn copy_colours(
    level: Level,
    source: Option<PlaneRef<'_, Rgb>>,
    target: &mut Plane<Rgb>,
    name: PlaneName,
    sanitised: &mut Sanitised,
) {
    let Some(source) = source else { return target.data_mut().fill([0.0; 3]) };
    let (tally, width) = (Tally::default(), target.size().width);
    rows::each(target.data_mut(), width, |y, row| {
        dispatch!(level, _simd => clean_row(source.row(y), row, &tally));
    });
    sanitised.add(name, &tally);
}

/// Cleans one row in the host's order.
#[inline(always)]
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
pub(crate) fn show(level: Level, phases: &Phases, source: &Colours, plane: usize, target: &mut Plane<Rgb>) {
    let width = phases.size.width;
    rows::each(target.data_mut(), width, |y, row| {
        let source = source.row(width, y);
        dispatch!(level, _simd => collect(phases, three(|c| channel(source, width, plane, c)), row));
    });
}

/// The inverse of [`scatter`] for colours.
#[inline(always)]
fn collect(phases: &Phases, source: [&[f32]; 3], row: &mut [Rgb]) {
    let n = row.len() / PERIOD;
    let (of_groups, rest) = row.split_at_mut(n * PERIOD);
    let (of_groups, _) = of_groups.as_flattened_mut().as_chunks_mut::<4>();
    let mut quads = [[[0.0f32; 4]; GROUPS]; 3];
    for (block, target) in of_groups.chunks_mut(3 * GROUPS).enumerate() {
        let m = target.len() / 3;
        for k in 0..3 {
            let channel = |l: usize| {
                let (phase, c) = ((4 * k + l) / 3, (4 * k + l) % 3);
                &source[c][phases.range(phase).start + block * GROUPS..][..m]
            };
            let (a, b, c, d) = (channel(0), channel(1), channel(2), channel(3));
            let quads = &mut quads[k][..m];
            for i in 0..m {
                quads[i] = [a[i], b[i], c[i], d[i]];
            }
        }
        for i in 0..m {
            for k in 0..3 {
                target[i * 3 + k] = quads[k][i];
            }
        }
    }
    for (phase, out) in rest.iter_mut().enumerate() {
        *out = three(|c| source[c][phases.range(phase).start + n]);
    }
}
