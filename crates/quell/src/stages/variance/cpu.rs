//! The variance of every light's mean, whole rows on vectors.

use crate::kernels::guide_distance::weight;
use crate::kernels::guide_distance_cpu::{Offset, guide_distances, strips};
use crate::kernels::math::{luminance, three};
use crate::plane::Plane;
use crate::sequence::settings::{Variance, Wavelet};
use crate::stages::gather::Gathered;
use crate::window::{Class, LocalFeatures};

/// One row of `out`, a channel a light. Arguments as those of [`super::reference::run`].
#[inline(always)]
pub(crate) fn row(
    local: &LocalFeatures,
    gathered: &Gathered,
    given: &[Option<Plane<f32>>],
    s: &Variance,
    wavelet: &Wavelet,
    y: usize,
    out: &mut [f32],
) {
    let (w, h) = (local.size.width, local.size.height);
    let slots = &gathered.slots;
    let lights = slots.len();
    let radius = s.radius as isize;
    let classes: Vec<usize> = slots.iter().map(|s| Class::of(s.kind) as usize).collect();
    let wanted = Class::ALL.map(|c| classes.contains(&(c as usize)));
    let mut distance: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; w]);
    // Per light: pooled spread, its degrees of freedom, and the moments of the means with their weight.
    let mut sums = vec![0.0f32; lights * 5 * w];
    for strip in strips(w) {
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let Some(o) = Offset::new(w, h, y, dx, dy).and_then(|o| o.within(&strip)) else { continue };
                if dx == 0 && dy == 0 {
                    distance.iter_mut().for_each(|e| e.fill(0.0));
                } else {
                    guide_distances(local, w, &o, wavelet, wanted, &mut distance);
                }
                for (l, slot) in slots.iter().enumerate() {
                    let distance = &distance[classes[l]];
                    let spread = o.taps(gathered.moments.row(o.qy, 2 * l));
                    let count = o.taps(gathered.moments.row(o.qy, 2 * l + 1));
                    let rgb = three(|c| o.taps(gathered.colours.row(o.qy, 3 * slot.first + c)));
                    let n = o.to - o.from;
                    let (distance, spread, count) = (&distance[..n], &spread[..n], &count[..n]);
                    let [r, g, b] = three(|c| &rgb[c][..n]);
                    let (pooled, rest) = sums[5 * l * w..][..5 * w].split_at_mut(w);
                    let (freedoms, rest) = rest.split_at_mut(w);
                    let (first, rest) = rest.split_at_mut(w);
                    let (second, total) = rest.split_at_mut(w);
                    let (pooled, freedoms) = (&mut pooled[o.from..o.to], &mut freedoms[o.from..o.to]);
                    let (first, second) = (&mut first[o.from..o.to], &mut second[o.from..o.to]);
                    let total = &mut total[o.from..o.to];
                    for i in 0..n {
                        let weight = weight(distance[i]);
                        let freedom = weight * (count[i] - 1.0).max(0.0);
                        let mean = luminance([r[i], g[i], b[i]]);
                        pooled[i] += freedom * spread[i];
                        freedoms[i] += freedom;
                        first[i] += weight * mean;
                        second[i] += weight * mean * mean;
                        total[i] += weight;
                    }
                }
            }
        }
    }
    for l in 0..lights {
        let count = gathered.moments.row(y, 2 * l + 1);
        let given = given.get(l).and_then(Option::as_ref).map(|plane| plane.row(y));
        for x in 0..w {
            let sum = |k: usize| sums[(5 * l + k) * w + x];
            let (spread, freedom, first, second, total) = (sum(0), sum(1), sum(2), sum(3), sum(4));
            let over_time = if freedom > 0.0 { spread / freedom } else { 0.0 };
            let mean = first / total;
            let over_space = (second / total - mean * mean).max(0.0) * count[x];
            let otherwise = given.map(|given| given[x]).filter(|v| !v.is_nan()).unwrap_or(over_space);
            let trust = (freedom / s.trusted_samples).min(1.0);
            out[l * w + x] = (over_time * trust + otherwise * (1.0 - trust)) / count[x].max(1.0);
        }
    }
}
