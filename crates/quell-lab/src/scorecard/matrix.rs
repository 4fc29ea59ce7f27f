//! The matrix of responses: what each score answers to each injected artefact, at equal HDR-FLIP.

use super::injection::{Artefact, Injector};
use super::instruments::Instruments;
use super::score::Scores;
use crate::error::Error;
use crate::metrics::{Exposures, hdr_flip};
use quell::{Plane, Rgb};
use std::fmt::Write;

/// Strengths of a row, as parts of the one that has the matrix's HDR-FLIP.
pub const PARTS: [f32; 3] = [0.5, 0.75, 1.0];
/// HDR-FLIP is equal within this part.
const TOLERANCE: f64 = 0.05;
/// Scores that are roots of mean squares: what a rendering has before is taken away in squares.
const SQUARES: [&str; 5] = ["noise", "flicker", "boiling", "slow_boiling", "fresh_noise"];
/// Columns.
pub const COLUMNS: [&str; 9] =
    ["noise", "flicker", "boiling", "slow_boiling", "blur", "smearing", "ghosting", "fresh_noise", "flatness"];

/// One artefact at three strengths.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was added.
    pub artefact: Artefact,
    /// Its strengths, rising.
    pub strengths: [f32; 3],
    /// Mean HDR-FLIP of the picture with it against the picture without, at the largest strength.
    pub flip: f64,
    /// Scores at each strength.
    pub scores: [Scores; 3],
}

/// All rows.
#[derive(Clone, Debug)]
pub struct Matrix {
    /// HDR-FLIP at the largest strengths.
    pub flip: f64,
    /// Scores of the rendering without an artefact.
    pub base: Scores,
    /// One row for each artefact.
    pub rows: Vec<Row>,
}

/// Largest strength that makes sense: 1 for shares, less for a history, none to speak of for grain.
fn largest(artefact: Artefact) -> f32 {
    match artefact {
        Artefact::EdgeAwareBlur | Artefact::BlurAcrossEdges | Artefact::FlatIndirect => 1.0,
        Artefact::BlindHistory => 0.9,
        // In so few pixels that no strength gives the whole picture the others' HDR-FLIP.
        Artefact::NoiseWhereFresh => 0.25,
        _ => 2.0,
    }
}

impl Matrix {
    /// Injects every artefact of `artefacts`, each with a strength to begin with, into `pictures` at strengths that
    /// HDR-FLIP finds equally bad, and scores them. `flip` is the mean HDR-FLIP wanted, measured on the frames
    /// `looked_at` against the pictures without the artefact, within 5 %; it is lowered to what all artefacts of a
    /// bounded strength reach.
    ///
    /// # Errors
    /// Those of [`Injector::inject`], [`hdr_flip`] and [`Instruments::score`].
    pub fn measure(
        instruments: &Instruments,
        injector: &Injector<'_>,
        pictures: &[Plane<Rgb>],
        artefacts: &[(Artefact, f32)],
        exposures: &Exposures,
        flip: f64,
        looked_at: &[usize],
    ) -> Result<Self, Error> {
        let seen = |with: &[Plane<Rgb>]| -> Result<f64, Error> {
            let mut sum = 0.0;
            for &t in looked_at {
                if let (Some(with), Some(without)) = (with.get(t), pictures.get(t)) {
                    sum += hdr_flip(with, without, exposures)?.mean;
                }
            }
            Ok(sum / looked_at.len().max(1) as f64)
        };
        let base = instruments.score(pictures)?;
        let mut found = Vec::new();
        let mut target = flip;
        for &(artefact, start) in artefacts {
            let prepared = injector.prepare(artefact, pictures)?;
            let largest = largest(artefact);
            let mut strength = start.min(largest);
            let mut reached = seen(&prepared.at(strength))?;
            // HDR-FLIP rises almost in proportion at first, then more slowly: this converges from below.
            for _ in 0..6 {
                let next = (strength * (flip / reached.max(1e-6)) as f32).min(largest);
                if (reached - flip).abs() < TOLERANCE * flip || next == strength {
                    break;
                }
                strength = next;
                reached = seen(&prepared.at(strength))?;
            }
            if artefact != Artefact::NoiseWhereFresh {
                target = target.min(reached * (1.0 + TOLERANCE));
            }
            found.push((artefact, prepared, strength, reached));
        }
        let mut rows = Vec::new();
        for (artefact, prepared, mut strength, mut flip) in found {
            for _ in 0..6 {
                if flip <= target * (1.0 + TOLERANCE) {
                    break;
                }
                strength *= (target / flip) as f32;
                flip = seen(&prepared.at(strength))?;
            }
            let strengths = PARTS.map(|part| part * strength);
            let [a, b, c] = strengths.map(|s| instruments.score(&prepared.at(s)));
            rows.push(Row { artefact, strengths, flip, scores: [a?, b?, c?] });
        }
        Ok(Self { flip: target, base, rows })
    }

    /// How much a score rises by an artefact at the strength of index `at`: the difference to the base, of squares for
    /// an rms. `None` where it is null.
    pub fn response(&self, row: &Row, at: usize, score: &str) -> Option<f64> {
        let value = row.scores.get(at)?.get(score)?.value?;
        let base = self.base.get(score)?.value?;
        Some(if SQUARES.contains(&score) {
            let squares = value * value - base * base;
            squares.abs().sqrt() * squares.signum()
        } else {
            value - base
        })
    }

    /// A response as a share of the response of the same score to its own artefact, at the largest strength; both in
    /// proportion for the matrix's HDR-FLIP, which an artefact of few pixels does not reach. `None` where either is null.
    pub fn relative(&self, row: &Row, score: &str) -> Option<f64> {
        let own = self.rows.iter().find(|r| r.artefact.own_score() == score)?;
        Some(self.response(row, 2, score)? / row.flip * own.flip / self.response(own, 2, score)?)
    }

    /// Whether each score rises from strength to strength with its own artefact.
    pub fn rises(&self, row: &Row) -> bool {
        let own = row.artefact.own_score();
        let values: Vec<f64> = (0..3).filter_map(|at| self.response(row, at, own)).collect();
        values.len() == 3 && values[0] > 0.0 && values.windows(2).all(|w| w[1] > w[0])
    }

    /// As two Markdown tables: relative responses, and the values.
    pub fn markdown(&self) -> String {
        let mut text = String::from("| artefact | strength | HDR-FLIP |");
        COLUMNS.iter().for_each(|c| text.push_str(&format!(" {} |", c.replace('_', " "))));
        text.push_str("\n|---|---|---|");
        COLUMNS.iter().for_each(|_| text.push_str("---|"));
        for row in &self.rows {
            let _ = write!(text, "\n| {} | {:.3} | {:.4} |", row.artefact.name(), row.strengths[2], row.flip);
            for column in COLUMNS {
                let own = row.artefact.own_score() == column;
                let mark = if own { "**" } else { "" };
                match self.relative(row, column) {
                    Some(v) => {
                        let _ = write!(text, " {mark}{v:.2}{mark} |");
                    }
                    None => text.push_str(" - |"),
                }
            }
        }
        text.push_str("\n\n| artefact | strengths | own score |\n|---|---|---|");
        for row in &self.rows {
            let own = row.artefact.own_score();
            let of = |scores: &Scores| match scores.get(own).and_then(|s| s.value) {
                Some(v) => format!("{v:.4}"),
                None => "null".to_owned(),
            };
            let [a, b, c] = row.strengths;
            let values = row.scores.each_ref().map(of).join(", ");
            let _ = write!(
                text,
                "\n| {} | {a:.3}, {b:.3}, {c:.3} | {own}: {} to {values} |",
                row.artefact.name(),
                of(&self.base)
            );
        }
        text.push('\n');
        text
    }
}
