//! Means over seeds with their 95 % intervals.

use serde::{Deserialize, Serialize};

/// A mean and how far the true one may be away, with 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Mean over seeds.
    pub mean: f64,
    /// Half of the interval's width; `None` of a single value.
    pub half_width: Option<f64>,
    /// Number of values.
    pub seeds: usize,
}

impl Interval {
    /// Of independent values: mean +- t s / sqrt(n), s with n - 1 in its denominator, t the 97.5 % quantile of Student's
    /// distribution with n - 1 degrees of freedom. `None` of none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        if n == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let half_width = (n > 1).then(|| student_t(n - 1) * (squares / (n - 1) as f64 / n as f64).sqrt());
        Some(Self { mean, half_width, seeds: n })
    }
}

/// The 97.5 % quantile of Student's distribution, to three decimals for up to 10 degrees of freedom; beyond, Fisher's
/// expansion about the normal quantile (Abramowitz and Stegun 26.7.5), right to 0.003.
fn student_t(freedom: usize) -> f64 {
    const FIRST: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];
    const Z: f64 = 1.959_964;
    if let Some(t) = freedom.checked_sub(1).and_then(|i| FIRST.get(i)) {
        return *t;
    }
    let n = freedom.max(1) as f64;
    let (z3, z5) = (Z.powi(3), Z.powi(5));
    Z + (z3 + Z) / (4.0 * n) + (5.0 * z5 + 16.0 * z3 + 3.0 * Z) / (96.0 * n * n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_values_have_the_textbook_interval() {
        let found = Interval::of(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!(found.mean, 3.0);
        // s = sqrt(2.5), t(4) = 2.776.
        let half = found.half_width.unwrap();
        assert!((half - 2.776 * (2.5_f64 / 5.0).sqrt()).abs() < 1e-12, "{half}");
        assert_eq!(Interval::of(&[7.0]).unwrap().half_width, None);
        assert_eq!(Interval::of(&[]), None);
        for (freedom, t) in [(11, 2.201), (20, 2.086), (30, 2.042), (120, 1.980)] {
            assert!((student_t(freedom) - t).abs() < 3e-3, "{freedom}: {}", student_t(freedom));
        }
    }
}
