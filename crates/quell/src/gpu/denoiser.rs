//! The whole plan on the GPU: walks the program, in the caller's encoder.

use super::convention::PrepareUniforms;
use super::debug::{DebugInputs, DebugTarget, DebugView, DebugViews};
use super::error::Error;
use super::frame::{Frame, Guides, Output};
use super::kernel::{Bindable, Kernel, Told, workgroups};
use super::options::Options;
use super::pass::Pass;
use super::planes::{Planes, extent_of};
use super::program::{Bound, Contents, Dispatch, Memory, Program, Role};
use super::repairs::Repairs;
use super::slot::Slot;
use super::storage::Storage;
use super::timing::{Timing, Timings};
use super::told::pack_taps;
use super::uniforms::{Cameras, FrameUniforms, SettingsUniforms};
use crate::camera::Camera;
use crate::frame::Signal;
use crate::history::{Ledger, PlanCache, Validity};
use crate::pipeline::{Image, Plan, Stage};
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
    timings: Option<Timings>,
    /// Which copy of what alternates this frame writes: 0 or 1.
    turn: usize,
    /// Made when guides first come as textures, or repairs are to be counted.
    repairs: Option<Repairs>,
    /// What the last frame was told, for debug views.
    last: Option<(Size, Small)>,
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

/// What a plan leaves undone where nobody asked for it, or where there is nothing to do it with.
fn wanted(plan: &Plan, contents: Contents, composite: bool) -> Plan {
    let mut plan = plan.clone();
    let has_light = contents.direct || contents.matte.is_some() || contents.glossy.is_some();
    if !composite {
        plan.steps.retain(|s| s.stage != Stage::DirectTaa);
        plan.direct_output = Image::DirectInput;
    }
    if !composite || !has_light {
        plan.steps.retain(|s| s.stage != Stage::Composite);
    }
    plan
}

/// Small buffers of one frame. They are its own: what several frames before one submit read must not be overwritten.
#[derive(Debug)]
struct Small {
    frame: wgpu::Buffer,
    settings: wgpu::Buffer,
    taps: HashMap<Slot, wgpu::Buffer>,
    prepare: Option<wgpu::Buffer>,
    /// The host's textures in an image's place, for debug views.
    hosts: HashMap<Slot, wgpu::TextureView>,
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
        let usual = Contents::USUAL;
        let plan = wanted(&Plan::new(&options.settings, usual.inputs()), usual, options.composite);
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
            timings: options.timings.then(|| Timings::new(device, &options.label)).flatten(),
            turn: 0,
            repairs: None,
            last: None,
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
        self.last = None;
        self.ledger.reset();
        Ok(())
    }

    /// The largest extent of a frame.
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

    /// A plane as the last frame that was encoded left it; `None`: the program has none. For debug views and bisecting.
    pub fn plane(&self, slot: Slot) -> Option<&wgpu::TextureView> {
        self.planes.view(slot, false, self.turn)
    }

    /// Appends to the encoder what brings home the times of the last frame that was encoded, with
    /// [`Options::timings`]; without, or where the device has no timestamps, it does nothing. Once the host has submitted
    /// and polled its device, [`Denoiser::take_timings`] has them.
    pub fn resolve_timings(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) {
        if let Some(timings) = &mut self.timings {
            timings.resolve(device, encoder);
        }
    }

    /// The oldest times that have come home, dispatch by dispatch; `None`: none has. It neither polls nor waits.
    pub fn take_timings(&mut self, queue: &wgpu::Queue) -> Option<Vec<Timing>> {
        self.timings.as_mut()?.take(f64::from(queue.get_timestamp_period()))
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
        let size = frame.size;
        let groups = workgroups(device, "denoiser", size)?;
        let projection = |camera: &Camera, which| camera.projection(size).ok_or(crate::Error::Camera { which });
        let cameras = Cameras {
            view: projection(&frame.camera, "camera")?,
            previous_view: projection(&frame.previous_camera, "previous_camera")?,
            jitter: Vec2::from(frame.camera.jitter),
            size,
            has_glossy_hit: frame.guides.has_glossy_hit(),
            has_roughness: frame.guides.has_roughness(),
        };
        let prepared = match &frame.guides {
            Guides::Textures(textures) => {
                let cameras = [&frame.camera, &frame.previous_camera];
                let told = PrepareUniforms::new(cameras, size, textures);
                Some(told.ok_or(crate::Error::Camera { which: "camera" })?)
            }
            Guides::Packed(_) => None,
        };
        let keys = frame.keys();
        let valid = self.ledger.open_keyed(frame.index, keys);
        self.prepare(device, Contents { counts: self.options.count_repairs, ..frame.contents() });
        self.check_targets(frame)?;
        self.turn = 1 - self.turn;
        let small = self.small(device, frame, &cameras, valid, prepared);
        self.take_packed(encoder, frame);
        let repairs = self.cleared_repairs(device, encoder);
        let told = Told { frame: &small.frame, settings: &small.settings };
        let mut timings = self.timings.take();
        timings.iter_mut().for_each(Timings::clear);
        for dispatch in &self.program.2.dispatches {
            let bound: Option<Vec<Bindable<'_>>> =
                dispatch.bound.iter().map(|bound| self.bindable(*bound, frame, &small)).collect();
            if let (Some(kernel), Some(bound)) = (self.kernels.get(dispatch), bound) {
                let group = kernel.group(device, told, &bound);
                kernel.dispatch(encoder, &group, groups, timings.as_mut().and_then(|t| t.next(&dispatch.pass)));
            }
        }
        self.timings = timings;
        self.fill_targets(encoder, frame);
        self.ledger.close_keyed(frame.index, keys, &self.program.0);
        self.before = Some(cameras);
        self.last = Some((size, small));
        Ok(self.output(frame, valid, repairs))
    }

    /// Packed guides into the denoiser's own planes.
    fn take_packed(&self, encoder: &mut wgpu::CommandEncoder, frame: &Frame<'_>) {
        let Guides::Packed(packed) = frame.guides else { return };
        for (slot, _, view) in packed.planes() {
            if let Some(own) = self.planes.view(slot, false, self.turn) {
                let (from, to) = (view.texture().as_image_copy(), own.texture().as_image_copy());
                encoder.copy_texture_to_texture(from, to, extent_of(frame.size));
            }
        }
    }

    /// Zero before the frame, where the program counts.
    fn cleared_repairs(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) -> Option<Repairs> {
        self.program.2.resources.iter().find(|r| r.role == Role::Counts)?;
        let repairs = self.repairs.get_or_insert_with(|| Repairs::new(device, &self.options.label));
        repairs.clear(encoder);
        Some(repairs.clone())
    }

    /// A target that nothing writes is a mistake.
    fn check_targets(&self, frame: &Frame<'_>) -> Result<(), Error> {
        for (binding, shown, target) in self.targets(frame) {
            let resource = shown.and_then(|index| self.program.2.resources.get(index));
            if target.is_some() && resource.is_none_or(|r| r.role == Role::Input) {
                let expected = "left out: no stage writes it";
                return Err(Error::Kind { pass: "target", binding, expected });
            }
        }
        Ok(())
    }

    fn targets<'a>(&self, frame: &Frame<'a>) -> [(&'static str, Option<usize>, Option<&'a wgpu::TextureView>); 3] {
        let (shown, targets) = (self.program.2.shown, frame.targets);
        [
            ("composite", shown.composite, targets.composite),
            ("matte", shown.matte, targets.matte),
            ("glossy", shown.glossy, targets.glossy),
        ]
    }

    /// The caller's texture in the place of an image that is shown and not remembered.
    fn target<'a>(&self, index: usize, frame: &Frame<'a>) -> Option<&'a wgpu::TextureView> {
        self.program.2.resources.get(index).filter(|r| r.role == Role::Output)?;
        self.targets(frame).into_iter().find(|(_, shown, _)| *shown == Some(index))?.2
    }

    /// Copies what is shown and remembered at once.
    fn fill_targets(&self, encoder: &mut wgpu::CommandEncoder, frame: &Frame<'_>) {
        for (_, shown, target) in self.targets(frame) {
            let (Some(index), Some(target)) = (shown, target) else { continue };
            let resource = self.program.2.resources.get(index).filter(|r| r.role == Role::Persistent);
            if let Some(own) = resource.and_then(|r| self.planes.view(r.slot, false, self.turn)) {
                let (from, to) = (own.texture().as_image_copy(), target.texture().as_image_copy());
                encoder.copy_texture_to_texture(from, to, extent_of(frame.size));
            }
        }
    }

    /// Program, planes and passes for a frame with these contents.
    fn prepare(&mut self, device: &wgpu::Device, contents: Contents) {
        let Options { settings, storage, fuse, composite, .. } = &self.options;
        let plan = wanted(self.plans.get(settings, contents.inputs()), contents, *composite);
        let (last_plan, last_contents, _) = &self.program;
        if *last_plan == plan && *last_contents == contents {
            return;
        }
        let program = Program::new(&plan, contents, *storage, *fuse);
        self.planes.ensure(device, &program);
        self.kernels.ensure(device, &program);
        self.program = (plan, contents, program);
    }

    fn small(
        &self,
        device: &wgpu::Device,
        frame: &Frame<'_>,
        cameras: &Cameras,
        valid: Validity,
        prepared: Option<PrepareUniforms>,
    ) -> Small {
        let (settings, rows) = (&self.options.settings, frame.size.height);
        let told = SettingsUniforms::of(settings, frame.size, frame.contents());
        let frame_told = FrameUniforms::from_cameras(cameras, self.before.as_ref(), valid);
        let label = |name| format!("{} {name}", self.options.label);
        let uniform = |name, bytes: &[u8]| filled(device, &label(name), bytes, wgpu::BufferUsages::UNIFORM);
        let taps = self.program.2.resources.iter().filter(|r| r.role == Role::Taps).map(|resource| {
            let bytes = pack_taps(settings, resource.slot, rows, frame.index);
            (resource.slot, filled(device, &label(resource.slot.name()), &bytes, wgpu::BufferUsages::STORAGE))
        });
        Small {
            frame: uniform("frame", &frame_told.bytes()),
            settings: uniform("settings", &told.bytes()),
            taps: taps.collect(),
            prepare: prepared.map(|told| uniform("prepare", &told.bytes())),
            hosts: self.hosts(frame),
        }
    }

    fn hosts(&self, frame: &Frame<'_>) -> HashMap<Slot, wgpu::TextureView> {
        let inputs = [Image::DirectInput, Image::MatteInput, Image::GlossyInput].map(Slot::Image);
        let given = inputs.into_iter().filter_map(|slot| Some((slot, frame.input(slot)?.clone())));
        let aimed = self
            .targets(frame)
            .into_iter()
            .filter_map(|(_, index, target)| Some((self.program.2.resources.get(index?)?.slot, target?.clone())));
        given.chain(aimed).collect()
    }

    fn bindable<'a>(&'a self, bound: Bound, frame: &Frame<'a>, small: &'a Small) -> Option<Bindable<'a>> {
        let resource = self.program.2.resources.get(bound.resource)?;
        match resource.role {
            Role::Taps => small.taps.get(&resource.slot).map(Bindable::Taps),
            Role::Uniform => small.prepare.as_ref().map(Bindable::Uniform),
            Role::Counts => self.repairs.as_ref().map(|repairs| Bindable::Counts(repairs.buffer())),
            Role::Input => {
                let stand_in = || self.planes.view(self.program.2.resources.get(resource.absent?)?.slot, false, 0);
                frame.input(resource.slot).or_else(stand_in).map(Bindable::Plane)
            }
            _ => {
                let target = self.target(bound.resource, frame).filter(|_| !bound.before);
                target.or(self.planes.view(resource.slot, bound.before, self.turn)).map(Bindable::Plane)
            }
        }
    }

    fn output(&self, frame: &Frame<'_>, valid: Validity, repairs: Option<Repairs>) -> Output {
        let program = &self.program.2;
        let view = |index: usize| {
            let resource = program.resources.get(index)?;
            let own = self.planes.view(resource.slot, false, self.turn);
            frame.input(resource.slot).or(self.target(index, frame)).or(own).cloned()
        };
        let shown = program.shown;
        let mut joint = Signal::ALL.map(|signal| program.joint[signal as usize].iter());
        Output {
            composite: shown.composite.and_then(view),
            direct: shown.direct.and_then(view),
            matte: shown.matte.and_then(view),
            glossy: shown.glossy.and_then(view),
            confidence: shown.confidence.and_then(view),
            history_length: shown.length.and_then(view),
            joint: frame.joint.iter().filter_map(|p| view(*joint[p.signal as usize].next()?)).collect(),
            repairs,
            had_history: valid.matte || valid.glossy,
        }
    }

    /// Draws a view of the frame that was encoded last, into the same encoder or a later one. `views` are of the
    /// denoiser's storage. The host's own inputs and targets are shown as they are when the encoder runs.
    ///
    /// # Errors
    /// No frame was encoded since `new` or `resize`; an image that it did not make; a target of another format, too small
    /// or without its usage.
    pub fn encode_debug(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        views: &DebugViews,
        view: DebugView,
        target: DebugTarget<'_>,
    ) -> Result<(), Error> {
        let missing = |image| Error::DebugImage { image };
        let (size, small) = self.last.as_ref().ok_or(missing("frame"))?;
        let (program, turn) = (&self.program.2, self.turn);
        let plane = |slot: Slot, before| self.planes.view(slot, before, turn).ok_or(missing(slot.name()));
        let of = |index: Option<usize>| self.planes.view(program.resources.get(index?)?.slot, false, turn);
        let image = match view {
            DebugView::Light(image) => {
                let slot = program.slot_of(&self.program.0, image).ok_or(missing(image.name()))?;
                match small.hosts.get(&slot) {
                    Some(view) => view,
                    None => plane(slot, false)?,
                }
            }
            _ => of(program.shown.confidence).unwrap_or(views.nothing()),
        };
        let inputs = DebugInputs {
            uniforms: [&small.frame, &small.settings],
            guides: [
                plane(Slot::Geometry, false)?,
                plane(Slot::Surface, false)?,
                plane(Slot::Moving, false)?,
                plane(Slot::Geometry, true)?,
                plane(Slot::Surface, true)?,
            ],
            image,
            length: of(program.shown.length).unwrap_or(views.nothing()),
            taps: small.taps.get(&Slot::BilateralTaps),
            tap_count: self.options.settings.matte_bilateral.taps,
            eye: self.before.as_ref().map_or(glam::Vec3::ZERO, |c| c.view.eye),
            has_confidence: program.shown.confidence.is_some(),
            size: *size,
        };
        views.encode(device, encoder, &inputs, view, target)
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
