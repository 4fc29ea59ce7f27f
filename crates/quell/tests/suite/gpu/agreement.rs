//! Every pass against its reference on the same inputs. Each comparison is shown to fail on planted differences, in the
//! outputs and in every piece of WGSL.

use super::device::{By, Job, Output, gpu};
use super::inputs::Inputs;
use crate::suite::frames::{
    Noise, Scene, box_before_wall, floor, jittered, mirror, moving, moving_jittered, sphere, with_radius,
};
use quell::gpu::{Kernel, Pass, Storage};
use quell::stages::glossy_bilateral::Axis;
use quell::{FrameBuf, Plane, Rgb, Settings, Signal, Size};

/// How far outputs may lie apart.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// Largest difference, relative to the pixel's value plus the plane's mean magnitude.
    pub relative: f64,
    /// Share of values beyond it: a decision at a threshold may have flipped.
    pub flips: f64,
}

/// Choices between values; sums of at most five terms, of which a multiplication and an addition may be fused.
const EXACT: Bound = Bound { relative: 1e-6, flips: 0.0 };
/// Stages 4, 7, 9, 10: sums of taps in f32, in the reference in f64; WGSL allows a quotient or a root 2.5 units in the
/// last place, and the offset of a tap is a difference of positions, which cancels.
const WEIGHTS: Bound = Bound { relative: 1e-4, flips: 0.0 };
/// Stage 3: positions relative to the eye, in the reference in world space; trust falls over a short distance.
const SURFACES: Bound = Bound { relative: 1e-4, flips: 1e-3 };
/// Stage 8: the place in the previous image by f32 arithmetic, in the reference by f64; noisy neighbours there differ by
/// more than their mean, so the interpolation shows the place's error enlarged.
const MIRRORS: Bound = Bound { relative: 5e-4, flips: 2e-3 };

/// 30 frames of everything: `WEIGHTS` and `MIRRORS` fed back; stage 6 replaces a value or not.
pub const SEQUENCE: Bound = Bound { relative: 5e-4, flips: 2e-3 };

fn worst(p: f32, q: f32, magnitude: f64) -> f64 {
    let scale = f64::from(p.abs().max(q.abs())) + magnitude;
    let d = f64::from((p - q).abs()) / if scale > 0.0 { scale } else { 1.0 };
    if d.is_nan() { f64::INFINITY } else { d }
}

type Pairs = Vec<(f32, f32)>;
/// A plane's name, its pairs of values, how far each pair lies apart.
type Apart = (&'static str, Pairs, Vec<f64>);

/// Every plane of both: its name, the pairs of values, and how far each pair lies apart, relative to itself and to the
/// plane's mean magnitude (of shares and frames: 1).
fn differences(a: &Output, b: &Output) -> Result<Vec<Apart>, String> {
    assert_ne!(a.by, b.by, "a back end always agrees with itself");
    if a.colours.len() != b.colours.len() || a.scalars.len() != b.scalars.len() {
        return Err("another number of planes".to_owned());
    }
    let mut planes: Vec<(&str, f64, Pairs)> = Vec::new();
    for ((name, p), (_, q)) in a.colours.iter().zip(&b.colours) {
        let values: Pairs = p.data().iter().flatten().copied().zip(q.data().iter().flatten().copied()).collect();
        let magnitude = values.iter().map(|(p, _)| f64::from(p.abs())).sum::<f64>() / values.len() as f64;
        planes.push((name, magnitude, values));
    }
    for ((name, p), (_, q)) in a.scalars.iter().zip(&b.scalars) {
        planes.push((name, 1.0, p.data().iter().copied().zip(q.data().iter().copied()).collect()));
    }
    let apart = |(name, magnitude, values): (&'static str, f64, Pairs)| {
        let differences = values.iter().map(|(p, q)| worst(*p, *q, magnitude)).collect();
        (name, values, differences)
    };
    Ok(planes.into_iter().map(apart).collect())
}

pub fn compare(a: &Output, b: &Output, bound: Bound) -> Result<f64, String> {
    let mut largest = 0.0f64;
    for (name, values, differences) in differences(a, b)? {
        let flipped = differences.iter().filter(|d| **d > bound.relative).count();
        let most = differences.iter().copied().fold(0.0, f64::max);
        // One value in a small picture is a large share: with a margin one pixel may always flip.
        let allowed = if bound.flips > 0.0 { (bound.flips * values.len() as f64).max(3.0) } else { 0.0 };
        if flipped as f64 > allowed {
            let at = differences.iter().position(|d| *d == most).unwrap_or(0);
            let (p, q) = values[at];
            return Err(format!("{name}: {flipped} of {} differ, by up to {most:e} ({p} and {q})", values.len()));
        }
        largest = differences.into_iter().filter(|d| *d <= bound.relative).fold(largest, f64::max);
    }
    Ok(largest)
}

/// Planted differences in an output, each of which every comparison must see.
pub fn canaries(output: &Output) -> Vec<(&'static str, Output)> {
    let with = |change: &dyn Fn(&mut Plane<Rgb>)| {
        let mut changed = output.clone();
        changed.colours.iter_mut().for_each(|(_, p)| change(p));
        changed
    };
    let mut all = vec![
        ("scaled by 1 %", with(&|p| p.data_mut().iter_mut().flatten().for_each(|v| *v *= 1.01))),
        ("shifted by a pixel", with(&|p| p.data_mut().rotate_right(1))),
        ("channels swapped", with(&|p| p.data_mut().iter_mut().for_each(|c| c.swap(0, 2)))),
    ];
    for k in 0..output.scalars.len() {
        let mut changed = output.clone();
        changed.scalars[k].1.data_mut().iter_mut().for_each(|v| *v = *v * 0.99 + 0.01 * f32::from(*v == 0.0));
        all.push(("a scalar off by 1 %", changed));
    }
    all
}

pub const SIZE: Size = Size::new(83, 49);
/// The smallest pictures, and those of one row or column.
const SMALL: [Size; 3] = [Size::new(1, 1), Size::new(1, 37), Size::new(53, 1)];

pub fn scenes() -> [(&'static str, Scene); 5] {
    let noise = Noise::Sparse(0.4);
    [
        ("floor", floor(moving, noise)),
        ("box", box_before_wall(moving, noise)),
        ("mirror", mirror(moving, true, noise)),
        ("sphere", sphere(moving_jittered, noise)),
        ("jittered", mirror(jittered, false, noise)),
    ]
}

/// Trust of the host, gloss and ids that change, motion that is not known, background by its normal.
pub fn unusual(frame: &mut FrameBuf) {
    let size = frame.size;
    frame.confidence_in = Some(Plane::from_fn(size, |x, y| [1.0, 0.5, 1.0, 0.0, 1.0][(x + 2 * y) % 5]));
    frame.surface_id = Some(Plane::from_fn(size, |x, y| ((x / 23 + y / 11) % 3) as u32));
    frame.roughness = Some(Plane::from_fn(size, |x, _| 0.05 + 0.3 * x as f32 / size.width as f32));
    if let (Some(motion), Some(normal)) = (&mut frame.motion, &mut frame.normal) {
        for i in (0..size.pixels()).step_by(11) {
            motion.data_mut()[i] = [f32::NAN; 2];
            normal.data_mut()[(7 * i + 3) % size.pixels()] = [0.0; 3];
        }
    }
}

/// Parallel rays along -z, on a slightly tilted plane whose normals are left out.
fn parallel(frame: &mut FrameBuf) {
    for camera in [&mut frame.camera, &mut frame.previous_camera] {
        let shift = 0.01 * frame.index as f32;
        camera.clip_from_world = [0.3, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, shift, 0.0, 0.0, 1.0];
    }
    frame.view_depth = Some(Plane::from_fn(frame.size, |x, y| 3.0 + 0.02 * x as f32 - 0.01 * y as f32));
    (frame.motion, frame.normal) = (None, None);
}

pub fn settings_with(changes: &[(&str, &str)]) -> Settings {
    let mut s = with_radius(Settings::default(), SIZE, 12.0);
    changes.iter().for_each(|(name, value)| s.set(name, value).unwrap());
    s
}

/// One comparison: what it is called, its bound, its settings, the job that it makes of inputs.
pub struct Case {
    pub name: &'static str,
    bound: Bound,
    pub changes: &'static [(&'static str, &'static str)],
    pub job: fn(&Inputs, &Settings) -> Job,
}

const fn case(
    name: &'static str,
    bound: Bound,
    changes: &'static [(&'static str, &'static str)],
    job: fn(&Inputs, &Settings) -> Job,
) -> Case {
    Case { name, bound, changes, job }
}

/// What every surface reflects is fetched by the spline.
const SPLINE: &[(&str, &str)] = &[("glossy_temporal.spline_roughness", "1")];
/// Everything is a mirror, and no hit distance is quite right; now its part, now the size of a pixel is the limit.
const HITS: &[(&str, &str)] = &[
    ("glossy_temporal.mirror_roughness", "1"),
    ("glossy_temporal.hit_tolerance", "0.01"),
    ("surface.pixel_distance", "0.1"),
];

/// A luminance stop, and lobes wide enough that every level acts.
const YOUNG_GLOSSY: &[(&str, &str)] =
    &[("young_filter.deviations", "3"), ("young_filter.lobe", "0.5"), ("young_filter.least_lobe", "2")];

/// A luminance stop, and levels that do not fade.
const YOUNG_STAYS: &[(&str, &str)] = &[
    ("young_filter.deviations", "3"),
    ("young_filter.matte_stays", "on"),
    ("young_filter.frames", "2"),
    ("disocclusion.enabled", "off"),
];
/// A luminance stop where history is long enough not to be filtered.
const YOUNG_MATURE: &[(&str, &str)] =
    &[("young_filter.deviations", "4"), ("young_filter.frames", "1.5"), ("disocclusion.enabled", "off")];

/// A first level that stops by contrast, alone and where it finds the noise.
const YOUNG_CONTRAST: &[(&str, &str)] = &[("young_filter.matte_contrast", "2")];
const YOUNG_GLOSSY_CONTRAST: &[(&str, &str)] =
    &[("young_filter.glossy_contrast", "1.5"), ("young_filter.deviations", "3"), ("young_filter.least_lobe", "2")];

/// Its contrast bounds the noise of further levels.
const YOUNG_FURTHER: &[(&str, &str)] = &[
    ("young_filter.matte_contrast", "4"),
    ("young_filter.glossy_contrast", "3"),
    ("young_filter.further_contrast", "0.5"),
    ("young_filter.deviations", "4"),
    ("young_filter.least_lobe", "2"),
];

/// The widest level, which fades though the others stay.
const YOUNG_WIDE: &[(&str, &str)] = &[
    ("young_filter.matte_levels", "4"),
    ("young_filter.wide_frames", "20"),
    ("young_filter.deviations", "3"),
    ("young_filter.matte_stays", "on"),
    ("disocclusion.enabled", "off"),
];
/// Noise switches the contact stop off.
const NOISY_CONTACT: &[(&str, &str)] =
    &[("edge.contact", "0.5"), ("young_filter.contact_noise", "2"), ("young_filter.deviations", "3")];

/// Neighbours of other surfaces count where few show the same one, as most do where normals must agree closely.
const YOUNG_ISOLATED: &[(&str, &str)] = &[
    ("young_filter.isolated", "6"),
    ("young_filter.deviations", "3"),
    ("young_filter.matte_contrast", "2"),
    ("young_filter.least_lobe", "2"),
    ("edge.normal", "8"),
];

/// Light that is looked at closely: nearly every difference between the means counts, and part of history stays.
const CHANGED: &[(&str, &str)] = &[
    ("changed_light.matte", "on"),
    ("changed_light.glossy", "on"),
    ("changed_light.fast", "0.2"),
    ("changed_light.begin", "0.3"),
    ("changed_light.certain", "4"),
    ("changed_light.least", "0.01"),
    ("changed_light.radius", "2"),
    ("changed_light.spacing", "2"),
];

/// The table: every comparison with its bound.
pub const CASES: &[Case] = &[
    case("3", SURFACES, &[], |i, s| i.temporal(Signal::Matte, s, true)),
    case("3, after a cut", EXACT, &[], |i, s| i.temporal(Signal::Matte, s, false)),
    case("3, box", SURFACES, &[("matte_temporal.clip", "box"), ("matte_temporal.clip_radius", "3")], |i, s| {
        i.temporal(Signal::Matte, s, true)
    }),
    case("3, deviations", SURFACES, &[("matte_temporal.clip", "sigma")], |i, s| i.temporal(Signal::Matte, s, true)),
    case("3, by point", SURFACES, &[("surface.rejection", "point")], |i, s| i.temporal(Signal::Matte, s, true)),
    case("3, no rejection", SURFACES, &[("surface.rejection", "off"), ("matte_temporal.ramp", "off")], |i, s| {
        i.temporal(Signal::Matte, s, true)
    }),
    case("3, guarded", SURFACES, &[("surface.guard_band", "3")], |i, s| i.temporal(Signal::Matte, s, true)),
    case("3, lost footprint", SURFACES, &[("surface.lost_footprint", "2")], |i, s| i.temporal(Signal::Matte, s, true)),
    case("3, alike", SURFACES, &[("surface.normal_min", "0.9999")], |i, s| i.temporal(Signal::Matte, s, true)),
    case("3, changed", SURFACES, CHANGED, |i, s| i.temporal(Signal::Matte, s, true)),
    case("3, changed, after a cut", EXACT, CHANGED, |i, s| i.temporal(Signal::Matte, s, false)),
    case("3, changed, joint", SURFACES, CHANGED, |i, s| i.temporal_joint(Signal::Matte, s)),
    case("young 1, beside", WEIGHTS, CHANGED, |i, s| i.young(Signal::Matte, 0, s)),
    case("8, changed", MIRRORS, CHANGED, |i, s| i.temporal(Signal::Glossy, s, true)),
    case("3+8, changed", MIRRORS, CHANGED, |i, s| i.both_temporal(s)),
    case("young 1", WEIGHTS, &[("young_filter.frames", "3.5")], |i, s| i.young(Signal::Matte, 0, s)),
    case("young 3", WEIGHTS, &[("young_filter.frames", "24")], |i, s| i.young(Signal::Matte, 1, s)),
    case("young 9", WEIGHTS, &[("young_filter.frames", "60")], |i, s| i.young(Signal::Matte, 2, s)),
    case("young 27", WEIGHTS, YOUNG_WIDE, |i, s| i.young(Signal::Matte, 3, s)),
    case("young 27, joint", WEIGHTS, YOUNG_WIDE, |i, s| i.young_joint(Signal::Matte, 3, s)),
    case("young glossy 1", WEIGHTS, &[("young_filter.lobe", "0.05"), ("young_filter.least_lobe", "0.3")], |i, s| {
        i.young(Signal::Glossy, 0, s)
    }),
    case("young glossy 3", WEIGHTS, &[("young_filter.lobe", "0.2")], |i, s| i.young(Signal::Glossy, 1, s)),
    case("young glossy 9", WEIGHTS, &[("young_filter.lobe", "0.5")], |i, s| i.young(Signal::Glossy, 2, s)),
    case("young 1, stop", WEIGHTS, &[("young_filter.deviations", "4")], |i, s| i.young(Signal::Matte, 0, s)),
    case("young 1, stop, mature", WEIGHTS, YOUNG_MATURE, |i, s| i.young(Signal::Matte, 0, s)),
    case("young 3, stop", WEIGHTS, &[("young_filter.deviations", "3")], |i, s| i.young(Signal::Matte, 1, s)),
    case("young 9, stop", WEIGHTS, YOUNG_STAYS, |i, s| i.young(Signal::Matte, 2, s)),
    case("young 9, stop, kept", WEIGHTS, &[("young_filter.deviations", "2")], |i, s| i.young(Signal::Matte, 2, s)),
    case("young glossy 1, stop", WEIGHTS, YOUNG_GLOSSY, |i, s| i.young(Signal::Glossy, 0, s)),
    case("young glossy 3, stop", WEIGHTS, YOUNG_GLOSSY, |i, s| i.young(Signal::Glossy, 1, s)),
    case("young 1, contact", WEIGHTS, &[("edge.contact", "0.5")], |i, s| i.young(Signal::Matte, 0, s)),
    case("young 3, contact", WEIGHTS, &[("edge.contact", "0.5")], |i, s| i.young_joint(Signal::Matte, 1, s)),
    case("young 1, contact, noise", WEIGHTS, NOISY_CONTACT, |i, s| i.young(Signal::Matte, 0, s)),
    case("young 3, contact, noise", WEIGHTS, NOISY_CONTACT, |i, s| i.young(Signal::Matte, 1, s)),
    case("young 1, isolated", WEIGHTS, YOUNG_ISOLATED, |i, s| i.young(Signal::Matte, 0, s)),
    case("young glossy 1, isolated", WEIGHTS, YOUNG_ISOLATED, |i, s| i.young(Signal::Glossy, 0, s)),
    case("young 1, contrast", WEIGHTS, YOUNG_CONTRAST, |i, s| i.young(Signal::Matte, 0, s)),
    case("young glossy 1, contrast", WEIGHTS, YOUNG_GLOSSY_CONTRAST, |i, s| i.young(Signal::Glossy, 0, s)),
    case("young 3, further contrast", WEIGHTS, YOUNG_FURTHER, |i, s| i.young(Signal::Matte, 1, s)),
    case("young glossy 3, further contrast", WEIGHTS, YOUNG_FURTHER, |i, s| i.young(Signal::Glossy, 1, s)),
    case("young 1, joint", WEIGHTS, YOUNG_CONTRAST, |i, s| i.young_joint(Signal::Matte, 0, s)),
    case("young glossy 1, joint", WEIGHTS, YOUNG_GLOSSY_CONTRAST, |i, s| i.young_joint(Signal::Glossy, 0, s)),
    case("young 3, joint", WEIGHTS, &[("young_filter.deviations", "3")], |i, s| i.young_joint(Signal::Matte, 1, s)),
    case("young 9, joint", WEIGHTS, &[("young_filter.deviations", "3")], |i, s| i.young_joint(Signal::Matte, 2, s)),
    case("young glossy 3, joint", WEIGHTS, YOUNG_GLOSSY, |i, s| i.young_joint(Signal::Glossy, 1, s)),
    case("young glossy 9, joint", WEIGHTS, YOUNG_GLOSSY, |i, s| i.young_joint(Signal::Glossy, 2, s)),
    case("4", WEIGHTS, &[], |i, s| i.sparse(false, s)),
    case("4, mirrored", WEIGHTS, &[("matte_prefilter.off_screen", "mirror")], |i, s| i.sparse(false, s)),
    case("4, gloss", WEIGHTS, &[("edge.matte_gloss", "1")], |i, s| i.sparse(false, s)),
    case("5", EXACT, &[("disocclusion.feedback_floor", "0.6")], |i, s| i.disocclusion(s)),
    case("5, wide", EXACT, &[("disocclusion.radius", "8"), ("disocclusion.blur", "5")], |i, s| i.disocclusion(s)),
    case("5+6", EXACT, &[], |i, s| i.disocclusion_firefly(s)),
    case("5+6, wide", EXACT, &[("disocclusion.radius", "8"), ("disocclusion.blur", "8")], |i, s| {
        i.disocclusion_firefly(s)
    }),
    case("6", EXACT, &[], |i, s| i.firefly(s)),
    case("6, plain", EXACT, &[("firefly.plain", "on")], |i, s| i.firefly(s)),
    case("6, luminance", EXACT, &[("firefly.median", "luminance")], |i, s| i.firefly(s)),
    case("3, joint", SURFACES, &[], |i, s| i.temporal_joint(Signal::Matte, s)),
    case("3, joint, box", SURFACES, &[("matte_temporal.clip", "box")], |i, s| i.temporal_joint(Signal::Matte, s)),
    case("6, joint", EXACT, &[], |i, s| i.firefly_joint(s)),
    case("6, joint, luminance", EXACT, &[("firefly.median", "luminance")], |i, s| i.firefly_joint(s)),
    case("8, joint", MIRRORS, &[], |i, s| i.temporal_joint(Signal::Glossy, s)),
    case("7", WEIGHTS, &[], |i, s| i.sparse(true, s)),
    case("4, contact", WEIGHTS, &[("edge.contact", "0.3"), ("matte_prefilter.radius", "96")], |i, s| {
        i.sparse(false, s)
    }),
    case("7, contact", WEIGHTS, &[("edge.contact", "0.5"), ("matte_bilateral.radius", "96")], |i, s| i.sparse(true, s)),
    case("8", MIRRORS, &[], |i, s| i.temporal(Signal::Glossy, s, true)),
    case("8, after a cut", EXACT, &[], |i, s| i.temporal(Signal::Glossy, s, false)),
    case("8, box", MIRRORS, &[("glossy_temporal.clip", "box")], |i, s| i.temporal(Signal::Glossy, s, true)),
    case("8, no clip", MIRRORS, &[("glossy_temporal.clip", "off")], |i, s| i.temporal(Signal::Glossy, s, true)),
    case("8, median", MIRRORS, &[("glossy_temporal.hit_filter", "median")], |i, s| i.temporal(Signal::Glossy, s, true)),
    case("8, unfiltered", MIRRORS, &[("glossy_temporal.hit_filter", "off")], |i, s| {
        i.temporal(Signal::Glossy, s, true)
    }),
    case("8, hits", MIRRORS, HITS, |i, s| i.temporal(Signal::Glossy, s, true)),
    case("8, hits, joint", MIRRORS, HITS, |i, s| i.temporal_joint(Signal::Glossy, s)),
    case("3+8, hits", MIRRORS, HITS, |i, s| i.both_temporal(s)),
    case("8, spline", MIRRORS, SPLINE, |i, s| i.temporal(Signal::Glossy, s, true)),
    case("8, spline, joint", MIRRORS, SPLINE, |i, s| i.temporal_joint(Signal::Glossy, s)),
    case("3+8, spline", MIRRORS, SPLINE, |i, s| i.both_temporal(s)),
    case("8, plane", MIRRORS, &[("glossy_temporal.curvature", "off")], |i, s| i.temporal(Signal::Glossy, s, true)),
    case("8, not virtual", SURFACES, &[("glossy_temporal.virtual_reprojection", "off")], |i, s| {
        i.temporal(Signal::Glossy, s, true)
    }),
    case("3+8", MIRRORS, &[], |i, s| i.both_temporal(s)),
    case("9", WEIGHTS, &[], |i, s| i.glossy(Axis::Horizontal, s)),
    case("10", WEIGHTS, &[], |i, s| i.glossy(Axis::Vertical, s)),
    case("9, monotone", WEIGHTS, &[("edge.monotone", "on")], |i, s| i.glossy(Axis::Horizontal, s)),
    case("10, constant", WEIGHTS, &[("glossy_bilateral.radius", "constant")], |i, s| i.glossy(Axis::Vertical, s)),
    case("11", EXACT, &[], |i, s| i.direct_taa(s, true)),
    case("11, after a cut", EXACT, &[], |i, s| i.direct_taa(s, false)),
    case("antialiasing", WEIGHTS, &[("antialiasing.thin_depth", "0.05")], |i, s| i.antialiasing(s, true)),
    case("antialiasing, one box", WEIGHTS, &[("antialiasing.thin_radius", "0")], |i, s| i.antialiasing(s, true)),
    case("antialiasing, after a cut", EXACT, &[], |i, s| i.antialiasing(s, false)),
    case("composite", EXACT, &[], |i, s| i.composite(s, [true, true, false, false])),
    case("composite, all", EXACT, &[], |i, s| i.composite(s, [true; 4])),
    case("composite, unweighted", EXACT, &[], |i, s| i.unweighted(s)),
    case("composite, glossy", EXACT, &[], |i, s| i.composite(s, [false, true, false, false])),
];

/// Compiled passes, each once.
#[derive(Default)]
struct Kernels(Vec<(&'static str, Kernel)>);

impl Kernels {
    fn get(&mut self, gpu: &super::device::Gpu, pass: Pass) -> &Kernel {
        let at = self.0.iter().position(|(name, _)| *name == pass.name).unwrap_or_else(|| {
            self.0.push((pass.name, Kernel::new(&gpu.device, pass, Storage::Float, false)));
            self.0.len() - 1
        });
        &self.0[at].1
    }
}

#[test]
fn every_pass_agrees() {
    let Some(gpu) = gpu() else { return };
    let mut kernels = Kernels::default();
    let mut failures = Vec::new();
    let mut seen: Vec<f64> = vec![0.0; CASES.len()];
    for (scene_name, scene) in scenes() {
        for (kind, inputs) in
            [("plain", Inputs::new(&scene, SIZE, |_| ())), ("unusual", Inputs::new(&scene, SIZE, unusual))]
        {
            for (case, seen) in CASES.iter().zip(&mut seen) {
                let job = (case.job)(&inputs, &settings_with(case.changes));
                let output = gpu.run(kernels.get(gpu, job.pass), &job);
                match compare(&job.expected, &output, case.bound) {
                    Ok(difference) => *seen = seen.max(difference),
                    Err(difference) => failures.push(format!("{scene_name}, {kind}, {}: {difference}", case.name)),
                }
                for (canary, planted) in canaries(&output) {
                    if compare(&job.expected, &planted, case.bound).is_ok() {
                        failures.push(format!("{scene_name}, {kind}, {}: {canary} went unseen", case.name));
                    }
                }
            }
        }
    }
    for (case, seen) in CASES.iter().zip(seen) {
        println!("{:<18} {seen:.1e} of {:.0e}", case.name, case.bound.relative);
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn small_pictures_and_missing_planes_agree() {
    let Some(gpu) = gpu() else { return };
    let mut kernels = Kernels::default();
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let missing = |frame: &mut FrameBuf| {
        (frame.roughness, frame.glossy_hit_distance, frame.motion) = (None, None, None);
        frame.surface_id = None;
    };
    let mut all: Vec<(String, Inputs)> = vec![("missing".to_owned(), Inputs::new(&scene, Size::new(37, 23), missing))];
    all.extend(SMALL.map(|size| (size.to_string(), Inputs::new(&scene, size, |_| ()))));
    let mut failures = Vec::new();
    for (name, inputs) in &all {
        for case in CASES {
            let job = (case.job)(inputs, &settings_with(case.changes));
            let output = gpu.run(kernels.get(gpu, job.pass), &job);
            if let Err(difference) = compare(&job.expected, &output, case.bound) {
                failures.push(format!("{name}, {}: {difference}", case.name));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn parallel_rays_agree() {
    let Some(gpu) = gpu() else { return };
    let mut kernels = Kernels::default();
    let inputs = Inputs::new(&floor(moving, Noise::Uniform), SIZE, parallel);
    for case in CASES {
        let job = (case.job)(&inputs, &settings_with(case.changes));
        let output = gpu.run(kernels.get(gpu, job.pass), &job);
        if let Err(difference) = compare(&job.expected, &output, case.bound) {
            panic!("{}: {difference}", case.name);
        }
    }
}

/// A change planted in the WGSL of a pass that the named comparison must see.
pub const PLANTED: &[(&str, &str, &str)] = &[
    // frame.wgsl
    ("3", "return view.eye + (", "return ("),
    ("4", "return view.origin[0] + view.origin[1] * pixel.x", "return view.origin[0] + view.origin[2] * pixel.x"),
    ("8", "homogeneous.xy / homogeneous.z", "homogeneous.xy / (1.001 * homogeneous.z)"),
    ("4", "select(1.0, view_depth, view.perspective != 0u)", "1e6"),
    // storage/float.wgsl
    ("3", "return Moving(v.xy, v.z, v.w);", "return Moving(v.yx, v.z, v.w);"),
    // guides
    ("9", "pixel_centre(pixel) + frame.jitter", "vec2f(pixel).yx"),
    ("6", "return depth_at(pixel) != BACKGROUND;", "return true;"),
    ("4", "geometry_normal(shape, skin),\n        depth,", "vec3f(0.0, 0.0, 1.0),\n        depth,"),
    (
        "3",
        "return moving_of(textureLoad(moving, pixel, 0), depth);",
        "return moving_of(textureLoad(moving, pixel.yx, 0), depth);",
    ),
    (
        "3",
        "let shape = textureLoad(geometry_before, pixel, 0);",
        "let shape = textureLoad(geometry_before, pixel + 1, 0);",
    ),
    // kernels
    ("6, luminance", "LUMINANCE.x * c.x + LUMINANCE.y * c.y", "LUMINANCE.y * c.x + LUMINANCE.x * c.y"),
    ("3, by point", "t * t * (3.0 - 2.0 * t)", "t"),
    ("5", "a * (1.0 - t) + b * t", "a"),
    ("9", "(0.5 + r * (1.0 / 6.0", "(0.45 + r * (1.0 / 6.0"),
    ("4", "w_depth * w_normal * w_plane * w_gloss", "w_depth * w_plane * w_gloss"),
    ("4", "w_depth * w_normal * w_plane * w_gloss", "w_normal * w_plane * w_gloss"),
    ("4", "w_depth * w_normal * w_plane * w_gloss", "w_depth * w_normal * w_gloss"),
    ("4, gloss", "w_depth * w_normal * w_plane * w_gloss", "w_depth * w_normal * w_plane"),
    ("4", "if q.id != p.id ||", "if"),
    ("4", "(pixel.y % PERIOD) * PERIOD + pixel.x % PERIOD", "(pixel.x % PERIOD) * PERIOD + pixel.y % PERIOD"),
    ("4, mirrored", "2 * extent - 1 - position", "2 * extent - 2 - position"),
    ("3, box", "max(bounds.high, c)", "bounds.high"),
    ("3, deviations", "mean + gamma * deviation", "mean"),
    ("3", "weight / total, trusted / total", "weight, trusted / total"),
    ("3, by point", "trusted / total", "1.0"),
    ("3, alike", "< settings.surface.normal_min", "< -2.0"),
    ("3", "vec2i(k & 1, k >> 1u)", "vec2i(k >> 1u, k & 1)"),
    ("3", "min(frames / blend.confidence_frames, 1.0)", "1.0"),
    ("3, changed", "max(spread.y, spread.x * (weights.y / weights.x / blend.fast_frames))", "spread.y"),
    ("3, changed", "max(spread.y, spread.x * (weights.y / weights.x / blend.fast_frames))", "0.0"),
    ("3, changed", "length * (1.0 - changed * own)", "length"),
    ("3, changed, joint", "length * (1.0 - changed * own)", "length"),
    ("3, changed", "min(CHANGE_OWN * change_weight(blend, change_frames(blend, length)), 1.0)", "1.0"),
    ("3, changed", "vec4f(w, w, w, w * w)", "vec4f(w, w, w, w)"),
    ("3, changed", "tent(blend, vec4f(f32(row * CHANGE_CELL) + middle.y)).x;", "1.0;"),
    ("3, changed", "columns + 4.0 * f32(CHANGE_CELL)", "columns"),
    ("3, changed", "corner / CHANGE_CELL - blend.change_radius", "corner / CHANGE_CELL - blend.change_radius + 1"),
    ("3, changed", "vec2f(long, fast - long)", "vec2f(long, fast)"),
    ("3, changed", "(deviations - blend.change_begin)", "deviations"),
    ("3, changed", "dx += blend.change_spacing", "dx += 1"),
    ("3, changed", "max(1.0 - blend.fast_frames / frames, 0.0)", "1.0"),
    ("3, changed", "weighed.fast * fast + (1.0 - weighed.fast) * kept_light(now)", "kept_light(now)"),
    ("3, changed", "(CHANGE_DARKEST - 1u);", "CHANGE_DARKEST;"),
    ("3, changed", "return bitcast<f32>(bitcast<u32>(texel) & LENGTH_BITS);", "return texel;"),
    (
        "young 1, beside",
        "select(texel, length_beside(texel), is_beside)",
        "select(texel, f32(bitcast<u32>(texel) & CODE_BITS), is_beside)",
    ),
    ("8, changed", "length * (1.0 - changed * own)", "length"),
    ("3", "min(blend.alpha, growing)", "blend.alpha"),
    ("8", "v - 2.0 * dot(v, normal) * normal", "v - 1.9 * dot(v, normal) * normal"),
    ("8, plane", "before.coordinate -= frame.jitter;", ""),
    ("8", " + frame.before_jitter - frame.jitter * frame.to_before", ""),
    ("8", "from_place = surface;", ""),
    ("8", "miss = reflected - mirrored_in(", "miss = reflected - 0.9 * mirrored_in("),
    ("8", "spread = JITTERED_TURN * slack;", ""),
    ("8", "> settings.mirror.reflector_roughness", "> -1.0"),
    ("8", "expected.moved || turned || shifted", "expected.moved"),
    ("8", "vec2f(b * q - c * p, b * p - a * q)", "vec2f(0.0)"),
    ("8, median", "let middle = (others + 1u) / 2u;", "let middle = 0u;"),
    ("8, hits", "textureLoad(moving_before, pixel, 0)", "textureLoad(moving, pixel, 0)"),
    ("8, hits", "settings.mirror.hit_tolerance * wanted", "3.0 * settings.mirror.hit_tolerance * wanted"),
    ("8, hits", "length(hit.point - world_before(q))", "hit.distance"),
    ("8, hits", "|| is_mirror(own.roughness)", ""),
    ("8, spline", "found.first + vec2i(i - 1, j - 1)", "found.first + vec2i(i - 1, j)"),
    ("8, spline", "catmull_rom(found.weight.z + found.weight.w)", "catmull_rom(found.weight.w)"),
    ("8, spline", "let within = hold_to_range(lookup, history, fetched);", "let within = fetched;"),
    ("8, spline", "found.spline = whole && inside", "found.spline = inside"),
    ("8, spline, joint", "let own_history = fetch_colour(", "let own_history = fetch("),
    // stages
    ("3", "accumulate(settings.matte_blend,", "accumulate(settings.glossy_blend,"),
    ("4", "i < shape.taps;", "i + 1u < shape.taps;"),
    ("7", "sum += w * sparse_input(q);", "sum += w * sparse_input(pixel);"),
    ("7, contact", "contact_stop(s.position - p.position, nearest, stops.contact)", "1.0"),
    ("7, contact", "select(CONTACT_FAR, CONTACT_NEAR, i == 0)", "CONTACT_FAR"),
    ("7, contact", "select(CONTACT_FAR, CONTACT_NEAR, i == 0)", "CONTACT_NEAR"),
    ("7, contact", "pixel + vec2i(0, far)", "pixel + vec2i(0, -far)"),
    ("4, contact", "pixel + vec2i(-far, 0)", "pixel + vec2i(far, 0)"),
    ("young 1", "min(young_length(pixel), settings.young.frames)", "young_length(pixel)"),
    ("young 1", "(1.0 / (end - 1.0))", "(1.0 / end)"),
    ("young 3", "var sum = frames * centre;", "var sum = centre;"),
    ("young 3", "let whole = share * edge * counted;", "let whole = share * edge;"),
    ("young 1, stop", "(count / (count - 1.0))", "1.0"),
    ("young 1, stop", "- moments.y * moments.y / moments.x", ""),
    ("young 1, stop", "own_weight * own_weight / frames + share * share * squares", "own_weight * own_weight / frames"),
    ("young glossy 1, contrast", "let own_weight = frames + refused;", "let own_weight = frames;"),
    ("young 1, stop", "edges += vec2f(edge, edge * edge);", "edges += vec2f(edge, edge);"),
    (
        "young 1, stop, mature",
        "let finds = has_stop && step == 1;",
        "let finds = has_stop && step == 1 && share > 0.0;",
    ),
    ("young 1, stop", "if count >= YOUNG_LEAST_NEIGHBOURS", "if count >= 0.0"),
    ("young 3, stop", "return left * left;", "return left;"),
    ("young 3, stop", "own.w * own.w + there.w * there.w", "own.w * own.w"),
    ("young 3, stop", "varied += w * w * there.w * there.w;", "varied += w * there.w * there.w;"),
    ("young 9, stop", "squared = settings.young.deviations * settings", "squared = settings"),
    ("young 1, contrast", "let mean = 0.5 * (p + q);", "let mean = p;"),
    ("young 1, contrast", "(p_frames + q_frames) / (p_frames * q_frames)", "2.0 / p_frames"),
    ("young 1, joint", "let w = whole * like;", "let w = whole;"),
    ("young 1, contrast", "sum += refused * centre;", ""),
    ("young 1, contrast", "total += refused;", ""),
    ("young glossy 1, contrast", "(edge * like) * (edge * like) * counted", "edge * edge * counted"),
    ("young glossy 1, joint", "settings.young.glossy_contrast", "settings.young.matte_contrast"),
    ("young glossy 3, stop", "let least = YOUNG_SAME_LIGHT * (p + q);", "let least = 0.3 * (p + q);"),
    ("young glossy 1", "gain * (roughness * roughness)", "gain * roughness"),
    ("5", "k = max(k, 1.0 - confidence_at", "k = min(k, 1.0 - confidence_at"),
    ("5", "k = max(k, widest_row_at", "k = min(k, widest_row_at"),
    ("5", "sum += widest_at(vec2i(tx, pixel.y));", "sum += widest_at(pixel);"),
    ("5", "sum += rows_at(vec2i(pixel.x, ty));", "sum += rows_at(pixel);"),
    ("6", "return e;", "return d;"),
    ("6, luminance", "const FIREFLY_MIDDLE: u32 = 4u;", "const FIREFLY_MIDDLE: u32 = 5u;"),
    ("6, luminance", "select(so_far.found, vec3u(k),", "select(so_far.found, vec3u(8u - k),"),
    ("8", "reflected.trust *= visible.trust;", "reflected.trust *= 0.9;"),
    ("9", "const LOBE_SPREAD: f32 = 2.0;", "const LOBE_SPREAD: f32 = 1.9;"),
    ("10", "2.0 * frame.view.focal_px * bend", "frame.view.focal_px * bend"),
    ("9", "sum += glossy_nearness(q, there.view_depth);", "sum += 1.0;"),
    ("9, monotone", "edge = min(edge, ceiling);", ""),
    ("11", "there < depth", "there > depth"),
    ("11", "settings.direct_taa.clamp_falloff * relative", "0.0"),
    ("11", "lerp(lerp(a, b, t.x), lerp(c, d, t.x), t.y)", "lerp(a, d, t.x)"),
    ("antialiasing", "there < depth", "there > depth"),
    ("antialiasing", "settings.antialiasing.change_falloff * change", "0.0"),
    ("antialiasing", "settings.antialiasing.resampling * between", "0.0"),
    ("antialiasing", "along[i] * across[j] * there.xyz", "along_frames[i] * across_frames[j] * there.xyz"),
    ("antialiasing", "settings.antialiasing.gamma", "1.0"),
    ("antialiasing", "moving_at(pixel, depth_at(pixel)).confidence_in", "1.0"),
    ("antialiasing", "i32(settings.antialiasing.thin_radius)", "2"),
    ("antialiasing", "depth * (1.0 + settings.antialiasing.thin_depth) < farthest", "depth < farthest"),
    ("antialiasing", "vec2f(settings.antialiasing.thin_motion)", "vec2f(0.0)"),
    ("antialiasing", "farthest = max(farthest, there);", "farthest = FAR;"),
    ("antialiasing", "vec4f(colour, found.w)", "vec4f(colour, 1.0)"),
    ("composite", "weight * signal", "signal"),
    // planes tied to a signal
    ("3, joint, box", "return pass_history * (clamped / history);", "return pass_history;"),
    ("8, joint", "fetch_colour(lookup, pass_history)", "fetch(lookup, history)"),
    ("3, joint", "(1.0 - weighed.history) * own", "(1.0 - weighed.history) * held"),
    ("3, joint, box", "let blend = settings.matte_blend;", "let blend = settings.glossy_blend;"),
    ("8, joint", "let blend = settings.glossy_blend;", "let blend = settings.matte_blend;"),
    ("6, joint", "textureLoad(pass_input, chosen[0], 0)", "textureLoad(pass_input, pixel, 0)"),
    // passes
    ("3", "textureStore(new_length, pixel, vec4f(result.texel))", "textureStore(new_length, pixel, vec4f(1.0))"),
    ("5", "disocclusion(accumulated, smooth_estimate, k, fed_back)", "accumulated"),
    (
        "5",
        "textureStore(floored, pixel, vec4f(stored_colour(result.floored), 0.0));",
        "textureStore(floored, pixel, vec4f(0.0));",
    ),
    ("5+6", ".w >= 0.0", ".w >= -2.0"),
    ("5+6", "vec4f(stored_colour(result.shown), accumulated.w)", "accumulated"),
    ("5+6", "const BORDER: i32 = 1;", "const BORDER: i32 = 0;"),
    ("5+6, wide", "inner_first - radius - blur + vec2i(x, y)", "inner_first - blur + vec2i(x, y)"),
    (
        "3+8",
        "glossy_temporal(pixel, glossy_changed, glossy_current, glossy_history, glossy_history_length)",
        "glossy_temporal(pixel, glossy_changed, glossy_current, matte_history, glossy_history_length)",
    ),
    ("3+8", "texel_of(glossy, on_surface)", "texel_of(matte, on_surface)"),
    (
        "young 9",
        "matte_level(vec2i(id.xy), 9, settings.young.end_9)",
        "matte_level(vec2i(id.xy), 9, settings.young.end_3)",
    ),
    (
        "young 27",
        "matte_level(vec2i(id.xy), 27, settings.young.end_27)",
        "matte_level(vec2i(id.xy), 27, settings.young.end_9)",
    ),
    ("young 27", "matte_level(vec2i(id.xy), 27, ", "matte_level(vec2i(id.xy), 9, "),
    ("young 3, further contrast", "allowed = min(allowed, most * (", "allowed = min(allowed, 9.0 * most * ("),
    ("young 3, further contrast", "further * further * (mean * mean)", "further * (mean * mean)"),
    ("young 3, further contrast", "YOUNG_NOISE_ALIKE * squared * min(own", "squared * min(own"),
    ("young 3, further contrast", "squared * min(own.w", "squared * max(own.w"),
    (
        "young glossy 3, further contrast",
        "settings.young.further_contrast * contrast",
        "settings.young.further_contrast",
    ),
    ("young 1, contact, noise", "let most = settings.young.contact_noise;", "let most = 0.0;"),
    ("young 1, contact, noise", "YOUNG_OF_A_FRAME * unknown", "unknown"),
    (
        "young 3, contact, noise",
        "select(YOUNG_OF_A_FRAME * unknown, known,",
        "select(known, YOUNG_OF_A_FRAME * unknown,",
    ),
    ("young 3, contact, noise", "(0.25 * both * both", "(both * both"),
    ("young 1, contact", "pixel - axis", "pixel + axis"),
    ("young 1, contact", "max(to_p, to_q)", "to_p"),
    ("young 1, contact", "stops_across[dx + 1] * stops_down[dy + 1]", "stops_across[dx + 1]"),
    ("young 1, contact", "vec2i(0, step)", "vec2i(0, -step)"),
    ("young 1, contact", "(nearest * nearest)", "nearest"),
    ("young 1, contact", "(contact * contact)", "contact"),
    ("young 3, contact", "p.normal, q + axis", "p.normal, q"),
    ("young 3, contact", "return above / dot(offset, offset);", "return above;"),
    ("3, lost footprint", "settings.surface.lost_footprint * (1.0 - part)", "settings.surface.lost_footprint"),
    ("young 1, isolated", "settings.young.isolated - frames", "settings.young.isolated - 1.0"),
    ("young 1, isolated", "max(1.0 - alike, 0.0)", "1.0"),
    ("young 1, isolated", "vec2f(edge * like, m / counted)", "vec2f(edge, m / counted)"),
    ("young glossy 1, isolated", "total += share * lack * others", "total += lack * others"),
    ("young 1, isolated", "let m = min(counted, most)", "let m = most"),
    ("young 1, isolated", "2.0 * lack * others_squares.x", "lack * others_squares.x"),
    ("young 1, isolated", "lack * lack * others_squares.y", "lack * others_squares.y"),
    ("young 1", "var fourth = textureLoad(input, pixel, 0).w;", "var fourth = 1.0;"),
    ("young 9, stop, kept", "fourth = textureLoad(accumulated, pixel, 0).w;", "fourth = 1.0;"),
    ("young 9, stop", "stored_colour(vec3f(filtered.deviation)).x", "0.5"),
    ("young 9, joint", "first_colour(textureLoad(pass_input, pixel, 0))", "light.xyz"),
    (
        "young 3, joint",
        "matte_level(vec2i(id.xy), 3, settings.young.end_3)",
        "matte_level(vec2i(id.xy), 1, settings.young.end_3)",
    ),
    ("young glossy 9, joint", "settings.young.lobe * LOBE_SPREAD * frame.view.focal_px", "settings.young.lobe"),
    ("young glossy 3", "settings.young.lobe * LOBE_SPREAD * frame.view.focal_px", "settings.young.lobe"),
    ("young glossy 1", "+ settings.young.least_lobe", ""),
    ("young glossy 9", "glossy_level(vec2i(id.xy), 9,", "glossy_level(vec2i(id.xy), 3,"),
    ("6", "return texel.xyz;\n}\n", "return texel.zyx;\n}\n"),
    ("6", "stored_colour(firefly(pixel))", "stored_colour(firefly_input(pixel))"),
    ("11", "stored_colour(direct_taa(pixel))", "stored_colour(direct_at(pixel))"),
    (
        "8",
        "let result = glossy_temporal(pixel, changed, current, history, history_length);",
        "let result = glossy_temporal(pixel, changed, history, history, history_length);",
    ),
    ("8", "textureStore(new_length, pixel, vec4f(result.texel))", "textureStore(new_length, pixel, vec4f(1.0))"),
    ("7", "settings.matte_edge, settings.matte_bilateral", "settings.matte_edge, settings.matte_prefilter"),
    ("8", "select(-accumulated.confidence, accumulated.confidence, on_surface)", "accumulated.length"),
    ("10", "glossy_bilateral(vec2i(0, 1), pixel)", "glossy_bilateral(vec2i(1, 0), pixel)"),
    ("composite, all", "input_at(direct_glossy, pixel), on_glossy", "input_at(direct_glossy, pixel), on_matte"),
];

#[test]
fn every_change_planted_in_a_shader_is_seen() {
    let Some(gpu) = gpu() else { return };
    let changes: [fn(&mut FrameBuf); 2] = [|_| (), unusual];
    let mut inputs: Vec<Inputs> =
        changes.iter().flat_map(|change| scenes().map(|(_, scene)| Inputs::new(&scene, SIZE, change))).collect();
    inputs.push(Inputs::new(&floor(moving, Noise::Uniform), SIZE, parallel));
    // Curved and at rest under jitter: normals that change are no turn. No other scene has that.
    let mut resting = sphere(jittered, Noise::Uniform);
    resting.objects[0].pose = Box::new(|_| glam::DAffine3::IDENTITY);
    inputs.push(Inputs::new(&resting, SIZE, |_| ()));
    {
        let case = CASES.iter().find(|c| c.name == "8").unwrap();
        let job = (case.job)(inputs.last().unwrap(), &settings_with(case.changes));
        let kernel = Kernel::with_source(&gpu.device, job.pass, job.storage, &job.pass.source(job.storage, false));
        compare(&job.expected, &gpu.run(&kernel, &job), case.bound).unwrap();
    }
    let mut unseen = Vec::new();
    for (name, from, to) in PLANTED {
        let case = CASES.iter().find(|c| c.name == *name).unwrap();
        // Other counts of taps, so that one pattern cannot stand in for the other.
        let mut settings = settings_with(case.changes);
        settings.matte_bilateral.taps = 22;
        let mut kernel = None;
        let seen = inputs.iter().any(|inputs| {
            let job = (case.job)(inputs, &settings);
            let kernel = kernel.get_or_insert_with(|| {
                let source = job.pass.source(job.storage, false);
                assert!(source.contains(from), "{}: `{from}` is not there", job.pass.name);
                Kernel::with_source(&gpu.device, job.pass, job.storage, &source.replacen(from, to, 1))
            });
            compare(&job.expected, &gpu.run(kernel, &job), case.bound).is_err()
        });
        if !seen {
            unseen.push(format!("{name}: `{from}` made `{to}`"));
        }
    }
    assert!(unseen.is_empty(), "went unseen:\n{}", unseen.join("\n"));
}

#[test]
#[should_panic(expected = "agrees with itself")]
fn an_output_is_not_compared_with_its_own_back_end() {
    let output = Output { by: By::Gpu, colours: Vec::new(), scalars: Vec::new() };
    let _ = compare(&output, &output, EXACT);
}
