//! Scene, tracer, denoiser and pictures on one device. A frame is encoded into the caller's encoder: traced, denoised, shown;
//! nothing is read back.

use crate::baselines::{Baselines, Wanted};
use crate::choice::{Choice, DEBUG_VIEWS, Pane, Tracing};
use crate::clock::{Clock, Times};
use crate::display::{Display, Pictures, writes};
use crate::error::LiveError;
use crate::shot::PlanesShot;
use crate::stage::Stage;
use quell::gpu::{self, Channel, DebugTarget, DebugView, DebugViews, GuideTextures, Scalar, Signal, wgpu};
use quell::{Camera, Preset, Settings, Size};
use quell_trace::gpu::{Kernels, Planes, View};
use quell_trace::{RenderOptions, jitter_of};
use std::sync::Arc;

/// What is looked at in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Without jitter.
    pub camera: Camera,
    /// Time of what moves, in frames of the scene.
    pub time: f64,
    /// Pixel under the pointer, for [`DebugView::WeightsAround`].
    pub pointer: [u32; 2],
}

/// What was encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Made {
    /// Number of the frame.
    pub number: i64,
    /// Frames in the converged picture.
    pub converged: u32,
    /// The denoiser had history.
    pub had_history: bool,
}

/// The last frame that was encoded, to be traced once more.
#[derive(Clone, Copy)]
struct Last {
    view: View,
    sight: Sight,
    tracing: Tracing,
}

/// A live picture of a scene.
pub struct Engine {
    device: wgpu::Device,
    queue: wgpu::Queue,
    kernels: Arc<Kernels>,
    stage: Option<Stage>,
    denoiser: gpu::Denoiser,
    debug: Option<DebugViews>,
    baselines: Baselines,
    display: Display,
    planes: Planes,
    pictures: Pictures,
    clock: Option<Clock>,
    times: Times,
    denoiser_times: Times,
    settings: Settings,
    number: i64,
    last: Option<Last>,
}

fn check(device: &wgpu::Device, size: Size) -> Result<(), LiveError> {
    let limit = device.limits().max_texture_dimension_2d;
    let fits = |n: usize| n > 0 && n <= limit as usize;
    if fits(size.width) && fits(size.height) { Ok(()) } else { Err(LiveError::Size { size, limit }) }
}

impl Engine {
    /// An engine without a scene for pictures of `size`, on the caller's device: WebGPU's default limits will do. With
    /// timestamps where the device has the feature `TIMESTAMP_QUERY`.
    ///
    /// # Errors
    /// A size without pixels or beyond the device's limits.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, size: Size) -> Result<Self, LiveError> {
        check(device, size)?;
        let settings = Settings::preset(Preset::default());
        let mut options = gpu::Options::new(&settings);
        options.composite = true;
        options.timings = true;
        // Debug views of signals show what others would overwrite.
        options.share_planes = false;
        Ok(Self {
            denoiser: gpu::Denoiser::new(device, size, &options)?,
            debug: None,
            baselines: Baselines::new(device),
            display: Display::new(device),
            planes: Planes::new(device, size),
            pictures: Pictures::new(device, size),
            clock: Clock::new(device),
            times: Times::default(),
            denoiser_times: Times::default(),
            device: device.clone(),
            queue: queue.clone(),
            kernels: Arc::default(),
            stage: None,
            settings,
            number: 0,
            last: None,
        })
    }

    /// Kernels of this device, for [`Stage::new`].
    pub fn kernels(&self) -> &Arc<Kernels> {
        &self.kernels
    }

    /// Shows another scene, which was made for the same device.
    pub fn set_stage(&mut self, stage: Stage) {
        self.stage = Some(stage);
        self.reset();
    }

    /// What is shown.
    pub fn stage(&self) -> Option<&Stage> {
        self.stage.as_ref()
    }

    /// The same, for its lamps.
    pub fn stage_mut(&mut self) -> Option<&mut Stage> {
        self.stage.as_mut()
    }

    /// Extent of the pictures.
    pub fn size(&self) -> Size {
        self.planes.size()
    }

    /// Pictures of another extent; all history is forgotten.
    ///
    /// # Errors
    /// A size without pixels or beyond the device's limits; the old size stays.
    pub fn resize(&mut self, size: Size) -> Result<(), LiveError> {
        if size == self.size() {
            return Ok(());
        }
        check(&self.device, size)?;
        self.denoiser.resize(&self.device, size)?;
        self.planes = Planes::new(&self.device, size);
        self.pictures = Pictures::new(&self.device, size);
        self.baselines.reset();
        self.last = None;
        Ok(())
    }

    /// Forgets history: as a cut does.
    pub fn reset(&mut self) {
        self.denoiser.reset();
        self.baselines.reset();
        self.last = None;
    }

    /// What is shown on the screen; rgba8unorm, encoded for sRGB. Another texture after [`Engine::resize`].
    pub fn picture(&self) -> &wgpu::TextureView {
        &self.pictures.picture
    }

    /// The mean of all frames since something last moved; rgba32float, scene-linear.
    pub fn converged(&self) -> &wgpu::TextureView {
        self.pictures.mean()
    }

    /// What the tracer wrote.
    pub fn planes(&self) -> &Planes {
        &self.planes
    }

    /// Device memory in bytes: of the scene, of the denoiser, of planes, pictures and the baselines that are shown.
    pub fn memory(&self) -> [(&'static str, u64); 3] {
        let scene = self.stage.iter().flat_map(Stage::memory).map(|(_, bytes)| bytes).sum();
        let memory = self.denoiser.memory();
        let pictures = self.size().pixels() as u64 * PICTURE_BYTES + self.baselines.memory();
        [("scene", scene), ("denoiser", memory.persistent + memory.transient), ("pictures", pictures)]
    }

    /// How tracing goes at this extent.
    pub fn options(&self, tracing: Tracing) -> RenderOptions {
        options(tracing, self.size())
    }

    /// Appends a frame to the caller's encoder. Frames run in the order in which they were encoded; the caller submits.
    ///
    /// # Errors
    /// No scene; a camera or a time that cannot be used; a setting out of its range. Nothing is shown anew then.
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        sight: &Sight,
        choice: &Choice,
    ) -> Result<Made, LiveError> {
        let tracing = choice.tracing.held();
        let size = self.size();
        let options = options(tracing, size);
        let settings = choice.effective();
        if settings != self.settings {
            self.denoiser.set_settings(&settings)?;
            self.settings = settings;
        }
        let stage = self.stage.as_mut().ok_or(LiveError::NoScene)?;
        let number = self.number;
        let before = self.last.map_or(sight.time, |last| last.sight.time);
        let scene_changed = stage.go_to(before, sight.time)?;
        let mut camera = sight.camera;
        camera.jitter = if tracing.jitter { jitter_of(number) } else { [0.0; 2] };
        let previous_camera = self.last.map_or(camera, |last| last.view.camera);
        let view = View { camera, previous_camera, number };
        let unusable = LiveError::Camera("its matrix cannot be inverted");
        let views = view.camera.projection(size).zip(view.previous_camera.projection(size)).ok_or(unusable)?;
        // What a pass borrows outlives it here. Bands have passes of the same names: their times are added up.
        let stamps: Vec<std::cell::OnceCell<_>> = (0..MOST_STAMPS).map(|_| std::cell::OnceCell::new()).collect();
        let clock = &mut self.clock;
        let mut free = stamps.iter();
        let times = |name| {
            let clock = clock.as_mut()?;
            writes(free.next()?.get_or_init(|| clock.next(name)))
        };
        stage.tracer().encode(encoder, &options, &view, &self.planes, times)?;
        let output = self.denoiser.encode(&self.device, encoder, &frame(&self.planes, &view, size))?;
        let denoised = output.composite.as_ref().unwrap_or(&self.planes.direct);
        if choice.panes.contains(&Pane::Debug) {
            let mut wanted = DEBUG_VIEWS.get(choice.debug).map_or(DebugView::Depth, |(_, view)| *view);
            if let DebugView::WeightsAround(place) = &mut wanted {
                *place = sight.pointer;
            }
            if self.debug.is_none() {
                let format = wgpu::TextureFormat::Rgba8Unorm;
                self.debug = Some(DebugViews::new(&self.device, self.denoiser.storage(), format)?);
            }
            let target = DebugTarget { view: &self.pictures.debug, scale: choice.debug_scale };
            // A view of a stage that is switched off shows the last one.
            if let Some(views) = &self.debug {
                let drawn = self.denoiser.encode_debug(&self.device, encoder, views, wanted, target);
                drop(drawn);
            }
        }
        let wanted = Wanted {
            atrous: choice.panes.contains(&Pane::Atrous),
            svgf: choice.panes.contains(&Pane::Svgf),
            constants: choice.baselines,
        };
        let direct = output.direct.as_ref().unwrap_or(&self.planes.direct);
        let clock = &mut self.clock;
        let baselines = self.baselines.encode(encoder, &self.planes, [&views.0, &views.1], number, wanted, |name| {
            clock.as_mut().and_then(|clock| clock.next(name))
        });
        let exposure = stage.scene().exposure * choice.stops.clamp(-20.0, 20.0).exp2();
        let stands =
            |last: Last| last.sight.camera == sight.camera && last.sight.time == sight.time && last.tracing == tracing;
        let begins_anew = scene_changed || !self.last.is_some_and(stands);
        let stamp = self.clock.as_mut().and_then(|clock| clock.next("display"));
        self.display.encode(
            &self.device,
            encoder,
            &self.planes,
            [denoised, direct],
            &baselines,
            &mut self.pictures,
            choice,
            exposure,
            begins_anew,
            &stamp,
        );
        if let Some(clock) = &mut self.clock {
            clock.resolve(&self.device, encoder);
        }
        self.denoiser.resolve_timings(&self.device, encoder);
        self.last = Some(Last { view, sight: *sight, tracing });
        self.number += 1;
        Ok(Made { number, converged: self.pictures.frames, had_history: output.had_history })
    }

    /// Times of the newest frame whose timestamps have come home: tracer and display, then the denoiser's dispatches; empty
    /// where the device has none. It neither polls nor waits.
    pub fn times(&mut self) -> Times {
        let period = f64::from(self.queue.get_timestamp_period());
        while let Some(times) = self.clock.as_mut().and_then(|clock| clock.take(period)) {
            self.times = times;
        }
        while let Some(timings) = self.denoiser.take_timings(&self.queue) {
            let mut times = Times::default();
            for timing in timings {
                times.add(timing.pass, timing.stages, timing.milliseconds);
            }
            self.denoiser_times = times;
        }
        let mut all = self.times.clone();
        all.0.extend(self.denoiser_times.0.iter().copied());
        all
    }

    /// The last frame as `quell render` would write it: traced once more, with the same samples, and read back. It submits, and
    /// waits for nothing.
    ///
    /// # Errors
    /// Nothing was shown yet; what keeps it from being traced.
    pub fn planes_of_last(&self) -> Result<PlanesShot, LiveError> {
        let (Some(stage), Some(last)) = (&self.stage, self.last) else { return Err(LiveError::NoScene) };
        let options = options(last.tracing, self.size());
        PlanesShot::new(&self.device, &self.queue, |submit| stage.read_back(&options, &last.view, submit))
    }
}

/// Passes of the tracer that are timed, at most.
const MOST_STAMPS: usize = 60;

/// Bytes a pixel of what the engine makes itself: the tracer's planes, two means, two pictures.
const PICTURE_BYTES: u64 = 76 + 2 * 16 + 2 * 4;

fn options(tracing: Tracing, size: Size) -> RenderOptions {
    RenderOptions {
        samples: tracing.paths,
        bounces: tracing.bounces,
        direct_samples: tracing.direct_samples,
        jitter: tracing.jitter,
        ..RenderOptions::new(size)
    }
}

/// What the denoiser reads of a frame.
fn frame<'a>(planes: &'a Planes, view: &View, size: Size) -> gpu::Frame<'a> {
    let guides = GuideTextures {
        view_depth: Some(&planes.depth_hit),
        normal: Some(&planes.normal_roughness),
        motion: Some(&planes.motion),
        roughness: Some(Scalar { view: &planes.normal_roughness, channel: Channel::A }),
        glossy_hit_distance: Some(Scalar { view: &planes.depth_hit, channel: Channel::G }),
        surface_id: Some(&planes.surface_id),
        ..GuideTextures::default()
    };
    let mut frame = gpu::Frame::new(size, view.camera, view.previous_camera, view.number, guides);
    frame.direct = Some(&planes.direct);
    frame.matte = Some(Signal { light: &planes.matte, weight: Some(&planes.matte_weight), direct: None });
    frame.glossy = Some(Signal { light: &planes.glossy, weight: Some(&planes.glossy_weight), direct: None });
    frame
}
