//! Light as the scorecard sees it: P, in stops, and the indirect light parted from a composite.

use super::bands::{Map, difference};
use super::instruments::ReferenceFrame;
use crate::error::Error;
use crate::tone::{LIT_PART_OF_MEAN, luminance};
use quell::{Plane, Rgb};

/// What the log-mean luminance of lit surfaces times k becomes: mid grey.
const MID_GREY: f64 = 0.18;
/// Surfaces darker than this reflect too little to separate their light from rounding.
pub(super) const LEAST_ALBEDO: f32 = 0.02;
/// Light beyond this counts as this: its logarithm stays finite.
const LARGEST_LIGHT: f32 = 1e30;

/// x = log2(1 + k M'), where M' = (picture - direct) / albedo, all luminances.
pub(super) fn demodulated(k: f32, picture: &Map, direct: &Map, albedo: &Map) -> Map {
    let mut indirect = difference(picture, direct);
    for (v, a) in indirect.data_mut().iter_mut().zip(albedo.data()) {
        *v = (1.0 + k * (*v / a.max(LEAST_ALBEDO)).max(0.0)).log2();
    }
    indirect
}

/// Luminance, with what is negative or no number as 0.
fn bounded_luminance(c: Rgb) -> f32 {
    let l = luminance(c);
    if l > 0.0 { l.min(LARGEST_LIGHT) } else { 0.0 }
}

/// Luminance of a picture.
pub(super) fn light(picture: &Plane<Rgb>) -> Map {
    let size = picture.size();
    Plane::from_fn(size, |x, y| bounded_luminance(picture.at(x, y)))
}

/// P(c) = log2(1 + k luminance(c)), c clamped at 0: stops.
pub(super) fn perceived(picture: &Plane<Rgb>, k: f32) -> Map {
    let size = picture.size();
    Plane::from_fn(size, |x, y| (1.0 + k * bounded_luminance(picture.at(x, y))).log2())
}

/// k = 0.18 / exp(mean log L) over the lit surface pixels (L above 1e-3 of their mean) of the sequence's half A.
pub(super) fn scale(frames: &[ReferenceFrame<'_>]) -> Result<f32, Error> {
    let surface = |f: &ReferenceFrame<'_>, i: usize| {
        f.frame.view_depth.as_ref().is_none_or(|d| d.data()[i].is_finite() && d.data()[i] > 0.0)
    };
    let lights = || {
        frames.iter().flat_map(|f| {
            let f = *f;
            (0..f.a.data().len())
                .filter(move |&i| surface(&f, i))
                .map(move |i| f64::from(bounded_luminance(f.a.data()[i])))
        })
    };
    let (sum, count) = lights().fold((0.0, 0u64), |(s, n), l| (s + l, n + 1));
    let least = LIT_PART_OF_MEAN * sum / count.max(1) as f64;
    let (logs, lit) = lights().filter(|&l| l > least && l > 0.0).fold((0.0, 0u64), |(s, n), l| (s + l.ln(), n + 1));
    if lit == 0 {
        return Err(Error::Empty { what: "no surface of the reference is lit: there is nothing to score".to_owned() });
    }
    let k = MID_GREY / (logs / lit as f64).exp();
    Ok((k as f32).clamp(f32::MIN_POSITIVE, LARGEST_LIGHT))
}
