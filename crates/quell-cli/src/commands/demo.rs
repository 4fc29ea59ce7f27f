//! `quell demo`: a built-in scene rendered, denoised and shown.

use crate::args::DemoArgs;
use crate::context::Context;
use crate::failure::Failure;
use crate::output;
use crate::progress::Progress;
use crate::sequence::files::{Files, REFERENCE};
use crate::sequence::references::ReferenceSource;
use crate::sequence::{FIRST_FRAME, Job};
use quell::{Frame, Size};
use quell_frames::{Content, FrameToWrite, Metadata, Precision, WriteOptions, frame_path, write_frame};
use quell_lab::cache::Cache;
use quell_lab::references::ReferenceTarget;
use quell_trace::{RenderOptions, Scene, Tracer, builtin, scene_hash};
use std::path::Path;

/// What is shown.
const SCENE: &str = "glossy-room";
const CAMERA: usize = 1;
/// Extent of the references.
const SIZE: Size = Size { width: 480, height: 270 };
/// Steady frames of the demo whose references come with quell.
const REFERENCE_FRAMES: [i64; 3] = [17, 20, 23];

/// Made by `quell demo --make-references crates/quell-cli/references`.
mod embedded {
    /// Hash of scene, tracer and options that the frames belong to.
    pub const HASH: &str = include_str!("../../references/glossy-room.hash");
    /// Number and file of each.
    pub const FRAMES: [(i64, &[u8]); 3] = [
        (17, include_bytes!("../../references/glossy-room.0017.exr")),
        (20, include_bytes!("../../references/glossy-room.0020.exr")),
        (23, include_bytes!("../../references/glossy-room.0023.exr")),
    ];
}

pub fn run(context: &Context, args: DemoArgs) -> Result<(), Failure> {
    let scene = builtin(SCENE)?;
    let options = options(args.size);
    if let Some(folder) = &args.make_references {
        return make_references(context, &scene, &options, folder, args.reference_spp);
    }
    let files = Files { folder: args.output, exr: args.exr, png: true, colours: Precision::Float, overwrite: false };
    files.check()?;
    let frames: Vec<i64> = (FIRST_FRAME..).take(args.count as usize).collect();
    let references = if scene_hash(&scene, &options) == embedded::HASH.trim() {
        let mut given = std::collections::BTreeMap::new();
        for (number, bytes) in embedded::FRAMES.iter().filter(|(n, _)| frames.contains(n)) {
            let path = files.path(REFERENCE, *number);
            quell_frames::files::write_bytes(&path, bytes)?;
            given.insert(*number, path);
        }
        ReferenceSource::Given(given)
    } else {
        let why = if args.size == SIZE {
            "those that come with quell are stale"
        } else {
            "none comes with quell for this size"
        };
        context.note(&format!("note: no references ({why}), so no scores"));
        ReferenceSource::None
    };
    Job { scene, camera: CAMERA, frames, options, denoise: true, references, files }.run(context)
}

/// How the demo samples light: one matte and one glossy path a pixel, from another place of it in every frame.
fn options(size: Size) -> RenderOptions {
    RenderOptions { jitter: true, ..RenderOptions::new(size) }
}

/// Makes the frames that are embedded, from both halves; resumable through the cache.
fn make_references(
    context: &Context,
    scene: &Scene,
    options: &RenderOptions,
    folder: &Path,
    spp: u32,
) -> Result<(), Failure> {
    output::check_folder(folder)?;
    let target = ReferenceTarget { samples: spp.div_ceil(2), ..ReferenceTarget::default() };
    let source = ReferenceSource::Trace { target, frames: None, cache: Cache::default_place() };
    let hash = scene_hash(scene, options);
    let progress = Progress::new("reference", REFERENCE_FRAMES.len(), context.quiet);
    for (index, frame) in REFERENCE_FRAMES.into_iter().enumerate() {
        let tracer = Tracer::new(scene, frame, CAMERA)?;
        let notify = |share: f32| progress.within(index, share, "tracing");
        let Some(reference) = source.of(&context.tracer()?, scene, options, CAMERA, frame, &notify)? else { continue };
        let error = reference.own_error().unwrap_or_default();
        let beauty = reference.into_beauty();
        let (camera, previous_camera) = tracer.cameras(options.size, options.jitter)?;
        let metadata = Metadata {
            content: Content::Reference,
            scene: format!("{} camera {CAMERA}", scene.name),
            scene_hash: hash.clone(),
            exposure: scene.exposure,
            sampling: format!("2 x {} samples a pixel, both halves averaged; {}", spp.div_ceil(2), context.command),
            ..Metadata::default()
        };
        let picture = Frame { index: frame, previous_camera, ..Frame::new(options.size, camera) };
        let to_write = FrameToWrite { composite: Some(beauty.view()), metadata, ..FrameToWrite::new(picture) };
        let path = frame_path(folder, &scene.name, frame);
        let written =
            write_frame(&path, &to_write, &WriteOptions { colours: Precision::Half, ..WriteOptions::default() })?;
        progress.done(index);
        progress.say(&format!("{}: {} bytes, own trimmed relMSE {error:.2e}", path.display(), written.bytes));
    }
    let path = folder.join(format!("{}.hash", scene.name));
    quell_frames::files::write_bytes(&path, format!("{hash}\n").as_bytes())?;
    drop(progress);
    output::print(&hash)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whoever changes the scene or the tracer makes the references anew: CONTRIBUTING.md.
    #[test]
    fn the_embedded_references_belong_to_this_scene_and_tracer() {
        let hash = scene_hash(&builtin(SCENE).unwrap(), &options(SIZE));
        assert_eq!(embedded::HASH.trim(), hash, "stale references: see CONTRIBUTING.md, `References of the demo`");
        assert_eq!(embedded::FRAMES.map(|(number, _)| number), REFERENCE_FRAMES);
        for (number, bytes) in embedded::FRAMES {
            assert!(bytes.len() < 1 << 20, "{} bytes", bytes.len());
            let path = std::env::temp_dir().join(format!("quell-embedded-{}.{number}.exr", std::process::id()));
            std::fs::write(&path, bytes).unwrap();
            let file = quell_frames::read_frame(&path).unwrap();
            std::fs::remove_file(&path).unwrap();
            assert_eq!((file.frame.index, file.frame.size), (number, SIZE));
            assert_eq!(file.metadata.scene_hash, hash);
        }
    }
}
