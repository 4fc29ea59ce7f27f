//! The offline methods on pictures whose truth is known.

use super::image::{self, Colour, Image};
use super::noisy::{Feature, FeatureNoise, Halves};
use super::weights::{Guide, Kernel, Noisy, filter};
use crate::error::Error;
use crate::methods::nfor::{Nfor, squared_error};
use crate::methods::wlr::Wlr;
use crate::methods::{Input, parse};
use crate::metrics::rel_mse;
use fearless_simd::Level;
use quell::{Camera, FrameBuf, Plane, Rgb, Size};
use quell_trace::HalfSignals;

const OFFLINE: [&str; 4] = ["nlm", "nlm:colour", "wlr", "nfor"];

/// A stream of numbers with mean 0 and variance 1: sums of uniform ones.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f32 {
        let mut sum = 0.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 40) as f32 / (1u64 << 24) as f32 - 0.5;
        }
        sum
    }
}

/// A frame with one signal of known mean, and two halves of it.
struct Scene {
    frame: FrameBuf,
    halves: [HalfSignals; 2],
    truth: Plane<Rgb>,
}

impl Scene {
    /// Light on tiles and a curved wall. `deviation`: of each half, relative to the light.
    fn new(size: Size, deviation: f32) -> Self {
        let at = |x: usize, y: usize| (x as f32 / size.width as f32, y as f32 / size.height as f32);
        // A shadow that no feature shows, soft.
        let light = Plane::from_fn(size, |x, y| {
            let (u, v) = at(x, y);
            let shadow = 1.0 / (1.0 + (-12.0 * (u + 0.4 * v - 0.7)).exp());
            [0.3 + shadow, 0.25 + 0.8 * shadow, 0.2 + 0.5 * shadow]
        });
        let albedo = Plane::from_fn(size, |x, y| {
            let tile = f32::from(u8::from((x / 5 + y / 4) % 2 == 0));
            let (u, _) = at(x, y);
            [0.25 + 0.5 * tile, 0.3 + 0.3 * tile, 0.2 + 0.5 * u]
        });
        let normal = Plane::from_fn(size, |x, y| {
            let (u, v) = at(x, y);
            let angle = if v < 0.5 { 0.0 } else { u - 0.5 };
            [angle.sin(), 0.0, angle.cos()]
        });
        let depth = Plane::from_fn(size, |x, y| 2.0 + at(x, y).0 + f32::from(u8::from(2 * y >= size.height)));
        let mut noise = Noise(7);
        let mut half = || {
            let matte = Plane::from_fn(size, |x, y| light.at(x, y).map(|l| l * (1.0 + deviation * noise.next())));
            HalfSignals { matte, glossy: Plane::filled(size, [0.0; 3]) }
        };
        let halves = [half(), half()];
        let camera = Camera::perspective([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 1.5);
        let mut frame = FrameBuf::new(size, camera);
        let [a, b] = &halves;
        let mean = |x: usize, y: usize| std::array::from_fn(|c| 0.5 * (a.matte.at(x, y)[c] + b.matte.at(x, y)[c]));
        frame.matte = Some(Plane::from_fn(size, mean));
        let times = |x: usize, y: usize| std::array::from_fn(|c| albedo.at(x, y)[c] * light.at(x, y)[c]);
        let truth = Plane::from_fn(size, times);
        frame.matte_weight = Some(albedo);
        frame.normal = Some(normal);
        frame.view_depth = Some(depth);
        Self { frame, halves, truth }
    }

    fn run(&self, method: &str) -> Plane<Rgb> {
        self.try_run(method).unwrap()
    }

    fn try_run(&self, method: &str) -> Result<Plane<Rgb>, Error> {
        let [a, b] = &self.halves;
        parse(method)?.denoise(&Input { frame: &self.frame.frame(&[]), halves: Some([a, b]) })
    }

    fn error(&self, method: &str) -> f64 {
        rel_mse(&self.run(method), &self.truth).unwrap().mean
    }

    fn noisy(&self) -> Halves {
        let [a, b] = &self.halves;
        Halves::of("test", &Input { frame: &self.frame.frame(&[]), halves: Some([a, b]) }).unwrap()
    }

    fn features(&self) -> [Feature; 3] {
        super::noisy::features(&Input { frame: &self.frame.frame(&[]), halves: None })
    }
}

const SMALL: Size = Size::new(50, 37);

fn mean_of(image: &Image) -> f64 {
    let size = image.size();
    let sum: f64 = (0..size.height).flat_map(|y| (0..size.width).map(move |x| f64::from(image.at(x, y)))).sum();
    sum / size.pixels() as f64
}

fn largest_difference(a: &Colour, b: &Colour) -> f32 {
    let size = a[0].size();
    let pixels = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
    pixels.flat_map(|(x, y)| (0..3).map(move |c| (a[c].at(x, y) - b[c].at(x, y)).abs())).fold(0.0, f32::max)
}

#[test]
fn constants_are_preserved() {
    let mut scene = Scene::new(SMALL, 0.0);
    scene.frame.matte_weight = None;
    for half in &mut scene.halves {
        half.matte = Plane::filled(SMALL, [0.5, 2.0, 30.0]);
    }
    for method in OFFLINE {
        for pixel in scene.run(method).data() {
            for (found, expected) in pixel.iter().zip([0.5, 2.0, 30.0]) {
                assert!((found / expected - 1.0).abs() < 3e-4, "{method}: {found} for {expected}");
            }
        }
    }
}

#[test]
fn direct_light_passes_through_and_nothing_is_negative() {
    let mut scene = Scene::new(SMALL, 1.5);
    let without = OFFLINE.map(|method| scene.run(method));
    let lamp = |x: usize, y: usize| if (20..30).contains(&x) && y < 5 { 40.0 } else { 0.1 * (x % 3) as f32 };
    scene.frame.direct = Some(Plane::from_fn(SMALL, |x, y| [lamp(x, y); 3]));
    for (method, without) in OFFLINE.iter().zip(without) {
        let with = scene.run(method);
        for y in 0..SMALL.height {
            for x in 0..SMALL.width {
                let (with, without) = (with.at(x, y), without.at(x, y));
                assert!(with.iter().zip(without).all(|(w, o)| o >= 0.0 && *w == o + lamp(x, y)), "{method} ({x}, {y})");
            }
        }
    }
}

#[test]
fn first_order_regression_reproduces_what_is_linear_in_features() {
    let scene = Scene::new(SMALL, 0.0);
    let features = scene.features();
    let flat: Vec<Image> = features.iter().flat_map(|f| f.mean.clone()).collect();
    let linear = |shift: f32| {
        Image::from_fn(SMALL, |x, y| {
            let f: f32 = flat.iter().enumerate().map(|(i, f)| (0.3 - 0.1 * i as f32 + shift) * f.at(x, y)).sum();
            2.0 + f + 0.01 * x as f32 - 0.02 * y as f32
        })
    };
    let truth = [linear(0.0), linear(0.2), linear(-0.3)];
    // A guide without structure: all weights are 1, and yet no step is lost.
    let (guide, variance) = (image::zip(&truth, &truth, |_, _| 1.0), image::zip(&truth, &truth, |_, _| 0.1));
    let kernel = Kernel { radius: 9, patch: 3, k: 1.0 };
    let found = Nfor::default().regress(&truth, &flat, &guide, &variance, &kernel);
    assert!(largest_difference(&found, &truth) < 2e-3, "nfor: {}", largest_difference(&found, &truth));
    let found = Wlr::default().regress(&truth, &variance, &features);
    assert!(largest_difference(&found, &truth) < 5e-3, "wlr: {}", largest_difference(&found, &truth));
    // Without features the steps are lost: the comparison can fail.
    let none: Vec<Image> = flat.iter().map(|f| f.map(|_| 0.0)).collect();
    let found = Nfor::default().regress(&truth, &none, &guide, &variance, &kernel);
    assert!(largest_difference(&found, &truth) > 0.05);
}

#[test]
fn equal_patches_are_averaged() {
    let mut noise = Noise(3);
    let input = Image::from_fn(SMALL, |_, _| 1.0 + 0.1 * noise.next());
    let (flat, variance) = (input.map(|_| 1.0), input.map(|_| 0.01));
    let guide = Guide { colour: vec![Noisy { value: &flat, variance: &variance }], features: vec![] };
    let kernel = Kernel { radius: 10, patch: 3, k: 0.45 };
    let [found] = filter(Level::new(), &guide, &kernel, [&input]).channels;
    // The mean of the window, cut at the edges; the corner has 11 x 11 pixels.
    let window = |x: usize, y: usize| {
        let (xs, ys) = (x.saturating_sub(10)..(x + 11).min(50), y.saturating_sub(10)..(y + 11).min(37));
        let count = xs.len() * ys.len();
        ys.flat_map(|y| xs.clone().map(move |x| (x, y))).map(|(x, y)| input.at(x, y)).sum::<f32>() / count as f32
    };
    for (x, y) in [(0, 0), (25, 18), (49, 36), (3, 30)] {
        assert!((found.at(x, y) - window(x, y)).abs() < 1e-5, "{x}, {y}");
    }
    // With noise in the guide too, three quarters of what could go still goes.
    let guide = Guide { colour: vec![Noisy { value: &input, variance: &variance }], features: vec![] };
    let [found] = filter(Level::new(), &guide, &Kernel { k: 1.0, ..kernel }, [&input]).channels;
    let left = mean_of(&found.map(|v| (v - 1.0) * (v - 1.0)));
    assert!(left < 0.01 / 50.0, "variance {left} is left of 0.01");
    // An edge of many deviations is not crossed.
    let step = Image::from_fn(SMALL, |x, y| if x < 25 { input.at(x, y) } else { input.at(x, y) + 5.0 });
    let guide = Guide { colour: vec![Noisy { value: &step, variance: &variance }], features: vec![] };
    let [found] = filter(Level::new(), &guide, &kernel, [&step]).channels;
    assert!(found.at(24, 18) < 1.2 && found.at(25, 18) > 5.8);
}

#[test]
fn variance_from_halves_is_unbiased() {
    let mut noise = Noise(11);
    let size = Size::new(96, 64);
    let mut half = || -> Colour {
        std::array::from_fn(|c| Image::from_fn(size, |_, _| 1.0 + 0.2 * (c + 1) as f32 * noise.next()))
    };
    let halves = Halves { a: half(), b: half() };
    for c in 0..3 {
        // The mean of two halves has half the variance of each.
        let expected = 0.5 * (0.2 * (c + 1) as f64).powi(2);
        for variance in [halves.raw_variance(), halves.variance(None)] {
            let found = mean_of(&variance[c]);
            assert!((found / expected - 1.0).abs() < 0.05, "channel {c}: {found} for {expected}");
        }
    }
    // The samples' own variance gives the detail and keeps the scale.
    let shape = Image::from_fn(size, |x, _| if x % 2 == 0 { 3.0 } else { 1.0 });
    let shaped = &halves.variance(Some(&shape))[0];
    assert!((mean_of(shaped) / 0.02 - 1.0).abs() < 0.05);
    let ratio = shaped.at(40, 30) / shaped.at(41, 30);
    assert!((1.5..6.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_variance_of_two_samples_is_not_taken_for_more_than_the_halves_say() {
    use crate::tone::luminance;
    let mut scene = Scene::new(SMALL, 1.0);
    let of_halves = |scene: &Scene| {
        let [a, b] = &scene.halves;
        let l = |p: &Plane<Rgb>, x, y| luminance(p.at(x, y));
        Plane::from_fn(SMALL, |x, y| 0.25 * (l(&a.matte, x, y) - l(&b.matte, x, y)).powi(2))
    };
    scene.frame.glossy_variance = Some(Plane::filled(SMALL, 0.0));
    scene.frame.matte_variance = Some(of_halves(&scene));
    let shape = |scene: &Scene| {
        let [a, b] = &scene.halves;
        super::noisy::sample_variance(&Input { frame: &scene.frame.frame(&[]), halves: Some([a, b]) })
    };
    assert!(shape(&scene).is_none());
    // More samples know more than their halves.
    scene.frame.matte_variance = Some(Plane::filled(SMALL, 0.3));
    assert!(shape(&scene).is_some());
}

/// The regressions of both halves at two strengths.
fn candidates(noisy: &Halves, features: &[Feature; 3], variance: &Colour) -> [Halves; 2] {
    let flat: Vec<Image> = features.iter().flat_map(|f| f.mean.clone()).collect();
    let doubled = image::zip(variance, variance, |a, b| a + b);
    [0.5, 1.0].map(|k| {
        let kernel = Kernel { radius: 9, patch: 3, k };
        let nfor = Nfor::default();
        Halves {
            a: nfor.regress(&noisy.a, &flat, &noisy.b, &doubled, &kernel),
            b: nfor.regress(&noisy.b, &flat, &noisy.a, &doubled, &kernel),
        }
    })
}

#[test]
fn estimated_error_is_near_the_true_one() {
    let scene = Scene::new(Size::new(96, 54), 0.4);
    let noisy = scene.noisy();
    let variance = noisy.variance(None);
    let truth = Image::colour(&scene.truth);
    // Without features the tiles blur: an error that stands out of the estimate's own noise.
    let blind = scene.features().map(|f| Feature::clean(f.mean.iter().map(|m| m.map(|_| 0.0)).collect()));
    let squared = |a: &Colour| image::zip(a, &truth, |a, b| (a - b) * (a - b)).iter().map(mean_of).sum::<f64>() / 3.0;
    for candidate in candidates(&noisy, &blind, &variance) {
        let estimated = mean_of(&squared_error(&noisy, &noisy.raw_variance(), &candidate));
        let (own, input) = (squared(&candidate.mean()), squared(&noisy.mean()));
        println!("estimated {estimated:.6}, true {own:.6}, noisy {input:.6}");
        assert!((0.5..2.0).contains(&(estimated / own)), "estimated {estimated:.6}, true {own:.6}, noisy {input:.6}");
    }
}

#[test]
fn the_better_candidate_is_taken() {
    let size = Size::new(64, 40);
    let mut noise = Noise(5);
    let mut like_truth = |deviation: f32| -> Colour {
        std::array::from_fn(|_| Image::from_fn(size, |_, _| 1.0 + deviation * noise.next()))
    };
    let noisy = Halves { a: like_truth(0.3), b: like_truth(0.3) };
    let variance = noisy.variance(None);
    // Each candidate is off by 0.3 in one half of the picture.
    let off = |left: bool| -> Colour {
        std::array::from_fn(|_| Image::from_fn(size, |x, _| if (x < 32) == left { 1.3 } else { 1.0 }))
    };
    let candidates = [Halves { a: off(true), b: off(true) }, Halves { a: off(false), b: off(false) }];
    let selection = Nfor::default().select(&noisy, &variance, &candidates);
    for y in [5, 20, 35] {
        let [left, right] = [16, 48].map(|x| selection.share.at(x, y));
        assert!(left < 0.1 && right > 0.9, "row {y}: share of the first {left} where it is off, {right} where not");
        assert!((selection.halves.a[1].at(48, y) - 1.0).abs() < 0.05);
        let [first, second] = selection.errors.each_ref().map(|e| e.at(16, y));
        assert!((first - 0.09).abs() < 0.04 && second.abs() < 0.04, "errors {first} and {second}");
    }
}

/// Bitterli et al. 2016 show their result well below the noisy input, and below filters that use features as weights
/// only; the figure asked for here is a tenth. Relative deviation 1 of a half is about what 8 paths give.
#[test]
fn nfor_is_an_order_of_magnitude_below_the_input_and_better_than_nlm() {
    let size = Size::new(96, 54);
    let errors = [1.0_f32, 0.5].map(|deviation| {
        let scene = Scene::new(size, deviation);
        let errors = ["none", "nfor", "nlm", "nlm:colour", "wlr"].map(|m| scene.error(m));
        let [none, nfor, nlm, colour, wlr] = errors;
        let all = format!("none {none:.5} nfor {nfor:.5} nlm {nlm:.5} colour {colour:.5} wlr {wlr:.5}");
        println!("{all}");
        assert!(nfor < none / 10.0, "{all}");
        assert!(nfor < nlm && nfor < colour, "{all}");
        assert!(wlr < none / 4.0, "{all}");
        nfor
    });
    assert!(errors[1] < 0.6 * errors[0], "four times the samples: {errors:?}");
}

#[test]
fn noisy_features_are_filtered_and_clean_ones_are_left_alone() {
    let mut noise = Noise(17);
    let truth = Image::from_fn(SMALL, |x, y| if (x / 10 + y / 10) % 2 == 0 { 0.2 } else { 0.8 });
    let clean = Feature::clean(vec![truth.clone()]);
    let kernel = Kernel { radius: 5, patch: 3, k: 0.5 };
    let filtered = clean.prefiltered(Level::new(), &kernel);
    assert!(filtered.variance.is_none() && filtered.halves == [vec![truth.clone()], vec![truth.clone()]]);
    let mut half = || vec![Image::from_fn(SMALL, |x, y| truth.at(x, y) + 0.1 * noise.next())];
    let halves = [half(), half()];
    let mean = vec![halves[0][0].zip(&halves[1][0], |a, b| 0.5 * (a + b))];
    let noisy =
        Feature { mean: mean.clone(), noise: Some(FeatureNoise { halves, variance: vec![truth.map(|_| 0.005)] }) };
    let error = |image: &Image| mean_of(&image.zip(&truth, |a, b| (a - b) * (a - b)));
    let filtered = noisy.prefiltered(Level::new(), &kernel);
    let (before, after) = (error(&mean[0]), error(&filtered.mean()[0]));
    assert!(after < before / 2.0, "{before} -> {after}");
    assert!(filtered.variance.is_some());
}

#[test]
fn same_bits_at_any_number_of_threads() {
    let scene = Scene::new(Size::new(83, 41), 0.5);
    for method in OFFLINE {
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| scene.run(method))
        });
        assert!(one == three, "{method}");
    }
}

#[test]
fn bad_input_gives_a_message_or_a_finite_picture() {
    let mut scene = Scene::new(Size::new(20, 9), 0.5);
    for method in OFFLINE {
        assert!(parse(method).unwrap().needs_halves());
        let frame = scene.frame.frame(&[]);
        let missing = parse(method).unwrap().denoise(&Input { frame: &frame, halves: None }).unwrap_err();
        assert!(matches!(missing, Error::Method { .. }), "{missing}");
    }
    scene.halves[0].matte.set(3, 4, [f32::NAN, f32::INFINITY, -1.0]);
    if let (Some(depth), Some(normal)) = (&mut scene.frame.view_depth, &mut scene.frame.normal) {
        depth.set(5, 5, f32::INFINITY);
        depth.set(6, 5, f32::NAN);
        normal.set(5, 5, [0.0; 3]);
    }
    for method in OFFLINE {
        assert!(scene.run(method).data().iter().flatten().all(|v| v.is_finite()), "{method}");
    }
    for size in [Size::new(1, 1), Size::new(2, 19)] {
        let mut scene = Scene::new(size, 0.5);
        scene.frame.normal = None;
        scene.frame.view_depth = None;
        scene.frame.matte_weight = None;
        for method in OFFLINE {
            let picture = scene.run(method);
            assert!(picture.size() == size && picture.data().iter().flatten().all(|v| v.is_finite()), "{method}");
        }
    }
}
