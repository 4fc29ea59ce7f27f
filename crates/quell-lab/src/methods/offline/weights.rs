//! Non-local means (Rousselle, Knaus, Zwicker 2012, section 4): weights from the distance of patches, by offsets.
//!
//! For one offset of the window the distance of all pixels of a tile to their neighbours is one image; its box sums are
//! the distances of patches. So the cost does not grow with the patch's area times the window's.

use super::image::{Image, LANES, MARGIN};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16, i32x16};
use quell::Size;
use rayon::prelude::*;

/// Columns and rows of a tile; its weights for one offset fit the first cache.
pub const TILE: Size = Size::new(4 * LANES, 16);
/// Tiles that are held before they are put together.
const TILES_AT_ONCE: usize = 64;
/// Largest radii of window and patch; their sum stays within the margin.
const LARGEST_PATCH: usize = 3;
const DISTANCES: Size = Size::new(TILE.width + LANES, TILE.height + 2 * LARGEST_PATCH);
/// Keeps 0 / 0 from pixels without variance (the paper's epsilon).
const EPSILON: f32 = 1e-10;

/// Window, patch and strength of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    /// R: the window has (2 R + 1)^2 pixels; at most 12.
    pub radius: usize,
    /// F: a patch has (2 F + 1)^2 pixels; at most 3.
    pub patch: usize,
    /// k: distances are compared with k times the standard deviation. Higher: smoother.
    pub k: f32,
}

/// A channel with the variance of its pixels.
#[derive(Clone, Copy)]
pub struct Noisy<'a> {
    /// Mean of the samples.
    pub value: &'a Image,
    /// Variance of that mean.
    pub variance: &'a Image,
}

/// A feature that bounds the weights (Rousselle, Manzi, Zwicker 2013, section 5).
#[derive(Clone)]
pub struct Bound<'a> {
    /// The feature, prefiltered, of unit range.
    pub value: &'a Image,
    /// What variance is left; `None`: noise-free.
    pub variance: Option<&'a Image>,
    /// 1 / (k_f^2 max(tau, V, |grad f|^2)).
    pub per_square: Image,
}

/// What weights are made from.
#[derive(Clone, Default)]
pub struct Guide<'a> {
    /// Patches of these are compared. None: every patch is the same.
    pub colour: Vec<Noisy<'a>>,
    /// Each bounds the weight of a pair of pixels.
    pub features: Vec<Bound<'a>>,
}

/// A part of the image.
#[derive(Clone, Copy, Debug)]
pub struct Tile {
    /// First column, a multiple of [`LANES`].
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Vectors of [`LANES`] columns.
    pub groups: usize,
    /// Rows.
    pub rows: usize,
}

/// The weights of a tile for one offset, rows of [`TILE`]'s width.
pub type TileWeights = [f32; TILE.width * TILE.height];

/// All tiles of an image, row by row.
pub fn tiles(size: Size) -> Vec<Tile> {
    let mut tiles = Vec::new();
    for y in (0..size.height).step_by(TILE.height) {
        for x in (0..size.width).step_by(TILE.width) {
            let groups = (size.width - x).min(TILE.width).div_ceil(LANES);
            tiles.push(Tile { x, y, groups, rows: (size.height - y).min(TILE.height) });
        }
    }
    tiles
}

/// Computes all tiles on all threads and takes their results in order: the same bits with any number of threads.
pub fn each_tile<T: Send>(size: Size, compute: impl Fn(Tile) -> T + Sync, mut take: impl FnMut(Tile, T)) {
    for tiles in tiles(size).chunks(TILES_AT_ONCE) {
        let results: Vec<T> = tiles.par_iter().map(|&tile| compute(tile)).collect();
        tiles.iter().zip(results).for_each(|(&tile, result)| take(tile, result));
    }
}

/// [`LANES`] pixels from element `i` on.
#[inline(always)]
fn load<S: Simd>(simd: S, image: &Image, i: usize) -> f32x16<S> {
    f32x16::from_slice(simd, &image.data()[i..i + LANES])
}

/// Distances beyond this have the weight 0, not 1e-15: beside a pixel's own weight of 1 single precision shows no
/// difference, and products of smaller weights would be subnormal, which costs processors a hundred cycles each.
const FARTHEST: f32 = 35.0;

/// exp(-x) for x >= 0, to about 2e-7; 0 beyond [`FARTHEST`].
#[inline(always)]
fn exp_minus<S: Simd>(simd: S, x: f32x16<S>) -> f32x16<S> {
    let near = x.simd_lt(f32x16::splat(simd, FARTHEST));
    let t = x.min(f32x16::splat(simd, FARTHEST)) * f32x16::splat(simd, -std::f32::consts::LOG2_E);
    let whole = t.floor();
    let f = t - whole;
    // Taylor's series of 2^f about 1/2, by powers of (f - 1/2) ln 2.
    let u = (f - f32x16::splat(simd, 0.5)) * f32x16::splat(simd, std::f32::consts::LN_2);
    let mut series = f32x16::splat(simd, 1.0 / 5040.0);
    for coefficient in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        series = series.mul_add(u, f32x16::splat(simd, coefficient));
    }
    let power: i32x16<S> = (whole + f32x16::splat(simd, 127.0)).to_int::<i32x16<S>>() << 23;
    let value = series * f32x16::splat(simd, std::f32::consts::SQRT_2) * power.bitcast::<f32x16<S>>();
    near.select(value, f32x16::splat(simd, 0.0))
}

/// Makes the weights of a tile, offset by offset in reading order, and shows each to `visit(number, dx, dy, weights)`.
/// Weights of neighbours outside the image are 0: `inside` is 1 in the image and 0 in its margin.
#[inline(always)]
pub fn each_offset<S: Simd>(
    simd: S,
    guide: &Guide<'_>,
    kernel: &Kernel,
    inside: &Image,
    tile: Tile,
    mut visit: impl FnMut(usize, isize, isize, &TileWeights),
) {
    let radius = kernel.radius.min(MARGIN - LARGEST_PATCH - 1) as isize;
    let patch = kernel.patch.min(LARGEST_PATCH);
    let stride = inside.stride();
    let mut distances = [0.0_f32; DISTANCES.width * DISTANCES.height];
    let mut columns = [0.0_f32; DISTANCES.width];
    let mut weights = [0.0_f32; TILE.width * TILE.height];
    let side = 2 * patch + 1;
    let per_patch = f32x16::splat(simd, 1.0 / (side * side * guide.colour.len().max(1)) as f32);
    let k2 = f32x16::splat(simd, kernel.k * kernel.k);
    let blocks = tile.groups + usize::from(patch > 0);
    for (number, (dy, dx)) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dy, dx))).enumerate() {
        let offset = dy * stride as isize + dx;
        // 2012, equation 2: the squared distance of pixels less what their noise explains, in units of it.
        for row in 0..tile.rows + 2 * patch {
            let begin = inside.index(tile.x, tile.y) + row * stride - patch * stride - patch;
            for block in 0..blocks {
                let p = begin + block * LANES;
                let q = p.wrapping_add_signed(offset);
                let mut sum = f32x16::splat(simd, 0.0);
                for channel in &guide.colour {
                    let (vp, vq) = (load(simd, channel.variance, p), load(simd, channel.variance, q));
                    let u = load(simd, channel.value, p) - load(simd, channel.value, q);
                    let explained = vp + vp.min(vq);
                    sum += (u * u - explained) / (vp + vq).mul_add(k2, f32x16::splat(simd, EPSILON));
                }
                sum.store_slice(&mut distances[row * DISTANCES.width + block * LANES..][..LANES]);
            }
        }
        // Equation 3: the mean over the patch, columns first.
        for row in 0..tile.rows {
            for block in 0..blocks {
                let mut sum = f32x16::splat(simd, 0.0);
                for j in 0..side {
                    let begin = (row + j) * DISTANCES.width + block * LANES;
                    sum += f32x16::from_slice(simd, &distances[begin..begin + LANES]);
                }
                sum.store_slice(&mut columns[block * LANES..][..LANES]);
            }
            for group in 0..tile.groups {
                let mut sum = f32x16::splat(simd, 0.0);
                for i in 0..side {
                    sum += f32x16::from_slice(simd, &columns[group * LANES + i..][..LANES]);
                }
                // Equation 4; 2013, equation 7: the smaller weight of colour and features is the larger distance.
                let mut distance = (sum * per_patch).max(f32x16::splat(simd, 0.0));
                let p = inside.index(tile.x + group * LANES, tile.y + row);
                let q = p.wrapping_add_signed(offset);
                for feature in &guide.features {
                    let f = load(simd, feature.value, p) - load(simd, feature.value, q);
                    let mut square = f * f;
                    if let Some(variance) = feature.variance {
                        let (vp, vq) = (load(simd, variance, p), load(simd, variance, q));
                        square -= vp + vp.min(vq);
                    }
                    distance = distance.max(square * load(simd, &feature.per_square, p));
                }
                let weight = exp_minus(simd, distance) * load(simd, inside, q);
                weight.store_slice(&mut weights[row * TILE.width + group * LANES..][..LANES]);
            }
        }
        visit(number, dx, dy, &weights);
    }
}

/// What [`filter`] makes.
pub struct Filtered<const C: usize> {
    /// The filtered channels.
    pub channels: [Image; C],
    /// The share of each pixel's own value in its result: 1 / sum of weights.
    pub own_share: Image,
}

/// Weighted means over the window, with weights from `guide`, of any channels (2012, equation 1).
pub fn filter<const C: usize>(level: Level, guide: &Guide<'_>, kernel: &Kernel, input: [&Image; C]) -> Filtered<C> {
    let size = input[0].size();
    let inside = Image::filled(size, 1.0);
    let mut filtered = Filtered { channels: input.map(|i| Image::filled(i.size(), 0.0)), own_share: inside.clone() };
    let compute = |tile: Tile| {
        let mut sums = vec![[0.0_f32; TILE.width * TILE.height]; C];
        let mut total = [0.0_f32; TILE.width * TILE.height];
        dispatch!(level, simd => each_offset(simd, guide, kernel, &inside, tile, #[inline(always)] |_, dx, dy, weights| {
            for row in 0..tile.rows {
                for group in 0..tile.groups {
                    let at = row * TILE.width + group * LANES;
                    let p = inside.index(tile.x + group * LANES, tile.y + row);
                    let q = p.wrapping_add_signed(dy * inside.stride() as isize + dx);
                    let w = f32x16::from_slice(simd, &weights[at..at + LANES]);
                    (f32x16::from_slice(simd, &total[at..at + LANES]) + w).store_slice(&mut total[at..at + LANES]);
                    for c in 0..C {
                        let (image, sum) = (input[c], &mut sums[c][at..at + LANES]);
                        w.mul_add(load(simd, image, q), f32x16::from_slice(simd, sum)).store_slice(sum);
                    }
                }
            }
        }));
        (sums, total)
    };
    each_tile(size, compute, |tile, (sums, total)| {
        for row in 0..tile.rows {
            for column in 0..(tile.groups * LANES).min(size.width - tile.x) {
                let at = row * TILE.width + column;
                // The pixel's own weight is 1.
                let share = 1.0 / total[at].max(1.0);
                let (x, y) = (tile.x + column, tile.y + row);
                filtered.own_share.set(x, y, share);
                for (image, sum) in filtered.channels.iter_mut().zip(&sums) {
                    image.set(x, y, sum[at] * share);
                }
            }
        }
    });
    filtered.channels.iter_mut().for_each(Image::repeat_edges);
    filtered.own_share.repeat_edges();
    filtered
}
