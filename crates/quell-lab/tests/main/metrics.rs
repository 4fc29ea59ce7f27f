//! Metrics against independent implementations: the numbers are printed by `tests/scripts/metrics_reference.py`, which makes
//! the same pictures by the same formulas.

use quell::{Plane, Rgb, Size};
use quell_lab::metrics::{Exposures, FrameScores, energy, hdr_flip, ldr_flip, psnr, rel_mse, ssim};
use quell_lab::tone::Tone;

const SIZE: Size = Size::new(97, 61);

struct Pictures {
    reference: Plane<Rgb>,
    noisy: Plane<Rgb>,
    blurred: Plane<Rgb>,
    reference_hdr: Plane<Rgb>,
    noisy_hdr: Plane<Rgb>,
    blurred_hdr: Plane<Rgb>,
}

fn pictures() -> Pictures {
    let in_disc = |x: usize, y: usize| (x as f64 - 60.0).powi(2) + (y as f64 - 25.0).powi(2) < 225.0;
    let reference = Plane::from_fn(SIZE, |x, y| {
        if in_disc(x, y) {
            return [0.9, 0.15, 0.1];
        }
        let (fx, fy) = (x as f64, y as f64);
        let (u, v) = (fx / SIZE.width as f64, fy / SIZE.height as f64);
        let wave = 0.5 + 0.5 * (0.9 * fx).sin() * (0.35 * fy).cos();
        [(0.05 + 0.9 * u * wave) as f32, (0.1 + 0.6 * v) as f32, (0.8 - 0.6 * u) as f32]
    });
    let mut state = 7u32;
    let mut grain = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.6 + 0.8 * ((state >> 8) as f32 / 16_777_216.0)
    };
    let noisy = Plane::from_fn(SIZE, |x, y| reference.at(x, y).map(|v| v * grain()));
    let blurred = Plane::from_fn(SIZE, |x, y| {
        if x == 0 || x + 1 == SIZE.width {
            return reference.at(x, y);
        }
        let (a, b, c) = (reference.at(x - 1, y), reference.at(x, y), reference.at(x + 1, y));
        std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0)
    });
    let bright =
        |p: &Plane<Rgb>| Plane::from_fn(SIZE, |x, y| p.at(x, y).map(|v| v * if in_disc(x, y) { 30.0 } else { 0.7 }));
    Pictures {
        reference_hdr: bright(&reference),
        noisy_hdr: bright(&noisy),
        blurred_hdr: bright(&blurred),
        reference,
        noisy,
        blurred,
    }
}

#[track_caller]
fn three_digits(what: &str, found: f64, expected: f64) {
    assert!((found - expected).abs() <= 0.0005 * expected.abs(), "{what}: {found}, expected {expected}");
}

#[test]
fn flip_agrees_with_its_authors_program() {
    let p = pictures();
    three_digits("noisy", ldr_flip(&p.noisy, &p.reference).unwrap().mean, 0.156398);
    three_digits("blurred", ldr_flip(&p.blurred, &p.reference).unwrap().mean, 0.046406);
    // A canary: the order of the arguments does not matter to FLIP, the pictures do.
    assert!((ldr_flip(&p.noisy, &p.blurred).unwrap().mean - 0.156398).abs() > 0.001);
}

#[test]
fn hdr_flip_agrees_with_its_authors_program() {
    let p = pictures();
    let exposures = Exposures { start: -4.0, stop: 2.0, count: 6 };
    let noisy = hdr_flip(&p.noisy_hdr, &p.reference_hdr, &exposures).unwrap();
    three_digits("noisy", noisy.mean, 0.145697);
    three_digits("noisy at (30, 20)", noisy.map.at(30, 20).into(), 0.091635);
    three_digits("noisy at (60, 25)", noisy.map.at(60, 25).into(), 0.070798);
    let blurred = hdr_flip(&p.blurred_hdr, &p.reference_hdr, &exposures).unwrap();
    three_digits("blurred", blurred.mean, 0.072301);
    three_digits("blurred at (30, 20)", blurred.map.at(30, 20).into(), 0.069820);
}

#[test]
fn the_papers_automatic_exposures() {
    let p = pictures();
    let mut luminances: Vec<f64> =
        p.reference_hdr.data().iter().map(|&c| f64::from(quell_lab::tone::luminance(c))).collect();
    luminances.sort_by(f64::total_cmp);
    let found = Exposures::from_luminances(luminances[luminances.len() - 1], luminances[luminances.len() / 2]);
    assert!((found.start + 2.114_44).abs() < 1e-3 && (found.stop - 2.835_32).abs() < 1e-3, "{found:?}");
    assert_eq!(found.count, 5);
    three_digits("automatic", hdr_flip(&p.noisy_hdr, &p.reference_hdr, &found).unwrap().mean, 0.143536);
}

#[test]
fn rel_mse_and_psnr_agree_with_numpy() {
    let p = pictures();
    for (name, picture, mean, trimmed, decibels) in [
        ("noisy", &p.noisy_hdr, 0.039182, 0.039087, 26.17199),
        ("blurred", &p.blurred_hdr, 0.009812, 0.009027, 35.17749),
    ] {
        let found = rel_mse(picture, &p.reference_hdr).unwrap();
        three_digits(name, found.mean, mean);
        three_digits(name, found.trimmed, trimmed);
        three_digits(name, psnr(picture, &p.reference_hdr, Tone::default()).unwrap(), decibels);
    }
}

#[test]
fn ssim_agrees_with_scikit_image() {
    let p = pictures();
    let tone = Tone::default();
    three_digits("noisy", ssim(&p.noisy_hdr, &p.reference_hdr, tone).unwrap().mean, 0.612292);
    three_digits("blurred", ssim(&p.blurred_hdr, &p.reference_hdr, tone).unwrap().mean, 0.988619);
    // A canary: another exposure is another picture.
    let other = ssim(&p.noisy_hdr, &p.reference_hdr, Tone { exposure: 2.0 }).unwrap().mean;
    assert!((other / 0.612292 - 1.0).abs() > 0.002, "{other}");
}

#[test]
fn energy_and_fireflies_agree_with_numpy() {
    let p = pictures();
    three_digits("noisy", energy(&p.noisy_hdr, &p.reference_hdr).unwrap(), 1.009469);
    three_digits("blurred", energy(&p.blurred_hdr, &p.reference_hdr).unwrap(), 0.999467);
    let mut spotted = p.reference_hdr.clone();
    for (x, y, v) in [(5, 5, 400.0), (50, 40, 900.0), (90, 7, 5000.0), (30, 30, 0.0)] {
        spotted.set(x, y, [v; 3]);
    }
    let found = rel_mse(&spotted, &p.reference_hdr).unwrap();
    three_digits("spotted", found.mean, 83528.100005);
    assert_eq!((found.trimmed, found.fireflies), (0.0, 3));
}

#[test]
fn a_frames_scores_are_those_of_the_single_metrics() {
    let p = pictures();
    let exposures = Exposures { start: -4.0, stop: 2.0, count: 6 };
    let (scores, map) = FrameScores::measure(&p.noisy_hdr, &p.reference_hdr, Tone::default(), &exposures).unwrap();
    for (name, found, expected) in [
        ("relMSE", scores.rel_mse, 0.039182),
        ("trimmed", scores.rel_mse_trimmed, 0.039087),
        ("PSNR", scores.psnr, 26.17199),
        ("SSIM", scores.ssim, 0.612292),
        ("FLIP", scores.ldr_flip, 0.112207),
        ("HDR-FLIP", scores.hdr_flip, 0.145697),
        ("HDR-FLIP's map", map.mean, 0.145697),
        ("energy", scores.energy, 1.009469),
    ] {
        three_digits(name, found, expected);
    }
    assert_eq!(scores.fireflies, 0.0);
}
