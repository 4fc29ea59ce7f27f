//! The a-trous levels, whole rows on vectors; lights share the guide distances of a level.

use super::{LEAST_VARIANCE, SPLINE, TENT, stop_by_noise, tolerance};
use crate::kernels::guide_distance::weight;
use crate::kernels::guide_distance_cpu::{Offset, guide_distances, strips};
use crate::kernels::math::luminance;
use crate::sequence::settings::Wavelet;
use crate::window::{Class, Features, LightSlot, LocalFeatures, Rows};

/// One row of two channels a light: mean luminance over 3x3 of the same surface, and its variance.
#[inline(always)]
pub(crate) fn compared_row(
    local: &LocalFeatures,
    slots: &[LightSlot],
    colours: &Rows,
    variance: &Rows,
    s: &Wavelet,
    y: usize,
    out: &mut [f32],
) {
    let (w, h) = (local.size.width, local.size.height);
    let lights = slots.len();
    let classes: Vec<usize> = slots.iter().map(|s| Class::of(s.kind) as usize).collect();
    let wanted = Class::ALL.map(|c| classes.contains(&(c as usize)));
    let mut distance: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; w]);
    let mut total = vec![0.0f32; lights * w];
    for strip in strips(w) {
        for dy in -1..=1isize {
            for dx in -1..=1isize {
                let Some(o) = Offset::new(w, h, y, dx, dy).and_then(|o| o.within(&strip)) else { continue };
                if dx == 0 && dy == 0 {
                    distance.iter_mut().for_each(|e| e.fill(0.0));
                } else {
                    guide_distances(local, w, &o, s, wanted, &mut distance);
                }
                let share = TENT[dx.unsigned_abs()] * TENT[dy.unsigned_abs()];
                let n = o.to - o.from;
                for (l, slot) in slots.iter().enumerate() {
                    let rgb = [0, 1, 2].map(|c| &o.taps(colours.row(o.qy, 3 * slot.first + c))[..n]);
                    let var = &o.taps(variance.row(o.qy, l))[..n];
                    let distance = &distance[classes[l]][..n];
                    let (mean, spread) = out[2 * l * w..][..2 * w].split_at_mut(w);
                    let (mean, spread) = (&mut mean[o.from..o.to], &mut spread[o.from..o.to]);
                    let total = &mut total[l * w + o.from..][..n];
                    for i in 0..n {
                        let g = share * weight(distance[i]);
                        total[i] += g;
                        mean[i] += g * luminance([rgb[0][i], rgb[1][i], rgb[2][i]]);
                        spread[i] += g * g * var[i];
                    }
                }
            }
        }
    }
    for l in 0..lights {
        for x in 0..w {
            let total = total[l * w + x];
            out[2 * l * w + x] /= total;
            out[(2 * l + 1) * w + x] /= total * total;
        }
    }
}

/// What one level reads.
pub(crate) struct Level<'a> {
    pub local: &'a LocalFeatures,
    pub slots: &'a [LightSlot],
    pub colours: &'a Rows,
    pub variance: &'a Rows,
    pub compared: &'a Rows,
    /// What the first level compared.
    pub first: &'a Rows,
    pub step: isize,
    /// The lights that take part.
    pub active: &'a [usize],
    pub settings: &'a Wavelet,
}

impl Level<'_> {
    /// One row of the colours and variances after the level.
    #[inline(always)]
    pub(crate) fn row(&self, y: usize, out: &mut [f32], out_variance: &mut [f32]) {
        let Self { local, slots, colours, variance, compared, first, step, active, settings: s } = *self;
        let (w, h) = (local.size.width, local.size.height);
        let lights = slots.len();
        let classes: Vec<usize> = slots.iter().map(|s| Class::of(s.kind) as usize).collect();
        let wanted = Class::ALL.map(|c| active.iter().any(|&l| classes[l] == c as usize));
        for l in (0..lights).filter(|l| !active.contains(l)) {
            let slot = &slots[l];
            for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                out[c * w..][..w].copy_from_slice(colours.row(y, c));
            }
            out_variance[l * w..][..w].copy_from_slice(variance.row(y, l));
        }
        let mut distance: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; w]);
        let mut total = vec![0.0f32; lights * w];
        let mut weights = vec![0.0f32; w];
        // Squared, of every light at every pixel.
        let mut tolerances = vec![0.0f32; lights * w];
        for &l in active {
            let kind = slots[l].kind;
            for (x, squared) in tolerances[l * w..][..w].iter_mut().enumerate() {
                let mirror = Features::can_reflect(kind) && local.is_mirror(y * w + x);
                let k = if mirror { s.mirror } else { tolerance(s, kind) };
                let (mean, spread) = (first.row(y, 2 * l)[x], first.row(y, 2 * l + 1)[x]);
                *squared = stop_by_noise(k * k, mean, spread, s);
            }
        }
        for strip in strips(w) {
            for dy in -2..=2isize {
                for dx in -2..=2isize {
                    let Some(o) = Offset::new(w, h, y, dx * step, dy * step).and_then(|o| o.within(&strip)) else {
                        continue;
                    };
                    let n = o.to - o.from;
                    let share = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()];
                    let centre = dx == 0 && dy == 0;
                    if !centre {
                        guide_distances(local, w, &o, s, wanted, &mut distance);
                    }
                    for &l in active {
                        let slot = &slots[l];
                        let weights = &mut weights[..n];
                        if centre {
                            weights.fill(share);
                        } else {
                            let squared = &o.centres(&tolerances[l * w..][..w])[..n];
                            let distance = &distance[classes[l]][..n];
                            let mean = |y: usize| compared.row(y, 2 * l);
                            let spread = |y: usize| compared.row(y, 2 * l + 1);
                            let (mp, mq) = (&o.centres(mean(y))[..n], &o.taps(mean(o.qy))[..n]);
                            let (vp, vq) = (&o.centres(spread(y))[..n], &o.taps(spread(o.qy))[..n]);
                            for i in 0..n {
                                let d = mp[i] - mq[i];
                                let v = vp[i] + vq[i].min(s.variance_ratio * vp[i]);
                                let contrast = s.least_contrast * mp[i];
                                let stop =
                                    (d * d - v).max(0.0) / (squared[i] * v + contrast * contrast + LEAST_VARIANCE);
                                weights[i] = share * weight(distance[i] + stop);
                            }
                        }
                        let total = &mut total[l * w + o.from..][..n];
                        let var = &o.taps(variance.row(o.qy, l))[..n];
                        let sum = &mut out_variance[l * w + o.from..][..n];
                        for i in 0..n {
                            total[i] += weights[i];
                            sum[i] += weights[i] * weights[i] * var[i];
                        }
                        for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                            let colour = &o.taps(colours.row(o.qy, c))[..n];
                            let sum = &mut out[c * w + o.from..][..n];
                            for i in 0..n {
                                sum[i] += weights[i] * colour[i];
                            }
                        }
                    }
                }
            }
        }
        for &l in active {
            let slot = &slots[l];
            for x in 0..w {
                let scale = 1.0 / total[l * w + x];
                out_variance[l * w + x] *= scale * scale;
                for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                    out[c * w + x] *= scale;
                }
            }
        }
    }
}
