//! Stage 5 on rows.

use crate::kernels::math::lerp;

/// Largest distrust, 1 - confidence, of each element's neighbours within `radius` along a row.
#[inline(always)]
pub(crate) fn widest(confidence: &[f32], radius: usize, out: &mut [f32]) {
    // 1 - x falls with x, rounding included: the maximum of distrust belongs to the minimum of confidence.
    out.copy_from_slice(confidence);
    for d in 1..=radius.min(confidence.len() - 1) {
        let n = confidence.len() - d;
        keep(&mut out[..n], &confidence[d..], |a, b| if b < a { b } else { a });
        keep(&mut out[d..], &confidence[..n], |a, b| if b < a { b } else { a });
    }
    for value in out {
        *value = 1.0 - *value;
    }
}

/// The greater of two rows, element by element.
#[inline(always)]
pub(crate) fn keep_greater(out: &mut [f32], row: &[f32]) {
    keep(out, row, |a, b| if b > a { b } else { a });
}

#[inline(always)]
fn keep(out: &mut [f32], row: &[f32], choose: impl Fn(f32, f32) -> f32) {
    for (a, b) in out.iter_mut().zip(row) {
        *a = choose(*a, *b);
    }
}

/// Adds a row.
#[inline(always)]
pub(crate) fn add(out: &mut [f32], row: &[f32]) {
    for (a, b) in out.iter_mut().zip(row) {
        *a += *b;
    }
}

/// Mean of each element's neighbours within `radius` along a row, summed from the left; the window is cut at the ends.
#[inline(always)]
pub(crate) fn blurred(row: &[f32], radius: usize, out: &mut [f32]) {
    let n = row.len();
    out.fill(0.0);
    for d in (1..=radius.min(n - 1)).rev() {
        add(&mut out[d..], &row[..n - d]);
    }
    add(out, row);
    for d in 1..=radius.min(n - 1) {
        add(&mut out[..n - d], &row[d..]);
    }
    let whole = (2 * radius + 1) as f32;
    let edge = radius.min(n);
    let interior = edge..(n - edge).max(edge);
    for i in (0..interior.start).chain(interior.end..n) {
        out[i] /= ((i + radius + 1).min(n) - i.saturating_sub(radius)) as f32;
    }
    for value in &mut out[interior] {
        *value /= whole;
    }
}

/// The blend of a channel.
#[inline(always)]
pub(crate) fn blend(temporal: &[f32], prefiltered: &[f32], distrust: &[f32], floor: f32, out: &mut [f32]) {
    let n = out.len();
    let (temporal, prefiltered, distrust) = (&temporal[..n], &prefiltered[..n], &distrust[..n]);
    for i in 0..n {
        let k = if distrust[i] > floor { distrust[i] } else { floor };
        out[i] = lerp(temporal[i], prefiltered[i], k);
    }
}
