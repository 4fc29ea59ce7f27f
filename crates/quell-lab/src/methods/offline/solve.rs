//! Small weighted least squares for many pixels at a time: normal equations in the lanes of vectors, solved by LDL^T.
//!
//! A general crate solves one system after another; here 16 systems are accumulated side by side in single precision
//! and solved side by side in double. `nalgebra` is the twin in the tests. Figures: docs/baselines-offline.md.

use super::image::LANES;
use fearless_simd::prelude::*;
use fearless_simd::{f32x16, f64x8};

/// A column whose weighted mean square is below this counts as constant (features have unit range).
const CONSTANT: f64 = 1e-10;
/// A column that those before it explain up to this share of its square is left out: its coefficient is 0. Sums in
/// single precision are not trusted beyond it.
const DEPENDENT: f64 = 1e-5;

/// Number of sums for `n` columns and `c` right-hand sides: rows of the upper triangle, each followed by its products
/// with the right-hand sides.
pub const fn sums(n: usize, c: usize) -> usize {
    n * (n + 1) / 2 + n * c
}

/// Solves sum of w (y - x . b)^2 -> min in each lane. `sums` are those of w x_i x_j (j >= i) and of w x_i y, packed as
/// [`sums`] says; column 0 is the constant 1. Columns that are constant or depend on earlier ones get the coefficient 0.
#[inline(always)]
pub fn solve<S: Simd, const N: usize, const C: usize>(simd: S, sums: &[f32x16<S>]) -> [[f32x16<S>; C]; N] {
    let mut solution = [[f32x16::splat(simd, 0.0); C]; N];
    for half in 0..2 {
        // Rows of the augmented matrix, upper triangle.
        let zero = f64x8::splat(simd, 0.0);
        let mut rows = [[zero; N]; N];
        let mut right = [[zero; C]; N];
        let mut next = 0;
        for i in 0..N {
            for j in i..N + C {
                let (low, high) = sums[next].widen();
                next += 1;
                let value = if half == 0 { low } else { high };
                if j < N { rows[i][j] = value } else { right[i][j - N] = value }
            }
        }
        let least = rows[0][0] * f64x8::splat(simd, CONSTANT);
        let mut limits = [zero; N];
        for i in 1..N {
            limits[i] = (rows[i][i] * f64x8::splat(simd, DEPENDENT)).max(least);
        }
        for i in 0..N {
            let pivot = rows[i][i];
            let kept = pivot.simd_gt(limits[i]);
            let inverse = kept.select(f64x8::splat(simd, 1.0) / pivot, zero);
            for j in i + 1..N {
                let factor = rows[i][j] * inverse;
                for k in j..N {
                    rows[j][k] -= factor * rows[i][k];
                }
                for c in 0..C {
                    right[j][c] -= factor * right[i][c];
                }
            }
            for j in i + 1..N {
                rows[i][j] *= inverse;
            }
            for c in 0..C {
                right[i][c] *= inverse;
            }
        }
        for i in (0..N).rev() {
            for k in i + 1..N {
                for c in 0..C {
                    right[i][c] -= rows[i][k] * right[k][c];
                }
            }
            for c in 0..C {
                let lanes = &mut solution[i][c];
                for l in 0..LANES / 2 {
                    lanes[half * LANES / 2 + l] = right[i][c][l] as f32;
                }
            }
        }
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    const N: usize = 5;
    const TRIANGLE: usize = sums(N, 1);

    /// The twin: singular values of the weighted rows themselves, in double precision, by `nalgebra`.
    fn by_singular_values(columns: &[[f32; N]], right: &[f32]) -> [f64; N] {
        let rows = nalgebra::DMatrix::from_fn(columns.len(), N, |r, c| f64::from(columns[r][c]));
        let right = nalgebra::DVector::from_iterator(right.len(), right.iter().map(|&y| f64::from(y)));
        let solution = rows.svd(true, true).solve(&right, 1e-9).unwrap();
        std::array::from_fn(|i| solution[i])
    }

    /// The largest difference between what two models say about the rows, over the largest right-hand side.
    fn apart(columns: &[[f32; N]], right: &[f32], found: &[f32; N], twin: &[f64; N]) -> f64 {
        let largest = right.iter().fold(0.0_f64, |l, &y| l.max(f64::from(y).abs()));
        let says =
            |row: &[f32; N]| (0..N).map(|i| f64::from(row[i]) * (f64::from(found[i]) - twin[i])).sum::<f64>().abs();
        columns.iter().map(says).fold(0.0, f64::max) / largest
    }

    fn solved(columns: &[[f32; N]], right: &[f32]) -> [f32; N] {
        let mut packed = [0.0_f32; TRIANGLE];
        for (row, y) in columns.iter().zip(right) {
            let mut next = 0;
            for i in 0..N {
                for j in i..=N {
                    packed[next] += row[i] * if j < N { row[j] } else { *y };
                    next += 1;
                }
            }
        }
        dispatch!(Level::new(), simd => {
            let mut sums = [f32x16::splat(simd, 0.0); TRIANGLE];
            for i in 0..TRIANGLE {
                sums[i] = f32x16::splat(simd, packed[i]);
            }
            let solution = solve::<_, N, 1>(simd, &sums);
            // Every lane gets the same answer.
            std::array::from_fn(|i| if solution[i][0][3] == solution[i][0][12] { solution[i][0][3] } else { f32::NAN })
        })
    }

    fn numbers(seed: u32) -> impl FnMut() -> f32 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        }
    }

    fn rows(count: usize, seed: u32) -> Vec<[f32; N]> {
        let mut next = numbers(seed);
        (0..count).map(|_| [1.0, next(), next(), next(), next()]).collect()
    }

    #[test]
    fn agrees_with_a_general_crate() {
        for seed in 0..200 {
            let columns = rows(40, 3 * seed + 1);
            let mut next = numbers(3 * seed + 2);
            let right: Vec<f32> = columns.iter().map(|r| (r[1] * 7.0).sin() + r[2] * r[3] + next()).collect();
            let (found, twin) = (solved(&columns, &right), by_singular_values(&columns, &right));
            for i in 0..N {
                assert!((f64::from(found[i]) - twin[i]).abs() < 1e-4, "{seed}: {found:?} {twin:?}");
            }
        }
    }

    /// A column that others almost explain: its coefficient means little, but what the model says about the rows must
    /// be right, whether the column is kept or left out.
    #[test]
    fn almost_singular_systems_predict_as_a_general_crate_does() {
        for seed in 0..200 {
            // From clearly independent to equal within rounding.
            let independence = 10.0_f32.powi(-((seed % 8) as i32));
            let mut columns = rows(40, 5 * seed + 1);
            for row in &mut columns {
                row[4] = 0.5 * row[1] - row[3] + 0.25 + independence * row[4];
            }
            let mut next = numbers(5 * seed + 2);
            let tilt = next();
            let right: Vec<f32> = columns.iter().map(|r| 1.0 + r[1] - 2.0 * r[2] + tilt * r[4]).collect();
            let (found, twin) = (solved(&columns, &right), by_singular_values(&columns, &right));
            let apart = apart(&columns, &right, &found, &twin);
            assert!(apart < 1e-4, "{seed}, independence {independence}: {apart}, {found:?} {twin:?}");
        }
        // The canary: another model is found out.
        let columns = rows(40, 1);
        let right: Vec<f32> = columns.iter().map(|r| r[1]).collect();
        assert!(apart(&columns, &right, &[0.0, 0.999, 0.0, 0.0, 0.0], &by_singular_values(&columns, &right)) > 1e-4);
    }

    #[test]
    fn dependent_and_constant_columns_get_nothing_and_do_no_harm() {
        let mut columns = rows(40, 1);
        for row in &mut columns {
            row[3] = 2.0 * row[1] - row[2] + 0.5;
            row[4] = 0.0;
        }
        let right: Vec<f32> = columns.iter().map(|r| 3.0 + r[1] - 2.0 * r[2] + 4.0 * r[3]).collect();
        let found = solved(&columns, &right);
        assert_eq!(found[3..], [0.0, 0.0]);
        for (row, y) in columns.iter().zip(&right) {
            let model: f32 = (0..N).map(|i| row[i] * found[i]).sum();
            assert!((model - y).abs() < 1e-4, "{model} for {y}");
        }
    }
}
