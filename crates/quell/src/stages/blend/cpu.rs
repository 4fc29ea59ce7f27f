//! Shares of the candidates, some rows of the picture at a time.

use super::statistics::{Known, PictureNoise};
use super::{
    ALONG, Blend, BlendFrame, GUIDES, INPUTS, NOISE_NEAR, READ, Steady, by_thresholds, drawn_back, guides,
    kernel::{self, RADIUS},
    net,
    outlier::{Limits, believed},
    shares, without_outlier,
};
use crate::frame::Rgb;
use crate::kernels::bands_cpu::{Band, around, bands, pool};
use crate::kernels::lanes::{BLOCK, load_within, store};
use crate::kernels::math::{lerp, three};
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Blend as Settings, Gather, Stabilise};
use crate::simd::{dispatch, widest};
use crate::window::{Features, Rows};
use fearless_simd::{Simd, f32x16, prelude::*};
use std::ops::Range;

/// As [`super::reference::run`].
pub(crate) fn run(
    window: &[BlendFrame<'_>],
    centre: usize,
    (steady, steady_alpha): Steady<'_>,
    (gather, stabilise): (&Gather, &Stabilise),
    s: &Settings,
) -> Blend {
    let here = &window[centre];
    let size = here.input.size();
    let (w, h) = (size.width, size.height);
    let mut said = None;
    let mut shares_of = Plane::filled(size, [0.0; 3]);
    let mut expected = Plane::filled(size, 0.0);
    let mut known = Plane::filled(size, Known::default());
    if s.net {
        let found = net().run(size, here.features.first_row, |rows| {
            let noise = PictureNoise::new(window, centre, steady, (gather, stabilise.nearer), rows.clone());
            let known = &mut known.data_mut()[rows.start * w..rows.end * w];
            par::rows(known, w, |y, known| {
                dispatch!(crate::simd::level(), simd => noise.known_row(simd, rows.start + y, s, known));
            });
            let around = mean_depth(here.features, &rows);
            Rows::written(Size::new(w, rows.len()), READ, |y, out| {
                let y = rows.start + y;
                dispatch!(crate::simd::level(), simd => read_row(simd, &noise, (here, steady), y, out));
                guides_row(here.features, around.row(y, 0), y, &mut out[(READ - GUIDES) * w..]);
            })
        });
        par::two_rows(shares_of.data_mut(), w, expected.data_mut(), w, |y, shares_of, expected| {
            widest!(shares_row(&found, known.row(y), y, s, shares_of, expected));
        });
        said = Some(found);
    } else {
        for rows in bands(h) {
            let noise = PictureNoise::new(window, centre, steady, (gather, stabilise.nearer), rows.clone());
            let pixels = rows.start * w..rows.end * w;
            let known = &mut known.data_mut()[pixels.clone()];
            par::rows(known, w, |y, known| {
                dispatch!(crate::simd::level(), simd => noise.known_row(simd, rows.start + y, s, known));
            });
            let (shares_of, expected) =
                (&mut shares_of.data_mut()[pixels.clone()], &mut expected.data_mut()[pixels.clone()]);
            par::two_rows(shares_of, w, expected, w, |y, shares_of, expected| {
                for x in 0..w {
                    let (pooled, _) = noise.at(x, rows.start + y);
                    let (share, error) = by_thresholds(&pooled, s);
                    (shares_of[x], expected[x]) = (share, error * pooled.noise(1) / 3.0);
                }
            });
        }
    }
    draw_back(&mut shares_of, (here, steady), &known, s);
    par::rows(shares_of.data_mut(), w, |y, row| {
        for (x, share) in row.iter_mut().enumerate() {
            let believed = believed(
                (window, centre),
                |frame| frame.input,
                (x, y),
                gather,
                Limits::new(stabilise, known.at(x, y).noise),
            );
            if believed < 1.0 {
                *share = without_outlier(*share, believed, s);
            }
        }
    });
    let noise = par::plane(size, |x, y| expected.at(x, y).sqrt() / known.at(x, y).inverse);
    let mut alpha = here
        .alpha
        .zip(steady_alpha)
        .map(|(own, steady)| par::plane(size, |x, y| lerp(own.at(x, y), steady.at(x, y), shares_of.at(x, y)[2])));
    let gain = said.filter(|_| s.kernel > 0.0).map(|said| {
        let mixture = par::plane(size, |x, y| {
            let [a, b, c] = shares_of.at(x, y);
            let (i, p, s) = (here.input.at(x, y), here.picture.at(x, y), steady.at(x, y));
            three(|k| a * i[k] + b * p[k] + c * s[k])
        });
        filtered(&mixture, &mut alpha, &said, &known, s)
    });
    Blend { shares: shares_of, gain, alpha, noise }
}

/// What the kernels multiply the mixture by; the coverage becomes what they make of it.
fn filtered(
    mixture: &Plane<Rgb>,
    alpha: &mut Option<Plane<f32>>,
    said: &Rows,
    known: &Plane<Known>,
    s: &Settings,
) -> Plane<Rgb> {
    let size = mixture.size();
    let (w, h) = (size.width, size.height);
    // What is added to the mixture, and to the coverage.
    let mut change = Plane::filled(size, [0.0; 4]);
    par::rows(change.data_mut(), w, |y, out| {
        dispatch!(crate::simd::level(), simd => change_row(simd, (mixture, alpha.as_ref()), said, y, s, out));
    });
    let squared = Band::filled(&(0..h), w, 1, |y, row| {
        for ((value, change), known) in row.iter_mut().zip(change.row(y)).zip(known.row(y)) {
            *value = (0..3).map(|c| change[c] * known.inverse).map(|d| d * d).sum();
        }
    });
    let difference = pool(&squared, &[0], NOISE_NEAR, &(0..h), h);
    par::rows(change.data_mut(), w, |y, row| {
        for ((change, known), difference) in row.iter_mut().zip(known.row(y)).zip(difference.row(y, 0)) {
            let kept = kernel::kept(*difference, known.noise, known.least_noise, s);
            // What is no number is kept by nobody.
            *change = if kept > 0.0 { change.map(|v| v * kept) } else { [0.0; 4] };
        }
    });
    if let Some(alpha) = alpha {
        for (alpha, change) in alpha.data_mut().iter_mut().zip(change.data()) {
            *alpha += change[3];
        }
    }
    par::plane(size, |x, y| {
        let [r, g, b, _] = change.at(x, y);
        kernel::gain(mixture.at(x, y), [r, g, b])
    })
}

/// What the kernels of a row change.
#[inline(always)]
fn change_row<S: Simd>(
    simd: S,
    (mixture, alpha): (&Plane<Rgb>, Option<&Plane<f32>>),
    said: &Rows,
    y: usize,
    s: &Settings,
    out: &mut [[f32; 4]],
) {
    const SIDE: usize = 2 * RADIUS + 1;
    let (w, h) = (mixture.size().width, mixture.size().height);
    let stride = w + 2 * RADIUS + BLOCK;
    // Of each line three channels and the coverage. Beyond the border the border counts; then room for the last sixteen.
    let mut around = par::unset_scratch(SIDE * 4 * stride);
    for (dy, lines) in around.chunks_exact_mut(4 * stride).enumerate() {
        let y = (y + dy).saturating_sub(RADIUS).min(h - 1);
        for (c, line) in lines.chunks_exact_mut(stride).enumerate() {
            match (c, alpha) {
                (3, Some(alpha)) => line[RADIUS..][..w].copy_from_slice(alpha.row(y)),
                (3, None) => line.fill(0.0),
                _ => line[RADIUS..].iter_mut().zip(mixture.row(y)).for_each(|(out, colour)| *out = colour[c]),
            }
            let ends = (line[RADIUS], line[RADIUS + w - 1]);
            line[..RADIUS].fill(ends.0);
            line[RADIUS + w..].fill(ends.1);
        }
    }
    let at = |dx: usize, dy: usize, c: usize, x: usize| load_within(simd, &around, (4 * dy + c) * stride + x + dx);
    let zero = f32x16::splat(simd, 0.0);
    for (block, out) in out.chunks_mut(BLOCK).enumerate() {
        let x = BLOCK * block;
        let weights = kernel::weight_lanes(simd, said, (x, y));
        let own = [at(RADIUS, RADIUS, 0, x), at(RADIUS, RADIUS, 1, x), at(RADIUS, RADIUS, 2, x)];
        let own_alpha = at(RADIUS, RADIUS, 3, x);
        let most = kernel::brightness_lanes(simd, &own) * s.kernel_contrast;
        let mut sums = [zero; 4];
        for dy in 0..SIDE {
            for dx in 0..SIDE {
                let other = [at(dx, dy, 0, x), at(dx, dy, 1, x), at(dx, dy, 2, x)];
                let bright = kernel::brightness_lanes(simd, &other);
                // As `limited`.
                let beyond = bright.simd_gt(most);
                let scale = most / bright;
                let weight = weights[SIDE * dy + dx];
                for c in 0..3 {
                    let other = beyond.select(other[c] * scale, other[c]);
                    sums[c] += weight * (other - own[c]);
                }
                if alpha.is_some() {
                    sums[3] += weight * (at(dx, dy, 3, x) - own_alpha);
                }
            }
        }
        let mut found = [[0.0; BLOCK]; 4];
        for c in 0..4 {
            sums[c].store_slice(&mut found[c]);
        }
        for (i, out) in out.iter_mut().enumerate() {
            *out = [found[0][i], found[1][i], found[2][i], found[3][i]];
        }
    }
}

/// The mean over 5x5 of 1 / depth.
fn mean_depth(features: &Features, rows: &Range<usize>) -> Band {
    let (w, h) = (features.size.width, features.size.height);
    let depth = Band::filled(&around(rows, NOISE_NEAR, h), w, 1, |y, out| {
        for (out, surface) in out.iter_mut().zip(&features.surface[y * w..][..w]) {
            *out = surface.inverse_depth;
        }
    });
    pool(&depth, &[0], NOISE_NEAR, rows, h)
}

/// Feature buffers of a row: [`guides`].
fn guides_row(features: &Features, around: &[f32], y: usize, out: &mut [f32]) {
    let w = around.len();
    for (x, around) in around.iter().enumerate() {
        for (c, value) in guides(features, y * w + x, *around).into_iter().enumerate() {
            out[c * w + x] = value;
        }
    }
}

/// What the net reads of every pixel, and the squared noise, for its training.
#[cfg(feature = "internals")]
pub(crate) fn read_by_net(
    window: &[BlendFrame<'_>],
    centre: usize,
    steady: &Plane<Rgb>,
    (gather, stabilise): (&Gather, &Stabilise),
) -> Plane<super::Read> {
    let here = &window[centre];
    let size = here.input.size();
    let noise = PictureNoise::new(window, centre, steady, (gather, stabilise.nearer), 0..size.height);
    let around = mean_depth(here.features, &(0..size.height));
    Plane::from_fn(size, |x, y| {
        let (pooled, inverse) = noise.at(x, y);
        let candidates = [here.input.at(x, y), here.picture.at(x, y), steady.at(x, y)];
        super::read(&pooled, candidates, inverse, (here.features, y * size.width + x, around.at(x, y, 0)))
    })
}

/// The statistics of every pixel, and its squared noise, for the training of `stabilise`'s net.
#[cfg(feature = "internals")]
pub(crate) fn inputs(
    window: &[BlendFrame<'_>],
    centre: usize,
    steady: &Plane<Rgb>,
    (gather, stabilise): (&Gather, &Stabilise),
) -> (Plane<super::Inputs>, Plane<f32>) {
    let here = &window[centre];
    let noise = PictureNoise::new(window, centre, steady, (gather, stabilise.nearer), 0..here.input.size().height);
    let size = here.input.size();
    let squared = |x, y| {
        let (pooled, inverse) = noise.at(x, y);
        pooled.noise(1) / (3.0 * inverse * inverse)
    };
    (Plane::from_fn(size, |x, y| noise.at(x, y).0.inputs()), Plane::from_fn(size, squared))
}

/// A row of what the net reads but for feature buffers: [`read`](super::read).
#[inline(always)]
fn read_row<S: Simd>(
    simd: S,
    noise: &PictureNoise,
    (here, steady): (&BlendFrame<'_>, &Plane<Rgb>),
    y: usize,
    out: &mut [f32],
) {
    let candidates = [here.input.row(y), here.picture.row(y), steady.row(y)];
    let w = candidates[0].len();
    for x in (0..w).step_by(BLOCK) {
        let (pooled, inverse) = noise.lanes(simd, (x, y));
        for k in 0..3 {
            let colours = &candidates[k][x..(x + BLOCK).min(w)];
            for c in 0..3 {
                let mut values = [0.0; BLOCK];
                for (value, colour) in values.iter_mut().zip(colours) {
                    *value = colour[c];
                }
                let v = f32x16::from_slice(simd, &values) * inverse;
                store(v / (v.abs() + 1.0), &mut out[(3 * k + c) * w..][..w], x);
            }
        }
        let inputs = pooled.inputs(simd);
        for c in 0..INPUTS {
            store(inputs[c], &mut out[(9 + c) * w..][..w], x);
        }
        let along = pooled.along_edges(simd);
        for c in 0..ALONG {
            store(along[c], &mut out[(9 + INPUTS + c) * w..][..w], x);
        }
    }
}

#[inline(always)]
fn shares_row(said: &Rows, known: &[Known], y: usize, s: &Settings, shares_of: &mut [[f32; 3]], expected: &mut [f32]) {
    for (x, known) in known.iter().enumerate() {
        let (share, error) = shares([0, 1, 2, 3].map(|c| said.at(x, y, c)), s.strength);
        shares_of[x] = share;
        expected[x] = error * known.noise / 3.0;
    }
}

fn draw_back(
    shares: &mut Plane<[f32; 3]>,
    (here, steady): (&BlendFrame<'_>, &Plane<Rgb>),
    known: &Plane<Known>,
    s: &Settings,
) {
    let size = shares.size();
    let (w, h) = (size.width, size.height);
    let squared = Band::filled(&(0..h), w, 1, |y, row| {
        for (x, value) in row.iter_mut().enumerate() {
            let [_, wavelet, steadied] = shares.at(x, y);
            let (i, p, s) = (here.input.at(x, y), here.picture.at(x, y), steady.at(x, y));
            let scale = known.at(x, y).inverse;
            *value = (0..3)
                .map(|c| wavelet * ((i[c] - p[c]) * scale) + steadied * ((i[c] - s[c]) * scale))
                .map(|d| d * d)
                .sum();
        }
    });
    let difference = pool(&squared, &[0], NOISE_NEAR, &(0..h), h);
    par::rows(shares.data_mut(), w, |y, row| {
        for ((share, known), difference) in row.iter_mut().zip(known.row(y)).zip(difference.row(y, 0)) {
            let kept = drawn_back(*difference, known.least_noise, s);
            let [_, wavelet, steady] = share.map(|v| v * kept);
            *share = [1.0 - (wavelet + steady), wavelet, steady];
        }
    });
}
