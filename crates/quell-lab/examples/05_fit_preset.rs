//! Fits parameters of the real-time filter by coordinate search (docs/quality.md, "Fitted anew"):
//! `cargo run --release -p quell-lab --example 05_fit_preset -- on=SEQUENCE,... base=quell:quality [sweeps=3] NAME=BEGIN:STEP:LEAST:MOST...`
//!
//! A sequence is `SCENE:CAMERA:SEED[:WIDTHxHEIGHT[:SAMPLES[:LAST]]]`, of built-in scenes; what is empty or left out is 160x90, references of
//! 2 x 128 samples, and frames 0 to 23, of which 1, 2, 6 and 18, 22, 23 are scored. With another last frame the last two are. `on` is
//! `glossy-room:1:0,mirror-hall:1:0` where it is left out. Steps above 1 are factors, others differences; after each sweep differences are
//! halved, of factors the root is taken. References are kept in the cache (`cache=FOLDER`).
//!
//! Without parameters, the methods of `methods=NAME,...` are scored, else `base`: a line a sequence and, for each phase, HDR-FLIP, trimmed relMSE, trimmed error
//! of means over 7x7 in thousandths, energy, boiling in ten-thousandths, flicker in thousandths. Errors and changes are without the references'
//! own noise; HDR-FLIP holds it.

use quell::{Plane, Rgb, Size};
use quell_lab::cache::Cache;
use quell_lab::compare::{SceneSource, Sequence};
use quell_lab::methods::{Input, parse};
use quell_lab::metrics::flip::{Exposures, hdr_flip};
use quell_lab::references::ReferenceTarget;
use quell_lab::tone::luminance;
use quell_lab::tracer::TraceOn;
use quell_trace::{PrimaryReplacement, RenderOptions, builtin};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::error::Error;

type Failure = Box<dyn Error + Send + Sync>;

/// Half the width of the windows whose means are low frequencies, pixels.
const RADIUS: usize = 3;
/// Least gain for which a step is kept.
const LEAST_GAIN: f64 = 1e-4;
/// What each logarithm counts in the cost: HDR-FLIP, error, error of window means, boiling, flicker.
const COSTS: [f64; 5] = [0.5, 0.25, 0.15, 0.05, 0.08];
/// Logarithms are taken of no less: products of two estimates may be 0, or below.
const LEAST_ERROR: f64 = 1e-8;
/// Of these many pixels the worst is left out of the error; of changes and window means, one of so many.
const TRIMMED_OF: usize = 1000;
const CHANGES_TRIMMED_OF: usize = 500;
/// Relative errors count as this at most in window means: single bright pixels would be all that they show.
const LARGEST: f64 = 4.0;
/// Added to the truth under a difference of luminance, of the truth's mean.
const DARK: f64 = 0.1;
/// eps of relMSE, of the squared mean luminance, as in `quell_lab::metrics::rel_mse`.
const EPSILON: f64 = 0.01;
/// Energy may be off by so much; what is beyond costs `ENERGY_COST` times as much.
const ENERGY_ROOM: f64 = 0.01;
const ENERGY_COST: f64 = 5.0;

/// Means over the frames of a phase.
#[derive(Clone, Copy, Default)]
struct Score {
    flip: f64,
    error: f64,
    wide_error: f64,
    energy: f64,
    boiling: f64,
    flicker: f64,
}

impl Score {
    /// What is minimised, of one phase.
    fn cost(&self) -> f64 {
        let parts = [self.flip, self.error, self.wide_error, self.boiling, self.flicker];
        parts.iter().zip(COSTS).map(|(part, cost)| cost * part.max(LEAST_ERROR).ln()).sum::<f64>()
            + ENERGY_COST * ((self.energy - 1.0).abs() - ENERGY_ROOM).max(0.0)
    }
}

struct Trained {
    name: String,
    sequence: Sequence,
    exposures: Exposures,
    phases: Vec<Vec<i64>>,
}

/// The frame before, for what changes from frame to frame.
struct Before<'a> {
    number: i64,
    truth: &'a Plane<Rgb>,
    /// The truth's mean luminance.
    brightness: f64,
    /// Against both halves.
    errors: [Vec<f64>; 2],
}

impl Trained {
    fn load(name: &str, cache: &Cache) -> Result<Self, Failure> {
        let parts: Vec<&str> = name.split(':').collect();
        let [scene, camera, seed, ..] = parts[..] else { return Err(format!("{name}: SCENE:CAMERA:SEED...").into()) };
        let part = |i: usize, default: &'static str| parts.get(i).copied().filter(|p| !p.is_empty()).unwrap_or(default);
        let (width, height) = part(3, "160x90").split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
        let last: i64 = part(5, "23").parse()?;
        if last < 1 {
            return Err(format!("{name}: the last frame is 1 or later").into());
        }
        let phases = if last == 23 { vec![vec![1, 2, 6], vec![18, 22, 23]] } else { vec![vec![last - 1, last]] };
        let scene = builtin(scene)?;
        let size = Size::new(width.parse()?, height.parse()?);
        let source = SceneSource {
            scene: &scene,
            camera: camera.parse()?,
            frames: (0..=last).collect(),
            // Mirrors are surfaces: the values that act on them would else have nothing to act on.
            options: RenderOptions {
                seed: seed.parse()?,
                primary_replacement: PrimaryReplacement::Glass,
                ..RenderOptions::new(size)
            },
            target: ReferenceTarget { samples: part(4, "128").parse()?, ..ReferenceTarget::default() },
            references: phases.concat(),
            on: &TraceOn::Cpu,
            cache: Some(cache),
            folder: None,
        };
        let sequence = source.load(None, &|_| ())?;
        let exposures = Exposures::from_reference(sequence.references().values().map(|r| (&r.mean, None)))?;
        Ok(Self { name: name.to_owned(), sequence, exposures, phases })
    }

    fn score(&self, method: &str) -> Result<Vec<Score>, Failure> {
        let mut method = parse(method)?;
        let mut pictures = BTreeMap::new();
        for (index, number) in self.sequence.numbers.iter().enumerate() {
            let noisy = self.sequence.frame(index)?;
            let picture = method.denoise(&Input { frame: &noisy.frame.frame(&[]), halves: None })?;
            if self.sequence.references().contains_key(number) {
                pictures.insert(*number, picture);
            }
        }
        self.phases.iter().map(|phase| self.phase(phase, &pictures)).collect()
    }

    fn phase(&self, phase: &[i64], pictures: &BTreeMap<i64, Plane<Rgb>>) -> Result<Score, Failure> {
        let mut score = Score::default();
        let count = phase.len() as f64;
        let pairs = phase.windows(2).filter(|w| w[1] == w[0] + 1).count().max(1) as f64;
        let mut before: Option<Before<'_>> = None;
        for number in phase {
            let reference = self.sequence.reference(*number).ok_or("no reference")?;
            let halves = reference.halves.as_ref().ok_or("no halves")?.each_ref().map(|half| &half.beauty);
            let (picture, truth) = (&pictures[number], &reference.mean);
            let brightness = mean_luminance(truth);
            score.flip += hdr_flip(picture, truth, &self.exposures)?.mean / count;
            score.error += trimmed_error(picture, truth, halves, brightness) / count;
            score.energy += mean_luminance(picture) / brightness / count;
            let errors = halves.map(|half| relative(picture, half, truth, brightness));
            let bounded = |e: &f64| e.clamp(-LARGEST, LARGEST);
            let windows =
                errors.each_ref().map(|e| window_means(&e.iter().map(bounded).collect::<Vec<f64>>(), truth.size()));
            score.wide_error += trimmed_product(&windows) / count;
            if let Some(last) = before.take_if(|last| last.number + 1 == *number) {
                // Both frames over the truth of the first: what is divided by does not change.
                let now = halves.map(|half| relative(picture, half, last.truth, last.brightness));
                let changes: [Vec<f64>; 2] =
                    std::array::from_fn(|h| now[h].iter().zip(&last.errors[h]).map(|(now, then)| now - then).collect());
                score.flicker += trimmed_product(&changes) / pairs;
                score.boiling += trimmed_product(&changes.each_ref().map(|c| window_means(c, truth.size()))) / pairs;
            }
            before = Some(Before { number: *number, truth, brightness, errors });
        }
        Ok(score)
    }
}

fn mean_luminance(plane: &Plane<Rgb>) -> f64 {
    plane.data().iter().map(|&c| f64::from(luminance(c))).sum::<f64>() / plane.data().len() as f64
}

/// relMSE without the references' noise: (D - A)(D - B) over R^2 + eps, without the 0.1 % of pixels that are farthest off.
fn trimmed_error(d: &Plane<Rgb>, truth: &Plane<Rgb>, [a, b]: [&Plane<Rgb>; 2], brightness: f64) -> f64 {
    let epsilon = EPSILON * brightness * brightness;
    let mut terms: Vec<(f64, f64)> = (0..truth.data().len())
        .map(|i| {
            let (mut off, mut product) = (0.0, 0.0);
            for c in 0..3 {
                let at = |plane: &Plane<Rgb>| f64::from(plane.data()[i][c]);
                let scale = 1.0 / (3.0 * (at(truth).powi(2) + epsilon));
                off += (at(d) - at(truth)).powi(2) * scale;
                product += (at(d) - at(a)) * (at(d) - at(b)) * scale;
            }
            (off, product)
        })
        .collect();
    terms.sort_by(|x, y| x.0.total_cmp(&y.0));
    let kept = terms.len() - terms.len().div_ceil(TRIMMED_OF);
    terms[..kept].iter().map(|t| t.1).sum::<f64>() / kept.max(1) as f64
}

/// Differences of luminance, over the truth's and a part of its mean.
fn relative(d: &Plane<Rgb>, half: &Plane<Rgb>, truth: &Plane<Rgb>, brightness: f64) -> Vec<f64> {
    let light = |c: &Rgb| f64::from(luminance(*c));
    let of = |((d, half), truth): ((&Rgb, &Rgb), &Rgb)| (light(d) - light(half)) / (light(truth) + DARK * brightness);
    d.data().iter().zip(half.data()).zip(truth.data()).map(of).collect()
}

/// Means over windows that lie within the picture.
fn window_means(values: &[f64], size: Size) -> Vec<f64> {
    let (width, height, across) = (size.width, size.height, 2 * RADIUS + 1);
    let mut means = Vec::new();
    for y in 0..height.saturating_sub(across - 1) {
        for x in 0..width.saturating_sub(across - 1) {
            let rows = (y..y + across).map(|row| values[row * width + x..][..across].iter().sum::<f64>());
            means.push(rows.sum::<f64>() / (across * across) as f64);
        }
    }
    means
}

/// Mean of the products of two independent estimates, without the 0.2 % that are largest.
fn trimmed_product([a, b]: &[Vec<f64>; 2]) -> f64 {
    let mut products: Vec<f64> = a.iter().zip(b).map(|(a, b)| a * b).collect();
    products.sort_by(|x, y| x.abs().total_cmp(&y.abs()));
    let kept = products.len() - products.len() / CHANGES_TRIMMED_OF;
    products[..kept].iter().sum::<f64>() / kept.max(1) as f64
}

struct Parameter {
    name: String,
    value: f64,
    step: f64,
    range: [f64; 2],
}

impl Parameter {
    fn parse(text: &str) -> Result<Self, Failure> {
        let (name, values) = text.split_once('=').ok_or("NAME=BEGIN:STEP:LEAST:MOST")?;
        let values = values.split(':').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let [value, step, least, most] = values[..] else { return Err(format!("{text}: four numbers").into()) };
        if !(step > 0.0 && least <= value && value <= most && (step <= 1.0 || value > 0.0)) {
            return Err(format!("{text}: a step above 0, a beginning within the range, above 0 for factors").into());
        }
        Ok(Self { name: name.to_owned(), value, step, range: [least, most] })
    }

    /// The value a step away, within the range.
    fn moved(&self, up: bool) -> f64 {
        let moved = match (self.step > 1.0, up) {
            (true, true) => self.value * self.step,
            (true, false) => self.value / self.step,
            (false, true) => self.value + self.step,
            (false, false) => self.value - self.step,
        };
        moved.clamp(self.range[0], self.range[1])
    }
}

struct Fit {
    trained: Vec<Trained>,
    base: String,
    parameters: Vec<Parameter>,
}

impl Fit {
    fn method(&self) -> String {
        let part = |p: &Parameter| format!("+{}={:.5}", p.name, p.value);
        self.base.clone() + &self.parameters.iter().map(part).collect::<String>()
    }

    fn scores(&self, method: &str) -> Result<Vec<Vec<Score>>, Failure> {
        self.trained.par_iter().map(|t| t.score(method)).collect()
    }

    fn cost(&self) -> Result<f64, Failure> {
        let costs: Vec<f64> = self.scores(&self.method())?.iter().flatten().map(Score::cost).collect();
        Ok(costs.iter().sum::<f64>() / costs.len().max(1) as f64)
    }

    /// Moves a parameter one way as long as it gains; whether it did.
    fn go(&mut self, index: usize, up: bool, best: &mut f64) -> Result<bool, Failure> {
        let mut gained = false;
        loop {
            let old = self.parameters[index].value;
            let new = self.parameters[index].moved(up);
            if new == old {
                return Ok(gained);
            }
            self.parameters[index].value = new;
            let cost = self.cost()?;
            println!("{} {old:.5} to {new:.5}: {:+.5}", self.parameters[index].name, cost - *best);
            if cost.is_nan() || cost >= *best - LEAST_GAIN {
                self.parameters[index].value = old;
                return Ok(gained);
            }
            (*best, gained) = (cost, true);
        }
    }

    fn print(&self, method: &str) -> Result<(), Failure> {
        let scores = self.scores(method)?;
        let costs: Vec<f64> = scores.iter().flatten().map(Score::cost).collect();
        println!("{method}: {:.4}", costs.iter().sum::<f64>() / costs.len().max(1) as f64);
        for (trained, phases) in self.trained.iter().zip(scores) {
            print!("  {:<24}", trained.name);
            for s in phases {
                let [wide, boiling, flicker] = [1e3 * s.wide_error, 1e4 * s.boiling, 1e3 * s.flicker];
                print!(" | {:.4} {:.5} {wide:6.3} {:.3} {boiling:7.3} {flicker:6.3}", s.flip, s.error, s.energy);
            }
            println!();
        }
        Ok(())
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let known = ["on", "cache", "base", "sweeps", "methods"];
    let is_known = |a: &&String| a.split('=').next().is_some_and(|key| key.contains('.') || known.contains(&key));
    if let Some(unknown) = arguments.iter().find(|a| !is_known(a)) {
        return Err(format!("{unknown}: not one of {known:?}, nor a parameter").into());
    }
    let option = |key: &str| arguments.iter().find_map(|a| a.strip_prefix(key)?.strip_prefix('='));
    let cache = option("cache").map(Cache::at).or_else(Cache::default_place).ok_or("cache=FOLDER")?;
    let names = option("on").unwrap_or("glossy-room:1:0,mirror-hall:1:0");
    let mut fit = Fit {
        trained: names.split(',').map(|name| Trained::load(name, &cache)).collect::<Result<_, _>>()?,
        base: option("base").unwrap_or("quell:quality").to_owned(),
        parameters: arguments
            .iter()
            .filter(|a| a.split('=').next().is_some_and(|name| name.contains('.')))
            .map(|a| Parameter::parse(a))
            .collect::<Result<_, _>>()?,
    };
    if fit.parameters.is_empty() {
        return option("methods").unwrap_or(&fit.base).split(',').try_for_each(|method| fit.print(method));
    }
    let mut best = fit.cost()?;
    println!("begins at {best:.5}");
    for sweep in 0..option("sweeps").unwrap_or("3").parse::<u32>()? {
        for index in 0..fit.parameters.len() {
            if !fit.go(index, true, &mut best)? {
                fit.go(index, false, &mut best)?;
            }
        }
        println!("sweep {sweep}: {best:.5} {}", fit.method());
        for p in &mut fit.parameters {
            p.step = if p.step > 1.0 { p.step.sqrt() } else { 0.5 * p.step };
        }
    }
    fit.print(&fit.method())
}
