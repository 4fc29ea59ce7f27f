//! Stage `residual` on the device, of a light or of the stabilised picture: its passes, and their order.

use super::kernels::kernel;
use super::passes::{IMAGE, frames, pass, settings, written};
use super::uniforms::extent;
use crate::gpu::error::Error;
use crate::gpu::kernel::{Bindable, Kernel};
use crate::gpu::pass::{Binding, BindingKind, Element, Pass};
use crate::gpu::small::filled;
use crate::gpu::timing::Timings;
use crate::gpu::uniform::{Uniform, Value, uniforms};
use crate::plane::Size;
use crate::stages::residual::{MOST_SURE, Trust, cells, squares, triangle};
use glam::{IVec2, UVec2};
use std::sync::{Arc, Mutex};

const SETTINGS: Binding = settings("ResidualSettings");
const RESIDUAL: &str = include_str!("../../stages/residual/shader.wgsl");
const SMOOTHED: &str = include_str!("../passes/residual_smoothed.wgsl");
const CORRECT: &str = include_str!("../passes/residual_correct.wgsl");

const fn many(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Read(Element::Fours) }
}
const fn many_written(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Write(Element::Fours) }
}

impl Pass {
    /// Stage `residual`: sums of the cells of a level.
    pub const RESIDUAL_CELLS: Self = pass(
        "residual_cells",
        "sum_cells",
        &[
            SETTINGS,
            frames("own"),
            many("filtered"),
            many_written("cell_light"),
            many_written("cell_residual"),
            many_written("cell_squared"),
        ],
        &[IMAGE, RESIDUAL, include_str!("../passes/residual_own.wgsl"), include_str!("../passes/residual_cells.wgsl")],
    );

    /// The same: what cells are multiplied by.
    pub const RESIDUAL_CHANGES: Self = pass(
        "residual_changes",
        "find_changes",
        &[
            SETTINGS,
            many("cell_light"),
            many("cell_residual"),
            many("cell_squared"),
            many("coarse"),
            many_written("changes"),
        ],
        &[RESIDUAL, SMOOTHED, include_str!("../passes/residual_changes.wgsl")],
    );

    /// The same, of the coarsest level of a picture: of each cell its relative residual, and one over the variance of that.
    pub const RESIDUAL_CERTAINTY: Self = pass(
        "residual_certainty",
        "find_certainty",
        &[
            SETTINGS,
            many("cell_light"),
            many("cell_residual"),
            many("cell_squared"),
            many("changes"),
            many_written("certainty"),
        ],
        &[RESIDUAL, SMOOTHED, include_str!("../passes/residual_certainty.wgsl")],
    );

    /// The same: what a cell is multiplied by, where the windows around show that light changes.
    pub const RESIDUAL_AROUND: Self = pass(
        "residual_around",
        "look_around",
        &[SETTINGS, many("certainty"), many_written("changes")],
        &[RESIDUAL, include_str!("../passes/residual_around.wgsl")],
    );

    /// The same: a light or a picture corrected.
    pub const RESIDUAL_APPLY: Self = pass(
        "residual_apply",
        "apply_changes",
        &[SETTINGS, frames("own"), many("changes"), written("filtered")],
        &[
            IMAGE,
            RESIDUAL,
            include_str!("../passes/residual_own.wgsl"),
            CORRECT,
            include_str!("../passes/residual_apply.wgsl"),
        ],
    );

    /// The same: a joint plane of a light, before the light itself.
    pub const RESIDUAL_APPLY_JOINT: Self = pass(
        "residual_apply_joint",
        "apply_changes",
        &[
            SETTINGS,
            frames("own"),
            many("changes"),
            Binding { name: "filtered", kind: BindingKind::Read(Element::Four) },
            written("joint"),
        ],
        &[
            IMAGE,
            RESIDUAL,
            include_str!("../passes/residual_own.wgsl"),
            CORRECT,
            include_str!("../passes/residual_apply_joint.wgsl"),
        ],
    );

    /// All of stage `residual`, in order.
    pub const RESIDUAL: [Self; 6] = [
        Self::RESIDUAL_CELLS,
        Self::RESIDUAL_CHANGES,
        Self::RESIDUAL_CERTAINTY,
        Self::RESIDUAL_AROUND,
        Self::RESIDUAL_APPLY_JOINT,
        Self::RESIDUAL_APPLY,
    ];
}

uniforms! {
    /// Of a level.
    ResidualUniforms as "ResidualSettings" {
        size: UVec2,
        cells: IVec2,
        /// Pixels of a cell, and cells that the triangle reaches to each side.
        side: i32,
        reach: i32,
        first_row: i32,
        /// Of the frame in the array of what came in; whether that is black.
        layer: i32,
        black: u32,
        /// The coarsest level, which has so many cells in a row.
        begins: u32,
        coarse_cells: i32,
        /// Sum of the squares of the triangle's weights.
        squares: f32,
        sure: f32,
        /// Mean certainty above which the windows around say that light changes.
        around: f32,
        /// Squared.
        noise: f32,
        least_change: f32,
        most_change: f32,
    }
}

pub(super) fn layout() -> Uniform {
    ResidualUniforms::layout()
}

/// Buffers for the cells of a level: three of sums, and what the coarsest level and another find.
pub(super) const BUFFERS: usize = 5;

/// The most cells of a level, of a picture of that extent.
pub(super) fn most_cells(size: Size) -> u64 {
    let along = |extent: usize| extent as u64 / 2 + 2;
    along(size.width) * along(size.height)
}

/// These passes, compiled.
#[derive(Clone, Debug)]
pub(super) struct ResidualKernels {
    cells: Kernel,
    changes: Kernel,
    certainty: Kernel,
    around: Kernel,
    apply: Kernel,
    apply_joint: Kernel,
}

/// What is corrected, and by what.
pub(super) struct Corrected<'a> {
    pub(super) size: Size,
    /// Row of the picture at which it begins.
    pub(super) first_row: usize,
    /// As it came: a layer of an array; black where the array has none.
    pub(super) own: Bindable<'a>,
    pub(super) layer: u32,
    pub(super) is_black: bool,
    /// The light or picture, then planes that are scaled with it.
    pub(super) planes: &'a [wgpu::Buffer],
    pub(super) buffers: &'a [wgpu::Buffer; BUFFERS],
}

impl ResidualKernels {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        Self {
            cells: kernel(device, Pass::RESIDUAL_CELLS, None),
            changes: kernel(device, Pass::RESIDUAL_CHANGES, None),
            certainty: kernel(device, Pass::RESIDUAL_CERTAINTY, None),
            around: kernel(device, Pass::RESIDUAL_AROUND, None),
            apply: kernel(device, Pass::RESIDUAL_APPLY, None),
            apply_joint: kernel(device, Pass::RESIDUAL_APPLY_JOINT, None),
        }
    }

    pub(super) fn timed(self, timings: Option<&Arc<Mutex<Timings>>>) -> Self {
        Self {
            cells: self.cells.timed(timings),
            changes: self.changes.timed(timings),
            certainty: self.certainty.timed(timings),
            around: self.around.timed(timings),
            apply: self.apply.timed(timings),
            apply_joint: self.apply_joint.timed(timings),
        }
    }

    /// With one of them from changed WGSL; whether it is one of them.
    pub(super) fn with_source(&mut self, device: &wgpu::Device, pass: Pass, source: &str) -> bool {
        let judges = [&mut self.changes, &mut self.certainty, &mut self.around];
        let all = judges.into_iter().chain([&mut self.cells, &mut self.apply, &mut self.apply_joint]);
        let place = all.into_iter().find(|kernel| kernel.pass().name == pass.name);
        place.map(|place| *place = kernel(device, pass, Some(source))).is_some()
    }

    /// All levels, from coarse to fine.
    pub(super) fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        corrected: &Corrected<'_>,
        (levels, trust): (&[(usize, usize)], Trust),
    ) -> Result<(), Error> {
        let Corrected { size, own, planes, .. } = *corrected;
        let ([filtered, joint @ ..], Some(coarsest)) = (planes, levels.first()) else { return Ok(()) };
        let [light, residual, squared, coarse, fine] = corrected.buffers.each_ref().map(Bindable::Buffer);
        for (level, kind) in levels.iter().enumerate() {
            let values = corrected.settings(*kind, *coarsest, level == 0, trust);
            let grid = Size::new(values.cells.x as usize, values.cells.y as usize);
            let mut bytes = Vec::new();
            values.write(&mut bytes);
            let settings = filled(device, "quell sequence settings", &bytes, wgpu::BufferUsages::UNIFORM);
            let settings = Bindable::Uniform(&settings);
            let main = Bindable::Buffer(filtered);
            // The coarsest level reads no other.
            let [other, changes] = if level == 0 { [fine, coarse] } else { [coarse, fine] };
            let bound = [settings, own, main, light, residual, squared];
            self.cells.encode(device, encoder, None, &bound, grid)?;
            let bound = [settings, light, residual, squared, other, changes];
            self.changes.encode(device, encoder, None, &bound, grid)?;
            if level == 0 && trust.around.is_some() {
                // What no other level has written yet holds it meanwhile.
                let bound = [settings, light, residual, squared, changes, fine];
                self.certainty.encode(device, encoder, None, &bound, grid)?;
                self.around.encode(device, encoder, None, &[settings, fine, changes], grid)?;
            }
            for plane in joint {
                let bound = [settings, own, changes, main, Bindable::Buffer(plane)];
                self.apply_joint.encode(device, encoder, None, &bound, size)?;
            }
            self.apply.encode(device, encoder, None, &[settings, own, changes, main], size)?;
        }
        Ok(())
    }
}

impl Corrected<'_> {
    fn settings(
        &self,
        (cell, radius): (usize, usize),
        coarsest: (usize, usize),
        begins: bool,
        trust: Trust,
    ) -> ResidualUniforms {
        let (size, first_row) = (self.size, self.first_row);
        ResidualUniforms {
            size: extent(size),
            cells: IVec2::new(cells(0, size.width, cell) as i32, cells(first_row, size.height, cell) as i32),
            side: cell as i32,
            reach: 2 * radius as i32,
            first_row: first_row as i32,
            layer: self.layer as i32,
            black: u32::from(self.is_black),
            begins: u32::from(begins),
            coarse_cells: cells(0, size.width, coarsest.0) as i32,
            squares: squares(&triangle(radius)),
            sure: trust.sure,
            around: trust.around.unwrap_or(MOST_SURE),
            noise: trust.noise,
            least_change: trust.change[0],
            most_change: trust.change[1],
        }
    }
}
