//! A result against the instruments.

use super::bands::{Map, difference, surface_band};
use super::fit::{self, G, S, U1, solve};
use super::instruments::{FRESH_FRAMES, Instruments, flag, is_fresh, mask};
use super::lag;
use super::light::{demodulated, light, perceived};
use super::score::{Score, Scores};
use super::surfaces::{Kept, cubic};
use crate::error::Error;
use quell::{Plane, Rgb};
use rayon::prelude::*;

/// A predictor must cover this share of the surface pixels.
const LEAST_COVERED: f64 = 0.005;
/// Fresh pixels must cover this share.
const LEAST_FRESH: f64 = 0.002;
/// With one reference: a score is worth nothing where the reference's noise explains more than this share.
const LARGEST_FLOOR: f64 = 0.3;
/// A predictor's signal must be this many times the halves' noise.
const LEAST_SIGNAL: f64 = 0.5;

/// A sum of products and its number of terms.
#[derive(Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    fn add(&mut self, a: f32, b: f32) {
        self.sum += f64::from(a) * f64::from(b);
        self.count += 1;
    }

    fn merge(mut self, other: Self) -> Self {
        self.sum += other.sum;
        self.count += other.count;
        self
    }

    /// The root of the mean product; where chance makes it negative, 0.
    fn root(self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum / self.count as f64).max(0.0).sqrt())
    }
}

/// The error's bands against each half.
struct Bands {
    fine: Vec<Map>,
    blotches: Vec<Map>,
}

/// Sums over the second pass.
#[derive(Clone, Copy, Default)]
struct Found {
    noise: Mean,
    flicker: Mean,
    boiling: Mean,
    slow: Mean,
    fresh: Mean,
    surface: u64,
}

impl Instruments {
    /// Scores a result: one picture for each frame given to [`Instruments::new`], scene-linear. What is not finite counts
    /// as black.
    ///
    /// # Errors
    /// [`Error::Empty`] where the numbers of frames differ, [`Error::Size`] where pictures differ in extent.
    pub fn score(&self, pictures: &[Plane<Rgb>]) -> Result<Scores, Error> {
        if pictures.len() != self.frames.len() {
            let what = format!("{} pictures cannot be scored against {} references", pictures.len(), self.frames.len());
            return Err(Error::Empty { what });
        }
        for picture in pictures {
            Error::same_size("picture", picture.size(), self.size)?;
        }
        let mut scores = Scores::all_null("no frame is scored: all are warm-up");
        if !self.frames.iter().any(|f| f.scored) {
            return Ok(scores);
        }
        let p: Vec<Map> = pictures.par_iter().map(|picture| perceived(picture, self.k)).collect();
        let c = self.fitted(&p, &mut scores);
        self.rest(&p, c, &mut scores);
        scores.flatness = self.flatness(pictures);
        scores.lag = lag::score(self, pictures);
        Ok(scores)
    }

    /// Blur, smearing and ghosting from the joint fit; its coefficients.
    fn fitted(&self, p: &[Map], scores: &mut Scores) -> fit::Columns {
        let zy = self
            .frames
            .par_iter()
            .zip(p)
            .map(|(frame, p)| {
                let mut zy = [0.0; fit::COUNT];
                let (Some(z), Some(reference)) = (frame.predictors.first(), frame.p.last()) else { return zy };
                for i in (0..z.len()).filter(|&i| frame.has(i, flag::SURFACE)) {
                    let e = f64::from(p.data()[i] - reference.data()[i]);
                    for (sum, z) in zy.iter_mut().zip(fit::columns(&z[i], frame.has(i, flag::EDGE))) {
                        *sum += f64::from(z) * e;
                    }
                }
                zy
            })
            .collect::<Vec<_>>()
            .into_iter()
            .fold([0.0; fit::COUNT], |mut sum, zy| {
                sum.iter_mut().zip(zy).for_each(|(s, v)| *s += v);
                sum
            });
        let reasons: [Option<String>; fit::COUNT] = std::array::from_fn(|i| self.unusable(i));
        let used: [bool; fit::COUNT] = std::array::from_fn(|i| reasons[i].is_none());
        let Some(c) = solve(&self.sums, &zy, used) else {
            let why = "detail, edges and stale light cannot be told apart here";
            [scores.blur, scores.smearing, scores.ghosting] = std::array::from_fn(|_| Score::null(why));
            return [0.0; fit::COUNT];
        };
        let score = |i: usize, value: f64| match &reasons[i] {
            Some(reason) => Score::null(reason.clone()),
            None => self.with_floor(Score::of(value), self.share_floor(i), false),
        };
        scores.blur = score(U1, c[U1]);
        scores.smearing = score(S, c[S].max(0.0));
        scores.ghosting = score(G, c[G].max(0.0));
        c.map(|c| c as f32)
    }

    /// Why a predictor cannot be used.
    fn unusable(&self, i: usize) -> Option<String> {
        let (what, where_) = match i {
            S => ("light that a blur would carry across edges", "edges"),
            G => ("stale light", "changes"),
            _ => ("fine detail", "texture"),
        };
        if i == G && self.static_sequence {
            return Some("nothing moves: there is no stale light to measure".to_owned());
        }
        let share = self.sums.covered[i] as f64 / self.sums.pixels.max(1) as f64;
        if share < LEAST_COVERED {
            return Some(format!("too few {where_}: {what} covers {:.2} % of the surfaces", 100.0 * share));
        }
        let ratio = self.sums.signal_to_noise(i);
        if self.halves && ratio < LEAST_SIGNAL {
            return Some(format!("the references are too noisy: {what} is {ratio:.2} times their noise"));
        }
        None
    }

    /// With one reference, the bias of a coefficient: its noise stands in the response and in the predictor, so
    /// sum n x / sum x^2, where the predictor holds the part of the noise of its own pixel.
    fn share_floor(&self, i: usize) -> Option<f64> {
        let [fine, ..] = self.own_change?;
        // Of an edge-stopping Gaussian of 6 px, the weight of its own pixel at a straight edge.
        let sigma = f64::from(self.radii.px(6.0)).max(0.5);
        let part = if i == S { 1.0 / (std::f64::consts::PI * sigma * sigma) } else { 1.0 };
        let variance = 0.5 * fine?;
        Some((part * variance * self.sums.covered[i] as f64 / self.sums.zx[i][i]).abs())
    }

    /// Adds the floor; takes the value away where the floor is too high: beyond 30 %, of the value for an rms.
    fn with_floor(&self, score: Score, floor: Option<f64>, rms: bool) -> Score {
        if self.halves {
            return score;
        }
        let Some(floor) = floor else { return score };
        let limit = if rms { LARGEST_FLOOR * score.value.unwrap_or(0.0) } else { LARGEST_FLOOR };
        if floor > limit {
            let why = format!("one reference only, whose own noise may explain {floor:.3}");
            return Score { floor: Some(floor), ..Score::null(why) };
        }
        Score { floor: Some(floor), ..score }
    }

    /// The rms scores.
    fn rest(&self, p: &[Map], c: fit::Columns, scores: &mut Scores) {
        let bands: Vec<Bands> = self
            .frames
            .par_iter()
            .zip(p)
            .map(|(frame, p)| {
                let errors: Vec<Map> = frame.p.iter().map(|reference| difference(p, reference)).collect();
                let calm = |e: &Map| {
                    let mut e = e.clone();
                    for (i, v) in e.data_mut().iter_mut().enumerate() {
                        if !frame.is_calm(i) {
                            *v = 0.0;
                        }
                    }
                    e
                };
                Bands {
                    fine: errors.iter().map(|e| self.radii.fine(e)).collect(),
                    blotches: errors.iter().map(|e| self.radii.blotches(&calm(e))).collect(),
                }
            })
            .collect();
        let found = (0..self.frames.len())
            .into_par_iter()
            .filter(|&t| self.frames[t].scored)
            .map(|t| self.frame_found(t, p, &bands, &c))
            .collect::<Vec<_>>()
            .into_iter()
            .fold(Found::default(), |a, b| Found {
                noise: a.noise.merge(b.noise),
                flicker: a.flicker.merge(b.flicker),
                boiling: a.boiling.merge(b.boiling),
                slow: a.slow.merge(b.slow),
                fresh: a.fresh.merge(b.fresh),
                surface: a.surface + b.surface,
            });
        let half = |change: Option<f64>| change.map(|v| (0.5 * v).sqrt());
        let floors = self.own_change.unwrap_or_default().map(half);
        let rms = |mean: Mean, scale: f64, least: f64, floor: Option<f64>, why: String| {
            let share = mean.count as f64 / found.surface.max(1) as f64;
            match mean.root() {
                Some(value) if share >= least => self.with_floor(Score::of(value * scale), floor, true),
                _ => Score::null(why),
            }
        };
        let half_power = std::f64::consts::FRAC_1_SQRT_2;
        let quiet = || "no quiet pixels: detail, edges or stale light are everywhere".to_owned();
        let past = |lag: usize| match self.frames.len() {
            n if n <= lag => format!("{n} frames are too few for a lag of {lag}"),
            _ => format!("no quiet surface stays in view for {lag} frames"),
        };
        scores.noise = rms(found.noise, 1.0, LEAST_COVERED, floors[0], quiet());
        scores.flicker = rms(found.flicker, half_power, LEAST_COVERED, floors[0], past(1));
        scores.boiling = rms(found.boiling, half_power, LEAST_COVERED, floors[1], past(1));
        scores.slow_boiling = rms(found.slow, half_power, LEAST_COVERED, floors[2], past(4));
        let fresh = match (self.frames.len(), self.static_sequence) {
            (1, _) => "one frame has no past: nothing can have come into view".to_owned(),
            (_, true) => "nothing moves: no surface comes into view".to_owned(),
            _ => {
                let share = 100.0 * found.fresh.count as f64 / found.surface.max(1) as f64;
                format!("surfaces that came into view cover {share:.2} % only")
            }
        };
        scores.fresh_noise = rms(found.fresh, 1.0, LEAST_FRESH, floors[0], fresh);
    }

    fn frame_found(&self, t: usize, p: &[Map], bands: &[Bands], c: &fit::Columns) -> Found {
        let frame = &self.frames[t];
        let mut found = Found::default();
        let residuals: Vec<Map> = frame
            .p
            .iter()
            .zip(&frame.predictors)
            .map(|(reference, rows)| {
                let mut r = difference(&p[t], reference);
                for (i, (r, row)) in r.data_mut().iter_mut().zip(rows).enumerate() {
                    let columns = fit::columns(row, frame.has(i, flag::EDGE));
                    *r -= columns.iter().zip(c).map(|(u, c)| u * c).sum::<f32>();
                }
                self.radii.fine(&r)
            })
            .collect();
        let both = |maps: &[Map], i: usize| {
            let at = |m: Option<&Map>| m.map_or(0.0, |m| m.data()[i]);
            (at(maps.first()), at(maps.last()))
        };
        for i in 0..frame.flags.len() {
            if !frame.has(i, flag::SURFACE) {
                continue;
            }
            found.surface += 1;
            if frame.has(i, flag::QUIET) {
                let (a, b) = both(&residuals, i);
                found.noise.add(a, b);
            }
            if is_fresh(frame.age[i], FRESH_FRAMES) {
                let error = |reference: Option<&Map>| reference.map_or(0.0, |r| p[t].data()[i] - r.data()[i]);
                found.fresh.add(error(frame.p.first()), error(frame.p.last()));
            }
        }
        type Band = fn(&Bands) -> &Vec<Map>;
        type Place = fn(&mut Found) -> &mut Mean;
        let cases: [(Band, usize, Place); 3] = [
            (|b| &b.fine, 1, |f| &mut f.flicker),
            (|b| &b.blotches, 1, |f| &mut f.boiling),
            (|b| &b.blotches, 4, |f| &mut f.slow),
        ];
        for (band, lag, mean) in cases {
            self.each_returned(t, lag, |i, place| {
                let (now, then) = (band(&bands[t]), band(&bands[t - lag]));
                let change = |now: Option<&Map>, then: Option<&Map>| match (now, then) {
                    (Some(now), Some(then)) => now.data()[i] - cubic(then, place),
                    _ => 0.0,
                };
                let (a, b) = (change(now.first(), then.first()), change(now.last(), then.last()));
                mean(&mut found).add(a, b);
            });
        }
        found
    }

    fn flatness(&self, pictures: &[Plane<Rgb>]) -> Score {
        let (energy, pixels) = self.flatness;
        let surface: u64 = self.sums.pixels;
        if pixels == 0 {
            return Score::null("the frames do not tell direct light and weights: indirect light cannot be parted");
        }
        if (pixels as f64) < LEAST_COVERED * surface as f64 || energy <= 0.0 {
            return Score::null("indirect light has no local contrast here");
        }
        let sum: f64 = self
            .frames
            .par_iter()
            .zip(pictures)
            .map(|(frame, picture)| {
                let Some(demodulation) = frame.demodulation.as_ref() else { return 0.0 };
                let Some(reference) = demodulation.bands.first() else { return 0.0 };
                let Some(surfaces) = demodulation.surfaces.as_ref().and_then(Kept::surfaces) else { return 0.0 };
                let x = demodulated(self.k, &light(picture), &demodulation.direct, &demodulation.albedo);
                let own = surface_band(&surfaces, &x, &mask(frame));
                let mut sum = 0.0;
                for i in (0..frame.flags.len()).filter(|&i| frame.has(i, flag::REFLECTS)) {
                    sum += f64::from(own.data()[i]) * f64::from(reference.data()[i]);
                }
                sum
            })
            .collect::<Vec<f64>>()
            .into_iter()
            .sum();
        let floor = self.own_change.and_then(|[fine, ..]| Some(0.5 * fine? * pixels as f64 / energy));
        self.with_floor(Score::of(1.0 - sum / energy), floor, false)
    }
}
