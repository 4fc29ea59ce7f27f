//! The whole plan on the GPU: the same list of stages as on the CPU, one dispatch or a few each, in the caller's encoder.

use super::error::Error;
use super::guides::pack_spiral;
use super::kernel::Kernel;
use super::pass::Pass;
use super::uniforms::{Cameras, FrameUniforms, SettingsUniforms};
use crate::camera::Camera;
use crate::denoiser::MAX_EXTENT;
use crate::frame::Frame as CpuFrame;
use crate::history::{Ledger, PlanCache};
use crate::kernels::spiral::{Spiral, SpiralShape};
use crate::pipeline::{Image, Inputs, Plan, Stage, Step};
use crate::plane::Size;
use crate::settings::Settings;
use glam::Vec2;
use std::collections::HashMap;

/// Bytes of a colour, of the guides, of confidence and history length, of a number: a pixel each.
const COLOUR: u64 = 16;
const GUIDES: u64 = 48;
const STATE: u64 = 8;
const SCALAR: u64 = 4;

/// One signal of a frame: colour planes of the caller's.
#[derive(Clone, Copy, Debug)]
pub struct Signal<'a> {
    /// Indirect light of the lobe, without its weight.
    pub light: &'a wgpu::Buffer,
    /// What multiplies it back. Absent: 1.
    pub weight: Option<&'a wgpu::Buffer>,
    /// Noisy direct light of the lobe, passed through unfiltered. Absent: none.
    pub direct: Option<&'a wgpu::Buffer>,
}

/// A frame on the GPU: storage buffers of the caller's, in the formats that the module's front page lists; they need the
/// usage `STORAGE`, the guides `COPY_SRC` as well. What they hold means what it means in [`crate::Frame`], and must keep
/// its contract: nothing is repaired here.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The camera that took this frame.
    pub camera: Camera,
    /// The camera of the frame before.
    pub previous_camera: Camera,
    /// Number of the frame; one that does not follow its predecessor by one is a cut.
    pub index: i64,
    /// Guides as [`super::pack_guides`] packs them.
    pub guides: &'a wgpu::Buffer,
    /// The guides' roughness counts.
    pub has_roughness: bool,
    /// The guides' hit distance counts.
    pub has_glossy_hit: bool,
    /// Radiance that needs no filter.
    pub direct: &'a wgpu::Buffer,
    /// The matte signal.
    pub matte: Option<Signal<'a>>,
    /// The glossy signal.
    pub glossy: Option<Signal<'a>>,
}

/// What was encoded: handles of colour planes. They hold the frame once the caller's encoder has run, until the next
/// frame's has. A signal that no stage filters is the caller's own buffer.
#[derive(Clone, Debug)]
pub struct Output {
    /// The sum.
    pub composite: wgpu::Buffer,
    /// Direct light, anti-aliased where the frame has jitter.
    pub direct: wgpu::Buffer,
    /// The matte signal, filtered.
    pub matte: Option<wgpu::Buffer>,
    /// The glossy signal, filtered.
    pub glossy: Option<wgpu::Buffer>,
    /// Confidence and history length of the matte signal, or of the glossy one where there is no matte.
    pub state: Option<wgpu::Buffer>,
    /// The frame continued from the one before.
    pub had_history: bool,
}

/// Buffers of one image size.
#[derive(Debug)]
struct Buffers {
    /// What stages write.
    images: HashMap<Image, wgpu::Buffer>,
    /// Matte and glossy: confidence and history length now and in the frame before.
    state: [wgpu::Buffer; 2],
    state_before: [wgpu::Buffer; 2],
    guides_before: wgpu::Buffer,
    /// Of stage 5.
    widest: wgpu::Buffer,
    rows: wgpu::Buffer,
}

/// The denoiser on the GPU, for one image size and one view. The caller's device and encoder, nothing submitted.
///
/// Plain storage of 32-bit floats, one dispatch or a few a stage; no joint passes, no repair of what the planes hold.
#[derive(Debug)]
pub struct Denoiser {
    size: Size,
    settings: Settings,
    plans: PlanCache,
    ledger: Ledger,
    kernels: HashMap<Stage, Kernel>,
    buffers: Buffers,
    before: Option<Cameras>,
}

/// Images that stages write, and the three that are remembered.
const IMAGES: [Image; 14] = [
    Image::MatteHistory,
    Image::MatteTemporal,
    Image::MattePrefiltered,
    Image::MatteBlended,
    Image::MatteFloored,
    Image::MatteMedian,
    Image::MatteFiltered,
    Image::GlossyHistory,
    Image::GlossyTemporal,
    Image::GlossyHorizontal,
    Image::GlossyFiltered,
    Image::DirectHistory,
    Image::DirectAntialiased,
    Image::Composite,
];

const fn pass_of(stage: Stage) -> Pass {
    match stage {
        Stage::MatteTemporal => Pass::MATTE_TEMPORAL,
        Stage::MattePrefilter => Pass::MATTE_PREFILTER,
        Stage::Disocclusion => Pass::DISOCCLUSION,
        Stage::Firefly => Pass::FIREFLY,
        Stage::MatteBilateral => Pass::MATTE_BILATERAL,
        Stage::GlossyTemporal => Pass::GLOSSY_TEMPORAL,
        Stage::GlossyHorizontal => Pass::GLOSSY_HORIZONTAL,
        Stage::GlossyVertical => Pass::GLOSSY_VERTICAL,
        Stage::DirectTaa => Pass::DIRECT_TAA,
        Stage::Composite => Pass::COMPOSITE,
    }
}

impl Buffers {
    fn new(device: &wgpu::Device, size: Size) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let make = |name: &str, bytes: u64| {
            let label = format!("quell {name}");
            let size = bytes * size.pixels() as u64;
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(&label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        Self {
            images: IMAGES.into_iter().map(|image| (image, make(image.name(), COLOUR))).collect(),
            state: ["matte state", "glossy state"].map(|name| make(name, STATE)),
            state_before: ["matte state before", "glossy state before"].map(|name| make(name, STATE)),
            guides_before: make("guides before", GUIDES),
            widest: make("disocclusion widest", SCALAR),
            rows: make("disocclusion rows", SCALAR),
        }
    }
}

impl Denoiser {
    /// Device memory that it holds, bytes a pixel.
    pub const BYTES_PER_PIXEL: u64 = IMAGES.len() as u64 * COLOUR + 4 * STATE + GUIDES + 2 * SCALAR;

    /// A denoiser for frames of `size`: compiles every pass and allocates every plane on the caller's device.
    ///
    /// # Errors
    /// A size without pixels or beyond the device's limits; a setting out of its range. Running out of device memory
    /// reaches the host through its device, as for any resource.
    pub fn new(device: &wgpu::Device, size: Size, settings: &Settings) -> Result<Self, Error> {
        settings.check()?;
        check_size(device, size)?;
        Ok(Self {
            size,
            settings: settings.clone(),
            plans: PlanCache::new(settings),
            ledger: Ledger::default(),
            kernels: Stage::ALL.into_iter().map(|s| (s, Kernel::new(device, pass_of(s)))).collect(),
            buffers: Buffers::new(device, size),
            before: None,
        })
    }

    /// Changes settings; no pipeline is built anew, history is kept.
    ///
    /// # Errors
    /// A setting out of its range; the old settings stay.
    pub fn set_settings(&mut self, settings: &Settings) -> Result<(), Error> {
        settings.check()?;
        self.settings = settings.clone();
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
        check_size(device, size)?;
        self.buffers = Buffers::new(device, size);
        self.size = size;
        self.before = None;
        self.ledger.reset();
        Ok(())
    }

    /// Appends the next frame to the caller's encoder. Frames run in the order in which they were encoded; several may be
    /// encoded before one submit. An encoder that is thrown away has lost a frame: call [`Denoiser::reset`].
    ///
    /// # Errors
    /// A buffer that is too small or lacks a usage, a camera that cannot be used. Nothing was encoded then, and history is
    /// as it was.
    pub fn encode(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        frame: &Frame<'_>,
    ) -> Result<Output, Error> {
        self.check(frame)?;
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
        let inputs = Inputs {
            matte: frame.matte.is_some(),
            glossy: frame.glossy.is_some(),
            jitter: frame.camera.jitter != [0.0; 2],
        };
        let plan = self.plans.get(&self.settings, inputs).clone();

        let there = |signal: Option<Signal<'_>>| {
            (signal.is_some(), signal.is_some_and(|s| s.direct.is_some()), signal.is_some_and(|s| s.weight.is_some()))
        };
        let (matte, glossy) = (there(frame.matte), there(frame.glossy));
        let settings = SettingsUniforms::new(&self.settings, self.size)
            .with_terms(matte.0, glossy.0, matte.1, glossy.1)
            .with_weights(matte.2, glossy.2);
        let uniform = wgpu::BufferUsages::UNIFORM;
        let settings = filled(device, "quell settings", &settings.bytes(), uniform);
        let with = self.before.map(|before| FrameUniforms::from_cameras(&cameras, Some(&before)));
        let with = with.map(|with| filled(device, "quell frame", &with.bytes(), uniform));
        let without = FrameUniforms::from_cameras(&cameras, None);
        let without = filled(device, "quell frame without history", &without.bytes(), uniform);

        for step in &plan.steps {
            let continues = match step.stage {
                Stage::MatteTemporal => valid.matte,
                Stage::GlossyTemporal => valid.glossy,
                Stage::DirectTaa => valid.direct,
                _ => false,
            };
            let uniforms = with.as_ref().filter(|_| continues).unwrap_or(&without);
            let Some(kernel) = self.kernels.get(&step.stage) else { continue };
            let spiral = self.spiral(device, step.stage, frame.index);
            if let Some(buffers) = self.bound(step, frame, spiral.as_ref()) {
                kernel.encode(device, encoder, uniforms, &settings, &buffers, self.size)?;
            }
        }
        self.remember(encoder, frame, &plan);
        self.ledger.close(&noted, &plan);
        self.before = Some(cameras);
        let buffer = |image| self.image(image, frame).cloned();
        let state = |stage, k: usize| plan.runs(stage).then(|| self.buffers.state[k].clone());
        Ok(Output {
            composite: buffer(Image::Composite).unwrap_or_else(|| frame.direct.clone()),
            direct: buffer(plan.direct_output).unwrap_or_else(|| frame.direct.clone()),
            matte: frame.matte.and_then(|_| buffer(plan.matte_output)),
            glossy: frame.glossy.and_then(|_| buffer(plan.glossy_output)),
            state: state(Stage::MatteTemporal, 0).or_else(|| state(Stage::GlossyTemporal, 1)),
            had_history: valid.matte || valid.glossy,
        })
    }

    fn check(&self, frame: &Frame<'_>) -> Result<(), Error> {
        let pixels = self.size.pixels() as u64;
        let check = |binding, buffer: &wgpu::Buffer, stride: u64| {
            let (pass, size, needed, found) = ("denoiser", self.size, stride * pixels, buffer.size());
            if found < needed {
                return Err(Error::BufferSize { pass, binding, size, needed, found });
            }
            if !buffer.usage().contains(wgpu::BufferUsages::STORAGE) {
                return Err(Error::BufferUsage { pass, binding, usage: "STORAGE" });
            }
            Ok(())
        };
        check("guides", frame.guides, GUIDES)?;
        if !frame.guides.usage().contains(wgpu::BufferUsages::COPY_SRC) {
            return Err(Error::BufferUsage { pass: "denoiser", binding: "guides", usage: "COPY_SRC" });
        }
        check("direct", frame.direct, COLOUR)?;
        for (signal, names) in [
            (frame.matte, ["matte", "matte_weight", "direct_matte"]),
            (frame.glossy, ["glossy", "glossy_weight", "direct_glossy"]),
        ] {
            let Some(signal) = signal else { continue };
            for (name, buffer) in names.into_iter().zip([Some(signal.light), signal.weight, signal.direct]) {
                buffer.map_or(Ok(()), |b| check(name, b, COLOUR))?;
            }
        }
        Ok(())
    }

    /// The buffer of an image: the caller's, or the denoiser's own.
    fn image<'a>(&'a self, image: Image, frame: &Frame<'a>) -> Option<&'a wgpu::Buffer> {
        match image {
            Image::Guides => Some(frame.guides),
            Image::MatteInput => frame.matte.map(|s| s.light),
            Image::GlossyInput => frame.glossy.map(|s| s.light),
            Image::DirectInput => Some(frame.direct),
            _ => self.buffers.images.get(&image),
        }
    }

    /// The tap pattern of a stage in a frame.
    fn spiral(&self, device: &wgpu::Device, stage: Stage, index: i64) -> Option<wgpu::Buffer> {
        let rows = self.size.height;
        let shape = match stage {
            Stage::MattePrefilter => SpiralShape::prefilter(&self.settings.matte_prefilter, rows, index),
            Stage::MatteBilateral => SpiralShape::bilateral(&self.settings.matte_bilateral, rows, index),
            _ => return None,
        };
        let bytes = pack_spiral(&Spiral::new(&shape));
        Some(filled(device, "quell spiral", &bytes, wgpu::BufferUsages::STORAGE))
    }

    /// The buffers of a step in the order of its pass's bindings; `None` where the plan names what is not there.
    fn bound<'a>(
        &'a self,
        step: &Step,
        frame: &Frame<'a>,
        spiral: Option<&'a wgpu::Buffer>,
    ) -> Option<Vec<&'a wgpu::Buffer>> {
        let own = &self.buffers;
        let (input, output) = (self.image(step.input, frame)?, self.image(step.output, frame)?);
        let temporal = |history, k: usize| {
            let history = self.image(history, frame)?;
            Some(vec![frame.guides, &own.guides_before, input, history, &own.state_before[k], output, &own.state[k]])
        };
        match step.stage {
            Stage::MatteTemporal => temporal(Image::MatteHistory, 0),
            Stage::GlossyTemporal => temporal(Image::GlossyHistory, 1),
            Stage::MattePrefilter | Stage::MatteBilateral => Some(vec![frame.guides, spiral?, input, output]),
            Stage::Firefly | Stage::GlossyHorizontal | Stage::GlossyVertical => Some(vec![frame.guides, input, output]),
            Stage::Disocclusion => {
                let prefiltered = self.image(*step.also_reads.first()?, frame)?;
                let floored = self.image(Image::MatteFloored, frame)?;
                Some(vec![&own.state[0], &own.widest, &own.rows, input, prefiltered, output, floored])
            }
            Stage::DirectTaa => Some(vec![frame.guides, input, self.image(Image::DirectHistory, frame)?, output]),
            Stage::Composite => {
                // What the frame lacks is not read: any buffer will do.
                let any = frame.direct;
                let is_glossy =
                    |image: &Image| matches!(image, Image::GlossyInput | Image::GlossyTemporal | Image::GlossyFiltered);
                let signal = |glossy: bool| {
                    let mut images = step.also_reads.iter().filter(|i| **i != Image::Weights);
                    images.find(|i| is_glossy(i) == glossy).and_then(|i| self.image(*i, frame)).unwrap_or(any)
                };
                let direct = |s: Option<Signal<'a>>| s.and_then(|s| s.direct).unwrap_or(any);
                let weight = |s: Option<Signal<'a>>| s.and_then(|s| s.weight).unwrap_or(any);
                Some(vec![
                    input,
                    signal(false),
                    signal(true),
                    direct(frame.matte),
                    direct(frame.glossy),
                    weight(frame.matte),
                    weight(frame.glossy),
                    output,
                ])
            }
        }
    }

    /// Copies what the next frame reads: stages overwrite their images.
    fn remember(&self, encoder: &mut wgpu::CommandEncoder, frame: &Frame<'_>, plan: &Plan) {
        let pixels = self.size.pixels() as u64;
        let mut copy = |from: Option<&wgpu::Buffer>, to: Option<&wgpu::Buffer>, stride: u64| {
            if let (Some(from), Some(to)) = (from, to) {
                encoder.copy_buffer_to_buffer(from, 0, to, 0, stride * pixels);
            }
        };
        for (feedback, history, k) in
            [(plan.matte_feedback, Image::MatteHistory, 0), (plan.glossy_feedback, Image::GlossyHistory, 1)]
        {
            if let Some(image) = feedback {
                copy(self.image(image, frame), self.image(history, frame), COLOUR);
                copy(Some(&self.buffers.state[k]), Some(&self.buffers.state_before[k]), STATE);
            }
        }
        if plan.runs(Stage::DirectTaa) {
            copy(self.image(plan.direct_output, frame), self.image(Image::DirectHistory, frame), COLOUR);
        }
        copy(Some(frame.guides), Some(&self.buffers.guides_before), GUIDES);
    }
}

/// The largest plane must fit one binding.
fn check_size(device: &wgpu::Device, size: Size) -> Result<(), Error> {
    if size.width == 0 || size.height == 0 {
        return Err(crate::Error::EmptySize { size }.into());
    }
    if size.width > MAX_EXTENT || size.height > MAX_EXTENT {
        return Err(crate::Error::SizeTooLarge { size, limit: MAX_EXTENT }.into());
    }
    let limits = device.limits();
    let bytes = (size.pixels() as u64).saturating_mul(GUIDES);
    for (limit, most) in [
        ("max_storage_buffer_binding_size", limits.max_storage_buffer_binding_size),
        ("max_buffer_size", limits.max_buffer_size),
    ] {
        if bytes > most {
            return Err(Error::Size { pass: "denoiser", size, limit });
        }
    }
    Ok(())
}

/// A buffer of its own for every frame: what several frames before one submit read must not be overwritten.
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
