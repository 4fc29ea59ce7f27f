//! Bad input: every error names the thing, nothing panics.

use super::frames::*;
use proptest::prelude::*;
use quell::sequence::{Filtered, Light, LightKind, SequenceDenoiser, SequenceFrame, SequenceSettings};
use quell::{Camera, Denoiser, Error, Frame, Plane, PlaneRef, Preset, Rgb, Settings, Signal, Size};
use std::sync::Arc;

const SIZE: Size = Size::new(8, 6);

fn camera() -> Camera {
    Camera::perspective([0.0, 0.0, 3.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 4.0 / 3.0)
}

fn message(result: Result<(), Error>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn a_plane_of_another_extent_is_named_with_both_extents() {
    let other = Size::new(8, 7);
    let (colour, scalar) = (Plane::filled(other, [0.0; 3]), Plane::filled(other, 1.0f32));
    let (vector, id) = (Plane::filled(other, [0.0f32; 2]), Plane::filled(other, 0u32));
    let passes = [quell::Pass { name: "key light", signal: Signal::Matte, plane: colour.view() }];
    let good = Plane::filled(SIZE, [0.0; 3]);
    type Put<'a> = Box<dyn Fn(&mut Frame<'a>) + 'a>;
    let cases: Vec<(&str, Put<'_>)> = vec![
        ("direct", Box::new(|f| f.direct = Some(colour.view()))),
        ("matte", Box::new(|f| f.matte = Some(colour.view()))),
        ("glossy", Box::new(|f| f.glossy = Some(colour.view()))),
        ("direct_matte", Box::new(|f| f.direct_matte = Some(colour.view()))),
        ("direct_glossy", Box::new(|f| f.direct_glossy = Some(colour.view()))),
        ("matte_weight", Box::new(|f| f.matte_weight = Some(colour.view()))),
        ("glossy_weight", Box::new(|f| f.glossy_weight = Some(colour.view()))),
        ("view_depth", Box::new(|f| f.view_depth = Some(scalar.view()))),
        ("normal", Box::new(|f| f.normal = Some(colour.view()))),
        ("roughness", Box::new(|f| f.roughness = Some(scalar.view()))),
        ("motion", Box::new(|f| f.motion = Some(vector.view()))),
        ("glossy_hit_distance", Box::new(|f| f.glossy_hit_distance = Some(scalar.view()))),
        ("matte_hit_distance", Box::new(|f| f.matte_hit_distance = Some(scalar.view()))),
        ("surface_id", Box::new(|f| f.surface_id = Some(id.view()))),
        ("alpha", Box::new(|f| f.alpha = Some(scalar.view()))),
        ("matte_variance", Box::new(|f| f.matte_variance = Some(scalar.view()))),
        ("glossy_variance", Box::new(|f| f.glossy_variance = Some(scalar.view()))),
        ("confidence_in", Box::new(|f| f.confidence_in = Some(scalar.view()))),
        ("key light", Box::new(|f| f.passes = &passes)),
        ("frame", Box::new(|f| f.size = other)),
    ];
    for (name, put) in &cases {
        let mut frame = Frame::new(SIZE, camera());
        frame.matte = Some(good.view());
        assert!(frame.check(SIZE).is_ok());
        put(&mut frame);
        let text = message(frame.check(SIZE));
        assert!(text.contains(&format!("`{name}`")) && text.contains("8x7") && text.contains("8x6"), "{name}: {text}");
        for backend in BACKENDS {
            let mut denoiser = Denoiser::with_backend(SIZE, &Settings::default(), backend).unwrap();
            assert_eq!(denoiser.denoise(&frame).unwrap_err().to_string(), text);
        }
    }
}

#[test]
fn a_frame_that_cannot_be_used_says_why() {
    let plane = Plane::filled(SIZE, [0.5; 3]);
    let passes = [quell::Pass { name: "rim", signal: Signal::Glossy, plane: plane.view() }];
    let frame = || {
        let mut f = Frame::new(SIZE, camera());
        f.matte = Some(plane.view());
        f
    };
    let text = message(Frame { passes: &passes, ..frame() }.check(SIZE));
    assert!(text.contains("`rim`") && text.contains("glossy"), "{text}");
    let mut singular = camera();
    singular.clip_from_world = [0.0; 16];
    let mut endless = camera();
    endless.clip_from_world[5] = f32::INFINITY;
    let mut astray = camera();
    astray.position[1] = f32::NAN;
    let mut shaken = camera();
    shaken.jitter = [f32::NAN, 0.0];
    for bad in [singular, endless, astray, shaken] {
        let text = message(Frame { camera: bad, ..frame() }.check(SIZE));
        assert!(text.starts_with("camera "), "{text}");
        let text = message(Frame { previous_camera: bad, ..frame() }.check(SIZE));
        assert!(text.starts_with("previous_camera "), "{text}");
    }
    let text = message(frame().check(Size::new(0, 6)));
    assert!(text.contains("0x6"), "{text}");
}

#[test]
fn a_denoiser_that_cannot_be_made_says_why() {
    let make = |size, settings: &Settings| message(Denoiser::new(size, settings).map(|_| ()));
    let default = Settings::default();
    for (size, part) in [
        (Size::new(0, 5), "0x5"),
        (Size::new(5, 0), "5x0"),
        (Size::new(40_000, 2), "40000x2"),
        (Size::new(1, usize::MAX), "at most 32768"),
    ] {
        let text = make(size, &default);
        assert!(text.contains(part), "{text}");
    }
    let mut wrong = Settings::default();
    wrong.matte_temporal.alpha = 1.5;
    let text = make(SIZE, &wrong);
    assert!(text.contains("matte_temporal.alpha") && text.contains("1.5") && text.contains("0.999"), "{text}");
    wrong = Settings::default();
    wrong.glossy_bilateral.sigma = f32::NAN;
    let text = make(SIZE, &wrong);
    assert!(text.contains("glossy_bilateral.sigma") && text.contains("NaN"), "{text}");
    let text = "none".parse::<Preset>().unwrap_err().to_string();
    assert!(text.contains("`none`") && text.contains("paper"), "{text}");
}

#[test]
fn a_slice_that_does_not_hold_its_rows_is_refused() {
    let data = [0.0f32; 20];
    for (width, height, stride, len) in [(5, 4, 5, 19), (5, 4, 4, 20), (5, 3, 8, 20), (5, 4, usize::MAX, 20)] {
        let text = PlaneRef::new(&data[..len], Size::new(width, height), stride).unwrap_err().to_string();
        let parts = [format!("{width}x{height}"), stride.to_string(), len.to_string()];
        assert!(parts.iter().all(|p| text.contains(p)), "{text}");
    }
    // The last row needs no padding.
    assert!(PlaneRef::new(&data[..19], Size::new(5, 3), 7).is_ok());
    assert!(PlaneRef::new(&data[..18], Size::new(5, 3), 7).is_err());
    assert!(matches!(PlaneRef::new(&data, Size::new(0, 3), 7), Err(Error::EmptySize { .. })));
    assert!(Plane::from_vec(Size::new(3, 3), vec![0u8; 8]).is_err());
}

#[test]
fn strides_and_padding_change_nothing() {
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let size = Size::new(21, 13);
    let frames = sequence(&scene, size, 2);
    const STRIDE: usize = 24;
    fn padded<T: Copy>(plane: &Plane<T>, poison: T) -> Vec<T> {
        let mut out = Vec::new();
        for y in 0..plane.size().height {
            out.extend_from_slice(plane.row(y));
            out.resize((y + 1) * STRIDE, poison);
        }
        out
    }
    for backend in BACKENDS {
        let expected = run(backend, &Settings::default(), &frames);
        let mut denoiser = Denoiser::with_backend(size, &Settings::default(), backend).unwrap();
        let mut found = None;
        for f in &frames {
            let matte = padded(f.matte.as_ref().unwrap(), [f32::NAN; 3]);
            let glossy = padded(f.glossy.as_ref().unwrap(), [f32::NAN; 3]);
            let depth = padded(f.view_depth.as_ref().unwrap(), f32::NAN);
            let mut frame = f.frame(&[]);
            frame.matte = Some(PlaneRef::new(&matte, size, STRIDE).unwrap());
            frame.glossy = Some(PlaneRef::new(&glossy, size, STRIDE).unwrap());
            frame.view_depth = Some(PlaneRef::new(&depth, size, STRIDE).unwrap());
            let output = denoiser.denoise(&frame).unwrap();
            assert!(output.report.sanitised.is_empty());
            found = Some(output.composite.clone());
        }
        assert_eq!(found.unwrap(), expected.composite);
    }
}

/// Ordinary and extreme values, chosen by a number.
fn value(u: u32) -> f32 {
    const EXTREME: [f32; 16] = [
        0.0,
        -0.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
        1e-45,
        -1e-45,
        1e20,
        -1e20,
        1e-20,
        16_777_217.0,
        -1.0,
        1.0,
    ];
    if u & 3 == 0 { EXTREME[(u >> 2) as usize % 16] } else { (u % 1000) as f32 * 0.004 }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_panics(
        width in 1usize..=67,
        height in 1usize..=67,
        pad in 0usize..5,
        seed in any::<u32>(),
        present in any::<u32>(),
        changes in proptest::collection::vec((0usize..quell::settings::PARAMETERS.len(), 0usize..5), 0..6),
        index in prop_oneof![Just(0i64), Just(i64::MAX), Just(i64::MIN), Just(-1)],
    ) {
        let size = Size::new(width, height);
        let stride = width + pad;
        let mut settings = Settings::default();
        for (p, sample) in changes {
            let p = &quell::settings::PARAMETERS[p];
            let samples = p.samples();
            settings.set(p.name, &samples[sample % samples.len()]).unwrap();
        }
        // The largest kernels cost seconds here and add nothing to what can go wrong.
        for radius in [&mut settings.matte_prefilter.radius, &mut settings.matte_bilateral.radius] {
            *radius = radius.min(100.0);
        }
        let number = |plane: u32, i: usize| value((hash([i as u32, plane, seed, 0]) * 4_294_967_295.0) as u32);
        let scalar = |plane: u32| (0..stride * height).map(|i| number(plane, i)).collect::<Vec<f32>>();
        let colour = |plane: u32| -> Vec<Rgb> {
            (0..stride * height).map(|i| [0, 1, 2].map(|c| number(plane + 100 * (c + 1), i))).collect()
        };
        let (direct, matte, glossy, weight) = (colour(1), colour(2), colour(3), colour(4));
        let (normal, pass) = (colour(5), colour(6));
        let (depth, roughness, hit, trust) = (scalar(7), scalar(8), scalar(9), scalar(10));
        let motion: Vec<[f32; 2]> = colour(11).iter().map(|c| [c[0], c[1]]).collect();
        let ids: Vec<u32> = (0..stride * height).map(|i| i as u32 % 3).collect();
        let passes = [quell::Pass { name: "p", signal: Signal::Matte, plane: PlaneRef::new(&pass, size, stride).unwrap() }];
        let has = |bit: u32| present >> bit & 1 == 1;
        let mut frame = Frame::new(size, camera());
        frame.index = index;
        if has(0) { frame.direct = Some(PlaneRef::new(&direct, size, stride).unwrap()); }
        if has(1) {
            frame.matte = Some(PlaneRef::new(&matte, size, stride).unwrap());
            if has(12) { frame.passes = &passes; }
        }
        if has(2) { frame.glossy = Some(PlaneRef::new(&glossy, size, stride).unwrap()); }
        if has(3) { frame.matte_weight = Some(PlaneRef::new(&weight, size, stride).unwrap()); }
        if has(4) { frame.normal = Some(PlaneRef::new(&normal, size, stride).unwrap()); }
        if has(5) { frame.view_depth = Some(PlaneRef::new(&depth, size, stride).unwrap()); }
        if has(6) { frame.roughness = Some(PlaneRef::new(&roughness, size, stride).unwrap()); }
        if has(7) { frame.glossy_hit_distance = Some(PlaneRef::new(&hit, size, stride).unwrap()); }
        if has(8) { frame.confidence_in = Some(PlaneRef::new(&trust, size, stride).unwrap()); }
        if has(9) { frame.motion = Some(PlaneRef::new(&motion, size, stride).unwrap()); }
        if has(10) { frame.surface_id = Some(PlaneRef::new(&ids, size, stride).unwrap()); }
        if has(11) { frame.camera.jitter = [0.3, -0.4]; }
        for backend in BACKENDS {
            let mut denoiser = Denoiser::with_backend(size, &settings, backend).unwrap();
            for _ in 0..3 {
                let output = denoiser.denoise(&frame).unwrap();
                prop_assert!(output.confidence.data().iter().all(|c| (0.0..=1.0).contains(c)));
                prop_assert!(output.history_length.data().iter().all(|n| *n >= 1.0));
                // The composite alone may overflow: weight times light is the host's own arithmetic.
                for signal in [output.matte, output.glossy].into_iter().flatten() {
                    prop_assert!(signal.data().iter().flatten().all(|v| v.is_finite()), "not finite");
                }
                frame.index = if frame.index == i64::MAX { i64::MAX - 1 } else { frame.index + 1 };
            }
        }
    }
}

/// Numbers 0..1 that look random.
fn speckle(x: usize, y: usize, t: i64, k: u32) -> f32 {
    hash([x as u32, y as u32, t as u32, k]) as f32
}

/// A wall before which the camera slides by two pixels a frame, part of it a mirror: every plane is there.
fn sequence_frame(t: i64) -> SequenceFrame {
    const SIZE: Size = Size::new(24, 16);
    let plane = |k: u32, low: f32| Plane::from_fn(SIZE, |x, y| [low + 0.5 * speckle(x, y, t, k); 3]);
    let mirror = |x: usize| x > 14;
    let albedo = Plane::from_fn(SIZE, |x, y| [if mirror(x) { 0.0 } else { 0.2 + 0.5 * speckle(x, y, 0, 1) }; 3]);
    let mut matte = Light::new("matte", LightKind::MatteIndirect, plane(2, 0.0));
    matte.weight = Some(Arc::new(albedo.clone()));
    matte.joint = vec![plane(3, 0.0)];
    let lights = vec![
        matte,
        Light::new("glossy", LightKind::GlossyIndirect, plane(4, 0.0)),
        Light::new("beauty", LightKind::Beauty, plane(5, 0.0)),
    ];
    SequenceFrame {
        lights,
        depth: Some(Plane::from_fn(SIZE, |x, y| 4.0 + 0.02 * speckle(x, y, t, 6))),
        normal: Some(Plane::from_fn(SIZE, |x, y| {
            let a = 0.3 * speckle(x, y, t, 7);
            [a.sin(), 0.0, a.cos()]
        })),
        position: Some(Plane::from_fn(SIZE, |x, y| [(x as f32 + 2.0 * t as f32) * 0.1, y as f32 * -0.1, 0.0])),
        motion_to_previous: Some(Plane::filled(SIZE, [2.0, 0.0])),
        motion_to_next: Some(Plane::filled(SIZE, [-2.0, 0.0])),
        albedo: Some(albedo),
        seen_albedo: Some(plane(8, 0.2)),
        seen_normal: Some(Plane::filled(SIZE, [0.0, 1.0, 0.0])),
        roughness: Some(Plane::filled(SIZE, 0.3)),
        alpha: Some(Plane::filled(SIZE, 0.8)),
        variance: Some(Plane::filled(SIZE, 0.1)),
        ..SequenceFrame::new(t, SIZE)
    }
}

#[test]
fn every_plane_of_a_sequence_frame_matters_or_is_listed() {
    /// Planes that the sequence filter does not read; a stage that does takes them off the list.
    const NOT_READ: [&str; 1] = ["roughness"];
    type Change = fn(&mut SequenceFrame);
    fn plane<T: Copy>(size: Size, f: impl Fn(f32) -> T) -> Option<Plane<T>> {
        Some(Plane::from_fn(size, |x, y| f(speckle(x, y, 0, 77))))
    }
    // A field more than these does not compile: it needs a line below.
    let SequenceFrame {
        number: _,
        size: _,
        lights: _,
        depth: _,
        normal: _,
        position: _,
        motion_to_previous: _,
        motion_to_next: _,
        camera_motion: _,
        albedo: _,
        seen_albedo: _,
        seen_normal: _,
        roughness: _,
        alpha: _,
        variance: _,
        repeats_noise: _,
    } = sequence_frame(0);
    let changes: &[(&str, Change)] = &[
        ("number", |f| f.number += 20),
        ("light", |f| f.lights[0].light = plane(f.size, |u| [u; 3]).unwrap()),
        ("kind", |f| f.lights[0].kind = LightKind::MatteDirect),
        ("weight", |f| f.lights[0].weight = plane(f.size, |u| [u; 3]).map(Arc::new)),
        ("joint", |f| f.lights[0].joint[0] = plane(f.size, |u| [u; 3]).unwrap()),
        ("in_beauty", |f| f.lights[0].in_beauty = false),
        ("depth", |f| f.depth = plane(f.size, |u| 4.0 + u)),
        ("normal", |f| f.normal = plane(f.size, |u| [u.sin(), 0.0, u.cos()])),
        ("position", |f| f.position = plane(f.size, |u| [u, 0.0, 0.0])),
        ("motion_to_previous", |f| f.motion_to_previous = plane(f.size, |u| [u, 0.0])),
        ("motion_to_next", |f| f.motion_to_next = plane(f.size, |u| [u, 0.0])),
        ("camera_motion", |f| f.camera_motion = true),
        ("albedo", |f| f.albedo = plane(f.size, |u| [u; 3])),
        ("seen_albedo", |f| f.seen_albedo = plane(f.size, |u| [u; 3])),
        ("seen_normal", |f| f.seen_normal = plane(f.size, |u| [u.sin(), u.cos(), 0.0])),
        ("roughness", |f| f.roughness = plane(f.size, |u| u)),
        ("alpha", |f| f.alpha = plane(f.size, |u| u)),
        ("variance", |f| f.variance = plane(f.size, |u| u)),
        ("repeats_noise", |f| f.repeats_noise = true),
    ];
    let run = |change: Change| {
        let mut denoiser = SequenceDenoiser::new(SequenceSettings::default()).unwrap();
        let mut out: Vec<Filtered> = Vec::new();
        for t in 0..5 {
            let mut frame = sequence_frame(t);
            if t == 2 {
                change(&mut frame);
            }
            out.extend(denoiser.push(frame, true).unwrap());
        }
        out.extend(denoiser.finish().unwrap());
        out
    };
    // What comes out beside the pictures does not count, nor what was put in.
    let pictures = |out: Vec<Filtered>| -> Vec<_> {
        out.into_iter().map(|f| (f.lights.into_iter().map(|l| l.planes).collect::<Vec<_>>(), f.alpha)).collect()
    };
    let base = pictures(run(|_| ()));
    let idle: Vec<&str> =
        changes.iter().filter(|(_, change)| pictures(run(*change)) == base).map(|(name, _)| *name).collect();
    assert_eq!(idle, NOT_READ);
}
