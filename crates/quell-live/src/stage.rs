//! A scene, checked, made ready and uploaded. It can be made on any thread while another one is shown.

use crate::error::LiveError;
use crate::shot::Submit;
use quell::Size;
use quell_trace::gltf::{self, Loaded};
use quell_trace::gpu::{Kernels, LiveTracer, Unread, View, wgpu};
use quell_trace::{Control, Half, PointlikeLight, ReferenceKind, RenderOptions, Scene, Tracer, Track, builtin};
use std::path::Path;
use std::sync::Arc;

/// Something that shines and can be switched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lamp {
    /// As a user reads it.
    pub name: String,
    /// Whether it shines.
    pub on: bool,
    what: Shines,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shines {
    /// An instance whose surface emits.
    Instance(usize),
    /// A light without extent.
    Light(usize),
    Environment,
}

/// A scene on a device.
pub struct Stage {
    scene: Arc<Scene>,
    tracer: LiveTracer,
    moves: bool,
    /// Which times are uploaded: of the frame before, and now.
    uploaded: [f64; 2],
    lamps: Vec<Lamp>,
    /// What shines as the scene has it.
    emission: Vec<Track<f32>>,
    lights: Vec<Track<PointlikeLight>>,
    environment: Track<f32>,
    is_changed: bool,
}

/// Whether this names a glTF file rather than a built-in scene.
pub fn is_file(source: &str) -> bool {
    let extension = Path::new(source).extension().and_then(|e| e.to_str()).unwrap_or_default();
    extension.eq_ignore_ascii_case("glb") || extension.eq_ignore_ascii_case("gltf")
}

/// The built-in scene of this name, or the scene in the file of this path; and what a user should know of it.
///
/// # Errors
/// An unknown name; a file that cannot be read.
pub fn open(source: &str) -> Result<(Scene, Vec<String>), LiveError> {
    if !is_file(source) {
        return Ok((builtin(source)?, Vec::new()));
    }
    Ok(loaded(gltf::load(Path::new(source), &gltf::Options::default())?))
}

/// The same of a file that lies in memory, as browsers and windows hand over what is dropped on them.
///
/// # Errors
/// A file that cannot be read, or that needs others beside it.
pub fn open_bytes(name: &str, bytes: Vec<u8>) -> Result<(Scene, Vec<String>), LiveError> {
    Ok(loaded(parsed(name, bytes)?))
}

/// The first half of [`open_bytes`].
pub(crate) fn parsed(name: &str, bytes: Vec<u8>) -> Result<Loaded, LiveError> {
    Ok(gltf::load_bytes(bytes, Path::new("."), name, &gltf::Options::default())?)
}

/// The second half: chooses an exposure.
pub(crate) fn loaded(loaded: Loaded) -> (Scene, Vec<String>) {
    let Loaded { mut scene, report } = loaded;
    let mut notes = report.notes.clone();
    notes.extend(report.warnings.iter().take(8).map(|warning| format!("warning: {warning}")));
    if let Some(exposure) = exposure(&scene) {
        scene.exposure = exposure;
    }
    (scene, notes)
}

/// Extent and samples of the picture that an exposure is taken from.
const EXPOSURE_SIZE: Size = Size::new(48, 27);
const EXPOSURE_SAMPLES: u32 = 8;

/// The exposure that brings the log-mean luminance of the lit pixels of a small picture to mid grey, as
/// `quell_lab::tone::Tone::automatic` does.
fn exposure(scene: &Scene) -> Option<f32> {
    let tracer = Tracer::new(scene, 0, 1).ok()?;
    let options = RenderOptions { direct_samples: 4, ..RenderOptions::new(EXPOSURE_SIZE) };
    let samples = 0..EXPOSURE_SAMPLES;
    let picture =
        tracer.reference(&options, ReferenceKind::Factored, Half::A, samples, &Control::default()).ok()?.beauty;
    let luminances = picture.data().iter().map(|&c| f64::from(quell::luminance(c))).filter(|l| l.is_finite());
    let luminances: Vec<f64> = luminances.collect();
    let mean = luminances.iter().sum::<f64>() / luminances.len().max(1) as f64;
    let lit: Vec<f64> = luminances.into_iter().filter(|&l| l > 1e-3 * mean && l > 0.0).collect();
    let log_mean = lit.iter().map(|l| l.ln()).sum::<f64>() / lit.len() as f64;
    let exposure = (0.18 / log_mean.exp()) as f32;
    (exposure.is_finite() && exposure > 0.0).then_some(exposure)
}

impl Stage {
    /// Makes a scene ready at time 0 and uploads it. `options`: for what the kernels are compiled.
    ///
    /// # Errors
    /// A scene that cannot be traced; one beyond the device's limits, said with the figure before anything is uploaded.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        kernels: &Arc<Kernels>,
        scene: Scene,
        options: &RenderOptions,
    ) -> Result<Self, LiveError> {
        let mut tracer = {
            let ready = Tracer::between(&scene, 0.0, 0.0, 1)?;
            LiveTracer::new(device, queue, Arc::clone(kernels), &ready)?
        };
        tracer.prepare(options)?;
        Ok(Self {
            moves: scene.moves(),
            uploaded: [0.0; 2],
            lamps: lamps(&scene),
            emission: scene.instances.iter().map(|i| i.emission_scale.clone()).collect(),
            lights: scene.lights.clone(),
            environment: scene.environment_scale.clone(),
            scene: Arc::new(scene),
            tracer,
            is_changed: false,
        })
    }

    /// What is shown, with its lamps as they are switched.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Whether time changes more than cameras.
    pub fn moves(&self) -> bool {
        self.moves
    }

    /// What shines.
    pub fn lamps(&self) -> &[Lamp] {
        &self.lamps
    }

    /// Bytes of the scene in the device's memory, by part.
    pub fn memory(&self) -> Vec<(&'static str, u64)> {
        self.tracer.memory()
    }

    /// What the pictures do not model.
    pub fn notes(&self) -> &[String] {
        self.tracer.notes()
    }

    pub(crate) fn read_back(
        &self,
        options: &RenderOptions,
        view: &View,
        submit: &mut Submit<'_>,
    ) -> Result<Unread, LiveError> {
        self.tracer.read_back(options, view, submit)
    }

    pub(crate) fn tracer(&mut self) -> &mut LiveTracer {
        &mut self.tracer
    }

    /// Switches a lamp; one that does not exist changes nothing.
    pub fn switch(&mut self, lamp: usize, on: bool) {
        let Some(lamp) = self.lamps.get_mut(lamp).filter(|lamp| lamp.on != on) else { return };
        lamp.on = on;
        let scene = Arc::make_mut(&mut self.scene);
        match lamp.what {
            Shines::Instance(i) => {
                scene.instances[i].emission_scale = if on { self.emission[i].clone() } else { 0.0.into() };
            }
            Shines::Light(i) => {
                scene.lights[i] = match (&self.lights[i], on) {
                    (track, true) => track.clone(),
                    (Track::Constant(light), false) => dark(*light).into(),
                    (track, false) => {
                        let track = track.clone();
                        Track::function(move |frame| dark(track.at(frame)))
                    }
                }
            }
            Shines::Environment => {
                scene.environment_scale = if on { self.environment.clone() } else { 0.0.into() };
            }
        }
        self.is_changed = true;
    }

    /// Brings the scene to time `now`, in frames, from `before`, where it stood in the last frame. True where light or
    /// geometry differ from what was uploaded.
    ///
    /// # Errors
    /// A scene that cannot be traced at that time; it stays where it was.
    pub(crate) fn go_to(&mut self, before: f64, now: f64) -> Result<bool, LiveError> {
        let times = [before, now];
        if !self.is_changed && (!self.moves || self.uploaded == times) {
            return Ok(false);
        }
        let differs = self.is_changed || before != now || self.uploaded[1] != now;
        let ready = Tracer::between(&self.scene, before, now, 1)?;
        self.tracer.update(&ready)?;
        self.uploaded = times;
        self.is_changed = false;
        Ok(differs)
    }
}

/// A light of the same kind that does not shine.
fn dark(light: PointlikeLight) -> PointlikeLight {
    let mut light = light;
    match &mut light {
        PointlikeLight::Point { intensity, .. } | PointlikeLight::Spot { intensity, .. } => *intensity *= 0.0,
        PointlikeLight::Directional { irradiance, .. } => *irradiance *= 0.0,
    }
    light
}

/// Lamps that are offered, at most: a street of a thousand windows has no use for as many switches.
const MOST_LAMPS: usize = 32;

fn lamps(scene: &Scene) -> Vec<Lamp> {
    let emits = |surface: usize| {
        scene.surfaces.get(surface).is_some_and(|s| s.unlit || s.material.emission.max_element() > 0.0)
    };
    let instances = (0..scene.instances.len()).filter(|&i| emits(scene.instances[i].surface));
    let surfaces = instances.map(|i| (format!("surface {}", i + 1), Shines::Instance(i)));
    let lights = (0..scene.lights.len()).map(|i| (format!("light {}", i + 1), Shines::Light(i)));
    let shines = scene.environment.mean_radiance().max_element() > 0.0;
    let environment = shines.then(|| ("environment".to_owned(), Shines::Environment));
    let all = environment.into_iter().chain(lights).chain(surfaces);
    all.take(MOST_LAMPS).map(|(name, what)| Lamp { name, on: true, what }).collect()
}
