//! The whole plan on the GPU: walks the program, in the caller's encoder.

use super::error::Error;
use super::frame::{Frame, Output};
use super::guides::pack_spiral;
use super::kernel::{Bindable, Kernel, Told, workgroups};
use super::options::Options;
use super::pass::Pass;
use super::planes::{Planes, extent_of};
use super::program::{Bound, Contents, Dispatch, Memory, Program, Role, Slot};
use super::storage::Storage;
use super::uniforms::{Cameras, FrameUniforms, SettingsUniforms};
use crate::camera::Camera;
use crate::frame::Frame as CpuFrame;
use crate::history::{Ledger, PlanCache, Validity};
use crate::kernels::spiral::{Spiral, SpiralShape};
use crate::pipeline::Plan;
use crate::plane::Size;
use crate::settings::Settings;
use glam::Vec2;
use std::collections::HashMap;

/// The denoiser on the GPU, for one image size and one view. The caller's device and encoder, nothing submitted.
#[derive(Debug)]
pub struct Denoiser {
    size: Size,
    options: Options,
    plans: PlanCache,
    ledger: Ledger,
    kernels: Kernels,
    planes: Planes,
    program: (Plan, Contents, Program),
    before: Option<Cameras>,
    /// Which copy of what alternates this frame writes: 0 or 1.
    turn: usize,
}

/// Compiled passes, each once.
#[derive(Debug, Default)]
struct Kernels(HashMap<(&'static str, bool), Kernel>);

impl Kernels {
    fn ensure(&mut self, device: &wgpu::Device, program: &Program) {
        for dispatch in &program.dispatches {
            let make = || Kernel::new(device, dispatch.pass, program.storage, dispatch.host_input);
            self.0.entry(Self::key(dispatch)).or_insert_with(make);
        }
    }

    fn get(&self, dispatch: &Dispatch) -> Option<&Kernel> {
        self.0.get(&Self::key(dispatch))
    }

    const fn key(dispatch: &Dispatch) -> (&'static str, bool) {
        let Pass { name, .. } = dispatch.pass;
        (name, dispatch.host_input)
    }
}

/// Small buffers of one frame. They are its own: what several frames before one submit read must not be overwritten.
struct Small {
    frame: wgpu::Buffer,
    settings: wgpu::Buffer,
    taps: HashMap<Slot, wgpu::Buffer>,
}

impl Denoiser {
    /// A denoiser for frames of `size`: compiles the passes and makes the planes, on the caller's device, that a frame
    /// with both signals needs. What only other frames or settings need is made when they first come.
    ///
    /// # Errors
    /// A size without pixels or beyond the device's limits; a setting out of its range. Running out of device memory
    /// reaches the host through its device, as for any resource.
    pub fn new(device: &wgpu::Device, size: Size, options: &Options) -> Result<Self, Error> {
        options.settings.check()?;
        let plans = PlanCache::new(&options.settings);
        let plan = Plan::new(&options.settings, Contents::USUAL.inputs());
        let program = Program::new(&plan, Contents::USUAL, options.storage, options.fuse);
        let mut planes = Planes::new(device, size, &options.label, options.storage)?;
        let mut kernels = Kernels::default();
        workgroups(device, "denoiser", size)?;
        planes.ensure(device, &program);
        kernels.ensure(device, &program);
        Ok(Self {
            size,
            options: options.clone(),
            plans,
            ledger: Ledger::default(),
            kernels,
            planes,
            program: (plan, Contents::USUAL, program),
            before: None,
            turn: 0,
        })
    }

    /// Changes settings; history is kept. No pipeline is built anew: a stage that is switched on is compiled once.
    ///
    /// # Errors
    /// A setting out of its range; the old settings stay.
    pub fn set_settings(&mut self, settings: &Settings) -> Result<(), Error> {
        settings.check()?;
        self.options.settings = settings.clone();
        Ok(())
    }

    /// Forgets history: the next frame starts afresh.
    pub fn reset(&mut self) {
        self.ledger.reset();
    }

    /// Changes the size of the frames; history is forgotten, pipelines stay.
    ///
    /// # Errors
    /// As [`Denoiser::new`]; the old size stays.
    pub fn resize(&mut self, device: &wgpu::Device, size: Size) -> Result<(), Error> {
        let mut planes = Planes::new(device, size, &self.options.label, self.options.storage)?;
        workgroups(device, "denoiser", size)?;
        planes.ensure(device, &self.program.2);
        self.planes = planes;
        self.size = size;
        self.before = None;
        self.ledger.reset();
        Ok(())
    }

    /// The extent of the frames.
    pub fn size(&self) -> Size {
        self.size
    }

    /// How planes are stored.
    pub fn storage(&self) -> Storage {
        self.options.storage
    }

    /// What the last frame ran; before the first one, what a frame with everything will run.
    pub fn program(&self) -> &Program {
        &self.program.2
    }

    /// Device memory of the planes of [`Denoiser::program`].
    pub fn memory(&self) -> Memory {
        self.program.2.memory(self.size.pixels())
    }

    /// Appends the next frame to the caller's encoder. Frames run in the order in which they were encoded; several may be
    /// encoded before one submit. An encoder that is thrown away has lost a frame: call [`Denoiser::reset`].
    ///
    /// # Errors
    /// A texture that is too small, of another format or lacks a usage, a camera that cannot be used. Nothing was encoded
    /// then, and history is as it was.
    pub fn encode(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        frame: &Frame<'_>,
    ) -> Result<Output, Error> {
        frame.check(self.size, self.options.storage)?;
        let groups = workgroups(device, "denoiser", self.size)?;
        let projection = |camera: &Camera, which| camera.projection(self.size).ok_or(crate::Error::Camera { which });
        let cameras = Cameras {
            view: projection(&frame.camera, "camera")?,
            previous_view: projection(&frame.previous_camera, "previous_camera")?,
            jitter: Vec2::from(frame.camera.jitter),
            size: self.size,
            has_glossy_hit: frame.has_glossy_hit,
            has_roughness: frame.has_roughness,
        };
        // What the ledger looks at: the index; there are no passes.
        let noted = CpuFrame { index: frame.index, ..CpuFrame::new(self.size, frame.camera) };
        let valid = self.ledger.open(&noted);
        self.prepare(device, frame.contents());
        self.turn = 1 - self.turn;
        let small = self.small(device, frame, &cameras, valid);
        for (slot, _, view) in frame.guides.planes() {
            if let Some(own) = self.planes.view(slot, false, self.turn) {
                let (from, to) = (view.texture().as_image_copy(), own.texture().as_image_copy());
                encoder.copy_texture_to_texture(from, to, extent_of(self.size));
            }
        }
        let told = Told { frame: &small.frame, settings: &small.settings };
        for dispatch in &self.program.2.dispatches {
            let bound: Option<Vec<Bindable<'_>>> =
                dispatch.bound.iter().map(|bound| self.bindable(*bound, frame, &small)).collect();
            if let (Some(kernel), Some(bound)) = (self.kernels.get(dispatch), bound) {
                kernel.dispatch(encoder, &kernel.group(device, told, &bound), groups, None);
            }
        }
        self.ledger.close(&noted, &self.program.0);
        self.before = Some(cameras);
        Ok(self.output(frame, valid))
    }

    /// Program, planes and passes for a frame with these contents.
    fn prepare(&mut self, device: &wgpu::Device, contents: Contents) {
        let Options { settings, storage, fuse, .. } = &self.options;
        let plan = self.plans.get(settings, contents.inputs());
        let (last_plan, last_contents, _) = &self.program;
        if last_plan == plan && *last_contents == contents {
            return;
        }
        let program = Program::new(plan, contents, *storage, *fuse);
        self.planes.ensure(device, &program);
        self.kernels.ensure(device, &program);
        self.program = (plan.clone(), contents, program);
    }

    fn small(&self, device: &wgpu::Device, frame: &Frame<'_>, cameras: &Cameras, valid: Validity) -> Small {
        let (settings, rows) = (&self.options.settings, self.size.height);
        let contents = frame.contents();
        let [matte, glossy] = [contents.matte, contents.glossy];
        let told = SettingsUniforms::new(settings, self.size)
            .with_terms(
                matte.is_some(),
                glossy.is_some(),
                matte.is_some_and(|s| s.direct),
                glossy.is_some_and(|s| s.direct),
            )
            .with_weights(matte.is_some_and(|s| s.weight), glossy.is_some_and(|s| s.weight));
        let frame_told = FrameUniforms::from_cameras(cameras, self.before.as_ref(), valid);
        let label = |name| format!("{} {name}", self.options.label);
        let uniform = |name, bytes: &[u8]| filled(device, &label(name), bytes, wgpu::BufferUsages::UNIFORM);
        let taps = self.program.2.resources.iter().filter(|r| r.role == Role::Taps).map(|resource| {
            let shape = match resource.slot {
                Slot::PrefilterTaps => SpiralShape::prefilter(&settings.matte_prefilter, rows, frame.index),
                _ => SpiralShape::bilateral(&settings.matte_bilateral, rows, frame.index),
            };
            let bytes = pack_spiral(&Spiral::new(&shape));
            (resource.slot, filled(device, &label(resource.slot.name()), &bytes, wgpu::BufferUsages::STORAGE))
        });
        Small {
            frame: uniform("frame", &frame_told.bytes()),
            settings: uniform("settings", &told.bytes()),
            taps: taps.collect(),
        }
    }

    fn bindable<'a>(&'a self, bound: Bound, frame: &Frame<'a>, small: &'a Small) -> Option<Bindable<'a>> {
        let resource = self.program.2.resources.get(bound.resource)?;
        match resource.role {
            Role::Taps => small.taps.get(&resource.slot).map(Bindable::Taps),
            Role::Input => frame.input(resource.slot).map(Bindable::Plane),
            _ => self.planes.view(resource.slot, bound.before, self.turn).map(Bindable::Plane),
        }
    }

    fn output(&self, frame: &Frame<'_>, valid: Validity) -> Output {
        let program = &self.program.2;
        let view = |index: usize| {
            let resource = program.resources.get(index)?;
            let own = self.planes.view(resource.slot, false, self.turn);
            frame.input(resource.slot).or(own).cloned()
        };
        let shown = program.shown;
        Output {
            composite: view(shown.composite).unwrap_or_else(|| frame.direct.clone()),
            direct: view(shown.direct).unwrap_or_else(|| frame.direct.clone()),
            matte: shown.matte.and_then(view),
            glossy: shown.glossy.and_then(view),
            confidence: shown.confidence.and_then(view),
            history_length: shown.length.and_then(view),
            had_history: valid.matte || valid.glossy,
        }
    }
}

/// A buffer of its own for every frame.
pub(super) fn filled(device: &wgpu::Device, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let size = bytes.len().next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT as usize).max(16) as u64;
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: true };
    let buffer = device.create_buffer(&descriptor);
    // A device that is lost or out of memory has no range to write; the host hears of it from its device.
    if let Ok(mut range) = buffer.get_mapped_range_mut(..bytes.len() as u64) {
        range.copy_from_slice(bytes);
    }
    buffer.unmap();
    buffer
}
