//! The residual's means over cells, row by row on all threads: the fast twin of [`super::reference`].

use super::{
    LEAST, LEAST_VARIANCE, LEVELS, MOST_SURE, PICTURE_LEVELS, Trust, between, cells, holding, shown, squares, triangle,
};
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Residual;
use crate::simd::widest;
use crate::stages::recombine::cpu::raw_row;
use crate::window::{LightSlot, PreparedFrame, Rows, Samples};
use std::ops::Range;

/// As [`super::reference::run`].
pub(crate) fn run(frame: &PreparedFrame, slots: &[LightSlot], mut colours: Rows, s: &Residual) -> Rows {
    let size = frame.features.size;
    let w = size.width;
    let noisy = |slot: &&LightSlot| matches!(frame.stored[slot.light], Samples::Black | Samples::Packed(_));
    let lights: Vec<_> = slots.iter().filter(noisy).collect();
    // One light is kept in the cache, but a loop over its rows is too short for many threads.
    let together = if par::many() { lights.len() } else { 1 };
    for lights in lights.chunks(together.max(1)) {
        let own = Rows::written(size, 3 * lights.len(), |y, row| {
            for (slot, row) in lights.iter().zip(row.chunks_exact_mut(3 * w)) {
                if !raw_row(frame, slot, 0, y, row) {
                    row.fill(0.0);
                }
            }
        });
        let planes: Vec<_> = lights.iter().map(|slot| slot.first..slot.first + slot.planes).collect();
        correct(&LEVELS, frame.features.first_row, &own, (&mut colours, &planes), Trust::of_lights(s));
    }
    colours
}

/// As [`super::reference::picture`].
pub(crate) fn picture(first: usize, input: &Plane<Rgb>, mut picture: Plane<Rgb>, s: &Residual) -> Plane<Rgb> {
    let w = picture.size().width;
    let rows = |plane: &Plane<Rgb>| {
        Rows::written(plane.size(), 3, |y, row| {
            let [red, green, blue] = three_parts(row, w);
            let colours = red.iter_mut().zip(green).zip(blue);
            for (((red, green), blue), colour) in colours.zip(&plane.data()[y * w..]) {
                [*red, *green, *blue] = *colour;
            }
        })
    };
    let mut corrected = rows(&picture);
    let planes = std::slice::from_ref(&(0..1));
    correct(&PICTURE_LEVELS, first, &rows(input), (&mut corrected, planes), Trust::of_picture(s));
    par::rows(picture.data_mut(), w, |y, row| {
        for (x, out) in row.iter_mut().enumerate() {
            *out = corrected.colour(x, y, 0);
        }
    });
    picture
}

/// All levels of some lights: of each its planes, of which the first is compared with its three channels of `own`.
fn correct(
    levels: &[(usize, usize)],
    first: usize,
    own: &Rows,
    (colours, planes): (&mut Rows, &[Range<usize>]),
    trust: Trust,
) {
    let mut noise = None;
    for (index, &(cell, radius)) in levels.iter().enumerate() {
        let level = Level { first, cell, kernel: triangle(radius), trust, planes };
        let sums = level.sums(own, colours);
        let noise = noise.get_or_insert_with(|| level.noise_around(&sums));
        let smooth = level.smoothed(&sums);
        let around = trust.around.filter(|_| index == 0);
        let kept = around.map(|around| level.kept_around(&smooth, noise, around));
        level.apply(own, colours, &level.changes(&smooth, noise, kept.as_ref()));
    }
}

#[inline(always)]
fn three_parts(row: &mut [f32], w: usize) -> [&mut [f32]; 3] {
    let (red, rest) = row.split_at_mut(w);
    let (green, blue) = rest.split_at_mut(w);
    [red, green, blue]
}

/// What [`between`] finds.
type Between = (usize, usize, f32);

/// Sums of a cell: of the filtered light, of the residual and of its square, each of three channels.
const SUMS: usize = 9;

struct Level<'p> {
    /// Row of the picture at which the images begin.
    first: usize,
    cell: usize,
    kernel: Vec<f32>,
    trust: Trust,
    /// Of each light.
    planes: &'p [Range<usize>],
}

impl Level<'_> {
    /// [`SUMS`] of each cell and light.
    fn sums(&self, own: &Rows, colours: &Rows) -> Rows {
        let Size { width: w, height: h } = own.size();
        let (cell, first) = (self.cell, self.first % self.cell);
        let size = Size::new(cells(0, w, cell), cells(self.first, h, cell));
        Rows::made(size, SUMS * self.planes.len(), |v, out| {
            let rows = (v * cell).saturating_sub(first)..((v + 1) * cell - first).min(h);
            for (light, out) in out.chunks_exact_mut(SUMS * size.width).enumerate() {
                widest!(self.sums_row(own, (colours, light), rows.clone(), out));
            }
        })
    }

    /// Every channel smoothed by the triangle over both axes.
    fn smoothed(&self, sums: &Rows) -> Rows {
        let (size, channels) = (sums.size(), sums.channels());
        let across = Rows::written(size, channels, |v, out| {
            for (c, out) in out.chunks_exact_mut(size.width).enumerate() {
                widest!(smooth_across(sums.row(v, c), &self.kernel, out));
            }
        });
        Rows::made(size, channels, |v, out| {
            let reach = self.kernel.len() - 1;
            for u in v.saturating_sub(reach)..(v + reach + 1).min(size.height) {
                let k = self.kernel[u.abs_diff(v)];
                for (c, sums) in out.chunks_exact_mut(size.width).enumerate() {
                    widest!(add_scaled(sums, across.row(u, c), k));
                }
            }
        })
    }

    /// Mean over the triangle of the cells' own squared relative noise.
    fn noise_around(&self, sums: &Rows) -> Rows {
        let (size, lights) = (sums.size(), self.planes.len());
        let own = Rows::made(size, lights, |v, out| {
            for (light, out) in out.chunks_exact_mut(size.width).enumerate() {
                widest!(self.noise_row(sums, (v, light), out));
            }
        });
        self.mean_around(&own)
    }

    /// Mean over the triangle of every channel, of the cells that there are.
    fn mean_around(&self, values: &Rows) -> Rows {
        let (size, channels) = (values.size(), values.channels());
        let mut mean = self.smoothed(values);
        // Of the triangle the part that lies within the image.
        let part = |at: usize, limit: usize| -> f32 {
            let reach = self.kernel.len() - 1;
            (at.saturating_sub(reach)..(at + reach + 1).min(limit)).map(|u| self.kernel[u.abs_diff(at)]).sum()
        };
        let columns: Vec<_> = (0..size.width).map(|x| part(x, size.width)).collect();
        par::rows(mean.data_mut(), channels * size.width, |v, row| {
            let rows = part(v, size.height);
            for row in row.chunks_exact_mut(size.width) {
                row.iter_mut().zip(&columns).for_each(|(mean, columns)| *mean /= rows * columns);
            }
        });
        mean
    }

    /// How much of its residual each cell keeps by the windows around. `noise`: of this level's cells.
    fn kept_around(&self, smooth: &Rows, noise: &Rows, around: f32) -> Rows {
        let (size, lights) = (smooth.size(), self.planes.len());
        let own = Rows::written(size, 2 * lights, |v, out| {
            for (light, out) in out.chunks_exact_mut(2 * size.width).enumerate() {
                widest!(self.certainty_row(smooth, (v, light), noise.row(v, light), out));
            }
        });
        let mean = self.mean_around(&own);
        Rows::written(size, lights, |v, out| {
            for (light, out) in out.chunks_exact_mut(size.width).enumerate() {
                let (certainty, inverse) = (mean.row(v, 2 * light), mean.row(v, 2 * light + 1));
                let own = own.row(v, 2 * light + 1);
                for (x, out) in out.iter_mut().enumerate() {
                    // The squared residual to expect beyond the noise, over the cell's own variance.
                    let beyond = certainty[x] - around;
                    let expected = if beyond > 0.0 { beyond / inverse[x] * own[x] } else { 0.0 };
                    *out = expected / (expected + 1.0);
                }
            }
        })
    }

    /// Of each cell of a row the squared relative noise of a pixel of a light, summed over the channels.
    #[inline(always)]
    fn noise_row(&self, sums: &Rows, (v, light): (usize, usize), out: &mut [f32]) {
        let pixels = (self.cell * self.cell) as f32;
        for c in (0..3).map(|c| SUMS * light + 3 * c) {
            let (light, squared) = (sums.row(v, c), sums.row(v, c + 2));
            for (out, (light, squared)) in out.iter_mut().zip(light.iter().zip(squared)) {
                let light = light + LEAST;
                *out += pixels * squared / (light * light);
            }
        }
    }

    /// What each cell is multiplied by, less 1: three channels of each light. `noise`: of the coarsest level's cells; `kept`:
    /// what they keep by the windows around.
    fn changes(&self, smooth: &Rows, noise: &Rows, kept: Option<&Rows>) -> Rows {
        let size = smooth.size();
        let holders: Vec<_> = (0..size.width).map(|x| holding(0, x, self.cell)).collect();
        Rows::written(size, 3 * self.planes.len(), |v, out| {
            for (light, out) in out.chunks_exact_mut(3 * size.width).enumerate() {
                let around = noise.row(holding(self.first, v, self.cell), light);
                let kept = kept.map(|kept| kept.row(v, light));
                widest!(self.changes_row(smooth, (v, light), (around, &holders, kept), out));
            }
        })
    }

    /// Sums of a row of cells, which hold `rows` of pixels, of one light.
    #[inline(always)]
    fn sums_row(&self, own: &Rows, (colours, light): (&Rows, usize), rows: Range<usize>, out: &mut [f32]) {
        let (w, cell) = (own.size().width, self.cell);
        let plane = self.planes[light].start;
        let across = w.div_ceil(cell);
        let mut residuals = par::unset_scratch(2 * w);
        for (y, c) in rows.flat_map(|y| (0..3).map(move |c| (y, c))) {
            let (filtered, own) = (colours.row(y, 3 * plane + c), own.row(y, 3 * light + c));
            let (residual, squared) = residuals.split_at_mut(w);
            for x in 0..w {
                residual[x] = own[x] - filtered[x];
                squared[x] = residual[x] * residual[x];
            }
            for (k, values) in [filtered, &*residual, &*squared].into_iter().enumerate() {
                let out = &mut out[(3 * c + k) * across..][..across];
                match cell {
                    2 => add_cells::<2>(values, out),
                    4 => add_cells::<4>(values, out),
                    _ => {
                        for (out, values) in out.iter_mut().zip(values.chunks(cell)) {
                            *out += values.iter().sum::<f32>();
                        }
                    }
                }
            }
        }
    }

    /// Of a row of cells of the coarsest level, of one light: squared residuals over their variances, and one over these variances.
    #[inline(always)]
    fn certainty_row(&self, smooth: &Rows, (v, light): (usize, usize), around: &[f32], out: &mut [f32]) {
        let w = smooth.size().width;
        let pixels = (self.cell * self.cell) as f32;
        let (certainty, inverse) = out.split_at_mut(w);
        let mut size = par::scratch(w);
        let mut noise = par::scratch(w);
        for c in (0..3).map(|c| SUMS * light + 3 * c) {
            let [light, residual, squared] = [0, 1, 2].map(|k| smooth.row(v, c + k));
            for x in 0..w {
                let light = light[x] + LEAST;
                let ratio = residual[x] / light;
                size[x] += ratio * ratio;
                noise[x] += pixels * squared[x] / (light * light * shown(ratio));
            }
        }
        for x in 0..w {
            let variance = self.share_of_pixel() * noise[x].max(around[x]) + LEAST_VARIANCE;
            let known = size[x].is_finite() && variance.is_finite();
            certainty[x] = if known { (size[x] / variance).min(MOST_SURE) } else { 0.0 };
            inverse[x] = if known { 1.0 / variance } else { 0.0 };
        }
    }

    /// Variance of a mean over the triangle, of pixels with a variance of 1.
    #[inline(always)]
    fn share_of_pixel(&self) -> f32 {
        squares(&self.kernel) / (self.cell * self.cell) as f32
    }

    /// Shrunk ratios of a row of cells, of one light. `holders`: of each cell the one of the coarsest level that holds it; `kept_around`: at least
    /// so much of them is kept.
    #[inline(always)]
    fn changes_row(
        &self,
        smooth: &Rows,
        (v, light): (usize, usize),
        (around, holders, kept_around): (&[f32], &[usize], Option<&[f32]>),
        out: &mut [f32],
    ) {
        let w = smooth.size().width;
        let share_of_pixel = self.share_of_pixel();
        let mut noise = par::scratch(w);
        self.noise_row(smooth, (v, light), &mut noise);
        let [red, green, blue] = channels(smooth, (v, light));
        let (red, green, blue) =
            ((&red.0[..w], &red.1[..w]), (&green.0[..w], &green.1[..w]), (&blue.0[..w], &blue.1[..w]));
        let mut least = par::unset_scratch(w);
        least.iter_mut().zip(holders).for_each(|(least, holder)| *least = around[*holder]);
        let (out_red, rest) = out.split_at_mut(w);
        let (out_green, out_blue) = rest.split_at_mut(w);
        let ([low, high], sure) = (self.trust.change, self.trust.sure * share_of_pixel);
        let weak = 3.0 * (self.trust.noise + LEAST);
        // No arrays that are mapped: they are compiled apart, for narrow vectors.
        for x in 0..w {
            let r = red.1[x] / (red.0[x] + LEAST);
            let g = green.1[x] / (green.0[x] + LEAST);
            let b = blue.1[x] / (blue.0[x] + LEAST);
            let squared = noise[x].max(least[x]);
            let size = r * r + g * g + b * b;
            let doubt = sure * squared;
            // NaN, of infinities, is no agreement.
            let kept = if doubt < size { 1.0 - doubt / size } else { 0.0 };
            let most = squared + weak;
            let share = if squared.is_finite() { squared / most } else { 0.0 };
            let mut kept = kept * share;
            if let Some(around) = kept_around {
                kept = kept.max(around[x]);
            }
            out_red[x] = (r * kept).max(low).min(high);
            out_green[x] = (g * kept).max(low).min(high);
            out_blue[x] = (b * kept).max(low).min(high);
        }
    }

    /// Multiplies the lights' planes.
    fn apply(&self, own: &Rows, colours: &mut Rows, changes: &Rows) {
        let w = own.size().width;
        let (across, down) = (changes.size().width, changes.size().height);
        let columns: Vec<_> = (0..w).map(|x| between(0, x, self.cell, across)).collect();
        let channels = colours.channels();
        par::rows(colours.data_mut(), channels * w, |y, out| {
            let rows = between(self.first, y, self.cell, down);
            for (light, planes) in self.planes.iter().enumerate() {
                let out = &mut out[3 * planes.start * w..3 * planes.end * w];
                widest!(self.apply_row((own, y), (changes, light), (&columns, rows), out));
            }
        });
    }

    /// A row of pixels, between two rows of cells.
    #[inline(always)]
    fn apply_row(
        &self,
        (own, y): (&Rows, usize),
        (changes, light): (&Rows, usize),
        (columns, (above, below, ty)): (&[Between], Between),
        out: &mut [f32],
    ) {
        let (w, across) = (columns.len(), changes.size().width);
        // 0 where a pixel came out as it went in.
        let mut changed = par::scratch(w);
        for c in 0..3 {
            for (changed, (filtered, own)) in changed.iter_mut().zip(out[c * w..].iter().zip(own.row(y, 3 * light + c)))
            {
                *changed = if filtered == own { *changed } else { 1.0 };
            }
        }
        let mut row = par::unset_scratch(across);
        let mut factor = par::unset_scratch(w);
        for c in 0..3 {
            for (row, (a, b)) in
                row.iter_mut().zip(changes.row(above, 3 * light + c).iter().zip(changes.row(below, 3 * light + c)))
            {
                *row = a + (b - a) * ty;
            }
            match self.cell {
                2 => spread::<2>(&row, columns, &mut factor),
                4 => spread::<4>(&row, columns, &mut factor),
                _ => spread_some(&row, columns, &mut factor),
            }
            for plane in out.chunks_exact_mut(3 * w) {
                for ((value, factor), changed) in plane[c * w..][..w].iter_mut().zip(&*factor).zip(&*changed) {
                    *value *= 1.0 + factor * changed;
                }
            }
        }
    }
}

/// Of each channel of a light a row of its smoothed sums: of the filtered light and of the residual.
#[inline(always)]
fn channels(smooth: &Rows, (v, light): (usize, usize)) -> [(&[f32], &[f32]); 3] {
    [0, 3, 6].map(|c| (smooth.row(v, SUMS * light + c), smooth.row(v, SUMS * light + c + 1)))
}

/// Adds to each cell's sum those of its `N` pixels; the last cell may have fewer.
#[inline(always)]
fn add_cells<const N: usize>(values: &[f32], out: &mut [f32]) {
    let (whole, rest) = values.as_chunks::<N>();
    for (out, values) in out.iter_mut().zip(whole) {
        let mut sum = 0.0;
        for value in values {
            sum += value;
        }
        *out += sum;
    }
    if let (Some(out), false) = (out.get_mut(whole.len()), rest.is_empty()) {
        *out += rest.iter().sum::<f32>();
    }
}

/// What each pixel of a row of cells is multiplied by, less 1: `columns` has the two cells of a pixel and the share of the second.
#[inline(always)]
fn spread_some(row: &[f32], columns: &[Between], out: &mut [f32]) {
    for (out, (left, right, tx)) in out.iter_mut().zip(columns) {
        *out = row[*left] + (row[*right] - row[*left]) * tx;
    }
}

/// [`spread_some`] for cells of `N` pixels, an even number: between the middles of two cells lie as many pixels, always at the same shares.
#[inline(always)]
fn spread<const N: usize>(row: &[f32], columns: &[Between], out: &mut [f32]) {
    let head = (N / 2).min(out.len());
    spread_some(row, &columns[..head], &mut out[..head]);
    let (columns, out) = (&columns[head..], &mut out[head..]);
    let (whole, _) = out.as_chunks_mut::<N>();
    let mut done = 0;
    if let Some(shares) = columns.first_chunk::<N>() {
        let shares = shares.map(|column| column.2);
        for (out, (a, b)) in whole.iter_mut().zip(row.iter().zip(row.iter().skip(1))) {
            for (out, share) in out.iter_mut().zip(shares) {
                *out = a + (b - a) * share;
            }
            done += N;
        }
    }
    spread_some(row, &columns[done..], &mut out[done..]);
}

#[inline(always)]
fn add_scaled(sums: &mut [f32], values: &[f32], k: f32) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += k * value);
}

/// A row smoothed by a triangle, as far as it goes.
#[inline(always)]
fn smooth_across(row: &[f32], kernel: &[f32], out: &mut [f32]) {
    let w = row.len();
    for (out, value) in out.iter_mut().zip(row) {
        *out = kernel[0] * value;
    }
    for (d, k) in kernel.iter().enumerate().skip(1).take_while(|(d, _)| *d < w) {
        out[d..].iter_mut().zip(row).for_each(|(sum, value)| *sum += k * value);
        out[..w - d].iter_mut().zip(&row[d..]).for_each(|(sum, value)| *sum += k * value);
    }
}
