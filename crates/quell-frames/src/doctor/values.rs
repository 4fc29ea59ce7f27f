//! Numbers that are none: NaN, infinities, light below zero, fireflies.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use crate::image::{ExrImage, Samples};
use crate::roles::{Mapping, Role};
use quell::{Plane, Rgb, Size};
use rayon::prelude::*;

/// NaN and infinities are repaired; a pass with more of them is broken.
const BROKEN_SHARE: f64 = 0.02;
/// Share of a pass's values from which negative light costs more than rounding: sharpening filters and wide gamuts make
/// some legally (docs/doctor.md).
const NEGATIVE_SHARE: f64 = 5e-4;
/// Negative values count where they are this large beside the mean of the brightest pass: rounding makes tiny ones.
const NEGATIVE_DEPTH: f64 = 0.01;
/// A firefly is this many times as bright as the second brightest pixel of the 5x5 around it and as the picture's mean.
const FIREFLY_TIMES: f32 = 30.0;
/// Fireflies that hold less of a picture's light than this are not seen beside the noise.
const FIREFLY_LIGHT: f64 = 0.03;

/// What is counted in one pass.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    values: usize,
    nan: usize,
    infinite: usize,
    negative: usize,
    least: f64,
    sum: f64,
}

fn count(samples: &Samples, into: &mut Count) {
    for value in samples.to_f32() {
        into.values += 1;
        if value.is_nan() {
            into.nan += 1;
        } else if value.is_infinite() {
            into.infinite += 1;
        } else {
            into.negative += usize::from(value < 0.0);
            into.least = into.least.min(f64::from(value));
            into.sum += f64::from(value.abs());
        }
    }
}

const fn is_light(role: Role) -> bool {
    role.light().is_some()
        || matches!(
            role,
            Role::Beauty
                | Role::Albedo
                | Role::MatteColour
                | Role::GlossyColour
                | Role::TransmissionColour
                | Role::SubsurfaceColour
                | Role::LightGroup
        )
}

/// Roles whose infinities mean something: no surface there.
const fn may_be_infinite(role: Role) -> bool {
    matches!(role, Role::Depth | Role::SeenDepth | Role::Position | Role::Id | Role::Cryptomatte)
}

/// The worst of each kind over all frames.
#[derive(Debug, Default)]
pub(super) struct Values {
    worst: [Option<(i64, String, Count)>; 3],
    frames: usize,
    fireflies: Option<(i64, usize, f64, usize)>,
}

impl Values {
    /// Counts the values of every pass that a mapping reads.
    pub fn look(&mut self, mapping: &Mapping, images: &[ExrImage], number: i64) {
        self.frames += 1;
        let passes = mapping.passes.iter().filter(|p| p.role != Role::Cryptomatte && p.role != Role::Id);
        let counts: Vec<_> = passes
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|pass| {
                let mut sum = Count::default();
                for id in &pass.channels {
                    if let Some(samples) = images.get(id.file).and_then(|i| i.samples(id.part, id.channel)) {
                        count(samples, &mut sum);
                    }
                }
                if may_be_infinite(pass.role) {
                    sum.infinite = 0;
                }
                (pass, sum)
            })
            .collect();
        // The beauty, or the brightest of the passes.
        let mean = |c: &Count| c.sum / c.values.max(1) as f64;
        let lights = counts.iter().filter(|(pass, _)| is_light(pass.role));
        let bright = lights.map(|(_, c)| mean(c)).fold(0.0, f64::max);
        for (pass, mut sum) in counts {
            if !is_light(pass.role) || -sum.least <= NEGATIVE_DEPTH * bright {
                sum.negative = 0;
            }
            let kinds = [sum.nan, sum.infinite, sum.negative];
            for (kind, (worst, n)) in self.worst.iter_mut().zip(kinds).enumerate() {
                let before = worst.as_ref().map_or(0, |(_, _, c)| [c.nan, c.infinite, c.negative][kind]);
                if n > before {
                    *worst = Some((number, pass.name.clone(), sum));
                }
            }
        }
    }

    /// Looks for fireflies.
    pub fn bright(&mut self, beauty: &Plane<Rgb>, number: i64) {
        let (pixels, light) = fireflies(beauty);
        if self.fireflies.is_none_or(|(_, _, l, _)| light > l) {
            self.fireflies = Some((number, pixels, light, beauty.size().pixels()));
        }
    }

    pub fn judge(&self, beauty: &str, found: &mut Diagnosis) {
        let before = found.findings.len();
        let texts = [
            ("values.nan", "NaN", "values that are no numbers"),
            ("values.infinite", "infinite", "infinite values"),
            ("values.negative", "negative", "light below zero"),
        ];
        for (kind, ((check, word, what), worst)) in texts.into_iter().zip(&self.worst).enumerate() {
            let Some((number, pass, c)) = worst else { continue };
            let n = [c.nan, c.infinite, c.negative][kind];
            let share = n as f64 / c.values.max(1) as f64;
            let severity = match kind {
                2 if share < NEGATIVE_SHARE => continue,
                2 => Severity::Warning,
                _ if share < BROKEN_SHARE => Severity::Warning,
                _ => Severity::Fault,
            };
            let least = if kind == 2 { format!(", the least is {:.3}", c.least) } else { String::new() };
            let (spoils, remedy) = if kind == 2 {
                (
                    "dark spots grow where such pixels are averaged with others",
                    "a reconstruction filter without negative lobes (Blackman-Harris, Gaussian), or no clipping of the gamut before writing",
                )
            } else {
                (
                    "quell leaves them out (they count as black), so the light that belongs there is missing: dark spots",
                    "find the material or light that makes them: divisions by zero in shaders, lamps of size 0, half floats beyond 65504",
                )
            };
            found.findings.push(
                Finding::new(check, severity, what)
                    .frame(*number)
                    .channel(pass.clone())
                    .evidence(
                        format!("{n} of {} values are {word} ({:.2e} of them){least}", c.values, share),
                        vec![Figure::new("values", n as f64, ""), Figure::new("share", share, "")],
                    )
                    .cure(spoils, remedy),
            );
        }
        if let Some((number, n, light, pixels)) = self.fireflies
            && light >= FIREFLY_LIGHT
        {
            found.findings.push(
                Finding::new("values.fireflies", Severity::Warning, "single pixels are far too bright")
                    .frame(number)
                    .channel(beauty)
                    .evidence(
                        format!(
                            "{n} of {pixels} pixels are {FIREFLY_TIMES:.0} times as bright as all around them, and hold {:.1} % of \
                             the picture's light",
                            light * 100.0
                        ),
                        vec![Figure::new("fireflies", n as f64, "px"), Figure::new("share of light", light * 100.0, "%")],
                    )
                    .cure(
                        "bright blotches, since their light is spread over their surroundings",
                        "Blender: Light Paths > Clamping > Indirect Light 10, Caustics off or Filter Glossy 1; elsewhere clamp indirect samples",
                    ),
            );
        }
        if found.findings.len() == before {
            let light = self.fireflies.map_or(0.0, |f| f.2);
            found.pass(
                "values",
                format!(
                    "{} frames without NaN, infinities, light below zero; fireflies hold {:.2} % of the light",
                    self.frames,
                    light * 100.0
                ),
            );
        }
    }
}

/// How many pixels outshine their surroundings, and their share of the picture's light.
fn fireflies(beauty: &Plane<Rgb>) -> (usize, f64) {
    let Size { width, height } = beauty.size();
    let bright: Vec<f32> = beauty
        .data()
        .iter()
        .map(|c| c.iter().map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 }).sum::<f32>())
        .collect();
    let all: f64 = bright.iter().map(|v| f64::from(*v)).sum();
    let mean = (all / bright.len().max(1) as f64) as f32;
    let (pixels, light) = (0..bright.len())
        .into_par_iter()
        .filter(|i| bright.get(*i).is_some_and(|v| *v > FIREFLY_TIMES * mean))
        .filter_map(|i| {
            let (x, y, here) = (i % width, i / width, *bright.get(i)?);
            // The brightest but itself and one more: a firefly's filter may reach its neighbour.
            let (mut first, mut second) = (0.0f32, 0.0f32);
            for v in y.saturating_sub(2)..(y + 3).min(height) {
                for u in x.saturating_sub(2)..(x + 3).min(width) {
                    if (u, v) == (x, y) {
                        continue;
                    }
                    let other = *bright.get(v * width + u)?;
                    if other > first {
                        (first, second) = (other, first);
                    } else if other > second {
                        second = other;
                    }
                }
            }
            (here > FIREFLY_TIMES * second).then_some((1, f64::from(here)))
        })
        .reduce(|| (0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    (pixels, if all > 0.0 { light / all } else { 0.0 })
}
