//! One level of detail of an image, its lookup, and how the next coarser one is made.

use super::{Encoding, Filter, Sampler, Wrap};
use glam::{Vec2, Vec4};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Linear values of the 256 codes of sRGB (IEC 61966-2-1).
static LINEAR_OF_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let v = code as f64 / 255.0;
        (if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// Linear values of the 256 codes of sRGB.
#[cfg(feature = "gpu")]
pub(crate) fn linear_of_srgb() -> [f32; 256] {
    *LINEAR_OF_SRGB
}

/// The nearest code of a linear value.
fn srgb_of_linear(value: f32) -> u8 {
    let v = if value <= 0.003_130_8 { value * 12.92 } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
    unit_code(v)
}

fn unit_code(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Texels row by row, at least one.
#[derive(Clone)]
pub(super) struct Level {
    width: usize,
    height: usize,
    texels: Vec<[u8; 4]>,
}

impl Level {
    /// `texels` has width * height entries, at least one.
    pub(super) fn new(width: usize, height: usize, texels: Vec<[u8; 4]>) -> Self {
        Self { width, height, texels }
    }

    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn height(&self) -> usize {
        self.height
    }

    pub(super) fn bytes(&self) -> usize {
        self.texels.len() * 4
    }

    /// Row by row.
    #[cfg(feature = "gpu")]
    pub(super) fn texels(&self) -> &[[u8; 4]] {
        &self.texels
    }

    #[inline]
    pub(super) fn texel(&self, x: usize, y: usize, encoding: Encoding) -> Vec4 {
        linear(self.texels[y * self.width + x], encoding)
    }

    /// Whether a texel's colours are all 0.
    pub(super) fn is_black(&self, x: usize, y: usize) -> bool {
        self.texels.get(y * self.width + x).is_none_or(|t| t[..3] == [0; 3])
    }

    /// The value between the texels about `uv`, which is finite.
    #[inline]
    pub(super) fn filtered(&self, uv: Vec2, sampler: &Sampler, filter: Filter, encoding: Encoding) -> Vec4 {
        match filter {
            Filter::Nearest => {
                let x = nearest(uv.x, self.width, sampler.wrap_s);
                let y = nearest(uv.y, self.height, sampler.wrap_t);
                self.texel(x, y, encoding)
            }
            Filter::Linear => {
                let (x, fx) = pair(uv.x, self.width, sampler.wrap_s);
                let (y, fy) = pair(uv.y, self.height, sampler.wrap_t);
                let top = self.texel(x[0], y[0], encoding).lerp(self.texel(x[1], y[0], encoding), fx);
                let bottom = self.texel(x[0], y[1], encoding).lerp(self.texel(x[1], y[1], encoding), fx);
                top.lerp(bottom, fy)
            }
        }
    }

    /// Alpha alone.
    #[inline]
    pub(super) fn alpha(&self, uv: Vec2, sampler: &Sampler) -> f32 {
        let at = |x: usize, y: usize| f32::from(self.texels[y * self.width + x][3]) * (1.0 / 255.0);
        match sampler.mag {
            Filter::Nearest => {
                at(nearest(uv.x, self.width, sampler.wrap_s), nearest(uv.y, self.height, sampler.wrap_t))
            }
            Filter::Linear => {
                let (x, fx) = pair(uv.x, self.width, sampler.wrap_s);
                let (y, fy) = pair(uv.y, self.height, sampler.wrap_t);
                let top = at(x[0], y[0]) * (1.0 - fx) + at(x[1], y[0]) * fx;
                let bottom = at(x[0], y[1]) * (1.0 - fx) + at(x[1], y[1]) * fx;
                top * (1.0 - fy) + bottom * fy
            }
        }
    }
}

#[inline]
fn linear(texel: [u8; 4], encoding: Encoding) -> Vec4 {
    let [r, g, b, a] = texel;
    let unit = |code: u8| f32::from(code) * (1.0 / 255.0);
    match encoding {
        Encoding::Linear => Vec4::new(unit(r), unit(g), unit(b), unit(a)),
        Encoding::Srgb => {
            let table = &*LINEAR_OF_SRGB;
            Vec4::new(table[usize::from(r)], table[usize::from(g)], table[usize::from(b)], unit(a))
        }
    }
}

/// Texel coordinates beyond this have lost their fraction anyway; within it `i64` and `f32` agree.
const FAR: f32 = 1e9;

/// The texel under a coordinate.
#[inline]
fn nearest(coordinate: f32, extent: usize, wrap: Wrap) -> usize {
    wrapped((coordinate * extent as f32).clamp(-FAR, FAR).floor() as i64, extent, wrap)
}

/// The two texels about a coordinate and the share of the second.
#[inline]
fn pair(coordinate: f32, extent: usize, wrap: Wrap) -> ([usize; 2], f32) {
    let position = (coordinate * extent as f32 - 0.5).clamp(-FAR, FAR);
    let first = position.floor();
    let index = first as i64;
    ([wrapped(index, extent, wrap), wrapped(index + 1, extent, wrap)], position - first)
}

/// A texel index within the image.
#[inline]
fn wrapped(index: i64, extent: usize, wrap: Wrap) -> usize {
    let n = extent as i64;
    let inside = match wrap {
        _ if index >= 0 && index < n => index,
        Wrap::Repeat => index.rem_euclid(n),
        Wrap::Clamp => index.clamp(0, n - 1),
        Wrap::Mirror => {
            let folded = index.rem_euclid(2 * n);
            if folded < n { folded } else { 2 * n - 1 - folded }
        }
    };
    inside as usize
}

/// Levels 1 and up of an image, each about half the extent of the one before, to a single texel. Averages are exact
/// for any extent: every texel weighs by its area, in linear values, and only the result is rounded to 8 bits.
pub(super) fn coarser_levels(base: &Level, encoding: Encoding) -> Vec<Level> {
    let mut levels = Vec::new();
    let (mut width, mut height) = (base.width, base.height);
    let mut values: Vec<Vec4> = Vec::new();
    while width > 1 || height > 1 {
        let next_width = (width / 2).max(1);
        let next_height = (height / 2).max(1);
        let columns = shares(width, next_width);
        let rows = shares(height, next_height);
        let source = |x: usize, y: usize| match values.get(y * width + x) {
            Some(value) => *value,
            None => base.texel(x, y, encoding),
        };
        let averaged: Vec<Vec4> = (0..next_height)
            .into_par_iter()
            .flat_map_iter(|y| {
                let (source, columns, row) = (&source, &columns, &rows[y]);
                columns.iter().map(move |column| {
                    let mut sum = Vec4::ZERO;
                    for &(sy, wy) in row {
                        for &(sx, wx) in column {
                            sum += source(sx, sy) * (wx * wy);
                        }
                    }
                    sum
                })
            })
            .collect();
        let texels = averaged
            .par_iter()
            .map(|v| {
                let code = |c: f32| if encoding == Encoding::Srgb { srgb_of_linear(c) } else { unit_code(c) };
                [code(v.x), code(v.y), code(v.z), unit_code(v.w)]
            })
            .collect();
        levels.push(Level::new(next_width, next_height, texels));
        values = averaged;
        (width, height) = (next_width, next_height);
    }
    levels
}

/// For each of `count` equal parts of a row of `extent` texels: which texels it covers, and their shares of it.
fn shares(extent: usize, count: usize) -> Vec<Vec<(usize, f32)>> {
    let size = extent as f64 / count as f64;
    (0..count)
        .map(|i| {
            let (start, end) = (i as f64 * size, (i + 1) as f64 * size);
            let last = (end.ceil() as usize).min(extent);
            (start as usize..last)
                .map(|x| (x, ((end.min(x as f64 + 1.0) - start.max(x as f64)) / size) as f32))
                .filter(|(_, share)| *share > 0.0)
                .collect()
        })
        .collect()
}
