//! Per-pixel test of hypothesis against pictures by Mitsuba 3, which share neither code nor description with quell:
//! `tests/mitsuba/render.py` made them, and says how. Its scenes and its BRDF are written down a second time.
//!
//! The null hypothesis is that both renderers estimate the same numbers. For a pixel and channel with quell's mean a,
//! Mitsuba's mean b and their variances, z = (a - b) / sqrt(va + vb). quell's samples stratify, so its variance comes
//! from batches with different seeds; z then follows Student's distribution, whose degrees of freedom are taken from
//! quell's batches alone, as if Mitsuba's variance were as uncertain (its own has 10^5).

use glam::{Affine3A, Quat, Vec3};
use quell::Size;
use quell_trace::environment::Environment;
use quell_trace::{
    CameraPath, Control, Estimator, Half, Material, ReferenceKind, RenderOptions, Scene, Tracer, builtin, shapes,
};
use std::f64::consts::FRAC_2_PI;
use std::path::Path;

/// Probability that one statement (all pixels, or all regions) rejects a right renderer, if means of batches were
/// Gaussian. Their tails are a little heavier, which the low level makes room for: the reference of 2048 samples has
/// |z| up to 5.8 in 1296 comparisons, that of 16384 up to 4.2.
const LEVEL: f64 = 1e-6;

/// Batches of quell's samples, each with a seed of its own.
const BATCHES: u32 = 64;

/// Samples of a pixel and batch. The sum over all batches has to be nearly Gaussian although paths that find a lamp's
/// reflection are rare and bright: below about 1000 samples Mitsuba does not agree with itself by this test.
const SAMPLES_A_BATCH: u32 = 32;

/// Share of the samples that canaries are given.
const CANARY_SHARE: u32 = 4;

/// Side of the square regions whose means are compared: a bias too small for a pixel shows there.
const REGION: usize = 6;

/// Largest relative rounding of a sum in single precision that is allowed for where neither side has noise.
const ROUNDING: f64 = 1e-5;

/// The spread of z may be this many standard deviations off.
const SPREAD_SIGMAS: f64 = 4.0;

type Rgb64 = [f64; 3];

/// Means and their variances over the pixels of a picture, and over its regions.
#[derive(Clone)]
pub(crate) struct Estimate {
    pub(crate) size: Size,
    pixels: Vec<Moments>,
    /// Row by row; the last is the whole picture.
    regions: Vec<Moments>,
}

/// A mean and its variance, per channel.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    mean: Rgb64,
    variance: Rgb64,
}

/// Index of the region of a pixel.
fn region_of(size: Size, pixel: usize) -> usize {
    pixel / size.width / REGION * size.width.div_ceil(REGION) + pixel % size.width / REGION
}

fn region_count(size: Size) -> usize {
    size.width.div_ceil(REGION) * size.height.div_ceil(REGION) + 1
}

/// Means over the regions.
fn regions(size: Size, pixels: &[Rgb64]) -> Vec<Rgb64> {
    let mut sums = vec![([0.0; 3], 0.0); region_count(size)];
    let whole = sums.len() - 1;
    for (i, value) in pixels.iter().enumerate() {
        for region in [region_of(size, i), whole] {
            for c in 0..3 {
                sums[region].0[c] += value[c];
            }
            sums[region].1 += 1.0;
        }
    }
    sums.into_iter().map(|(sum, count)| sum.map(|s| s / count)).collect()
}

/// Reads a Portable Float Map in colour as `render.py` writes it, rows from the top.
fn read_pfm(path: &Path) -> (Size, Vec<Rgb64>) {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}; tests/mitsuba/render.py", path.display()));
    let mut lines = bytes.splitn(4, |b| *b == b'\n');
    let mut line = || lines.next().and_then(|l| std::str::from_utf8(l).ok()).unwrap().to_owned();
    assert_eq!(line(), "PF", "{}", path.display());
    let extent: Vec<usize> = line().split(' ').map(|n| n.parse().unwrap()).collect();
    assert_eq!(line(), "-1.0", "little endian");
    let size = Size::new(extent[0], extent[1]);
    let values: Vec<f64> = lines
        .next()
        .unwrap()
        .chunks_exact(4)
        .map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])))
        .collect();
    assert_eq!(values.len(), 3 * size.pixels());
    let pixels = (0..size.pixels()).map(|i| {
        let stored = ((size.height - 1 - i / size.width) * size.width + i % size.width) * 3;
        [values[stored], values[stored + 1], values[stored + 2]]
    });
    (size, pixels.collect())
}

/// The committed picture; its pixels are independent.
pub(crate) fn mitsuba(name: &str) -> Estimate {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mitsuba");
    let (size, mean) = read_pfm(&folder.join(format!("{name}.mean.pfm")));
    let (variance_size, variance) = read_pfm(&folder.join(format!("{name}.variance.pfm")));
    assert_eq!(size, variance_size);
    let region_means = regions(size, &mean);
    // The variance of a mean of n independent numbers is the mean of their variances over n.
    let whole = region_means.len() - 1;
    let mut counts = vec![0.0; region_means.len()];
    for i in 0..size.pixels() {
        counts[region_of(size, i)] += 1.0;
        counts[whole] += 1.0;
    }
    let region_variances =
        regions(size, &variance).into_iter().zip(counts).map(|(mean, count): (Rgb64, f64)| mean.map(|m| m / count));
    let pair = |(mean, variance)| Moments { mean, variance };
    Estimate {
        size,
        pixels: mean.into_iter().zip(variance).map(pair).collect(),
        regions: region_means.into_iter().zip(region_variances).map(pair).collect(),
    }
}

/// Mean over batches, and the variance of that mean from their spread.
fn moments_of_batches(batches: &[Vec<Rgb64>]) -> Vec<Moments> {
    let count = batches.len() as f64;
    (0..batches[0].len())
        .map(|i| {
            let mut moments = Moments::default();
            for c in 0..3 {
                let mean = batches.iter().map(|b| b[i][c]).sum::<f64>() / count;
                let squares: f64 = batches.iter().map(|b| (b[i][c] - mean).powi(2)).sum();
                moments.mean[c] = mean;
                moments.variance[c] = squares / (count * (count - 1.0));
            }
            moments
        })
        .collect()
}

/// quell's picture, camera 1 at frame 0.
pub(crate) fn quell(scene: &Scene, options: &RenderOptions, kind: ReferenceKind, samples_a_batch: u32) -> Estimate {
    let tracer = Tracer::new(scene, 0, 1).unwrap();
    let batches: Vec<Vec<Rgb64>> = (0..BATCHES)
        .map(|batch| {
            let options = RenderOptions { seed: u64::from(batch), ..*options };
            let reference = tracer.reference(&options, kind, Half::A, 0..samples_a_batch, &Control::default()).unwrap();
            reference.beauty.data().iter().map(|p| p.map(f64::from)).collect()
        })
        .collect();
    let region_batches: Vec<Vec<Rgb64>> = batches.iter().map(|b| regions(options.size, b)).collect();
    Estimate { size: options.size, pixels: moments_of_batches(&batches), regions: moments_of_batches(&region_batches) }
}

/// Probability that |t| of Student's distribution with `BATCHES` - 1 degrees of freedom, an odd number, is larger
/// (Abramowitz and Stegun 26.7.3).
fn student_p(t: f64) -> f64 {
    let freedom = f64::from(BATCHES - 1);
    let angle = (t.abs() / freedom.sqrt()).atan();
    let (sin, cos) = angle.sin_cos();
    let (mut term, mut sum) = (cos, cos);
    for k in (3..BATCHES - 2).step_by(2) {
        term *= cos * cos * f64::from(k - 1) / f64::from(k);
        sum += term;
    }
    (1.0 - FRAC_2_PI * (angle + sin * sum)).max(0.0)
}

/// All z of a set of means: index, channel, value.
fn z_scores(a: &[Moments], b: &[Moments]) -> Vec<(usize, usize, f64)> {
    let mut scores = Vec::with_capacity(3 * a.len());
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        for c in 0..3 {
            let rounding = ROUNDING * b.mean[c];
            let deviation = (a.variance[c] + b.variance[c] + rounding * rounding).sqrt();
            let difference = a.mean[c] - b.mean[c];
            scores.push((i, c, if difference == 0.0 { 0.0 } else { difference / deviation }));
        }
    }
    scores
}

/// What the test says of two pictures: empty, or what is wrong with them.
pub(crate) fn rejections(a: &Estimate, b: &Estimate) -> (Vec<String>, String) {
    assert_eq!(a.size, b.size);
    let mut wrong = Vec::new();
    for (i, moments) in a.pixels.iter().enumerate() {
        if moments.mean.iter().chain(&moments.variance).any(|v| !v.is_finite()) {
            wrong.push(format!("pixel {i}: {moments:?}"));
        }
    }
    let mut summary = String::new();
    for (what, a, b) in [("pixel", &a.pixels, &b.pixels), ("region", &a.regions, &b.regions)] {
        let scores = z_scores(a, b);
        let (i, c, worst) =
            scores.iter().copied().fold((0, 0, 0.0_f64), |w, s| if s.2.abs() > w.2.abs() { s } else { w });
        // Sidak: the probability that none of n independent numbers is rejected is the n-th power of one's. Channels
        // are not independent, which only lowers the level.
        let level_of_one = 1.0 - (1.0 - LEVEL).powf(1.0 / scores.len() as f64);
        let p = student_p(worst);
        let text = format!(
            "{what} {i} channel {c}: z {worst:.2}, p {p:.1e} (rejected below {level_of_one:.1e}), quell {:.5} Mitsuba \
             {:.5}; ",
            a[i].mean[c], b[i].mean[c]
        );
        summary += &text;
        if p < level_of_one {
            wrong.push(text);
        }
    }
    // The spread of z over the pixels that have noise: of one channel, since the others repeat its noise.
    let noisy: Vec<f64> = z_scores(&a.pixels, &b.pixels)
        .into_iter()
        .filter(|(i, c, _)| *c == 1 && b.pixels[*i].variance[1] > 0.0)
        .map(|(_, _, z)| z)
        .collect();
    let n = noisy.len() as f64;
    let mean = noisy.iter().sum::<f64>() / n;
    let spread = noisy.iter().map(|z| z * z).sum::<f64>() / n;
    // Student's second and fourth moments.
    let freedom = f64::from(BATCHES - 1);
    let second = freedom / (freedom - 2.0);
    let fourth = 3.0 * freedom * freedom / ((freedom - 2.0) * (freedom - 4.0));
    let allowed = SPREAD_SIGMAS * ((fourth - second * second) / n).sqrt();
    let text = format!("mean of z {mean:.3}, mean of z^2 {spread:.3} (expected {second:.3} +- {allowed:.3})");
    summary += &text;
    if (spread - second).abs() > allowed {
        wrong.push(text);
    }
    (wrong, summary)
}

/// The same picture in another brightness.
pub(crate) fn scaled(estimate: &Estimate, factor: f64) -> Estimate {
    let mut out = estimate.clone();
    for moments in out.pixels.iter_mut().chain(&mut out.regions) {
        moments.mean = moments.mean.map(|m| m * factor);
        moments.variance = moments.variance.map(|v| v * factor * factor);
    }
    out
}

/// Both kinds of reference against the picture of Mitsuba, and what must not pass.
fn agree(name: &str, scene: &Scene, bounces: u32) {
    let expected = mitsuba(name);
    let options = RenderOptions { bounces, ..RenderOptions::new(expected.size) };
    for kind in [ReferenceKind::Factored, ReferenceKind::FullIntegral] {
        let start = std::time::Instant::now();
        let found = quell(scene, &options, kind, SAMPLES_A_BATCH);
        let (wrong, summary) = rejections(&found, &expected);
        println!("{name}, {kind:?}, {:.1} s: {summary}", start.elapsed().as_secs_f64());
        assert!(wrong.is_empty(), "{name}, {kind:?}: {wrong:#?}");
        for factor in [0.99, 1.01] {
            let (wrong, _) = rejections(&scaled(&found, factor), &expected);
            assert!(!wrong.is_empty(), "{name}, {kind:?}: {factor} times the picture passes");
        }
    }
    // Canaries of physics, with fewer samples.
    let mut damped = options;
    damped.model.fresnel_rough_damping = true;
    let paper = RenderOptions { estimator: Estimator::Paper, ..options };
    let longer = RenderOptions { bounces: bounces + 1, ..options };
    for (what, options) in [("one bounce more", longer), ("Fresnel damped", damped), ("the paper's estimator", paper)] {
        let found = quell(scene, &options, ReferenceKind::Factored, SAMPLES_A_BATCH / CANARY_SHARE);
        let (wrong, summary) = rejections(&found, &expected);
        println!("{name}, {what}: {summary}");
        assert!(!wrong.is_empty(), "{name}: {what} passes: {summary}");
    }
}

/// White rough metal (F = 1) on the floor and a box, a satin box, matte walls, a lamp and a dim sky; as in
/// `render.py`.
fn metal_corner() -> Scene {
    let mut scene = Scene::new("metal-corner");
    let material = |r: f32, g: f32, b: f32, roughness: f32, metallic: f32| Material {
        base_color: Vec3::new(r, g, b),
        roughness,
        metallic,
        ..Material::default()
    };
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let floor = scene.surface(material(1.0, 1.0, 1.0, 0.3, 1.0));
    let back = scene.surface(material(0.7, 0.6, 0.4, 0.8, 0.0));
    let left = scene.surface(material(0.7, 0.1, 0.1, 0.8, 0.0));
    let lamp = scene.surface(Material { emission: Vec3::new(4.0, 3.6, 3.0), ..material(0.5, 0.5, 0.5, 0.8, 0.0) });
    let metal = scene.surface(material(1.0, 1.0, 1.0, 0.2, 1.0));
    let satin = scene.surface(material(0.2, 0.4, 0.7, 0.25, 0.0));
    scene.place(shapes::quad(Vec3::new(-1.5, 0.0, 1.5), x * 3.0, -z * 3.0), floor);
    scene.place(shapes::quad(Vec3::new(-1.5, 0.0, -1.5), x * 3.0, y * 2.0), back);
    scene.place(shapes::quad(Vec3::new(-1.5, 0.0, 1.5), -z * 3.0, y * 2.0), left);
    scene.place(shapes::quad(Vec3::new(-1.0, 1.9, -1.0), x * 2.0, z * 1.5), lamp);
    let mut standing = |half: f32, height: f32, degrees: f32, at: Vec3, surface: usize| {
        let mesh = shapes::cuboid(Vec3::new(-half, 0.0, -half), Vec3::new(half, height, half));
        let transform = Affine3A::from_rotation_translation(Quat::from_rotation_y(degrees.to_radians()), at);
        scene.place_moving(mesh, surface, transform);
    };
    standing(0.3, 0.7, 25.0, Vec3::new(0.6, 0.0, -0.4), metal);
    standing(0.25, 0.5, -20.0, Vec3::new(-0.5, 0.0, 0.3), satin);
    scene.environment = Environment::constant(Vec3::new(0.3, 0.4, 0.5));
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.2, 1.2, 3.6), Vec3::new(0.0, 0.6, -0.2), 40.0));
    scene
}

#[test]
fn cornell_box_agrees_with_mitsuba() {
    agree("cornell-box", &builtin("cornell-box").unwrap(), 3);
}

#[test]
fn white_rough_metal_agrees_with_mitsuba() {
    agree("metal-corner", &metal_corner(), 2);
}

#[test]
fn the_tail_of_students_distribution_is_right() {
    // From tables: 63 degrees of freedom.
    for (t, p) in [(0.0, 1.0), (1.998341, 0.05), (3.452, 0.001)] {
        assert!((student_p(t) - p).abs() < 1e-3 * p, "{t}: {}", student_p(t));
    }
}
