//! What the scorecard answers to artefacts of known kind, on a built-in scene: the matrix of docs/scorecard.md, as Markdown.
//!
//! `cargo run --release -p quell-lab --example 03_injection_matrix -- glossy-room 240x135 32-47 64 4`: scene, size,
//! frames, samples a pixel of each half of the reference, camera. References are kept in `$QUELL_CACHE`, the same that
//! `quell compare` makes.
//!
//! Artefacts are added to a third rendering, filtered by `nfor`: its own grain would be larger than the artefacts, and a
//! blur would answer by taking that grain away.

use quell::{FrameBuf, Plane, Rgb, Size};
use quell_lab::cache::Cache;
use quell_lab::methods::{Input, parse};
use quell_lab::metrics::Exposures;
use quell_lab::references::{ReferenceOf, ReferencePair, ReferenceTarget, converge};
use quell_lab::scorecard::injection::{Artefact, Injector};
use quell_lab::scorecard::matrix::Matrix;
use quell_lab::scorecard::{Instruments, ReferenceFrame};
use quell_trace::{Control, RenderOptions, Tracer, builtin};

/// Seed of the rendering that artefacts are added to; that of the references is 0.
const THIRD: u64 = 1;
/// Its samples a pixel.
const THIRD_SAMPLES: u32 = 16;
/// HDR-FLIP of every artefact.
const FLIP: f64 = 0.05;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize, default: &str| words.get(i).cloned().unwrap_or_else(|| default.to_owned());
    let name = word(0, "glossy-room");
    let (width, height) = word(1, "240x135").split_once('x').map(|(w, h)| (w.parse(), h.parse())).ok_or("WxH")?;
    let size = Size::new(width?, height?);
    let (first, last) = word(2, "32-47").split_once('-').map(|(a, b)| (a.parse(), b.parse())).ok_or("FIRST-LAST")?;
    let (first, last): (i64, i64) = (first?, last?);
    let (samples, camera): (u32, usize) = (word(3, "64").parse()?, word(4, "4").parse()?);
    let count = (last - first + 1) as usize;
    let warm_up = count / 3;

    let scene = builtin(&name)?;
    let cache = Cache::default_place();
    let control = Control::default();
    let mut frames: Vec<FrameBuf> = Vec::new();
    let mut references: Vec<ReferencePair> = Vec::new();
    let mut third: Vec<Plane<Rgb>> = Vec::new();
    for frame in first..=last {
        let options = RenderOptions::new(size);
        let converged = |seed: u64, samples: u32| {
            let options = RenderOptions { seed, ..options };
            let target = ReferenceTarget { samples, batch: samples, ..ReferenceTarget::default() };
            let what = ReferenceOf { scene: &scene, camera, frame, options: &options };
            converge(cache.as_ref(), &what, &target, &control, |_| ())
        };
        references.push(converged(0, samples)?);
        let options = RenderOptions { seed: THIRD, samples: THIRD_SAMPLES, halves: true, ..options };
        let rendered = Tracer::new(&scene, frame, camera)?.render(&options, &control)?;
        let halves = rendered.halves.as_ref().map(|[a, b]| [a, b]);
        third.push(parse("nfor")?.denoise(&Input { frame: &rendered.frame.frame(&[]), halves })?);
        frames.push(rendered.frame);
        eprintln!("frame {frame} of {first} to {last}");
    }

    let own_error = references.iter().map(ReferencePair::rel_mse).sum::<f64>() / references.len() as f64;
    let reference_frames: Vec<ReferenceFrame<'_>> = frames
        .iter()
        .zip(&references)
        .enumerate()
        .map(|(t, (frame, pair))| ReferenceFrame {
            b: Some(&pair.b.beauty),
            a_direct: Some(&pair.a.direct),
            b_direct: Some(&pair.b.direct),
            scored: t >= warm_up,
            ..ReferenceFrame::new(frame, &pair.a.beauty)
        })
        .collect();
    let start = std::time::Instant::now();
    let instruments = Instruments::new(&reference_frames)?;
    eprintln!("instruments: {:.1} s", start.elapsed().as_secs_f64());
    let guides: Vec<&FrameBuf> = frames.iter().collect();
    let injector = Injector::new(&guides, 11)?;
    let depths = references.iter().zip(&frames).map(|(r, f)| (&r.a.beauty, f.view_depth.as_ref()));
    let exposures = Exposures::from_reference(depths)?;
    let artefacts = Artefact::ALL.map(|artefact| (artefact, 0.2));
    let looked_at = [warm_up, count - 1];
    let start = std::time::Instant::now();
    let matrix = Matrix::measure(&instruments, &injector, &third, &artefacts, &exposures, FLIP, &looked_at)?;
    eprintln!("matrix: {:.1} s", start.elapsed().as_secs_f64());

    println!(
        "`{name}`, camera {camera}, {size}, frames {} to {last} scored, references of 2 x {samples} samples a",
        first + warm_up as i64
    );
    println!("pixel (their own trimmed relMSE: {own_error:.1e}), HDR-FLIP {:.4}.\n", matrix.flip);
    println!("{}", matrix.markdown());
    println!("\nWithout an artefact:");
    for (name, score) in matrix.base.iter() {
        match (score.value, &score.reason) {
            (Some(value), _) => println!("- {name}: {value:.4}"),
            (None, reason) => println!("- {name}: none, {}", reason.as_deref().unwrap_or("-")),
        }
    }
    Ok(())
}
