//! The stages of the sequence filter agree: stage by stage on the same inputs, and over whole sequences.
//!
//! Every comparison is shown to fail on planted differences of the output. Bounds stand in [`BOUNDS`], each with its reason.
//! The GPU's are in `tests/suite/gpu`.

use super::run::{SequenceStages, stages_of};
use super::settings::{Blend, Stabilise};
use super::testing::frame;
use super::{Filtered, LightKind, SequenceDenoiser, SequenceFrame, SequenceSettings};
use crate::denoiser::Backend;
use crate::frame::Rgb;
use crate::plane::{Plane, Size};
use crate::stages::blend::BlendFrame;
use crate::stages::stabilise::{self, StabiliseFrame};
use crate::window::{LocalFeatures, PreparedFrame, Rows};

const SIZE: Size = Size::new(53, 31);

/// How far outputs may lie apart.
#[derive(Clone, Copy)]
struct Bound {
    /// Largest difference, relative to the value plus the mean magnitude of the output.
    relative: f64,
    /// Share of values that may differ by more: a decision at a threshold may have flipped.
    flips: f64,
}

/// Of each stage, with the reason.
const BOUNDS: [(&str, Bound); 15] = [
    // Costs of patches add up in another order, so that of two offsets that cost the same either may win.
    ("reflection_motion", Bound { relative: 1e-5, flips: 0.01 }),
    // The same arithmetic in the same order.
    ("feature_noise", Bound { relative: 0.0, flips: 0.0 }),
    // Sums of samples in f32, in the reference in f64; the spread is a difference of sums.
    ("gather", Bound { relative: 2e-5, flips: 0.0 }),
    // Sums of f32; the spread over space is a difference of sums, multiplied by up to 17 samples.
    ("variance", Bound { relative: 1e-4, flips: 0.0 }),
    // Four levels whose stops depend on what the level before made.
    ("wavelet", Bound { relative: 1e-4, flips: 0.0 }),
    // Ratios of sums over some hundred pixels in f32, in the reference in f64; shrinkage by a difference of nearly equal numbers.
    ("residual", Bound { relative: 1e-4, flips: 0.0 }),
    // A sum of seven products.
    ("sum", Bound { relative: 1e-6, flips: 0.0 }),
    // A sum of seven products.
    ("input", Bound { relative: 1e-6, flips: 0.0 }),
    // Sums of squares in f32, in the reference in f64.
    ("likeness", Bound { relative: 2e-5, flips: 0.0 }),
    // Means of 25 values in f32, in the reference in f64.
    ("signature", Bound { relative: 2e-6, flips: 0.0 }),
    // Another form of the cubic's polynomials.
    ("stabilise by hand", Bound { relative: 2e-5, flips: 0.0 }),
    // Statistics as in `blend`, through a net; weights fall by powers of two of differences over them.
    ("stabilise", Bound { relative: 5e-4, flips: 2e-3 }),
    // Windows summed in another order; logarithms of small differences of large numbers, through a net.
    ("blend", Bound { relative: 2e-3, flips: 2e-3 }),
    // The same arithmetic in the same order.
    ("rescale", Bound { relative: 0.0, flips: 0.0 }),
    // All of these one after another.
    ("sequence", Bound { relative: 1e-3, flips: 2e-3 }),
];

fn bound(stage: &str) -> Bound {
    BOUNDS.iter().find(|(name, _)| *name == stage).unwrap().1
}

/// What a stage writes, as numbers: planes of some channels, row by row.
type Output = Vec<(String, Vec<f32>)>;

fn compare(a: &Output, b: &Output, bound: Bound) -> Result<(), String> {
    if a.len() != b.len() {
        return Err(format!("{} planes and {}", a.len(), b.len()));
    }
    for ((name, a), (_, b)) in a.iter().zip(b) {
        if a.len() != b.len() {
            return Err(format!("{name}: {} values and {}", a.len(), b.len()));
        }
        let finite = a.iter().filter(|v| v.is_finite());
        let magnitude = finite.map(|v| f64::from(v.abs())).sum::<f64>() / a.len().max(1) as f64;
        let (mut worst, mut flipped) = (0.0f64, 0);
        for (a, b) in a.iter().zip(b) {
            let same = a == b || (a.is_nan() && b.is_nan());
            let scale = f64::from(a.abs().max(b.abs())) + magnitude;
            let d = if same { 0.0 } else { f64::from((a - b).abs()) / scale };
            if d.is_nan() || d > bound.relative {
                (flipped, worst) = (flipped + 1, worst.max(if d.is_nan() { f64::INFINITY } else { d }));
            }
        }
        if f64::from(flipped) > bound.flips * a.len() as f64 {
            return Err(format!("{name}: {flipped} of {} values differ, by up to {worst:e}", a.len()));
        }
    }
    Ok(())
}

/// Compares what both back ends make, and plants differences into the one's output that must be seen in every plane.
fn check(stage: &str, mut run: impl FnMut(&SequenceStages) -> Output) -> Output {
    let [reference, cpu] = [Backend::Reference, Backend::Cpu].map(|backend| run(stages_of(backend)));
    compare(&reference, &cpu, bound(stage)).unwrap_or_else(|e| panic!("{stage}: {e}"));
    for k in 0..cpu.len() {
        let planted = |change: &dyn Fn(&mut Vec<f32>)| {
            let mut changed = cpu.clone();
            change(&mut changed[k].1);
            changed
        };
        let scaled = planted(&|v| v.iter_mut().for_each(|v| *v = *v * 1.01 + 1e-6));
        let shifted = planted(&|v| v.rotate_right(1));
        let spoilt = planted(&|v| v.iter_mut().for_each(|v| *v = if *v == v.floor() { *v + 0.5 } else { f32::NAN }));
        for (what, changed) in [("scaled", scaled), ("shifted", shifted), ("spoilt", spoilt)] {
            let constant = cpu[k].1.windows(2).all(|pair| pair[0] == pair[1]);
            if what == "shifted" && constant {
                continue;
            }
            assert!(compare(&reference, &changed, bound(stage)).is_err(), "{stage}: {} {what} is not seen", cpu[k].0);
        }
    }
    cpu
}

fn channels(name: &str, rows: &Rows) -> Output {
    let size = rows.size();
    let plane = |c: usize| (0..size.height).flat_map(|y| rows.row(y, c).to_vec()).collect();
    (0..rows.channels()).map(|c| (format!("{name} {c}"), plane(c))).collect()
}

fn colours(name: &str, plane: &Plane<Rgb>) -> (String, Vec<f32>) {
    (name.to_owned(), plane.data().iter().flatten().copied().collect())
}

/// Binomial 3x3, the border left as it is: a picture that differs from the one that came.
fn blurred(picture: &Plane<Rgb>) -> Plane<Rgb> {
    let Size { width, height } = picture.size();
    Plane::from_fn(picture.size(), |x, y| {
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return picture.at(x, y);
        }
        let tent = |d: usize| if d == 1 { 0.5 } else { 0.25 };
        let nine = (0..3).flat_map(|j| (0..3).map(move |i| (i, j)));
        nine.fold([0.0; 3], |sum, (i, j)| {
            let c = picture.at(x + i - 1, y + j - 1);
            [0, 1, 2].map(|k| sum[k] + tent(i) * tent(j) * c[k])
        })
    })
}

fn motion(name: &str, plane: Option<&Plane<[f32; 2]>>) -> (String, Vec<f32>) {
    (name.to_owned(), plane.map(|p| p.data().iter().flatten().copied().collect()).unwrap_or_default())
}

fn features(local: &LocalFeatures) -> Output {
    let named = |name: &str, planes: &[Vec<f32>]| -> Output {
        planes.iter().enumerate().map(|(c, plane)| (format!("{name} {c}"), plane.clone())).collect()
    };
    let mut all = named("slope", &local.slope);
    all.extend(named("depth", &[local.inverse_depth.clone(), local.depth_noise.clone(), local.normal_noise.clone()]));
    // The second component of normals is 0 all over.
    all.extend(named("normal", &[local.normal[0].clone(), local.normal[2].clone()]));
    all.extend(named("seen albedo", &local.seen_albedo));
    all.extend(named("seen normal", &local.seen_normal[..2]));
    all.extend(named("albedo", &local.albedo));
    all.push(("mirror".to_owned(), local.mirror.iter().map(|m| f32::from(u8::from(*m))).collect()));
    all
}

/// Five frames made ready, with the motion of reflections that the CPU finds.
fn window(size: Size) -> Vec<PreparedFrame> {
    let mut frames: Vec<_> =
        (0..5).map(|t| PreparedFrame::new(frame(t, size), &SequenceSettings::default()).unwrap()).collect();
    for t in 1..frames.len() {
        let (before, after) = frames.split_at_mut(t);
        before[t - 1].followed_by(&mut after[0], &SequenceSettings::default(), Backend::Cpu);
    }
    frames
}

#[test]
fn every_stage_agrees_with_its_reference() {
    let s = SequenceSettings::default();
    let frames = window(SIZE);
    let members: Vec<&PreparedFrame> = frames.iter().collect();
    let here = members[2];

    let plain: Vec<_> = [0, 1].map(|t| PreparedFrame::new(frame(t, Size::new(96, 88)), &s).unwrap()).into();
    let motion_of_glass = check("reflection_motion", |stages| {
        let found = (stages.reflection_motion)(&plain[0].features, &plain[1].features, &s.reflections).unwrap();
        vec![motion("to previous", found.to_previous.as_ref()), motion("to next", found.to_next.as_ref())]
    });
    let surface = plain[1].features.motion.to_previous.as_ref().map(|vectors| vectors.plane());
    let surface = motion("", surface.as_ref()).1;
    let other = motion_of_glass[0].1.iter().zip(&surface).filter(|(a, b)| a != b).count();
    assert!(other > surface.len() / 10, "what the glass shows has a motion of its own in {other} values");

    check("feature_noise", |stages| features(&(stages.feature_noise)(&here.features)));
    let local = (stages_of(Backend::Cpu).feature_noise)(&here.features);

    check("gather", |stages| {
        let gathered = (stages.gather)(&members, 2, &s.gather);
        [channels("mean", &gathered.colours), channels("moment", &gathered.moments)].concat()
    });
    let gathered = (stages_of(Backend::Cpu).gather)(&members, 2, &s.gather);
    assert_eq!(gathered.slots.len(), frames[0].slots.len(), "every kind of light takes part");

    let given: Vec<_> = gathered.slots.iter().map(|slot| here.given_variance(slot)).collect();
    assert!(given.iter().any(Option::is_some));
    let variance = |stages: &SequenceStages| (stages.variance)(&local, &gathered, &given, &s.variance, &s.wavelet);
    check("variance", |stages| channels("variance", &variance(stages)));
    let pooled = variance(stages_of(Backend::Cpu));

    let slots = &gathered.slots;
    let wavelet =
        |stages: &SequenceStages| (stages.wavelet)(&local, slots, gathered.colours.clone(), pooled.clone(), &s.wavelet);
    check("wavelet", |stages| channels("filtered", &wavelet(stages)));
    let filtered = wavelet(stages_of(Backend::Cpu));

    // Of a frame whose light came out otherwise than it went in.
    let other = |stages: &SequenceStages| (stages.residual)(here, slots, filtered.clone(), &s.residual);
    check("residual", |stages| channels("corrected", &other(stages)));

    check("sum", |stages| vec![colours("picture", &(stages.sum)(here, slots, &filtered))]);

    let pictures: Vec<_> =
        (members.iter()).map(|frame| (stages_of(Backend::Cpu).sum)(frame, slots, &gathered.colours)).collect();
    check("input", |stages| vec![colours("input", &(stages.input)(here, slots, &filtered))]);
    let raw: Vec<_> = (members.iter()).map(|frame| (stages_of(Backend::Cpu).input)(frame, slots, &filtered)).collect();
    let smoothed: Vec<_> = pictures.iter().map(blurred).collect();
    check("likeness", |stages| {
        let likeness = (stages.likeness)(&smoothed[2], &raw[2], &s.stabilise);
        vec![colours("guide", &likeness.guide), ("tolerance".to_owned(), likeness.tolerance.data().to_vec())]
    });
    let likeness: Vec<_> = (smoothed.iter().zip(&raw))
        .map(|(picture, raw)| (stages_of(Backend::Cpu).likeness)(picture, raw, &s.stabilise))
        .collect();
    check("signature", |stages| {
        let signature = (stages.signature)(&here.features, &smoothed[2]);
        vec![("signature".to_owned(), signature.data().to_vec())]
    });
    let signatures: Vec<_> = (members.iter().zip(&pictures))
        .map(|(frame, picture)| stabilise::kept((stages_of(Backend::Cpu).signature)(&frame.features, picture)))
        .collect();
    let shown: Vec<_> = (0..members.len())
        .map(|i| StabiliseFrame {
            features: &members[i].features,
            picture: &pictures[i],
            input: &raw[i],
            likeness: Some(&likeness[i]),
            signature: Some(&signatures[i]),
            alpha: members[i].alpha.as_ref(),
            along: None,
        })
        .collect();
    for (net, name) in [(false, "stabilise by hand"), (true, "stabilise")] {
        let settings = Stabilise { net, ..s.stabilise };
        check(name, |stages| {
            let (picture, alpha) = (stages.stabilise)(&shown, 2, &s.gather, &settings);
            vec![colours("picture", &picture), ("coverage".to_owned(), alpha.unwrap().data().to_vec())]
        });
    }

    let (steady, alpha) = (stages_of(Backend::Cpu).stabilise)(&shown, 2, &s.gather, &s.stabilise);
    check("residual", |stages| {
        let corrected = (stages.picture_residual)(5, &raw[2], steady.clone(), &s.residual);
        assert!(corrected != steady, "it corrects something here");
        vec![colours("corrected picture", &corrected)]
    });
    let shown: Vec<_> = (members.iter().zip(&raw).zip(&pictures))
        .map(|((f, input), picture)| BlendFrame {
            features: &f.features,
            input,
            picture,
            alpha: f.alpha.as_ref(),
            along: None,
        })
        .collect();
    let mut blended = None;
    for net in [false, true] {
        let settings = Blend { net, ..s.blend };
        check("blend", |stages| {
            let steady = (&steady, alpha.as_ref());
            let blend = (stages.blend)(&shown, 2, steady, (&s.gather, &s.stabilise), &settings);
            let mut output = vec![
                colours("shares", &blend.shares),
                ("noise".to_owned(), blend.noise.data().to_vec()),
                ("coverage".to_owned(), blend.alpha.as_ref().unwrap().data().to_vec()),
            ];
            output.extend(blend.gain.as_ref().map(|gain| colours("gain", gain)));
            assert_eq!(blend.gain.is_some(), net);
            blended = Some(blend);
            output
        });
    }

    check("rescale", |stages| {
        let passes = (stages.rescale)(here, slots, &filtered, [&pictures[2], &steady], blended.as_ref());
        passes.iter().flatten().enumerate().map(|(k, plane)| colours(&format!("pass {k}"), plane)).collect()
    });
}

#[test]
fn stages_agree_where_buffers_and_neighbours_are_missing() {
    let s = SequenceSettings::default();
    let mut sparse = frame(0, Size::new(9, 1));
    sparse.lights.retain(|light| light.kind != LightKind::Volume);
    (sparse.depth, sparse.position, sparse.seen_normal, sparse.alpha) = (None, None, None, None);
    let mut bare = SequenceFrame::new(0, Size::new(1, 7));
    bare.lights = frame(0, bare.size).lights;
    bare.lights[0].weight = None;
    for frame in [sparse, bare] {
        let frame = PreparedFrame::new(frame, &s).unwrap();
        let run = |stages: &SequenceStages| {
            let gathered = (stages.gather)(&[&frame], 0, &s.gather);
            let local = (stages.feature_noise)(&frame.features);
            let variance = (stages.variance)(&local, &gathered, &[], &s.variance, &s.wavelet);
            let slots = gathered.slots;
            let filtered = (stages.wavelet)(&local, &slots, gathered.colours, variance, &s.wavelet);
            let picture = (stages.sum)(&frame, &slots, &filtered);
            let input = (stages.input)(&frame, &slots, &filtered);
            let signature = stabilise::kept((stages.signature)(&frame.features, &picture));
            let only = StabiliseFrame {
                features: &frame.features,
                picture: &picture,
                input: &input,
                likeness: None,
                signature: Some(&signature),
                alpha: None,
                along: None,
            };
            let (steady, alpha) = (stages.stabilise)(&[only], 0, &s.gather, &s.stabilise);
            assert!(alpha.is_none());
            let passes = (stages.rescale)(&frame, &slots, &filtered, [&picture, &steady], None);
            passes.iter().flatten().map(|plane| colours("pass", plane)).collect()
        };
        let [reference, cpu]: [Output; 2] = [Backend::Reference, Backend::Cpu].map(|b| run(stages_of(b)));
        compare(&reference, &cpu, bound("sequence")).unwrap();
        assert!(reference.iter().flat_map(|(_, v)| v).all(|v| v.is_finite()));
    }
}

fn sequence(backend: Backend, changes: &[(&str, &str)]) -> Vec<Filtered> {
    let mut settings = SequenceSettings::default();
    changes.iter().for_each(|(name, value)| settings.set(name, value).unwrap());
    let mut denoiser = SequenceDenoiser::with_backend(settings, backend).unwrap();
    let mut out = Vec::new();
    for t in 0..7 {
        let mut frame = frame(t, Size::new(40, 24));
        frame.repeats_noise = t == 3;
        out.extend(denoiser.push(frame, true).unwrap());
    }
    out.extend(denoiser.finish().unwrap());
    out
}

fn whole(filtered: &[Filtered]) -> Output {
    let mut all = Output::new();
    for f in filtered {
        let planes = f.lights.iter().flat_map(|light| &light.planes);
        all.extend(planes.map(|plane| colours(&format!("frame {}", f.number), plane)));
        all.push((format!("noise {}", f.number), f.noise.as_ref().unwrap().data().to_vec()));
        all.push((format!("samples {}", f.number), f.samples.data().to_vec()));
        all.push((format!("coverage {}", f.number), f.alpha.as_ref().unwrap().data().to_vec()));
    }
    all
}

#[test]
fn whole_sequences_agree() {
    let settings: [&[(&str, &str)]; 3] = [
        &[],
        &[("gather.future", "off"), ("stabilise.frames", "3")],
        &[("gather.frames", "2"), ("wavelet.levels", "3")],
    ];
    for changes in settings {
        let [reference, cpu] = [Backend::Reference, Backend::Cpu].map(|backend| whole(&sequence(backend, changes)));
        compare(&reference, &cpu, bound("sequence")).unwrap_or_else(|e| panic!("{changes:?}: {e}"));
        let mut wrong = cpu.clone();
        wrong[1].1.iter_mut().for_each(|v| *v *= 1.01);
        assert!(compare(&reference, &wrong, bound("sequence")).is_err());
    }
    let [a, b] = [&[][..], &[("wavelet.matte", "3.9")]].map(|s| whole(&sequence(Backend::Cpu, s)));
    assert!(compare(&a, &b, bound("sequence")).is_err(), "another stop is seen");
}
