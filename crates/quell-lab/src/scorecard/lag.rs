//! Lag: how many frames indirect light takes to follow a change of the lamps.
//!
//! On I = L(picture) - L(direct), smoothed by a Gaussian of 6 px. A change is a run of frames in which the reference's
//! mean I over the surfaces rises or falls by more than a fifth a frame. A pixel takes part where its I changed by more
//! than a fifth of the mean change. Noise keeps single pixels from ever staying near the truth: so what is missing of the
//! change is summed over regions, ninths of the picture, in each frame t after the change:
//!
//! r(t) = sum of s (I(reference, t) - I(result, t)) / sum of s (I(reference, after) - I(reference, before)),
//!
//! s = 1 where the light rises, else -1, chosen on half A of the references, everything else taken from half B. To r the nearest
//! sequence is fitted that never rises (least squares): what noise adds to single frames is averaged away. A method that ends
//! within a quarter of the change, and no longer moves there, is biased: that is counted by other scores, and is taken off. The
//! region has followed from the first frame on in which what is left is at most a tenth, counted from the end of the change, until
//! the next one. The score is that of the slowest region of the slowest change.

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
/// A region has followed within this part of its change.
const FOLLOWED: f64 = 0.1;
/// Regions along each axis.
const REGIONS: usize = 3;
/// A method that ends farther from the truth, in parts of the change, has not followed.
const MOST_BIAS: f64 = 0.25;
/// It has come to rest where its last two quarters differ by no more.
const AT_REST: f64 = 0.025;
/// Frames of a quarter, at the least, that say so.
const LEAST_QUARTER: usize = 2;
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

/// The same of half A and of half B; of the one reference twice where there is no half B.
fn reference_halves(instruments: &Instruments, frame: &FrameInstruments) -> Option<[Map; 2]> {
    let direct = &frame.demodulation.as_ref()?.reference_direct;
    let of = |p: &Map| combined(p, direct, |p, d| (p.exp2() - 1.0) / instruments.k - d);
    Some([of(frame.p.first()?), of(frame.p.last()?)])
}

/// The score.
pub fn score(instruments: &Instruments, pictures: &[Plane<Rgb>]) -> Score {
    if instruments.frames.iter().all(|f| f.demodulation.is_none()) {
        return Score::null("the frames do not tell direct light and weights: indirect light cannot be parted");
    }
    if instruments.changes.is_empty() {
        return Score::null("the lamps do not change");
    }
    let found = instruments.changes.iter().filter_map(|change| followed(instruments, pictures, change));
    let worst = found.max_by_key(|&(frames, has)| (!has, frames));
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

/// Frames after a change within which every region has followed, and whether all have.
fn followed(instruments: &Instruments, pictures: &[Plane<Rgb>], change: &Change) -> Option<(usize, bool)> {
    let radii = instruments.radii;
    let halves = |t: usize| {
        let [chosen, counted] = reference_halves(instruments, &instruments.frames[t])?;
        Some([chosen, counted].map(|indirect| radii.gaussian(&indirect, SMOOTH)))
    };
    let (old, new) = (halves(change.before)?, halves(change.after)?);
    let [chosen, counted] = [0, 1].map(|half| combined(&new[half], &old[half], |a, b| a - b));
    let flags = &instruments.frames[change.after].flags;
    let surface = |i: usize| flags[i] & flag::SURFACE != 0;
    let (sum, count) = (0..flags.len())
        .filter(|&i| surface(i))
        .fold((0.0, 0u64), |(s, n), i| (s + f64::from(chosen.data()[i].abs()), n + 1));
    let least = TAKES_PART * sum / count.max(1) as f64;
    let size = instruments.size;
    let mut regions: Vec<Region> = vec![Region::default(); REGIONS * REGIONS];
    for i in (0..flags.len()).filter(|&i| surface(i) && f64::from(chosen.data()[i].abs()) > least) {
        let (column, row) = (i % size.width * REGIONS / size.width, i / size.width * REGIONS / size.height);
        let region = &mut regions[row * REGIONS + column];
        let sign = chosen.data()[i].signum();
        region.pixels.push((i, sign));
        region.step += f64::from(sign * counted.data()[i]);
    }
    regions.retain(|region| !region.pixels.is_empty());
    let mean = regions.iter().map(|region| region.step).sum::<f64>() / regions.len().max(1) as f64;
    regions.retain(|region| region.step > TAKES_PART * mean && region.step > 0.0);
    if regions.is_empty() {
        return None;
    }
    for t in change.after..change.end {
        let (Some([_, truth]), Some(demodulation)) = (halves(t), &instruments.frames[t].demodulation) else { continue };
        let own = combined(&light(&pictures[t]), &demodulation.direct, |p, d| p - d);
        let missing = combined(&truth, &radii.gaussian(&own, SMOOTH), |t, o| t - o);
        for region in &mut regions {
            let sum: f64 = region.pixels.iter().map(|&(i, sign)| f64::from(sign * missing.data()[i])).sum();
            region.missing.push(sum / region.step);
        }
    }
    regions.iter().map(|region| followed_from(&region.missing)).max_by_key(|&(frames, has)| (!has, frames))
}

/// A part of the picture.
#[derive(Clone, Debug, Default)]
struct Region {
    /// Pixels that take part, with the sign of their change.
    pixels: Vec<(usize, f32)>,
    /// The change, each pixel's with its sign.
    step: f64,
    /// r(t) from the end of the change on.
    missing: Vec<f64>,
}

/// The frame from which on at most a tenth is missing beside a bias that stays, and whether there is one.
fn followed_from(missing: &[f64]) -> (usize, bool) {
    let fitted = never_rising(missing);
    let n = fitted.len();
    let quarter = (n / 4).max(LEAST_QUARTER);
    let mean = |from: usize, to: usize| fitted[from..to].iter().sum::<f64>() / (to - from) as f64;
    let mut bias = 0.0;
    if n >= 4 * LEAST_QUARTER {
        let (last, before) = (mean(n - quarter, n), mean(n - 2 * quarter, n - quarter));
        if before - last <= AT_REST && last.abs() <= MOST_BIAS {
            bias = last;
        }
    }
    let frames = fitted.iter().take_while(|r| **r > bias + FOLLOWED).count();
    let is_far = fitted.last().is_none_or(|last| *last < -MOST_BIAS);
    if is_far { (n, false) } else { (frames, frames < n) }
}

/// The sequence nearest to this one that never rises: neighbours that would are averaged.
fn never_rising(values: &[f64]) -> Vec<f64> {
    let mut blocks: Vec<(f64, usize)> = Vec::new();
    for &value in values {
        let mut block = (value, 1);
        while let Some(&(mean, n)) = blocks.last().filter(|(mean, _)| *mean <= block.0) {
            blocks.pop();
            let count = n + block.1;
            block = ((mean * n as f64 + block.0 * block.1 as f64) / count as f64, count);
        }
        blocks.push(block);
    }
    blocks.into_iter().flat_map(|(mean, n)| std::iter::repeat_n(mean, n)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_never_rises_and_keeps_the_mean() {
        assert_eq!(never_rising(&[3.0, 2.0, 1.0]), [3.0, 2.0, 1.0]);
        assert_eq!(never_rising(&[1.0, 3.0, 2.0, 0.0, 1.0]), [2.0, 2.0, 2.0, 0.5, 0.5]);
        assert!(never_rising(&[]).is_empty());
    }

    #[test]
    fn bias_is_no_lag_and_what_still_moves_is_no_bias() {
        let decay = |kept: f64, bias: f64, n: i32| (0..n).map(|t| bias + (1.0 - bias) * kept.powi(t + 1)).collect();
        let of = |missing: Vec<f64>| followed_from(&missing);
        assert_eq!(of(decay(0.8, 0.0, 28)), (10, true));
        assert_eq!(of(decay(0.8, 0.12, 28)), (9, true), "0.88 of the change decays");
        assert_eq!(of(decay(0.8, -0.05, 28)), (10, true));
        assert_eq!(of(decay(0.9, 0.0, 28)), (21, true));
        assert_eq!(of(decay(0.98, 0.0, 28)), (28, false));
        assert_eq!(of(vec![1.0; 10]), (10, false), "it never moves");
        assert_eq!(of(vec![-0.5; 10]), (10, false), "it went too far");
        assert_eq!(of(Vec::new()), (0, false));
    }
}
