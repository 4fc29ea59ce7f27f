//! Lag: how many frames indirect light takes to follow a change of the lamps.
//!
//! On I = L(picture) - L(direct), smoothed by a Gaussian of 6 px. A change is a run of frames in which the reference's
//! mean I over the surfaces rises or falls by more than a fifth a frame. A pixel takes part where its I changed by more
//! than a fifth of the mean change. It has followed from the first frame on, counted from the end of the change, after
//! which abs(I(result) - I(reference)) stays within 10 % of its change, until the next one. The score is the number of
//! frames within which 95 % of the pixels have followed, of the slowest change.

use super::bands::{Map, combined, mapped};
use super::instruments::{FrameInstruments, Instruments, flag};
use super::light::light;
use super::score::Score;
use quell::{Plane, Rgb};
use rayon::prelude::*;

/// Relative change of the mean indirect light between two frames that only lamps make.
const CHANGE: f64 = 0.2;
/// Pixels take part where they change by this part of the mean change.
const TAKES_PART: f64 = 0.2;
/// A pixel has followed within this part of its change.
const FOLLOWED: f32 = 0.1;
/// Share of the pixels that must have followed.
const SHARE: f64 = 0.95;
/// Sigma of the smoothing, at 225 rows.
const SMOOTH: f32 = 6.0;

/// A change of the lamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// The last frame before it.
    pub before: usize,
    /// The first frame with the new light.
    pub after: usize,
    /// One past the last frame before the next change.
    pub end: usize,
}

/// The changes of a sequence.
pub fn changes(instruments: &Instruments) -> Vec<Change> {
    let means: Vec<Option<f64>> = instruments
        .frames
        .par_iter()
        .map(|frame| {
            let indirect = reference_indirect(instruments, frame)?;
            let surface = (0..frame.flags.len()).filter(|&i| frame.has(i, flag::SURFACE));
            let (sum, count) = surface.fold((0.0, 0u64), |(s, n), i| (s + f64::from(indirect.data()[i]), n + 1));
            (count > 0).then(|| sum / count as f64)
        })
        .collect();
    let changed = |t: usize| match (means[t - 1], means[t]) {
        (Some(a), Some(b)) => (a - b).abs() > CHANGE * a.max(b) && a.max(b) > 0.0,
        _ => false,
    };
    let mut found: Vec<Change> = Vec::new();
    for t in 1..means.len() {
        if !changed(t) || !instruments.frames[t].scored {
            continue;
        }
        match found.last_mut() {
            Some(last) if last.after + 1 == t => last.after = t,
            _ => {
                if let Some(last) = found.last_mut() {
                    last.end = t;
                }
                found.push(Change { before: t - 1, after: t, end: means.len() });
            }
        }
        if let Some(last) = found.last_mut() {
            last.end = means.len();
        }
    }
    found
}

/// Luminance of the reference without its direct term: the mean of the halves.
fn reference_indirect(instruments: &Instruments, frame: &FrameInstruments) -> Option<Map> {
    let direct = &frame.demodulation.as_ref()?.reference_direct;
    let share = 1.0 / frame.p.len().max(1) as f32;
    let mut sum = mapped(direct, |v| -v);
    for p in &frame.p {
        sum = combined(&sum, p, |s, p| s + share * (p.exp2() - 1.0) / instruments.k);
    }
    Some(sum)
}

/// The score.
pub fn score(instruments: &Instruments, pictures: &[Plane<Rgb>]) -> Score {
    if instruments.frames.iter().all(|f| f.demodulation.is_none()) {
        return Score::null("the frames do not tell direct light and weights: indirect light cannot be parted");
    }
    if instruments.changes.is_empty() {
        return Score::null("the lamps do not change");
    }
    let mut worst: Option<(usize, bool)> = None;
    for change in &instruments.changes {
        if let Some(found) = followed(instruments, pictures, change) {
            worst = Some(worst.map_or(found, |w| w.max(found)));
        }
    }
    match worst {
        None => Score::null("no surface shows the lamps' change"),
        Some((frames, true)) => Score::of(frames as f64),
        Some((frames, false)) => Score {
            reason: Some(format!(
                "at least: after {frames} frames, when the next change or the end comes, not followed"
            )),
            ..Score::of(frames as f64)
        },
    }
}

/// Frames after a change within which 95 % of the pixels have followed, and whether they have at all.
fn followed(instruments: &Instruments, pictures: &[Plane<Rgb>], change: &Change) -> Option<(usize, bool)> {
    let radii = instruments.radii;
    let reference = |t: usize| {
        reference_indirect(instruments, &instruments.frames[t]).map(|indirect| radii.gaussian(&indirect, SMOOTH))
    };
    let (old, new) = (reference(change.before)?, reference(change.after)?);
    let step = combined(&new, &old, |a, b| (a - b).abs());
    let flags = &instruments.frames[change.after].flags;
    let surface = |i: usize| flags[i] & flag::SURFACE != 0;
    let (sum, count) =
        (0..flags.len()).filter(|&i| surface(i)).fold((0.0, 0u64), |(s, n), i| (s + f64::from(step.data()[i]), n + 1));
    let least = TAKES_PART * sum / count.max(1) as f64;
    let taking_part: Vec<usize> =
        (0..flags.len()).filter(|&i| surface(i) && f64::from(step.data()[i]) > least).collect();
    if taking_part.is_empty() {
        return None;
    }
    // For each pixel one past the last frame in which it was off.
    let mut settled = vec![0usize; taking_part.len()];
    for (after, t) in (change.after..change.end).enumerate() {
        let (Some(truth), Some(demodulation)) = (reference(t), &instruments.frames[t].demodulation) else { continue };
        let own = combined(&light(&pictures[t]), &demodulation.direct, |p, d| p - d);
        let own = radii.gaussian(&own, SMOOTH);
        for (settled, &i) in settled.iter_mut().zip(&taking_part) {
            if (own.data()[i] - truth.data()[i]).abs() > FOLLOWED * step.data()[i] {
                *settled = after + 1;
            }
        }
    }
    settled.sort_unstable();
    let at = ((settled.len() - 1) as f64 * SHARE).ceil() as usize;
    let frames = settled.get(at).copied().unwrap_or(0);
    Some((frames, frames < change.end - change.after))
}
