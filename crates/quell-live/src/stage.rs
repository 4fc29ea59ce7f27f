//! A scene, checked, made ready and uploaded. It can be made on any thread while another one is shown.

use crate::error::LiveError;
use crate::shot::Submit;
use quell::Size;
use quell_trace::environment::file::{self, EnvironmentFile};
use quell_trace::gltf::{self, Loaded};
use quell_trace::gpu::{Kernels, LiveTracer, Unread, View, wgpu};
use quell_trace::{
    Control, Half, PointlikeLight, PrimaryReplacement, ReferenceKind, RenderOptions, Scene, Tracer, Track, builtin,
};
use std::path::{Path, PathBuf};
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

/// Whether this names an environment map: `.hdr` or `.exr`.
pub fn is_environment(source: &str) -> bool {
    file::is_named(Path::new(source))
}

/// A latitude-longitude picture around a scene, in place of its own environment, as `quell render --environment` takes it.
#[derive(Clone, Debug)]
pub struct Surroundings {
    path: PathBuf,
    file: EnvironmentFile,
    turn: Turn,
}

/// How a picture stands around a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// About the vertical, clockwise seen from above.
    pub degrees: f32,
    /// Multiplies the picture.
    pub strength: f32,
}

impl Default for Turn {
    fn default() -> Self {
        Self { degrees: 0.0, strength: 1.0 }
    }
}

impl Surroundings {
    /// Reads a `.hdr` or `.exr` file.
    ///
    /// # Errors
    /// A file that is no environment map, in the words of `quell render`.
    pub fn open(path: &Path, turn: Turn) -> Result<Self, LiveError> {
        Ok(Self { path: path.to_owned(), file: file::read(path)?, turn })
    }

    /// The same of a file that lies in memory. `name`: the file's.
    ///
    /// # Errors
    /// As [`Surroundings::open`].
    pub fn from_bytes(name: &str, bytes: &[u8], turn: Turn) -> Result<Self, LiveError> {
        Ok(Self { path: PathBuf::from(name), file: file::read_bytes(Path::new(name), bytes)?, turn })
    }

    fn surround(self, scene: &mut Scene, notes: &mut Vec<String>) -> Result<(), LiveError> {
        let Self { path, file, turn: Turn { degrees, strength } } = self;
        notes.extend(file.note(&path));
        let made = file.surround(scene, degrees.to_radians(), strength);
        made.map_err(|error| LiveError::Surround(path, error))
    }
}

/// The built-in scene of this name, or the scene in the file of this path, in these surroundings or its own; and what a user
/// should know of it.
///
/// # Errors
/// An unknown name; a file that cannot be read; surroundings that are not finite.
pub fn open(source: &str, around: Option<Surroundings>) -> Result<(Scene, Vec<String>), LiveError> {
    if is_file(source) {
        return loaded(gltf::load(Path::new(source), &gltf::Options::default())?, around);
    }
    let (mut scene, mut notes) = (builtin(source)?, Vec::new());
    if let Some(around) = around {
        around.surround(&mut scene, &mut notes)?;
    }
    Ok((scene, notes))
}

/// The same of a file that lies in memory, as browsers and windows hand over what is dropped on them.
///
/// # Errors
/// A file that cannot be read, or that needs others beside it; as [`open`].
pub fn open_bytes(name: &str, bytes: Vec<u8>, around: Option<Surroundings>) -> Result<(Scene, Vec<String>), LiveError> {
    loaded(parsed(name, bytes)?, around)
}

/// The first half of [`open_bytes`].
pub(crate) fn parsed(name: &str, bytes: Vec<u8>) -> Result<Loaded, LiveError> {
    Ok(gltf::load_bytes(bytes, Path::new("."), name, &gltf::Options::default())?)
}

/// The second half: puts the surroundings there and chooses an exposure.
pub(crate) fn loaded(loaded: Loaded, around: Option<Surroundings>) -> Result<(Scene, Vec<String>), LiveError> {
    let Loaded { mut scene, report } = loaded;
    let mut notes = report.notes.clone();
    notes.extend(report.warnings.iter().take(8).map(|warning| format!("warning: {warning}")));
    if let Some(around) = around {
        around.surround(&mut scene, &mut notes)?;
    }
    if let Some(exposure) = exposure(&scene) {
        scene.exposure = exposure;
    }
    Ok((scene, notes))
}

/// Extent and samples of the picture that an exposure is taken from.
const EXPOSURE_SIZE: Size = Size::new(48, 27);
const EXPOSURE_SAMPLES: u32 = 8;

/// The exposure that brings the log-mean luminance of the lit pixels of a small picture to mid grey, as
/// `quell_lab::tone::Tone::automatic` does.
fn exposure(scene: &Scene) -> Option<f32> {
    let tracer = Tracer::new(scene, 0, 1).ok()?;
    let primary_replacement = PrimaryReplacement::Glass;
    let options = RenderOptions { direct_samples: 4, primary_replacement, ..RenderOptions::new(EXPOSURE_SIZE) };
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 8x4 texels of one colour, as a file.
    fn hdr(colour: [f32; 3]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let texels = [image::Rgb(colour); 32];
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&texels, 8, 4).unwrap();
        bytes
    }

    #[test]
    fn a_picture_surrounds_scenes_and_files() {
        let turn = Turn { degrees: 30.0, strength: 2.0 };
        let around = |turn| Surroundings::from_bytes("sky.hdr", &hdr([0.25, 0.5, 1.0]), turn).unwrap();
        let up = |scene: &Scene| scene.environment.radiance(glam::Vec3::Y).to_array();
        let (scene, notes) = open("cornell-box", Some(around(turn))).unwrap();
        assert_eq!((up(&scene), notes.len()), ([0.5, 1.0, 2.0], 0));
        // A built-in scene keeps its exposure; a file's follows from what lights it.
        assert_eq!(scene.exposure, builtin("cornell-box").unwrap().exposure);
        let room =
            std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf/rich.glb")).unwrap();
        let (own, _) = open_bytes("rich.glb", room.clone(), None).unwrap();
        let bright = Turn { degrees: 0.0, strength: 50.0 };
        let (lit, _) = open_bytes("rich.glb", room, Some(around(bright))).unwrap();
        assert_eq!(up(&lit), [12.5, 25.0, 50.0]);
        assert!(lit.exposure < own.exposure, "{} {}", lit.exposure, own.exposure);
    }

    /// What `quell render --environment` refuses is refused in its words.
    #[test]
    fn what_is_no_picture_is_refused() {
        let refused = |name: &str, bytes: &[u8]| Surroundings::from_bytes(name, bytes, Turn::default()).unwrap_err();
        let words = refused("sky.png", b"").to_string();
        assert!(words.starts_with("sky.png is no environment map"), "{words}");
        let words = refused("sky.exr", b"nothing").to_string();
        assert!(words.starts_with("sky.exr cannot be decoded"), "{words}");
        let words = Surroundings::open(Path::new("/nonexistent/sky.hdr"), Turn::default()).unwrap_err().to_string();
        assert!(words.starts_with("cannot read /nonexistent/sky.hdr"), "{words}");
        for strength in [-1.0, f32::NAN, 1e38] {
            let around = Surroundings::from_bytes("sky.hdr", &hdr([9.0; 3]), Turn { degrees: 0.0, strength });
            let error = open("cornell-box", Some(around.unwrap())).map(|_| ()).unwrap_err();
            assert!(error.to_string().starts_with("sky.hdr: "), "{error}");
        }
    }
}
