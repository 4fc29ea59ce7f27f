//! Where frames and references come from: a scene, or a folder.

use crate::args::CompareArgs;
use crate::commands::render;
use crate::context::Context;
use crate::environment;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Work;
use crate::scene;
use crate::sequence::FIRST_FRAME;
use quell::Size;
use quell_lab::cache::Cache;
use quell_lab::compare::sequence::default_choice;
use quell_lab::compare::{FolderSource, SceneSource, Sequence};
use quell_lab::references::ReferenceTarget;
use quell_trace::{RenderOptions, Scene, TraceError, builtin_scenes};
use std::path::{Path, PathBuf};

/// Small enough that a first comparison takes minutes.
const USUAL_SIZE: Size = Size::new(320, 180);
/// Samples of a reference between two looks at the clock and two writes.
const BATCH: u32 = 8;

pub enum Source {
    Scene(Box<FromScene>),
    Folder(FolderSource),
}

pub struct FromScene {
    scene: Scene,
    camera: usize,
    frames: Vec<i64>,
    options: RenderOptions,
    references: Vec<i64>,
    target: ReferenceTarget,
    cache: Option<Cache>,
}

impl Source {
    pub fn new(context: &Context, args: &CompareArgs) -> Result<Self, Failure> {
        let folder = PathBuf::from(&args.source);
        if folder.is_dir() && !builtin_scenes().iter().any(|s| s.name == args.source) {
            return Self::folder(args, folder);
        }
        let opened = scene::open(context, &args.source, &args.scene).map_err(|e| match e {
            Failure::Usage(error) if !scene::is_file(&args.source) => {
                Failure::Usage(format!("{error}; nor is there a folder of this name"))
            }
            other => other,
        })?;
        let mut scene = opened.scene;
        environment::surround(context, &mut scene, &args.environment)?;
        Self::scene(context, args, scene)
    }

    fn folder(args: &CompareArgs, folder: PathBuf) -> Result<Self, Failure> {
        for (given, option) in [
            (args.size.is_some(), "--size"),
            (args.exposure.is_some(), "--exposure"),
            (args.seeds > 1, "--seeds"),
            (args.count.is_some(), "--count"),
            (args.scene.name.is_some(), "--scene"),
            (args.scene.clip.is_some(), "--clip"),
            (args.environment.environment.is_some(), "--environment"),
        ] {
            if given {
                return Err(Failure::Usage(format!("{option} is for scenes; {} is a folder", folder.display())));
            }
        }
        Ok(Self::Folder(FolderSource {
            folder,
            references: args.reference.clone(),
            frames: args.frames.as_ref().map(|f| f.numbers().to_vec()),
            reference_frames: args.reference_frames.as_ref().map(|f| f.numbers().to_vec()),
        }))
    }

    fn scene(context: &Context, args: &CompareArgs, mut scene: Scene) -> Result<Self, Failure> {
        if args.reference.is_some() {
            return Err(Failure::Usage(
                "--reference is for folders; the references of a scene are rendered (--reference-spp)".to_owned(),
            ));
        }
        let camera = scene::camera(&mut scene, &args.sampling.camera)?;
        let count = args.count.map_or(scene.frames, |count| count as usize);
        let frames: Vec<i64> = match &args.frames {
            Some(frames) => frames.numbers().to_vec(),
            None => (FIRST_FRAME..).take(count).collect(),
        };
        scene::expose(context, &args.source, &mut scene, camera, args.exposure, render::middle(&frames))?;
        let references = match &args.reference_frames {
            Some(chosen) => {
                if let Some(missing) = chosen.numbers().iter().find(|n| !frames.contains(n)) {
                    let message = format!("--reference-frames names frame {missing}, which is not compared");
                    return Err(Failure::Usage(message));
                }
                chosen.numbers().to_vec()
            }
            None => default_choice(&frames),
        };
        let options = render::options(args.size.unwrap_or(USUAL_SIZE), &args.sampling)?;
        let target =
            ReferenceTarget { samples: args.reference_spp.div_ceil(2), batch: BATCH, ..ReferenceTarget::default() };
        let cache = Cache::default_place();
        Ok(Self::Scene(Box::new(FromScene { scene, camera, frames, options, references, target, cache })))
    }

    /// Whether frames will come in two halves; of a folder it is not known yet.
    pub fn has_halves(&self) -> bool {
        match self {
            Self::Scene(from) => from.options.samples > 1,
            Self::Folder(_) => true,
        }
    }

    /// The extent, where it is known already.
    pub fn size(&self) -> Option<Size> {
        match self {
            Self::Scene(from) => Some(from.options.size),
            Self::Folder(_) => None,
        }
    }

    /// Renders or reads the sequence of seed number `turn`.
    pub fn load(&self, context: &Context, turn: u64, folder: &Path) -> Result<Sequence, Failure> {
        let from = match self {
            Self::Folder(folder) => return Ok(folder.load()?),
            Self::Scene(from) => from,
        };
        if let Some(cache) = &from.cache {
            context.detail(&format!("references are kept in {}", cache.folder().display()));
        }
        let on = context.tracer()?;
        let source = SceneSource {
            scene: &from.scene,
            camera: from.camera,
            frames: from.frames.clone(),
            options: RenderOptions { seed: from.options.seed.wrapping_add(turn), ..from.options },
            target: from.target,
            references: from.references.clone(),
            on: &on,
            cache: from.cache.as_ref(),
            folder: Some(folder),
        };
        let work = Work::new(context.quiet);
        let loaded = source.load(Some(interrupt::flag()), &|p| work.to(p.share, &p.note));
        loaded.map_err(|e| match e {
            quell_lab::Error::Trace(TraceError::Cancelled) => Failure::Interrupted(
                "frames and reference samples so far are kept; the same command goes on from here".to_owned(),
            ),
            quell_lab::Error::Trace(error) => error.into(),
            error => error.into(),
        })
    }
}
