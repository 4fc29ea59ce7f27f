//! A small convolutional net of the U-Net kind (Ronneberger et al. 2015), on images row by row: the picture at its own size, halved and
//! halved again, and back, so that a pixel is judged by what is around it. The same bits on every machine and for every band of rows.
//!
//! ```text
//! inputs -1x1-> A -3x3-> a -half-> -3x3-> b -half-> -3x3-> -3x3-> c
//! c -twice-> [b, c] -3x3-> d -twice-> [a, d] -3x3-> -1x1-> outputs
//! ```

use crate::par;
use crate::plane::Size;
#[cfg(feature = "cpu")]
use crate::simd::widest;
use crate::window::Rows;

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

    /// The outputs at every pixel of `inputs`, whose first row is row `first_row` of the picture.
    pub(crate) fn run(&self, inputs: Rows, first_row: usize) -> Rows {
        let size = inputs.size();
        let above = first_row % GRID;
        let whole = Size::new(size.width.next_multiple_of(GRID), (above + size.height).next_multiple_of(GRID));
        let half = Size::new(whole.width / 2, whole.height / 2);
        let quarter = Size::new(half.width / 2, half.height / 2);
        let [first, second, third, fourth, fifth, sixth, seventh, last] = &self.layers;
        // What is read, made standard; beyond the picture its border.
        let standard = |y: usize, c: usize, out: &mut [f32]| {
            let row = inputs.row(y.saturating_sub(above).min(size.height - 1), c);
            for (x, out) in out.iter_mut().enumerate() {
                let value = (row[x.min(size.width - 1)] - self.mean[c]) * self.scale[c];
                *out = value.clamp(-MOST_INPUT, MOST_INPUT);
            }
        };
        let before = first.run(whole, standard, true);
        drop(inputs);
        let a = second.run(whole, own(&before), true);
        drop(before);
        let b = third.run(half, halved(&a), true);
        let c = fifth.run(quarter, own(&fourth.run(quarter, halved(&b), true)), true);
        let d = sixth.run(half, beside(&b, &c), true);
        let out = last.run(whole, own(&seventh.run(whole, beside(&a, &d), true)), false);
        let mut cut = Rows::new(size, last.outputs);
        par::rows(cut.data_mut(), (last.outputs * size.width).max(1), |y, row| {
            for (c, row) in row.chunks_exact_mut(size.width).enumerate() {
                row.copy_from_slice(&out.row(above + y, c)[..size.width]);
            }
        });
        cut
    }
}

/// Pixels of a row that are summed up together, and outputs.
const LANES: usize = 16;
const GROUP: usize = 4;

impl Layer {
    /// `fetch` fills in row y of input c. Beyond the picture its border counts. Sums are taken in the order of inputs, rows and columns.
    fn run(&self, size: Size, fetch: impl Fn(usize, usize, &mut [f32]) + Sync, rectify: bool) -> Rows {
        let mut out = Rows::new(size, self.outputs);
        par::rows(out.data_mut(), (self.outputs * size.width).max(1), |y, out| {
            let around = self.side / 2;
            // The rows around, the border continued to whole blocks.
            let stride = size.width.next_multiple_of(LANES) + 2 * around;
            let mut rows = vec![0.0f32; self.side * self.inputs * stride];
            for (k, row) in rows.chunks_exact_mut(stride).enumerate() {
                let (c, dy) = (k / self.side, k % self.side);
                let inside = around + size.width;
                fetch((y + dy).saturating_sub(around).min(size.height - 1), c, &mut row[around..inside]);
                let (left, right) = (row[around], row[inside - 1]);
                row[..around].fill(left);
                row[inside..].fill(right);
            }
            #[cfg(feature = "cpu")]
            widest!(self.row(&rows, stride, rectify, size.width, out));
            #[cfg(not(feature = "cpu"))]
            self.row(&rows, stride, rectify, size.width, out);
        });
        out
    }

    #[inline(always)]
    fn row(&self, rows: &[f32], stride: usize, rectify: bool, width: usize, out: &mut [f32]) {
        let taps = self.inputs * self.side * self.side;
        for start in (0..width).step_by(LANES) {
            for group in (0..self.outputs).step_by(GROUP) {
                let number = GROUP.min(self.outputs - group);
                let mut sums = [[0.0f32; LANES]; GROUP];
                for (k, sum) in sums.iter_mut().enumerate().take(number) {
                    sum.fill(self.bias[group + k]);
                }
                let mut weights: [&[f32]; GROUP] = [&[]; GROUP];
                for (k, weights) in weights.iter_mut().enumerate() {
                    *weights = &self.weights[(group + k.min(number - 1)) * taps..][..taps];
                }
                for (k, row) in rows.chunks_exact(stride).enumerate() {
                    for dx in 0..self.side {
                        let Some(from) = row[start + dx..].first_chunk::<LANES>() else { continue };
                        let tap = k * self.side + dx;
                        for (sum, weights) in sums.iter_mut().zip(&weights) {
                            let weight = weights[tap];
                            for lane in 0..LANES {
                                sum[lane] += weight * from[lane];
                            }
                        }
                    }
                }
                for (k, sum) in sums.iter().enumerate().take(number) {
                    let end = (start + LANES).min(width);
                    let out = &mut out[(group + k) * width..][start..end];
                    for (out, value) in out.iter_mut().zip(sum) {
                        *out = if rectify && *value < 0.0 { LEAK * value } else { *value };
                    }
                }
            }
        }
    }
}

/// Rows of an image as they are.
fn own(rows: &Rows) -> impl Fn(usize, usize, &mut [f32]) + Sync {
    |y, c, out| out.copy_from_slice(rows.row(y, c))
}

/// Means of 2x2 pixels.
fn halved(rows: &Rows) -> impl Fn(usize, usize, &mut [f32]) + Sync {
    |y, c, out| {
        let (above, below) = (rows.row(2 * y, c), rows.row(2 * y + 1, c));
        for (x, out) in out.iter_mut().enumerate() {
            *out = 0.25 * ((above[2 * x] + above[2 * x + 1]) + (below[2 * x] + below[2 * x + 1]));
        }
    }
}

/// Channels of an image, then those of one of half its size, each pixel four times.
fn beside(whole: &Rows, half: &Rows) -> impl Fn(usize, usize, &mut [f32]) + Sync {
    |y, c, out| match c.checked_sub(whole.channels()) {
        None => out.copy_from_slice(whole.row(y, c)),
        Some(c) => {
            let row = half.row(y / 2, c);
            out.iter_mut().enumerate().for_each(|(x, out)| *out = row[x / 2]);
        }
    }
}
