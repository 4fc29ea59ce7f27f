//! One sample: nearly all pixels have the CPU's values, since nearly all paths have the CPU's samples. The rest are paths
//! that rounding sends another way: past an edge, to the other lobe or lamp, through the roulette.

use super::device::{Device, device};
use quell::{FrameBuf, Plane, Rgb, Size};
use quell_trace::gltf::{self, Loaded};
use quell_trace::{Control, RenderOptions, Scene, builtin, builtin_scenes};
use std::path::PathBuf;

/// Share of the pixels that must have the CPU's values.
const LEAST: f64 = 0.98;

/// The same where all kinds of lights, lobes and holes meet: more paths lie near a choice.
const LEAST_OF_EVERYTHING: f64 = 0.97;

/// The same on a GPU, which contracts products and sums and whose sines and roots are less exact (H100: 0.967).
const LEAST_OF_EVERYTHING_ON_HARDWARE: f64 = 0.96;

/// For the scene that has everything at once.
pub fn least_of_everything(device: &Device) -> f64 {
    if device.is_software() { LEAST_OF_EVERYTHING } else { LEAST_OF_EVERYTHING_ON_HARDWARE }
}

/// Largest difference of two values that count as the same, as a share of the larger.
const SAME: f32 = 1e-3;

fn same(a: f32, b: f32) -> bool {
    a == b || (a.is_nan() && b.is_nan()) || (a - b).abs() <= SAME * a.abs().max(b.abs()) + 1e-6
}

fn share<T: Copy>(a: &Option<Plane<T>>, b: &Option<Plane<T>>, same: impl Fn(T, T) -> bool) -> f64 {
    let (Some(a), Some(b)) = (a, b) else { panic!("a plane is missing") };
    let pairs = a.data().iter().zip(b.data());
    pairs.filter(|&(a, b)| same(*a, *b)).count() as f64 / a.data().len() as f64
}

/// Share of pixels that agree, by plane.
pub fn agreement(a: &FrameBuf, b: &FrameBuf) -> Vec<(&'static str, f64)> {
    let rgb = |a: Rgb, b: Rgb| (0..3).all(|c| same(a[c], b[c]));
    let unit = |a: Rgb, b: Rgb| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-3);
    let pixels = |a: [f32; 2], b: [f32; 2]| (0..2).all(|c| same(a[c], b[c]) || (a[c] - b[c]).abs() < 1e-3);
    vec![
        ("direct", share(&a.direct, &b.direct, rgb)),
        ("matte", share(&a.matte, &b.matte, rgb)),
        ("glossy", share(&a.glossy, &b.glossy, rgb)),
        ("matte weight", share(&a.matte_weight, &b.matte_weight, rgb)),
        ("glossy weight", share(&a.glossy_weight, &b.glossy_weight, rgb)),
        ("normal", share(&a.normal, &b.normal, unit)),
        ("depth", share(&a.view_depth, &b.view_depth, same)),
        ("roughness", share(&a.roughness, &b.roughness, same)),
        ("motion", share(&a.motion, &b.motion, pixels)),
        ("id", share(&a.surface_id, &b.surface_id, |a, b| a == b)),
        ("matte distance", share(&a.matte_hit_distance, &b.matte_hit_distance, same)),
        ("glossy distance", share(&a.glossy_hit_distance, &b.glossy_hit_distance, same)),
    ]
}

pub fn assert_same(device: &Device, scene: &Scene, frame: i64, camera: usize, options: &RenderOptions) {
    let gpu = device.tracer(scene, frame, camera);
    let ours = device.render(&gpu, options).unwrap();
    let expected = gpu.tracer().render(options, &Control::default()).unwrap();
    let shares = agreement(&ours.frame, &expected.frame);
    let least = if scene.name == "everything" { least_of_everything(device) } else { LEAST };
    println!("{}, frame {frame}: {shares:.4?}", scene.name);
    for (plane, share) in shares {
        assert!(share >= least, "{}: only {share:.4} of plane {plane} agree", scene.name);
    }
    // Paths of the same kinds and lengths, too.
    let (a, b) = (ours.rays.total() as f64, expected.rays.total() as f64);
    assert!((a / b - 1.0).abs() < 0.01, "{}: {a} rays, not {b}", scene.name);
    assert_eq!(ours.notes, expected.notes);
}

pub const SIZE: Size = Size::new(64, 36);

#[test]
fn pixels_of_builtin_scenes_have_the_cpus_values() {
    let Some(device) = device() else { return };
    for info in builtin_scenes() {
        let scene = builtin(info.name).unwrap();
        let options = RenderOptions { direct_samples: 16, ..RenderOptions::new(SIZE) };
        assert_same(device, &scene, 3, 1, &options);
    }
}

#[test]
fn several_samples_have_the_cpus_means_variances_and_halves() {
    let Some(device) = device() else { return };
    let scene = builtin("cornell-box").unwrap();
    let few =
        RenderOptions { samples: 5, variances: true, halves: true, direct_samples: 4, ..RenderOptions::new(SIZE) };
    let mut gpu = device.tracer(&scene, 3, 1);
    // Bands of 16 rows, the last of 4.
    gpu.limit_bands(16 * SIZE.width + 5);
    let (ours, expected) =
        (device.render(&gpu, &few).unwrap(), gpu.tracer().render(&few, &Control::default()).unwrap());
    for (plane, share) in agreement(&ours.frame, &expected.frame) {
        assert!(share >= LEAST, "only {share:.4} of plane {plane} agree");
    }
    let variances = [
        (&ours.frame.matte_variance, &expected.frame.matte_variance),
        (&ours.frame.glossy_variance, &expected.frame.glossy_variance),
    ];
    for (a, b) in variances {
        // Of variances half the digits.
        assert!(share(a, b, |a, b| (a - b).abs() <= 1e-2 * a.max(b) + 1e-6) >= LEAST);
    }
    let rgb = |a: Rgb, b: Rgb| (0..3).all(|c| same(a[c], b[c]));
    for (a, b) in ours.halves.unwrap().into_iter().zip(expected.halves.unwrap()) {
        assert!(share(&Some(a.matte), &Some(b.matte), rgb) >= LEAST);
        assert!(share(&Some(a.glossy), &Some(b.glossy), rgb) >= LEAST);
    }
}

/// A file of the shared folder; the skip is printed where it is absent.
fn shared(name: &str) -> Option<Loaded> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes").join(format!("{name}.glb"));
    if !path.is_file() {
        println!("SKIPPED: ../shared/scenes/{name}.glb is not there");
        return None;
    }
    Some(gltf::load(&path, &gltf::Options::default()).unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn pixels_of_shared_files_have_the_cpus_values() {
    let Some(device) = device() else { return };
    for (name, frame) in [
        ("cornell_box_animated", 20),
        ("fox_animated", 10),
        ("khr_alpha_mask", 0),
        ("khr_hierarchy_lights", 5),
        ("khr_texture_transform", 0),
        ("khr_transmission_spheres", 0),
        ("morph_stress_test", 12),
    ] {
        let Some(Loaded { scene, .. }) = shared(name) else { return };
        let options = RenderOptions { direct_samples: 8, ..RenderOptions::new(SIZE) };
        assert_same(device, &scene, frame, 1, &options);
    }
}

/// Columns of the contact sheet; each has a file's pictures by the GPU, by the CPU, and how far they differ.
const COLUMNS: u32 = 3;
const SHEET: Size = Size::new(128, 72);

#[test]
#[ignore = "all files of the shared folder: some minutes, and a contact sheet to look at"]
fn every_shared_file_has_the_cpus_picture() {
    let Some(device) = device() else { return };
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("gpu-files");
    std::fs::create_dir_all(&folder).unwrap();
    let files = std::fs::read_dir(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes")).unwrap();
    let mut names: Vec<String> = files
        .filter_map(|f| f.unwrap().file_name().into_string().ok()?.strip_suffix(".glb").map(str::to_owned))
        .collect();
    names.sort();
    let [width, height] = [SHEET.width as u32, SHEET.height as u32];
    let mut sheet = image::RgbImage::new(COLUMNS * 3 * width, (names.len() as u32).div_ceil(COLUMNS) * height);
    let mut wrong = Vec::new();
    for (number, name) in (0..).zip(&names) {
        let Some(Loaded { scene, .. }) = shared(name) else { return };
        let options = RenderOptions { direct_samples: 4, samples: 4, ..RenderOptions::new(SHEET) };
        let gpu = device.tracer(&scene, 10, 1);
        let ours = device.render(&gpu, &options).unwrap();
        let expected = gpu.tracer().render(&options, &Control::default()).unwrap();
        let both = [ours.frame.composite(), expected.frame.composite()];
        let mean = |p: &Plane<Rgb>| p.data().iter().map(|p| quell::luminance(*p)).sum::<f32>() / p.data().len() as f32;
        let light = mean(&both[0]) / mean(&both[1]).max(1e-12);
        let shares = agreement(&ours.frame, &expected.frame);
        println!("{number:2} {name}: light {light:.4}, {shares:.4?}");
        // Of four paths one may part.
        if (light - 1.0).abs() > 0.01 || shares.iter().any(|(_, share)| *share < 0.97) {
            wrong.push(name);
        }
        let exposure = 0.25 / mean(&both[1]).max(1e-9);
        let shown = |p: Rgb| image::Rgb(p.map(|v| ((v * exposure).clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0) as u8));
        let [left, top] = [number % COLUMNS * 3 * width, number / COLUMNS * height];
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let [a, b] = [0, 1].map(|i| both[i].at(x as usize, y as usize));
            let difference = [0, 1, 2].map(|c| (a[c] - b[c]).abs());
            for (column, colour) in (0..).zip([a, b, difference]) {
                sheet.put_pixel(left + column * width + x, top + y, shown(colour));
            }
        }
    }
    let path = folder.join("sheet.png");
    sheet.save(&path).unwrap();
    println!("GPU, CPU, difference of {} files, {COLUMNS} a row, in the order above: {}", names.len(), path.display());
    assert!(wrong.is_empty(), "other pictures: {wrong:?}");
}
