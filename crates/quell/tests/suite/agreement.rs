//! The back ends agree: stage by stage on the same input, over whole sequences, and on values that no renderer should
//! make. Every comparison takes both outputs, insists that they come from different back ends, and is shown to fail
//! on planted differences.

use super::frames::{
    Kept, Noise, Scene, box_before_wall, denoise, floor, mirror, moving, moving_jittered, sequence, sphere, with_radius,
};
use glam::DMat3;
use proptest::prelude::*;
use quell::settings::PARAMETERS;
use quell::{
    Backend, Camera, Denoiser, Frame, FrameBuf, Pass, PassBuf, Plane, PlaneRef, Preset, Rgb, Settings, Signal, Size,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How far outputs may lie apart.
#[derive(Clone, Copy, Debug)]
struct Bound {
    /// Largest difference, relative to the pixel's value plus the plane's mean magnitude.
    relative: f64,
    /// Share of pixels in which a decision at a threshold may have flipped: they may differ by more.
    flips: f64,
    /// Share of confidences and history lengths that may have been rounded the other way.
    ties: f64,
}

/// The same arithmetic in the same order.
const EXACT: Bound = Bound { relative: 0.0, flips: 0.0, ties: 0.0 };
/// Stages 4, 7, 9, 10: sums of taps in f32, in the reference in f64; the offset of a tap as change of ray, in the
/// reference as difference of positions, which cancels; 1 / sqrt to 5e-6.
const WEIGHTS: Bound = Bound { relative: 3e-5, flips: 0.0, ties: 0.0 };
/// Mean and deviation from sums in another order: the variance cancels.
const DEVIATIONS: Bound = Bound { relative: 1e-5, flips: 0.0, ties: 0.0 };
/// Where light has changed: variances of two means from sums in f32 about the centre's light, in the reference in f64 about the means.
/// Both round history lengths as they are kept: one near a tie may go either way, 2.4e-4 of itself apart.
const CHANGES: Bound = Bound { relative: 1e-4, flips: 1e-3, ties: 1e-2 };
/// The largest step between two lengths that are kept, relative.
const TIE: f32 = 2.5e-4;
/// 30 frames of everything: `WEIGHTS` and `DEVIATIONS` fed back; stage 6 replaces a pixel or not.
const SEQUENCE: Bound = Bound { relative: 1e-4, flips: 1e-3, ties: 0.0 };
/// The same with `quality`, whose history lengths are rounded as in `CHANGES`: since `surface.lost_footprint` they are fractions, not
/// numbers of frames, and may lie near a tie.
const SEQUENCE_ROUNDED: Bound = Bound { ties: 1e-2, ..SEQUENCE };
/// Noise without any smoothness, in which values of very different size meet; of nearly equal medians either may be
/// taken, and a pass then comes from another pixel.
const WILD: Bound = Bound { relative: 3e-4, flips: 0.02, ties: 0.0 };

struct Output {
    backend: Backend,
    kept: Kept,
}

fn outputs(settings: &Settings, frames: &[FrameBuf]) -> [Output; 2] {
    [Backend::Reference, Backend::Cpu].map(|backend| {
        let mut denoiser = Denoiser::with_backend(frames[0].size, settings, backend).unwrap();
        let mut kept = None;
        for frame in frames {
            kept = Some(denoise(&mut denoiser, frame));
        }
        Output { backend, kept: kept.unwrap() }
    })
}

/// Every colour plane of an output with its name.
fn planes(kept: &mut Kept) -> Vec<(&'static str, &mut Plane<Rgb>)> {
    let mut all = vec![("composite", &mut kept.composite), ("direct", &mut kept.direct)];
    all.extend(kept.matte.iter_mut().map(|p| ("matte", p)));
    all.extend(kept.glossy.iter_mut().map(|p| ("glossy", p)));
    all.extend(kept.matte_passes.iter_mut().map(|p| ("matte pass", p)));
    all.extend(kept.glossy_passes.iter_mut().map(|p| ("glossy pass", p)));
    all
}

fn compare(a: &Output, b: &Output, bound: Bound) -> Result<(), String> {
    assert_ne!(a.backend, b.backend, "a back end always agrees with itself");
    let (mut a, mut b) = (a.kept.clone(), b.kept.clone());
    for (name, p, q) in [("confidence", &a.confidence, &b.confidence), ("history", &a.history, &b.history)] {
        let apart = || p.data().iter().zip(q.data()).map(|(p, q)| (p - q).abs() / p.max(1.0));
        let (worst, most) = (apart().fold(0.0, f32::max), if bound.relative == 0.0 { 0.0 } else { 1e-5 });
        let tied = apart().filter(|d| *d > most).count() as f64;
        if tied > bound.ties * p.data().len() as f64 || worst > if bound.ties > 0.0 { TIE } else { most } {
            return Err(format!("{name}: {worst:e}, {tied} beyond {most:e}"));
        }
    }
    if a.report.sanitised != b.report.sanitised || a.report.reset_pixels != b.report.reset_pixels {
        return Err("the reports differ".to_owned());
    }
    let (pa, pb) = (planes(&mut a), planes(&mut b));
    if pa.len() != pb.len() {
        return Err(format!("{} planes and {}", pa.len(), pb.len()));
    }
    for ((name, p), (_, q)) in pa.into_iter().zip(pb) {
        let n = p.data().len();
        let magnitude = p.data().iter().flatten().map(|v| f64::from(v.abs())).sum::<f64>() / (3 * n) as f64;
        let (mut worst, mut flipped) = (0.0f64, 0);
        for (i, (p, q)) in p.data().iter().zip(q.data()).enumerate() {
            for c in 0..3 {
                if !(p[c].is_finite() && q[c].is_finite()) {
                    if name == "composite" && p[c].is_finite() == q[c].is_finite() {
                        continue; // weight times light is the host's own arithmetic
                    }
                    return Err(format!("{name}, pixel {i}: {} and {}", p[c], q[c]));
                }
                let scale = f64::from(p[c].abs().max(q[c].abs())) + magnitude;
                let d = f64::from((p[c] - q[c]).abs()) / if scale > 0.0 { scale } else { 1.0 };
                if d > bound.relative {
                    flipped += 1;
                    worst = worst.max(d);
                }
            }
        }
        if f64::from(flipped) > bound.flips * (3 * n) as f64 {
            return Err(format!("{name}: {flipped} of {} values differ, by up to {worst:e}", 3 * n));
        }
    }
    Ok(())
}

/// Planted differences, each of which every comparison must see.
fn canaries(output: &Output) -> Vec<(&'static str, Output)> {
    let with = |change: &dyn Fn(&mut Plane<Rgb>)| {
        let mut kept = output.kept.clone();
        planes(&mut kept).into_iter().for_each(|(_, p)| change(p));
        Output { backend: output.backend, kept }
    };
    vec![
        ("scaled by 1 %", with(&|p| p.data_mut().iter_mut().flatten().for_each(|v| *v *= 1.01))),
        ("shifted by a pixel", with(&|p| p.data_mut().rotate_right(1))),
        ("channels swapped", with(&|p| p.data_mut().iter_mut().for_each(|c| c.swap(0, 2)))),
    ]
}

/// As [`canaries`], for planes of values so different in size that a share of each would drown in their mean.
fn wild_canaries(output: &Output) -> Vec<(&'static str, Output)> {
    let with = |change: &dyn Fn(&mut Kept)| {
        let mut kept = output.kept.clone();
        change(&mut kept);
        Output { backend: output.backend, kept }
    };
    let off = |p: &mut Plane<Rgb>| {
        let n = 3 * p.data().len();
        let magnitude = p.data().iter().flatten().map(|v| f64::from(v.abs())).sum::<f64>() / n as f64;
        for v in p.data_mut().iter_mut().flatten() {
            *v += (0.01 * (f64::from(v.abs()) + magnitude).max(1e-3)) as f32;
        }
    };
    let mut all = vec![
        ("everything off by 1 %", with(&|kept| planes(kept).into_iter().for_each(|(_, p)| off(p)))),
        ("direct light off by 1 %", with(&|kept| off(&mut kept.direct))),
        ("a number lost", with(&|kept| kept.direct.data_mut()[0][1] = f32::NAN)),
        ("an older history", with(&|kept| kept.history.data_mut()[0] += 1.0)),
        ("a repair that was not counted", with(&|kept| kept.report.reset_pixels += 1)),
    ];
    for (name, k) in [("the last plane off by 1 %", 1), ("the last plane but one off by 1 %", 2)] {
        let change = |kept: &mut Kept| {
            let mut planes = planes(kept);
            let at = planes.len() - k;
            off(planes[at].1);
        };
        // A composite may leave the range of numbers: it is then not compared.
        if planes(&mut output.kept.clone()).len() - k > 0 {
            all.push((name, with(&change)));
        }
    }
    all
}

const SIZE: Size = Size::new(83, 49);

fn scenes() -> [(&'static str, Scene); 4] {
    let noise = Noise::Sparse(0.4);
    [
        ("floor", floor(moving, noise)),
        ("box", box_before_wall(moving, noise)),
        ("mirror", mirror(moving, true, noise)),
        ("sphere", sphere(moving_jittered, noise)),
    ]
}

/// Frames with a pass for each signal, or with none.
fn frames(scene: &Scene, count: i64, passes: bool) -> Vec<FrameBuf> {
    let mut frames = sequence(scene, SIZE, count);
    for frame in frames.iter_mut().filter(|_| passes) {
        for (name, signal, source) in
            [("m", Signal::Matte, frame.matte.clone()), ("g", Signal::Glossy, frame.glossy.clone())]
        {
            let source = source.unwrap();
            let plane = Plane::from_fn(SIZE, |x, y| source.at(x, y).map(|v| v * ((x + 2 * y) % 5) as f32 * 0.25));
            frame.passes.push(PassBuf { name: name.to_owned(), signal, plane });
        }
    }
    frames
}

fn only(settings: &[(&str, &str)]) -> Settings {
    let mut s = with_radius(Settings::default(), SIZE, 12.0).without_denoising();
    settings.iter().for_each(|(name, value)| s.set(name, value).unwrap());
    s
}

#[test]
fn every_stage_alone_agrees() {
    /// Everything is a mirror, and no hit distance is quite right; now its part, now the size of a pixel is the limit.
    const HITS: &[(&str, &str)] = &[
        ("glossy_temporal.mirror_roughness", "1"),
        ("glossy_temporal.hit_tolerance", "0.01"),
        ("surface.pixel_distance", "0.1"),
    ];
    const TEMPORAL: &[(&str, &str)] = &[("matte_temporal.enabled", "on"), ("pipeline.feedback", "temporal")];
    const GLOSSY: &[(&str, &str)] = &[("glossy_temporal.enabled", "on"), ("glossy_temporal.clip", "box")];
    // Nearly every difference between the means counts, and part of history stays.
    const CHANGED: &[(&str, &str)] = &[
        ("changed_light.fast", "0.2"),
        ("changed_light.begin", "0.3"),
        ("changed_light.certain", "4"),
        ("changed_light.least", "0.01"),
    ];
    type Case = (&'static str, Vec<(&'static str, &'static str)>, Bound);
    let cases: Vec<Case> = vec![
        ("nothing", vec![], EXACT),
        ("3", TEMPORAL.to_vec(), EXACT),
        ("3, box", [TEMPORAL, &[("matte_temporal.clip", "box"), ("matte_temporal.clip_radius", "3")]].concat(), EXACT),
        ("3, deviations", [TEMPORAL, &[("matte_temporal.clip", "sigma")]].concat(), DEVIATIONS),
        ("3, by point", [TEMPORAL, &[("surface.rejection", "point")]].concat(), EXACT),
        (
            "3, no rejection",
            [TEMPORAL, &[("surface.rejection", "off"), ("matte_temporal.ramp", "off")]].concat(),
            EXACT,
        ),
        ("3, lost footprint", [TEMPORAL, &[("surface.lost_footprint", "2")]].concat(), EXACT),
        ("3, changed", [TEMPORAL, CHANGED, &[("changed_light.matte", "on")]].concat(), CHANGES),
        ("8, changed", [GLOSSY, CHANGED, &[("changed_light.glossy", "on")]].concat(), CHANGES),
        ("young matte", [TEMPORAL, &[("young_filter.matte", "on")]].concat(), WEIGHTS),
        (
            "young matte, narrow",
            [TEMPORAL, &[("young_filter.matte", "on"), ("young_filter.frames", "3")]].concat(),
            WEIGHTS,
        ),
        (
            "young matte, stop",
            [TEMPORAL, &[("young_filter.matte", "on"), ("young_filter.deviations", "3")]].concat(),
            WEIGHTS,
        ),
        (
            "young matte, contrast",
            [
                TEMPORAL,
                &[("young_filter.matte", "on"), ("young_filter.matte_contrast", "2"), ("young_filter.deviations", "3")],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young matte, further contrast",
            [
                TEMPORAL,
                &[
                    ("young_filter.matte", "on"),
                    ("young_filter.matte_contrast", "4"),
                    ("young_filter.further_contrast", "0.5"),
                    ("young_filter.deviations", "4"),
                ],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young glossy, further contrast",
            [
                GLOSSY,
                &[
                    ("young_filter.glossy", "on"),
                    ("young_filter.glossy_contrast", "3"),
                    ("young_filter.further_contrast", "0.5"),
                    ("young_filter.deviations", "4"),
                    ("young_filter.least_lobe", "1"),
                ],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young, contact",
            [TEMPORAL, &[("young_filter.matte", "on"), ("edge.contact", "0.5"), ("young_filter.deviations", "3")]]
                .concat(),
            WEIGHTS,
        ),
        (
            "young, contact, noise",
            [
                TEMPORAL,
                &[
                    ("young_filter.matte", "on"),
                    ("edge.contact", "0.5"),
                    ("young_filter.contact_noise", "2"),
                    ("young_filter.deviations", "3"),
                ],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young, wide",
            [
                TEMPORAL,
                &[
                    ("young_filter.matte", "on"),
                    ("young_filter.matte_levels", "4"),
                    ("young_filter.wide_frames", "3.5"),
                    ("young_filter.deviations", "6"),
                ],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young, isolated",
            [
                TEMPORAL,
                &[
                    ("young_filter.matte", "on"),
                    ("young_filter.isolated", "6"),
                    ("young_filter.matte_contrast", "2"),
                    ("young_filter.deviations", "3"),
                    ("edge.normal", "4"),
                ],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young glossy, isolated",
            [
                GLOSSY,
                &[
                    ("young_filter.glossy", "on"),
                    ("young_filter.isolated", "3"),
                    ("young_filter.least_lobe", "1"),
                    ("edge.normal", "4"),
                ],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young glossy, contrast",
            [
                GLOSSY,
                &[
                    ("young_filter.glossy", "on"),
                    ("young_filter.glossy_contrast", "1.5"),
                    ("young_filter.least_lobe", "1"),
                ],
            ]
            .concat(),
            WEIGHTS,
        ),
        (
            "young glossy, stop",
            [
                GLOSSY,
                &[("young_filter.glossy", "on"), ("young_filter.deviations", "3"), ("young_filter.least_lobe", "1")],
            ]
            .concat(),
            WEIGHTS,
        ),
        ("young glossy", [GLOSSY, &[("young_filter.glossy", "on"), ("young_filter.lobe", "0.02")]].concat(), WEIGHTS),
        ("4", vec![("matte_prefilter.enabled", "on")], WEIGHTS),
        ("4, mirrored", vec![("matte_prefilter.enabled", "on"), ("matte_prefilter.off_screen", "mirror")], WEIGHTS),
        ("4, gloss", vec![("matte_prefilter.enabled", "on"), ("edge.matte_gloss", "1")], WEIGHTS),
        ("5", [TEMPORAL, &[("matte_prefilter.enabled", "on"), ("disocclusion.enabled", "on")]].concat(), WEIGHTS),
        ("6", vec![("firefly.enabled", "on")], EXACT),
        ("6, plain", vec![("firefly.enabled", "on"), ("firefly.plain", "on")], EXACT),
        ("6, luminance", vec![("firefly.enabled", "on"), ("firefly.median", "luminance")], EXACT),
        ("7", vec![("matte_bilateral.enabled", "on")], WEIGHTS),
        (
            "7, contact",
            vec![("matte_bilateral.enabled", "on"), ("edge.contact", "0.5"), ("matte_bilateral.radius", "96")],
            WEIGHTS,
        ),
        (
            "4, gloss, contact",
            vec![
                ("matte_prefilter.enabled", "on"),
                ("edge.matte_gloss", "1"),
                ("edge.contact", "0.3"),
                ("matte_prefilter.radius", "96"),
            ],
            WEIGHTS,
        ),
        ("8", GLOSSY.to_vec(), EXACT),
        ("8, deviations", [GLOSSY, &[("glossy_temporal.clip", "sigma")]].concat(), DEVIATIONS),
        ("8, median", [GLOSSY, &[("glossy_temporal.hit_filter", "median")]].concat(), EXACT),
        ("8, unfiltered", [GLOSSY, &[("glossy_temporal.hit_filter", "off")]].concat(), EXACT),
        ("8, hits", [GLOSSY, HITS].concat(), EXACT),
        ("8, spline", [GLOSSY, &[("glossy_temporal.spline_roughness", "1")]].concat(), EXACT),
        (
            "8, spline, deviations",
            [GLOSSY, &[("glossy_temporal.spline_roughness", "1"), ("glossy_temporal.clip", "sigma")]].concat(),
            DEVIATIONS,
        ),
        (
            "8, spline, changed",
            [GLOSSY, CHANGED, &[("changed_light.glossy", "on"), ("glossy_temporal.spline_roughness", "1")]].concat(),
            CHANGES,
        ),
        ("8, not virtual", [GLOSSY, &[("glossy_temporal.virtual_reprojection", "off")]].concat(), EXACT),
        ("9, 10", vec![("glossy_bilateral.enabled", "on")], WEIGHTS),
        ("9, 10, monotone", vec![("glossy_bilateral.enabled", "on"), ("edge.monotone", "on")], WEIGHTS),
        ("9, 10, constant", vec![("glossy_bilateral.enabled", "on"), ("glossy_bilateral.radius", "constant")], WEIGHTS),
        ("11", vec![("direct_taa.enabled", "on")], EXACT),
        ("antialiasing", vec![("antialiasing.enabled", "on")], EXACT),
        ("antialiasing, one box", vec![("antialiasing.enabled", "on"), ("antialiasing.thin_radius", "0")], EXACT),
        (
            "antialiasing, whatever is nearer",
            vec![
                ("antialiasing.enabled", "on"),
                ("antialiasing.thin_radius", "2"),
                ("antialiasing.thin_depth", "0.001"),
                ("antialiasing.thin_motion", "16"),
            ],
            EXACT,
        ),
        ("antialiasing, few frames", vec![("antialiasing.enabled", "on"), ("antialiasing.least", "0.3")], EXACT),
    ];
    for (scene_name, scene) in scenes() {
        for passes in [false, true] {
            let mut frames = frames(&scene, 4, passes);
            for (i, frame) in frames.iter_mut().enumerate() {
                // Direct light with something to see, and jitter, for stage 11.
                frame.camera.jitter = [0.25, -0.125 * i as f32];
                frame.direct = frame.matte.clone();
            }
            for (name, settings, bound) in &cases {
                let [a, b] = outputs(&only(settings), &frames);
                if let Err(difference) = compare(&a, &b, *bound) {
                    panic!("{scene_name}, passes {passes}, stage {name}: {difference}");
                }
                for (canary, planted) in canaries(&b) {
                    assert!(compare(&a, &planted, *bound).is_err(), "{scene_name}, {name}: {canary} went unseen");
                }
            }
        }
    }
}

#[test]
fn a_dropped_tap_or_weight_is_seen() {
    let frames = frames(&floor(moving, Noise::Sparse(0.4)), 4, false);
    for (name, value, stage) in [
        ("young_filter.frames", "31", "young_filter.matte"),
        ("young_filter.falloff", "0.45", "young_filter.glossy"),
        ("young_filter.deviations", "2.5", "young_filter.matte"),
        ("young_filter.matte_stays", "on", "young_filter.matte"),
        ("young_filter.matte_levels", "4", "young_filter.matte"),
        ("young_filter.glossy_levels", "2", "young_filter.glossy"),
        ("matte_prefilter.taps", "23", "matte_prefilter.enabled"),
        ("matte_bilateral.taps", "23", "matte_bilateral.enabled"),
        ("glossy_bilateral.sigma", "0.7", "glossy_bilateral.enabled"),
        ("glossy_bilateral.max_radius", "60", "glossy_bilateral.enabled"),
        ("matte_temporal.alpha", "0.3", "matte_temporal.enabled"),
        ("changed_light.begin", "0.4", "changed_light.matte"),
        ("changed_light.certain", "3.9", "changed_light.matte"),
        ("changed_light.fast", "0.25", "changed_light.matte"),
        ("changed_light.least", "0.03", "changed_light.matte"),
        ("changed_light.radius", "3", "changed_light.matte"),
        ("changed_light.spacing", "3", "changed_light.matte"),
        ("glossy_temporal.alpha", "0.3", "glossy_temporal.enabled"),
    ] {
        // The filter of young history acts after stages 3 and 8 only.
        let settings = match stage {
            "young_filter.matte" => only(&[(stage, "on"), ("matte_temporal.enabled", "on")]),
            "young_filter.glossy" => only(&[(stage, "on"), ("glossy_temporal.enabled", "on")]),
            "changed_light.matte" => only(&[
                (stage, "on"),
                ("changed_light.fast", "0.2"),
                ("changed_light.begin", "0.3"),
                ("changed_light.certain", "4"),
                ("changed_light.least", "0.01"),
                ("changed_light.radius", "2"),
                ("matte_temporal.enabled", "on"),
                ("pipeline.feedback", "temporal"),
            ]),
            _ => only(&[(stage, "on")]),
        };
        let mut other = settings.clone();
        other.set(name, value).unwrap();
        let [a, _] = outputs(&settings, &frames);
        let [_, b] = outputs(&other, &frames);
        assert!(compare(&a, &b, WEIGHTS).is_err(), "{name} = {value} went unseen");
    }
}

#[test]
fn orthographic_cameras_agree() {
    let mut frames = frames(&floor(moving, Noise::Uniform), 3, false);
    for frame in &mut frames {
        for camera in [&mut frame.camera, &mut frame.previous_camera] {
            let rows = DMat3::IDENTITY.to_cols_array_2d();
            for c in 0..4 {
                for r in [0, 1, 3] {
                    let value = if c < 3 { rows[c].get(r).copied().unwrap_or(0.0) * 0.3 } else { 0.0 };
                    camera.clip_from_world[4 * c + r] = value as f32;
                }
            }
            camera.clip_from_world[15] = 1.0;
        }
        // A tilted plane seen along -z.
        frame.view_depth = Some(Plane::from_fn(SIZE, |x, y| 3.0 + 0.02 * x as f32 - 0.01 * y as f32));
        // Without normals of its own: the floor's are edge-on to this camera, and every weight would be 0.
        (frame.motion, frame.normal) = (None, None);
    }
    for settings in [only(&[("matte_prefilter.enabled", "on")]), only(&[("glossy_bilateral.enabled", "on")])] {
        let [a, b] = outputs(&settings, &frames);
        compare(&a, &b, WEIGHTS).unwrap();
        for (canary, planted) in canaries(&b) {
            assert!(compare(&a, &planted, WEIGHTS).is_err(), "{canary}");
        }
    }
    let [a, b] = outputs(&with_radius(Settings::default(), SIZE, 12.0), &frames);
    compare(&a, &b, SEQUENCE).unwrap();
    for (canary, planted) in canaries(&b) {
        assert!(compare(&a, &planted, SEQUENCE).is_err(), "{canary}");
    }
}

#[test]
fn sequences_of_thirty_frames_agree() {
    for (name, scene) in scenes() {
        for feedback in ["blend", "prefilter", "quality"] {
            let mut settings = with_radius(Settings::default(), SIZE, 12.0);
            match feedback {
                "quality" => settings = with_radius(Settings::preset(Preset::Quality), SIZE, 12.0),
                _ => settings.set("pipeline.feedback", feedback).unwrap(),
            }
            let frames = frames(&scene, 30, name == "box");
            let [a, b] = outputs(&settings, &frames);
            let bound = if feedback == "quality" { SEQUENCE_ROUNDED } else { SEQUENCE };
            if let Err(difference) = compare(&a, &b, bound) {
                panic!("{name}, {feedback}: {difference}");
            }
            for (canary, planted) in canaries(&b) {
                assert!(compare(&a, &planted, bound).is_err(), "{name}: {canary} went unseen");
            }
        }
    }
}

#[test]
fn a_cut_a_resize_and_planes_that_come_and_go_agree() {
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let settings = Settings::default();
    let [mut a, mut b] =
        [Backend::Reference, Backend::Cpu].map(|k| Denoiser::with_backend(Size::new(8, 8), &settings, k).unwrap());
    for (i, index) in [(0, 0), (1, 1), (2, 7), (3, 8), (4, 9), (5, 10), (6, 11), (7, 10)] {
        let size = if i < 6 { Size::new(37, 23) } else { Size::new(5, 41) };
        let mut frame = scene.frame(size, index);
        match i {
            1 => frame.glossy_hit_distance = None,
            3 => frame.glossy = None,
            4 => (frame.surface_id, frame.roughness, frame.motion) = (None, None, None),
            5 => (frame.matte, frame.normal, frame.direct) = (None, None, None),
            _ => frame.confidence_in = Some(Plane::from_fn(size, |x, _| (x % 3) as f32 * 0.5)),
        }
        let [a, b] = [(&mut a, Backend::Reference), (&mut b, Backend::Cpu)].map(|(denoiser, backend)| {
            if denoiser.size() != size {
                denoiser.resize(size).unwrap();
            }
            Output { backend, kept: denoise(denoiser, &frame) }
        });
        if let Err(difference) = compare(&a, &b, SEQUENCE) {
            panic!("frame {i}: {difference}");
        }
        for (canary, planted) in canaries(&b).into_iter().chain(wild_canaries(&b)) {
            assert!(compare(&a, &planted, SEQUENCE).is_err(), "frame {i}: {canary} went unseen");
        }
    }
    // What would be left of a cut, a resize or a lost plane that one of the two had overlooked.
    let frames: Vec<FrameBuf> = (0..3).map(|i| scene.frame(Size::new(37, 23), i)).collect();
    let mut cut = frames.clone();
    cut[2].index = 9;
    let mut lost = frames.clone();
    lost.iter_mut().for_each(|f| f.glossy = None);
    for (name, other) in [("a cut", cut), ("a lost plane", lost)] {
        let [a, _] = outputs(&settings, &frames);
        let [_, b] = outputs(&settings, &other);
        assert!(compare(&a, &b, SEQUENCE).is_err(), "{name} went unseen");
    }
}

#[test]
fn threads_change_no_bit() {
    let frames = frames(&box_before_wall(moving, Noise::Sparse(0.4)), 6, true);
    let settings = Settings::default();
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut denoiser = Denoiser::new(SIZE, &settings).unwrap();
            frames.iter().map(|f| denoise(&mut denoiser, f)).last().unwrap()
        })
    });
    assert_eq!(one.composite, three.composite);
    assert_eq!(one.matte_passes, three.matte_passes);
    assert_eq!(one.glossy_passes, three.glossy_passes);
    assert_eq!(one.history, three.history);
}

/// Counts what the threads of one pool allocate.
struct Counting;

thread_local! {
    static COUNTED: Cell<bool> = const { Cell::new(false) };
}
static BYTES: AtomicUsize = AtomicUsize::new(0);

#[expect(unsafe_code, reason = "an allocator cannot be written without; it only counts")]
// SAFETY: every call is handed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if COUNTED.try_with(Cell::get).unwrap_or(false) {
            BYTES.fetch_add(layout.size(), Ordering::Relaxed);
        }
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_steady_frame_allocates_nothing() {
    /// Blocks of rayon's queues.
    const RAYON: usize = 64 << 10;
    let mut frames = frames(&box_before_wall(moving, Noise::Sparse(0.4)), 16, true);
    frames.iter_mut().for_each(|f| f.camera.jitter = [0.25, 0.125]);
    let views: Vec<Vec<Pass<'_>>> = frames.iter().map(FrameBuf::pass_views).collect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .start_handler(|_| COUNTED.with(|c| c.set(true)))
        .build()
        .unwrap();
    pool.install(|| {
        let mut denoiser = Denoiser::new(SIZE, &Settings::default()).unwrap();
        let mut before = 0;
        for (i, (frame, passes)) in frames.iter().zip(&views).enumerate() {
            if i == 6 {
                before = BYTES.load(Ordering::Relaxed);
                assert!(before > 0, "nothing is counted");
            }
            denoiser.denoise(&frame.frame(passes)).unwrap();
        }
        let used = BYTES.load(Ordering::Relaxed) - before;
        assert!(used < RAYON, "{used} bytes in ten frames");
    });
}

/// Ordinary and extreme values, chosen by a number.
fn value(u: u32, extremes: &[f32]) -> f32 {
    if u.is_multiple_of(16) {
        extremes[(u >> 4) as usize % extremes.len()]
    } else {
        (u >> 8) as f32 / (1 << 24) as f32 * 4.0
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn wild_frames_agree(
        width in 1usize..=67,
        height in 1usize..=67,
        pad in 0usize..5,
        seed in any::<u32>(),
        present in any::<u32>(),
        changes in proptest::collection::vec((0usize..PARAMETERS.len(), 0usize..5), 0..5),
    ) {
        let (size, stride) = (Size::new(width, height), width + pad);
        let mut settings = Settings::default();
        for (p, sample) in changes {
            let samples = PARAMETERS[p].samples();
            settings.set(PARAMETERS[p].name, &samples[sample % samples.len()]).unwrap();
        }
        for radius in [&mut settings.matte_prefilter.radius, &mut settings.matte_bilateral.radius] {
            *radius = radius.min(100.0);
        }
        // Steep gains turn the rounding of the reference's positions into differences.
        for gain in [&mut settings.edge.depth, &mut settings.edge.normal, &mut settings.edge.plane] {
            *gain = gain.min(5.0);
        }
        // Light that the young filter has smoothed has nearly equal medians everywhere: rounding decides from which pixel stage 6 takes a
        // value. Without smoothness around, both together made one run in 25 of this test fail; on other frames they are compared together.
        if settings.young_filter.matte || settings.young_filter.glossy {
            settings.firefly.enabled = false;
        }
        const ANY: &[f32] =
            &[0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e-45, 1e10, -1.0, 1.0];
        // Squares of greater lengths leave f32.
        const LENGTHS: &[f32] = &[0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e6, 1e-3];
        let number = |plane: u32, i: usize, extremes| {
            let hash = super::frames::hash([i as u32, plane, seed, 0]);
            value((hash * 4_294_967_295.0) as u32, extremes)
        };
        let scalar = |plane: u32, extremes| (0..stride * height).map(|i| number(plane, i, extremes)).collect::<Vec<f32>>();
        let colour = |plane: u32| -> Vec<Rgb> {
            (0..stride * height).map(|i| [1, 2, 3].map(|c| number(plane + 100 * c, i, ANY))).collect()
        };
        let [direct, matte, glossy, weight, pass] = [1, 2, 3, 4, 6].map(colour);
        let normal: Vec<[f32; 3]> = colour(5).iter().map(|n| [n[0] - 2.0, n[1] - 2.0, 6.0 + n[2]]).collect();
        let [depth, hit] = [7, 9].map(|k| scalar(k, LENGTHS));
        let [roughness, trust] = [8, 10].map(|k| scalar(k, ANY).iter().map(|v| v * 0.25).collect::<Vec<f32>>());
        let depth: Vec<f32> = depth.iter().map(|z| if *z > 0.0 { 5.0 + z * 0.1 } else { *z }).collect();
        let motion: Vec<[f32; 2]> = colour(11).iter().map(|c| [c[0] - 2.0, c[1] - 2.0]).collect();
        let ids: Vec<u32> = (0..stride * height).map(|i| (i / 7) as u32 % 3).collect();
        let view = |data| PlaneRef::new(data, size, stride).unwrap();
        let scalars = |data| PlaneRef::new(data, size, stride).unwrap();
        let passes = [Pass { name: "p", signal: Signal::Matte, plane: view(&pass) }];
        let has = |bit: u32| present >> bit & 1 == 1;
        let camera = Camera::perspective([0.0, 0.5, 2.0], [0.1, -0.2, -1.0], [0.0, 1.0, 0.0], 0.9, 1.5);
        let mut frame = Frame::new(size, camera);
        frame.direct = has(0).then(|| view(&direct));
        frame.matte = has(1).then(|| view(&matte));
        frame.passes = if has(1) && has(12) { &passes } else { &[] };
        frame.glossy = has(2).then(|| view(&glossy));
        frame.matte_weight = has(3).then(|| view(&weight));
        frame.normal = has(4).then(|| view(&normal));
        frame.view_depth = has(5).then(|| scalars(&depth));
        frame.roughness = has(6).then(|| scalars(&roughness));
        frame.glossy_hit_distance = has(7).then(|| scalars(&hit));
        frame.confidence_in = has(8).then(|| scalars(&trust));
        frame.motion = has(9).then(|| PlaneRef::new(&motion, size, stride).unwrap());
        frame.surface_id = has(10).then(|| PlaneRef::new(&ids, size, stride).unwrap());
        if has(11) { frame.camera.jitter = [0.3, -0.4]; }
        let [mut a, mut b] = [Backend::Reference, Backend::Cpu]
            .map(|backend| (backend, Denoiser::with_backend(size, &settings, backend).unwrap()));
        for index in 0..3 {
            frame.index = index;
            let [a, b] = [&mut a, &mut b].map(|(backend, denoiser)| {
                let output = denoiser.denoise(&frame).unwrap();
                Output { backend: *backend, kept: Kept {
                    composite: output.composite.clone(),
                    direct: output.direct.clone(),
                    matte: output.matte.cloned(),
                    glossy: output.glossy.cloned(),
                    confidence: output.confidence.clone(),
                    history: output.history_length.clone(),
                    matte_passes: output.passes(Signal::Matte).to_vec(),
                    glossy_passes: output.passes(Signal::Glossy).to_vec(),
                    report: output.report,
                } }
            });
            // One value in a small picture is a large share: one flip is always allowed.
            let mut bound = Bound { flips: WILD.flips.max(1.0 / (3 * size.pixels()) as f64), ..WILD };
            // As in `CHANGES`: one length in a small picture is a large share.
            if settings.changed_light.matte || settings.changed_light.glossy {
                bound.ties = CHANGES.ties.max(1.0 / size.pixels() as f64);
            }
            let result = compare(&a, &b, bound);
            prop_assert!(result.is_ok(), "frame {}: {}", index, result.unwrap_err());
            if index == 2 {
                for (canary, planted) in wild_canaries(&b) {
                    prop_assert!(compare(&a, &planted, bound).is_err(), "{} went unseen", canary);
                }
            }
        }
    }
}
