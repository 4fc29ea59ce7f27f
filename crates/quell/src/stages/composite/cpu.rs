//! The composite on rows.

/// Adds a signal times its weight.
#[inline(always)]
pub(crate) fn add(signal: &[f32], weight: &[f32], sum: &mut [f32]) {
    let n = sum.len();
    let (signal, weight) = (&signal[..n], &weight[..n]);
    for i in 0..n {
        sum[i] += weight[i] * signal[i];
    }
}
