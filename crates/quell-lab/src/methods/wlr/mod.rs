//! `wlr`: weighted local regression (Moon, Carr, Yoon, ACM Transactions on Graphics 2014).
//!
//! At each pixel a linear model in pixel position, normal, albedo and depth, whose window is shaped by the data: narrow
//! along features in which colour is steep. Constants and departures: docs/baselines-offline.md.

mod eigen;
mod window;

use self::eigen::eigen;
use self::window::{POSITIONS, Window, gather, products, total, vector};
use super::offline::image::{Colour, Image, LANES};
use super::offline::noisy::{FEATURES, Feature, Halves, features, finished, sample_variance};
use super::offline::solve::{solve, sums};
use super::offline::weights::{TILE, Tile, each_tile};
use super::{Input, Method};
use crate::error::Error;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use quell::{Plane, Rgb};

/// The window: 19 x 19.
const RADIUS: usize = 9;
const SIDE: usize = 2 * RADIUS + 1;
const COUNT: usize = SIDE * SIDE;
/// Vectors that hold a window.
const VECTORS: usize = COUNT.div_ceil(LANES);
/// Pixel position 2 and the features.
const DIMENSIONS: usize = 2 + FEATURES;
/// The constant and the local dimensions.
const COLUMNS: usize = 1 + DIMENSIONS;
/// Red, green, blue and the unit vector that gives the pixel's own equivalent kernel.
const RIGHT: usize = 4;
const SUMS: usize = sums(COLUMNS, RIGHT);

/// A feature that varies less within the window is constant there (features have unit range).
const LEAST_RANGE: f32 = 1e-4;
/// Directions whose singular value is a smaller part of the largest are dropped. With noise-free features this only
/// drops what others say already.
const LEAST_SINGULAR: f32 = 0.01;
/// Bandwidths at which bias and variance are measured, in units of the largest predicted change within the window.
const BANDWIDTHS: [f32; 4] = [0.12, 0.35, 1.0, 2.8];

/// A difference between two estimates is bias only beyond so many times the variance of that difference.
const DOUBT: f32 = 9.0;

/// The method.
#[derive(Debug)]
pub struct Wlr {
    level: Level,
}

impl Default for Wlr {
    fn default() -> Self {
        Self { level: Level::new() }
    }
}

impl Method for Wlr {
    fn name(&self) -> String {
        "wlr".to_owned()
    }

    fn needs_halves(&self) -> bool {
        true
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let noisy = Halves::of("wlr", input)?;
        let variance = noisy.variance(sample_variance(input).as_ref());
        Ok(finished(input, &self.regress(&noisy.mean(), &variance, &features(input))))
    }
}

impl Wlr {
    pub(crate) fn regress(&self, colour: &Colour, variance: &Colour, features: &[Feature; 3]) -> Colour {
        let size = colour[0].size();
        let inside = Image::filled(size, 1.0);
        let [r, g, b] = variance;
        let variance = r.zip(g, |r, g| r + g).zip(b, |rg, b| (rg + b) / 3.0);
        let channels: Vec<&Image> = features.iter().flat_map(|f| &f.mean).collect();
        let noise = features.iter().flat_map(|f| {
            let variance = f.noise.as_ref().map(|n| &n.variance);
            (0..f.mean.len()).map(move |c| variance.and_then(|v| v.get(c)))
        });
        let noise: Vec<Option<&Image>> = noise.collect();
        let (Ok(features), Ok(noise)) = (channels.try_into(), noise.try_into()) else {
            // Every caller brings all features.
            return colour.clone();
        };
        let planes = Planes { features, noise, colour, variance: &variance, inside: &inside };
        let mut output: Colour = std::array::from_fn(|_| Image::filled(size, 0.0));
        each_tile(
            size,
            |tile| dispatch!(self.level, simd => planes.tile(simd, tile)),
            |tile, results| {
                for (i, result) in results.iter().enumerate() {
                    let (row, column) = (i / (tile.groups * LANES), i % (tile.groups * LANES));
                    if tile.x + column < size.width {
                        for c in 0..3 {
                            output[c].set(tile.x + column, tile.y + row, result[c]);
                        }
                    }
                }
            },
        );
        output.iter_mut().for_each(Image::repeat_edges);
        output
    }
}

struct Planes<'a> {
    features: [&'a Image; FEATURES],
    /// Variance of noisy features.
    noise: [Option<&'a Image>; FEATURES],
    colour: &'a Colour,
    /// Of the mean, averaged over channels.
    variance: &'a Image,
    inside: &'a Image,
}

/// What is known of one pixel's window.
struct Local {
    /// Coordinates in the local space, each within -1..1; those beyond `rank` are 0.
    z: [Window; DIMENSIONS],
    rank: usize,
    colour: [Window; 3],
    own: Rgb,
    variance: Window,
    inside: Window,
    /// Steepness of colour along each dimension, 1 / bandwidth.
    steepness: [f32; DIMENSIONS],
    weights: Window,
}

impl Local {
    fn new() -> Self {
        let empty = [0.0; VECTORS * LANES];
        Self {
            z: [empty; DIMENSIONS],
            rank: 0,
            colour: [empty; 3],
            own: [0.0; 3],
            variance: empty,
            inside: empty,
            steepness: [0.0; DIMENSIONS],
            weights: empty,
        }
    }
}

impl Planes<'_> {
    /// Filters a tile, row by row, whole vectors.
    #[inline(always)]
    fn tile<S: Simd>(&self, simd: S, tile: Tile) -> Vec<Rgb> {
        let mut locals: Vec<Local> = (0..LANES).map(|_| Local::new()).collect();
        let mut results = Vec::with_capacity(TILE.width * TILE.height);
        for row in 0..tile.rows {
            for group in 0..tile.groups {
                let centre = self.inside.index(tile.x + group * LANES, tile.y + row);
                // Lanes beyond the right edge belong to no pixel.
                let used = (self.inside.size().width - tile.x - group * LANES).min(LANES);
                results.extend(self.group(simd, centre, &mut locals[..used]));
            }
        }
        results
    }

    /// Filters up to [`LANES`] neighbouring pixels; their equations are solved side by side.
    #[inline(always)]
    fn group<S: Simd>(&self, simd: S, centre: usize, locals: &mut [Local]) -> [Rgb; LANES] {
        for (l, local) in locals.iter_mut().enumerate() {
            self.prepare(simd, centre + l, local);
        }
        // Section 5.1: the pilot, with equal weights, gives the derivatives by which bandwidths differ.
        locals.iter_mut().for_each(|local| local.weights = local.inside);
        let pilot = fit(simd, locals);
        for (l, local) in locals.iter_mut().enumerate() {
            let noise = products(simd, &local.inside, [&local.variance, &local.inside]);
            let variance = noise[0] / noise[1].max(1.0);
            for j in 0..DIMENSIONS {
                // A derivative is known to its standard error only: a smaller one counts as that.
                let [squares] = products(simd, &local.z[j], [&local.z[j]]);
                let error = if squares > 0.0 { (variance / squares).sqrt() } else { 0.0 };
                let slope = (0..3).map(|c| pilot[1 + j][c][l].abs()).fold(0.0, f32::max);
                local.steepness[j] = if j < local.rank { slope.max(error) } else { 0.0 };
            }
        }
        // Section 5.2: bias and variance at several bandwidths.
        let mut estimates = [[[0.0_f32; 3]; BANDWIDTHS.len()]; LANES];
        let mut variances = [[0.0_f32; BANDWIDTHS.len()]; LANES];
        for (i, &h) in BANDWIDTHS.iter().enumerate() {
            locals.iter_mut().for_each(|local| local.weigh(simd, h));
            let model = fit(simd, locals);
            for (l, local) in locals.iter().enumerate() {
                estimates[l][i] = std::array::from_fn(|c| local.own[c] + model[0][c][l]);
                let kernel: [f32; COLUMNS] = std::array::from_fn(|j| model[j][3][l]);
                variances[l][i] = local.variance_of_estimate(simd, &kernel);
            }
        }
        std::array::from_fn(|l| estimates[l][best_bandwidth(&estimates[l], &variances[l])])
    }

    /// Section 4: the local space. Features relative to the centre, scaled to the window's range; singular vectors of
    /// what is not noise.
    #[inline(always)]
    fn prepare<S: Simd>(&self, simd: S, centre: usize, local: &mut Local) {
        gather(self.inside, centre, &mut local.inside);
        gather(self.variance, centre, &mut local.variance);
        for c in 0..3 {
            gather(&self.colour[c], centre, &mut local.colour[c]);
            // Relative to the pixel itself, as the features are: sums in single precision lose less.
            local.own[c] = self.colour[c].data()[centre];
            let own = f32x16::splat(simd, local.own[c]);
            for v in 0..VECTORS {
                let relative = vector(simd, &local.colour[c], v) - own;
                relative.store_slice(&mut local.colour[c][v * LANES..(v + 1) * LANES]);
            }
        }
        let mut x = [[0.0; VECTORS * LANES]; DIMENSIONS];
        let mut count = 0;
        let mut noise = 0.0_f32;
        for i in 0..DIMENSIONS {
            let column = &mut x[count];
            if i < 2 {
                *column = POSITIONS[i];
                for v in 0..VECTORS {
                    let inside = vector(simd, column, v) * vector(simd, &local.inside, v);
                    inside.store_slice(&mut column[v * LANES..(v + 1) * LANES]);
                }
            } else {
                let image = self.features[i - 2];
                gather(image, centre, column);
                let own = f32x16::splat(simd, image.data()[centre]);
                let mut range = f32x16::splat(simd, 0.0);
                for v in 0..VECTORS {
                    let d = (vector(simd, column, v) - own) * vector(simd, &local.inside, v);
                    range = range.max(d.max(-d));
                    d.store_slice(&mut column[v * LANES..(v + 1) * LANES]);
                }
                let range = (0..LANES).fold(0.0, |r: f32, l| r.max(range[l]));
                if range < LEAST_RANGE {
                    continue;
                }
                let scale = f32x16::splat(simd, 1.0 / range);
                for v in 0..VECTORS {
                    (vector(simd, column, v) * scale).store_slice(&mut column[v * LANES..(v + 1) * LANES]);
                }
                if let Some(variance) = self.noise[i - 2] {
                    let mut window = [0.0; VECTORS * LANES];
                    gather(variance, centre, &mut window);
                    let [energy] = products(simd, &window, [&local.inside]);
                    noise = noise.max(energy / (range * range));
                }
            }
            count += 1;
        }
        let mut squares = [[0.0_f32; DIMENSIONS]; DIMENSIONS];
        for i in 0..count {
            for j in i..count {
                let [sum] = products(simd, &x[i], [&x[j]]);
                squares[i][j] = sum;
                squares[j][i] = sum;
            }
        }
        let (values, vectors) = eigen(&squares, count);
        let largest = values.iter().fold(0.0_f32, |l, &v| l.max(v));
        let least = noise.max(LEAST_SINGULAR * LEAST_SINGULAR * largest);
        local.rank = 0;
        for j in (0..count).filter(|&j| values[j] > least) {
            let z = &mut local.z[local.rank];
            let mut range = f32x16::splat(simd, 0.0);
            for v in 0..VECTORS {
                let mut sum = f32x16::splat(simd, 0.0);
                for i in 0..count {
                    sum = vector(simd, &x[i], v).mul_add(f32x16::splat(simd, vectors[i][j]), sum);
                }
                range = range.max(sum.max(-sum));
                sum.store_slice(&mut z[v * LANES..(v + 1) * LANES]);
            }
            let range = (0..LANES).fold(0.0, |r: f32, l| r.max(range[l]));
            let scale = f32x16::splat(simd, if range > 0.0 { 1.0 / range } else { 0.0 });
            for v in 0..VECTORS {
                (vector(simd, z, v) * scale).store_slice(&mut z[v * LANES..(v + 1) * LANES]);
            }
            local.rank += 1;
        }
        for z in &mut local.z[local.rank..] {
            *z = [0.0; VECTORS * LANES];
        }
    }
}

impl Local {
    /// Equation 3: a product of Epanechnikov kernels, `h` in units of the largest predicted change of colour.
    #[inline(always)]
    fn weigh<S: Simd>(&mut self, simd: S, h: f32) {
        let largest = self.steepness.iter().fold(0.0_f32, |l, &s| l.max(s));
        if largest <= 0.0 {
            self.weights = self.inside;
            return;
        }
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        let mut scales = [zero; DIMENSIONS];
        for j in 0..DIMENSIONS {
            scales[j] = f32x16::splat(simd, (self.steepness[j] / (h * largest)).powi(2));
        }
        for v in 0..VECTORS {
            let mut w = vector(simd, &self.inside, v);
            for j in 0..self.rank {
                let z = vector(simd, &self.z[j], v);
                w *= (one - z * z * scales[j]).max(zero);
            }
            w.store_slice(&mut self.weights[v * LANES..(v + 1) * LANES]);
        }
    }

    /// The variance of the estimate: the neighbours' own, weighted by the squares of the equivalent kernel.
    #[inline(always)]
    fn variance_of_estimate<S: Simd>(&self, simd: S, kernel: &[f32; COLUMNS]) -> f32 {
        let mut sum = f32x16::splat(simd, 0.0);
        for v in 0..VECTORS {
            let mut l = f32x16::splat(simd, kernel[0]);
            for j in 0..self.rank {
                l = vector(simd, &self.z[j], v).mul_add(f32x16::splat(simd, kernel[1 + j]), l);
            }
            let l = l * vector(simd, &self.weights, v);
            sum = (l * l).mul_add(vector(simd, &self.variance, v), sum);
        }
        total(sum)
    }
}

/// Equations 4 and 5: the weighted linear models of up to [`LANES`] windows; the last right-hand side is (1, 0, .. 0).
#[inline(always)]
fn fit<S: Simd>(simd: S, locals: &[Local]) -> [[f32x16<S>; RIGHT]; COLUMNS] {
    let mut sums = [[0.0_f32; LANES]; SUMS];
    let one = [1.0; VECTORS * LANES];
    for (l, local) in locals.iter().enumerate() {
        let columns: [&Window; COLUMNS + 3] = std::array::from_fn(|j| match j {
            0 => &one,
            j if j < COLUMNS => &local.z[j - 1],
            j => &local.colour[j - COLUMNS],
        });
        let mut next = 0;
        for i in 0..=local.rank {
            let mut weighted = [0.0; VECTORS * LANES];
            for v in 0..VECTORS {
                let w = vector(simd, columns[i], v) * vector(simd, &local.weights, v);
                w.store_slice(&mut weighted[v * LANES..(v + 1) * LANES]);
            }
            let mut j = i;
            while j <= local.rank {
                // Four at a time; what lies beyond the rank is multiplied for nothing and not kept.
                let four =
                    products(simd, &weighted, std::array::from_fn::<_, 4, _>(|t| columns[(j + t).min(COLUMNS - 1)]));
                for t in 0..4.min(local.rank + 1 - j) {
                    sums[next + j - i + t][l] = four[t];
                }
                j += 4;
            }
            next += COLUMNS - i;
            let right = products(simd, &weighted, [columns[COLUMNS], columns[COLUMNS + 1], columns[COLUMNS + 2]]);
            for c in 0..3 {
                sums[next + c][l] = right[c];
            }
            sums[next + 3][l] = if i == 0 { 1.0 } else { 0.0 };
            next += RIGHT;
        }
    }
    let mut vectors = [f32x16::splat(simd, 0.0); SUMS];
    for i in 0..SUMS {
        vectors[i] = f32x16::from_slice(simd, &sums[i]);
    }
    solve::<S, COLUMNS, RIGHT>(simd, &vectors)
}

/// Section 5.2: the bandwidth at which squared bias and variance add up to the least. The bias of an estimate is how far
/// it lies from those of smaller bandwidths, beyond what their noise explains.
fn best_bandwidth(estimates: &[[f32; 3]; BANDWIDTHS.len()], variances: &[f32; BANDWIDTHS.len()]) -> usize {
    let error = |i: usize| {
        let bias2 = |j: usize| {
            let squares = (0..3).map(|c| (estimates[i][c] - estimates[j][c]).powi(2)).sum::<f32>() / 3.0;
            squares - DOUBT * (variances[j] - variances[i]).max(0.0)
        };
        (0..i).map(bias2).fold(0.0, f32::max) + variances[i]
    };
    (1..BANDWIDTHS.len()).fold(0, |best, i| if error(i) < error(best) { i } else { best })
}
