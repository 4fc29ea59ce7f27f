//! What half storage must not lose, too small for a comparison of single values: rounding that leans to one side, and the
//! lowest bits of packed normals. Each is shown to be seen.

use super::agreement::{CASES, SIZE, scenes, settings_with};
use super::device::{Job, Output, colour_bytes, gpu};
use super::inputs::Inputs;
use crate::suite::frames::{Noise, floor, hash, moving};
use glam::Vec3;
use quell::gpu::{Kernel, Storage};
use quell::{Plane, Settings};

/// Mean of (found - expected) / expected over a pass's values. Rounding to nearest leaves 2e-4 / sqrt(values), 3e-6
/// here; cutting off takes 3.5e-4 away. What the stages themselves differ by leans to neither side.
const LEANING: f64 = 5e-5;
/// The rounding of stored colours, and the same cut off.
const ROUNDED: &str = "bits + 0xfffu + ((bits >> vec3u(13u)) & vec3u(1u))";

/// How much an output leans to one side.
fn leaning(expected: &Output, found: &Output) -> f64 {
    let pairs = expected.colours.iter().zip(&found.colours).flat_map(|((_, a), (_, b))| {
        a.data().iter().flatten().zip(b.data().iter().flatten()).map(|(a, b)| (f64::from(*a), f64::from(*b)))
    });
    // Halves under 2^-14 have fewer digits.
    let (sum, count) = pairs.filter(|(a, _)| *a > 1e-4).fold((0.0, 0.0), |(s, n), (a, b)| (s + (b - a) / a, n + 1.0));
    sum / count
}

fn half_job(inputs: &mut Inputs, case: &super::agreement::Case, settings: &Settings) -> Job {
    inputs.storage = Storage::Half;
    (case.job)(inputs, settings)
}

#[test]
fn no_pass_rounds_to_one_side() {
    let Some(gpu) = gpu() else { return };
    let scene = floor(moving, Noise::Uniform);
    let mut inputs = Inputs::new(&scene, SIZE, |_| ());
    // The plain case of every pass.
    for case in CASES.iter().filter(|case| case.changes.is_empty() && !case.name.contains("after")) {
        let job = half_job(&mut inputs, case, &settings_with(case.changes));
        let source = job.pass.source(Storage::Half, false);
        assert!(source.contains(ROUNDED));
        let lean = |source: &str| {
            let kernel = Kernel::with_source(&gpu.device, job.pass, Storage::Half, source);
            leaning(&job.expected, &gpu.run(&kernel, &job))
        };
        let (rounded, cut) = (lean(&source), lean(&source.replace(ROUNDED, "bits")));
        println!("{:<14} {rounded:+.1e}, cut off {cut:+.1e}, of {LEANING:.0e}", case.name);
        assert!(rounded.abs() < LEANING, "{}: leans by {rounded:e}", case.name);
        assert!(cut.abs() > LEANING, "{}: cutting off went unseen: {cut:e}", case.name);
    }
}

/// Largest difference of a component of a normal that comes out of its 19 bits an axis: half a step of the octahedron,
/// 1.9e-6, on both axes, which add up in the third component, and 1.7 times as much where the octahedron is flattest.
const NORMAL: f32 = 7e-6;
/// The error is written enlarged: a half has 11 digits.
const ENLARGED: f32 = 65536.0;

#[test]
fn packed_normals_keep_their_lowest_bits() {
    let Some(gpu) = gpu() else { return };
    // Directions all over the sphere.
    let normals = Plane::from_fn(SIZE, |x, y| {
        let v = [0, 1, 2].map(|c| hash([x as u32, y as u32, c, 0]) as f32 - 0.5);
        Vec3::from(v).normalize_or(Vec3::Z).to_array()
    });
    let (_, scene) = scenes().into_iter().next().expect("a scene");
    let mut inputs = Inputs::new(&scene, SIZE, |frame| frame.normal = Some(normals.clone()));
    let case = CASES.iter().find(|case| case.name == "4").expect("stage 4");
    let mut job = half_job(&mut inputs, case, &settings_with(case.changes));
    job.inputs[3] = colour_bytes(&normals);
    let source = job.pass.source(Storage::Half, false);
    let filter = "sparse_bilateral(pixel, settings.matte_edge, settings.matte_prefilter)";
    assert!(source.contains(filter));
    let error = format!("(surface_of(pixel).normal - textureLoad(input, pixel, 0).xyz) * {ENLARGED:?}");
    let source = source.replace(filter, &error);
    let largest = |source: &str| {
        let kernel = Kernel::with_source(&gpu.device, job.pass, Storage::Half, source);
        let found = gpu.run(&kernel, &job);
        let values = found.colours[0].1.data().iter().flatten();
        values.fold(0.0f32, |most, v| most.max(v.abs())) / ENLARGED
    };
    let found = largest(&source);
    println!("{found:.1e} of {NORMAL:.0e}");
    assert!(found > 0.0 && found <= NORMAL, "{found:e}");
    for (from, to) in [
        ("(high << vec2u(NORMAL_LOW_BITS)) | low", "(high << vec2u(NORMAL_LOW_BITS))"),
        ("vec2u(skin.x >> 26u, skin.x >> 29u) & vec2u(7u)", "vec2u(skin.x >> 26u, skin.x >> 29u) & vec2u(6u)"),
        ("vec2u(skin.x >> 26u, skin.x >> 29u)", "vec2u(skin.x >> 29u, skin.x >> 26u)"),
    ] {
        assert!(source.contains(from), "`{from}` is not there");
        let found = largest(&source.replace(from, to));
        println!("{found:.1e} with `{to}`");
        assert!(found > NORMAL, "`{from}` made `{to}` went unseen");
    }
}
