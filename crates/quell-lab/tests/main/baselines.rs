//! Temporal accumulation, a-trous, SVGF and BMFR by what they must do to pictures with a known answer.

use quell::{Camera, FrameBuf, Plane, Size};
use quell_lab::methods::taa::Taa;
use quell_lab::methods::{Input, Method, parse};
use quell_lab::tone::luminance;

const SIZE: Size = Size::new(96, 64);

/// White noise, 0..1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// A still wall 4 units before the camera, lit by matte light of 1 and glossy light of 0.5.
fn wall(index: i64) -> FrameBuf {
    let camera = Camera::perspective([0.0, 0.0, 4.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 1.5);
    let mut f = FrameBuf::new(SIZE, camera);
    f.index = index;
    f.matte = Some(Plane::filled(SIZE, [1.0; 3]));
    f.glossy = Some(Plane::filled(SIZE, [0.5; 3]));
    f.view_depth = Some(Plane::filled(SIZE, 4.0));
    f.normal = Some(Plane::filled(SIZE, [0.0, 0.0, 1.0]));
    f.surface_id = Some(Plane::filled(SIZE, 1));
    f.motion = Some(Plane::filled(SIZE, [0.0; 2]));
    f
}

/// The same, every pixel's matte light times 0..2: mean 1, variance 1/3.
fn noisy_wall(index: i64) -> FrameBuf {
    let mut noise = Noise(index as u64 + 11);
    let mut f = wall(index);
    f.matte = Some(Plane::from_fn(SIZE, |_, _| [2.0 * noise.next(); 3]));
    f.glossy = None;
    f
}

fn run(method: &mut dyn Method, frame: &FrameBuf) -> Plane<[f32; 3]> {
    method.denoise(&Input { frame: &frame.frame(&[]), halves: None }).unwrap()
}

/// Mean and variance of luminance over the pixels of `columns`, eight from each edge.
fn moments(picture: &Plane<[f32; 3]>, columns: std::ops::Range<usize>) -> (f64, f64) {
    let values: Vec<f64> = (8..SIZE.height - 8)
        .flat_map(|y| columns.clone().map(move |x| (x, y)))
        .map(|(x, y)| f64::from(luminance(picture.at(x, y))))
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64)
}

const ALL: [&str; 5] = ["temporal", "atrous", "svgf", "svgf:later", "bmfr"];

#[test]
fn a_constant_stays_constant_on_slanted_ground_with_background() {
    for name in ALL {
        let mut method = parse(name).unwrap();
        assert_eq!(method.name(), name);
        for index in 0..4 {
            let mut f = wall(index);
            let is_ground = |y: usize| y > 20;
            let depth = |y: usize| if is_ground(y) { 100.0 / (y as f32 - 18.0) } else { f32::INFINITY };
            f.view_depth = Some(Plane::from_fn(SIZE, |_, y| depth(y)));
            f.normal = Some(Plane::from_fn(SIZE, |_, y| if is_ground(y) { [0.0, 1.0, 0.0] } else { [0.0; 3] }));
            for light in [&mut f.matte, &mut f.glossy].into_iter().flatten() {
                *light = Plane::from_fn(SIZE, |x, y| if is_ground(y) { light.at(x, y) } else { [0.0; 3] });
            }
            f.direct = Some(Plane::filled(SIZE, [0.25; 3]));
            let picture = run(method.as_mut(), &f);
            for y in 0..SIZE.height {
                for x in 0..SIZE.width {
                    let expected = if is_ground(y) { 1.75 } else { 0.25 };
                    let found = picture.at(x, y);
                    assert!(found.iter().all(|v| (v - expected).abs() < 1e-5), "{name} {index} ({x}, {y}): {found:?}");
                }
            }
        }
    }
}

#[test]
fn energy_is_kept_and_noise_falls() {
    for (name, at_most) in
        [("temporal", 1.0 / 7.0), ("atrous", 0.02), ("svgf", 0.02), ("svgf:later", 0.02), ("bmfr", 0.02)]
    {
        let mut method = parse(name).unwrap();
        let picture = (0..8).map(|i| run(method.as_mut(), &noisy_wall(i))).last().unwrap();
        let (mean, variance) = moments(&picture, 8..SIZE.width - 8);
        assert!((mean - 1.0).abs() < 0.02, "{name}: mean {mean}");
        assert!(variance < at_most / 3.0, "{name}: variance {variance}");
    }
}

#[test]
fn accumulation_is_a_running_mean_that_starts_anew_at_disocclusions() {
    let mut method = parse("temporal").unwrap();
    for index in 0..12 {
        let mut f = noisy_wall(index);
        // From frame 6 on something else stands on the left, and on the right motion is lost once.
        if index >= 6 {
            f.surface_id = Some(Plane::from_fn(SIZE, |x, _| 1 + u32::from(x < 32)));
        }
        if index == 6 {
            f.motion = Some(Plane::from_fn(SIZE, |x, _| if x >= 64 { [f32::NAN; 2] } else { [0.0; 2] }));
        }
        let picture = run(method.as_mut(), &f);
        let n = index as f64 + 1.0;
        let since = if index >= 6 { index as f64 - 5.0 } else { n };
        for (columns, n) in [(0..32, since), (32..64, n), (64..96, since)] {
            // 1536 pixels: the variance of uniform noise is known to 2.3 % (one standard deviation).
            let (_, variance) = moments(&picture, columns.clone());
            assert!((variance * 3.0 * n - 1.0).abs() < 0.12, "frame {index}, {columns:?}: {variance}, n {n}");
        }
    }
}

#[test]
fn the_mean_counts_32_frames_and_a_cut_forgets_them() {
    let mut method = parse("temporal").unwrap();
    for index in 0..40 {
        let mut f = wall(index);
        f.matte = Some(Plane::filled(SIZE, [if index == 0 { 1.0 } else { 0.0 }; 3]));
        f.glossy = None;
        let expected =
            if index < 32 { 1.0 / (index as f32 + 1.0) } else { (31.0f32 / 32.0).powi(index as i32 - 31) / 32.0 };
        let found = run(method.as_mut(), &f).at(40, 40)[0];
        assert!((found / expected - 1.0).abs() < 1e-4, "frame {index}: {found}, expected {expected}");
    }
    let found = run(method.as_mut(), &wall(60)).at(40, 40)[0];
    assert!((found - 1.5).abs() < 1e-6, "{found}");
}

#[test]
fn history_follows_motion() {
    // The picture moves 2.5 pixels a frame to the right; a step of light on it moves along.
    let step = |x: f32| if x < 30.0 { 0.0 } else { 1.0 };
    let mut method = parse("temporal").unwrap();
    for index in 0..10 {
        let mut f = wall(index);
        f.matte = Some(Plane::from_fn(SIZE, |x, _| [step(x as f32 - 2.5 * index as f32); 3]));
        f.glossy = None;
        f.motion = Some(Plane::filled(SIZE, [-2.5, 0.0]));
        let picture = run(method.as_mut(), &f);
        for x in 4..SIZE.width - 4 {
            let place = x as f32 - 2.5 * index as f32;
            if (place - 30.0).abs() > 12.0 {
                // Each frame resamples between pixels, which widens the step by one.
                assert!((picture.at(x, 32)[0] - step(place)).abs() < 1e-5, "frame {index}, column {x}");
            }
        }
    }
}

/// `+taa` is the last stage of preset `quality`: behind the rest of it, it gives the same bits. It also goes back when a method does.
#[test]
fn taa_behind_a_method_is_the_stage_of_quality() {
    let mut whole = parse("quell:quality").unwrap();
    let stages_before = parse("quell:quality+antialiasing.enabled=off+direct_taa.enabled=off").unwrap();
    let mut apart = Taa::behind(stages_before).unwrap();
    let mut before = parse("quell:quality+antialiasing.enabled=off").unwrap();
    assert_eq!(parse("svgf+taa").unwrap().name(), "svgf+taa");
    assert!(parse("quell:sequence+taa").is_err(), "its pictures come late");
    assert!(parse("quell:quality+taa").is_err(), "it has the stage itself");
    for index in 0..6 {
        let mut f = noisy_wall(index);
        f.camera.jitter = [[0.25, -0.3], [-0.1, 0.4]][index as usize % 2];
        f.direct = Some(Plane::from_fn(SIZE, |x, y| [((x + y + index as usize) % 5) as f32 * 0.2; 3]));
        if index == 3 {
            whole.reset();
            apart.reset();
            before.reset();
        }
        let found = run(&mut apart, &f);
        assert!(found == run(whole.as_mut(), &f), "frame {index}");
        assert_eq!(found != run(before.as_mut(), &f), index % 3 > 0, "frame {index}");
    }
}

/// Left half bright, right half dark, both noisy; the planes meet at right angles, or are one.
fn corner(index: i64, bent: bool) -> FrameBuf {
    let mut noise = Noise(index as u64 + 5);
    let mut f = wall(index);
    let left = |x: usize| x < SIZE.width / 2;
    f.matte = Some(Plane::from_fn(SIZE, |x, _| [if left(x) { 4.0 } else { 0.4 } * noise.next(); 3]));
    f.glossy = None;
    let turned = |x: usize| if left(x) || !bent { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    f.normal = Some(Plane::from_fn(SIZE, |x, _| turned(x)));
    f
}

#[test]
fn the_wavelets_stop_at_normals() {
    // The a-trous weight sees normals through the step: at 16 pixels a right angle lets nine tenths of the light through.
    for (name, at_most) in [("atrous", 0.4), ("svgf", 0.24), ("svgf:later", 0.24)] {
        let beside_the_edge = |bent: bool| {
            let mut method = parse(name).unwrap();
            let picture = (0..3).map(|i| run(method.as_mut(), &corner(i, bent))).last().unwrap();
            moments(&picture, SIZE.width / 2..SIZE.width / 2 + 1).0
        };
        let (bent, flat) = (beside_the_edge(true), beside_the_edge(false));
        assert!(bent > 0.16 && bent < at_most, "{name}: {bent}, expected 0.2");
        // The canary: without the bend light does cross.
        assert!(flat > bent + 0.06, "{name}: {flat} on a flat wall, {bent} on a bent one");
    }
}

#[test]
fn bad_values_do_not_spread() {
    for name in ALL {
        let mut method = parse(name).unwrap();
        for index in 0..3 {
            let mut f = noisy_wall(index);
            for (x, value) in [(10, f32::NAN), (30, f32::INFINITY), (50, -5.0)] {
                f.matte.as_mut().unwrap().set(x, 30, [value; 3]);
                f.view_depth.as_mut().unwrap().set(x, 20, value);
                f.normal.as_mut().unwrap().set(x, 40, [value; 3]);
                f.motion.as_mut().unwrap().set(x, 50, [value; 2]);
            }
            let picture = run(method.as_mut(), &f);
            assert!(picture.data().iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{name}, frame {index}");
        }
    }
}

#[test]
fn small_extents_and_missing_planes_work() {
    for (width, height) in [(1, 1), (2, 3), (65, 1), (7, 70)] {
        let size = Size::new(width, height);
        for name in ALL {
            let mut method = parse(name).unwrap();
            for index in 0..2 {
                let mut f = FrameBuf::new(size, wall(0).camera);
                f.index = index;
                f.matte = Some(Plane::filled(size, [0.75; 3]));
                let picture = run(method.as_mut(), &f);
                assert!(picture.data().iter().flatten().all(|v| (v - 0.75).abs() < 1e-5), "{name} {size}");
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    for name in ALL {
        let pictures = [1, 3].map(|threads| {
            pool(threads).install(|| {
                let mut method = parse(name).unwrap();
                (0..3).map(|i| run(method.as_mut(), &noisy_wall(i))).last().unwrap()
            })
        });
        assert_eq!(pictures[0], pictures[1], "{name}");
    }
}
