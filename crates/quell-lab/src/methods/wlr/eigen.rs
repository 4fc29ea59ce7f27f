//! Singular vectors of a window's features: eigenvectors of their products.

use super::DIMENSIONS;

/// Eigenvalues, and eigenvectors as columns, of the leading `count` rows and columns of a symmetric matrix: Jacobi's
/// rotations, in the order of rows. Nine unknowns at most, a million times a picture.
pub(super) fn eigen(
    m: &[[f32; DIMENSIONS]; DIMENSIONS],
    count: usize,
) -> ([f32; DIMENSIONS], [[f32; DIMENSIONS]; DIMENSIONS]) {
    /// Sweeps converge quadratically: six leave nothing that single precision shows.
    const SWEEPS: usize = 6;
    /// Elements below this part of the trace count as 0.
    const NEGLIGIBLE: f32 = 1e-6;
    let mut a = *m;
    let mut vectors = [[0.0; DIMENSIONS]; DIMENSIONS];
    for i in 0..DIMENSIONS {
        vectors[i][i] = 1.0;
    }
    let least = NEGLIGIBLE * (0..count).map(|i| a[i][i]).sum::<f32>();
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..count {
            for q in p + 1..count {
                if a[p][q].abs() <= least {
                    continue;
                }
                rotated = true;
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..count {
                    let (kp, kq) = (a[k][p], a[k][q]);
                    (a[k][p], a[k][q]) = (c * kp - s * kq, s * kp + c * kq);
                }
                // Whole rows: constant length, so the compiler takes them at once.
                for k in 0..DIMENSIONS {
                    let (pk, qk) = (a[p][k], a[q][k]);
                    (a[p][k], a[q][k]) = (c * pk - s * qk, s * pk + c * qk);
                    // Transposed: eigenvectors as rows.
                    let (pk, qk) = (vectors[p][k], vectors[q][k]);
                    (vectors[p][k], vectors[q][k]) = (c * pk - s * qk, s * pk + c * qk);
                }
            }
        }
        if !rotated {
            break;
        }
    }
    (std::array::from_fn(|i| a[i][i]), std::array::from_fn(|i| std::array::from_fn(|j| vectors[j][i])))
}
