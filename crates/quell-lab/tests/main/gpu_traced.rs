//! Frames and references that a GPU traced, in the place of the CPU's.

use super::gpu::gpu;
use quell::{FrameBuf, Plane, Rgb, Settings, Size};
use quell_frames::{frame_path, read_frame};
use quell_lab::backend::Backend;
use quell_lab::compare::{SceneSource, Sequence};
use quell_lab::methods::{Input, parse};
use quell_lab::metrics::{FrameScores, flip::Exposures};
use quell_lab::references::{ReferenceOf, ReferenceTarget, converge};
use quell_lab::tone::Tone;
use quell_lab::tracer::TraceOn;
use quell_lab::whole_frame::{FramePlan, WholeFrame};
use quell_trace::{Control, RenderOptions, Scene, builtin};
use std::path::Path;

/// Scores of the last frame, denoised: trimmed relMSE, HDR-FLIP, energy.
fn scores(frames: &[FrameBuf], reference: &Plane<Rgb>, tone: Tone) -> [f64; 3] {
    let mut method = parse("quell:paper").unwrap();
    let denoise = |frame: &FrameBuf| method.denoise(&Input { frame: &frame.frame(&[]), halves: None }).unwrap();
    let picture = frames.iter().map(denoise).last().unwrap();
    let depth = frames.last().unwrap().view_depth.as_ref();
    let exposures = Exposures::from_reference([(reference, depth)]).unwrap();
    let (scores, _) = FrameScores::measure(&picture, reference, tone, &exposures).unwrap();
    [scores.rel_mse_trimmed, scores.hdr_flip, scores.energy]
}

#[test]
fn scores_of_frames_from_the_gpu_lie_within_those_of_five_seeds() {
    let Some(gpu) = gpu() else { return };
    const FRAMES: i64 = 6;
    let scene = builtin("glossy-room").unwrap();
    let options = RenderOptions { direct_samples: 4, ..RenderOptions::new(Size::new(64, 36)) };
    let target = ReferenceTarget { samples: 64, ..ReferenceTarget::default() };
    let what = ReferenceOf { scene: &scene, camera: 1, frame: FRAMES - 1, options: &options };
    let reference = converge(None, &what, &target, &Control::default(), |_| ()).unwrap().mean().unwrap().beauty;
    let tone = Tone { exposure: scene.exposure };
    let on_gpu = TraceOn::backend(&Backend::Gpu(gpu));
    let of = |on: &TraceOn, options: RenderOptions| {
        let frame = |n| on.tracer(&scene, n, 1).unwrap().render(&options, &Control::default()).unwrap().frame;
        let frames: Vec<FrameBuf> = (0..FRAMES).map(frame).collect();
        scores(&frames, &reference, tone)
    };
    let seeds: Vec<[f64; 3]> = (0..5).map(|seed| of(&TraceOn::Cpu, RenderOptions { seed, ..options })).collect();
    let ours = of(&on_gpu, RenderOptions { seed: 1, ..options });
    println!("GPU, seed 1: {ours:.5?}; CPU, seeds 0 to 4: {seeds:.5?}");
    // Of the same seed nearly all paths are the CPU's: a tenth of the spread, where the bound is the spread itself.
    let off = |scores: [f64; 3]| {
        [0, 1, 2].map(|i| {
            let of = seeds.iter().map(|s| s[i]);
            let spread = of.clone().fold(f64::MIN, f64::max) - of.fold(f64::MAX, f64::min);
            (scores[i] - seeds[1][i]).abs() / spread
        })
    };
    println!("in spreads of the CPU's: {:.3?}", off(ours));
    assert!(off(ours).iter().all(|off| *off < 1.0), "{ours:?} {seeds:?}");
    // A tracer that forgets two bounces of three is seen.
    let wrong = off(of(&on_gpu, RenderOptions { seed: 1, bounces: 1, ..options }));
    println!("with one bounce: {wrong:.3?}");
    assert!(wrong.iter().any(|off| *off > 1.0), "{wrong:?}");
}

fn load(scene: &Scene, on: &TraceOn, folder: &Path) -> Sequence {
    let source = SceneSource {
        scene,
        camera: 1,
        frames: vec![0, 1],
        options: RenderOptions { samples: 1, direct_samples: 2, ..RenderOptions::new(Size::new(32, 18)) },
        target: ReferenceTarget { samples: 16, batch: 16, ..ReferenceTarget::default() },
        references: vec![1],
        on,
        cache: None,
        folder: Some(folder),
    };
    source.load(None, &|_| {}).unwrap()
}

#[test]
fn a_comparison_traced_on_the_gpu_is_one_of_its_own() {
    let Some(gpu) = gpu() else { return };
    let scene = builtin("cornell-box").unwrap();
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("compare-gpu");
    let _ = std::fs::remove_dir_all(&place);
    let on_gpu = TraceOn::backend(&Backend::Gpu(gpu));
    let ours = load(&scene, &on_gpu, &place);
    let sampling = || read_frame(&frame_path(&place.join("noisy"), "noisy", 1)).unwrap().metadata.sampling;
    assert!(sampling().ends_with("traced on a GPU") && ours.description.ends_with("traced on a GPU"));
    // Frames of one tracer are not taken for those of the other.
    let cpus = load(&scene, &TraceOn::Cpu, &place);
    assert_ne!(ours.identity, cpus.identity);
    assert!(!sampling().contains("GPU"));
    // Yet nearly all pixels have the same light; references differ by noise at most.
    let [a, b] = [&ours, &cpus].map(|s| s.frame(1).unwrap().frame.matte.clone().unwrap());
    let same = |(a, b): (&Rgb, &Rgb)| (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-3 * b[c].abs() + 1e-6);
    let share = a.data().iter().zip(b.data()).filter(|&pair| same(pair)).count() as f64 / a.data().len() as f64;
    let [a, b] = [&ours, &cpus].map(|s| s.reference(1).unwrap().mean.clone());
    let sum = |p: &Plane<Rgb>| p.data().iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    println!("{share:.4} of the matte pixels agree; references' light {:.5}", sum(&a) / sum(&b));
    assert!(share > 0.98 && (sum(&a) / sum(&b) - 1.0).abs() < 0.01);
}

#[test]
fn a_whole_frame_counts_its_bytes_and_rays() {
    let Some(gpu) = gpu() else { return };
    let scene = builtin("cornell-box").unwrap();
    let kernels = std::sync::Arc::default();
    let size = Size::new(32, 18);
    let frame = |views, bounces| {
        let options = RenderOptions { bounces, direct_samples: 1, ..RenderOptions::new(size) };
        let plan = FramePlan { size, views, options };
        WholeFrame::new(&gpu, &kernels, &scene, 0, 1, &Settings::default(), &plan).unwrap()
    };
    let mut one = frame(1, 1);
    let cost = one.run().unwrap();
    println!("{cost:?}");
    // docs/gpu.md has these figures.
    let bytes = |name: &str| cost.passes.iter().find(|p| p.name == name).unwrap().bytes_per_pixel;
    let traced = ["trace primary", "trace signals", "trace direct", "planes"].map(bytes);
    assert_eq!(traced, [128, 200, 92, 172]);
    let denoised: u32 = cost.passes.iter().filter(|p| !p.is_tracing).map(|p| p.bytes_per_pixel).sum();
    assert_eq!(denoised, 351);
    // The eye's ray, shadow rays of what it meets, two paths with some of each.
    let rays = one.rays_per_pixel().unwrap();
    assert!((4.0..=8.0).contains(&rays), "{rays}");
    assert!(frame(1, 3).rays_per_pixel().unwrap() > 1.3 * rays);
    let mut two = frame(2, 1);
    let both = two.run().unwrap();
    assert_eq!(both.passes.len(), cost.passes.len());
    assert!(two.memory()[1].1 == 2 * one.memory()[1].1 && two.run().unwrap().wall.as_nanos() > 0);
}
