//! A small convolutional net of the U-Net kind (Ronneberger et al. 2015), on images row by row: the picture at its own size, halved and
//! halved again, and back, so that a pixel is judged by what is around it. The same bits on every machine and for every band of rows.
//!
//! ```text
//! inputs -1x1-> A -3x3-> a -half-> -3x3-> b -half-> -3x3-> -3x3-> c
//! c -twice-> [b, c] -3x3-> d -twice-> [a, d] -3x3-> -1x1-> outputs
//! ```

use crate::par;
use crate::plane::Size;
use crate::window::Rows;
#[cfg(feature = "cpu")]
use fearless_simd::{Simd, f32x16, prelude::*};
use std::ops::Range;

/// Slope of the rectified linear units below 0.
pub(crate) const LEAK: f32 = 0.05;
/// Standardised inputs count as this at most.
pub(crate) const MOST_INPUT: f32 = 4.0;
/// Rows and columns begin anew at multiples of it: the size of a pixel that was halved twice.
pub(crate) const GRID: usize = 4;
/// How far an output looks: a window of 3 at full size, of 3 and two of 3 at halves and quarters on the way down, of 3 twice on the way up, and
/// what pixels share a half and a quarter with those.
pub(crate) const REACH: usize = 1 + 2 + 4 + 4 + 2 + 1 + 2 + GRID;

/// A layer's weights, `[output][input][3x3 or 1]`, and what it adds.
#[derive(Debug)]
pub(crate) struct Layer {
    pub inputs: usize,
    pub outputs: usize,
    /// Of the window: 1 or 3.
    pub side: usize,
    pub weights: Vec<f32>,
    pub bias: Vec<f32>,
}

/// The net's weights, as `benchmarks/nets` writes them.
#[derive(Debug)]
pub(crate) struct ConvNet {
    /// Of each input what is taken away, and one over what it is divided by.
    pub mean: Vec<f32>,
    pub scale: Vec<f32>,
    /// In the order of the picture above.
    pub layers: [Layer; 8],
}

impl ConvNet {
    /// Inputs, outputs and side of each layer.
    const fn shapes(inputs: usize, [a, b, c]: [usize; 3], outputs: usize) -> [[usize; 3]; 8] {
        [[inputs, a, 1], [a, a, 3], [a, b, 3], [b, c, 3], [c, c, 3], [b + c, b, 3], [a + b, a, 3], [a, outputs, 1]]
    }

    /// Bytes of a file of weights. `widths`: channels of a, b, c.
    pub(crate) const fn bytes(inputs: usize, widths: [usize; 3], outputs: usize) -> usize {
        let shapes = Self::shapes(inputs, widths, outputs);
        let (mut values, mut k) = (2 * inputs, 0);
        while k < shapes.len() {
            let [inputs, outputs, side] = shapes[k];
            values += outputs * (inputs * side * side + 1);
            k += 1;
        }
        2 * values
    }

    /// From 16-bit floats, little-endian: means, deviations, then each layer's weights and what it adds. What is missing is 0.
    pub(crate) fn read(bytes: &[u8], inputs: usize, widths: [usize; 3], outputs: usize) -> Self {
        let mut values = bytes.chunks_exact(2).map(|two| half::f16::from_le_bytes([two[0], two[1]]).to_f32());
        let mut take = |n: usize| -> Vec<f32> { (0..n).map(|_| values.next().unwrap_or(0.0)).collect() };
        let mean = take(inputs);
        let scale = take(inputs).into_iter().map(f32::recip).collect();
        let layers = Self::shapes(inputs, widths, outputs).map(|[inputs, outputs, side]| Layer {
            inputs,
            outputs,
            side,
            weights: take(inputs * outputs * side * side),
            bias: take(outputs),
        });
        Self { mean, scale, layers }
    }

    /// The outputs at every pixel of an image whose first row is row `first_row` of the picture. `inputs` gives what some rows of it
    /// hold, from the first to the last, some of them twice: never all at once, they are many channels.
    pub(crate) fn run(&self, size: Size, first_row: usize, mut inputs: impl FnMut(Range<usize>) -> Rows) -> Rows {
        let [first, second, third, fourth, fifth, sixth, seventh, last] = &self.layers;
        if size.pixels() == 0 {
            return Rows::new(size, last.outputs);
        }
        let above = first_row % GRID;
        let whole = Size::new(size.width.next_multiple_of(GRID), (above + size.height).next_multiple_of(GRID));
        let half = Size::new(whole.width / 2, whole.height / 2);
        let quarter = Size::new(half.width / 2, half.height / 2);
        // Beyond the picture its border.
        let row_of = |y: usize| y.saturating_sub(above).min(size.height - 1);
        let few = FEW.max(2 * STRIP * par::threads());
        let mut a = Rows::unset(whole, second.outputs);
        for (k, out) in a.data_mut().chunks_mut((BAND * second.outputs * whole.width).max(1)).enumerate() {
            let rows = BAND * k..(BAND * (k + 1)).min(whole.height);
            let wider = rows.start.saturating_sub(1)..(rows.end + 1).min(whole.height);
            let begin = row_of(wider.start);
            let read = inputs(begin..row_of(wider.end - 1) + 1);
            // What is read, made standard.
            let standard = |y: usize, c: usize, from: usize, out: &mut [f32]| {
                let row = &read.row(row_of(y) - begin, c)[from.min(size.width - 1)..];
                let there = row.len().min(out.len());
                standardise(row, (self.mean[c], self.scale[c]), out);
                let border = out[there - 1];
                out[there..].fill(border);
            };
            for (k, out) in out.chunks_mut(few * second.outputs * whole.width).enumerate() {
                let rows = rows.start + few * k..(rows.start + few * (k + 1)).min(rows.end);
                let wider = rows.start.saturating_sub(1)..(rows.end + 1).min(whole.height);
                let before = first.rows(whole, wider.clone(), standard, true);
                second.fill(whole, rows, from_row(&before, wider.start), true, out);
            }
        }
        let b = third.run(half, halved(&a), true);
        let c = fifth.run(quarter, from_row(&fourth.run(quarter, halved(&b), true), 0), true);
        let d = sixth.run(half, beside(&b, &c), true);
        drop((b, c));
        let mut cut = Rows::unset(size, last.outputs);
        let length = (last.outputs * size.width).max(1);
        for (k, cut) in cut.data_mut().chunks_mut(few * length).enumerate() {
            let rows = above + few * k..above + (few * (k + 1)).min(size.height);
            let before = seventh.rows(whole, rows.clone(), beside(&a, &d), true);
            let out = last.rows(whole, rows.clone(), from_row(&before, rows.start), false);
            par::rows(cut, length, |y, row| {
                for (c, row) in row.chunks_exact_mut(size.width).enumerate() {
                    row.copy_from_slice(&out.row(y, c)[..size.width]);
                }
            });
        }
        cut
    }
}

/// Pixels of a row that are summed up together.
const LANES: usize = 16;
/// Outputs that are summed up together: as many as registers hold the sums of, of a processor whose registers hold [`LANES`] numbers and of
/// the others.
#[cfg(feature = "cpu")]
const WIDE: usize = 16;
const NARROW: usize = 4;
/// Columns and rows whose inputs are fetched together, so that they stay in the cache: 48 channels take 150 kB.
const TILE: usize = 128;
const STRIP: usize = 4;

/// No vectors.
#[cfg(not(feature = "cpu"))]
trait Simd: Copy {}
#[cfg(not(feature = "cpu"))]
impl Simd for () {}

/// [`WIDE`] or [`NARROW`].
#[inline(always)]
#[cfg(feature = "cpu")]
fn group_of<S: Simd>(_: S) -> usize {
    if <S::f32s as SimdBase<S>>::LEN == LANES { WIDE } else { NARROW }
}

fn group() -> usize {
    #[cfg(feature = "cpu")]
    return crate::simd::dispatch!(crate::simd::level(), simd => group_of(simd));
    #[cfg(not(feature = "cpu"))]
    NARROW
}

/// Rows that are read at once. Few in tests, so that small pictures have some.
const BAND: usize = if cfg!(test) { 16 } else { 128 };

/// The least rows that layers follow each other on before the next rows come, so that what is between them stays in the cache; two strips for
/// each thread.
const FEW: usize = if cfg!(test) { 4 } else { 32 };

/// What a layer reads around the pixels of a tile: line by line of each input.
struct Fetched {
    values: par::Scratch,
    lines: usize,
    stride: usize,
}

impl Layer {
    /// `fetch` fills in row y of input c from a column on. Beyond the picture its border counts. Sums are taken in the order of inputs, rows and
    /// columns.
    fn run(&self, size: Size, fetch: impl Fn(usize, usize, usize, &mut [f32]) + Sync, rectify: bool) -> Rows {
        self.rows(size, 0..size.height, fetch, rectify)
    }

    /// The same of some rows.
    fn rows(
        &self,
        size: Size,
        rows: Range<usize>,
        fetch: impl Fn(usize, usize, usize, &mut [f32]) + Sync,
        rectify: bool,
    ) -> Rows {
        let mut out = Rows::unset(Size::new(size.width, rows.len()), self.outputs);
        self.fill(size, rows, fetch, rectify, out.data_mut());
        out
    }

    /// The same into what holds them.
    fn fill(
        &self,
        size: Size,
        rows: Range<usize>,
        fetch: impl Fn(usize, usize, usize, &mut [f32]) + Sync,
        rectify: bool,
        out: &mut [f32],
    ) {
        let row_length = (self.outputs * size.width).max(1);
        let weights = self.grouped(group());
        par::rows(out, STRIP * row_length, |strip, out| {
            let (around, first) = (self.side / 2, rows.start + STRIP * strip);
            let lines = out.len() / row_length + 2 * around;
            let mut fetched = Fetched {
                values: par::unset_scratch(self.inputs * lines * (TILE + 2 * around)),
                lines,
                stride: TILE + 2 * around,
            };
            for start in (0..size.width).step_by(TILE) {
                for (k, line) in fetched.values.chunks_exact_mut(fetched.stride).enumerate() {
                    let (c, y) = (k / lines, (first + k % lines).saturating_sub(around).min(size.height - 1));
                    // Columns of the picture that there are, then its border.
                    let left = start.saturating_sub(around);
                    let right = (start + TILE + around).min(size.width);
                    let from = left + around - start;
                    let to = from + right - left;
                    fetch(y, c, left, &mut line[from..to]);
                    let ends = (line[from], line[to - 1]);
                    line[..from].fill(ends.0);
                    line[to..].fill(ends.1);
                }
                for (y, out) in out.chunks_exact_mut(row_length).enumerate() {
                    let (from, at) = ((&fetched, &weights[..]), (start, y));
                    #[cfg(feature = "cpu")]
                    crate::simd::dispatch!(crate::simd::level(), simd => {
                        self.tile_on(simd, from, at, rectify, size.width, out)
                    });
                    #[cfg(not(feature = "cpu"))]
                    self.tile::<NARROW, _>((), from, at, rectify, size.width, out);
                }
            }
        });
    }

    /// Weights of `group` outputs at a time, tap by tap; of outputs that there are not 0.
    fn grouped(&self, group: usize) -> Vec<f32> {
        let taps = self.inputs * self.side * self.side;
        let mut found = vec![0.0; taps * self.outputs.next_multiple_of(group)];
        for (o, weights) in self.weights.chunks_exact(taps).enumerate() {
            let first = o / group * group * taps + o % group;
            for (found, weight) in found[first..].iter_mut().step_by(group).zip(weights) {
                *found = *weight;
            }
        }
        found
    }

    /// Row `y` of a tile that begins at column `start`.
    #[inline(always)]
    fn tile<const GROUP: usize, S: Simd>(
        &self,
        simd: S,
        (fetched, weights): (&Fetched, &[f32]),
        (start, y): (usize, usize),
        rectify: bool,
        width: usize,
        out: &mut [f32],
    ) {
        let taps = self.inputs * self.side * self.side;
        for (g, weights) in weights.chunks_exact(taps * GROUP).enumerate() {
            let (first, weights) = (GROUP * g, weights.as_chunks::<GROUP>().0);
            let mut bias = [0.0; GROUP];
            bias.iter_mut().zip(&self.bias[first..]).for_each(|(bias, value)| *bias = *value);
            for at in (0..TILE.min(width - start)).step_by(LANES) {
                let sums = if self.side == 3 {
                    fetched.sums::<3, GROUP, S>(simd, weights, &bias, at, y)
                } else {
                    fetched.sums::<1, GROUP, S>(simd, weights, &bias, at, y)
                };
                for (k, sum) in sums.iter().enumerate().take(self.outputs - first) {
                    let out = &mut out[(first + k) * width + start + at..(first + k + 1) * width];
                    for (out, value) in out.iter_mut().zip(sum) {
                        *out = if rectify && *value < 0.0 { LEAK * value } else { *value };
                    }
                }
            }
        }
    }

    /// The same with as many outputs together as the registers hold.
    #[inline(always)]
    #[cfg(feature = "cpu")]
    fn tile_on<S: Simd>(
        &self,
        simd: S,
        from: (&Fetched, &[f32]),
        at: (usize, usize),
        rectify: bool,
        width: usize,
        out: &mut [f32],
    ) {
        if group_of(simd) == WIDE {
            self.tile::<WIDE, S>(simd, from, at, rectify, width, out);
        } else {
            self.tile::<NARROW, S>(simd, from, at, rectify, width, out);
        }
    }
}

impl Fetched {
    /// Of sixteen pixels from `at` on in row `y`.
    #[inline(always)]
    #[cfg(feature = "cpu")]
    fn sums<const SIDE: usize, const GROUP: usize, S: Simd>(
        &self,
        simd: S,
        weights: &[[f32; GROUP]],
        bias: &[f32; GROUP],
        at: usize,
        y: usize,
    ) -> [[f32; LANES]; GROUP] {
        let mut sums = [f32x16::splat(simd, 0.0); GROUP];
        for k in 0..GROUP {
            sums[k] = f32x16::splat(simd, bias[k]);
        }
        let mut weights = weights.as_chunks::<SIDE>().0.iter();
        for input in self.values.chunks_exact(self.lines * self.stride) {
            for dy in 0..SIDE {
                let from = (y + dy) * self.stride + at;
                let (Some(run), Some(weights)) = (input.get(from..from + LANES + SIDE - 1), weights.next()) else {
                    continue;
                };
                for dx in 0..SIDE {
                    let values = f32x16::from_slice(simd, &run[dx..dx + LANES]);
                    for k in 0..GROUP {
                        // Rounded once on every machine: two instructions in one where there is one for it.
                        sums[k] = values.mul_add_precise(f32x16::splat(simd, weights[dx][k]), sums[k]);
                    }
                }
            }
        }
        let mut found = [[0.0; LANES]; GROUP];
        for k in 0..GROUP {
            sums[k].store_slice(&mut found[k]);
        }
        found
    }

    /// The same without vectors.
    #[cfg(not(feature = "cpu"))]
    fn sums<const SIDE: usize, const GROUP: usize, S: Simd>(
        &self,
        _: S,
        weights: &[[f32; GROUP]],
        bias: &[f32; GROUP],
        at: usize,
        y: usize,
    ) -> [[f32; LANES]; GROUP] {
        let mut sums = bias.map(|bias| [bias; LANES]);
        let mut weights = weights.iter();
        for input in self.values.chunks_exact(self.lines * self.stride) {
            for (line, dx) in (y..y + SIDE).flat_map(|line| (0..SIDE).map(move |dx| (line, dx))) {
                let run = input[line * self.stride + at + dx..].first_chunk::<LANES>();
                let (Some(run), Some(weights)) = (run, weights.next()) else { continue };
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    sum.iter_mut().zip(run).for_each(|(sum, value)| *sum = value.mul_add(*weight, *sum));
                }
            }
        }
        sums
    }
}

/// Inputs as the net reads them.
fn standardise(values: &[f32], (mean, scale): (f32, f32), out: &mut [f32]) {
    #[inline(always)]
    fn each(values: &[f32], mean: f32, scale: f32, out: &mut [f32]) {
        for (out, value) in out.iter_mut().zip(values) {
            *out = ((value - mean) * scale).clamp(-MOST_INPUT, MOST_INPUT);
        }
    }
    #[cfg(feature = "cpu")]
    crate::simd::widest!(each(values, mean, scale, out));
    #[cfg(not(feature = "cpu"))]
    each(values, mean, scale, out);
}

/// Rows of an image as they are, the first of which is row `first`.
fn from_row(rows: &Rows, first: usize) -> impl Fn(usize, usize, usize, &mut [f32]) + Sync {
    move |y, c, from, out| out.copy_from_slice(&rows.row(y - first, c)[from..][..out.len()])
}

/// Means of 2x2 pixels.
fn halved(rows: &Rows) -> impl Fn(usize, usize, usize, &mut [f32]) + Sync {
    |y, c, from, out| {
        let (above, below) = (&rows.row(2 * y, c)[2 * from..], &rows.row(2 * y + 1, c)[2 * from..]);
        for ((out, above), below) in out.iter_mut().zip(above.as_chunks::<2>().0).zip(below.as_chunks::<2>().0) {
            *out = 0.25 * ((above[0] + above[1]) + (below[0] + below[1]));
        }
    }
}

/// Channels of an image, then those of one of half its size, each pixel four times.
fn beside(whole: &Rows, half: &Rows) -> impl Fn(usize, usize, usize, &mut [f32]) + Sync {
    |y, c, from, out| match c.checked_sub(whole.channels()) {
        None => out.copy_from_slice(&whole.row(y, c)[from..][..out.len()]),
        Some(c) => {
            let row = half.row(y / 2, c);
            // The second pixel of a pair may come first.
            let odd = (from % 2).min(out.len());
            out[..odd].fill(row[from / 2]);
            let (pairs, last) = out[odd..].as_chunks_mut::<2>();
            let rest = row[(from + odd) / 2..].iter();
            let ends = pairs.len();
            pairs.iter_mut().zip(rest.clone()).for_each(|(pair, value)| *pair = [*value; 2]);
            last.iter_mut().zip(rest.skip(ends)).for_each(|(last, value)| *last = *value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A layer by its definition, pixel by pixel, in the order of inputs, rows and columns.
    fn plainly(layer: &Layer, inputs: &Rows, rectify: bool) -> Rows {
        let (w, h) = (inputs.size().width, inputs.size().height);
        let (side, around) = (layer.side, (layer.side / 2) as isize);
        let mut out = Rows::new(inputs.size(), layer.outputs);
        for (o, y, x) in (0..layer.outputs).flat_map(|o| (0..h).flat_map(move |y| (0..w).map(move |x| (o, y, x)))) {
            let mut sum = layer.bias[o];
            for (k, weight) in
                layer.weights[o * layer.inputs * side * side..][..layer.inputs * side * side].iter().enumerate()
            {
                let (c, dy, dx) = (k / (side * side), k / side % side, k % side);
                let qx = (x as isize + dx as isize - around).clamp(0, w as isize - 1) as usize;
                let qy = (y as isize + dy as isize - around).clamp(0, h as isize - 1) as usize;
                sum = weight.mul_add(inputs.at(qx, qy, c), sum);
            }
            out.set(x, y, o, if rectify && sum < 0.0 { LEAK * sum } else { sum });
        }
        out
    }

    /// Tiles, strips and groups of outputs that are not filled; borders; a pixel alone.
    #[test]
    fn a_layer_has_the_bits_of_its_definition() {
        let mut state = 7u32;
        let mut value = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        for (size, inputs, outputs, side) in
            [((131, 6), 3, 11, 3), ((257, 5), 2, 8, 3), ((1, 1), 4, 3, 3), ((128, 4), 5, 3, 1), ((17, 9), 9, 16, 1)]
        {
            let size = Size::new(size.0, size.1);
            let mut image = Rows::new(size, inputs);
            image.data_mut().iter_mut().for_each(|v| *v = value());
            let weights = (0..outputs * inputs * side * side).map(|_| value()).collect();
            let layer = Layer { inputs, outputs, side, weights, bias: (0..outputs).map(|_| value()).collect() };
            for rectify in [false, true] {
                let (found, expected) =
                    (layer.run(size, from_row(&image, 0), rectify), plainly(&layer, &image, rectify));
                assert_eq!(found, expected, "{size}, {inputs} inputs, {outputs} outputs, {side}x{side}");
            }
        }
    }

    #[test]
    fn images_beside_each_other_begin_anywhere() {
        let (whole, half) = (Size::new(12, 4), Size::new(6, 2));
        let numbered = |size: Size, first: f32| {
            let mut rows = Rows::new(size, 1);
            rows.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = first + i as f32);
            rows
        };
        let (whole, half) = (numbered(whole, 0.0), numbered(half, 100.0));
        for (from, length) in [(0, 12), (1, 11), (3, 4), (5, 1), (4, 5), (11, 1)] {
            let mut out = vec![0.0; length];
            beside(&whole, &half)(3, 1, from, &mut out);
            let expected: Vec<f32> = (from..from + length).map(|x| half.at(x / 2, 1, 0)).collect();
            assert_eq!(out, expected, "{from} {length}");
        }
    }
}
