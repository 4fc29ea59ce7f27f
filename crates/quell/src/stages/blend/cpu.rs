//! Shares of the candidates, row by row: windows are sums over columns of sums over rows.

use super::{
    Blend, BlendFrame, DIRECTIONS, FRAMES, HIGH_PASS, LEAST_BRIGHTNESS, MOST_CHANGE, NEAR, NOISE_NEAR, NOISE_WIDE,
    Pooled, READ, SECOND_DIFFERENCE, WIDE, by_thresholds, drawn_back, follow, net, read, shares, silhouette,
};
use crate::frame::Rgb;
use crate::kernels::math::three;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Blend as Settings, Gather, Stabilise};
use crate::simd::widest;
use crate::window::{Features, Rows};

/// As [`super::reference::run`].
pub(crate) fn run(
    window: &[BlendFrame<'_>],
    centre: usize,
    steady: &Plane<Rgb>,
    (gather, stabilise): (&Gather, &Stabilise),
    s: &Settings,
) -> Blend {
    let here = &window[centre];
    let size = here.input.size();
    let (inverse, differences, stats) = statistics(window, centre, steady, gather);
    let w = size.width;
    let edges = |y: usize| -> Vec<bool> { (0..w).map(|x| silhouette(here.features, x, y, stabilise.nearer)).collect() };
    let said = s.net.then(|| {
        let mut read = Rows::new(size, READ);
        par::rows(read.data_mut(), (READ * w).max(1), |y, out| {
            widest!(read_row((&stats, &inverse), (here, steady), y, &edges(y), out));
        });
        net().run(read, here.features.first_row)
    });
    let mut shares_of = Plane::filled(size, [0.0; 3]);
    let mut expected = Plane::filled(size, 0.0);
    par::two_rows(shares_of.data_mut(), w, expected.data_mut(), w, |y, shares_of, expected| {
        widest!(shares_row(&stats, said.as_ref(), y, &edges(y), s, shares_of, expected));
    });
    draw_back(&mut shares_of, &differences, &stats, s);
    let noise = par::plane(size, |x, y| expected.at(x, y).sqrt() / inverse.at(x, y));
    Blend { shares: shares_of, noise }
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
    let noise = PictureNoise::new(window, centre, steady, gather);
    Plane::from_fn(here.input.size(), |x, y| {
        let (pooled, inverse) = noise.at(x, y, here.features, stabilise.nearer);
        read(&pooled, [here.input.at(x, y), here.picture.at(x, y), steady.at(x, y)], inverse)
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
    let noise = PictureNoise::new(window, centre, steady, gather);
    let at = |x, y| noise.at(x, y, here.features, stabilise.nearer);
    let size = here.input.size();
    let squared = |x, y| {
        let (pooled, inverse) = at(x, y);
        pooled.noise(1) / (3.0 * inverse * inverse)
    };
    (Plane::from_fn(size, |x, y| at(x, y).0.inputs()), Plane::from_fn(size, squared))
}

/// What is known of the noise of a frame's input, from its difference to filtered pictures.
pub(crate) struct PictureNoise {
    inverse: Plane<f32>,
    stats: Statistics,
}

impl PictureNoise {
    /// `steady`: another filtered picture, or again the wavelet's.
    pub(crate) fn new(window: &[BlendFrame<'_>], centre: usize, steady: &Plane<Rgb>, gather: &Gather) -> Self {
        let (inverse, _, stats) = statistics(window, centre, steady, gather);
        Self { inverse, stats }
    }

    /// What is known at a pixel, and one over the brightness that it is relative to.
    #[inline(always)]
    pub(crate) fn at(&self, x: usize, y: usize, features: &Features, nearer: f32) -> (Pooled, f32) {
        (self.stats.at(x, y, silhouette(features, x, y, nearer)), self.inverse.at(x, y))
    }

    /// One over the brightness around a pixel.
    #[cfg(feature = "internals")]
    pub(crate) fn inverse(&self, x: usize, y: usize) -> f32 {
        self.inverse.at(x, y)
    }
}

fn statistics(
    window: &[BlendFrame<'_>],
    centre: usize,
    steady: &Plane<Rgb>,
    gather: &Gather,
) -> (Plane<f32>, Rows, Statistics) {
    let here = &window[centre];
    let inverse = inverse_brightness(here.picture, steady);
    let differences = differences(window, centre, steady, &inverse, gather);
    let squares = squares(here, steady, &inverse, &differences);
    let stats = Statistics::new(&differences, &squares);
    (inverse, differences, stats)
}

/// One over the brightness around a pixel: the mean over 5x5 of both filtered pictures.
fn inverse_brightness(picture: &Plane<Rgb>, steady: &Plane<Rgb>) -> Plane<f32> {
    let size = picture.size();
    let mut both = Rows::new(size, 1);
    par::rows(both.data_mut(), size.width, |y, row| {
        for ((value, a), b) in row.iter_mut().zip(picture.row(y)).zip(steady.row(y)) {
            *value = (a[0] + a[1] + a[2] + b[0] + b[1] + b[2]) / 6.0;
        }
    });
    let mean = pool(&both, NOISE_NEAR);
    par::plane(size, |x, y| 1.0 / (mean.at(x, y, 0).max(0.0) + LEAST_BRIGHTNESS))
}

/// Three channels each: input less wavelet, input less stabilised, input less wavelet averaged over time; then the
/// squared changes over time and the share of neighbours seen.
const DIFFERENCES: usize = 11;

fn differences(
    window: &[BlendFrame<'_>],
    centre: usize,
    steady: &Plane<Rgb>,
    inverse: &Plane<f32>,
    gather: &Gather,
) -> Rows {
    let here = &window[centre];
    let size = here.input.size();
    let w = size.width;
    let mut out = Rows::new(size, DIFFERENCES);
    par::rows(out.data_mut(), (DIFFERENCES * w).max(1), |y, out| {
        widest!(differences_row((window, centre), (steady, inverse), gather, y, out));
    });
    out
}

#[inline(always)]
fn differences_row(
    (window, centre): (&[BlendFrame<'_>], usize),
    (steady, inverse): (&Plane<Rgb>, &Plane<f32>),
    gather: &Gather,
    y: usize,
    out: &mut [f32],
) {
    let here = &window[centre];
    let w = here.input.size().width;
    for x in 0..w {
        let scale = inverse.at(x, y);
        let (i, p, s) = (here.input.at(x, y), here.picture.at(x, y), steady.at(x, y));
        let e = three(|c| i[c] - p[c]);
        let (sum, change, seen) = over_time(window, centre, (x, y), e, gather);
        for c in 0..3 {
            out[c * w + x] = e[c] * scale;
            out[(3 + c) * w + x] = (i[c] - s[c]) * scale;
            out[(6 + c) * w + x] = sum[c] * scale / (1.0 + seen);
        }
        let all = (2 * FRAMES) as f32;
        out[9 * w + x] = change * scale * scale / all;
        out[10 * w + x] = seen / all;
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

fn squares(here: &BlendFrame<'_>, steady: &Plane<Rgb>, inverse: &Plane<f32>, differences: &Rows) -> Rows {
    let size = here.input.size();
    let (w, h) = (size.width, size.height);
    let mut out = Rows::new(size, SQUARES);
    par::rows(out.data_mut(), (SQUARES * w).max(1), |y, out| {
        let rows = [y.saturating_sub(1), y, (y + 1).min(h - 1)];
        for x in 0..w {
            let columns = [x.saturating_sub(1), x, (x + 1).min(w - 1)];
            let scale = inverse.at(x, y);
            let high = |at: &dyn Fn(usize, usize) -> f32| {
                let row = |y: usize| 0.25 * at(columns[0], y) + 0.5 * at(columns[1], y) + 0.25 * at(columns[2], y);
                let d = at(x, y) - (0.25 * row(rows[0]) + 0.5 * row(rows[1]) + 0.25 * row(rows[2]));
                d * d
            };
            let mut sums = [0.0f32; SQUARES];
            for c in 0..3 {
                let (e, f) = (differences.at(x, y, c), differences.at(x, y, 3 + c));
                sums[0] += high(&|x, y| differences.at(x, y, c)) / HIGH_PASS;
                sums[1] += e * e;
                sums[2] += f * f;
                sums[3] += (e - f) * (e - f);
                sums[4] += high(&|x, y| steady.at(x, y)[c]) * scale * scale;
                sums[5] += high(&|x, y| here.picture.at(x, y)[c]) * scale * scale;
                sums[6] += high(&|x, y| here.input.at(x, y)[c]) * scale * scale / HIGH_PASS;
            }
            let place = |v: usize, d: isize, limit: usize| (v as isize + d).clamp(0, limit as isize - 1) as usize;
            let around = |dx: isize, dy: isize| (place(x, dx, w), place(y, dy, h));
            for (k, [dx, dy]) in DIRECTIONS.into_iter().enumerate() {
                let places = [around(-dx, -dy), (x, y), around(dx, dy)];
                let [a, b, c] = places.map(|(x, y)| here.input.at(x, y));
                let [p, q, r] = places.map(|(x, y)| [0, 1, 2].map(|c| differences.at(x, y, c)));
                let squared = |d: f32| d * d / SECOND_DIFFERENCE;
                sums[7 + k] = (0..3).map(|i| squared((a[i] - 2.0 * b[i] + c[i]) * scale)).sum();
                sums[11 + k] = (0..3).map(|i| squared(p[i] - 2.0 * q[i] + r[i])).sum();
            }
            for (k, sum) in sums.into_iter().enumerate() {
                out[k * w + x] = sum;
            }
        }
    });
    out
}

/// Means over windows.
struct Statistics {
    /// Of the three differences, near.
    means: Rows,
    /// Changes over time and neighbours seen, near and wide.
    time: [Rows; 2],
    /// Noise over space, and changes of the input, near and wide.
    space: [Rows; 2],
    /// Squared differences and details, near; differences, wide.
    near: Rows,
    wide: Rows,
    /// Second differences along four directions.
    along: Rows,
}

impl Statistics {
    fn new(differences: &Rows, squares: &Rows) -> Self {
        let means = pool(&part(differences, &[0, 1, 2, 3, 4, 5, 6, 7, 8]), NOISE_NEAR);
        let (time, space) = (part(differences, &[9, 10]), part(squares, &[0, 6]));
        let apart = part(squares, &[1, 2, 3]);
        Self {
            means,
            time: [NOISE_NEAR, NOISE_WIDE].map(|r| pool(&time, r)),
            space: [NOISE_NEAR, NOISE_WIDE].map(|r| pool(&space, r)),
            near: pool(&part(squares, &[1, 2, 3, 4, 5]), NEAR),
            wide: pool(&apart, WIDE),
            along: pool(&part(squares, &[7, 8, 9, 10, 11, 12, 13, 14]), NOISE_NEAR),
        }
    }

    #[inline(always)]
    fn at(&self, x: usize, y: usize, silhouette: bool) -> Pooled {
        let mean = |k: usize| (0..3).map(|c| self.means.at(x, y, 3 * k + c)).map(|v| v * v).sum::<f32>();
        let [near, wide] = [&self.near, &self.wide].map(|rows| [0, 1, 2].map(|k| rows.at(x, y, k)));
        Pooled {
            over_time: [0, 1].map(|k| self.time[k].at(x, y, 0)),
            seen: [0, 1].map(|k| self.time[k].at(x, y, 1)),
            over_space: [0, 1].map(|k| self.space[k].at(x, y, 0)),
            input: [0, 1].map(|k| self.space[k].at(x, y, 1)),
            along: [0..4, 4..8].map(|of| of.map(|k| self.along.at(x, y, k)).fold(f32::MAX, f32::min)),
            apart: [near[0], near[1], near[2], wide[0], wide[1], wide[2]],
            detail: [self.near.at(x, y, 3), self.near.at(x, y, 4)],
            mean: [mean(0), mean(1), mean(2)],
            silhouette,
        }
    }
}

#[inline(always)]
fn read_row(
    (stats, inverse): (&Statistics, &Plane<f32>),
    (here, steady): (&BlendFrame<'_>, &Plane<Rgb>),
    y: usize,
    edges: &[bool],
    out: &mut [f32],
) {
    let w = edges.len();
    for (x, edge) in edges.iter().enumerate() {
        let candidates = [here.input.at(x, y), here.picture.at(x, y), steady.at(x, y)];
        let values = read(&stats.at(x, y, *edge), candidates, inverse.at(x, y));
        for (c, value) in values.into_iter().enumerate() {
            out[c * w + x] = value;
        }
    }
}

#[inline(always)]
fn shares_row(
    stats: &Statistics,
    said: Option<&Rows>,
    y: usize,
    edges: &[bool],
    s: &Settings,
    shares_of: &mut [[f32; 3]],
    expected: &mut [f32],
) {
    for (x, edge) in edges.iter().enumerate() {
        let pooled = stats.at(x, y, *edge);
        let (share, error) = match said {
            Some(said) => shares([0, 1, 2, 3].map(|c| said.at(x, y, c)), s.strength),
            None => by_thresholds(&pooled, s),
        };
        shares_of[x] = share;
        expected[x] = error * pooled.noise(1) / 3.0;
    }
}

fn draw_back(shares: &mut Plane<[f32; 3]>, differences: &Rows, stats: &Statistics, s: &Settings) {
    let size = shares.size();
    let w = size.width;
    let mut squared = Rows::new(size, 1);
    par::rows(squared.data_mut(), w, |y, row| {
        for (x, value) in row.iter_mut().enumerate() {
            let [_, wavelet, steady] = shares.at(x, y);
            *value = (0..3)
                .map(|c| wavelet * differences.at(x, y, c) + steady * differences.at(x, y, 3 + c))
                .map(|d| d * d)
                .sum();
        }
    });
    let difference = pool(&squared, NOISE_NEAR);
    par::rows(shares.data_mut(), w, |y, row| {
        for (x, share) in row.iter_mut().enumerate() {
            let noise = stats.at(x, y, false).least_noise(s);
            let kept = drawn_back(difference.at(x, y, 0), noise, s);
            let [_, wavelet, steady] = share.map(|v| v * kept);
            *share = [1.0 - (wavelet + steady), wavelet, steady];
        }
    });
}

/// Some channels of an image.
fn part(rows: &Rows, channels: &[usize]) -> Rows {
    let size = rows.size();
    let mut out = Rows::new(size, channels.len());
    par::rows(out.data_mut(), (channels.len() * size.width).max(1), |y, out| {
        for (out, c) in out.chunks_exact_mut(size.width).zip(channels) {
            out.copy_from_slice(rows.row(y, *c));
        }
    });
    out
}

/// Means over windows of 2 `radius` + 1 pixels, of what lies in the picture.
pub(crate) fn pool(rows: &Rows, radius: usize) -> Rows {
    let (size, channels) = (rows.size(), rows.channels());
    let Size { width: w, height: h } = size;
    let mut across = Rows::new(size, channels);
    par::rows(across.data_mut(), (channels * w).max(1), |y, out| {
        for (c, out) in out.chunks_exact_mut(w).enumerate() {
            widest!(sums_across(rows.row(y, c), radius, out));
        }
    });
    let mut both = Rows::new(size, channels);
    par::rows(both.data_mut(), (channels * w).max(1), |y, out| {
        for (c, out) in out.chunks_exact_mut(w).enumerate() {
            let (from, to) = (y.saturating_sub(radius), (y + radius + 1).min(h));
            for v in from..to {
                out.iter_mut().zip(across.row(v, c)).for_each(|(sum, value)| *sum += value);
            }
            let scale = 1.0 / (to - from) as f32;
            out.iter_mut().for_each(|sum| *sum *= scale);
        }
    });
    both
}

#[inline(always)]
fn sums_across(row: &[f32], radius: usize, out: &mut [f32]) {
    let w = row.len();
    for dx in 0..=2 * radius {
        // out[x] += row[x + dx - radius]
        let (from, to) = (radius.saturating_sub(dx), (w + radius).saturating_sub(dx).min(w));
        if from < to {
            let start = from + dx - radius;
            out[from..to].iter_mut().zip(&row[start..start + (to - from)]).for_each(|(sum, value)| *sum += value);
        }
    }
    for (x, sum) in out.iter_mut().enumerate() {
        let number = (x + radius + 1).min(w) - x.saturating_sub(radius);
        *sum /= number as f32;
    }
}
