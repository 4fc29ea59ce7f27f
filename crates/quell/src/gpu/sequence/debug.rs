//! Debug views of the sequence filter: what its buffers hold after the stages that were encoded last.

use super::uniforms::extent;
use super::window::SequenceWindow;
use crate::gpu::debug::{COLOURS, DebugTarget, DebugViews, picture};
use crate::gpu::error::Error;
use crate::gpu::kernel::Bindable;
use crate::gpu::pass::{Binding, BindingKind, Element, Pass};
use crate::gpu::small::filled;
use crate::gpu::uniform::{Uniform, Value, uniforms};
use glam::UVec2;

use super::passes::TOGETHER;

/// What to show of the frame that was encoded last. A light is named by its place in the job
/// ([`crate::sequence::GatheredLight`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SequenceView {
    /// A colour plane of a light, held to a display's range (c / (1 + c)) and encoded for sRGB: the gathered mean, or the
    /// filtered light, by how far the frame was encoded ([`super::SequenceStage`]).
    Light {
        /// The light.
        light: usize,
        /// Its colour plane; 0 is the light itself.
        plane: usize,
    },
    /// Standard deviation s of a light's luminance beside its mean m, s / (s + m): black none, red 1/3, yellow 2/3. Of one sample
    /// after stage 1, of the mean afterwards.
    Deviation {
        /// The light.
        light: usize,
    },
    /// Samples that a light's mean is worth, by logarithm: black 1, red 4, yellow 16, white 64.
    Counts {
        /// The light.
        light: usize,
    },
    /// The largest of all lights' counts.
    Samples,
    /// Depth, grey, anew from dark to bright with every doubling. Background is nearly black blue.
    Depth,
    /// Normals as (n + 1) / 2.
    Normal,
    /// Noise of the feature buffers themselves: red of the depth, relative; green of the normal. Full at 1/10.
    FeatureNoise,
    /// Colour that mirrors and glass show, tone-mapped.
    SeenColour,
    /// Normal that they show.
    SeenNormal,
}

/// Numbers of the views in WGSL.
pub(in crate::gpu) const SHOWS_LIGHT: u32 = 0;
pub(in crate::gpu) const SHOWS_DEVIATION: u32 = 1;
pub(in crate::gpu) const SHOWS_COUNT: u32 = 2;
pub(in crate::gpu) const SHOWS_SAMPLES: u32 = 3;
pub(in crate::gpu) const SHOWS_DEPTH: u32 = 4;
pub(in crate::gpu) const SHOWS_NOISE: u32 = 5;
pub(in crate::gpu) const SHOWS_COLOUR: u32 = 6;
const SHOWS_NORMAL: u32 = 7;

uniforms! {
    pub(super) ViewUniforms as "SequenceDebug" {
        size: UVec2,
        /// `SHOWS_*`.
        view: u32,
        /// Of a light among four counts.
        place: u32,
        scale: f32,
    }
}

pub(super) fn layout() -> Uniform {
    ViewUniforms::layout()
}

const fn bindings(format: usize) -> [Binding; 5] {
    [
        Binding { name: "debug", kind: BindingKind::Uniform("SequenceDebug") },
        Binding { name: "plane", kind: BindingKind::Read(Element::Four) },
        Binding { name: "second", kind: BindingKind::Read(Element::Four) },
        Binding { name: "numbers", kind: BindingKind::Read(Element::One) },
        picture(format),
    ]
}

const fn pass(bindings: &'static [Binding]) -> Pass {
    Pass {
        name: "debug_sequence",
        stages: &[],
        per_frame: false,
        entry: "show_sequence",
        bindings,
        pieces: &[include_str!("../../kernels/math.wgsl"), COLOURS, include_str!("../passes/debug_sequence.wgsl")],
    }
}

/// For each format of targets.
pub(in crate::gpu) const DEBUG_PASSES: [Pass; 3] =
    [pass(&const { bindings(0) }), pass(&const { bindings(1) }), pass(&const { bindings(2) })];

impl SequenceWindow {
    /// Draws a view of the frame that was encoded last, into the same encoder or a later one before the next frame's.
    ///
    /// # Errors
    /// No frame was encoded, or it has no such light or plane; a target of another format, too small or without its usage.
    pub fn encode_debug(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        views: &DebugViews,
        view: SequenceView,
        target: DebugTarget<'_>,
    ) -> Result<(), Error> {
        let missing = |image| Error::DebugImage { image };
        let (Some(shown), Some(work)) = (&self.shown, &self.work) else { return Err(missing("frame")) };
        let [geometry, normals, seen_colours, seen_normals] = &work.features;
        let of = |light: usize, plane: usize| {
            let found = shown.lights.iter().find(|(place, _, planes)| *place == light && plane < *planes);
            found.map(|(_, first, _)| first + plane).ok_or(missing("such light"))
        };
        let mean = |index: usize| work.means.get(index).ok_or(missing("such light"));
        let mut place = 0;
        let (number, plane) = match view {
            SequenceView::Light { light, plane } => (SHOWS_LIGHT, mean(of(light, plane)?)?),
            SequenceView::Deviation { light } => (SHOWS_DEVIATION, mean(of(light, 0)?)?),
            SequenceView::Counts { light } => {
                let first = of(light, 0)?;
                place = (first % TOGETHER) as u32;
                (SHOWS_COUNT, work.counts.get(first / TOGETHER).ok_or(missing("such light"))?)
            }
            SequenceView::Samples => (SHOWS_SAMPLES, geometry),
            SequenceView::Depth => (SHOWS_DEPTH, geometry),
            SequenceView::Normal => (SHOWS_NORMAL, normals),
            SequenceView::FeatureNoise => (SHOWS_NOISE, geometry),
            SequenceView::SeenColour => (SHOWS_COLOUR, seen_colours),
            SequenceView::SeenNormal => (SHOWS_NORMAL, seen_normals),
        };
        let mut bytes = Vec::new();
        let uniforms = ViewUniforms { size: extent(self.size), view: number, place, scale: target.scale };
        uniforms.write(&mut bytes);
        let uniforms = filled(device, "quell debug", &bytes, wgpu::BufferUsages::UNIFORM);
        let buffers = [plane, normals, &work.most].map(Bindable::Buffer);
        let [plane, second, numbers] = buffers;
        let bound = [Bindable::Uniform(&uniforms), plane, second, numbers, Bindable::Plane(target.view)];
        views.sequence().encode(device, encoder, None, &bound, self.size)
    }
}
