//! Some rows of an image at a time, and means over windows of it: sums over columns of sums over rows, sixteen pixels of a row at once.

use super::lanes::{BLOCK, load, load_within, store};
use super::math::three;
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::simd::dispatch;
use crate::window::Rows;
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
    /// Made row by row: `f(y, all channels of the row one after the other)`, which writes all of it.
    pub(crate) fn filled(
        rows: &Range<usize>,
        width: usize,
        channels: usize,
        f: impl Fn(usize, &mut [f32]) + Sync + Send,
    ) -> Self {
        let first = rows.start;
        Self { first, rows: Rows::written(Size::new(width, rows.len()), channels, |y, row| f(first + y, row)) }
    }

    pub(crate) fn width(&self) -> usize {
        self.rows.size().width
    }

    #[inline(always)]
    pub(crate) fn row(&self, y: usize, c: usize) -> &[f32] {
        self.rows.row(y - self.first, c)
    }

    /// Channel `c` of sixteen pixels of a row; beyond its end 0.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(&self, simd: S, (x, y): (usize, usize), c: usize) -> f32x16<S> {
        load::<true, _>(simd, self.row(y, c), x as isize)
    }

    /// All channels of row `y`, one after the other.
    #[inline(always)]
    pub(crate) fn channels(&self, y: usize) -> &[f32] {
        let length = self.rows.channels() * self.width();
        &self.rows.data()[(y - self.first) * length..][..length]
    }

    #[inline(always)]
    pub(crate) fn at(&self, x: usize, y: usize, c: usize) -> f32 {
        self.row(y, c)[x]
    }

    /// The rows that there are.
    pub(crate) fn here(&self) -> Range<usize> {
        self.first..self.first + self.rows.size().height
    }

    pub(crate) fn data_mut(&mut self) -> &mut [f32] {
        self.rows.data_mut()
    }

    /// Three channels from `first` on at a pixel.
    #[inline(always)]
    pub(crate) fn colour(&self, x: usize, y: usize, first: usize) -> Rgb {
        three(|c| self.at(x, y, first + c))
    }
}

/// Means of some channels over windows of 2 `radius` + 1 pixels, of what lies in the picture, for these rows. `from` holds those around them.
pub(crate) fn pool(from: &Band, channels: &[usize], radius: usize, rows: &Range<usize>, height: usize) -> Band {
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
        // The radii of the stages: known to the compiler, a window is summed without a loop, and its bounds are looked at once.
        let found = match radius {
            1 => whole_window::<1, _>(simd, row, at),
            2 => whole_window::<2, _>(simd, row, at),
            3 => whole_window::<3, _>(simd, row, at),
            5 => whole_window::<5, _>(simd, row, at),
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
