//! Shares of the candidates, some rows of the picture at a time: windows are sums over columns of sums over rows, sixteen pixels of a
//! row at once.

use super::{
    ALONG, Blend, BlendFrame, DIRECTIONS, FRAMES, GUIDES, HIGH_PASS, INPUTS, LEAST, LEAST_BRIGHTNESS, LEAST_SEEN,
    MOST_CHANGE, MOST_RATIO, NEAR, NOISE_NEAR, NOISE_WIDE, Pooled, READ, SECOND_DIFFERENCE, Steady, WIDE,
    by_thresholds, drawn_back, follow, guides,
    kernel::{self, RADIUS},
    net,
    outlier::{Limits, believed},
    shares, without_outlier,
};
use crate::frame::Rgb;
use crate::kernels::lanes::{BLOCK, load, load_within, log2, store};
use crate::kernels::math::{lerp, three};
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Blend as Settings, Gather, Stabilise};
use crate::simd::dispatch;
use crate::simd::widest;
use crate::window::{Features, Rows};
use fearless_simd::{Simd, f32x16, prelude::*};
use std::ops::Range;

/// Rows whose statistics are found at once: those of a whole picture take 300 bytes a pixel. Few in tests, so that small pictures have some.
const BAND: usize = if cfg!(test) { 16 } else { 128 };

/// Of a band.
const ROWS_OF_A_THREAD: usize = if cfg!(test) { 0 } else { 16 };

/// All rows of a picture, some at a time.
pub(crate) fn bands(height: usize) -> impl Iterator<Item = Range<usize>> {
    let band = par::band(BAND, ROWS_OF_A_THREAD);
    (0..height).step_by(band).map(move |y| y..(y + band).min(height))
}

/// These rows and those that lie around them in the picture.
pub(crate) fn around(rows: &Range<usize>, radius: usize, height: usize) -> Range<usize> {
    rows.start.saturating_sub(radius)..(rows.end + radius).min(height)
}

/// Some rows of an image, which count as they do in the picture.
pub(crate) struct Band {
    first: usize,
    rows: Rows,
}

impl Band {
    /// Made row by row: `f(y, all channels of the row one after the other)`; a row is 0 before.
    pub(crate) fn filled(
        rows: &Range<usize>,
        width: usize,
        channels: usize,
        f: impl Fn(usize, &mut [f32]) + Sync + Send,
    ) -> Self {
        let first = rows.start;
        Self { first, rows: Rows::made(Size::new(width, rows.len()), channels, |y, row| f(first + y, row)) }
    }

    fn width(&self) -> usize {
        self.rows.size().width
    }

    #[inline(always)]
    pub(crate) fn row(&self, y: usize, c: usize) -> &[f32] {
        self.rows.row(y - self.first, c)
    }

    /// Channel `c` of sixteen pixels of a row; beyond its end 0.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, (x, y): (usize, usize), c: usize) -> f32x16<S> {
        load::<true, _>(simd, self.row(y, c), x as isize)
    }

    /// All channels of row `y`, one after the other.
    #[inline(always)]
    pub(crate) fn channels(&self, y: usize) -> &[f32] {
        let length = self.rows.channels() * self.width();
        &self.rows.data()[(y - self.first) * length..][..length]
    }

    #[inline(always)]
    fn at(&self, x: usize, y: usize, c: usize) -> f32 {
        self.row(y, c)[x]
    }

    /// Three channels from `first` on at a pixel.
    #[inline(always)]
    pub(crate) fn colour(&self, x: usize, y: usize, first: usize) -> Rgb {
        three(|c| self.at(x, y, first + c))
    }
}

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
            Rows::made(Size::new(w, rows.len()), READ, |y, out| {
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
        widest!(change_row((mixture, alpha.as_ref()), said, y, s, out));
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
fn change_row(
    (mixture, alpha): (&Plane<Rgb>, Option<&Plane<f32>>),
    said: &Rows,
    y: usize,
    s: &Settings,
    out: &mut [[f32; 4]],
) {
    let (w, h) = (mixture.size().width, mixture.size().height);
    // Beyond the border the border counts.
    let lines: [_; 2 * RADIUS + 1] = std::array::from_fn(|dy| (y + dy).saturating_sub(RADIUS).min(h - 1));
    for (x, out) in out.iter_mut().enumerate() {
        let weights = kernel::weights(std::array::from_fn(|k| said.at(x, y, 4 + k)));
        let own = mixture.at(x, y);
        let brightness = kernel::brightness(own);
        let own_alpha = alpha.map_or(0.0, |alpha| alpha.at(x, y));
        *out = [0.0; 4];
        for (line, weights) in lines.iter().zip(weights.as_chunks::<{ 2 * RADIUS + 1 }>().0) {
            for (dx, weight) in weights.iter().enumerate() {
                let x = (x + dx).saturating_sub(RADIUS).min(w - 1);
                let other = kernel::limited(mixture.at(x, *line), brightness, s);
                for c in 0..3 {
                    out[c] += weight * (other[c] - own[c]);
                }
                if let Some(alpha) = alpha {
                    out[3] += weight * (alpha.at(x, *line) - own_alpha);
                }
            }
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

/// What is kept of a pixel's statistics until the net has spoken.
#[derive(Clone, Copy, Default)]
struct Known {
    /// One over the brightness around.
    inverse: f32,
    /// See [`Pooled`].
    noise: f32,
    least_noise: f32,
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

/// What is known of the noise of a frame's input, from its difference to filtered pictures; of some rows.
pub(crate) struct PictureNoise {
    inverse: Band,
    stats: Statistics,
    /// 1 where something stands in front within 3x3, else 0.
    silhouettes: Band,
}

impl PictureNoise {
    /// `steady`: another filtered picture, or again the wavelet's. `nearer`: that of `stabilise`.
    pub(crate) fn new(
        window: &[BlendFrame<'_>],
        centre: usize,
        steady: &Plane<Rgb>,
        (gather, nearer): (&Gather, f32),
        rows: Range<usize>,
    ) -> Self {
        let here = &window[centre];
        let size = here.input.size();
        let w = size.width;
        // Windows of squares, which look at the rows beside them.
        let squared = around(&rows, NOISE_WIDE, size.height);
        let differing = around(&squared, 1, size.height);
        let inverse = inverse_brightness(here.picture, steady, &differing);
        let found = here.along.is_none().then(|| {
            Band::filled(&differing, w, ALONG_CHANNELS, |y, out| widest!(along_row((window, centre), gather, y, out)))
        });
        let differences = Band::filled(&differing, w, DIFFERENCES, |y, out| {
            let along = match (here.along, &found) {
                (Some(whole), _) => &whole.data()[whole.start(y, 0)..][..ALONG_CHANNELS * w],
                (None, Some(band)) => band.channels(y),
                (None, None) => return,
            };
            widest!(differences_row((here, steady), inverse.row(y, 0), along, y, out));
        });
        let apart = Apart::new(here, steady, &differences, &differing);
        let squares = Band::filled(&squared, w, SQUARES, |y, out| {
            dispatch!(crate::simd::level(), simd => apart.squares_row(simd, &differences, inverse.row(y, 0), y, out));
        });
        drop(apart);
        let silhouettes = silhouettes(here.features, nearer, &rows);
        let stats = Statistics::new(&differences, &squares, rows, size.height);
        Self { inverse, stats, silhouettes }
    }

    /// What is known at a pixel, and one over the brightness that it is relative to.
    pub(crate) fn at(&self, x: usize, y: usize) -> (Pooled, f32) {
        (self.stats.at(x, y, self.silhouettes.at(x, y, 0) > 0.0), self.inverse.at(x, y, 0))
    }

    /// [`Self::at`] for sixteen pixels from column `x` on. Beyond the end of the row all is 0.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(&self, simd: S, (x, y): (usize, usize)) -> (PooledLanes<S>, f32x16<S>) {
        let silhouette = self.silhouettes.lanes(simd, (x, y), 0);
        let inverse = self.inverse.lanes(simd, (x, y), 0);
        (self.stats.lanes(simd, (x, y), silhouette), inverse)
    }

    /// One over the brightness around a pixel.
    #[cfg(feature = "internals")]
    pub(crate) fn inverse(&self, x: usize, y: usize) -> f32 {
        self.inverse.at(x, y, 0)
    }

    #[inline(always)]
    fn known_row<S: Simd>(&self, simd: S, y: usize, s: &Settings, out: &mut [Known]) {
        let mut x = 0;
        for out in out.chunks_mut(BLOCK) {
            let (pooled, inverse) = self.lanes(simd, (x, y));
            let inverse: [f32; BLOCK] = inverse.into();
            let noise: [f32; BLOCK] = pooled.noise(simd, 1).into();
            let least_noise: [f32; BLOCK] = pooled.least_noise(simd, s).into();
            for (i, out) in out.iter_mut().enumerate() {
                *out = Known { inverse: inverse[i], noise: noise[i], least_noise: least_noise[i] };
            }
            x += BLOCK;
        }
    }
}

/// 1 where something stands in front within 3x3, else 0: [`silhouette`](super::silhouette) of these rows.
fn silhouettes(features: &Features, nearer: f32, rows: &Range<usize>) -> Band {
    let (w, h) = (features.size.width, features.size.height);
    // Of a pixel more at either end, and room for the last sixteen. Beyond the border the border counts: what is nearer in 3x3 stays so.
    let depths = Band::filled(&around(rows, 1, h), w + 2 + BLOCK, 1, |y, out| {
        for (out, surface) in out[1..=w].iter_mut().zip(&features.surface[y * w..][..w]) {
            *out = surface.inverse_depth;
        }
        (out[0], out[w + 1]) = (out[1], out[w]);
    });
    Band::filled(rows, w, 1, |y, out| {
        let lines = [y.saturating_sub(1), y, (y + 1).min(h - 1)].map(|y| depths.row(y, 0));
        dispatch!(crate::simd::level(), simd => silhouettes_row(simd, &lines, nearer, out));
    })
}

#[inline(always)]
fn silhouettes_row<S: Simd>(simd: S, lines: &[&[f32]; 3], nearer: f32, out: &mut [f32]) {
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    for x in (0..out.len()).step_by(BLOCK) {
        let own = load::<false, _>(simd, lines[1], x as isize + 1);
        let limit = own * nearer;
        let mut found = zero;
        for dy in 0..3 {
            for dx in 0..3 {
                let other = load::<false, _>(simd, lines[dy], (x + dx) as isize);
                let apart = other.simd_gt(limit) | own.simd_gt(other * nearer);
                found = apart.select(one, found);
            }
        }
        store(found, out, x);
    }
}

/// One over the brightness around a pixel: the mean over 5x5 of both filtered pictures.
fn inverse_brightness(picture: &Plane<Rgb>, steady: &Plane<Rgb>, rows: &Range<usize>) -> Band {
    let (w, h) = (picture.size().width, picture.size().height);
    let both = Band::filled(&around(rows, NOISE_NEAR, h), w, 1, |y, row| {
        for ((value, a), b) in row.iter_mut().zip(picture.row(y)).zip(steady.row(y)) {
            *value = (a[0] + a[1] + a[2] + b[0] + b[1] + b[2]) / 6.0;
        }
    });
    let mut mean = pool(&both, &[0], NOISE_NEAR, rows, h);
    for value in mean.rows.data_mut() {
        *value = 1.0 / (value.max(0.0) + LEAST_BRIGHTNESS);
    }
    mean
}

/// Three channels each: input less wavelet, input less stabilised, input less wavelet averaged over time; then the
/// squared changes over time and the share of neighbours seen.
const DIFFERENCES: usize = 11;

/// `along`: the row of [`along_row`].
#[inline(always)]
fn differences_row(
    (here, steady): (&BlendFrame<'_>, &Plane<Rgb>),
    inverse: &[f32],
    along: &[f32],
    y: usize,
    out: &mut [f32],
) {
    let w = inverse.len();
    let (input, picture, steady) = (here.input.row(y), here.picture.row(y), steady.row(y));
    let (changes, seen) = (&along[ALONG_CHANGES * w..][..w], &along[ALONG_SEEN * w..][..w]);
    for c in 0..3 {
        let own = &mut out[c * w..];
        for x in 0..w {
            own[x] = (input[x][c] - picture[x][c]) * inverse[x];
        }
        for x in 0..w {
            own[3 * w + x] = (input[x][c] - steady[x][c]) * inverse[x];
        }
        let sums = &along[c * w..][..w];
        for x in 0..w {
            own[6 * w + x] = sums[x] * inverse[x] / (1.0 + seen[x]);
        }
    }
    let all = (2 * FRAMES) as f32;
    for x in 0..w {
        out[9 * w + x] = changes[x] * inverse[x] * inverse[x] / all;
    }
    for x in 0..w {
        out[10 * w + x] = seen[x] / all;
    }
}

/// Of a pixel the three sums of [`over_time`], then the changes and the frames that show it.
const ALONG_CHANGES: usize = 3;
const ALONG_SEEN: usize = 4;
const ALONG_CHANNELS: usize = 5;

/// What the trajectories of `window[centre]` show of its noise: [`ALONG_CHANNELS`] a pixel. `stabilise` and `blend` both ask for it, and
/// following them costs more than what is done with it.
pub(crate) fn along(window: &[BlendFrame<'_>], centre: usize, gather: &Gather) -> Rows {
    Rows::written(window[centre].input.size(), ALONG_CHANNELS, |y, out| {
        widest!(along_row((window, centre), gather, y, out));
    })
}

#[inline(always)]
fn along_row((window, centre): (&[BlendFrame<'_>], usize), gather: &Gather, y: usize, out: &mut [f32]) {
    let here = &window[centre];
    let w = here.input.size().width;
    for (x, (i, p)) in here.input.row(y).iter().zip(here.picture.row(y)).enumerate() {
        let (sum, change, seen) = over_time(window, centre, (x, y), three(|c| i[c] - p[c]), gather);
        for (c, value) in [sum[0], sum[1], sum[2], change, seen].into_iter().enumerate() {
            out[c * w + x] = value;
        }
    }
}

/// Sum of the differences `e` of input and wavelet's picture along the pixel's trajectory, half the sum of their squared changes, and the
/// frames that show it.
#[inline(always)]
fn over_time(
    window: &[BlendFrame<'_>],
    centre: usize,
    (x, y): (usize, usize),
    e: Rgb,
    gather: &Gather,
) -> (Rgb, f32, f32) {
    let here = &window[centre];
    let w = here.features.size.width;
    let p = y * w + x;
    let reflected = here.features.is_mirror(p);
    let origin = [x as f32, (here.features.first_row + y) as f32];
    let farthest = gather.travel * here.features.picture_height as f32;
    let brightness = |c: Rgb| c[0] + c[1] + c[2] + LEAST_BRIGHTNESS;
    let own = brightness(here.picture.data()[p]);
    let (mut sum, mut change, mut seen) = (e, 0.0f32, 0.0f32);
    for forward in [false, true] {
        if forward && !gather.future {
            continue;
        }
        let ahead = if forward { window.len() - 1 - centre } else { centre };
        let (mut at, mut q) = (origin, p);
        for k in 1..=ahead.min(FRAMES) {
            let (from, to) = if forward { (centre + k - 1, centre + k) } else { (centre + 1 - k, centre - k) };
            let other = &window[to];
            let Some(there) = follow(window[from].features, other.features, forward, reflected, (&mut at, q)) else {
                break;
            };
            if (at[1] - origin[1]).abs() > farthest {
                break;
            }
            q = there;
            let (i, f) = (other.input.data()[q], other.picture.data()[q]);
            let ratio = (own / brightness(f)).clamp(1.0 / MOST_CHANGE, MOST_CHANGE);
            for c in 0..3 {
                let d = (i[c] - f[c]) * ratio;
                sum[c] += d;
                change += 0.5 * (e[c] - d) * (e[c] - d);
            }
            seen += 1.0;
        }
    }
    (sum, change, seen)
}

/// Squared, relative to the brightness: noise over space; input to wavelet, input to stabilised, wavelet to stabilised; detail
/// of the stabilised picture and of the wavelet's; changes of the input over space; second
/// differences along four directions, of the input and of input less wavelet.
const SQUARES: usize = 15;

/// Three channels each: the stabilised picture, the wavelet's, the input, and input less wavelet relative to the brightness. Each
/// row begins and ends with its border once more, and has room for the last sixteen pixels.
struct Apart(Band);

impl Apart {
    fn new(here: &BlendFrame<'_>, steady: &Plane<Rgb>, differences: &Band, rows: &Range<usize>) -> Self {
        let w = here.input.size().width;
        let stride = w + 2 + BLOCK;
        Self(Band::filled(rows, stride, 12, |y, out| {
            for (k, picture) in [steady, here.picture, here.input].into_iter().enumerate() {
                for (x, colour) in picture.row(y).iter().enumerate() {
                    for c in 0..3 {
                        out[(3 * k + c) * stride + 1 + x] = colour[c];
                    }
                }
            }
            for (c, out) in out.chunks_exact_mut(stride).enumerate() {
                if c >= 9 {
                    out[1..=w].copy_from_slice(differences.row(y, c - 9));
                }
                out[0] = out[1];
                out[w + 1] = out[w];
            }
        }))
    }

    /// A row of [`SQUARES`].
    #[inline(always)]
    fn squares_row<S: Simd>(&self, simd: S, differences: &Band, inverse: &[f32], y: usize, out: &mut [f32]) {
        let w = inverse.len();
        let last = self.0.first + self.0.rows.size().height - 1;
        // Beyond the picture its border counts.
        let lines = [y.max(self.0.first + 1) - 1, y, (y + 1).min(last)];
        let near = Near {
            rows: [self.0.channels(lines[0]), self.0.channels(lines[1]), self.0.channels(lines[2])],
            stride: self.0.width(),
        };
        for x in (0..w).step_by(BLOCK) {
            let scale = load::<true, _>(simd, inverse, x as isize);
            let mut sums = [f32x16::splat(simd, 0.0); SQUARES];
            for c in 0..3 {
                let e = near.at(simd, 9 + c, x, [0, 0]);
                let f = differences.lanes(simd, (x, y), 3 + c);
                sums[1] += e * e;
                sums[2] += f * f;
                sums[3] += (e - f) * (e - f);
                let d = near.detail(simd, 9 + c, x);
                sums[0] += d * d / HIGH_PASS;
                let d = near.detail(simd, c, x);
                sums[4] += d * d * scale * scale;
                let d = near.detail(simd, 3 + c, x);
                sums[5] += d * d * scale * scale;
                let d = near.detail(simd, 6 + c, x);
                sums[6] += d * d * scale * scale / HIGH_PASS;
                for k in 0..DIRECTIONS.len() {
                    let input = near.bend(simd, 6 + c, x, DIRECTIONS[k]) * scale;
                    let difference = near.bend(simd, 9 + c, x, DIRECTIONS[k]);
                    sums[7 + k] += input * input / SECOND_DIFFERENCE;
                    sums[11 + k] += difference * difference / SECOND_DIFFERENCE;
                }
            }
            for k in 0..SQUARES {
                store(sums[k], &mut out[k * w..][..w], x);
            }
        }
    }
}

/// Three rows of [`Apart`], all channels one after the other.
struct Near<'a> {
    rows: [&'a [f32]; 3],
    stride: usize,
}

impl Near<'_> {
    /// Channel `c` of the pixels beside sixteen from column `x` on.
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, c: usize, x: usize, [dx, dy]: [isize; 2]) -> f32x16<S> {
        load_within(simd, self.rows[(1 + dy) as usize], c * self.stride + x + (1 + dx) as usize)
    }

    /// What a binomial 3x3 takes away.
    #[inline(always)]
    fn detail<S: Simd>(&self, simd: S, c: usize, x: usize) -> f32x16<S> {
        let above = self.across(simd, c, x, -1);
        let here = self.across(simd, c, x, 0);
        let below = self.across(simd, c, x, 1);
        self.at(simd, c, x, [0, 0]) - (above * 0.25 + here * 0.5 + below * 0.25)
    }

    #[inline(always)]
    fn across<S: Simd>(&self, simd: S, c: usize, x: usize, dy: isize) -> f32x16<S> {
        self.at(simd, c, x, [-1, dy]) * 0.25 + self.at(simd, c, x, [0, dy]) * 0.5 + self.at(simd, c, x, [1, dy]) * 0.25
    }

    /// The second difference along a direction.
    #[inline(always)]
    fn bend<S: Simd>(&self, simd: S, c: usize, x: usize, [dx, dy]: [isize; 2]) -> f32x16<S> {
        self.at(simd, c, x, [-dx, -dy]) - self.at(simd, c, x, [0, 0]) * 2.0 + self.at(simd, c, x, [dx, dy])
    }
}

/// Means over windows.
struct Statistics {
    /// Of the three differences, near.
    means: Band,
    /// Changes over time and neighbours seen, near and wide.
    time: [Band; 2],
    /// Noise over space, and changes of the input, near and wide.
    space: [Band; 2],
    /// Squared differences and details, near; differences, wide.
    near: Band,
    wide: Band,
    /// Second differences along the direction in which they are least, of the input and of input less wavelet.
    along: Band,
}

impl Statistics {
    fn new(differences: &Band, squares: &Band, rows: Range<usize>, height: usize) -> Self {
        let of = |band: &Band, channels: &[usize], radius: usize| pool(band, channels, radius, &rows, height);
        let along = of(squares, &[7, 8, 9, 10, 11, 12, 13, 14], NOISE_NEAR);
        let w = along.width();
        Self {
            means: of(differences, &[0, 1, 2, 3, 4, 5, 6, 7, 8], NOISE_NEAR),
            time: [NOISE_NEAR, NOISE_WIDE].map(|r| of(differences, &[9, 10], r)),
            space: [NOISE_NEAR, NOISE_WIDE].map(|r| of(squares, &[0, 6], r)),
            near: of(squares, &[1, 2, 3, 4, 5], NEAR),
            wide: of(squares, &[1, 2, 3], WIDE),
            along: Band::filled(&rows, w, 2, |y, out| {
                out.fill(f32::MAX);
                for (k, out) in out.chunks_exact_mut(w).enumerate() {
                    for c in 4 * k..4 * k + 4 {
                        out.iter_mut().zip(along.row(y, c)).for_each(|(least, value)| *least = least.min(*value));
                    }
                }
            }),
        }
    }

    /// [`Self::at`] for sixteen pixels from column `x` on.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, (x, y): (usize, usize), silhouette: f32x16<S>) -> PooledLanes<S> {
        let at = (x, y);
        let [near, far] = &self.time;
        let [space, far_space] = &self.space;
        let (close, wide) = (&self.near, &self.wide);
        let mut mean = [f32x16::splat(simd, 0.0); 3];
        for k in 0..3 {
            let a = self.means.lanes(simd, at, 3 * k);
            let b = self.means.lanes(simd, at, 3 * k + 1);
            let c = self.means.lanes(simd, at, 3 * k + 2);
            mean[k] = a * a + b * b + c * c;
        }
        PooledLanes {
            over_time: [near.lanes(simd, at, 0), far.lanes(simd, at, 0)],
            seen: [near.lanes(simd, at, 1), far.lanes(simd, at, 1)],
            over_space: [space.lanes(simd, at, 0), far_space.lanes(simd, at, 0)],
            input: [space.lanes(simd, at, 1), far_space.lanes(simd, at, 1)],
            along: [self.along.lanes(simd, at, 0), self.along.lanes(simd, at, 1)],
            apart: [
                close.lanes(simd, at, 0),
                close.lanes(simd, at, 1),
                close.lanes(simd, at, 2),
                wide.lanes(simd, at, 0),
                wide.lanes(simd, at, 1),
                wide.lanes(simd, at, 2),
            ],
            detail: [close.lanes(simd, at, 3), close.lanes(simd, at, 4)],
            mean,
            silhouette,
        }
    }

    fn at(&self, x: usize, y: usize, silhouette: bool) -> Pooled {
        let mean = |k: usize| (0..3).map(|c| self.means.at(x, y, 3 * k + c)).map(|v| v * v).sum::<f32>();
        let [near, wide] = [&self.near, &self.wide].map(|rows| [0, 1, 2].map(|k| rows.at(x, y, k)));
        Pooled {
            over_time: [0, 1].map(|k| self.time[k].at(x, y, 0)),
            seen: [0, 1].map(|k| self.time[k].at(x, y, 1)),
            over_space: [0, 1].map(|k| self.space[k].at(x, y, 0)),
            input: [0, 1].map(|k| self.space[k].at(x, y, 1)),
            along: [0, 1].map(|k| self.along.at(x, y, k)),
            apart: [near[0], near[1], near[2], wide[0], wide[1], wide[2]],
            detail: [self.near.at(x, y, 3), self.near.at(x, y, 4)],
            mean: [mean(0), mean(1), mean(2)],
            silhouette,
        }
    }
}

/// [`Pooled`] of sixteen pixels. What is no number counts as it does there.
#[derive(Clone, Copy)]
pub(crate) struct PooledLanes<S: Simd> {
    over_time: [f32x16<S>; 2],
    seen: [f32x16<S>; 2],
    over_space: [f32x16<S>; 2],
    input: [f32x16<S>; 2],
    along: [f32x16<S>; 2],
    apart: [f32x16<S>; 6],
    pub detail: [f32x16<S>; 2],
    mean: [f32x16<S>; 3],
    silhouette: f32x16<S>,
}

impl<S: Simd> PooledLanes<S> {
    /// [`Pooled::noise`].
    #[inline(always)]
    pub(crate) fn noise(&self, simd: S, wide: usize) -> f32x16<S> {
        let space = self.over_space[wide].min_precise(self.input[wide]);
        let time = (self.over_time[wide] / self.seen[wide]).min_precise(space);
        let known = self.seen[wide].simd_gt(f32x16::splat(simd, LEAST_SEEN));
        known.select(time, space).max_precise(f32x16::splat(simd, LEAST))
    }

    /// [`Pooled::least_noise`].
    #[inline(always)]
    fn least_noise(&self, simd: S, s: &Settings) -> f32x16<S> {
        let [input, removed] = self.along;
        let input = input.min_precise(self.input[0]);
        let noise = self.noise(simd, 0).min_precise(removed).max_precise(input * s.guard_input);
        noise.min_precise(input).max_precise(f32x16::splat(simd, LEAST))
    }

    /// [`Pooled::along_edges`].
    #[inline(always)]
    fn along_edges(&self, simd: S) -> [f32x16<S>; ALONG] {
        let of_noise = log2(simd, self.noise(simd, 1));
        [ratio(simd, self.along[0], of_noise), ratio(simd, self.along[1], of_noise)]
    }

    /// [`Pooled::inputs`].
    #[inline(always)]
    pub(crate) fn inputs(&self, simd: S) -> [f32x16<S>; INPUTS] {
        let of_noise = log2(simd, self.noise(simd, 1));
        let least = f32x16::splat(simd, LEAST_SEEN);
        let mut time = self.over_space;
        for k in 0..2 {
            time[k] = self.seen[k].simd_gt(least).select(self.over_time[k] / self.seen[k], time[k]);
        }
        [
            ratio(simd, time[0], of_noise),
            ratio(simd, time[1], of_noise),
            ratio(simd, self.over_space[0], of_noise),
            ratio(simd, self.over_space[1], of_noise),
            ratio(simd, self.apart[0], of_noise),
            ratio(simd, self.apart[1], of_noise),
            ratio(simd, self.apart[2], of_noise),
            ratio(simd, self.apart[3], of_noise),
            ratio(simd, self.apart[4], of_noise),
            ratio(simd, self.apart[5], of_noise),
            ratio(simd, self.detail[0], of_noise),
            ratio(simd, self.detail[1], of_noise),
            ratio(simd, self.mean[0], of_noise),
            ratio(simd, self.mean[1], of_noise),
            ratio(simd, self.mean[2], of_noise),
            self.seen[0],
            self.silhouette,
        ]
    }
}

/// The logarithm of a ratio to the noise, whose logarithm is `of_noise`.
#[inline(always)]
fn ratio<S: Simd>(simd: S, v: f32x16<S>, of_noise: f32x16<S>) -> f32x16<S> {
    let most = f32x16::splat(simd, MOST_RATIO);
    let found = log2(simd, v.max_precise(f32x16::splat(simd, LEAST))) - of_noise;
    found.max(-most).min(most)
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

/// Means of some channels over windows of 2 `radius` + 1 pixels, of what lies in the picture, for these rows. `from` holds those around them.
fn pool(from: &Band, channels: &[usize], radius: usize, rows: &Range<usize>, height: usize) -> Band {
    let (w, n) = (from.width(), channels.len());
    let across = Band::filled(&around(rows, radius, height), w, n, |y, out| {
        for (c, out) in channels.iter().zip(out.chunks_exact_mut(w)) {
            dispatch!(crate::simd::level(), simd => means_across(simd, from.row(y, *c), radius, out));
        }
    });
    Band::filled(rows, w, n, |y, out| {
        let window = around(&(y..y + 1), radius, height);
        let lines = &across.rows.data()[(window.start - across.first) * n * w..][..window.len() * n * w];
        dispatch!(crate::simd::level(), simd => means_of(simd, lines, window.len(), out));
    })
}

/// Means over 2 `radius` + 1 pixels of a row, of those that there are.
#[inline(always)]
fn means_across<S: Simd>(simd: S, row: &[f32], radius: usize, out: &mut [f32]) {
    let (w, r) = (row.len(), radius as isize);
    for at in (0..w).step_by(BLOCK) {
        let x = at as isize;
        // Known to the compiler, a window is summed without a loop, and its bounds are looked at once.
        let found = match radius {
            NEAR => whole_window::<NEAR, _>(simd, row, at),
            NOISE_NEAR => whole_window::<NOISE_NEAR, _>(simd, row, at),
            WIDE => whole_window::<WIDE, _>(simd, row, at),
            NOISE_WIDE => whole_window::<NOISE_WIDE, _>(simd, row, at),
            _ => None,
        };
        if let Some(mean) = found {
            store(mean, out, at);
        } else {
            let mut sum = f32x16::splat(simd, 0.0);
            for dx in -r..=r {
                sum += load::<true, _>(simd, row, x + dx);
            }
            let mut number = [1.0; BLOCK];
            for (i, number) in number.iter_mut().enumerate().take(w - at) {
                *number = ((at + i + radius + 1).min(w) - (at + i).saturating_sub(radius)) as f32;
            }
            let number: f32x16<S> = number.simd_into(simd);
            store(sum / number, out, at);
        }
    }
}

/// Means over windows of 2 `R` + 1 pixels around sixteen, where all of them lie in the row.
#[inline(always)]
fn whole_window<const R: usize, S: Simd>(simd: S, row: &[f32], at: usize) -> Option<f32x16<S>> {
    let run = row.get(at.checked_sub(R)?..at + BLOCK + R)?;
    let mut sum = f32x16::splat(simd, 0.0);
    for dx in 0..2 * R + 1 {
        sum += f32x16::from_slice(simd, &run[dx..dx + BLOCK]);
    }
    Some(sum / (2 * R + 1) as f32)
}

/// Means of `n` lines of the length of `out` that lie one after the other, value by value.
#[inline(always)]
fn means_of<S: Simd>(simd: S, lines: &[f32], n: usize, out: &mut [f32]) {
    let (scale, stride) = (1.0 / n as f32, out.len());
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    let end = BLOCK * blocks.len();
    for (k, block) in blocks.iter_mut().enumerate() {
        let mut sum = f32x16::splat(simd, 0.0);
        let mut from = BLOCK * k;
        for _ in 0..n {
            sum += load_within(simd, lines, from);
            from += stride;
        }
        (sum * scale).store_slice(block);
    }
    for (i, value) in rest.iter_mut().enumerate() {
        let mut sum = 0.0;
        for line in lines.chunks_exact(stride) {
            sum += line[end + i];
        }
        *value = sum * scale;
    }
}

/// Means over 5x5 and the like of a picture's colours, for these rows.
pub(crate) fn mean_colours(picture: &Plane<Rgb>, radius: usize, rows: &Range<usize>) -> Band {
    let (w, h) = (picture.size().width, picture.size().height);
    let channels = Band::filled(&around(rows, radius, h), w, 3, |y, out| {
        for (x, colour) in picture.row(y).iter().enumerate() {
            for c in 0..3 {
                out[c * w + x] = colour[c];
            }
        }
    });
    pool(&channels, &[0, 1, 2], radius, rows, h)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Statistics of sixteen pixels, some of them none, infinite or no number, and the same on lanes.
    pub(crate) fn pooled<S: Simd>(simd: S, seed: u32) -> (Vec<Pooled>, PooledLanes<S>) {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
        let mut value = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let some = (state >> 8) as f32 / (1 << 24) as f32;
            match state >> 8 & 63 {
                0 => 0.0,
                1 => f32::NAN,
                2 => f32::INFINITY,
                _ => (30.0 * (some - 0.7)).exp2(),
            }
        };
        let mut one = Vec::new();
        for i in 0..BLOCK {
            let mut pooled = Pooled { silhouette: i % 3 == 0, ..Pooled::default() };
            let Pooled { over_time, over_space, input, along, apart, detail, mean, .. } = &mut pooled;
            for values in [&mut over_time[..], over_space, input, along, apart, detail, mean] {
                values.fill_with(&mut value);
            }
            pooled.seen = [0.25 * (i % 5) as f32, 0.02 * i as f32];
            one.push(pooled);
        }
        let lanes = |of: &dyn Fn(&Pooled) -> f32| -> f32x16<S> {
            let values: [f32; BLOCK] = std::array::from_fn(|i| of(&one[i]));
            values.simd_into(simd)
        };
        let lanes = PooledLanes {
            over_time: [0, 1].map(|k| lanes(&|p| p.over_time[k])),
            seen: [0, 1].map(|k| lanes(&|p| p.seen[k])),
            over_space: [0, 1].map(|k| lanes(&|p| p.over_space[k])),
            input: [0, 1].map(|k| lanes(&|p| p.input[k])),
            along: [0, 1].map(|k| lanes(&|p| p.along[k])),
            apart: [0, 1, 2, 3, 4, 5].map(|k| lanes(&|p| p.apart[k])),
            detail: [0, 1].map(|k| lanes(&|p| p.detail[k])),
            mean: [0, 1, 2].map(|k| lanes(&|p| p.mean[k])),
            silhouette: lanes(&|p| f32::from(u8::from(p.silhouette))),
        };
        (one, lanes)
    }

    #[test]
    fn statistics_of_sixteen_pixels_have_the_bits_of_one() {
        let s = Settings::default();
        dispatch!(crate::simd::level(), simd => {
            for seed in 0..40 {
                let (one, lanes) = pooled(simd, seed);
                let inputs = lanes.inputs(simd);
                let noise = [lanes.noise(simd, 0), lanes.noise(simd, 1), lanes.least_noise(simd, &s)];
                for (i, pooled) in one.into_iter().enumerate() {
                    let expected = [pooled.noise(0), pooled.noise(1), pooled.least_noise(&s)];
                    for (found, expected) in noise.iter().zip(expected).chain(inputs.iter().zip(pooled.inputs())) {
                        assert_eq!(found.as_slice()[i].to_bits(), expected.to_bits(), "{pooled:?}");
                    }
                }
            }
        });
    }

    /// Also at the ends of rows that are no multiple of sixteen.
    #[test]
    fn silhouettes_are_those_of_the_definition() {
        let frame = crate::sequence::testing::frame(0, Size::new(37, 21));
        let mut features = Features::new(&frame, &crate::sequence::SequenceSettings::default());
        for (i, surface) in features.surface.iter_mut().enumerate() {
            surface.inverse_depth = [1.0, 1.05, 1.3, 0.0, f32::NAN][i * i % 11 % 5];
        }
        for rows in [0..21, 5..9] {
            let found = silhouettes(&features, 1.1, &rows);
            for (x, y) in rows.flat_map(|y| (0..37).map(move |x| (x, y))) {
                let expected = super::super::silhouette(&features, x, y, 1.1);
                assert_eq!(found.at(x, y, 0) > 0.0, expected, "{x} {y}");
            }
        }
    }
}
