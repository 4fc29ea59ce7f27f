//! The joint fit: least squares with the halves of the reference as instruments.

/// Columns of the fit: the predictors u1 and u2 (detail lost) away from edges, s (light across edges), g (stale light), u1
/// and u2 again near edges, and once more where g acts. The detail that a blur across edges takes on its own side is so separated
/// from the blur of surfaces; and what is blurred more there than elsewhere, a mirror in which things move, is not taken for stale.
pub const COUNT: usize = 8;
/// u1 away from edges.
pub const U1: usize = 0;
/// s.
pub const S: usize = 2;
/// g.
pub const G: usize = 3;
/// u1 near edges; u2 follows.
const U1_NEAR_EDGES: usize = 4;
/// u1 where g acts; u2 follows.
const U1_WHERE_STALE: usize = 6;

/// One pixel's predictors as they are kept: u1, u2, s, g.
pub type Row = [f32; 4];

/// One pixel's predictors in the fit.
pub type Columns = [f32; COUNT];

/// The predictors of a pixel that is near an edge or not. Where its g is not 0 light may be stale.
#[inline]
pub fn columns([u1, u2, s, g]: &Row, near: bool) -> Columns {
    let mut columns = [0.0, 0.0, *s, *g, 0.0, 0.0, 0.0, 0.0];
    let first = match (*g != 0.0, near) {
        (true, _) => U1_WHERE_STALE,
        (false, true) => U1_NEAR_EDGES,
        (false, false) => U1,
    };
    columns[first] = *u1;
    columns[first + 1] = *u2;
    columns
}

/// Sums over the pixels of a sequence, in f64.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Pixels.
    pub pixels: u64,
    /// Pixels where the predictor is large enough to speak of.
    pub covered: [u64; COUNT],
    /// Instruments times predictors: sum of x_A x_B.
    pub zx: [[f64; COUNT]; COUNT],
    /// Noise energy of one half: the sum of (x_A - x_B)^2 / 2.
    pub noise: [f64; COUNT],
}

impl Sums {
    /// One more pixel: the predictors on both halves (the same twice where there is one).
    pub fn add(&mut self, a: &Columns, b: &Columns, least: f32) {
        self.pixels += 1;
        for i in 0..COUNT {
            self.covered[i] += u64::from(a[i].abs() > least);
            let difference = f64::from(a[i] - b[i]);
            self.noise[i] += 0.5 * difference * difference;
            for j in 0..COUNT {
                self.zx[i][j] += f64::from(a[i]) * f64::from(b[j]);
            }
        }
    }

    /// The signal of a predictor in units of one half's noise: root of the ratio of energies. Infinite without noise.
    pub fn signal_to_noise(&self, i: usize) -> f64 {
        (self.zx[i][i].max(0.0) / self.noise[i]).sqrt()
    }
}

/// Solves sum z_i y = sum_j (sum z_i x_j) c_j for the predictors that are `used`; the others' coefficients are 0. `None`
/// where the predictors in use cannot be separated.
pub fn solve(sums: &Sums, zy: &[f64; COUNT], used: [bool; COUNT]) -> Option<[f64; COUNT]> {
    let chosen: Vec<usize> = (0..COUNT).filter(|&i| used[i]).collect();
    let n = chosen.len();
    let mut rows: Vec<Vec<f64>> =
        chosen.iter().map(|&i| chosen.iter().map(|&j| sums.zx[i][j]).chain(std::iter::once(zy[i])).collect()).collect();
    for column in 0..n {
        let pivot = (column..n).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(column, pivot);
        let scale = sums.zx[chosen[column]][chosen[column]].abs();
        if rows[column][column].abs() <= 1e-9 * scale || !rows[column][column].is_finite() {
            return None;
        }
        for r in column + 1..n {
            let factor = rows[r][column] / rows[column][column];
            for k in column..=n {
                rows[r][k] -= factor * rows[column][k];
            }
        }
    }
    let mut found = [0.0; COUNT];
    for r in (0..n).rev() {
        let known: f64 = (r + 1..n).map(|k| rows[r][k] * found[chosen[k]]).sum();
        found[chosen[r]] = (rows[r][n] - known) / rows[r][r];
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Predictors with noise in both halves; the response has the noise of half B.
    fn sums_and_response(noise: f32, coefficients: [f32; COUNT]) -> (Sums, [f64; COUNT], [f64; COUNT]) {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
        };
        let (mut sums, mut zy, mut naive) = (Sums::default(), [0.0; COUNT], [0.0; COUNT]);
        for _ in 0..40_000 {
            let truth: Columns = std::array::from_fn(|_| random());
            let (na, nb): (Columns, Columns) =
                (std::array::from_fn(|_| noise * random()), std::array::from_fn(|_| noise * random()));
            let a: Columns = std::array::from_fn(|i| truth[i] + na[i]);
            let b: Columns = std::array::from_fn(|i| truth[i] + nb[i]);
            // e_B falls where the noise of the reference rises, as it does in e = P(D) - P(R).
            let y: f32 = (0..COUNT).map(|i| coefficients[i] * truth[i] - nb[i]).sum();
            sums.add(&a, &b, 0.1);
            for i in 0..COUNT {
                zy[i] += f64::from(a[i]) * f64::from(y);
                naive[i] += f64::from(b[i]) * f64::from(y);
            }
        }
        (sums, zy, naive)
    }

    #[test]
    fn halves_as_instruments_remove_the_bias_of_the_references_noise() {
        let expected = [0.3, 0.0, 0.1, 0.7, 0.2, 0.0, 0.5, 0.0];
        let (sums, zy, naive) = sums_and_response(0.5, expected);
        let found = solve(&sums, &zy, [true; COUNT]).unwrap();
        for i in 0..COUNT {
            assert!((found[i] - f64::from(expected[i])).abs() < 0.03, "{found:?}");
        }
        // A canary: with the noise of the same half on both sides the answer is wrong.
        let biased = solve(&sums, &naive, [true; COUNT]).unwrap();
        assert!((biased[U1] - 0.3).abs() > 0.15, "{biased:?}");
        assert!((1.5..2.5).contains(&sums.signal_to_noise(U1)), "{}", sums.signal_to_noise(U1));
    }

    #[test]
    fn a_mirror_that_is_blurred_more_than_the_rest_is_not_stale() {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
        };
        // In every tenth pixel the picture moves otherwise than the surface: what was there is the mean of other detail, so that
        // g = h - P(R) holds less this pixel's own detail, as u1 = E(P(R)) - P(R) does.
        let mut solved = |apart: bool| {
            let (mut sums, mut zy) = (Sums::default(), [0.0; COUNT]);
            for k in 0..40_000 {
                let (detail, u2, mirror) = (random(), 0.3 * random(), k % 10 == 0);
                let g = if mirror { 0.3 * random() - 0.8 * detail } else { 0.0 };
                let lost = if mirror { 0.8 } else { 0.1 };
                let columns = match (columns(&[-detail, u2, 0.0, g], false), apart) {
                    (columns, true) => columns,
                    (columns, false) => [-detail, u2, columns[S], columns[G], 0.0, 0.0, 0.0, 0.0],
                };
                sums.add(&columns, &columns, 0.1);
                for (sum, column) in zy.iter_mut().zip(columns) {
                    *sum += f64::from(column) * f64::from(-lost * detail);
                }
            }
            solve(&sums, &zy, [true, true, false, true, false, false, apart, apart]).unwrap()
        };
        let found = solved(true);
        assert!(
            found[G].abs() < 1e-3 && (found[U1] - 0.1).abs() < 1e-3 && (found[U1_WHERE_STALE] - 0.8).abs() < 1e-3,
            "{found:?}"
        );
        // A canary: with one coefficient of blur for all, the mirror's blur counts as stale light.
        let together = solved(false);
        assert!(together[G] > 0.3, "{together:?}");
    }

    #[test]
    fn what_is_not_used_is_left_out_and_nothing_to_fit_is_no_answer() {
        let (sums, zy, _) = sums_and_response(0.0, [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let found = solve(&sums, &zy, [true, true, false, false, true, true, true, true]).unwrap();
        assert!((found[U1] - 0.3).abs() < 1e-3 && found[G] == 0.0, "{found:?}");
        assert_eq!(solve(&Sums::default(), &[0.0; COUNT], [true; COUNT]), None);
        assert_eq!(solve(&sums, &zy, [false; COUNT]), Some([0.0; COUNT]));
    }
}
