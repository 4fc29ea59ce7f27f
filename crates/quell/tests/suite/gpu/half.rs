//! Half storage against the reference, stage by stage and over 30 frames; fused passes against single ones.

use super::agreement::{Bound, CASES, SIZE, canaries, compare, scenes, settings_with, unusual};
use super::device::{By, Output, gpu, half as of_half};
use super::inputs::Inputs;
use super::sequence::{on_gpu, on_reference};
use super::textures::half;
use crate::suite::frames::with_radius;
use quell::gpu::{self, Kernel, Options, Storage};
use quell::{Backend, Denoiser, FrameBuf, Settings};

/// One stage, guides that are plain: the result is rounded to a half, 2^-11 (4.9e-4) of itself; the rest is motion in 20
/// bits and the hit distance in 11, which move the place in the previous image. A pick of stage 6 or a fetch of stage 8
/// at a threshold may flip.
const STAGE: Bound = Bound { relative: 1.1e-3, flips: 1e-3 };
/// Roughness that changes from pixel to pixel, in steps of 1/1023: the radius of stages 9 and 10 goes with its square, and
/// a tap at its edge comes or goes; Kg takes it ten times.
const GUIDED: Bound = Bound { relative: 5e-3, flips: 5e-3 };
/// 30 frames: every frame's history is rounded once, to nearest, and errors do not add up.
const SEQUENCE: Bound = Bound { relative: 2e-3, flips: 2e-3 };
/// Curved mirrors find their history by the differences of neighbouring normals (19 bits an axis) and by the hit distance.
const CURVED: Bound = Bound { relative: 5e-3, flips: 2e-2 };

/// Hit distances that half storage holds as they are: parts of the depth that are halves. Where they are compared within a hundredth
/// their rounding, 2^-12, would be a fortieth of that, and trust with it; how they are packed is what the other cases see.
fn pack_exactly(frame: &mut FrameBuf) {
    let Some(depth) = frame.view_depth.clone() else { return };
    let Some(hit) = frame.glossy_hit_distance.as_mut() else { return };
    for (hit, depth) in hit.data_mut().iter_mut().zip(depth.data()) {
        if hit.is_finite() && *depth > 0.0 && depth.is_finite() {
            *hit = of_half(half(*hit / depth)) * depth;
        }
    }
}

#[test]
fn every_pass_agrees_in_half_storage() {
    let Some(gpu) = gpu() else { return };
    let mut failures = Vec::new();
    for case in CASES {
        let settings = settings_with(case.changes);
        let mut kernel = None;
        let mut largest = [0.0f64; 2];
        for (name, scene) in scenes() {
            // Each scene in one kind: half the time.
            let is_unusual = matches!(name, "mirror" | "jittered");
            let bound = if is_unusual { GUIDED } else { STAGE };
            let mut inputs = Inputs::new(&scene, SIZE, |frame| {
                if is_unusual {
                    unusual(frame);
                }
                if case.changes.iter().any(|(name, _)| *name == "glossy_temporal.hit_tolerance") {
                    pack_exactly(frame);
                }
            });
            inputs.storage = Storage::Half;
            let job = (case.job)(&inputs, &settings);
            let kernel = kernel.get_or_insert_with(|| Kernel::new(&gpu.device, job.pass, Storage::Half, false));
            let output = gpu.run(kernel, &job);
            match compare(&job.expected, &output, bound) {
                Ok(seen) => largest[usize::from(is_unusual)] = largest[usize::from(is_unusual)].max(seen),
                Err(difference) => failures.push(format!("{name}, {}: {difference}", case.name)),
            }
            for (canary, planted) in canaries(&output) {
                if !is_unusual && compare(&job.expected, &planted, bound).is_ok() {
                    failures.push(format!("{name}, {}: {canary} went unseen", case.name));
                }
            }
        }
        println!(
            "{:<20} {:.1e} of {:.1e}, {:.1e} of {:.1e}",
            case.name, largest[0], STAGE.relative, largest[1], GUIDED.relative
        );
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn thirty_frames_agree_in_half_storage() {
    let Some(gpu) = gpu() else { return };
    for (name, scene) in scenes() {
        let bound = if name == "sphere" { CURVED } else { SEQUENCE };
        let settings = with_radius(Settings::default(), SIZE, 12.0);
        let mut reference = Denoiser::with_backend(SIZE, &settings, Backend::Reference).unwrap();
        let mut other = {
            let mut options = Options::new(&settings);
            options.composite = true;
            gpu::Denoiser::new(&gpu.device, SIZE, &options).unwrap()
        };
        for i in 0..30 {
            let frame = scene.frame(SIZE, i);
            let (a, b) = (on_reference(&mut reference, &frame), on_gpu(gpu, &mut other, &frame));
            if i % 10 != 9 {
                continue;
            }
            let colours = |o: &Output| Output { scalars: Vec::new(), ..o.clone() };
            let scalars = |o: &Output| Output { colours: Vec::new(), ..o.clone() };
            for (a, b, bound) in [(colours(&a), colours(&b), bound), (scalars(&a), scalars(&b), SEQUENCE)] {
                match compare(&a, &b, bound) {
                    Ok(seen) => println!("{name}, frame {i}: {seen:.1e} of {:.1e}", bound.relative),
                    Err(difference) => panic!("{name}, frame {i}: {difference}"),
                }
                // What changes colours leaves scalars alone.
                for (canary, planted) in canaries(&b).into_iter().skip(if b.colours.is_empty() { 3 } else { 0 }) {
                    assert!(compare(&a, &planted, bound).is_err(), "{name}, frame {i}: {canary} went unseen");
                }
            }
        }
    }
}

#[test]
fn fused_passes_agree_with_single_ones() {
    let Some(gpu) = gpu() else { return };
    // The same steps, compiled in other company: a multiplication and an addition may be fused in one and not the other.
    let bounds = [
        (Storage::Float, Bound { relative: 1e-5, flips: 1e-3 }),
        (Storage::Half, Bound { relative: 1.1e-3, flips: 1e-3 }),
    ];
    for (storage, bound) in bounds {
        for (name, scene) in scenes().into_iter().skip(1).step_by(2) {
            let settings = with_radius(Settings::default(), SIZE, 12.0);
            let mut denoisers = [true, false].map(|fuse| {
                let mut options = Options::new(&settings);
                (options.storage, options.fuse, options.composite) = (storage, fuse, true);
                gpu::Denoiser::new(&gpu.device, SIZE, &options).unwrap()
            });
            for i in 0..4 {
                let frame = scene.frame(SIZE, i);
                let [a, mut b] = denoisers.each_mut().map(|denoiser| on_gpu(gpu, denoiser, &frame));
                b.by = By::Unfused;
                let result = compare(&a, &b, bound);
                assert!(result.is_ok(), "{storage:?}, {name}, frame {i}: {result:?}");
                println!("{storage:?}, {name}, frame {i}: fused and single differ by {:.1e}", result.unwrap_or(1.0));
            }
            let passes = |k: usize| denoisers[k].program().dispatches.len();
            assert!(passes(0) < passes(1));
        }
    }
}

/// A change planted in `storage/half.wgsl` that the named comparison must see.
pub const PLANTED: &[(&str, &str, &str)] = &[
    ("4", "(high << vec2u(NORMAL_LOW_BITS)) | low", "low"),
    ("4", "return skin.x & 0xffffu;", "return 0u;"),
    ("3", "select(value, -value, (code >> 19u) != 0u)", "value"),
    ("3", "((bits.y & 0xffu) << 12u)", "((bits.y & 0xffu) << 11u)"),
    ("3", "f32(bits.y >> 24u) / CONFIDENCE_STEPS", "1.0"),
    ("8", "select(ratio * depth, FAR, ratio >= HALF_MAX)", "ratio"),
    ("9", "& 1023u) / ROUGHNESS_STEPS", "& 1023u) / 1000.0"),
    // Two steps up instead of to the nearest.
    ("6", "bits + 0xfffu + ((bits >> vec3u(13u)) & vec3u(1u))", "bits + 0x5fffu"),
];

#[test]
fn every_change_planted_in_the_packing_is_seen() {
    let Some(gpu) = gpu() else { return };
    for (name, from, to) in PLANTED {
        let case = CASES.iter().find(|c| c.name == *name).unwrap();
        let settings = settings_with(case.changes);
        let mut kernel = None;
        let all = scenes();
        let mut kinds = all.iter().flat_map(|(_, scene)| [(scene, false), (scene, true)]);
        let seen = kinds.any(|(scene, odd)| {
            let mut inputs = Inputs::new(scene, SIZE, |frame| {
                if odd {
                    unusual(frame);
                }
            });
            inputs.storage = Storage::Half;
            let job = (case.job)(&inputs, &settings);
            let kernel = kernel.get_or_insert_with(|| {
                let source = job.pass.source(Storage::Half, false);
                assert!(source.contains(from), "`{from}` is not there");
                Kernel::with_source(&gpu.device, job.pass, Storage::Half, &source.replacen(from, to, 1))
            });
            compare(&job.expected, &gpu.run(kernel, &job), if odd { GUIDED } else { STAGE }).is_err()
        });
        assert!(seen, "{name}: `{from}` made `{to}` went unseen");
    }
}
