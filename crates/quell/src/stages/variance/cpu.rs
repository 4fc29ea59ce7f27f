//! The variance of every light's mean, sixteen pixels of a row at once through all taps.

use crate::kernels::guide_distance_cpu::{Distances, Guides, RUN, Tap, three_rows, weight};
use crate::kernels::lanes::{BLOCK, store};
use crate::kernels::lit_blocks::{Lit, LitBlocks};
use crate::kernels::math::{LUMINANCE, luminance};
use crate::par;
use crate::plane::Plane;
use crate::sequence::settings::{Variance, Wavelet};
use crate::stages::gather::Gathered;
use crate::window::{Class, LightSlot, LocalFeatures};
use fearless_simd::{Simd, f32x16, prelude::*};

/// One row of `out`, a channel a light. Arguments as those of [`super::reference::run`].
#[inline(always)]
pub(crate) fn row<S: Simd>(
    simd: S,
    local: &LocalFeatures,
    (gathered, lit): (&Gathered, &LitBlocks),
    given: &[Option<Plane<f32>>],
    (s, wavelet): (&Variance, &Wavelet),
    y: usize,
    out: &mut [f32],
) {
    let (w, h) = (local.size.width, local.size.height);
    let slots = &gathered.slots;
    let lights = slots.len();
    let radius = s.radius as usize;
    let rows = y.saturating_sub(radius)..(y + radius + 1).min(h);
    let mut distances = Distances::new(radius, 1, y, h, wavelet);
    // Per light: pooled spread, its degrees of freedom, and the moments of the means with their weight.
    let mut sums = par::scratch(lights * 5 * w);
    let has_given = |l: usize| given.get(l).is_some_and(Option::is_some);
    for start in (0..w).step_by(RUN * BLOCK) {
        let blocks = || (start..w).step_by(BLOCK).take(RUN).enumerate();
        let mut lit_in = [Lit::default(); RUN];
        for (block, x) in blocks() {
            let lit = lit.within(rows.clone(), x as isize - radius as isize..(x + BLOCK + radius) as isize);
            lit_in[block] = lit;
            let Some(wanted) = Class::wanted(slots, |l| lit.has(l) || has_given(l)) else { continue };
            if distances.reach_edge(x, w) {
                distances.find(block, &Guides::<_, true>::new(simd, local, wavelet, wanted, [x, y]));
            } else {
                distances.find(block, &Guides::<_, false>::new(simd, local, wavelet, wanted, [x, y]));
            }
        }
        for (l, slot) in slots.iter().enumerate() {
            let class = Class::of(slot.kind);
            for (block, x) in blocks() {
                if !lit_in[block].has(l) && !has_given(l) {
                    continue;
                }
                let taps = (distances.taps(), distances.of(block, class));
                if distances.reach_edge(x, w) {
                    moments::<true, _>(simd, gathered, (l, slot.first), taps, x, &mut sums);
                } else {
                    moments::<false, _>(simd, gathered, (l, slot.first), taps, x, &mut sums);
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
            if total == 0.0 {
                out[l * w + x] = 0.0; // black
                continue;
            }
            let over_time = if freedom > 0.0 { spread / freedom } else { 0.0 };
            let mean = first / total;
            let over_space = (second / total - mean * mean).max(0.0) * count[x];
            let trust = (freedom / s.trusted_samples).min(1.0);
            let otherwise = match given.map(|given| given[x]).filter(|v| !v.is_nan()) {
                Some(given) => given,
                None if trust < 1.0 && total - 1.0 < s.least_window => {
                    let alone = 1.0 - (total - 1.0) / s.least_window;
                    over_space + alone * spread_around(gathered, &slots[l], x, y) * count[x]
                }
                None => over_space,
            };
            out[l * w + x] = (over_time * trust + otherwise * (1.0 - trust)) / count[x].max(1.0);
        }
    }
}

/// Spread of a light's means over 3x3 pixels, whatever they show.
#[cold]
fn spread_around(gathered: &Gathered, slot: &LightSlot, x: usize, y: usize) -> f32 {
    let size = gathered.colours.size();
    let (mut first, mut second, mut total) = (0.0f32, 0.0f32, 0.0f32);
    for qy in y.saturating_sub(1)..(y + 2).min(size.height) {
        for qx in x.saturating_sub(1)..(x + 2).min(size.width) {
            let mean = luminance(gathered.colours.colour(qx, qy, 3 * slot.first));
            first += mean;
            second += mean * mean;
            total += 1.0;
        }
    }
    let mean = first / total;
    (second / total - mean * mean).max(0.0)
}

/// Sums over the taps of the pixels from `x` on, five for a light; of those that do not take part they stay 0.
#[inline(always)]
fn moments<const EDGE: bool, S: Simd>(
    simd: S,
    gathered: &Gathered,
    (l, plane): (usize, usize),
    (taps, distances): (&[Tap], &[[f32; BLOCK]]),
    x: usize,
    sums: &mut [f32],
) {
    let w = gathered.colours.size().width;
    let zero = f32x16::splat(simd, 0.0);
    let (mut pooled, mut freedoms, mut total) = (zero, zero, zero);
    let (mut first, mut second) = (zero, zero);
    for (tap, distance) in taps.iter().zip(distances) {
        let weight = tap.inside::<EDGE, _>(x, w, weight(f32x16::from_slice(simd, distance)));
        let spread = tap.of::<EDGE, _>(simd, &gathered.moments, 2 * l, x);
        let count = tap.of::<EDGE, _>(simd, &gathered.moments, 2 * l + 1, x);
        let [r, g, b] = three_rows::<EDGE, _>(simd, &gathered.colours, tap, 3 * plane, x);
        let freedom = weight * (count - 1.0).max_precise(zero);
        let mean = r * LUMINANCE[0] + g * LUMINANCE[1] + b * LUMINANCE[2];
        pooled += freedom * spread;
        freedoms += freedom;
        first += weight * mean;
        second += weight * mean * mean;
        total += weight;
    }
    for (k, sum) in [pooled, freedoms, first, second, total].into_iter().enumerate() {
        store(sum, &mut sums[(5 * l + k) * w..][..w], x);
    }
}
