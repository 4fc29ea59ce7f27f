//! The specification of `variance`.

use crate::kernels::guide_distance::{guide_distance, weight};
use crate::kernels::math::luminance;
use crate::plane::Plane;
use crate::sequence::settings::{Variance, Wavelet};
use crate::stages::gather::Gathered;
use crate::window::{Class, LightSlot, LocalFeatures, Rows};

/// Runs the stage on the whole image: one channel a light of `gathered`, the variance of the luminance of its mean.
///
/// `given`: of each light the variance of its pixels' means that the renderer gave, in the light's units, NaN where it is
/// unknown; missing entries count as unknown. `wavelet` has the edge-stopping functions.
pub fn run(
    local: &LocalFeatures,
    gathered: &Gathered,
    given: &[Option<Plane<f32>>],
    s: &Variance,
    wavelet: &Wavelet,
) -> Rows {
    let mut out = Rows::new(local.size, gathered.slots.len());
    for l in 0..gathered.slots.len() {
        let given = given.get(l).and_then(Option::as_ref);
        for y in 0..local.size.height {
            for x in 0..local.size.width {
                let given = given.map(|plane| plane.at(x, y)).filter(|v| !v.is_nan());
                out.set(x, y, l, pixel(local, gathered, l, (x, y), given, s, wavelet));
            }
        }
    }
    out
}

fn pixel(
    local: &LocalFeatures,
    gathered: &Gathered,
    l: usize,
    (x, y): (usize, usize),
    given: Option<f32>,
    s: &Variance,
    wavelet: &Wavelet,
) -> f32 {
    let slot = &gathered.slots[l];
    let r = s.radius as usize;
    let (mut spread, mut freedom) = (0.0f64, 0.0f64);
    let (mut first, mut second, mut total) = (0.0f64, 0.0f64, 0.0f64);
    for qy in y.saturating_sub(r)..(y + r + 1).min(local.size.height) {
        for qx in x.saturating_sub(r)..(x + r + 1).min(local.size.width) {
            let distance = guide_distance(local, Class::of(slot.kind), (x, y), (qx, qy), wavelet);
            let g = f64::from(weight(distance));
            let degrees = g * f64::from((gathered.moments.at(qx, qy, 2 * l + 1) - 1.0).max(0.0));
            let mean = f64::from(luminance(gathered.colours.colour(qx, qy, 3 * slot.first)));
            spread += degrees * f64::from(gathered.moments.at(qx, qy, 2 * l));
            freedom += degrees;
            first += g * mean;
            second += g * mean * mean;
            total += g;
        }
    }
    let count = f64::from(gathered.moments.at(x, y, 2 * l + 1));
    let over_time = if freedom > 0.0 { spread / freedom } else { 0.0 };
    let mean = first / total;
    let over_space = (second / total - mean * mean).max(0.0) * count;
    let alone = (1.0 - (total - 1.0) / f64::from(s.least_window)).max(0.0);
    let over_space =
        if alone > 0.0 { over_space + alone * spread_around(gathered, slot, x, y) * count } else { over_space };
    let otherwise = given.map_or(over_space, f64::from);
    let trust = (freedom / f64::from(s.trusted_samples)).min(1.0);
    ((over_time * trust + otherwise * (1.0 - trust)) / count.max(1.0)) as f32
}

/// Spread of a light's means over 3x3 pixels, whatever they show.
fn spread_around(gathered: &Gathered, slot: &LightSlot, x: usize, y: usize) -> f64 {
    let size = gathered.colours.size();
    let rows = y.saturating_sub(1)..(y + 2).min(size.height);
    let around = rows.flat_map(|qy| (x.saturating_sub(1)..(x + 2).min(size.width)).map(move |qx| (qx, qy)));
    let means: Vec<f64> =
        around.map(|(qx, qy)| f64::from(luminance(gathered.colours.colour(qx, qy, 3 * slot.first)))).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / means.len() as f64
}
