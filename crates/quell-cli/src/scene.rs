//! Scenes by name or from files, and their cameras.

use crate::args::scene::SceneArgs;
use crate::context::Context;
use crate::failure::Failure;
use quell_trace::gltf::{self, LoadReport};
use quell_trace::{Scene, builtin, camera_paths};
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
    let gltf::Loaded { scene, report } = gltf::load(Path::new(source), &options)?;
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

/// Warnings that are printed without `-v`.
const WARNINGS_SHOWN: usize = 8;

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
