//! Scenes by name or from files, and their cameras.

use crate::args::scene::SceneArgs;
use crate::context::Context;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Work;
use crate::sequence::FIRST_FRAME;
use quell::Size;
use quell_lab::tone::Tone;
use quell_trace::gltf::{self, LoadReport, Stage};
use quell_trace::{
    Control, Half, PrimaryReplacement, ReferenceKind, RenderOptions, Scene, Tracer, builtin, camera_paths,
};
use std::path::Path;

/// A scene and, if it came from a file, what the file held.
pub struct Opened {
    pub scene: Scene,
    pub report: Option<LoadReport>,
}

/// Whether this names a glTF file rather than a built-in scene.
pub fn is_file(source: &str) -> bool {
    let extension = Path::new(source).extension().and_then(|e| e.to_str()).unwrap_or_default();
    extension.eq_ignore_ascii_case("glb") || extension.eq_ignore_ascii_case("gltf")
}

/// The built-in scene of this name, or the scene in the file of this path. Says what was left out.
pub fn open(context: &Context, source: &str, args: &SceneArgs) -> Result<Opened, Failure> {
    if !is_file(source) {
        if let Some(option) = args.first_given() {
            return Err(Failure::Usage(format!("{option} is for glTF files; `{source}` is none")));
        }
        return Ok(Opened { scene: builtin(source)?, report: None });
    }
    let defaults = gltf::Options::default();
    let options = gltf::Options {
        scene: args.name.clone(),
        clip: args.clip.clone(),
        frames_per_second: args.fps.map_or(defaults.frames_per_second, f64::from),
        ..defaults
    };
    let work = Work::unless_quick(context.quiet);
    let gltf::Loaded { scene, report } = gltf::load_watched(Path::new(source), &options, &|stage, done, total| {
        let (from, to, what) = match stage {
            Stage::Images => (0.0, LOADED * 0.5, "image"),
            Stage::Meshes => (LOADED * 0.5, LOADED, "mesh"),
        };
        let share = if total > 0 { done as f32 / total as f32 } else { 1.0 };
        work.to(from + (to - from) * share, &format!("{source}: {what} {done} of {total}"));
    })?;
    work.to(LOADED, &format!("{source}: levels of detail and hierarchy of {} triangles", report.triangles));
    // What does not move is kept for all frames. Errors come again where the first frame is traced.
    if let Err(error) = Tracer::new(&scene, FIRST_FRAME, 1) {
        context.detail(&error.to_string());
    }
    drop(work);
    for note in &report.notes {
        context.note(&format!("{source}: {note}"));
    }
    let shown = if context.verbose { report.warnings.len() } else { WARNINGS_SHOWN };
    for warning in report.warnings.iter().take(shown) {
        context.note(&format!("warning: {source}: {warning}"));
    }
    let rest = report.warnings.len().saturating_sub(shown) + report.further_warnings;
    if rest > 0 {
        context.note(&format!("warning: {source}: {rest} further warnings; `quell explain {source}` lists them"));
    }
    Ok(Opened { scene, report: Some(report) })
}

/// Share of the time from file to first ray that reading takes, about; the rest makes levels of detail and the hierarchy.
const LOADED: f32 = 0.6;

/// Warnings that are printed without `-v`.
const WARNINGS_SHOWN: usize = 8;

/// Gives a scene from a file the exposure that the user asked for, else one that suits what the camera sees: it brings
/// the log-mean luminance of a small picture of the middle frame to mid grey, the same for the whole sequence. Frames hold light
/// as it is; only pictures and previews are multiplied. Says what was taken.
pub fn expose(
    context: &Context,
    source: &str,
    scene: &mut Scene,
    camera: usize,
    asked: Option<f32>,
    middle: i64,
) -> Result<(), Failure> {
    if let Some(exposure) = asked {
        scene.exposure = exposure;
        return Ok(());
    }
    if !is_file(source) {
        return Ok(());
    }
    // Whether mirrors are looked into or not, exposure is the same.
    let primary_replacement = PrimaryReplacement::Glass;
    let options = RenderOptions { seed: EXPOSURE_SEED, primary_replacement, ..RenderOptions::new(EXPOSURE_SIZE) };
    let tracer = Tracer::new(scene, middle, camera)?;
    let control = Control { cancel: Some(interrupt::flag()), progress: None };
    let picture = tracer.reference(&options, ReferenceKind::Factored, Half::A, 0..EXPOSURE_SAMPLES, &control)?;
    drop(tracer);
    let Tone { exposure } = Tone::automatic([&picture.beauty]);
    // Two digits: a picture so small knows no more, and the number is to be typed.
    let digits = 10_f32.powi(1 - exposure.log10().floor() as i32);
    let rounded = (exposure * digits).round() / digits;
    if rounded.is_finite() && rounded > 0.0 {
        scene.exposure = rounded;
    }
    context.note(&format!("{source}: exposure {} from its brightness; --exposure sets another", scene.exposure));
    Ok(())
}

/// Extent and samples of the picture that an exposure is taken from: a tenth of a second for most scenes.
const EXPOSURE_SIZE: Size = Size::new(48, 27);
const EXPOSURE_SAMPLES: u32 = 8;
/// Not the frames' own noise.
const EXPOSURE_SEED: u64 = 0x6578_706f_7365;

impl SceneArgs {
    fn first_given(&self) -> Option<&'static str> {
        [(self.name.is_some(), "--scene"), (self.clip.is_some(), "--clip"), (self.fps.is_some(), "--fps")]
            .into_iter()
            .find_map(|(given, option)| given.then_some(option))
    }
}

/// The number of a camera, from 1: by number, by name, or a path that is added to the scene.
pub fn camera(scene: &mut Scene, text: &str) -> Result<usize, Failure> {
    let count = scene.cameras.len();
    let by_number = text.parse().ok().filter(|n| (1..=count).contains(n));
    let by_name = || scene.cameras.iter().position(|c| !c.name.is_empty() && c.name == text).map(|n| n + 1);
    if let Some(number) = by_number.or_else(by_name) {
        return Ok(number);
    }
    if let Some(path) = camera_paths::Motion::named(text) {
        return camera_paths::add(scene, path, 1).map_err(Failure::from);
    }
    let names: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).filter(|n| !n.is_empty()).collect();
    let named = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
    Err(Failure::Usage(format!(
        "camera `{text}` does not exist: scene `{}` has cameras 1 to {count}{named}; orbit, dolly and still move or hold \
         the first",
        scene.name
    )))
}
