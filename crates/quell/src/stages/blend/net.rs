//! The net: two hidden layers of rectified linear units.

use super::weights::{BIAS_1, BIAS_2, BIAS_3, HIDDEN_1, HIDDEN_2, OUTPUTS, WEIGHTS_1, WEIGHTS_2, WEIGHTS_3};
use super::{INPUTS, Inputs};

/// Sums in the order of the inputs, so that every instruction set gives the same bits.
#[inline(always)]
pub(super) fn run(inputs: &Inputs) -> [f32; OUTPUTS] {
    let mut first: [f32; HIDDEN_1] = BIAS_1;
    for i in 0..INPUTS {
        for k in 0..HIDDEN_1 {
            first[k] += WEIGHTS_1[i][k] * inputs[i];
        }
    }
    let mut second: [f32; HIDDEN_2] = BIAS_2;
    for i in 0..HIDDEN_1 {
        let value = first[i].max(0.0);
        for k in 0..HIDDEN_2 {
            second[k] += WEIGHTS_2[i][k] * value;
        }
    }
    let mut out: [f32; OUTPUTS] = BIAS_3;
    for i in 0..HIDDEN_2 {
        let value = second[i].max(0.0);
        for k in 0..OUTPUTS {
            out[k] += WEIGHTS_3[i][k] * value;
        }
    }
    out
}
