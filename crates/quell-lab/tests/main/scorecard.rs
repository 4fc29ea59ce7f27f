//! The scorecard on a sequence made by formula: the injection test, and what it says where it cannot measure.

use crate::synthetic::{Scene, with_noise};
use quell::{FrameBuf, Plane, Rgb, Size};
use quell_lab::metrics::Exposures;
use quell_lab::scorecard::injection::{Artefact, Injector};
use quell_lab::scorecard::matrix::{COLUMNS, Matrix};
use quell_lab::scorecard::{Instruments, ReferenceFrame, Scores};

/// Frames that serve as the past only.
const WARM_UP: usize = 6;

struct Sequence {
    frames: Vec<FrameBuf>,
    /// Halves A, B and the third rendering.
    renderings: [Vec<Plane<Rgb>>; 3],
}

impl Sequence {
    fn new(size: Size, count: i64, moves: bool) -> Self {
        Self::with_noise(size, count, moves, 0.005)
    }

    /// Three renderings, each with its own noise of this relative rms on the indirect light.
    fn with_noise(size: Size, count: i64, moves: bool, rms: f32) -> Self {
        let scene = Scene { size, moves };
        let mut sequence = Self { frames: Vec::new(), renderings: [Vec::new(), Vec::new(), Vec::new()] };
        for t in 0..count {
            let (frame, picture) = scene.frame(t);
            for (seed, rendering) in sequence.renderings.iter_mut().enumerate() {
                rendering.push(with_noise(&frame, &picture, rms, seed as u64 + 1));
            }
            sequence.frames.push(frame);
        }
        sequence
    }

    fn instruments(&self, halves: bool) -> Instruments {
        let [a, b, _] = &self.renderings;
        let frames: Vec<ReferenceFrame<'_>> = (0..self.frames.len())
            .map(|t| ReferenceFrame {
                b: halves.then_some(&b[t]),
                scored: t >= WARM_UP.min(self.frames.len() / 2),
                ..ReferenceFrame::new(&self.frames[t], &a[t])
            })
            .collect();
        Instruments::new(&frames).unwrap()
    }
}

fn value(scores: &Scores, name: &str) -> f64 {
    let score = scores.get(name).unwrap();
    score.value.unwrap_or_else(|| panic!("{name}: {score:?}"))
}

/// Responses of one score to another's artefact that are inherent, and why (docs/scorecard.md).
const COUPLINGS: &[(Artefact, &str, &str)] = &[
    (Artefact::FreshGrain, "noise", "grain that changes is grain in a still frame as well"),
    (Artefact::FreshGrain, "boiling", "white grain has power in every band"),
    (Artefact::FreshGrain, "slow_boiling", "what is new in every frame is new after four"),
    (Artefact::FreshBlotches, "slow_boiling", "what is new in every frame is new after four"),
    (Artefact::SlowBlotches, "boiling", "a tenth of the blotches is new in every frame: 0.32 in amplitude"),
    (Artefact::BlindHistory, "slow_boiling", "a stale shadow that moves on is a blotch that changes slowly"),
    (Artefact::BlindHistory, "flatness", "a stale shadow is missing where it now belongs"),
];

/// Injects each artefact at three strengths, the largest of equal HDR-FLIP, and asks that every score rises with its own
/// artefact and answers to others by at most 0.3 of that. It takes longer than 20 seconds: nine artefacts are scored three
/// times each, with edge-stopping Gaussians over every frame.
#[test]
fn the_injection_matrix_separates() {
    let sequence = Sequence::new(Size::new(128, 225), 14, true);
    let instruments = sequence.instruments(true);
    let frames: Vec<&FrameBuf> = sequence.frames.iter().collect();
    let injector = Injector::new(&frames, 11).unwrap();
    let [a, _, third] = &sequence.renderings;
    let depths = a.iter().zip(&sequence.frames).map(|(a, f)| (a, f.view_depth.as_ref()));
    let exposures = Exposures { count: 3, ..Exposures::from_reference(depths.skip(12)).unwrap() };
    // Strengths that give this HDR-FLIP, found by the search in `measure`: here it only checks them.
    let strengths = [0.061, 0.142, 0.045, 0.045, 0.4, 0.95, 0.345, 0.25, 1.0];
    let artefacts: Vec<(Artefact, f32)> = Artefact::ALL.into_iter().zip(strengths).collect();
    let matrix = Matrix::measure(&instruments, &injector, third, &artefacts, &exposures, 0.04, &[13]).unwrap();
    println!("HDR-FLIP {:.4}\n{}", matrix.flip, matrix.markdown());
    for row in &matrix.rows {
        assert!(matrix.rises(row), "{}: {:?}", row.artefact.name(), row.scores);
    }
    let mut wrong = Vec::new();
    // The protocol's seven artefacts and scores; the two beyond it are documented only.
    for row in &matrix.rows[..7] {
        for score in &COLUMNS[..7] {
            let inherent = COUPLINGS.iter().any(|(a, s, _)| *a == row.artefact && s == score);
            let response = matrix.relative(row, score).unwrap_or_else(|| panic!("{score} is null"));
            if !inherent && row.artefact.own_score() != *score && response.abs() > 0.3 {
                wrong.push(format!("{score} answers {response:.2} to {}", row.artefact.name()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    // Without an artefact, with the noise of three independent renderings, every share is 0.
    for name in ["blur", "smearing", "ghosting", "flatness"] {
        assert!(value(&matrix.base, name).abs() < 0.005, "{name}: {:?}", matrix.base);
    }
}

#[test]
fn halves_cancel_the_references_noise_and_one_reference_has_floors() {
    let sequence = Sequence::with_noise(Size::new(80, 100), 10, true, 0.1);
    let [_, _, third] = &sequence.renderings;
    let truth: Vec<Plane<Rgb>> = (0..10).map(|t| Scene { size: Size::new(80, 100), moves: true }.frame(t).1).collect();
    let with_halves = sequence.instruments(true);
    let right = with_halves.score(&truth).unwrap();
    for name in ["blur", "ghosting", "noise", "flicker"] {
        assert!(value(&right, name).abs() < 0.006, "{name}: {right:#?}");
        assert_eq!(right.get(name).unwrap().floor, None);
    }
    // A canary: against one reference the very same pictures seem to lose detail, and the floor says so.
    let single = sequence.instruments(false).score(&truth).unwrap();
    let blur = &single.blur;
    let floor = blur.floor.unwrap();
    assert!(floor > 0.02 && blur.value.is_none_or(|v| v > 0.02), "{blur:?}");
    assert!(single.noise.floor.unwrap() > 0.003 && single.noise.value.is_none(), "{:?}", single.noise);
    assert!(value(&with_halves.score(third).unwrap(), "noise") > 0.003);
}

#[test]
fn what_cannot_be_measured_is_null_with_its_reason() {
    let size = Size::new(64, 45);
    let reason = |scores: &Scores, name: &str| {
        let score = scores.get(name).unwrap();
        assert_eq!(score.value, None, "{name}: {score:?}");
        score.reason.clone().unwrap()
    };
    // A static sequence: nothing stale, nothing fresh.
    let still = Sequence::new(size, 9, false);
    let instruments = still.instruments(true);
    assert!(instruments.is_static());
    let scores = instruments.score(&still.renderings[2]).unwrap();
    assert!(reason(&scores, "ghosting").contains("nothing moves"));
    assert!(reason(&scores, "fresh_noise").contains("nothing moves"));
    assert!(reason(&scores, "lag").contains("lamps"));
    assert!(scores.flicker.value.is_some() && scores.slow_boiling.value.is_some());
    // Two frames: no lag of four.
    let frame = |t: usize| ReferenceFrame::new(&still.frames[t], &still.renderings[0][t]);
    let two = Instruments::new(&[frame(0), frame(1)]).unwrap();
    let scores = two.score(&still.renderings[2][..2]).unwrap();
    assert!(reason(&scores, "slow_boiling").contains("2 frames"), "{scores:?}");
    // All warm-up.
    let unscored = ReferenceFrame { scored: false, ..frame(0) };
    let scores = Instruments::new(&[unscored]).unwrap().score(&still.renderings[2][..1]).unwrap();
    assert!(reason(&scores, "noise").contains("warm-up"));
    // No guides at all, one pixel, black, not finite: numbers or reasons, never a panic.
    let bare = |size: Size| FrameBuf::new(size, Scene { size, moves: false }.camera(0));
    for size in [Size::new(1, 1), Size::new(1, 7), Size::new(9, 1)] {
        let (guides, lit) = (bare(size), Plane::filled(size, [0.5; 3]));
        let frames = [ReferenceFrame::new(&guides, &lit), ReferenceFrame::new(&guides, &lit)];
        let instruments = Instruments::new(&frames).unwrap();
        let odd = vec![Plane::filled(size, [f32::NAN, f32::INFINITY, -1.0]), Plane::filled(size, [3e38; 3])];
        for (name, score) in instruments.score(&odd).unwrap().iter() {
            assert!(
                score.value.is_none_or(f64::is_finite) && score.value.is_some() != score.reason.is_some(),
                "{name}"
            );
        }
        assert!(instruments.score(&odd[..1]).is_err());
    }
    let black = Plane::filled(size, [0.0; 3]);
    assert!(Instruments::new(&[ReferenceFrame::new(&still.frames[0], &black)]).is_err());
    assert!(Instruments::new(&[]).is_err());
    let other = Plane::filled(Size::new(2, 2), [1.0; 3]);
    assert!(Instruments::new(&[ReferenceFrame::new(&still.frames[0], &other)]).is_err());
}

#[test]
fn lag_counts_the_frames_until_the_light_has_followed() {
    let size = Size::new(64, 45);
    let (frame, truth) = Scene { size, moves: false }.frame(0);
    let direct = frame.direct.clone().unwrap();
    // Indirect light doubles at frame 4 and is gone at frame 14.
    let light = |t: usize| match t {
        0..4 => 1.0,
        4..14 => 2.0,
        _ => 0.0f32,
    };
    let at = |factor: f32| {
        Plane::from_fn(size, |x, y| {
            let (p, d) = (truth.at(x, y), direct.at(x, y));
            std::array::from_fn(|c| d[c] + factor * (p[c] - d[c]))
        })
    };
    let references: Vec<Plane<Rgb>> = (0..24).map(|t| at(light(t))).collect();
    let frames: Vec<ReferenceFrame<'_>> = references.iter().map(|r| ReferenceFrame::new(&frame, r)).collect();
    let instruments = Instruments::new(&frames).unwrap();
    assert_eq!(value(&instruments.score(&references).unwrap(), "lag"), 0.0);
    // An exponential history of weight a is within 10 % of a step after n frames, where a^(n + 1) < 0.1.
    for (kept, expected) in [(0.72f32, 7.0), (0.5, 3.0)] {
        let mut history = light(0);
        let pictures: Vec<Plane<Rgb>> = (0..24)
            .map(|t| {
                history = kept * history + (1.0 - kept) * light(t);
                at(history)
            })
            .collect();
        assert_eq!(value(&instruments.score(&pictures).unwrap(), "lag"), expected, "{kept}");
    }
    // Noise, of the picture and of two references, of a third of the light in each pixel: the same within a frame.
    let noisy = |picture: &Plane<Rgb>, t: usize, seed: u64| with_noise(&frame, picture, 0.3, 3 * t as u64 + seed);
    let halves: Vec<[Plane<Rgb>; 2]> =
        references.iter().enumerate().map(|(t, r)| [noisy(r, t, 100), noisy(r, t, 101)]).collect();
    let frames: Vec<ReferenceFrame<'_>> =
        halves.iter().map(|[a, b]| ReferenceFrame { b: Some(b), ..ReferenceFrame::new(&frame, a) }).collect();
    let uncertain = Instruments::new(&frames).unwrap();
    for (kept, expected) in [(0.72f32, 7.0f64), (0.5, 3.0), (0.0, 0.0)] {
        let mut history = light(0);
        let pictures: Vec<Plane<Rgb>> = (0..24)
            .map(|t| {
                history = kept * history + (1.0 - kept) * light(t);
                noisy(&at(history), t, 102)
            })
            .collect();
        let lag = value(&uncertain.score(&pictures).unwrap(), "lag");
        // The slowest of nine is late by chance.
        assert!((lag - expected).abs() <= 2.0, "{kept}: {lag}");
    }
    // One whose lower third follows late is as slow as that.
    let pictures: Vec<Plane<Rgb>> = (0..24)
        .map(|t| {
            let (early, late) = (at(light(t)), at(light(t.saturating_sub(5))));
            Plane::from_fn(size, |x, y| if y >= size.height * 2 / 3 { late.at(x, y) } else { early.at(x, y) })
        })
        .collect();
    let lag = value(&instruments.score(&pictures).unwrap(), "lag");
    assert!((lag - 5.0).abs() <= 1.0, "{lag}");
    // One that never follows is reported as such.
    let stuck: Vec<Plane<Rgb>> = (0..24).map(|_| at(1.0)).collect();
    let lag = instruments.score(&stuck).unwrap().lag;
    assert!(lag.value == Some(10.0) && lag.reason.unwrap().contains("at least"));
}
