//! The whole plan on the GPU: walks the program, in the caller's encoder.

mod binder;
mod debug;

use super::convention::PrepareUniforms;
use super::error::Error;
use super::frame::{Frame, Guides, Output};
use super::groups::Groups;
use super::kernel::{workgroups, workgroups_of};
use super::kernels::Kernels;
use super::options::Options;
use super::pass::WORKGROUP;
use super::planes::{Planes, extent_of};
use super::program::{Contents, Memory, Program, Role};
use super::repairs::Repairs;
use super::slot::Slot;
use super::small::{Part, Small};
use super::storage::Storage;
use super::taps::pack_taps;
use super::tile::Tile;
use super::timing::{self, Timing, Timings};
use super::uniforms::{Cameras, FrameUniforms, SettingsUniforms};
use crate::camera::Camera;
use crate::history::{Ledger, PlanCache, Validity};
use crate::pipeline::{Image, Plan, Stage};
use crate::plane::Size;
use crate::settings::Settings;
use binder::{Binder, check_targets};
use debug::Last;
use glam::Vec2;

/// The denoiser on the GPU, for one image size and one view. The caller's device and encoder, nothing submitted.
#[derive(Debug)]
pub struct Denoiser {
    size: Size,
    pub(super) options: Options,
    plans: PlanCache,
    pub(super) ledger: Ledger,
    kernels: Kernels,
    planes: Planes,
    pub(super) program: (Plan, Contents, Program),
    before: Option<Cameras>,
    timings: Option<Timings>,
    /// Which copy of what alternates this frame writes: 0 or 1.
    turn: usize,
    /// Of the last frame.
    pub(super) tile: Option<Tile>,
    /// Made when guides first come as textures, or repairs are to be counted.
    repairs: Option<Repairs>,
    small: Small,
    groups: Groups,
    last: Option<Last>,
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
        plan.steps.retain(|s| !matches!(s.stage, Stage::Composite | Stage::Antialiasing));
    }
    plan
}

fn program_of(plan: &Plan, contents: Contents, options: &Options) -> Program {
    let program = Program::new(plan, contents, options.storage, options.fuse);
    if options.share_planes { program.with_shared_planes() } else { program }
}

impl Denoiser {
    /// A denoiser for frames of `size`: compiles the passes and makes the planes, on the caller's device, that a frame
    /// with both signals needs. What only other frames or settings need is made when they first come.
    ///
    /// # Errors
    /// A size without pixels or beyond the device's limits; a setting out of its range. Running out of device memory
    /// reaches the host through its device, as for any resource.
    pub fn new(device: &wgpu::Device, size: Size, options: &Options) -> Result<Self, Error> {
        Self::with_kernels(device, size, options, Kernels::default())
    }

    fn with_kernels(device: &wgpu::Device, size: Size, options: &Options, mut kernels: Kernels) -> Result<Self, Error> {
        options.settings.check()?;
        let plans = PlanCache::new(&options.settings);
        let usual = Contents::USUAL;
        let plan = wanted(&Plan::new(&options.settings, usual.inputs()), usual, options.composite);
        let program = program_of(&plan, usual, options);
        let mut planes = Planes::new(device, size, &options.label, options.storage)?;
        workgroups_of(device, "denoiser", WORKGROUP, size)?;
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
            timings: options.timings.then(|| Timings::new(device, &options.label, timing::MOST)).flatten(),
            turn: 0,
            tile: None,
            repairs: None,
            small: Small::new(&options.label),
            groups: Groups::default(),
            last: None,
        })
    }

    /// Another denoiser with these options, for another tile or view: what this one has compiled is not compiled again.
    ///
    /// # Errors
    /// As [`Denoiser::new`].
    pub fn another(&self, device: &wgpu::Device, size: Size) -> Result<Self, Error> {
        Self::with_kernels(device, size, &self.options, self.kernels.clone())
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

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.options.settings
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
        workgroups_of(device, "denoiser", WORKGROUP, size)?;
        planes.ensure(device, &self.program.2);
        self.planes = planes;
        self.size = size;
        self.before = None;
        self.groups.clear();
        self.last = None;
        self.tile = None;
        self.ledger.reset();
        Ok(())
    }

    /// The largest extent of a frame.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Extent of the last frame.
    pub(super) fn last_size(&self) -> Option<Size> {
        self.last.as_ref().map(|last| last.size)
    }

    /// How planes are stored.
    pub fn storage(&self) -> Storage {
        self.options.storage
    }

    /// What the last frame ran; before the first one, what a frame with everything will run.
    pub fn program(&self) -> &Program {
        &self.program.2
    }

    /// Device memory of the planes that were made: of [`Denoiser::program`], and what other contents or settings needed
    /// before.
    pub fn memory(&self) -> Memory {
        self.planes.memory()
    }

    /// A plane as the last frame that was encoded left it; `None`: the program has none, or another plane has its texture
    /// by now ([`Options::share_planes`]). For debug views and bisecting.
    pub fn plane(&self, slot: Slot) -> Option<&wgpu::TextureView> {
        let index = self.program.2.resources.iter().position(|r| r.slot == slot && r.lasts)?;
        self.planes.view(self.program.2.home(index)?.slot, false, self.turn)
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
        workgroups_of(device, "denoiser", WORKGROUP, size)?;
        let tile = frame.tile.unwrap_or(Tile::whole(size));
        let projection = |camera: &Camera, which| camera.projection(tile.whole).ok_or(crate::Error::Camera { which });
        let cameras = Cameras {
            view: projection(&frame.camera, "camera")?,
            previous_view: projection(&frame.previous_camera, "previous_camera")?,
            jitter: Vec2::from(frame.camera.jitter),
            size,
            tile,
            has_glossy_hit: frame.guides.has_glossy_hit(),
            has_roughness: frame.guides.has_roughness(),
        };
        let prepared = match &frame.guides {
            Guides::Textures(textures) => {
                let cameras = [&frame.camera, &frame.previous_camera];
                let prepared = PrepareUniforms::new(cameras, tile.whole, textures);
                Some(prepared.ok_or(crate::Error::Camera { which: "camera" })?)
            }
            Guides::Packed(_) => None,
        };
        let keys = frame.keys();
        // Of another tile, what is remembered lies at other pixels.
        let is_same_place = frame.tile == self.tile;
        let valid = if is_same_place { self.ledger.open_keyed(frame.index, keys) } else { Validity::default() };
        self.prepare(device, Contents { counts: self.options.count_repairs, ..frame.contents() });
        check_targets(&self.program.2, frame)?;
        self.turn = 1 - self.turn;
        let uniforms = self.per_frame(frame, &cameras, valid, prepared);
        if self.small.fill(device, encoder, &uniforms) {
            self.groups.clear();
        }
        self.take_packed(encoder, frame);
        let repairs = self.cleared_repairs(device, encoder);
        let Self { program: (plan, _, program), planes, small, kernels, groups, timings, turn, .. } = self;
        let binder = Binder { program, planes, small, repairs: repairs.as_ref(), frame, turn: *turn };
        timings.iter_mut().for_each(Timings::clear);
        for (index, dispatch) in program.dispatches.iter().enumerate() {
            let Some(kernel) = kernels.get(dispatch) else { continue };
            let views = dispatch.bound.iter().filter_map(|bound| binder.view(*bound));
            let make = || {
                let uniforms = [Part::Frame, Part::Settings].into_iter().map(|part| small.binding(part));
                let bound = dispatch.bound.iter().map(|bound| binder.binding(*bound));
                Some(kernel.group(device, uniforms.chain(bound).collect::<Option<Vec<_>>>()?))
            };
            if let Some(group) = groups.get(index, *turn, views, make) {
                let workgroups = workgroups(device, &dispatch.pass, size)?;
                kernel.dispatch(encoder, group, workgroups, timings.as_mut().and_then(|t| t.next(&dispatch.pass)));
            }
        }
        binder.fill_targets(encoder);
        let output = binder.output(valid, repairs.clone());
        self.last = Some(Last { size, hosts: binder.hosts() });
        self.ledger.close_keyed(frame.index, keys, plan);
        self.before = Some(cameras);
        self.tile = frame.tile;
        Ok(output)
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

    /// Program, planes and passes for a frame with these contents.
    fn prepare(&mut self, device: &wgpu::Device, contents: Contents) {
        let plan = self.plans.get(&self.options.settings, contents.inputs());
        let plan = wanted(plan, contents, self.options.composite);
        let (last_plan, last_contents, _) = &self.program;
        if *last_plan == plan && *last_contents == contents {
            return;
        }
        let program = program_of(&plan, contents, &self.options);
        self.planes.ensure(device, &program);
        self.kernels.ensure(device, &program);
        self.groups.clear();
        self.program = (plan, contents, program);
    }

    /// Uniforms and taps of a frame.
    fn per_frame(
        &self,
        frame: &Frame<'_>,
        cameras: &Cameras,
        valid: Validity,
        prepared: Option<PrepareUniforms>,
    ) -> Vec<(Part, Vec<u8>)> {
        // Kernels have the whole picture's sizes.
        let (settings, whole) = (&self.options.settings, cameras.tile.whole);
        let settings_uniforms = SettingsUniforms::of(settings, whole, frame.contents());
        let frame_uniforms = FrameUniforms::from_cameras(cameras, self.before.as_ref(), valid);
        let mut parts = vec![(Part::Frame, frame_uniforms.bytes()), (Part::Settings, settings_uniforms.bytes())];
        for resource in &self.program.2.resources {
            let bytes = match resource.role {
                Role::Taps => pack_taps(settings, resource.slot, whole.height, frame.index),
                Role::Uniform => prepared.map(|p| p.bytes()).unwrap_or_default(),
                _ => continue,
            };
            parts.push((Part::Resource(resource.slot), bytes));
        }
        parts
    }
}
