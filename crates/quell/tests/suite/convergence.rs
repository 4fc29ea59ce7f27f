//! More samples always help: on a sequence whose light is known the error falls with every step from 1 to 4096 samples a pixel.

use quell::sequence::{Light, LightKind, SequenceDenoiser, SequenceFrame, SequenceSettings};
use quell::{Plane, Rgb, Size};
use std::sync::Arc;

const SIZE: Size = Size::new(72, 48);
/// Pixels a frame by which the camera slides.
const SPEED: f32 = 1.25;
const FRAMES: i64 = 9;
/// Frames that are scored.
const SCORED: std::ops::RangeInclusive<i64> = 3..=5;

/// Numbers 0..1 that look random, from integers.
fn random(x: usize, y: usize, t: i64, k: u64) -> f32 {
    let mut h = (x as u64) ^ (y as u64) << 16 ^ (t as u64) << 32 ^ k << 48;
    for _ in 0..3 {
        h = (h ^ (h >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}

/// The mean of `samples` paths of which one in five brings light: mean 1.
fn noise(x: usize, y: usize, t: i64, k: u64, samples: usize) -> f32 {
    const LIT: f32 = 0.2;
    if samples <= 64 {
        let lit = (0..samples).filter(|s| random(x, y, t, k + 16 * *s as u64) < LIT).count();
        return lit as f32 / (LIT * samples as f32);
    }
    let normal: f32 = (0..12).map(|s| random(x, y, t, k + 16 * s)).sum::<f32>() - 6.0;
    (1.0 + normal * ((1.0 / LIT - 1.0) / samples as f32).sqrt()).max(0.0)
}

/// What the scene shows at a pixel.
struct Shown {
    /// A bar of the lattice in front, else the wall; a pixel at its edge shows both.
    front: f32,
    colour: Rgb,
    /// Direct light with the edge of a shadow that moves, and light that is switched on in frame 4.
    direct: f32,
    /// A highlight that moves over the wall.
    highlight: f32,
    /// The reflection of stripes: it slides otherwise than the wall.
    reflection: f32,
    /// A sign that is on in every other frame.
    sign: f32,
}

fn shown(x: f32, y: f32, t: i64) -> Shown {
    let time = t as f32;
    let wall = x + SPEED * time;
    let bars = (x + 2.0 * SPEED * time).rem_euclid(11.0);
    let front = if y < 16.0 { (2.0 - (bars - 5.5).abs()).clamp(0.0, 1.0) } else { 0.0 };
    let texture = if ((wall / 3.0).floor() + (y / 3.0).floor()).rem_euclid(2.0) < 1.0 { 0.3 } else { 0.6 };
    let shadow = if wall + 0.5 * y - 2.0 * time < 40.0 { 1.0 } else { 0.15 };
    let far = ((wall - 24.0 - 1.5 * time).powi(2) + (y - 30.0).powi(2)) / 18.0;
    let stripes = if (x - 0.75 * time).rem_euclid(7.0) < 3.5 { 0.8 } else { 0.1 };
    let lamp = if t >= 4 && x > 40.0 { 0.5 } else { 0.0 };
    Shown {
        front,
        colour: [texture, 0.8 * texture, 0.5],
        direct: shadow + lamp,
        highlight: 3.0 / (1.0 + far * far),
        reflection: if y > 38.0 { stripes } else { 0.05 },
        sign: if (50.0..60.0).contains(&x) && (20.0..26.0).contains(&y) && t % 2 == 0 { 2.0 } else { 0.0 },
    }
}

/// A light by its name: its kind and its truth.
type Part = (LightKind, fn(&Shown) -> Rgb);
const PARTS: [Part; 4] = [
    (LightKind::MatteDirect, |s| [s.direct * (1.0 - s.front) + 0.2 * s.front; 3]),
    (LightKind::GlossyDirect, |s| [s.highlight * (1.0 - s.front); 3]),
    (LightKind::GlossyIndirect, |s| [s.reflection * (1.0 - s.front); 3]),
    (LightKind::NoiseFree, |s| [s.sign, 0.2 * s.sign, 0.0]),
];

fn frame(t: i64, samples: usize) -> SequenceFrame {
    let at = |x: usize, y: usize| shown(x as f32, y as f32, t);
    let mut frame = SequenceFrame::new(t, SIZE);
    let colour = Arc::new(Plane::from_fn(SIZE, |x, y| {
        let s = at(x, y);
        s.colour.map(|c| c * (1.0 - s.front) + 0.1 * s.front)
    }));
    for (k, (kind, truth)) in (1..).zip(PARTS) {
        let light = Plane::from_fn(SIZE, |x, y| {
            let factor = if kind == LightKind::NoiseFree { 1.0 } else { noise(x, y, t, k, samples) };
            truth(&at(x, y)).map(|c| c * factor)
        });
        let mut light = Light::new(format!("{kind:?}"), kind, light);
        light.weight = (kind == LightKind::MatteDirect).then(|| Arc::clone(&colour));
        frame.lights.push(light);
    }
    let front = |x: usize, y: usize| at(x, y).front;
    frame.albedo = Some(colour.as_ref().clone());
    // Feature buffers are means over the pixel, as renderers write them.
    frame.depth = Some(Plane::from_fn(SIZE, |x, y| 4.0 - 2.0 * front(x, y)));
    frame.normal = Some(Plane::from_fn(SIZE, |x, y| [0.6 * front(x, y), 0.0, 1.0 - 0.2 * front(x, y)]));
    frame.position =
        Some(Plane::from_fn(SIZE, |x, y| [(x as f32 + SPEED * t as f32) * 0.1, y as f32 * -0.1, 2.0 * front(x, y)]));
    let speed = |x: usize, y: usize| SPEED * (1.0 + front(x, y));
    frame.motion_to_previous = Some(Plane::from_fn(SIZE, |x, y| [speed(x, y), 0.0]));
    frame.motion_to_next = Some(Plane::from_fn(SIZE, |x, y| [-speed(x, y), 0.0]));
    frame
}

/// relMSE of the input and of the output over the scored frames.
fn errors(samples: usize, settings: SequenceSettings) -> [f64; 2] {
    let mut denoiser = SequenceDenoiser::new(settings).unwrap();
    let mut out = Vec::new();
    for t in 0..FRAMES {
        out.extend(denoiser.push(frame(t, samples), SCORED.contains(&t)).unwrap());
    }
    out.extend(denoiser.finish().unwrap());
    let mut sums = [0.0f64; 2];
    let mut count = 0.0;
    for filtered in &out {
        let noisy = frame(filtered.number, samples).beauty();
        for p in 0..SIZE.pixels() {
            let s = shown((p % SIZE.width) as f32, (p / SIZE.width) as f32, filtered.number);
            let colour = s.colour.map(|c| c * (1.0 - s.front) + 0.1 * s.front);
            for c in 0..3 {
                let truth: f32 = (PARTS.iter())
                    .map(|(kind, truth)| truth(&s)[c] * if *kind == LightKind::MatteDirect { colour[c] } else { 1.0 })
                    .sum();
                let output: f32 = (filtered.lights.iter())
                    .map(|l| l.planes[0].data()[p][c] * l.weight.as_ref().map_or(1.0, |w| w.data()[p][c]))
                    .sum();
                let error = |v: f32| f64::from((v - truth).powi(2) / (truth * truth + 0.01));
                sums[0] += error(noisy.data()[p][c]);
                sums[1] += error(output);
                count += 1.0;
            }
        }
    }
    sums.map(|sum| sum / count)
}

/// Most that the output's error may be of the input's at 4096 samples.
const AT_THE_END: f64 = 1.05;

/// The error falls at every step, with the nets and with thresholds in their place, and does not end above the input's.
#[test]
fn more_samples_always_help() {
    let mut wrong = Vec::new();
    for net in [true, false] {
        let mut settings = SequenceSettings::default();
        settings.blend.net = net;
        let mut last = f64::INFINITY;
        for samples in [1, 4, 16, 64, 256, 1024, 4096] {
            let [input, output] = errors(samples, settings.clone());
            let line = format!("net {net}, {samples} samples: input {input:.3e}, output {output:.3e}");
            println!("{line}, {:.3} times", output / input);
            let too_far = samples == 4096 && output > AT_THE_END * input;
            if output >= last || too_far {
                wrong.push(line);
            }
            last = output;
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn without_a_choice_the_error_stays() {
    let mut settings = SequenceSettings::default();
    settings.blend.choose = false;
    // The net's form of `stabilise` takes the input's part, too.
    settings.stabilise.net = false;
    let [input, output] = errors(4096, settings);
    assert!(output > 3.0 * AT_THE_END * input, "{output:e} of {input:e}: the test above would see nothing");
}
