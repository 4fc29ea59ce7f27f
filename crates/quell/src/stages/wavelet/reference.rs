//! The specification of `wavelet`.

use super::{LEAST_VARIANCE, TENT, correlation, levels, same_light, tolerance};
use crate::kernels::guide_distance::{guide_distance, weight};
use crate::kernels::math::luminance;
use crate::sequence::settings::Wavelet;
use crate::window::{Class, Features, LightSlot, LocalFeatures, Rows};

/// Filters every light on the whole image. `colours`: three channels a plane, as `slots` place them; `variance`: one
/// channel a light, of its luminance.
pub fn run(local: &LocalFeatures, slots: &[LightSlot], mut colours: Rows, mut variance: Rows, s: &Wavelet) -> Rows {
    for (l, slot) in slots.iter().enumerate() {
        let (w, h) = (local.size.width, local.size.height);
        let compared = |colours: &Rows, variance: &Rows| -> Vec<[f64; 2]> {
            (0..w * h).map(|p| mean_around(local, slot, l, (p % w, p / w), colours, variance, s)).collect()
        };
        let first = compared(&colours, &variance);
        let mirror = |p: usize| Features::can_reflect(slot.kind) && local.is_mirror(p);
        let stops: Vec<f64> = (0..w * h)
            .map(|p| squared_stop(if mirror(p) { s.mirror } else { tolerance(s, slot.kind) }, first[p], s))
            .collect();
        for level in 0..levels(s, slot.kind) {
            let mean = compared(&colours, &variance);
            (colours, variance) = a_level(local, slot, l, level, (&mean, &stops), (&colours, &variance), s);
        }
    }
    colours
}

/// One level of one light; the other lights stay as they are.
fn a_level(
    local: &LocalFeatures,
    slot: &LightSlot,
    l: usize,
    level: u32,
    (mean, stops): (&[[f64; 2]], &[f64]),
    (colours, variance): (&Rows, &Rows),
    s: &Wavelet,
) -> (Rows, Rows) {
    let (w, h) = (local.size.width, local.size.height);
    let (class, step, correlation) = (Class::of(slot.kind), 1 << level, f64::from(correlation(level)));
    let (mut filtered, mut filtered_variance) = (colours.clone(), variance.clone());
    for y in 0..h {
        for x in 0..w {
            let mut sums = vec![[0.0f64; 3]; slot.planes];
            let (mut total, mut squares) = (0.0f64, 0.0f64);
            for (dx, dy) in (-1..=1isize).flat_map(|dy| (-1..=1isize).map(move |dx| (dx, dy))) {
                let (qx, qy) = (x as isize + dx * step, y as isize + dy * step);
                if qx < 0 || qy < 0 || qx >= w as isize || qy >= h as isize {
                    continue;
                }
                let q = (qx as usize, qy as usize);
                let share = f64::from(TENT[dx.unsigned_abs()] * TENT[dy.unsigned_abs()]);
                let compared = [mean[y * w + x], mean[q.1 * w + q.0]].map(|[mean, v]| [mean, correlation * v]);
                let stop = luminance_stop(compared[0], compared[1], stops[y * w + x], s);
                let distance = f64::from(guide_distance(local, class, (x, y), q, s)) + stop;
                let tap = if (dx, dy) == (0, 0) { share } else { share * f64::from(weight(distance as f32)) };
                for (k, sum) in sums.iter_mut().enumerate() {
                    let colour = colours.colour(q.0, q.1, 3 * (slot.first + k));
                    for c in 0..3 {
                        sum[c] += tap * f64::from(colour[c]);
                    }
                }
                squares += tap * tap * f64::from(variance.at(q.0, q.1, l));
                total += tap;
            }
            for (k, sum) in sums.iter().enumerate() {
                for c in 0..3 {
                    filtered.set(x, y, 3 * (slot.first + k) + c, (sum[c] / total) as f32);
                }
            }
            filtered_variance.set(x, y, l, (squares / (total * total)) as f32);
        }
    }
    (filtered, filtered_variance)
}

/// Mean luminance over 3x3 of the same surface, and its variance.
fn mean_around(
    local: &LocalFeatures,
    slot: &LightSlot,
    l: usize,
    (x, y): (usize, usize),
    colours: &Rows,
    variance: &Rows,
    s: &Wavelet,
) -> [f64; 2] {
    let (mut mean, mut spread, mut total) = (0.0f64, 0.0f64, 0.0f64);
    let own = f64::from(luminance(colours.colour(x, y, 3 * slot.first)));
    let own_variance = f64::from(variance.at(x, y, l));
    for qy in y.saturating_sub(1)..(y + 2).min(local.size.height) {
        for qx in x.saturating_sub(1)..(x + 2).min(local.size.width) {
            let distance = guide_distance(local, Class::of(slot.kind), (x, y), (qx, qy), s);
            let value = f64::from(luminance(colours.colour(qx, qy, 3 * slot.first)));
            let v = f64::from(variance.at(qx, qy, l));
            let same = same_light(value - own, v + own_variance, f64::from(s.step).powi(2));
            let g = f64::from(TENT[x.abs_diff(qx)] * TENT[y.abs_diff(qy)] * weight(distance)) * same;
            mean += g * value;
            spread += g * g * v;
            total += g;
        }
    }
    [mean / total, spread / (total * total)]
}

/// The stop's deviations, squared: those of the light where noise is strong, `low` where it is weak.
fn squared_stop(deviations: f32, [mean, variance]: [f64; 2], s: &Wavelet) -> f64 {
    let high = f64::from(deviations).powi(2);
    let low = f64::from(s.low).powi(2).min(high);
    let noisy = variance / (variance + (f64::from(s.low_noise) * mean).powi(2) + f64::from(LEAST_VARIANCE));
    low + (high - low) * noisy
}

/// The difference of two means, squared, beyond the variance of both, in `squared` variances.
fn luminance_stop([mean_p, variance_p]: [f64; 2], [mean_q, variance_q]: [f64; 2], squared: f64, s: &Wavelet) -> f64 {
    let v = variance_p + variance_q.min(f64::from(s.variance_ratio) * variance_p);
    let contrast = f64::from(s.least_contrast) * mean_p;
    let beyond = ((mean_p - mean_q).powi(2) - v).max(0.0);
    beyond / (squared * v + contrast * contrast + f64::from(LEAST_VARIANCE))
}
