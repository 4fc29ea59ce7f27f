//! Means of the light, sixteen pixels of a row at once through all taps: the fast twin of [`super::reference`].

use super::{Asked, FREE, LEAST, MOST, RADIUS, SECOND_DIFFERENCE, STEPS, STRONGEST, WINDOW};
use crate::kernels::lanes::{
    BLOCK, inside, load, load_halves, load_halves_within, load_row, load_within, store, whole,
};
use crate::kernels::lit_blocks::{Lit, LitBlocks};
use crate::kernels::math::luminance;
use crate::par;
use crate::sequence::settings::Gather;
use crate::simd::dispatch;
use crate::window::{Features, Packed};
use fearless_simd::{Simd, f32x16, mask32x16, prelude::*};
use half::f16;
use half::slice::HalfFloatSliceExt;
use std::ops::Range;

/// Columns before a row, where its first value goes on.
const PAD: usize = RADIUS as usize + 1;
/// Pixels of a window of [`RADIUS`].
const NEAR: usize = (WINDOW * WINDOW) as usize;

/// Of each pixel the means of all lights, then their deviations: [`super::LightMeans::data`].
pub(super) fn data(
    f: &Features,
    lights: &[Asked],
    media: &[usize],
    samples: &Packed,
    scale: f32,
    s: &Gather,
) -> Vec<f16> {
    let (w, n) = (f.size.width, lights.len());
    let mut data = vec![f16::ZERO; 2 * n * f.size.pixels()];
    if n == 0 {
        return data;
    }
    let job = Job { f, lights, scale, s, surface: Surface::new(f) };
    // Row by row, of each row the means of all lights, then their deviations.
    let mut near = vec![f16::ZERO; 2 * n * f.size.pixels()];
    let (light, medium) = (job.luminances(samples), job.medium(media, samples));
    let lit = LitBlocks::new(f.size, n, |y, l| std::iter::once(&light[l].row(y)[PAD..PAD + w]));
    par::rows(&mut near, 2 * n * w, |y, out| {
        let mut row = par::scratch(out.len());
        dispatch!(crate::simd::level(), simd => job.near(simd, (&light, &lit), medium.as_ref(), y, &mut row));
        out.convert_from_f32_slice(&row);
    });
    drop((light, lit, medium));
    par::rows(&mut data, 2 * n * w, |y, out| {
        let mut row = par::scratch(out.len());
        dispatch!(crate::simd::level(), simd => job.wide(simd, &near, y, &mut row));
        let mut pixels = par::unset_scratch(out.len());
        for (c, channel) in row.chunks_exact(w).enumerate() {
            for (pixel, value) in pixels.chunks_exact_mut(2 * n).zip(channel) {
                pixel[c] = *value;
            }
        }
        out.convert_from_f32_slice(&pixels);
    });
    data
}

/// What tells surfaces apart, plane by plane.
struct Surface {
    inverse_depth: Vec<f32>,
    normal: [Vec<f32>; 3],
    /// 1: a mirror.
    mirror: Vec<f32>,
}

impl Surface {
    fn new(f: &Features) -> Self {
        let of = |c: usize| par::map(&f.surface, |s| s.normal[c]);
        let mut mirror = vec![0.0; f.surface.len()];
        if f.mirror_colour.is_some() {
            let w = f.size.width;
            par::rows(&mut mirror, w.max(1), |y, row| {
                row.iter_mut().enumerate().for_each(|(x, m)| *m = if f.is_mirror(y * w + x) { 1.0 } else { 0.0 });
            });
        }
        Self { inverse_depth: par::map(&f.surface, |s| s.inverse_depth), normal: [of(0), of(1), of(2)], mirror }
    }
}

/// The surfaces of sixteen pixels of a row.
#[derive(Clone, Copy)]
struct Points<S: Simd> {
    inverse_depth: f32x16<S>,
    normal: [f32x16<S>; 3],
    mirror: f32x16<S>,
}

impl<S: Simd> Points<S> {
    #[inline(always)]
    fn load<const EDGE: bool>(simd: S, surface: &Surface, w: usize, y: usize, at: isize) -> Self {
        let [nx, ny, nz] = &surface.normal;
        Self {
            inverse_depth: load_row::<EDGE, _>(simd, &surface.inverse_depth, y * w, w, at),
            normal: [
                load_row::<EDGE, _>(simd, nx, y * w, w, at),
                load_row::<EDGE, _>(simd, ny, y * w, w, at),
                load_row::<EDGE, _>(simd, nz, y * w, w, at),
            ],
            mirror: load_row::<EDGE, _>(simd, &surface.mirror, y * w, w, at),
        }
    }

    /// True where other pixels show the surface of these.
    #[inline(always)]
    fn alike(&self, other: &Self, s: &Gather) -> mask32x16<S> {
        let zero = f32x16::splat(self.mirror.simd, 0.0);
        let (a, b) = (self.inverse_depth, other.inverse_depth);
        let other_kind = !self.mirror.simd_eq(other.mirror) | (a.simd_gt(zero) ^ b.simd_gt(zero));
        let near = (b - a).abs().simd_le(a * s.moving_depth);
        let (p, q) = (&self.normal, &other.normal);
        let cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let unknown = p[0].simd_eq(zero) & p[1].simd_eq(zero) & p[2].simd_eq(zero);
        let unknown = unknown & q[0].simd_eq(zero) & q[1].simd_eq(zero) & q[2].simd_eq(zero);
        near & (cosine.simd_ge(f32x16::splat(zero.simd, s.plane_normal)) | unknown) & !other_kind
    }
}

/// Numbers beside each other: rows that go on beyond their ends.
struct Padded {
    stride: usize,
    data: Vec<f32>,
}

impl Padded {
    /// `of(y, row)` writes the row itself.
    fn new(w: usize, h: usize, of: impl Fn(usize, &mut [f32]) + Sync + Send) -> Self {
        let stride = w.next_multiple_of(BLOCK) + 2 * PAD + BLOCK;
        let mut data = vec![0.0f32; stride * h];
        par::rows(&mut data, stride, |y, row| {
            of(y, &mut row[PAD..PAD + w]);
            let (first, last) = (row[PAD], row[PAD + w - 1]);
            row[..PAD].fill(first);
            row[PAD + w..].fill(last);
        });
        Self { stride, data }
    }

    #[inline(always)]
    fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.stride..][..self.stride]
    }
}

struct Job<'a> {
    f: &'a Features,
    lights: &'a [Asked],
    scale: f32,
    s: &'a Gather,
    surface: Surface,
}

impl Job<'_> {
    /// Luminance of each light.
    fn luminances(&self, samples: &Packed) -> Vec<Padded> {
        let (w, h, run) = (self.f.size.width, self.f.size.height, 3 * samples.planes);
        let of = |light: &Asked| {
            Padded::new(w, h, |y, row| {
                let of = |c: [f32; 3]| luminance(c).clamp(-MOST, MOST);
                if !samples.beyond.is_empty() {
                    (0..w).for_each(|x| row[x] = of(samples.at(light.first, y * w + x)));
                    return;
                }
                // Widened a row at once.
                let mut colours = vec![f16::ZERO; 3 * w];
                let pixels = samples.data[y * w * run..][..w * run].chunks_exact(run);
                for (x, pixel) in pixels.enumerate() {
                    for c in 0..3 {
                        colours[c * w + x] = pixel[c * samples.planes + light.first];
                    }
                }
                let mut floats = par::scratch(3 * w);
                colours.convert_to_f32_slice(&mut floats);
                for (x, out) in row.iter_mut().enumerate() {
                    *out = of([floats[x], floats[w + x], floats[2 * w + x]]);
                }
            })
        };
        self.lights.iter().map(of).collect()
    }

    /// 1 where a medium has light, where that is asked.
    fn medium(&self, media: &[usize], samples: &Packed) -> Option<Padded> {
        let (w, h) = (self.f.size.width, self.f.size.height);
        (!media.is_empty() && self.lights.iter().any(|light| light.behind)).then(|| {
            Padded::new(w, h, |y, row| {
                for (x, lit) in row.iter_mut().enumerate() {
                    let any = media.iter().any(|first| samples.at(*first, y * w + x) != [0.0; 3]);
                    *lit = if any { 1.0 } else { 0.0 };
                }
            })
        })
    }

    /// A row of means over 5x5 pixels, light by light, then of their deviations.
    #[inline(always)]
    fn near<S: Simd>(
        &self,
        simd: S,
        (light, lit): (&[Padded], &LitBlocks),
        medium: Option<&Padded>,
        y: usize,
        out: &mut [f32],
    ) {
        let (w, h, n) = (self.f.size.width, self.f.size.height, self.lights.len());
        let rows = y.saturating_sub(RADIUS as usize)..(y + RADIUS as usize + 1).min(h);
        let stride = light[0].stride;
        let mut noises = vec![[0.0f32; 2 * BLOCK]; n * w.div_ceil(BLOCK)];
        let mut column = par::scratch(stride);
        let lit_here = lit.within(rows.clone(), 0..w as isize);
        for (l, noises) in noises.chunks_exact_mut(w.div_ceil(BLOCK)).enumerate().filter(|(l, _)| lit_here.has(*l)) {
            least_noise(simd, &light[l], (y, h), &mut column, noises);
        }
        for x in (0..w).step_by(BLOCK) {
            let found = (rows.clone(), &noises[..]);
            let lit = lit.within(rows.clone(), x as isize - RADIUS..(x + BLOCK) as isize + RADIUS);
            if x < RADIUS as usize || x + BLOCK + RADIUS as usize > w {
                self.near_block::<true, _>(simd, (light, lit), medium, (x, y), found, out);
            } else {
                self.near_block::<false, _>(simd, (light, lit), medium, (x, y), found, out);
            }
        }
    }

    /// The part of a row from `x` on.
    #[inline(always)]
    fn near_block<const EDGE: bool, S: Simd>(
        &self,
        simd: S,
        (light, lit): (&[Padded], Lit),
        medium: Option<&Padded>,
        (x, y): (usize, usize),
        (rows, noises): (Range<usize>, &[[f32; 2 * BLOCK]]),
        out: &mut [f32],
    ) {
        let (w, n, s) = (self.f.size.width, self.lights.len(), self.s);
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        let surface = &self.surface;
        // What lies in the picture, and of that what shows the same surface.
        let mut there = [zero.simd_eq(zero); NEAR];
        let mut same = there;
        let here = Points::load::<EDGE>(simd, surface, w, y, x as isize);
        let mut starts = [0; NEAR];
        let (mut count, mut centre) = (0, 0);
        let mut medium_around = zero;
        // How many pixels that is, for lights that surfaces bound and for the others.
        let mut numbers = [zero; 2];
        for qy in rows.clone() {
            for dx in -RADIUS..=RADIUS {
                let at = x as isize + dx;
                starts[count] = qy * light[0].stride + (at + PAD as isize) as usize;
                if EDGE && !whole(at, w) {
                    let inside: f32x16<S> = inside(at, w).simd_into(simd);
                    there[count] = inside.simd_gt(zero);
                }
                same[count] = there[count];
                if qy != y || dx != 0 {
                    same[count] &= here.alike(&Points::load::<EDGE>(simd, surface, w, qy, at), s);
                } else {
                    centre = count;
                }
                if let Some(medium) = medium {
                    let here = load_within(simd, &medium.data, starts[count]);
                    medium_around = there[count].select(medium_around.max(here), medium_around);
                }
                numbers[0] += there[count].select(one, zero);
                numbers[1] += same[count].select(one, zero);
                count += 1;
            }
        }
        let medium = medium_around.simd_gt(zero);
        for (l, asked) in self.lights.iter().enumerate() {
            if !lit.has(l) {
                // What comes out below where the light is black.
                let deviation = if asked.behind { medium.select(zero, f32x16::splat(simd, FREE)) } else { zero };
                store(zero, &mut out[l * w..][..w], x);
                store(deviation, &mut out[(n + l) * w..][..w], x);
                continue;
            }
            let found = &noises[l * w.div_ceil(BLOCK) + x / BLOCK];
            let noise = f32x16::from_slice(simd, &found[..BLOCK]);
            let allowed = f32x16::from_slice(simd, &found[BLOCK..]) * s.mean_strong;
            let strong = (noise / (allowed * allowed + LEAST)).min_precise(f32x16::splat(simd, STRONGEST));
            // The spread of the pixels is noise as far as it is below this.
            let bound = noise * (strong * s.mean_few + s.mean_least);
            let t = noise * s.mean_pixels * (strong + 1.0);
            let data = &light[l].data;
            let own = load_within(simd, data, starts[centre]);
            let (mut first, mut squared, mut total, mut second) = (zero, zero, zero, zero);
            let (masks, number) = if asked.bounded { (&same, numbers[1]) } else { (&there, numbers[0]) };
            for (i, (start, mask)) in starts[..count].iter().zip(masks).enumerate() {
                let value = load_within(simd, data, *start);
                let difference = value - own;
                let mut weight = t / (t + difference * difference + LEAST);
                if i == centre {
                    weight = one;
                }
                let weight = mask.select(weight, zero);
                first += weight * value;
                squared += weight * weight;
                total += weight;
                second += weight * value * value;
            }
            let mean = first / total;
            let spread = (second / total - mean * mean).max_precise(zero) * number / (number - 1.0);
            // Of one value alone the deviation is the value.
            let several = number.simd_gt(one);
            let variance = several.select(spread.min_precise(bound) * squared / (total * total), mean * mean);
            let mut deviation = variance.sqrt() / self.scale;
            if asked.behind {
                deviation = medium.select(deviation, f32x16::splat(simd, FREE));
            }
            store(mean / self.scale, &mut out[l * w..][..w], x);
            store(deviation, &mut out[(n + l) * w..][..w], x);
        }
    }

    /// A channel of sixteen pixels of row `y` of [`Self::near`], from column `x` on.
    #[inline(always)]
    fn kept<const EDGE: bool, S: Simd>(&self, simd: S, near: &[f16], c: usize, (y, x): (usize, isize)) -> f32x16<S> {
        let w = self.f.size.width;
        let from = (2 * self.lights.len() * y + c) * w;
        if EDGE {
            load_halves::<true, _>(simd, &near[from..][..w], x)
        } else {
            load_halves_within(simd, near, from.wrapping_add_signed(x))
        }
    }

    /// A row of means of these windows side by side, light by light, then of their deviations.
    #[inline(always)]
    fn wide<S: Simd>(&self, simd: S, near: &[f16], y: usize, out: &mut [f32]) {
        const FAR: usize = (STEPS * WINDOW) as usize;
        let w = self.f.size.width;
        for x in (0..w).step_by(BLOCK) {
            if x < FAR || x + BLOCK + FAR > w {
                self.wide_block::<true, _>(simd, near, (x, y), out);
            } else {
                self.wide_block::<false, _>(simd, near, (x, y), out);
            }
        }
    }

    /// The part of a row from `x` on.
    #[inline(always)]
    fn wide_block<const EDGE: bool, S: Simd>(&self, simd: S, near: &[f16], (x, y): (usize, usize), out: &mut [f32]) {
        const MOST_WINDOWS: usize = ((2 * STEPS + 1) * (2 * STEPS + 1)) as usize;
        let (w, h, n, s) = (self.f.size.width, self.f.size.height, self.lights.len(), self.s);
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        let mut there = [zero.simd_eq(zero); MOST_WINDOWS];
        let mut same = there;
        let mut taps = [(0, 0); MOST_WINDOWS];
        let mut count = 0;
        // How many windows that is with the pixel's own, for lights that surfaces bound and for the others.
        let mut numbers = [one; 2];
        let here = Points::load::<EDGE>(simd, &self.surface, w, y, x as isize);
        for dy in -STEPS..=STEPS {
            let qy = y as isize + dy * WINDOW;
            if qy < 0 || qy >= h as isize {
                continue;
            }
            for dx in -STEPS..=STEPS {
                let at = x as isize + dx * WINDOW;
                if (dx, dy) == (0, 0) || (EDGE && (at + BLOCK as isize <= 0 || at >= w as isize)) {
                    continue;
                }
                if EDGE && !whole(at, w) {
                    let inside: f32x16<S> = inside(at, w).simd_into(simd);
                    there[count] = inside.simd_gt(zero);
                }
                let other = Points::load::<EDGE>(simd, &self.surface, w, qy as usize, at);
                same[count] = there[count] & here.alike(&other, s);
                taps[count] = (qy as usize, at);
                numbers[0] += there[count].select(one, zero);
                numbers[1] += same[count].select(one, zero);
                count += 1;
            }
        }
        // The deviations of the windows of a light.
        let mut others = [zero; MOST_WINDOWS];
        for (l, asked) in self.lights.iter().enumerate() {
            let (mean, known) = (
                self.kept::<EDGE, _>(simd, near, l, (y, x as isize)),
                self.kept::<EDGE, _>(simd, near, n + l, (y, x as isize)),
            );
            // Below 0: without noise.
            let noisy = known.simd_gt(zero);
            if !noisy.any_true() {
                store(mean, &mut out[l * w..][..w], x);
                store(known, &mut out[(n + l) * w..][..w], x);
                continue;
            }
            // Light without noise is compared like the rest.
            let deviation = known.max_precise(zero);
            let own = deviation * deviation;
            let (masks, number) = if asked.bounded { (&same, numbers[1]) } else { (&there, numbers[0]) };
            // The noise of a window alone is small where the window is dark by chance: that of all is surer.
            let mut pooled = own;
            for ((tap, mask), others) in taps[..count].iter().zip(masks).zip(&mut others) {
                *others = self.kept::<EDGE, _>(simd, near, n + l, *tap).max_precise(zero);
                pooled += mask.select(*others * *others, zero);
            }
            let t = pooled / number * (2.0 * s.mean_windows);
            let differ = t.simd_gt(zero);
            let (mut sum, mut variance, mut total) = (mean, own, one);
            for ((tap, mask), others) in taps[..count].iter().zip(masks).zip(&others) {
                let other = self.kept::<EDGE, _>(simd, near, l, *tap);
                let difference = other - mean;
                let share = (t - difference * difference).max_precise(zero) / t;
                let weight = (*mask & differ).select(share * share, zero);
                sum += weight * other;
                variance += weight * weight * *others * *others;
                total += weight;
            }
            store(noisy.select(sum / total, mean), &mut out[l * w..][..w], x);
            store(noisy.select(variance.sqrt() / total, known), &mut out[(n + l) * w..][..w], x);
        }
    }
}

/// The noise of pixels, sixteen after another: their variances over 5x5 pixels, then their means. The variance is that of second
/// differences along the direction in which they are least.
#[inline(always)]
fn least_noise<S: Simd>(
    simd: S,
    light: &Padded,
    (y, h): (usize, usize),
    column: &mut [f32],
    out: &mut [[f32; 2 * BLOCK]],
) {
    let zero = f32x16::splat(simd, 0.0);
    let rows: [&[f32]; 2 * PAD + 1] = std::array::from_fn(|k| light.row((y + k).saturating_sub(PAD).min(h - 1)));
    let number = ((2 * PAD - 1) * (2 * PAD - 1)) as f32;
    for found in out.iter_mut() {
        found[..BLOCK].fill(f32::MAX);
    }
    let last = out.len() * BLOCK + 2 * PAD;
    for (dx, dy) in [(1usize, 0isize), (0, 1), (1, 1), (1, -1)] {
        for x in (1..last - 1).step_by(BLOCK) {
            let mut sum = zero;
            for k in 1..2 * PAD {
                let (before, after) = (rows[(k as isize - dy) as usize], rows[(k as isize + dy) as usize]);
                let before = load::<false, _>(simd, before, (x - dx) as isize);
                let after = load::<false, _>(simd, after, (x + dx) as isize);
                let d = before - load::<false, _>(simd, rows[k], x as isize) * 2.0 + after;
                sum += d * d;
            }
            store(sum, column, x);
        }
        for (i, found) in out.iter_mut().enumerate() {
            let sum = five(simd, column, i * BLOCK + 1);
            let least = f32x16::from_slice(simd, &found[..BLOCK]).min_precise(sum);
            least.store_slice(&mut found[..BLOCK]);
        }
    }
    for x in (1..last - 1).step_by(BLOCK) {
        let mut sum = zero;
        for row in &rows[1..2 * PAD] {
            sum += load::<false, _>(simd, row, x as isize);
        }
        store(sum, column, x);
    }
    for (i, found) in out.iter_mut().enumerate() {
        let least = f32x16::from_slice(simd, &found[..BLOCK]) / (SECOND_DIFFERENCE * number);
        least.store_slice(&mut found[..BLOCK]);
        (five(simd, column, i * BLOCK + 1) / number).store_slice(&mut found[BLOCK..]);
    }
}

/// Sums of five values side by side, from column `x` on.
#[inline(always)]
fn five<S: Simd>(simd: S, column: &[f32], x: usize) -> f32x16<S> {
    let mut sum = load::<false, _>(simd, column, x as isize);
    for k in 1..2 * PAD - 1 {
        sum += load::<false, _>(simd, column, (x + k) as isize);
    }
    sum
}
