//! Sixteen pixels of a row on lanes.

use super::halves::{widen, widen_eight};
use fearless_simd::{Simd, f32x16, i32x16, prelude::*, u32x16};
use half::f16;

/// Pixels of a row that filters work on at once, through all taps: their sums stay in registers.
pub(crate) const BLOCK: usize = 16;

/// Sixteen values of a row from column `at` on; 0 beyond its ends. Without `EDGE` all must lie within the row: no function is called
/// then, so that a loop around keeps its sums in registers.
#[inline(always)]
pub(crate) fn load<const EDGE: bool, S: Simd>(simd: S, row: &[f32], at: isize) -> f32x16<S> {
    if let Some(run) = run::<BLOCK, f32>(row, at) {
        return f32x16::from_slice(simd, run);
    }
    if EDGE { at_edge(row, at).simd_into(simd) } else { f32x16::splat(simd, 0.0) }
}

/// [`load`] of a row that begins at `from` in `data` and is `w` wide. Without `EDGE` its bounds are not looked at one by one.
#[inline(always)]
pub(crate) fn load_row<const EDGE: bool, S: Simd>(
    simd: S,
    data: &[f32],
    from: usize,
    w: usize,
    at: isize,
) -> f32x16<S> {
    if EDGE { load::<true, _>(simd, &data[from..][..w], at) } else { load::<false, _>(simd, data, from as isize + at) }
}

#[inline(always)]
fn run<const N: usize, T>(row: &[T], at: isize) -> Option<&[T; N]> {
    row.get(at as usize..)?.first_chunk()
}

/// [`load`] of what lies within `data` by what is known of it: from `start` on, which is no more than `isize::MAX`. One comparison, where
/// [`load`] takes five instructions.
#[inline(always)]
pub(crate) fn load_within<S: Simd>(simd: S, data: &[f32], start: usize) -> f32x16<S> {
    // That the sum does not overflow is plain to the compiler so.
    let start = start & (usize::MAX >> 1);
    match data.get(start..start + BLOCK) {
        Some(run) => f32x16::from_slice(simd, run),
        None => f32x16::splat(simd, 0.0),
    }
}

#[cold]
fn at_edge(row: &[f32], at: isize) -> [f32; BLOCK] {
    let mut found = [0.0; BLOCK];
    overlap(row, at, &mut found);
    found
}

/// Copies what of the row from column `at` on there is.
#[inline(always)]
fn overlap<T: Copy>(row: &[T], at: isize, out: &mut [T; BLOCK]) {
    let (from, to) = (at.max(0) as usize, (at + BLOCK as isize).clamp(0, row.len() as isize) as usize);
    // Columns before the row are left out: from - at, which is not negative.
    if let (Some(there), Some(out)) = (row.get(from..to), out.get_mut(from.wrapping_sub(at as usize)..)) {
        out.iter_mut().zip(there).for_each(|(out, value)| *out = *value);
    }
}

/// The same of half floats.
#[inline(always)]
pub(crate) fn load_halves<const EDGE: bool, S: Simd>(simd: S, row: &[f16], at: isize) -> f32x16<S> {
    if let Some([a, b]) = run::<BLOCK, f16>(row, at).map(split) {
        return widen_eight(simd, a).combine(widen_eight(simd, b));
    }
    if EDGE { halves_at_edge(row, at).simd_into(simd) } else { f32x16::splat(simd, 0.0) }
}

/// [`load_within`] of half floats.
#[inline(always)]
pub(crate) fn load_halves_within<S: Simd>(simd: S, data: &[f16], start: usize) -> f32x16<S> {
    let start = start & (usize::MAX >> 1);
    let run = match data.get(start..start + BLOCK) {
        Some(run) => run.first_chunk(),
        None => None,
    };
    match run.map(split) {
        Some([a, b]) => widen_eight(simd, a).combine(widen_eight(simd, b)),
        None => f32x16::splat(simd, 0.0),
    }
}

#[inline(always)]
fn split(run: &[f16; BLOCK]) -> [[f16; BLOCK / 2]; 2] {
    bytemuck::cast(*run)
}

#[cold]
fn halves_at_edge(row: &[f16], at: isize) -> [f32; BLOCK] {
    let mut found = [f16::ZERO; BLOCK];
    overlap(row, at, &mut found);
    std::array::from_fn(|i| widen(found[i]))
}

/// Writes sixteen values from column `x` on, as far as the row goes.
#[inline(always)]
pub(crate) fn store<S: Simd>(values: f32x16<S>, row: &mut [f32], x: usize) {
    if let Some(run) = row.get_mut(x..x + BLOCK) {
        values.store_slice(run);
        return;
    }
    let values: [f32; BLOCK] = values.into();
    row[x..].iter_mut().zip(values).for_each(|(out, value)| *out = value);
}

/// [`exp2`](crate::stages::blend::exp2) on lanes, to the bit.
#[inline(always)]
pub(crate) fn exp2<S: Simd>(simd: S, x: f32x16<S>) -> f32x16<S> {
    let (least, most) = (f32x16::splat(simd, -60.0), f32x16::splat(simd, 60.0));
    // What is no number stays none.
    let x = x.simd_lt(least).select(least, x);
    let x = x.simd_gt(most).select(most, x);
    let whole = x.floor();
    let t = x - whole;
    let p = (((t * 0.079_125_2) + 0.224_946_3) * t + 0.695_928_5) * t + 1.0;
    let scale = (whole.to_int::<i32x16<S>>() + i32x16::splat(simd, 127)) << 23;
    scale.bitcast::<f32x16<S>>() * p
}

/// [`log2`](crate::stages::blend::log2) on lanes, to the bit.
#[inline(always)]
pub(crate) fn log2<S: Simd>(simd: S, x: f32x16<S>) -> f32x16<S> {
    let bits = x.bitcast::<u32x16<S>>();
    let exponent = (bits >> 23).bitcast::<i32x16<S>>() - i32x16::splat(simd, 127);
    let mantissa = (bits & u32x16::splat(simd, 0x007f_ffff)) | u32x16::splat(simd, 0x3f80_0000);
    let m = mantissa.bitcast::<f32x16<S>>() - 1.0;
    let p = (m - 1.0) * (m * (m * (m * 0.044_004_7 - 0.146_314_3) + 0.266_029_9) - 0.441_740_3) + 1.0;
    exponent.to_float::<f32x16<S>>() + m * p
}

/// Of the columns from `at` on: 1 where they lie in a row of `w`, else 0.
#[cold]
pub(crate) fn inside(at: isize, w: usize) -> [f32; BLOCK] {
    std::array::from_fn(|i| if (0..w as isize).contains(&(at + i as isize)) { 1.0 } else { 0.0 })
}

/// True where every one of sixteen columns from `at` on lies in a row of `w`.
#[inline(always)]
pub(crate) fn whole(at: isize, w: usize) -> bool {
    at >= 0 && at + BLOCK as isize <= w as isize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_have_the_bits_of_one_lane() {
        let values: Vec<f32> = (-700..700).map(|i| i as f32 * 0.097).chain([f32::NAN, -0.0, 1e9, -1e30]).collect();
        crate::simd::dispatch!(crate::simd::level(), simd => {
            for some in values.chunks(BLOCK) {
                let found: [f32; BLOCK] = exp2(simd, load::<true, _>(simd, some, 0)).into();
                for (found, x) in found.into_iter().zip(some) {
                    let expected = crate::stages::blend::exp2(*x);
                    assert!(found.to_bits() == expected.to_bits() || x.is_nan() && found.is_nan(), "{x}");
                }
            }
        });
    }

    #[test]
    fn logarithms_have_the_bits_of_one_lane() {
        let values: Vec<f32> = (1..900).map(|i| (i as f32 * 0.1 - 45.0).exp() * (1.0 + 0.003 * i as f32)).collect();
        let values: Vec<f32> = values.into_iter().chain([1.0, f32::MAX, f32::INFINITY, 1e-40, 0.0]).collect();
        crate::simd::dispatch!(crate::simd::level(), simd => {
            for some in values.chunks(BLOCK) {
                let found: [f32; BLOCK] = log2(simd, load::<true, _>(simd, some, 0)).into();
                for (found, x) in found.into_iter().zip(some) {
                    assert_eq!(found.to_bits(), crate::stages::blend::log2(*x).to_bits(), "{x}");
                }
            }
        });
    }

    #[test]
    fn what_lies_beyond_a_row_is_zero() {
        let row: Vec<f32> = (0..19).map(|i| 1.0 + i as f32).collect();
        let halves: Vec<f16> = row.iter().map(|v| f16::from_f32(*v)).collect();
        crate::simd::dispatch!(crate::simd::level(), simd => {
            for at in -20..22isize {
                let expected: [f32; BLOCK] = std::array::from_fn(|i| {
                    let x = at + i as isize;
                    if (0..19).contains(&x) { 1.0 + x as f32 } else { 0.0 }
                });
                let found: [f32; BLOCK] = load::<true, _>(simd, &row, at).into();
                assert_eq!(found, expected, "{at}");
                let found: [f32; BLOCK] = load_halves::<true, _>(simd, &halves, at).into();
                assert_eq!(found, expected, "{at}");
                if whole(at, 19) {
                    let found: [f32; BLOCK] = load::<false, _>(simd, &row, at).into();
                    assert_eq!(found, expected, "{at}");
                    let found: [f32; BLOCK] = load_halves::<false, _>(simd, &halves, at).into();
                    assert_eq!(found, expected, "{at}");
                }
                assert_eq!(inside(at, 19), expected.map(|v| if v > 0.0 { 1.0 } else { 0.0 }), "{at}");
                assert_eq!(whole(at, 19), expected.iter().all(|v| *v > 0.0), "{at}");
            }
            let mut out = vec![0.0; 19];
            for x in [0, 16] {
                store(load::<true, _>(simd, &row, x as isize), &mut out, x);
            }
            assert_eq!(out, row);
        });
    }
}
