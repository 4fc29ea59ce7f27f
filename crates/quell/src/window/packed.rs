//! Colours of a frame that waits in the window, in half precision: what neighbours read of it.
//!
//! A sample is rounded to 11 bits, a fiftieth of a percent; path-traced noise is thousands of times as large. What half
//! precision does not reach is kept in full beside it, so that no value is lost. Files hold half floats mostly: they
//! lose nothing at all.

use crate::frame::Rgb;
use crate::kernels::halves::widen;
use crate::par;
use crate::plane::{Plane, Size};
use half::f16;
use half::slice::HalfFloatSliceExt;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stands for a pixel that is kept in full: half precision's infinity, which no finite colour becomes.
const BEYOND: f16 = f16::INFINITY;
pub(super) fn fits(value: f32) -> bool {
    value.abs() <= f16::MAX.to_f32_const()
}

/// Numbers in half precision, where that holds all of them to the bit; `nan`: what is no number counts as held.
pub(super) fn exact_halves<const N: usize>(values: &[[f32; N]], nan: bool) -> Option<Vec<[f16; N]>> {
    // Converted a piece at a time: asked for one number, `half` looks each time for the instruction.
    const PIECE: usize = 1 << 12;
    let lost = AtomicBool::new(false);
    let mut halves = vec![[f16::ZERO; N]; values.len()];
    par::rows(&mut halves, PIECE, |i, halves| {
        if lost.load(Ordering::Relaxed) {
            return;
        }
        let values = values[i * PIECE..][..halves.len()].as_flattened();
        let halves = halves.as_flattened_mut();
        halves.convert_from_f32_slice(values);
        let mut back = par::unset_scratch(values.len());
        halves.convert_to_f32_slice(&mut back);
        let exact =
            |(value, back): (&f32, &f32)| (fits(*value) & (back.to_bits() == value.to_bits())) | (nan & value.is_nan());
        if !values.iter().zip(&*back).fold(true, |all, pair| all & exact(pair)) {
            lost.store(true, Ordering::Relaxed);
        }
    });
    (!lost.into_inner()).then_some(halves)
}

/// A colour as it is kept: rounded to half precision, where that holds it.
pub(crate) fn half_or_full(colour: Rgb) -> Rgb {
    if colour.iter().all(|v| fits(*v)) { colour.map(|v| f16::from_f32(v).to_f32()) } else { colour }
}

/// Some colours a pixel, pixel by pixel: a tap reads one run of memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed {
    pub planes: usize,
    /// Of each pixel the red of every plane, then the green, then the blue.
    pub data: Vec<f16>,
    /// Colours that half precision does not hold, with their places (pixel * `planes` + plane), ascending.
    pub beyond: Vec<(usize, Rgb)>,
}

impl Packed {
    /// `value(plane, pixel)` must be finite.
    pub(crate) fn new(size: Size, planes: usize, value: impl Fn(usize, usize) -> Rgb + Sync) -> Self {
        Self::by_rows(size, planes, |y, row| {
            for (x, pixel) in row.chunks_exact_mut(3 * planes).enumerate() {
                for k in 0..planes {
                    for (c, v) in value(k, y * size.width + x).into_iter().enumerate() {
                        pixel[c * planes + k] = v;
                    }
                }
            }
        })
    }

    /// `fill(y, row)` writes the values of a row, in the order of [`Self::data`]; they must be finite.
    pub(crate) fn by_rows(size: Size, planes: usize, fill: impl Fn(usize, &mut [f32]) + Sync) -> Self {
        let length = 3 * planes * size.width;
        let mut data: Vec<f16> = par::zeros(length * size.height);
        if data.is_empty() {
            return Self { planes, data, beyond: Vec::new() };
        }
        let some_beyond = AtomicBool::new(false);
        par::rows(&mut data, length, |y, row| {
            // Rounded a row at once: asked for one number, `half` looks each time for the instruction.
            let mut floats = par::unset_scratch(length);
            fill(y, &mut floats);
            if floats.iter().fold(false, |beyond, v| beyond | !fits(*v)) {
                some_beyond.store(true, Ordering::Relaxed);
                for pixel in floats.chunks_exact_mut(3 * planes) {
                    for k in 0..planes {
                        let places = [k, planes + k, 2 * planes + k];
                        if !places.iter().all(|c| fits(pixel[*c])) {
                            places.into_iter().for_each(|c| pixel[c] = f32::INFINITY);
                        }
                    }
                }
            }
            row.convert_from_f32_slice(&floats);
        });
        let mut beyond = Vec::new();
        if some_beyond.into_inner() {
            let mut floats = par::unset_scratch(length);
            for (y, row) in data.chunks_exact(length).enumerate().filter(|(_, row)| row.contains(&BEYOND)) {
                fill(y, &mut floats);
                let pixels = row.chunks_exact(3 * planes).zip(floats.chunks_exact(3 * planes));
                for (x, (halves, values)) in pixels.enumerate() {
                    for k in (0..planes).filter(|k| halves[*k] == BEYOND) {
                        let place = (y * size.width + x) * planes + k;
                        beyond.push((place, [values[k], values[planes + k], values[2 * planes + k]]));
                    }
                }
            }
        }
        Self { planes, data, beyond }
    }

    /// Colour `plane` of the pixels of a row.
    pub(crate) fn row(&self, plane: usize, y: usize, out: &mut [Rgb]) {
        let (w, planes) = (out.len(), self.planes);
        let mut floats = par::unset_scratch(3 * planes * w);
        self.data[3 * planes * w * y..][..3 * planes * w].convert_to_f32_slice(&mut floats);
        for (x, (out, pixel)) in out.iter_mut().zip(floats.chunks_exact(3 * planes)).enumerate() {
            *out = [pixel[plane], pixel[planes + plane], pixel[2 * planes + plane]];
            if out[0] == f32::INFINITY {
                *out = self.at(plane, y * w + x);
            }
        }
    }

    /// Channel `c` of colour `plane` of the pixels of a row.
    #[cfg(feature = "cpu")]
    pub(crate) fn channel(&self, plane: usize, c: usize, y: usize, out: &mut [f32]) {
        self.some(plane, c..c + 1, y, out);
    }

    /// Colour `plane` of the pixels of a row, three channels one after the other.
    #[cfg(feature = "cpu")]
    pub(crate) fn channels(&self, plane: usize, y: usize, out: &mut [f32]) {
        self.some(plane, 0..3, y, out);
    }

    #[cfg(feature = "cpu")]
    fn some(&self, plane: usize, channels: std::ops::Range<usize>, y: usize, out: &mut [f32]) {
        /// Pixels that are converted at once, all their channels, while they are near.
        const PIECE: usize = 64;
        let (w, length) = (out.len() / channels.len(), 3 * self.planes);
        if self.beyond.is_empty() {
            let mut halves = [f16::ZERO; PIECE];
            let pieces = self.data[length * w * y..][..length * w].chunks(PIECE * length);
            for (k, pixels) in pieces.enumerate() {
                for (out, c) in out.chunks_exact_mut(w).zip(channels.clone()) {
                    let out = &mut out[PIECE * k..(PIECE * (k + 1)).min(w)];
                    for (half, pixel) in halves.iter_mut().zip(pixels.chunks_exact(length)) {
                        *half = pixel[c * self.planes + plane];
                    }
                    halves[..out.len()].convert_to_f32_slice(out);
                }
            }
        } else {
            for (out, c) in out.chunks_exact_mut(w.max(1)).zip(channels) {
                out.iter_mut().enumerate().for_each(|(x, out)| *out = self.at(plane, y * w + x)[c]);
            }
        }
    }

    /// Colour `plane` of a pixel.
    #[inline(always)]
    pub(crate) fn at(&self, plane: usize, pixel: usize) -> Rgb {
        let c = self.halves(plane, pixel);
        if c[0] == BEYOND { self.kept(pixel * self.planes + plane) } else { c.map(widen) }
    }

    /// The same as it is kept: infinite where half precision does not hold it.
    #[inline(always)]
    pub(crate) fn halves(&self, plane: usize, pixel: usize) -> [f16; 3] {
        let run = &self.data[3 * pixel * self.planes..][..3 * self.planes];
        [run[plane], run[self.planes + plane], run[2 * self.planes + plane]]
    }

    #[cold]
    fn kept(&self, place: usize) -> Rgb {
        self.beyond.binary_search_by_key(&place, |(at, _)| *at).map_or([0.0; 3], |i| self.beyond[i].1)
    }
}

/// Colours of which nothing is lost, what multiplies a light back for one: in half precision where that holds them, else as they came.
#[derive(Clone)]
pub(crate) enum Weight {
    Half(Vec<[f16; 3]>),
    Full(Plane<Rgb>),
}

impl Weight {
    pub(crate) fn new(plane: &Plane<Rgb>) -> Self {
        exact_halves(plane.data(), false).map_or_else(|| Self::Full(plane.clone()), Self::Half)
    }

    #[inline(always)]
    pub(crate) fn at(&self, pixel: usize) -> Rgb {
        match self {
            Self::Half(data) => data[pixel].map(widen),
            Self::Full(plane) => plane.data()[pixel],
        }
    }

    /// Multiplies light of the pixels from `first` on.
    #[inline(always)]
    #[cfg(feature = "cpu")]
    pub(crate) fn multiply(&self, first: usize, light: &mut [Rgb]) {
        let n = light.len();
        match self {
            Self::Half(data) => {
                let weights = data[first..][..n].as_flattened();
                for (light, weight) in light.as_flattened_mut().iter_mut().zip(weights) {
                    *light *= widen(*weight);
                }
            }
            Self::Full(plane) => {
                let weights = plane.data()[first..][..n].as_flattened();
                for (light, weight) in light.as_flattened_mut().iter_mut().zip(weights) {
                    *light *= weight;
                }
            }
        }
    }

    /// As it came.
    pub(crate) fn plane(&self, size: Size) -> Plane<Rgb> {
        par::plane(size, |x, y| self.at(y * size.width + x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_kept() {
        let size = Size::new(3, 2);
        let value = |k: usize, i: usize| match (k, i) {
            (1, 4) => [1e9, -2.0, 0.1],
            (0, 5) => [0.5, 0.5, 65505.0],
            _ => [k as f32, i as f32, -0.25],
        };
        let packed = Packed::new(size, 2, value);
        for (k, i) in (0..2).flat_map(|k| (0..6).map(move |i| (k, i))) {
            assert_eq!(packed.at(k, i), value(k, i));
        }
        assert_eq!(packed.beyond.len(), 2);
        for (k, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let mut row = [[0.0; 3]; 3];
            packed.row(k, y, &mut row);
            assert_eq!(row, [0, 1, 2].map(|x| value(k, 3 * y + x)));
        }
        assert_eq!(Packed::new(size, 0, value).data.len(), 0);
    }

    /// Wider than a piece, with colours that half precision does not hold and without.
    #[cfg(feature = "cpu")]
    #[test]
    fn channels_are_those_of_the_pixels() {
        let size = Size::new(70, 2);
        for large in [0.5, 1e9] {
            let value = |k: usize, i: usize| [k as f32, 0.25 * i as f32, if i == 67 { large } else { -1.0 }];
            let packed = Packed::new(size, 3, value);
            for (k, y) in [(0, 1), (2, 0)] {
                let (mut all, mut one) = ([0.0; 210], [0.0; 70]);
                packed.channels(k, y, &mut all);
                for c in 0..3 {
                    packed.channel(k, c, y, &mut one);
                    let expected: Vec<_> = (0..70).map(|x| value(k, 70 * y + x)[c]).collect();
                    assert_eq!((&all[70 * c..][..70], &one[..]), (&expected[..], &expected[..]));
                }
            }
        }
    }

    #[test]
    fn weights_lose_nothing() {
        let size = Size::new(4, 1);
        for value in [0.25f32, 0.3] {
            let plane = Plane::filled(size, [value, 1.0, 0.0]);
            let weight = Weight::new(&plane);
            assert_eq!(weight.plane(size), plane);
            assert_eq!(matches!(weight, Weight::Half(_)), value == 0.25);
        }
    }
}
