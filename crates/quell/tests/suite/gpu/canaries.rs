//! Every file of WGSL has a planted change that a comparison sees: those of `agreement.rs`, `half.rs`, `wavelet.rs`,
//! `prepare.rs` by name, and those of what repairs and counts colours here.

use super::agreement::{self, CASES, SIZE, scenes, settings_with};
use super::device::{Output, colour_bytes, gpu};
use super::inputs::Inputs;
use super::{finish, half, prepare, sequence_views, wavelet, window};
use quell::Plane;
use quell::border::{PlaneName, Repair};
use quell::gpu::{Bindable, Kernel, Pass, PerFrameUniforms, Repairs, Storage, wgpu};
use std::path::{Path, PathBuf};

/// Declarations only, no step of a computation: `shaders.rs` compares their structs with Rust's. And debug views, where
/// `debug.rs` plants the mistakes of hosts instead.
const OTHERWISE: [&str; 4] =
    ["gpu/settings.wgsl", "gpu/guides/types.wgsl", "gpu/passes/debug.wgsl", "gpu/passes/debug_colours.wgsl"];

/// What repairs colours as they are loaded, planted here.
const PLANTED: [(&str, &str); 3] = [
    ("select(vec3f(0.0), texel.xyz, finite)", "texel.xyz"),
    ("vec3f(-COLOUR_LIMIT), vec3f(COLOUR_LIMIT)", "vec3f(0.0), vec3f(COLOUR_LIMIT)"),
    ("(bitcast<vec3u>(texel.xyz) & vec3u(0x7f800000u)) != vec3u(0x7f800000u)", "vec3<bool>(true, true, false)"),
];

/// What counts them.
const COUNTED: [(&str, &str); 2] = [
    (
        "count_colour(PLANE_DIRECT, textureLoad(direct, pixel, 0));",
        "count_colour(PLANE_DIRECT, textureLoad(matte, pixel, 0));",
    ),
    ("count_colour(PLANE_GLOSSY_WEIGHT,", "count_colour(PLANE_MATTE_WEIGHT,"),
];

/// The files under a folder with this ending.
fn files(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            files(&path, out);
        } else if path.extension().is_some_and(|e| e == "wgsl") {
            out.push(path);
        }
    }
}

/// Whether one of these changes is in this text.
fn is_planted(text: &str, changes: &[&str]) -> bool {
    changes.iter().any(|from| text.contains(from))
}

#[test]
fn every_file_of_shaders_has_a_planted_change() {
    let packed = prepare::PACKED.iter();
    let passes = agreement::PLANTED.iter().chain(half::PLANTED).map(|(_, from, _)| *from);
    let sequence = window::PLANTED.iter().chain(finish::PLANTED).chain([&finish::PLANTED_IN_JOINT]);
    let passes = passes.chain(sequence.map(|(_, from, _)| *from));
    let others = wavelet::PLANTED
        .iter()
        .chain(prepare::PLANTED)
        .chain(sequence_views::PLANTED)
        .chain(packed)
        .chain(&COUNTED)
        .chain(&PLANTED);
    let changes: Vec<&str> = passes.chain(others.map(|(from, _)| *from)).collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    files(&folder, &mut found);
    assert!(found.len() > 40, "{} files", found.len());
    let without: Vec<PathBuf> = found
        .iter()
        .map(|path| path.strip_prefix(&folder).expect("inside").to_owned())
        .filter(|path| !OTHERWISE.iter().any(|d| path == Path::new(d)))
        .filter(|path| !is_planted(&std::fs::read_to_string(folder.join(path)).expect("a file"), &changes))
        .collect();
    assert!(without.is_empty(), "nothing is planted in {without:?}");
    assert!(!is_planted("fn nobody() {}", &changes));
}

#[test]
fn colours_are_repaired_as_they_are_loaded() {
    let Some(gpu) = gpu() else { return };
    let (_, scene) = scenes().into_iter().next().expect("a scene");
    let inputs = Inputs::new(&scene, SIZE, |_| ());
    let case = CASES.iter().find(|case| case.name == "composite, all").expect("the sum");
    // Direct light, so that nothing multiplies it: what is wild, and what it is to count as.
    let with = |values: [f32; 4]| {
        let mut job = (case.job)(&inputs, &settings_with(case.changes));
        for (i, texel) in job.inputs[0].chunks_exact_mut(16).enumerate() {
            texel[(i % 3) * 4..][..4].copy_from_slice(&values[i % 4].to_le_bytes());
        }
        job
    };
    let wild = with([f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.5]);
    let tame = with([0.0, 0.0, 0.0, -0.5]);
    let source = wild.pass.source(Storage::Float, false);
    let run = |source: &str, job| {
        let kernel = Kernel::with_source(&gpu.device, wild.pass, Storage::Float, source);
        gpu.run(&kernel, job)
    };
    let same = |a: &Output, b: &Output| a.colours == b.colours;
    let wanted = run(&source, &tame);
    assert!(wanted.colours[0].1.data().iter().flatten().all(|v| v.is_finite()));
    assert!(same(&wanted, &run(&source, &wild)));
    for (from, to) in PLANTED {
        assert!(source.contains(from), "`{from}` is not there");
        let planted = source.replacen(from, to, 1);
        assert!(!same(&wanted, &run(&planted, &wild)), "`{from}` made `{to}` went unseen");
    }
}

#[test]
fn repaired_colours_are_counted_plane_by_plane() {
    let Some(gpu) = gpu() else { return };
    use wgpu::BufferUsages as B;
    const PLANES: [PlaneName; 7] = [
        PlaneName::Direct,
        PlaneName::Matte,
        PlaneName::Glossy,
        PlaneName::DirectMatte,
        PlaneName::DirectGlossy,
        PlaneName::MatteWeight,
        PlaneName::GlossyWeight,
    ];
    // Plane k has k + 1 values that are not finite.
    let colour = |k: usize| {
        let mut plane = Plane::filled(SIZE, [0.5; 3]);
        plane.data_mut().iter_mut().step_by(17).take(k + 1).for_each(|c| c[1] = f32::NAN);
        gpu.texture("colour", wgpu::TextureFormat::Rgba32Float, SIZE, &colour_bytes(&plane))
    };
    let colours: Vec<wgpu::TextureView> = (0..PLANES.len()).map(colour).collect();
    let (_, scene) = scenes().into_iter().next().expect("a scene");
    let job = (CASES[0].job)(&Inputs::new(&scene, SIZE, |_| ()), &settings_with(&[]));
    let counted = |source: &str| -> Vec<u64> {
        let kernel = Kernel::with_source(&gpu.device, Pass::COUNT_REPAIRS, Storage::Float, source);
        let frame = gpu.buffer("frame", &job.frame.bytes(), B::UNIFORM);
        let settings = gpu.buffer("settings", &job.settings.bytes(), B::UNIFORM);
        let counts = gpu.buffer("counts", &[0; Repairs::BYTES as usize], B::STORAGE | B::COPY_SRC);
        let planes = colours.iter().map(Bindable::Plane);
        let bound: Vec<Bindable<'_>> = [Bindable::Counts(&counts)].into_iter().chain(planes).collect();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("test") });
        let uniforms = PerFrameUniforms { frame: &frame, settings: &settings };
        kernel.encode(&gpu.device, &mut encoder, uniforms, &bound, SIZE).unwrap();
        gpu.queue.submit([encoder.finish()]);
        let bytes: Vec<u8> = gpu.read_buffers(&[&counts])[0].iter().flat_map(|n| n.to_le_bytes()).collect();
        let counts = Repairs::read(&bytes).unwrap();
        PLANES.map(|plane| counts.count(plane, Repair::NotFinite)).to_vec()
    };
    let source = Pass::COUNT_REPAIRS.source(Storage::Float, false);
    let wanted: Vec<u64> = (1..=PLANES.len() as u64).collect();
    assert_eq!(counted(&source), wanted);
    for (from, to) in COUNTED {
        assert!(source.contains(from), "`{from}` is not there");
        assert_ne!(counted(&source.replacen(from, to, 1)), wanted, "`{from}` made `{to}` went unseen");
    }
}
