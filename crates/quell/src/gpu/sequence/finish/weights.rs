//! Weights of the nets of `stabilise` and `blend` as the shaders read them: runs of four numbers.

use crate::kernels::conv::{ConvNet, Layer};
use crate::kernels::net::Net;

/// Runs that the first net of `stabilise` takes: two hidden layers of eight units, and three runs of outputs.
pub(in crate::gpu) const SHARE_NET: u32 = (2 + 2 * 11) + (2 + 2 * 8) + (3 + 3 * 8);
/// Runs of the last layer but one of `blend`, after which the last one's lie.
pub(in crate::gpu) const LAST_LAYER: u32 = 4 + 12 * 9 * 16;

fn runs(values: impl Iterator<Item = f32>, count: usize, out: &mut Vec<f32>) {
    let end = out.len() + 4 * count;
    out.extend(values);
    // Runs are filled up with zeros.
    out.resize(end, 0.0);
}

/// Appends a net whose outputs are filled up to three runs: of each layer what is added, then a row for each input.
pub(super) fn net<const I: usize, const O: usize>(net: &Net<I, 8, 8, O>, out: &mut Vec<f32>) {
    runs(net.first.1.into_iter(), 2, out);
    net.first.0.iter().for_each(|row| runs(row.iter().copied(), 2, out));
    runs(net.second.1.into_iter(), 2, out);
    net.second.0.iter().for_each(|row| runs(row.iter().copied(), 2, out));
    runs(net.third.1.into_iter(), 3, out);
    net.third.0.iter().for_each(|row| runs(row.iter().copied(), 3, out));
}

/// Appends a layer: what is added; then for each group of four inputs, pixel of the window and input a row of outputs.
pub(super) fn layer(layer: &Layer, out: &mut Vec<f32>) {
    let (taps, count) = (layer.side * layer.side, layer.outputs.div_ceil(4));
    runs(layer.bias.iter().copied(), count, out);
    for group in 0..layer.inputs.div_ceil(4) {
        for (tap, c) in (0..taps).flat_map(|tap| (0..4).map(move |c| (tap, 4 * group + c))) {
            let of = |o: usize| layer.weights.get((o * layer.inputs + c) * taps + tap).copied().unwrap_or(0.0);
            let outputs = if c < layer.inputs { layer.outputs } else { 0 };
            runs((0..outputs).map(of), count, out);
        }
    }
}

/// The first layer of a net, which reads one pixel: what is added; then for each input what is taken away, by what the rest is
/// multiplied, and a row of outputs.
pub(super) fn first(net: &ConvNet, out: &mut Vec<f32>) {
    let layer = &net.layers[0];
    let count = layer.outputs.div_ceil(4);
    runs(layer.bias.iter().copied(), count, out);
    for (i, (mean, scale)) in net.mean.iter().zip(&net.scale).enumerate() {
        runs([*mean, *scale].into_iter(), 1, out);
        runs((0..layer.outputs).map(|o| layer.weights[o * layer.inputs + i]), count, out);
    }
}

/// As a buffer holds them.
pub(super) fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::{blend, stabilise};

    #[test]
    fn shaders_find_weights_where_they_lie() {
        let mut out = Vec::new();
        net(stabilise::nets().0, &mut out);
        assert_eq!(out.len() as u32, 4 * SHARE_NET);
        let mut out = Vec::new();
        layer(&blend::net().layers[6], &mut out);
        assert_eq!(out.len() as u32, 4 * LAST_LAYER);
    }
}
