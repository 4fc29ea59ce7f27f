//! The sequence filter: properties, and what it must never do.

use quell::sequence::{
    Filtered, Light, LightKind, PreparedFrame, SEQUENCE_PARAMETERS, SequenceDenoiser, SequenceFrame, SequenceSettings,
    SpooledFrame,
};
use quell::{Plane, Rgb, Size};
use std::io::Cursor;
use std::sync::Arc;

const SIZE: Size = Size::new(48, 27);
const SPEED: f32 = 1.3;

/// Numbers 0..1 that look random, from integers.
fn random(x: usize, y: usize, t: i64, k: u64) -> f32 {
    let mut h = (x as u64) ^ (y as u64) << 16 ^ (t as u64) << 32 ^ k << 56;
    for _ in 0..3 {
        h = (h ^ (h >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}

/// The light on a wall before which the camera slides: bright on the right of a straight shadow edge.
fn truth(x: f32, t: i64) -> f32 {
    if x + SPEED * t as f32 > 30.0 { 1.0 } else { 0.2 }
}

/// A wall at depth 4, one path in five lit, moving to the left.
fn frame(t: i64) -> SequenceFrame {
    let mut frame = SequenceFrame::new(t, SIZE);
    let noisy = |k: u64| {
        move |x: usize, y: usize| -> Rgb {
            let lit = if random(x, y, t, k) < 0.2 { 5.0 } else { 0.0 };
            [1.0, 0.8, 0.5].map(|c| c * lit * truth(x as f32, t))
        }
    };
    let mut matte = Light::new("matte", LightKind::MatteDirect, Plane::from_fn(SIZE, noisy(1)));
    matte.weight = Some(Arc::new(Plane::from_fn(SIZE, |x, y| [0.3 + 0.5 * random(x, y, 0, 9); 3])));
    let half = |plane: &Plane<Rgb>, share: f32| Plane::from_fn(SIZE, |x, y| plane.at(x, y).map(|c| c * share));
    matte.joint = vec![half(&matte.light, 0.25), half(&matte.light, 0.75)];
    let glossy = Light::new("glossy", LightKind::GlossyIndirect, Plane::from_fn(SIZE, noisy(2)));
    let steady = Light::new("emission", LightKind::NoiseFree, Plane::from_fn(SIZE, |x, _| [x as f32 * 0.01; 3]));
    frame.lights = vec![matte, glossy, steady];
    frame.depth = Some(Plane::filled(SIZE, 4.0));
    frame.normal = Some(Plane::filled(SIZE, [0.0, 0.0, 1.0]));
    let position = |x: usize, y: usize| [(x as f32 + SPEED * t as f32) * 0.1, y as f32 * -0.1, 0.0];
    frame.position = Some(Plane::from_fn(SIZE, position));
    frame.motion_to_previous = Some(Plane::filled(SIZE, [SPEED, 0.0]));
    frame.motion_to_next = Some(Plane::filled(SIZE, [-SPEED, 0.0]));
    frame
}

fn settings(changes: &[(&str, &str)]) -> SequenceSettings {
    let mut settings = SequenceSettings::default();
    for (name, value) in changes {
        settings.set(name, value).unwrap();
    }
    settings
}

fn run(settings: &SequenceSettings, frames: impl IntoIterator<Item = SequenceFrame>) -> Vec<Filtered> {
    let mut denoiser = SequenceDenoiser::new(settings.clone()).unwrap();
    let mut out = Vec::new();
    for frame in frames {
        out.extend(denoiser.push(frame, true).unwrap());
    }
    out.extend(denoiser.finish().unwrap());
    out
}

/// Mean square error of the matte light over all frames.
fn error(out: &[Filtered]) -> f64 {
    let pixels = out.iter().flat_map(|f| {
        f.lights[0].planes[0].data().iter().enumerate().map(|(i, c)| c[0] - truth((i % SIZE.width) as f32, f.number))
    });
    let (sum, n) = pixels.fold((0.0, 0), |(s, n), d| (s + f64::from(d * d), n + 1));
    sum / f64::from(n)
}

#[test]
fn noise_goes_and_a_shadow_edge_stays() {
    let noisy: f64 = error(&run(
        &settings(&[("gather.frames", "0"), ("wavelet.levels", "0"), ("stabilise.frames", "0")]),
        (0..8).map(frame),
    ));
    let both = run(&settings(&[]), (0..8).map(frame));
    assert!(error(&both) * 60.0 < noisy, "{} of {noisy}", error(&both));
    // The first frame is as clean as the rest.
    assert!(error(&both[..1]) < 3.0 * error(&both), "{} {}", error(&both[..1]), error(&both));
    // Each part does its share: the canaries of the line above.
    for off in [("gather.frames", "0"), ("wavelet.levels", "0")] {
        assert!(error(&run(&settings(&[off]), (0..8).map(frame))) > 2.0 * error(&both), "{off:?}");
    }
    // Three pixels from the edge nothing of the other side is left.
    let f = &both[4];
    let edge = 30.0 - SPEED * 4.0;
    for y in 8..20 {
        for (x, expected) in [(edge as usize - 3, 0.2), (edge as usize + 4, 1.0)] {
            let found = f.lights[0].planes[0].at(x, y)[0];
            assert!((found - expected).abs() < 0.3, "{found} for {expected} at {x}, {y}");
        }
    }
}

#[test]
fn energy_is_kept() {
    let out = run(&settings(&[]), (0..10).map(frame));
    let mean = |of: &dyn Fn(usize, i64) -> f32| -> f64 {
        let sum: f64 =
            (0..10i64).flat_map(|t| (0..SIZE.pixels()).map(move |i| (i, t))).map(|(i, t)| f64::from(of(i, t))).sum();
        sum / (10 * SIZE.pixels()) as f64
    };
    let filtered = mean(&|i, t| out[t as usize].lights[0].planes[0].data()[i][0]);
    let inputs: Vec<_> = (0..10).map(frame).collect();
    let noisy = mean(&|i, t| inputs[t as usize].lights[0].light.data()[i][0]);
    assert!((filtered / noisy - 1.0).abs() < 0.03, "{filtered} of {noisy}");
}

/// `stabilise` and the kernels of `blend` scale all passes alike, noise-free ones too, so that they add up; without both these are untouched.
#[test]
fn joint_planes_add_up_and_noise_free_light_is_untouched() {
    let off = [("stabilise.frames", "0"), ("blend.kernel", "0")];
    for (set, untouched) in [(&off[..], true), (&off[..1], false), (&[], false)] {
        let out = run(&settings(set), (0..4).map(frame));
        for f in &out {
            for i in 0..SIZE.pixels() {
                let planes = &f.lights[0].planes;
                for c in 0..3 {
                    let (whole, parts) = (planes[0].data()[i][c], planes[1].data()[i][c] + planes[2].data()[i][c]);
                    // Half precision in the window rounds each by up to 2^-11 of itself.
                    assert!((whole - parts).abs() <= 5e-4 * whole.abs() + 1e-6, "{whole} {parts}");
                }
            }
            assert_eq!(f.lights[2].planes[0] == frame(f.number).lights[2].light, untouched, "{set:?}");
        }
    }
}

/// Colours wait in half precision; those that do not fit in it, in full: a frame a million times as bright is exact.
#[test]
fn half_precision_in_the_window_does_no_harm() {
    const SCALE: f32 = (1 << 20) as f32;
    let bright = |t: i64| {
        let mut f = frame(t);
        for plane in f.lights.iter_mut().flat_map(|l| std::iter::once(&mut l.light).chain(&mut l.joint)) {
            plane.data_mut().iter_mut().for_each(|c| *c = c.map(|v| v * SCALE));
        }
        f
    };
    let (half, full) = (run(&settings(&[]), (0..6).map(frame)), run(&settings(&[]), (0..6).map(bright)));
    let (mut worst, mut differs) = (0.0f32, false);
    for (half, full) in half.iter().zip(&full).flat_map(|(a, b)| a.lights.iter().zip(&b.lights)) {
        for (a, b) in half.planes[0].data().iter().flatten().zip(full.planes[0].data().iter().flatten()) {
            let b = b / SCALE;
            worst = worst.max((a - b).abs() / (b.abs() + 0.01));
            differs |= *a != b;
        }
    }
    assert!(worst < 2e-3, "{worst}");
    // The comparison can fail.
    assert!(differs);
}

/// A beauty of uneven noise whose variance the renderer gives: kernels that are sized by it are no worse.
#[test]
fn variance_that_the_renderer_gives_does_no_harm() {
    let amplitude = |x: usize| if x < SIZE.width / 2 { 0.2 } else { 0.9 };
    let truth = |x: usize, y: usize| 1.0 + 0.3 * ((x / 6 + y / 6) % 2) as f32;
    let noise = |x: usize, y: usize, t: i64, k: u64| amplitude(x) * 12f32.sqrt() * (random(x, y, t, k) - 0.5);
    // Two halves of the samples, and what of the variance of their mean is given with it.
    let frame = |t: i64, given: &str| {
        let mut f = frame(0);
        f.number = t;
        f.position = None;
        f.motion_to_previous = Some(Plane::filled(SIZE, [0.0; 2]));
        f.motion_to_next = f.motion_to_previous.clone();
        let half = |x: usize, y: usize, k: u64| truth(x, y) * (1.0 + noise(x, y, t, k));
        let mean = Plane::from_fn(SIZE, |x, y| [0.5 * (half(x, y, 1) + half(x, y, 2)); 3]);
        f.lights = vec![Light::new("beauty", LightKind::Beauty, mean)];
        let difference = |x: usize, y: usize| 0.25 * (half(x, y, 1) - half(x, y, 2)).powi(2);
        f.variance = match given {
            "variance" => Some(Plane::from_fn(SIZE, |x, y| 0.5 * (truth(x, y) * amplitude(x)).powi(2))),
            "halves" => Some(Plane::from_fn(SIZE, |x, y| {
                let near = (y.saturating_sub(2)..(y + 3).min(SIZE.height))
                    .flat_map(|v| (x.saturating_sub(2)..(x + 3).min(SIZE.width)).map(move |u| (u, v)));
                let (sum, n) = near.fold((0.0, 0.0), |(s, n), (u, v)| (s + difference(u, v), n + 1.0));
                sum / n
            })),
            _ => None,
        };
        f
    };
    let error = |frames: i64, given: &str| -> f64 {
        let out = run(&settings(&[]), (0..frames).map(|t| frame(t, given)));
        let planes = out.iter().flat_map(|f| f.lights[0].planes[0].data().iter().enumerate());
        planes.map(|(i, c)| f64::from(c[0] - truth(i % SIZE.width, i / SIZE.width)).powi(2)).sum::<f64>()
            / frames as f64
    };
    for frames in [1, 5] {
        let without = error(frames, "nothing");
        for given in ["variance", "halves"] {
            let with = error(frames, given);
            assert!(with <= without * 1.01, "{frames} frames, {given}: {with} for {without}");
        }
    }
}

#[test]
fn any_split_gives_the_same_bits() {
    let settings = settings(&[("gather.frames", "3"), ("stabilise.frames", "1")]);
    let whole = run(&settings, (0..12).map(frame));
    let reach = SequenceDenoiser::new(settings.clone()).unwrap().reach() as i64;
    assert_eq!(reach, 4);
    for (from, to) in [(0, 4), (5, 5), (6, 11)] {
        let mut denoiser = SequenceDenoiser::new(settings.clone()).unwrap();
        let mut part = Vec::new();
        for t in (from - reach).max(0)..=(to + reach).min(11) {
            part.extend(denoiser.push(frame(t), (from..=to).contains(&t)).unwrap());
        }
        part.extend(denoiser.finish().unwrap());
        assert_eq!(part, whole[from as usize..=to as usize], "{from} to {to}");
    }
    // Canary: one frame too few around it shows.
    let short = run(&settings, (5 - reach + 1..=5 + reach).map(frame));
    assert_ne!(short[(reach - 1) as usize], whole[5]);
}

#[test]
fn the_past_alone_does_not_know_the_future() {
    let settings = settings(&[("gather.future", "off")]);
    let out = run(&settings, (0..6).map(frame));
    let mut changed: Vec<_> = (0..6).map(frame).collect();
    changed[5].lights[0].light = Plane::filled(SIZE, [9.0; 3]);
    let other = run(&settings, changed);
    assert_eq!(out[..5], other[..5]);
    assert_ne!(out[5], other[5]);
}

#[test]
fn a_gap_is_a_cut() {
    let with_gap = run(&settings(&[]), [0, 1, 2, 7, 8].map(frame));
    assert_eq!(with_gap[..3], run(&settings(&[]), (0..3).map(frame))[..]);
    assert_eq!(with_gap[3..], run(&settings(&[]), (7..9).map(frame))[..]);
}

#[test]
fn motion_to_the_next_frame_is_found_where_the_file_has_none() {
    let without = |t| SequenceFrame { motion_to_next: None, ..frame(t) };
    let (with, derived) = (run(&settings(&[]), (0..6).map(frame)), run(&settings(&[]), (0..6).map(without)));
    assert!(error(&derived) < 1.5 * error(&with), "{} {}", error(&derived), error(&with));
    let none = |t| SequenceFrame { motion_to_next: None, motion_to_previous: None, ..frame(t) };
    assert!(error(&run(&settings(&[]), (0..6).map(none))) > 1.5 * error(&with));
}

#[test]
fn motion_that_is_unknown_in_places_is_found_in_the_next_frame() {
    let partly = |t| {
        let mut f = frame(t);
        if let Some(motion) = &mut f.motion_to_next {
            (0..SIZE.height).for_each(|y| (0..30).for_each(|x| motion.set(x, y, [f32::NAN; 2])));
        }
        f
    };
    // The first frame has no past: there the light comes from the frames after it.
    let samples = |out: &[Filtered]| out[0].samples.at(15, 13);
    let (known, found) = (run(&settings(&[]), (0..6).map(frame)), run(&settings(&[]), (0..6).map(partly)));
    assert!(samples(&found) > 0.8 * samples(&known), "{} {}", samples(&found), samples(&known));
}

#[test]
fn noise_that_repeats_brings_no_samples() {
    let still = |repeats| {
        move |t: i64| {
            let mut f = frame(0);
            f.number = t;
            f.motion_to_previous = Some(Plane::filled(SIZE, [0.0; 2]));
            f.motion_to_next = f.motion_to_previous.clone();
            f.repeats_noise = repeats;
            f
        }
    };
    let samples = |out: &[Filtered]| out[3].samples.at(20, 13);
    assert!(samples(&run(&settings(&[]), (0..6).map(still(true)))) < 1.01);
    assert!(samples(&run(&settings(&[]), (0..6).map(still(false)))) > 5.0);
}

/// A mirror that shows a texture: the light on what it shows is even, and noisy.
#[test]
fn a_texture_in_a_mirror_stays() {
    let texture = |x: usize, y: usize| [if (x / 2 + y / 2).is_multiple_of(2) { 0.2 } else { 0.25 }; 3];
    // The surface's own colour may count its mirror's: what multiplies matte light shows that it has no other.
    let mirror = |diffuse: f32| {
        move |t: i64| {
            let mut f = frame(0);
            f.number = t;
            f.motion_to_previous = Some(Plane::filled(SIZE, [0.0; 2]));
            f.motion_to_next = f.motion_to_previous.clone();
            f.lights.truncate(2);
            f.lights[0].light = Plane::filled(SIZE, [0.0; 3]);
            f.lights[0].weight = Some(Arc::new(Plane::filled(SIZE, [diffuse; 3])));
            f.lights[1].light = Plane::from_fn(SIZE, |x, y| texture(x, y).map(|c| c * 2.0 * random(x, y, t, 3)));
            f.albedo = Some(Plane::filled(SIZE, [0.9; 3]));
            f.seen_albedo = Some(Plane::from_fn(SIZE, texture));
            f
        }
    };
    let contrast = |out: &[Filtered]| -> f32 {
        let picture = &out[3].lights[1].planes[0];
        let mean = |dark: bool| {
            let of = |i: &usize| texture(i % SIZE.width, i / SIZE.width)[0] < 0.22;
            let values: Vec<f32> = (0..SIZE.pixels()).filter(|i| of(i) == dark).map(|i| picture.data()[i][0]).collect();
            values.iter().sum::<f32>() / values.len() as f32
        };
        mean(false) / mean(true) - 1.0
    };
    // Without the help of a stop between the two colours.
    let loose = settings(&[("wavelet.seen_albedo", "16"), ("wavelet.glossy", "64")]);
    let kept = contrast(&run(&loose, (0..6).map(mirror(0.0))));
    assert!((kept - 0.25).abs() < 0.03, "{kept}");
    // Canary: a surface with a diffuse colour is not divided, and loses it.
    let lost = contrast(&run(&loose, (0..6).map(mirror(0.5))));
    assert!(lost < 0.12, "{lost}");
}

/// Stripes that slide by themselves, in a file without motion vectors: its motion is the camera's alone, which rests.
#[test]
fn a_texture_that_slides_without_motion_vectors_stays() {
    const STILL: usize = 1;
    let texture = |x: usize, t: i64| [if (x as i64 + 3 * t).rem_euclid(8) < 4 { 0.2 } else { 0.6 }; 3];
    let slides = |camera_motion: bool| {
        move |t: i64| {
            let mut f = frame(0);
            f.number = t;
            f.motion_to_previous = Some(Plane::filled(SIZE, [0.0; 2]));
            f.motion_to_next = f.motion_to_previous.clone();
            f.camera_motion = camera_motion;
            f.lights.truncate(STILL);
            f.lights[0].light = Plane::from_fn(SIZE, |x, y| [2.0 * random(x, y, t, 3); 3]);
            f.albedo = Some(Plane::from_fn(SIZE, |x, _| texture(x, t)));
            f.lights[0].weight = f.albedo.clone().map(Arc::new);
            f.lights[0].in_beauty = true;
            f
        }
    };
    let error = |out: &[Filtered]| -> f32 {
        // Light is 1 everywhere: what is too bright or too dark has the other stripe's colour.
        let light = out[3].lights[0].planes[0].data();
        light.iter().map(|light| (light[0] - 1.0).powi(2)).sum::<f32>() / light.len() as f32
    };
    let [known, trusted] = [true, false].map(|camera| error(&run(&settings(&[]), (0..7).map(slides(camera)))));
    assert!(known < 0.7 * trusted, "{known} {trusted}");
}

/// A wall with a pattern of light of its own comes nearer, in a file without motion vectors: the camera, which rests, is no
/// reason to take the frames around for the same place.
#[test]
fn what_comes_nearer_without_motion_vectors_is_not_gathered() {
    let stripes = |x: usize, t: i64| if (x as i64 + 3 * t).rem_euclid(8) < 4 { 0.2 } else { 1.0 };
    let comes = |camera_motion: bool| {
        move |t: i64| {
            let mut f = frame(0);
            f.number = t;
            let nearer = 0.2 * t as f32;
            f.depth = Some(Plane::filled(SIZE, 4.0 - nearer));
            f.position = Some(Plane::from_fn(SIZE, |x, y| [x as f32 * 0.1, y as f32 * -0.1, nearer]));
            f.motion_to_previous = Some(Plane::filled(SIZE, [0.0; 2]));
            f.motion_to_next = f.motion_to_previous.clone();
            f.camera_motion = camera_motion;
            f.lights.truncate(1);
            f.lights[0].joint.clear();
            f.lights[0].weight = None;
            f.lights[0].light = Plane::from_fn(SIZE, |x, y| [stripes(x, t) * (0.9 + 0.2 * random(x, y, t, 3)); 3]);
            f
        }
    };
    // Without the help of the light itself, and of the stages after.
    let loose = settings(&[
        ("gather.light_deviations", "64"),
        ("gather.light_deviations_high", "64"),
        ("gather.light_contrast", "1"),
        ("residual.correct", "off"),
        ("stabilise.frames", "0"),
        ("blend.choose", "off"),
    ]);
    let error = |camera_motion: bool| -> f32 {
        let out = run(&loose, (0..7).map(comes(camera_motion)));
        let pixels = out[3].lights[0].planes[0].data().iter().enumerate();
        pixels.map(|(i, light)| (light[0] - stripes(i % SIZE.width, 3)).abs()).sum::<f32>() / SIZE.pixels() as f32
    };
    let [known, trusted] = [true, false].map(error);
    assert!(known < 0.3 * trusted, "{known} {trusted}");
}

#[test]
fn wild_frames_do_no_harm() {
    let tiny = Size::new(1, 1);
    let mut bare = SequenceFrame::new(0, tiny);
    bare.lights.push(Light::new("beauty", LightKind::Beauty, Plane::filled(tiny, [2.0; 3])));
    assert_eq!(run(&settings(&[]), [bare])[0].lights[0].planes[0].at(0, 0), [2.0; 3]);

    let wild = |t: i64| {
        let mut f = frame(t);
        f.lights[0].light.set(3, 4, [f32::NAN, 1.0, 1.0]);
        f.lights[1].light.set(9, 4, [f32::INFINITY; 3]);
        if let (Some(n), Some(z), Some(p), Some(m)) =
            (&mut f.normal, &mut f.depth, &mut f.position, &mut f.motion_to_previous)
        {
            n.set(5, 5, [f32::NAN; 3]);
            z.set(6, 6, f32::NAN);
            z.set(7, 6, -1.0);
            p.set(8, 6, [f32::INFINITY; 3]);
            m.set(9, 9, [f32::NAN, 3e38]);
            m.set(10, 9, [-3e38, f32::INFINITY]);
        }
        f
    };
    let out = run(&settings(&[]), (0..5).map(wild));
    assert!(out.iter().all(|f| f.repaired == 2));
    for plane in out.iter().flat_map(|f| &f.lights).flat_map(|l| &l.planes) {
        assert!(plane.data().iter().flatten().all(|c| c.is_finite()));
    }
    let mut wrong = frame(0);
    wrong.depth = Some(Plane::filled(tiny, 1.0));
    let error = SequenceDenoiser::new(settings(&[])).unwrap().push(wrong, true).unwrap_err();
    assert!(error.to_string().contains("depth"), "{error}");
}

#[test]
fn every_parameter_matters() {
    // A box before a wall, moving against it; glass that shows something else; a beauty of its own.
    let scene =
        |t: i64| {
            let mut f = frame(t);
            let inside = |x: usize, y: usize| (8..28).contains(&x) && (4..22).contains(&y);
            let depth = Plane::from_fn(SIZE, |x, y| {
                if inside(x, y) { 2.0 + 0.05 * random(x, y, t, 5) } else { 4.0 + 0.02 * x as f32 }
            });
            let normal = |x: usize, y: usize| -> [f32; 3] {
                let a = if inside(x, y) { 0.6 + 0.9 * random(x, y, t, 6) } else { 0.02 * y as f32 };
                [a.sin(), 0.0, a.cos()]
            };
            f.normal = Some(Plane::from_fn(SIZE, normal));
            f.motion_to_previous =
                Some(Plane::from_fn(SIZE, |x, y| if inside(x, y) { [0.1, 0.0] } else { [SPEED, 0.0] }));
            f.motion_to_next = Some(Plane::from_fn(SIZE, |x, y| match (inside(x, y), y % 5) {
                (true, _) => [-0.1, 0.12],
                // Motion there and back again misses by more and less.
                (_, 1) => [0.3 - SPEED, 0.0],
                (_, 3) => [0.8 - SPEED, 0.0],
                _ => [-SPEED, 0.0],
            }));
            f.position = Some(Plane::from_fn(SIZE, |x, y| {
                let z = depth.at(x, y);
                [(x as f32 + SPEED * t as f32) * 0.1, y as f32 * -0.1, 0.4 * random(x, y, t, 7) - z]
            }));
            f.depth = Some(depth);
            // With a lamp in it, and the noisy sky.
            let sky = |x: usize, y: usize| (18..28).contains(&x) && (12..22).contains(&y);
            let shown = |x: usize, y: usize| match (x, y) {
                (12..14, 8..10) => [80.0; 3],
                _ if sky(x, y) => [0.4 + 0.3 * random(x, y, t, 9); 3],
                _ => [0.2 + 0.5 * random((x + 2 * t as usize) / 3, y / 3, 0, 8); 3],
            };
            f.seen_albedo = Some(Plane::from_fn(SIZE, shown));
            f.seen_normal = Some(Plane::from_fn(SIZE, |x, y| {
                let a = random((x + 2 * t as usize) / 4, y / 4, 0, 3);
                if sky(x, y) { [0.0; 3] } else { [a.sin(), a.cos(), 0.0] }
            }));
            f.albedo = Some(Plane::from_fn(SIZE, |x, y| {
                if inside(x, y) { [0.0; 3] } else { [0.06 + 0.5 * random(x / 2, y, 0, 4); 3] }
            }));
            // The box is glass: it has no diffuse colour.
            f.lights[0].weight = f.albedo.clone().map(Arc::new);
            // Reflections have a colour beside the glass, too.
            f.lights[1].weight = Some(Arc::new(Plane::filled(SIZE, [0.5; 3])));
            f.repeats_noise = t == 2;
            f.camera_motion = t == 3;
            let light = f.lights[1].light.clone();
            for (name, kind) in [
                ("highlight", LightKind::GlossyDirect),
                ("glass", LightKind::Transmission),
                ("indirect", LightKind::MatteIndirect),
                ("beauty", LightKind::Beauty),
            ] {
                f.lights.push(Light::new(name, kind, light.clone()));
            }
            f
        };
    // The pictures are small: without this the motion of reflections has one level.
    let levels = ("reflections.coarsest", "8");
    // With the nets, which read everything but the parameters of the forms made by hand, and with these in their place.
    let nets = ["on", "off"].map(|net| [levels, ("stabilise.net", net), ("blend.net", net)]);
    let bases = nets.map(|nets| run(&settings(&nets), (0..5).map(scene)));
    let moves = |name: &str, value: &str| {
        (nets.iter().zip(&bases)).any(|(nets, base)| {
            let [a, b, c] = *nets;
            run(&settings(&[a, b, c, (name, value)]), (0..5).map(scene)) != *base
        })
    };
    let still: Vec<&str> = (SEQUENCE_PARAMETERS.iter())
        .filter(|p| !p.samples().iter().any(|value| moves(p.name, value)))
        .map(|p| p.name)
        .collect();
    assert!(still.is_empty(), "{still:?} change nothing");
}

/// What a mirror shows moves by its own motion, which no file holds: a shadow there, that the feature buffers do not show, is
/// neither smeared nor left noisy.
#[test]
fn what_a_mirror_shows_is_followed_by_its_own_motion() {
    const REFLECTED: f32 = 3.0;
    let size = Size::new(64, 48);
    // What is seen: random tiles of 4 pixels, and a dark stripe of 6 on a floor lit by 1.
    let colour = |x: f32, y: usize, t: i64| {
        let u = x - REFLECTED * t as f32 + 400.0;
        0.3 + 0.6 * random((u / 4.0) as usize, y / 4, 0, 5)
    };
    let shadow = |x: f32, t: i64| {
        let u = (x - REFLECTED * t as f32 + 400.0).rem_euclid(24.0);
        if u < 6.0 { 0.3 } else { 1.0 }
    };
    let mirror = |t: i64| {
        let mut frame = SequenceFrame::new(t, size);
        let noise = |x: usize, y: usize| 2.0 * random(x, y, t, 3);
        let light = Plane::from_fn(size, |x, y| [colour(x as f32, y, t) * shadow(x as f32, t) * noise(x, y); 3]);
        let mut matte = Light::new("matte", LightKind::MatteIndirect, Plane::filled(size, [0.0; 3]));
        matte.weight = Some(Arc::new(Plane::filled(size, [0.0; 3])));
        let mut glossy = Light::new("glossy", LightKind::GlossyIndirect, light);
        glossy.weight = Some(Arc::new(Plane::filled(size, [0.9; 3])));
        frame.lights = vec![matte, glossy];
        frame.depth = Some(Plane::filled(size, 4.0));
        frame.normal = Some(Plane::filled(size, [0.0, 0.0, 1.0]));
        frame.position = Some(Plane::from_fn(size, |x, y| [x as f32 * 0.1, y as f32 * -0.1, 0.0]));
        frame.motion_to_previous = Some(Plane::filled(size, [0.0; 2]));
        frame.motion_to_next = Some(Plane::filled(size, [0.0; 2]));
        frame.seen_albedo = Some(Plane::from_fn(size, |x, y| [colour(x as f32, y, t); 3]));
        frame.seen_normal = Some(Plane::filled(size, [0.0, 1.0, 0.0]));
        frame
    };
    let error = |out: &[Filtered]| -> f64 {
        let middle = &out[out.len() / 2];
        let pixels = (12..size.width - 12).flat_map(|x| (4..size.height - 4).map(move |y| (x, y)));
        let square = |(x, y): (usize, usize)| {
            let true_light = colour(x as f32, y, middle.number) * shadow(x as f32, middle.number);
            f64::from(middle.lights[1].planes[0].at(x, y)[0] - true_light).powi(2)
        };
        let all: Vec<f64> = pixels.map(square).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    // Without a filter over the image: what counts are the samples that other frames bring.
    let alone = [("gather.frames", "0"), ("wavelet.levels", "0"), ("stabilise.frames", "0")];
    let gathered = [("wavelet.levels", "0"), ("stabilise.frames", "0")];
    let (noisy, followed) =
        (error(&run(&settings(&alone), (0..9).map(mirror))), error(&run(&settings(&gathered), (0..9).map(mirror))));
    assert!(followed < noisy / 2.5, "{followed} of {noisy}");
    // A mirror that hides its colours is followed as a surface is: the canary. It smears, as far as `gather` does not see that other
    // frames show other light there.
    let blind = |t: i64| {
        let mut frame = mirror(t);
        frame.seen_albedo = Some(Plane::filled(size, [0.5; 3]));
        frame
    };
    let smeared = error(&run(&settings(&gathered), (0..9).map(blind)));
    assert!(smeared > 1.5 * followed, "{smeared} and {followed}");
}

/// A wall that moves upwards, with a firefly, coverage and shared colour.
fn tall(t: i64) -> SequenceFrame {
    const TALL: Size = Size::new(20, 190);
    const UP: f32 = 1.7;
    let mut frame = SequenceFrame::new(t, TALL);
    let noisy = |k: u64| {
        Plane::from_fn(TALL, |x, y| {
            let lit = if random(x, y, t, k) < 0.3 { 3.0 } else { 0.0 };
            let edge = if y as f32 - UP * t as f32 > 90.0 { 1.0 } else { 0.3 };
            if (x, y) == (7, 60) { [1e6; 3] } else { [1.0, 0.8, 0.5].map(|c| c * lit * edge) }
        })
    };
    let colour = Arc::new(Plane::from_fn(TALL, |x, y| [0.3 + 0.6 * random(x, y / 5, 0, 9); 3]));
    for (k, kind) in [LightKind::MatteDirect, LightKind::MatteIndirect, LightKind::GlossyIndirect, LightKind::NoiseFree]
        .into_iter()
        .enumerate()
    {
        let mut light = Light::new(format!("{kind:?}"), kind, noisy(k as u64));
        light.weight = (k < 2).then(|| Arc::clone(&colour));
        frame.lights.push(light);
    }
    frame.lights.push(Light::new("volume", LightKind::Volume, Plane::filled(TALL, [0.0; 3])));
    frame.depth = Some(Plane::from_fn(TALL, |x, y| 4.0 + 0.01 * y as f32 + 0.02 * random(x, y, t, 5)));
    frame.normal = Some(Plane::filled(TALL, [0.0, 0.0, 1.0]));
    frame.position = Some(Plane::from_fn(TALL, |x, y| [x as f32 * 0.1, (y as f32 - UP * t as f32) * -0.1, 0.0]));
    frame.seen_albedo = Some(Plane::from_fn(TALL, |x, y| [0.2 + 0.2 * random(x / 3, y / 3, 0, 8); 3]));
    frame.motion_to_previous = Some(Plane::filled(TALL, [0.1, -UP]));
    frame.alpha = Some(Plane::from_fn(TALL, |x, y| random(x, y, t, 6)));
    frame
}

#[test]
fn bands_have_the_bits_of_the_whole() {
    let settings = settings(&[
        ("gather.frames", "3"),
        ("wavelet.levels", "3"),
        ("wavelet.transmission_levels", "3"),
        ("stabilise.frames", "1"),
    ]);
    let whole = run(&settings, (0..7).map(tall));
    let height = tall(0).size.height;
    let mut prepared: Vec<PreparedFrame> = (0..7).map(|t| PreparedFrame::new(tall(t), &settings).unwrap()).collect();
    for t in 1..7 {
        let (before, after) = prepared.split_at_mut(t);
        before[t - 1].followed_by(&mut after[0], &settings, quell::Backend::Cpu);
    }
    let moved = prepared.iter().flat_map(PreparedFrame::rows_moved).fold(0.0, f32::max);
    assert!((moved - 1.7).abs() < 1e-6, "{moved}");
    let spooled: Vec<(SpooledFrame, Vec<u8>)> = (prepared.into_iter())
        .map(|frame| {
            let mut bytes = Vec::new();
            let kept = frame.spool(&mut bytes).unwrap();
            assert_eq!(kept.bytes(), bytes.len() as u64);
            (kept, bytes)
        })
        .collect();
    let band = |core: std::ops::Range<usize>, margin: usize| -> bool {
        let rows = core.start.saturating_sub(margin)..(core.end + margin).min(height);
        let mut denoiser = SequenceDenoiser::new(settings.clone()).unwrap();
        let mut out = Vec::new();
        let mut take = |filtered| {
            out.push(filtered);
            true
        };
        for (kept, bytes) in &spooled {
            denoiser.push_to(kept.rows(&mut Cursor::new(bytes), rows.clone()).unwrap(), true, &mut take).unwrap();
        }
        denoiser.finish_to(&mut take).unwrap();
        assert_eq!(out.len(), whole.len());
        out.iter().zip(&whole).all(|(band, whole)| {
            core.clone().all(|y| {
                let here = y - rows.start;
                let lights = band.lights.iter().zip(&whole.lights);
                let planes = lights.flat_map(|(b, w)| {
                    b.planes.iter().zip(&w.planes).chain(b.weight.as_deref().zip(w.weight.as_deref()))
                });
                let same = |(b, w): (&Plane<Rgb>, &Plane<Rgb>)| b.row(here) == w.row(y);
                planes.into_iter().all(same)
                    && band.alpha.as_ref().unwrap().row(here) == whole.alpha.as_ref().unwrap().row(y)
            })
        })
    };
    let margin = SequenceDenoiser::new(settings.clone()).unwrap().margin(moved, height);
    for bands in [2, 3, 7] {
        for k in 0..bands {
            assert!(band(k * height / bands..(k + 1) * height / bands, margin), "band {k} of {bands}, margin {margin}");
        }
    }
    // The comparison can fail.
    assert!(!band(80..100, margin / 8), "{margin}");
}
