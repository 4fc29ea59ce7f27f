//! What methods delivered, measured against the references: picture metrics frame by frame, the scorecard.

use super::runner::Finished;
use super::sequence::{NoisyFrame, Sequence};
use crate::error::Error;
use crate::metrics::{Exposures, FrameScores, mean_scores};
use crate::report::json::NumberedScores;
use crate::scorecard::{Instruments, ReferenceFrame, Scores};
use quell::{Plane, Rgb};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Everything about the sequence that measuring needs, made once.
pub struct Judge<'a> {
    sequence: &'a Sequence,
    exposures: Exposures,
    /// Or why there is no scorecard.
    instruments: Result<Instruments, String>,
    /// Indices of the frames that the instruments were made from: one after the other.
    row: Vec<usize>,
}

/// What was measured of one method.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Each scored frame.
    pub frames: Vec<NumberedScores>,
    /// Means over them.
    pub mean: Option<FrameScores>,
    /// The scorecard.
    pub scorecard: Scores,
    /// HDR-FLIP maps of the scored frames, by number.
    pub maps: BTreeMap<i64, Plane<f32>>,
}

impl<'a> Judge<'a> {
    /// Fixes exposures and makes the scorecard's instruments.
    ///
    /// # Errors
    /// [`Error::Empty`] where no frame can be scored, or where the references are black; files that cannot be read.
    pub fn new(sequence: &'a Sequence) -> Result<Self, Error> {
        let row = longest_row(sequence);
        let frames: Vec<Cow<'_, NoisyFrame>> = row.iter().map(|&i| sequence.frame(i)).collect::<Result<_, _>>()?;
        let mut depths = BTreeMap::new();
        for (&index, frame) in row.iter().zip(&frames) {
            depths.insert(sequence.numbers[index], frame.frame.view_depth.as_ref());
        }
        let scored = sequence.scored.iter().filter_map(|n| {
            let depth = depths.get(n).copied().flatten();
            sequence.reference(*n).map(|r| (&r.mean, depth))
        });
        let exposures = Exposures::from_reference(scored)?;
        let references: Vec<ReferenceFrame<'_>> = row
            .iter()
            .zip(&frames)
            .filter_map(|(&index, frame)| {
                let number = sequence.numbers[index];
                let reference = sequence.reference(number)?;
                let (a, b) = match &reference.halves {
                    Some([a, b]) => (&a.beauty, Some(&b.beauty)),
                    None => (&reference.mean, None),
                };
                let direct = |i: usize| reference.halves.as_ref().and_then(|h| h[i].direct.as_ref());
                Some(ReferenceFrame {
                    b,
                    a_direct: direct(0),
                    b_direct: direct(1),
                    scored: sequence.scored.contains(&number),
                    ..ReferenceFrame::new(&frame.frame, a)
                })
            })
            .collect();
        let instruments = Instruments::new(&references).map_err(|e| e.to_string());
        Ok(Self { sequence, exposures, instruments, row })
    }

    /// Measures what a method delivered. `notify` hears the number of frames measured.
    ///
    /// # Errors
    /// Pictures that cannot be read, or of another extent.
    pub fn measure(&self, finished: &Finished, notify: &dyn Fn(usize)) -> Result<Verdict, Error> {
        let sequence = self.sequence;
        let mut frames = Vec::new();
        let mut maps = BTreeMap::new();
        let mut read: BTreeMap<usize, Plane<Rgb>> = BTreeMap::new();
        for (done, &number) in sequence.scored.iter().enumerate() {
            let (Some(index), Some(reference)) = (sequence.index_of(number), sequence.reference(number)) else {
                continue;
            };
            let picture = finished.picture(index)?;
            let (scores, map) = FrameScores::measure(&picture, &reference.mean, sequence.tone, &self.exposures)?;
            frames.push(NumberedScores { frame: number, scores });
            maps.insert(number, map.map);
            read.insert(index, picture);
            notify(done + 1);
        }
        let scorecard = match &self.instruments {
            Ok(instruments) => {
                let mut pictures = Vec::with_capacity(self.row.len());
                for &index in &self.row {
                    pictures.push(match read.remove(&index) {
                        Some(picture) => picture,
                        None => finished.picture(index)?,
                    });
                }
                instruments.score(&pictures)?
            }
            Err(reason) => Scores::all_null(reason),
        };
        let all: Vec<FrameScores> = frames.iter().map(|f| f.scores).collect();
        Ok(Verdict { mean: mean_scores(&all), frames, scorecard, maps })
    }
}

/// Indices of the frames with references that follow each other by one: of all such rows the one with most scored
/// frames, the last of equals.
fn longest_row(sequence: &Sequence) -> Vec<usize> {
    let mut best: Vec<usize> = Vec::new();
    let mut row: Vec<usize> = Vec::new();
    let scored = |row: &[usize]| row.iter().filter(|&&i| sequence.scored.contains(&sequence.numbers[i])).count();
    for (index, &number) in sequence.numbers.iter().enumerate() {
        let follows = row.last().is_some_and(|&last| sequence.numbers[last] + 1 == number && last + 1 == index);
        if sequence.reference(number).is_none() || !follows {
            row.clear();
        }
        if sequence.reference(number).is_some() {
            row.push(index);
            if (scored(&row), row.len()) >= (scored(&best), best.len()) {
                best.clone_from(&row);
            }
        }
    }
    best
}

/// What a reader must know about the sequence before believing any figure: whether the references' noise limits it,
/// whether anything moves, whether there is a steady state.
pub fn caveats(sequence: &Sequence, best_error: Option<f64>) -> Result<Vec<String>, Error> {
    /// A reference whose own error is beyond this part of the best method's limits what can be distinguished.
    const MOST_OF_BEST: f64 = 0.05;
    let mut notes = Vec::new();
    match (sequence.reference_error(), best_error) {
        (Some(own), Some(best)) if own > MOST_OF_BEST * best => notes.push(format!(
            "The references' own trimmed relMSE is {own:.2e}, {:.0} % of the best method's ({best:.2e}; aim: at most \
             {:.0} %): differences of that size are noise. More samples (--reference-spp) help.",
            100.0 * own / best.max(f64::MIN_POSITIVE),
            100.0 * MOST_OF_BEST
        )),
        (Some(own), _) => notes.push(format!("The references' own trimmed relMSE is {own:.2e} (from their halves).")),
        (None, _) => notes.push(
            "The references come without halves: their own noise is not known and adds to every score.".to_owned(),
        ),
    }
    let list = |numbers: &[i64]| match numbers {
        [] => "none".to_owned(),
        [one] => format!("frame {one}"),
        [first, .., last] if last - first + 1 == numbers.len() as i64 => format!("frames {first} to {last}"),
        several => format!("frames {}", several.iter().map(i64::to_string).collect::<Vec<_>>().join(", ")),
    };
    let steady = sequence.scored.iter().all(|n| sequence.index_of(*n).is_some_and(|i| sequence.is_steady(i)));
    notes.push(format!(
        "Scored: {} of {}{}.",
        list(&sequence.scored),
        list(&sequence.numbers),
        if steady { "" } else { "; no steady state yet, so these are scores of a start" }
    ));
    if sequence.scored.len() < 3 {
        notes.push(format!(
            "{} scored frames are few for anything that changes over time: flicker, boiling and ghosting need a row of \
             referenced frames.",
            sequence.scored.len()
        ));
    }
    if is_static(sequence)? {
        notes.push("Nothing moves in the scored frames: there is no ghosting to measure.".to_owned());
    }
    Ok(notes)
}

/// Whether camera and surfaces stand still over the scored frames.
fn is_static(sequence: &Sequence) -> Result<bool, Error> {
    for index in sequence.scored.iter().filter_map(|n| sequence.index_of(*n)) {
        let noisy = sequence.frame(index)?;
        let f = &noisy.frame;
        let moves = f.motion.as_ref().is_none_or(|m| m.data().iter().flatten().any(|v| v.abs() > 1e-3 || v.is_nan()));
        if moves || f.camera != f.previous_camera {
            return Ok(false);
        }
    }
    Ok(!sequence.scored.is_empty())
}
