//! `quell render`: a scene path traced to factored EXR frames, and denoised.

use crate::args::{RenderArgs, SamplingArgs};
use crate::context::Context;
use crate::environment;
use crate::failure::Failure;
use crate::scene;
use crate::sequence::files::Files;
use crate::sequence::references::ReferenceSource;
use crate::sequence::{FIRST_FRAME, Job};
use quell::Size;
use quell_frames::Precision;
use quell_lab::cache::Cache;
use quell_lab::references::ReferenceTarget;
use quell_trace::RenderOptions;

pub fn run(context: &Context, args: RenderArgs) -> Result<(), Failure> {
    let mut scene = scene::open(context, &args.source, &args.scene)?.scene;
    environment::surround(context, &mut scene, &args.environment)?;
    let camera = scene::camera(&mut scene, &args.sampling.camera)?;
    let count = args.count.map_or(scene.frames, |count| count as usize);
    let frames = match &args.frames {
        Some(frames) => frames.numbers().to_vec(),
        None => (FIRST_FRAME..).take(count).collect(),
    };
    scene::expose(context, &args.source, &mut scene, camera, args.exposure, middle(&frames))?;
    let options = options(args.size, &args.sampling)?;
    let references = match (args.reference, &args.reference_frames) {
        (None, None) if args.reference_error.is_none() => ReferenceSource::None,
        (spp, chosen) => {
            let chosen = chosen.as_ref().map(|c| c.numbers().to_vec());
            if let Some(missing) = chosen.iter().flatten().find(|f| !frames.contains(f)) {
                return Err(Failure::Usage(format!("--reference-frames names frame {missing}, which is not rendered")));
            }
            let cache = Cache::default_place();
            if let Some(cache) = &cache {
                context.detail(&format!("references are kept in {}", cache.folder().display()));
            }
            let target = ReferenceTarget {
                samples: spp.unwrap_or(DEFAULT_REFERENCE_SPP).div_ceil(2),
                rel_mse: args.reference_error.map_or(0.0, f64::from),
                ..ReferenceTarget::default()
            };
            ReferenceSource::Trace { target, frames: chosen, cache }
        }
    };
    let colours = if args.half { Precision::Half } else { Precision::Float };
    let files = Files { folder: args.output, exr: true, png: false, colours, overwrite: args.overwrite };
    Job { scene, camera, frames, options, denoise: !args.no_denoise, references, files }.run(context)
}

/// The frame that stands for all.
pub fn middle(frames: &[i64]) -> i64 {
    frames.get(frames.len() / 2).copied().unwrap_or(FIRST_FRAME)
}

/// Samples a pixel of a reference, both halves together, by default.
const DEFAULT_REFERENCE_SPP: u32 = 256;

/// How light is sampled, from the command line.
pub fn options(size: Size, sampling: &SamplingArgs) -> Result<RenderOptions, Failure> {
    if !(sampling.indirect_clamp.is_finite() && sampling.indirect_clamp >= 0.0) {
        let value = sampling.indirect_clamp;
        return Err(Failure::Usage(format!("--indirect-clamp {value} is no luminance; 0 is no limit")));
    }
    let defaults = RenderOptions::new(size);
    Ok(RenderOptions {
        samples: sampling.spp,
        bounces: sampling.bounces,
        seed: sampling.seed,
        estimator: sampling.estimator,
        direct_samples: sampling.direct_samples.unwrap_or(defaults.direct_samples),
        jitter: sampling.jitter,
        indirect_clamp: sampling.indirect_clamp,
        primary_replacement: sampling.replacement,
        variances: sampling.spp > 1,
        halves: sampling.spp > 1,
        ..defaults
    })
}
