//! The a-trous levels, sixteen pixels of a row at once through all taps: sums stay in registers, and lights share the guide
//! distances of a level.

use super::{LEAST_VARIANCE, TENT, tolerance};
use crate::kernels::guide_distance_cpu::{Distances, Guides, RUN, Tap, three_rows, weight};
use crate::kernels::lanes::{BLOCK, load, store};
use crate::kernels::lit_blocks::{Lit, LitBlocks};
use crate::kernels::math::LUMINANCE;
use crate::plane::Size;
use crate::sequence::settings::Wavelet;
use crate::window::{Class, Features, LightSlot, LocalFeatures, Rows};
use fearless_simd::{Simd, f32x16, prelude::*};

/// One row of two channels a light: mean luminance over 3x3 of the same surface, and its variance.
#[inline(always)]
pub(crate) fn compared_row<S: Simd>(
    simd: S,
    local: &LocalFeatures,
    slots: &[LightSlot],
    (colours, variance, lit): (&Rows, &Rows, &LitBlocks),
    s: &Wavelet,
    y: usize,
    out: &mut [f32],
) {
    let (w, h) = (local.size.width, local.size.height);
    let mut distances = Distances::new(1, 1, y, h, s);
    // Of each light the luminance of the rows that taps lie in: found once, not at every tap.
    let mut luminances = Rows::new(Size::new(w, 3), slots.len());
    let first = y.saturating_sub(1);
    for row in first..(y + 2).min(h) {
        luminances_of(simd, slots, colours, row, &mut luminances, row - first);
    }
    let images = Compared { luminances: &luminances, first, variance };
    for start in (0..w).step_by(RUN * BLOCK) {
        let blocks = || (start..w).step_by(BLOCK).take(RUN).enumerate();
        let mut lit_in = [Lit::default(); RUN];
        for (block, x) in blocks() {
            let lit = lit.within(first..(y + 2).min(h), x as isize - 1..(x + BLOCK + 1) as isize);
            lit_in[block] = lit;
            let Some(wanted) = Class::wanted(slots, |l| lit.has(l)) else { continue };
            if distances.reach_edge(x, w) {
                distances.find(block, &Guides::<_, true>::new(simd, local, s, wanted, [x, y]));
            } else {
                distances.find(block, &Guides::<_, false>::new(simd, local, s, wanted, [x, y]));
            }
            distances.weigh(simd, block, wanted);
        }
        for (l, slot) in slots.iter().enumerate() {
            let class = Class::of(slot.kind);
            for (block, x) in blocks() {
                if !lit_in[block].has(l) {
                    for c in [2 * l, 2 * l + 1] {
                        out[c * w..][x..(x + BLOCK).min(w)].fill(0.0);
                    }
                    continue;
                }
                let (weights, at) = (distances.of(block, class), ((x, y), s.step * s.step));
                if distances.reach_edge(x, w) {
                    means::<true, _>(simd, l, &images, (distances.taps(), weights), at, out);
                } else {
                    means::<false, _>(simd, l, &images, (distances.taps(), weights), at, out);
                }
            }
        }
    }
}

/// The luminance of each light in row `y`, into row `at`.
#[inline(always)]
fn luminances_of<S: Simd>(simd: S, slots: &[LightSlot], colours: &Rows, y: usize, out: &mut Rows, at: usize) {
    let w = colours.size().width;
    for (l, slot) in slots.iter().enumerate() {
        let (r, g, b) =
            (colours.row(y, 3 * slot.first), colours.row(y, 3 * slot.first + 1), colours.row(y, 3 * slot.first + 2));
        let start = out.start(at, l);
        let out = &mut out.data_mut()[start..][..w];
        for x in (0..w).step_by(BLOCK) {
            let of = x as isize;
            let value = load::<true, _>(simd, r, of) * LUMINANCE[0]
                + load::<true, _>(simd, g, of) * LUMINANCE[1]
                + load::<true, _>(simd, b, of) * LUMINANCE[2];
            store(value, out, x);
        }
    }
}

/// What is compared around a pixel.
struct Compared<'a> {
    /// Of each light, rows from `first` on.
    luminances: &'a Rows,
    first: usize,
    variance: &'a Rows,
}

/// The part of [`compared_row`] for one light and the pixels from `x` on.
#[inline(always)]
fn means<const EDGE: bool, S: Simd>(
    simd: S,
    l: usize,
    Compared { luminances, first, variance }: &Compared<'_>,
    (taps, weights): (&[Tap], &[[f32; BLOCK]]),
    ((x, y), squared): ((usize, usize), f32),
    out: &mut [f32],
) {
    let w = variance.size().width;
    let (one, two) = (f32x16::splat(simd, 1.0), f32x16::splat(simd, 2.0));
    let zero = f32x16::splat(simd, 0.0);
    let (mut mean, mut spread, mut total) = (zero, zero, zero);
    let own = load::<EDGE, _>(simd, luminances.row(y - first, l), x as isize);
    let own_variance = load::<EDGE, _>(simd, variance.row(y, l), x as isize);
    let (values, variances) = (from(luminances, l), from(variance, l));
    for (tap, weight) in taps.iter().zip(weights) {
        let share = TENT[tap.dx.unsigned_abs()] * TENT[tap.dy.unsigned_abs()];
        let here = tap.counted_from(*first);
        let value = here.at::<EDGE, _>(simd, (luminances, l), (values, here.start(luminances)), x);
        let v = tap.at::<EDGE, _>(simd, (variance, l), (variances, tap.start(variance)), x);
        let d = value - own;
        // As `same_light`.
        let most = (v + own_variance) * squared + LEAST_VARIANCE;
        let same = (two - d * d / most).max_precise(zero).min_precise(one);
        let weight = tap.inside::<EDGE, _>(x, w, f32x16::from_slice(simd, weight) * same * share);
        total += weight;
        mean += weight * value;
        spread += weight * weight * v;
    }
    store(mean / total, &mut out[2 * l * w..][..w], x);
    store(spread / (total * total), &mut out[(2 * l + 1) * w..][..w], x);
}

/// What one level reads.
pub(crate) struct Level<'a> {
    pub local: &'a LocalFeatures,
    pub slots: &'a [LightSlot],
    pub compared: &'a Rows,
    /// Of each light its luminance stop, squared.
    pub stops: &'a Rows,
    pub step: isize,
    /// See [`super::correlation`].
    pub correlation: f32,
    /// The lights that take part.
    pub active: &'a [usize],
    /// Where lights have colour or variance before the level.
    pub lit: &'a LitBlocks,
    pub settings: &'a Wavelet,
}

impl Level<'_> {
    /// One row of the colours and variances after the level, from those before.
    #[inline(always)]
    pub(crate) fn row<S: Simd>(
        &self,
        simd: S,
        (colours, variance): (&Rows, &Rows),
        y: usize,
        out: &mut [f32],
        out_variance: &mut [f32],
    ) {
        let Self { local, slots, step, active, settings: s, .. } = *self;
        let (w, h) = (local.size.width, local.size.height);
        for l in (0..slots.len()).filter(|l| !active.contains(l)) {
            let slot = &slots[l];
            for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                out[c * w..][..w].copy_from_slice(colours.row(y, c));
            }
            out_variance[l * w..][..w].copy_from_slice(variance.row(y, l));
        }
        let mut distances = Distances::new(1, step, y, h, s);
        let places: Vec<Place> = distances
            .taps()
            .iter()
            .map(|tap| Place {
                share: TENT[tap.dx.unsigned_abs()] * TENT[tap.dy.unsigned_abs()],
                is_centre: tap.is_centre(),
                compared: tap.start(self.compared),
                variance: tap.start(variance),
                colours: tap.start(colours),
            })
            .collect();
        let mut weights = vec![[0.0; BLOCK]; places.len()];
        let rows = || (-1..=1).filter_map(|dy| y.checked_add_signed(dy * step)).filter(|row| *row < h);
        for start in (0..w).step_by(RUN * BLOCK) {
            let blocks = || (start..w).step_by(BLOCK).take(RUN).enumerate();
            let mut lit_in = [Lit::default(); RUN];
            for (block, x) in blocks() {
                let lit = self.lit.within(rows(), x as isize - step..(x + BLOCK) as isize + step);
                lit_in[block] = lit;
                let Some(wanted) = Class::wanted(slots, |l| lit.has(l) && active.contains(&l)) else { continue };
                if distances.reach_edge(x, w) {
                    distances.find(block, &Guides::<_, true>::new(simd, local, s, wanted, [x, y]));
                } else {
                    distances.find(block, &Guides::<_, false>::new(simd, local, s, wanted, [x, y]));
                }
            }
            for &l in active {
                let slot = &slots[l];
                let class = Class::of(slot.kind);
                for (block, x) in blocks() {
                    if !lit_in[block].has(l) {
                        let end = (x + BLOCK).min(w);
                        for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                            out[c * w..][x..end].fill(0.0);
                        }
                        out_variance[l * w..][x..end].fill(0.0);
                        continue;
                    }
                    let (images, out) = ((colours, variance), (&mut *out, &mut *out_variance));
                    let taps = Taps { each: distances.taps(), places: &places, distances: distances.of(block, class) };
                    if distances.reach_edge(x, w) {
                        self.light::<true, _>(simd, images, (l, [x, y]), taps, &mut weights, out);
                    } else {
                        self.light::<false, _>(simd, images, (l, [x, y]), taps, &mut weights, out);
                    }
                }
            }
        }
    }

    /// A light of the pixels of a block.
    #[inline(always)]
    fn light<const EDGE: bool, S: Simd>(
        &self,
        simd: S,
        (colours, variance): (&Rows, &Rows),
        (l, [x, y]): (usize, [usize; 2]),
        Taps { each, places, distances }: Taps<'_>,
        weights: &mut [[f32; BLOCK]],
        (out, out_variance): (&mut [f32], &mut [f32]),
    ) {
        let Self { local, slots, compared, stops, correlation, settings: s, .. } = *self;
        let (w, zero) = (local.size.width, f32x16::splat(simd, 0.0));
        let slot = &slots[l];
        let squared = load::<EDGE, _>(simd, stops.row(y, l), x as isize);
        let mp = load::<EDGE, _>(simd, compared.row(y, 2 * l), x as isize);
        let vp = load::<EDGE, _>(simd, compared.row(y, 2 * l + 1), x as isize);
        let (contrast, most) = (mp * s.least_contrast, vp * s.variance_ratio);
        let contrast = contrast * contrast;
        let (means, spreads) = (from(compared, 2 * l), from(compared, 2 * l + 1));
        let (variances, first) = (from(variance, l), 3 * slot.first);
        let (reds, greens, blues) = (from(colours, first), from(colours, first + 1), from(colours, first + 2));
        let several = slot.planes > 1;
        let (mut total, mut sum) = (zero, zero);
        let [mut red, mut green, mut blue] = [zero; 3];
        for (((tap, distance), place), kept) in each.iter().zip(distances).zip(places).zip(&mut *weights) {
            let weight = if place.is_centre {
                f32x16::splat(simd, place.share)
            } else {
                let d = mp - tap.at::<EDGE, _>(simd, (compared, 2 * l), (means, place.compared), x);
                let vq = tap.at::<EDGE, _>(simd, (compared, 2 * l + 1), (spreads, place.compared), x);
                let v = (vp + vq.min_precise(most)) * correlation;
                let stop = (d * d - v).max_precise(zero) / (squared * v + contrast + LEAST_VARIANCE);
                tap.inside::<EDGE, _>(x, w, weight(f32x16::from_slice(simd, distance) + stop) * place.share)
            };
            total += weight;
            sum += weight * weight * tap.at::<EDGE, _>(simd, (variance, l), (variances, place.variance), x);
            red += weight * tap.at::<EDGE, _>(simd, (colours, first), (reds, place.colours), x);
            green += weight * tap.at::<EDGE, _>(simd, (colours, first + 1), (greens, place.colours), x);
            blue += weight * tap.at::<EDGE, _>(simd, (colours, first + 2), (blues, place.colours), x);
            if several {
                weight.store_slice(kept);
            }
        }
        let scale = 1.0 / total;
        store(sum * (scale * scale), &mut out_variance[l * w..][..w], x);
        for (c, sum) in [red, green, blue].into_iter().enumerate() {
            store(sum * scale, &mut out[(first + c) * w..][..w], x);
        }
        for k in slot.first + 1..slot.first + slot.planes {
            let [mut red, mut green, mut blue] = [zero; 3];
            for (tap, weight) in each.iter().zip(&*weights) {
                let weight = f32x16::from_slice(simd, weight);
                let [r, g, b] = three_rows::<EDGE, _>(simd, colours, tap, 3 * k, x);
                red += weight * r;
                green += weight * g;
                blue += weight * b;
            }
            for (c, sum) in [red, green, blue].into_iter().enumerate() {
                store(sum * scale, &mut out[(3 * k + c) * w..][..w], x);
            }
        }
    }
}

/// The taps of the pixels of a block.
#[derive(Clone, Copy)]
struct Taps<'a> {
    each: &'a [Tap],
    places: &'a [Place],
    distances: &'a [[f32; BLOCK]],
}

/// What a tap is for every light.
#[derive(Clone, Copy)]
struct Place {
    /// Of the kernel.
    share: f32,
    is_centre: bool,
    /// See [`Tap::start`].
    compared: usize,
    variance: usize,
    colours: usize,
}

/// The values of an image from a channel of its first row on.
#[inline(always)]
fn from(rows: &Rows, channel: usize) -> &[f32] {
    rows.data().get(channel * rows.size().width..).unwrap_or(&[])
}

/// One row of a channel a light: the luminance stop squared, from `low` where there is little noise to the light's own where there is
/// much. `compared` is what the first level compares.
#[inline(always)]
pub(crate) fn stops_row<S: Simd>(
    simd: S,
    local: &LocalFeatures,
    slots: &[LightSlot],
    compared: &Rows,
    s: &Wavelet,
    y: usize,
    out: &mut [f32],
) {
    let w = local.size.width;
    for (l, slot) in slots.iter().enumerate() {
        for x in (0..w).step_by(BLOCK) {
            let mut squared = [tolerance(s, slot.kind) * tolerance(s, slot.kind); BLOCK];
            if Features::can_reflect(slot.kind) {
                for (i, squared) in squared.iter_mut().enumerate().take(w - x) {
                    if local.is_mirror(y * w + x + i) {
                        *squared = s.mirror * s.mirror;
                    }
                }
            }
            let squared: f32x16<S> = squared.simd_into(simd);
            let mean = load::<true, _>(simd, compared.row(y, 2 * l), x as isize);
            let variance = load::<true, _>(simd, compared.row(y, 2 * l + 1), x as isize);
            let low = squared.min_precise(f32x16::splat(simd, s.low * s.low));
            let scale = mean * s.low_noise;
            let stop = low + (squared - low) * variance / (variance + scale * scale + LEAST_VARIANCE);
            store(stop, &mut out[l * w..][..w], x);
        }
    }
}
