//! Determinism, scale, bad input.

use crate::scenes::{closed_box, lambert};
use glam::Vec3;
use quell::{Plane, Size};
use quell_trace::{
    CameraPath, Control, Half, Instance, PrimaryReplacement, ReferenceKind, RenderOptions, Scene, SceneError,
    TraceError, Tracer, builtin, scene_hash, shapes,
};
use std::sync::atomic::AtomicBool;

fn options(width: usize, height: usize) -> RenderOptions {
    RenderOptions { direct_samples: 4, ..RenderOptions::new(Size::new(width, height)) }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let scene = builtin("cornell-box").unwrap();
    let render = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let tracer = Tracer::new(&scene, 3, 2).unwrap();
            let options = RenderOptions { seed, jitter: true, ..options(67, 41) };
            tracer.render(&options, &Control::default()).unwrap().frame
        })
    };
    let one = render(1, 7);
    assert_eq!(one, render(2, 7));
    assert_ne!(one.matte, render(2, 8).matte);
}

/// Even samples are half A, odd ones half B; the frame is their mean; and they do not follow each other.
#[test]
fn halves_are_independent_and_make_the_frame() {
    let scene = builtin("cornell-box").unwrap();
    let tracer = Tracer::new(&scene, 0, 1).unwrap();
    let render = |samples: u32, halves: bool| {
        let options = RenderOptions { samples, halves, ..options(48, 27) };
        tracer.render(&options, &Control::default()).unwrap()
    };
    let both = render(4, true);
    let [a, b] = both.halves.unwrap();
    let matte = both.frame.matte.unwrap();
    let (mut covariance, mut variance) = (0.0, 0.0);
    let reference = render(256, false).frame.matte.unwrap();
    for (i, m) in matte.data().iter().enumerate() {
        let (x, y, r) = (a.matte.data()[i][1], b.matte.data()[i][1], reference.data()[i][1]);
        assert!((0.5 * (x + y) - m[1]).abs() <= 1e-5 * m[1].abs().max(1e-3), "{x} and {y} do not make {}", m[1]);
        covariance += (x - r) * (y - r);
        variance += 0.5 * ((x - r).powi(2) + (y - r).powi(2));
    }
    assert!(covariance.abs() < 0.1 * variance, "correlation {}", covariance / variance);
    assert!(render(1, true).halves.is_none() && render(4, false).halves.is_none());
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let scene = builtin("cornell-box").unwrap();
    let size = Size::new(48, 27);
    let picture = |scale: f32| {
        let scene = scene.scaled(scale);
        let tracer = Tracer::new(&scene, 0, 1).unwrap();
        let options = RenderOptions { samples: 4, ..options(size.width, size.height) };
        let frame = tracer.render(&options, &Control::default()).unwrap().frame;
        (frame.composite(), frame.view_depth.unwrap())
    };
    let (one, depth) = picture(1.0);
    for scale in [0.01, 100.0] {
        let (other, other_depth) = picture(scale);
        // Rounding sends a few paths another way; all others see the same to rounding.
        let far_off = one
            .data()
            .iter()
            .zip(other.data())
            .filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3 * (a[c].abs() + 0.01)))
            .count();
        assert!(far_off * 50 < size.pixels(), "{far_off} pixels of {} differ at scale {scale}", size.pixels());
        let same_depth =
            |(a, b): (&f32, &f32)| a.is_infinite() && b.is_infinite() || (b / scale / a - 1.0).abs() < 1e-3;
        let wrong = depth.data().iter().zip(other_depth.data()).filter(|p| !same_depth(*p)).count();
        assert!(wrong * 200 < size.pixels(), "{wrong} depths differ at scale {scale}");
    }
}

#[test]
fn bad_input_is_an_error() {
    let scene = builtin("cornell-box").unwrap();
    assert!(matches!(Tracer::new(&scene, 0, 0), Err(SceneError::UnknownCamera { count: 5, .. })));
    assert!(matches!(Tracer::new(&scene, 0, 6), Err(SceneError::UnknownCamera { .. })));
    let tracer = Tracer::new(&scene, 0, 1).unwrap();
    for (w, h) in [(0, 4), (4, 0), (1 << 20, 1)] {
        let error = tracer.render(&options(w, h), &Control::default()).unwrap_err();
        assert!(matches!(error, TraceError::Scene(SceneError::Size { .. })), "{error}");
    }
    let cancel = AtomicBool::new(true);
    let control = Control { cancel: Some(&cancel), progress: None };
    assert_eq!(tracer.render(&options(4, 4), &control).unwrap_err(), TraceError::Cancelled);

    let mut broken = closed_box(0.5, 1.0);
    broken.instances.push(Instance::fixed(3, 0));
    assert!(matches!(Tracer::new(&broken, 0, 1), Err(SceneError::Index { what: "mesh", index: 3, .. })));
    let mut broken = closed_box(0.5, 1.0);
    broken.meshes[0].triangles.push([0, 1, 99]);
    assert!(matches!(Tracer::new(&broken, 0, 1), Err(SceneError::Index { what: "vertex", index: 99, .. })));
    let mut broken = closed_box(0.5, 1.0);
    broken.meshes[0].positions[0].x = f32::NAN;
    assert!(matches!(Tracer::new(&broken, 0, 1), Err(SceneError::NotFinite { .. })));
    let mut broken = closed_box(0.5, 1.0);
    broken.cameras[0] = CameraPath::fixed(Vec3::ONE, Vec3::ONE, 40.0);
    assert!(matches!(Tracer::new(&broken, 0, 1), Err(SceneError::Camera { number: 1, .. })));
    assert!(Tracer::new(&broken, 0, 1).err().unwrap().to_string().contains("camera 1"));
}

#[test]
fn odd_scenes_give_pictures() {
    let camera = CameraPath::fixed(Vec3::ZERO, Vec3::NEG_Z, 60.0);
    // No geometry, no light.
    let mut empty = Scene::new("empty");
    empty.cameras.push(camera.clone());
    // Geometry, no light; a mesh without triangles; a triangle without area.
    let mut dark = closed_box(0.5, 0.0);
    dark.meshes.push(quell_trace::Mesh::default());
    dark.instances.push(Instance::fixed(1, 0));
    dark.meshes[0].triangles.push([0, 0, 0]);
    // The eye inside a solid wall, and exactly on a plane.
    let mut inside = Scene::new("inside");
    let surface = inside.surface(lambert(Vec3::ONE, Vec3::ONE));
    inside.place(shapes::cuboid(Vec3::splat(-1.0), Vec3::ONE), surface);
    inside.cameras.push(camera.clone());
    let mut on_plane = Scene::new("on a plane");
    let surface = on_plane.surface(lambert(Vec3::ONE, Vec3::ONE));
    on_plane.place(shapes::quad(Vec3::new(-1.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Z * 2.0), surface);
    on_plane.cameras.push(camera);
    for (scene, black) in [(&empty, true), (&dark, true), (&inside, true), (&on_plane, false)] {
        let tracer = Tracer::new(scene, 0, 1).unwrap();
        for (w, h) in [(1, 1), (1, 7), (5, 1), (8, 8)] {
            let rendered = tracer.render(&options(w, h), &Control::default()).unwrap();
            rendered.frame.frame(&[]).check(Size::new(w, h)).unwrap();
            let picture = rendered.frame.composite();
            assert!(picture.data().iter().flatten().all(|v| v.is_finite()), "{}", scene.name);
            if black {
                // Not exactly 0: rounding may lift a point above the plane of its own emissive wall.
                assert!(picture.data().iter().flatten().all(|v| *v < 1e-4), "{}", scene.name);
            }
        }
    }
    let tracer = Tracer::new(&dark, 0, 1).unwrap();
    let notes = tracer.render(&options(2, 2), &Control::default()).unwrap().notes;
    assert!(notes.iter().any(|n| n.contains("no light")));
    assert_eq!(tracer.degenerate_triangles(), 1);
}

#[test]
fn references_are_resumable_and_halves_differ() {
    let scene = builtin("cornell-box").unwrap();
    let tracer = Tracer::new(&scene, 0, 1).unwrap();
    let options = options(12, 8);
    for kind in [ReferenceKind::Factored, ReferenceKind::FullIntegral] {
        let part = |half, range| tracer.reference(&options, kind, half, range, &Control::default()).unwrap();
        let whole = part(Half::A, 0..24);
        let mut joined = part(Half::A, 0..16);
        joined.merge(&part(Half::A, 16..24)).unwrap();
        let close = |a: &Plane<[f32; 3]>, b: &Plane<[f32; 3]>| {
            a.data().iter().flatten().zip(b.data().iter().flatten()).all(|(a, b)| (a - b).abs() <= 2e-4 * a.abs())
        };
        assert_eq!(joined.samples, 24);
        assert!(close(&whole.beauty, &joined.beauty) && close(&whole.variance, &joined.variance));
        assert!(close(&whole.matte, &joined.matte) && close(&whole.glossy, &joined.glossy));
        assert_ne!(whole.beauty, part(Half::B, 0..24).beauty);
    }
    let mut other = tracer.reference(&options, ReferenceKind::Factored, Half::A, 0..1, &Control::default()).unwrap();
    let full = tracer.reference(&options, ReferenceKind::FullIntegral, Half::A, 0..1, &Control::default()).unwrap();
    assert!(other.merge(&full).is_err());
}

/// What anti-aliasing over time tends to: as the mean over blocks of a picture eight times as large.
#[test]
fn references_of_jittered_frames_are_means_over_pixels() {
    let scene = builtin("thin-things").unwrap();
    let tracer = Tracer::new(&scene, 0, 1).unwrap();
    let (width, height, times) = (32, 18, 8);
    let picture = |options: RenderOptions, samples: u32| {
        tracer.reference(&options, ReferenceKind::Factored, Half::A, 0..samples, &Control::default()).unwrap().beauty
    };
    let large = picture(options(width * times, height * times), 4);
    let mean = Plane::from_fn(Size::new(width, height), |x, y| {
        let mut sum = [0.0; 3];
        for (j, i) in (0..times).flat_map(|j| (0..times).map(move |i| (j, i))) {
            let colour = large.at(x * times + i, y * times + j);
            sum = std::array::from_fn(|c| sum[c] + colour[c] / (times * times) as f32);
        }
        sum
    });
    let apart = |options: RenderOptions| {
        let found = picture(options, 256);
        let pairs = found.data().iter().flatten().zip(mean.data().iter().flatten());
        let total: f32 = mean.data().iter().flatten().sum();
        pairs.map(|(a, b)| (a - b).abs()).sum::<f32>() / total
    };
    let centres = apart(options(width, height));
    let area = apart(RenderOptions { jitter: true, ..options(width, height) });
    println!("{centres} and {area} of the light apart");
    assert!(area < 0.4 * centres, "{centres} {area}");
}

#[test]
fn hashes_tell_scenes_and_options_apart() {
    let scene = builtin("cornell-box").unwrap();
    let options = options(12, 8);
    let hash = scene_hash(&scene, &options);
    assert_eq!(hash, scene_hash(&builtin("cornell-box").unwrap(), &options));
    assert_ne!(hash, scene_hash(&scene, &RenderOptions { bounces: 2, ..options }));
    assert_ne!(hash, scene_hash(&scene, &RenderOptions { seed: 1, ..options }));
    // Whether mirrors are looked into matters where there are any.
    let without = RenderOptions { primary_replacement: PrimaryReplacement::Glass, ..options };
    assert_eq!(hash, scene_hash(&scene, &without));
    let hall = builtin("mirror-hall").unwrap();
    assert_ne!(scene_hash(&hall, &options), scene_hash(&hall, &without));
    let mut other = scene.clone();
    other.identity ^= 1;
    assert_ne!(hash, scene_hash(&other, &options));
}
