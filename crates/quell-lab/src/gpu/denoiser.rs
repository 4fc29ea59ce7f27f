//! Frames in, frames out.

use super::device::Gpu;
use super::error::Error;
use quell::frame::Signal;
use quell::gpu::{
    Options, PackedFrame, PackedGuides, PackedSignal, Texel, unpack_colours, unpack_fourth, unpack_numbers, wgpu,
};
use quell::pipeline::Stage;
use quell::report::StageTimes;
use quell::{Camera, Frame, Output, OutputBuf, Plane, Report, Settings, Size};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How a frame's colours come onto the device.
const COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// [`quell::Denoiser`]'s twin on a device of this program.
#[derive(Debug)]
pub struct Denoiser {
    gpu: Arc<Gpu>,
    guest: quell::gpu::Denoiser,
    size: Size,
    planes: HashMap<Name, wgpu::TextureView>,
    uploaded: Option<Uploaded>,
    output: Option<OutputBuf>,
}

/// A frame that has run.
#[derive(Clone, Debug)]
pub struct Ran {
    /// Where it lies.
    pub output: quell::gpu::Output,
    /// From encoding to the end.
    pub wall: Duration,
    /// Of its stages, where the adapter has timestamps.
    pub times: StageTimes,
}

/// A plane that is uploaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Name {
    Plane(&'static str),
    /// The joint pass of this number.
    Joint(usize),
}

impl std::fmt::Display for Name {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Plane(name) => f.write_str(name),
            Self::Joint(index) => write!(f, "joint pass {index}"),
        }
    }
}

/// What of a frame is not in a texture.
#[derive(Clone, Debug)]
struct Uploaded {
    camera: Camera,
    previous_camera: Camera,
    index: i64,
    has_roughness: bool,
    has_glossy_hit: bool,
    signals: [Option<Terms>; 2],
    /// Name and signal of each joint pass.
    joint: Vec<(String, Signal)>,
    sanitised: quell::border::Sanitised,
}

/// What of a signal is there besides its light.
#[derive(Clone, Copy, Debug)]
struct Terms {
    weight: bool,
    direct: bool,
}

/// Names of a signal's planes: light, weight, noisy direct light.
const NAMES: [[&str; 3]; 2] = [["matte", "matte_weight", "direct_matte"], ["glossy", "glossy_weight", "direct_glossy"]];

impl Denoiser {
    /// A denoiser for frames of `size`.
    ///
    /// # Errors
    /// A size or a setting that the denoiser refuses; the device's memory.
    pub fn new(gpu: Arc<Gpu>, size: Size, settings: &Settings) -> Result<Self, Error> {
        let mut options = Options::new(settings);
        options.composite = true;
        options.timings = true;
        let guest = quell::gpu::Denoiser::new(gpu.device(), size, &options)?;
        gpu.check(&format!("the planes of {size}"))?;
        Ok(Self { gpu, guest, size, planes: HashMap::new(), uploaded: None, output: None })
    }

    /// Forgets history: the next frame starts afresh.
    pub fn reset(&mut self) {
        self.guest.reset();
    }

    /// Filters the next frame: uploads it, runs it, reads it back.
    ///
    /// # Errors
    /// What [`quell::Frame::check`] finds; what the device reports.
    pub fn denoise(&mut self, frame: &Frame<'_>) -> Result<Output<'_>, Error> {
        let begin = Instant::now();
        self.upload(frame)?;
        let uploading = begin.elapsed();
        let ran = self.run()?;
        let begin = Instant::now();
        let mut read = self.read(&ran.output)?;
        read.report.times = ran.times;
        read.report.times.border = uploading + begin.elapsed();
        Ok(self.output.insert(read).output())
    }

    /// Brings a frame onto the device, for [`Denoiser::run`].
    ///
    /// # Errors
    /// What [`quell::Frame::check`] finds; what the device reports.
    pub fn upload(&mut self, frame: &Frame<'_>) -> Result<(), Error> {
        frame.check(self.size).map_err(quell::gpu::Error::Denoiser)?;
        let packed = PackedFrame::new(frame, self.guest.storage()).map_err(quell::gpu::Error::Denoiser)?;
        let storage = self.guest.storage();
        for (name, texel, texels) in [
            ("geometry", Texel::Geometry, &packed.guides.geometry),
            ("surface", Texel::Surface, &packed.guides.surface),
            ("moving", Texel::Moving, &packed.guides.moving),
        ] {
            self.write(Name::Plane(name), texel.format(storage), texels);
        }
        self.write(Name::Plane("direct"), COLOUR, &packed.direct);
        for (signal, names) in [&packed.matte, &packed.glossy].into_iter().zip(NAMES) {
            let Some(PackedSignal { light, weight, direct }) = signal else { continue };
            for (bytes, name) in [Some(light), weight.as_ref(), direct.as_ref()].into_iter().zip(names) {
                if let Some(bytes) = bytes {
                    self.write(Name::Plane(name), COLOUR, bytes);
                }
            }
        }
        for (index, light) in packed.joint.iter().enumerate() {
            self.write(Name::Joint(index), COLOUR, light);
        }
        let terms = |signal: &Option<PackedSignal>| {
            signal.as_ref().map(|s| Terms { weight: s.weight.is_some(), direct: s.direct.is_some() })
        };
        self.uploaded = Some(Uploaded {
            camera: frame.camera,
            previous_camera: frame.previous_camera,
            index: frame.index,
            has_roughness: packed.has_roughness,
            has_glossy_hit: packed.has_glossy_hit,
            signals: [terms(&packed.matte), terms(&packed.glossy)],
            joint: frame.passes.iter().map(|pass| (pass.name.to_owned(), pass.signal)).collect(),
            sanitised: packed.sanitised,
        });
        // Without this the copies would run, and be timed, with the frame.
        self.gpu.queue().submit([]);
        self.gpu.wait("uploading a frame")
    }

    /// Runs what was uploaded, as the frame after the one before; the wall time from encoding to the end.
    ///
    /// # Errors
    /// Nothing was uploaded; what the device reports.
    pub fn run(&mut self) -> Result<Ran, Error> {
        let Some(uploaded) = &self.uploaded else {
            return Err(Error::NoFrame);
        };
        let plane = |name| self.planes.get(&Name::Plane(name));
        let (Some(geometry), Some(surface), Some(moving), Some(direct)) =
            (plane("geometry"), plane("surface"), plane("moving"), plane("direct"))
        else {
            return Err(Error::NoFrame);
        };
        let signal = |k: usize| {
            let (terms, names) = (uploaded.signals[k]?, NAMES[k]);
            Some(quell::gpu::Signal {
                light: plane(names[0])?,
                weight: plane(names[1]).filter(|_| terms.weight),
                direct: plane(names[2]).filter(|_| terms.direct),
            })
        };
        let joint = uploaded.joint.iter().enumerate().filter_map(|(index, (name, signal))| {
            let light = self.planes.get(&Name::Joint(index))?;
            Some(quell::gpu::JointPlane { name, signal: *signal, light })
        });
        let joint: Vec<_> = joint.collect();
        let Uploaded { camera, previous_camera, index, has_roughness, has_glossy_hit, .. } = *uploaded;
        let guides = PackedGuides { geometry, surface, moving, has_roughness, has_glossy_hit };
        let frame = quell::gpu::Frame {
            direct: Some(direct),
            matte: signal(0),
            glossy: signal(1),
            joint: &joint,
            ..quell::gpu::Frame::new(self.size, camera, previous_camera, index, guides)
        };
        let begin = Instant::now();
        let mut encoder = self.gpu.encoder("quell host");
        let output = self.guest.encode(self.gpu.device(), &mut encoder, &frame)?;
        self.guest.resolve_timings(self.gpu.device(), &mut encoder);
        self.gpu.run(encoder, "a frame")?;
        let wall = begin.elapsed();
        let mut times = StageTimes::default();
        for timing in self.guest.take_timings(self.gpu.queue()).unwrap_or_default() {
            // Of stages that share a pass the first has the time of all.
            if let Some(&stage) = timing.stages.first() {
                let so_far = times.get(stage).unwrap_or_default();
                times.set(stage, so_far + Duration::from_secs_f64(timing.milliseconds.max(0.0) * 1e-3));
            }
        }
        Ok(Ran { output, wall, times })
    }

    /// Names of the passes that ran several stages of the last frame.
    pub fn shared_passes(&self) -> Vec<&'static str> {
        let passes = self.guest.program().dispatches.iter().map(|d| d.pass);
        passes.filter(|pass| pass.stages.len() > 1).map(|pass| pass.name).collect()
    }

    /// Bytes a pixel that a stage moves, as the last frame ran.
    pub fn bytes_per_pixel(&self, stage: Stage) -> Option<u32> {
        self.guest.program().bytes_per_pixel(stage)
    }

    fn read(&self, encoded: &quell::gpu::Output) -> Result<OutputBuf, Error> {
        let what = "reading a frame back";
        // Direct light is always given, and the sum asked for.
        let named = [&encoded.composite, &encoded.direct, &encoded.matte, &encoded.glossy].map(Option::as_ref);
        let state = encoded.confidence.iter().chain(&encoded.history_length);
        let textures: Vec<&wgpu::Texture> =
            named.into_iter().flatten().chain(state).chain(&encoded.joint).map(|v| v.texture()).collect();
        let contents = self.gpu.read_textures(&textures, what)?;
        let mut contents = textures.iter().map(|t| t.format()).zip(contents);
        let short = || Error::Refused {
            adapter: self.gpu.adapter().name.clone(),
            what: what.to_owned(),
            reason: "a texture holds no whole plane".to_owned(),
        };
        let mut colour =
            || contents.next().and_then(|(f, texels)| unpack_colours(&texels, self.size, f)).ok_or_else(short);
        let (composite, direct) = (colour()?, colour()?);
        let matte = encoded.matte.as_ref().map(|_| colour()).transpose()?;
        let glossy = encoded.glossy.as_ref().map(|_| colour()).transpose()?;
        let confidence = match contents.next() {
            Some((format, texels)) => unpack_fourth(&texels, self.size, format).ok_or_else(short)?,
            None => Plane::filled(self.size, 0.0),
        };
        let history_length = match contents.next() {
            Some((_, texels)) => unpack_numbers(&texels, self.size).ok_or_else(short)?,
            None => Plane::filled(self.size, 1.0),
        };
        // After the signal its passes.
        let (mut matte, mut glossy): (Vec<_>, Vec<_>) = (matte.into_iter().collect(), glossy.into_iter().collect());
        for (_, signal) in self.uploaded.iter().flat_map(|uploaded| &uploaded.joint) {
            let Some((format, texels)) = contents.next() else { break };
            let light = unpack_colours(&texels, self.size, format).ok_or_else(short)?;
            match signal {
                Signal::Matte => matte.push(light),
                Signal::Glossy => glossy.push(light),
            }
        }
        let report = Report {
            sanitised: self.uploaded.as_ref().map(|u| u.sanitised).unwrap_or_default(),
            reset_pixels: confidence.data().iter().filter(|c| **c == 0.0).count() as u64,
            had_history: encoded.had_history,
            times: StageTimes::default(),
        };
        Ok(OutputBuf { composite, direct, matte, glossy, confidence, history_length, report })
    }

    /// Fills the texture of a plane; it is made where there is none.
    fn write(&mut self, name: Name, format: wgpu::TextureFormat, texels: &[u8]) {
        match self.planes.get(&name) {
            Some(view) => self.gpu.write_texture(view.texture(), texels),
            None => {
                let view = self.gpu.texture(&format!("quell host {name}"), self.size, format, texels);
                self.planes.insert(name, view);
            }
        }
    }
}
