//! Helpers of the unit tests: a chi-squared test of directional samplers.

use crate::sampler::mix;
use glam::{Vec2, Vec3};
use std::f64::consts::TAU;

/// A right sampler is rejected with this probability per test. Seeds are fixed, so a test that passes keeps passing;
/// the level says how surprised to be by a failure.
pub(crate) const SIGNIFICANCE: f64 = 1e-4;

/// Cells whose expected count is below this are pooled (the usual rule is 5).
const MIN_EXPECTED: f64 = 10.0;

const CELLS_S: usize = 16;
const CELLS_T: usize = 24;
const SAMPLES: usize = 200_000;
const SEED: u64 = 0x5eed_9e11;

/// White noise for tests.
pub(crate) struct Noise(u64);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(mix(seed ^ SEED))
    }

    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(1);
        (mix(self.0) >> 40) as f32 / (1u64 << 24) as f32
    }

    pub(crate) fn next_2d(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }

    pub(crate) fn next_3d(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    pub(crate) fn direction(&mut self) -> Vec3 {
        crate::warp::uniform_sphere(self.next_2d())
    }
}

/// A map of the sphere of directions to the unit square, on whose cells the test counts. Equal areas in cos and
/// azimuth about a pole, or stretched towards the pole so that narrow lobes fill many cells.
pub(crate) struct SphereDomain {
    pole: Vec3,
    tangent: Vec3,
    bitangent: Vec3,
    /// s = (1 - sqrt(width / (x + width))) / s_max with x = 1 - cos; infinite: plain cos.
    width: f64,
    /// Largest 1 - cos: 2 for the sphere, 1 for the hemisphere (what lies beyond counts in the last cells).
    x_max: f64,
}

impl SphereDomain {
    pub(crate) fn around(pole: Vec3) -> Self {
        Self::stretched(pole, f64::INFINITY)
    }

    /// Half of the cells lie within about 1 - cos < `width` of the pole.
    pub(crate) fn stretched(pole: Vec3, width: f64) -> Self {
        let (tangent, bitangent) = pole.any_orthonormal_pair();
        Self { pole, tangent, bitangent, width, x_max: 2.0 }
    }

    /// The hemisphere about the pole only, its edge being an edge of cells.
    pub(crate) fn hemisphere(self) -> Self {
        Self { x_max: 1.0, ..self }
    }

    /// What makes s run to 1.
    fn tail(&self) -> f64 {
        1.0 - (self.width / (self.x_max + self.width)).sqrt()
    }

    /// Direction of (s, t) and the solid angle per unit of the square there.
    fn direction(&self, s: f64, t: f64) -> (Vec3, f64) {
        let (x, dx_ds) = if self.width.is_infinite() {
            (self.x_max * s, self.x_max)
        } else {
            // y = x / (x + w) runs over [0, y_max]; 1 - y is a square, which flattens the long tails of GGX.
            let root = 1.0 - s * self.tail();
            let y = 1.0 - root * root;
            let dy_ds = 2.0 * root * self.tail();
            (self.width * y / (1.0 - y), dy_ds * self.width / ((1.0 - y) * (1.0 - y)))
        };
        let sin = (x * (2.0 - x)).max(0.0).sqrt();
        let phi = TAU * t;
        let w = self.tangent.as_dvec3() * (sin * phi.cos())
            + self.bitangent.as_dvec3() * (sin * phi.sin())
            + self.pole.as_dvec3() * (1.0 - x);
        (w.as_vec3().normalize(), dx_ds * TAU)
    }

    fn coordinates(&self, w: Vec3) -> (f64, f64) {
        let w = w.as_dvec3().normalize();
        // 1 - cos from the difference vector: w.pole has no digits left near the pole.
        let x = 0.5 * (w - self.pole.as_dvec3()).length_squared();
        let s = if self.width.is_infinite() {
            x / self.x_max
        } else {
            (1.0 - (self.width / (x + self.width)).sqrt()) / self.tail()
        };
        let phi = w.dot(self.bitangent.as_dvec3()).atan2(w.dot(self.tangent.as_dvec3()));
        (s, (phi / TAU).rem_euclid(1.0))
    }
}

/// Pearson's statistic and degrees of freedom of `sample` against `pdf`; `None` samples count in a cell of their own,
/// whose expectation is what the density lacks to 1.
pub(crate) fn chi_squared(
    domain: &SphereDomain,
    pdf: impl Fn(Vec3) -> f32,
    sample: impl Fn(Vec3) -> Option<Vec3>,
) -> (f64, usize) {
    let mut counts = vec![0usize; CELLS_S * CELLS_T];
    let mut missing = 0usize;
    let mut noise = Noise::new(1);
    for _ in 0..SAMPLES {
        match sample(noise.next_3d()) {
            Some(w) => {
                let (s, t) = domain.coordinates(w);
                let i = ((s * CELLS_S as f64) as usize).min(CELLS_S - 1);
                let j = ((t * CELLS_T as f64) as usize).min(CELLS_T - 1);
                counts[i * CELLS_T + j] += 1;
            }
            None => missing += 1,
        }
    }
    // Expected counts by the midpoint rule within each cell.
    const FINE: usize = 48;
    let mut expected = vec![0.0f64; CELLS_S * CELLS_T];
    for i in 0..CELLS_S {
        for j in 0..CELLS_T {
            let mut sum = 0.0;
            for a in 0..FINE {
                for b in 0..FINE {
                    let s = (i as f64 + (a as f64 + 0.5) / FINE as f64) / CELLS_S as f64;
                    let t = (j as f64 + (b as f64 + 0.5) / FINE as f64) / CELLS_T as f64;
                    let (w, jacobian) = domain.direction(s, t);
                    sum += f64::from(pdf(w)) * jacobian;
                }
            }
            expected[i * CELLS_T + j] = sum / (CELLS_S * CELLS_T * FINE * FINE) as f64 * SAMPLES as f64;
        }
    }
    let total: f64 = expected.iter().sum();
    let mut cells: Vec<(f64, f64)> = counts.iter().zip(&expected).map(|(&c, &e)| (c as f64, e)).collect();
    cells.push((missing as f64, (SAMPLES as f64 - total).max(0.0)));

    let (mut statistic, mut used) = (0.0, 0usize);
    let mut pool = (0.0, 0.0);
    for (count, expected) in cells {
        if expected < MIN_EXPECTED {
            pool = (pool.0 + count, pool.1 + expected);
        } else {
            statistic += (count - expected) * (count - expected) / expected;
            used += 1;
        }
    }
    if pool.1 >= MIN_EXPECTED {
        statistic += (pool.0 - pool.1) * (pool.0 - pool.1) / pool.1;
        used += 1;
    } else {
        // Too little is expected here for a chi-squared term; the count may exceed a Poisson bound by no means.
        assert!(
            pool.0 <= pool.1 + 6.0 * (pool.1 + 1.0).sqrt() + 6.0,
            "{} samples where {} are expected",
            pool.0,
            pool.1
        );
    }
    (statistic, used.saturating_sub(1).max(1))
}

/// Fails unless `sample` follows `pdf` at the level [`SIGNIFICANCE`].
pub(crate) fn assert_chi_squared(
    name: &str,
    domain: &SphereDomain,
    pdf: impl Fn(Vec3) -> f32,
    sample: impl Fn(Vec3) -> Option<Vec3>,
) {
    let (statistic, freedom) = chi_squared(domain, pdf, sample);
    let p = upper_gamma(freedom as f64 / 2.0, statistic / 2.0);
    assert!(p >= SIGNIFICANCE, "{name}: chi^2 = {statistic:.1} at {freedom} degrees of freedom, p = {p:.2e}");
}

/// Probability that a chi-squared variable of `freedom` degrees exceeds `statistic`.
pub(crate) fn chi_squared_p(statistic: f64, freedom: usize) -> f64 {
    upper_gamma(freedom as f64 / 2.0, statistic / 2.0)
}

/// Regularised upper incomplete gamma function Q(a, x): series below a + 1, continued fraction (Lentz) above.
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        for _ in 0..10_000 {
            k += 1.0;
            term *= x / k;
            sum += term;
            if term < sum * 1e-15 {
                break;
            }
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..10_000 {
        let an = -(i as f64) * (i as f64 - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * h
}

/// ln Gamma by Stirling's series, after shifting the argument above 10.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift += x.ln();
        x += 1.0;
    }
    let x2 = x * x;
    (x - 0.5) * x.ln() - x + 0.5 * TAU.ln() + (1.0 / 12.0 - (1.0 / 360.0 - 1.0 / (1260.0 * x2)) / x2) / x - shift
}

#[test]
fn tail_probabilities_match_tables() {
    // 5 % points of chi-squared: 3.841 (1), 18.307 (10), 124.342 (100).
    for (freedom, point) in [(1, 3.841459), (10, 18.307038), (100, 124.342113)] {
        assert!((chi_squared_p(point, freedom) - 0.05).abs() < 1e-5, "{freedom}");
    }
}

#[test]
fn the_test_rejects_a_slightly_wrong_sampler() {
    // Canary: a density that is off by a tilt of 8 % must be found.
    let (statistic, freedom) = chi_squared(
        &SphereDomain::around(Vec3::Z),
        |w| (1.0 + 0.08 * w.x) / (2.0 * TAU as f32),
        |u| Some(crate::warp::uniform_sphere(Vec2::new(u.x, u.y))),
    );
    assert!(chi_squared_p(statistic, freedom) < SIGNIFICANCE);
}
