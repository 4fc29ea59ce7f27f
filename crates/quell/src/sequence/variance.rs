//! The variance of every light's mean, pooled over the surface around each pixel.

use super::accumulate::{Accumulated, luminance};
use super::energy::{Class, Offset, energies, weight};
use super::frame::LightKind;
use super::guides::Local;
use super::member::Member;
use super::rows::Rows;
use super::settings::{Variance, Wavelet};
use super::simd::widest;
use crate::par;

/// One channel a light: variance of the mean's luminance.
///
/// Over time it is the pooled spread of the samples; where those are few, the spread of the means over the window
/// counts too (a first frame, what was just uncovered), or the variance that the renderer gave.
pub(super) fn variance(
    member: &Member,
    local: &Local,
    accumulated: &Accumulated,
    s: &Variance,
    wavelet: &Wavelet,
) -> Rows {
    let lights = accumulated.slots.len();
    let mut out = Rows::new(member.size, lights);
    par::rows(out.data_mut(), (lights * member.size.width).max(1), |y, out| {
        widest!(variance_row(member, local, accumulated, s, wavelet, y, out));
    });
    out
}

#[inline(always)]
fn variance_row(
    member: &Member,
    local: &Local,
    accumulated: &Accumulated,
    s: &Variance,
    wavelet: &Wavelet,
    y: usize,
    out: &mut [f32],
) {
    let (w, h) = (member.size.width, member.size.height);
    let slots = &accumulated.slots;
    let lights = slots.len();
    let radius = s.radius as isize;
    let classes: Vec<usize> = slots.iter().map(|s| Class::of(s.kind) as usize).collect();
    let wanted = Class::ALL.map(|c| classes.contains(&(c as usize)));
    let mut energy: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; w]);
    // Per light: pooled spread, its degrees of freedom, and the moments of the means with their weight.
    let mut sums = vec![[0.0f32; 5]; lights * w];
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let Some(o) = Offset::new(w, h, y, dx, dy) else { continue };
            if dx == 0 && dy == 0 {
                energy.iter_mut().for_each(|e| e.fill(0.0));
            } else {
                energies(local, w, &o, wavelet, wanted, &mut energy);
            }
            for (l, slot) in slots.iter().enumerate() {
                let energy = &energy[classes[l]];
                let spread = o.taps(accumulated.moments.row(o.qy, 2 * l));
                let count = o.taps(accumulated.moments.row(o.qy, 2 * l + 1));
                let rgb = [0, 1, 2].map(|c| o.taps(accumulated.colours.row(o.qy, 3 * slot.first + c)));
                let sums = &mut sums[l * w + o.from..][..o.to - o.from];
                for (i, sum) in sums.iter_mut().enumerate() {
                    let g = weight(energy[i]);
                    let freedom = g * (count[i] - 1.0).max(0.0);
                    let mean = luminance([rgb[0][i], rgb[1][i], rgb[2][i]]);
                    sum[0] += freedom * spread[i];
                    sum[1] += freedom;
                    sum[2] += g * mean;
                    sum[3] += g * mean * mean;
                    sum[4] += g;
                }
            }
        }
    }
    for (l, slot) in slots.iter().enumerate() {
        let count = accumulated.moments.row(y, 2 * l + 1);
        let weights = member.weights[slot.light].as_deref();
        let given = member.variance.as_ref().filter(|_| slot.kind == LightKind::Beauty).map(|p| p.row(y));
        for x in 0..w {
            let [spread, freedom, first, second, total] = sums[l * w + x];
            let over_time = if freedom > 0.0 { spread / freedom } else { 0.0 };
            let mean = first / total;
            let over_space = (second / total - mean * mean).max(0.0) * count[x];
            let otherwise = match given {
                Some(given) if given[x].is_finite() && given[x] >= 0.0 => {
                    let weight = weights.map_or(1.0, |weight| luminance(weight.at(y * w + x))).max(1e-3);
                    given[x] / (weight * weight)
                }
                _ => over_space,
            };
            let trust = (freedom / s.trusted_samples).min(1.0);
            out[l * w + x] = (over_time * trust + otherwise * (1.0 - trust)) / count[x].max(1.0);
        }
    }
}
