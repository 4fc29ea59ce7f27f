//! glTF 2.0 files made into scenes: `.glb`, and `.gltf` with data embedded or beside it.
//!
//! [`load`] reads a file into a [`Scene`] and says in a [`LoadReport`] what it found, what it left out and why. Nothing in
//! a file is trusted: every number that leads somewhere is checked before it is followed, and sizes before memory is
//! taken. What can be left out is, with a warning; the rest is a [`GltfError`] that names the place.
//!
//! Conventions: time is counted in frames of `1 / frames_per_second` seconds from the start of the clips; lengths are the
//! file's; radiance is `emissiveFactor * emissiveStrength`, and intensities of punctual lights are taken in the same unit.

mod accessor;
mod animation;
mod buffers;
mod build;
mod cameras;
mod container;
mod deform;
mod error;
mod lights;
mod materials;
mod mesh;
mod nodes;
mod report;
mod schema;
mod tangents;
mod textures;

pub use error::{GltfError, Problem};
pub use report::{CameraInfo, ClipInfo, LoadReport, Plays, WARNING_LIMIT, Warning};

use crate::scene::Scene;
use error::{Fault, Place};
use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// What is loaded of a file, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Name or number, from 1, of the scene; `None`: the file's own choice, else the first.
    pub scene: Option<String>,
    /// Name or number, from 1, of the clip to play, or `none`; `None`: all that do not share a channel with one before.
    pub clip: Option<String>,
    /// Frames a second of animation, above 0.
    pub frames_per_second: f64,
    /// How much a file may ask for.
    pub limits: Limits,
}

impl Default for Options {
    fn default() -> Self {
        Self { scene: None, clip: None, frames_per_second: 24.0, limits: Limits::default() }
    }
}

/// How much a file may ask for. A small file can name much: the same buffer a thousand times, a mesh at a million nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the file, and of each file beside it.
    pub file_bytes: u64,
    /// Bytes of JSON.
    pub json_bytes: u64,
    /// Bytes of what is read out of buffers and images, all together.
    pub decoded_bytes: u64,
    /// Triangles in the world, each instance counted.
    pub triangles: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { file_bytes: 4 << 30, json_bytes: 256 << 20, decoded_bytes: 6 << 30, triangles: 20_000_000 }
    }
}

/// Bytes that may still be taken.
pub(crate) struct Budget {
    left: AtomicU64,
    limit: u64,
}

impl Budget {
    fn new(limit: u64) -> Self {
        Self { left: AtomicU64::new(limit), limit }
    }

    /// Takes bytes, before they are allocated.
    fn charge(&self, bytes: u64, place: &Place<'_>) -> Result<(), Fault> {
        let taken = self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(bytes));
        taken.map(drop).map_err(|left| {
            let value = (self.limit - left).saturating_add(bytes);
            let problem = Problem::Limit { what: "bytes of data", value, limit: self.limit };
            Fault::new(place, problem)
        })
    }
}

/// What of a file is being read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Images are decoded.
    Images,
    /// Meshes are read, and tangents made where normal maps need them.
    Meshes,
}

/// Called from any thread while a file is loaded: what is being read and how much of it is done, of how much.
pub type Watcher<'a> = &'a (dyn Fn(Stage, usize, usize) + Sync);

/// Counts what is done of one stage.
struct Counter<'a> {
    stage: Stage,
    done: AtomicUsize,
    total: usize,
    watcher: Watcher<'a>,
}

impl<'a> Counter<'a> {
    fn new(watcher: Watcher<'a>, stage: Stage, total: usize) -> Self {
        watcher(stage, 0, total);
        Self { stage, done: AtomicUsize::new(0), total, watcher }
    }

    fn one_more(&self) {
        (self.watcher)(self.stage, self.done.fetch_add(1, Ordering::Relaxed) + 1, self.total);
    }
}

/// A scene and what its file held.
#[derive(Debug)]
pub struct Loaded {
    /// What can be traced.
    pub scene: Scene,
    /// What the file held.
    pub report: LoadReport,
}

/// Loads a `.glb` or `.gltf` file.
///
/// The scene's frames are those of the clips that play, or 64 where nothing moves; its identity is a hash of the file's
/// bytes and of the options.
///
/// # Errors
/// Files that cannot be read, are no glTF 2.0, are cut off, contradict themselves or require what quell lacks; a scene or
/// clip that does not exist; more than the limits allow; nothing to see.
pub fn load(path: &Path, options: &Options) -> Result<Loaded, GltfError> {
    load_watched(path, options, &|_, _, _| {})
}

/// [`load`], with progress for the caller.
///
/// # Errors
/// As [`load`].
pub fn load_watched(path: &Path, options: &Options, watcher: Watcher<'_>) -> Result<Loaded, GltfError> {
    let fault = |fault: Fault| fault.in_file(path);
    let bytes = container::read_file(path, options.limits.file_bytes).map_err(|p| fault(Fault::whole(p)))?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_stem().map_or_else(|| "scene".to_owned(), |s| s.to_string_lossy().into_owned());
    build::scene(bytes, folder, &name, options, watcher).map_err(fault)
}

/// Loads a file that lies in memory. `folder` is where external files are looked for, `name` what the scene is called.
///
/// # Errors
/// As [`load`].
pub fn load_bytes(bytes: Vec<u8>, folder: &Path, name: &str, options: &Options) -> Result<Loaded, GltfError> {
    build::scene(bytes, folder, name, options, &|_, _, _| {}).map_err(|fault| fault.in_file(Path::new(name)))
}
