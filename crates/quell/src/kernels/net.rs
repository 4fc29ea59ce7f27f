//! A small net: two hidden layers of rectified linear units.

#[cfg(feature = "cpu")]
use fearless_simd::{Simd, f32x16, prelude::*};

/// Weights of a net of `I` inputs, `H` and `G` hidden units and `O` outputs, as `benchmarks/nets` writes them: a row for each of
/// what a layer reads, then what it adds.
#[derive(Debug)]
pub(crate) struct Net<const I: usize, const H: usize, const G: usize, const O: usize> {
    pub first: ([[f32; H]; I], [f32; H]),
    pub second: ([[f32; G]; H], [f32; G]),
    pub third: ([[f32; O]; G], [f32; O]),
}

impl<const I: usize, const H: usize, const G: usize, const O: usize> Net<I, H, G, O> {
    /// The outputs. Sums are taken in the order of the inputs, so that every instruction set gives the same bits.
    #[inline(always)]
    pub(crate) fn run(&self, inputs: &[f32; I]) -> [f32; O] {
        let first = rectified(layer(&self.first, inputs));
        let second = rectified(layer(&self.second, &first));
        layer(&self.third, &second)
    }

    /// [`Self::run`] for sixteen pixels at once, to the bit.
    #[inline(always)]
    #[cfg(feature = "cpu")]
    pub(crate) fn run_lanes<S: Simd>(&self, simd: S, inputs: &[f32x16<S>; I]) -> [f32x16<S>; O] {
        let first = rectified_lanes(simd, layer_lanes(simd, &self.first, inputs));
        let second = rectified_lanes(simd, layer_lanes(simd, &self.second, &first));
        layer_lanes(simd, &self.third, &second)
    }
}

#[inline(always)]
#[cfg(feature = "cpu")]
fn rectified_lanes<const N: usize, S: Simd>(simd: S, mut values: [f32x16<S>; N]) -> [f32x16<S>; N] {
    let zero = f32x16::splat(simd, 0.0);
    for k in 0..N {
        values[k] = values[k].max(zero);
    }
    values
}

/// A sum at a time, which stays in a register through all inputs.
#[inline(always)]
#[cfg(feature = "cpu")]
fn layer_lanes<const I: usize, const O: usize, S: Simd>(
    simd: S,
    (weights, bias): &([[f32; O]; I], [f32; O]),
    inputs: &[f32x16<S>; I],
) -> [f32x16<S>; O] {
    let mut out = [f32x16::splat(simd, 0.0); O];
    for k in 0..O {
        let mut sum = f32x16::splat(simd, bias[k]);
        for i in 0..I {
            sum += inputs[i] * weights[i][k];
        }
        out[k] = sum;
    }
    out
}

/// Not by `map`: that is a function of its own, compiled for narrow vectors.
#[inline(always)]
fn rectified<const N: usize>(mut values: [f32; N]) -> [f32; N] {
    for value in &mut values {
        *value = value.max(0.0);
    }
    values
}

#[inline(always)]
fn layer<const I: usize, const O: usize>((weights, bias): &([[f32; O]; I], [f32; O]), inputs: &[f32; I]) -> [f32; O] {
    let mut out = *bias;
    for i in 0..I {
        for k in 0..O {
            out[k] += weights[i][k] * inputs[i];
        }
    }
    out
}
