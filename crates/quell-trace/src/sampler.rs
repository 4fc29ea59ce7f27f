//! Low-discrepancy random numbers: Owen-scrambled Sobol' points, padded in pairs.
//!
//! Each pair of dimensions is the (0, 2)-sequence of Sobol', its order shuffled and its digits scrambled by hashes of
//! pixel, frame, seed, domain and dimension (Kollig and Keller 2002, "Efficient multidimensional sampling", for the
//! padding; Burley 2020, "Practical hash-based Owen scrambling", for doing it without tables). Successive sample
//! indices of one pixel therefore stratify every pair, while pixels, frames and dimensions are independent.

use crate::warp::ONE_MINUS_EPSILON;
use glam::{Vec2, Vec3};

/// A stream of low-discrepancy numbers; which one is drawn next depends on the number of draws so far only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    /// Hash of all that makes this stream different from others.
    key: u64,
    /// Index of the sample within the pixel and frame: what the points stratify over.
    index: u32,
    /// Number of draws so far.
    dimension: u32,
}

impl Sampler {
    /// The stream of sample `sample_index` of a pixel in a frame. Equal arguments give equal bits.
    pub fn new(pixel: (u32, u32), frame: i64, sample_index: u32, seed: u64) -> Self {
        let position = (u64::from(pixel.0) << 32) | u64::from(pixel.1);
        let key = mix(mix(mix(seed).wrapping_add(position)).wrapping_add(frame as u64));
        Self { key, index: sample_index, dimension: 0 }
    }

    /// An independent stream for the same sample: one for each purpose (matte path, glossy path, direct light), so
    /// that the number of draws in one does not shift the other. It starts at its first dimension.
    pub fn fork(&self, domain: u32) -> Self {
        // The constant keeps forks apart from dimensions, which are mixed by the same function.
        let key = mix(self.key ^ mix(u64::from(domain) ^ 0x5851_f42d_4c95_7f2d));
        Self { key, index: self.index, dimension: 0 }
    }

    /// The same stream for another sample of the pixel: sub-samples of one sample (several shadow rays) stratify too.
    pub fn with_index(&self, sample_index: u32) -> Self {
        Self { index: sample_index, ..*self }
    }

    /// A hash for one ray of this stream, for choices along it whose number is not known before (is a veil there?). It
    /// draws nothing. Different directions and different numbers of draws so far have different hashes.
    #[inline]
    pub(crate) fn ray_seed(&self, direction: Vec3) -> u64 {
        let [x, y, z] = direction.to_array().map(|v| u64::from(v.to_bits()));
        let state = self.key ^ mix((u64::from(self.index) << 32) | u64::from(self.dimension));
        mix(mix(state).wrapping_add(x | (y << 32)) ^ z.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    /// The next number, in \[0, 1).
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        let (order, scramble) = self.next_seeds();
        let index = owen_scramble(self.index, order);
        unit_float(owen_scramble(sobol_0(index), scramble as u32))
    }

    /// The next pair, in \[0, 1)^2.
    #[inline]
    pub fn next_2d(&mut self) -> Vec2 {
        let (order, scramble) = self.next_seeds();
        let index = owen_scramble(self.index, order);
        Vec2::new(
            unit_float(owen_scramble(sobol_0(index), scramble as u32)),
            unit_float(owen_scramble(sobol_1(index), (scramble >> 32) as u32)),
        )
    }

    /// One number to choose with and a pair to place with, in \[0, 1)^3; each part stratifies on its own.
    #[inline]
    pub fn next_3d(&mut self) -> Vec3 {
        let choice = self.next_1d();
        let place = self.next_2d();
        Vec3::new(choice, place.x, place.y)
    }

    /// Seeds of the shuffle and of the scrambles of the next draw.
    #[inline]
    fn next_seeds(&mut self) -> (u32, u64) {
        let h = mix(self.key.wrapping_add(u64::from(self.dimension).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        self.dimension = self.dimension.wrapping_add(1);
        (h as u32, mix(h))
    }
}

/// Sobol's first dimension: the radical inverse in base 2.
#[inline]
fn sobol_0(index: u32) -> u32 {
    index.reverse_bits()
}

/// Sobol's second dimension. Its generator matrix is Pascal's triangle modulo 2, which is the Kronecker power of
/// [[1, 1], [0, 1]]: five masked shifts instead of a table of direction numbers.
#[inline]
fn sobol_1(index: u32) -> u32 {
    let mut x = index.reverse_bits();
    x ^= x << 16;
    x ^= (x & 0x00ff_00ff) << 8;
    x ^= (x & 0x0f0f_0f0f) << 4;
    x ^= (x & 0x3333_3333) << 2;
    x ^= (x & 0x5555_5555) << 1;
    x
}

/// Owen scrambling: each bit is flipped by a hash of the bits above it.
///
/// Of a fraction in 32 bits it keeps every stratum; of an index it keeps every aligned block of 2^k indices together,
/// so that prefixes stay stratified in the new order.
#[inline]
fn owen_scramble(x: u32, seed: u32) -> u32 {
    laine_karras(x.reverse_bits(), seed).reverse_bits()
}

/// A hash in which a bit depends on itself and on lower bits only (Laine and Karras 2011; multipliers by Vegdahl
/// 2021, "Building a better LK hash").
#[inline]
fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// A 64-bit mixer (the finaliser of SplitMix64; Steele et al. 2014).
#[inline]
pub(crate) fn mix(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The upper 24 bits as a number in \[0, 1).
#[inline]
fn unit_float(x: u32) -> f32 {
    ((x >> 8) as f32 * (1.0 / (1u32 << 24) as f32)).min(ONE_MINUS_EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{SIGNIFICANCE, chi_squared_p};

    #[test]
    fn second_dimension_matches_direction_numbers() {
        // Sobol's recurrence for the polynomial x + 1: v_(k+1) = v_k ^ (v_k >> 1).
        let mut directions = [1u32 << 31; 32];
        for k in 1..32 {
            directions[k] = directions[k - 1] ^ (directions[k - 1] >> 1);
        }
        for index in (0..4096u32).chain([u32::MAX, 0x8000_0001, 0xdead_beef]) {
            let expected = (0..32).filter(|k| (index >> k) & 1 == 1).fold(0, |x, k| x ^ directions[k]);
            assert_eq!(sobol_1(index), expected, "{index}");
        }
    }

    #[test]
    fn successive_samples_fill_every_elementary_interval() {
        for (pixel, frame, skip) in [((0, 0), 0, 0), ((7, 3), 5, 1), ((1919, 1080), -4, 6)] {
            for m in 0..=8u32 {
                let n = 1usize << m;
                for columns_log2 in 0..=m {
                    let (columns, rows) = (1usize << columns_log2, n >> columns_log2);
                    let mut hit = vec![false; n];
                    for i in 0..n {
                        let mut sampler = Sampler::new(pixel, frame, i as u32, 9);
                        for _ in 0..skip {
                            sampler.next_1d();
                        }
                        let p = sampler.next_2d();
                        let cell = (p.x * columns as f32) as usize * rows + (p.y * rows as f32) as usize;
                        assert!(!hit[cell], "two of {n} points in one of {columns} x {rows} cells");
                        hit[cell] = true;
                    }
                }
            }
        }
    }

    #[test]
    fn one_dimension_is_stratified_too() {
        for frame in 0..20 {
            let mut hit = [false; 64];
            for i in 0..64 {
                let x = Sampler::new((3, 4), frame, i, 0).fork(2).next_1d();
                hit[(x * 64.0) as usize] = true;
            }
            assert!(hit.iter().all(|&h| h));
        }
    }

    #[test]
    fn integrates_with_far_less_variance_than_white_noise() {
        // A smooth and a discontinuous integrand; 64 samples, over 256 pixels.
        let smooth = |p: Vec2| (p.x * 2.0).sin() * p.y;
        let edge = |p: Vec2| if p.x + 0.7 * p.y < 0.8 { 1.0 } else { 0.0 };
        let mut noise = crate::testing::Noise::new(3);
        for (f, gain) in [(&smooth as &dyn Fn(Vec2) -> f32, 100.0), (&edge, 4.0)] {
            let variance = |estimates: &[f64]| {
                let mean = estimates.iter().sum::<f64>() / estimates.len() as f64;
                estimates.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / (estimates.len() - 1) as f64
            };
            let mean_of_64 =
                |draw: &mut dyn FnMut(u32) -> Vec2| (0..64).map(|i| f64::from(f(draw(i)))).sum::<f64>() / 64.0;
            let ours: Vec<f64> =
                (0..256).map(|x| mean_of_64(&mut |i| Sampler::new((x, 17), 1, i, 0).next_2d())).collect();
            let white: Vec<f64> = (0..256).map(|_| mean_of_64(&mut |_| noise.next_2d())).collect();
            let ratio = variance(&white) / variance(&ours);
            assert!(ratio > gain, "variance is only {ratio} times lower");
        }
    }

    /// p-value of independence and uniformity of pairs of numbers, on 16 x 16 cells.
    fn pair_p(pairs: impl Iterator<Item = (f32, f32)>) -> f64 {
        let mut counts = [0usize; 256];
        let mut n = 0;
        for (a, b) in pairs {
            assert!((0.0..1.0).contains(&a) && (0.0..1.0).contains(&b));
            counts[(a * 16.0) as usize * 16 + (b * 16.0) as usize] += 1;
            n += 1;
        }
        let expected = n as f64 / 256.0;
        let statistic = counts.iter().map(|&c| (c as f64 - expected).powi(2) / expected).sum();
        chi_squared_p(statistic, 255)
    }

    #[test]
    fn pixels_frames_dimensions_and_forks_are_independent() {
        let all = || (0..160u32).flat_map(|y| (0..256u32).map(move |x| (x, y)));
        let first = |pixel: (u32, u32), frame: i64| Sampler::new(pixel, frame, 0, 1).next_2d();
        let start = |pixel: (u32, u32)| Sampler::new(pixel, 0, 0, 1);
        let successive = |mut sampler: Sampler| (sampler.next_1d(), sampler.next_1d());
        let forks = |s: Sampler| (s.fork(0).next_1d(), s.fork(1).next_1d());
        let seeds = |p| (start(p).next_1d(), Sampler::new(p, 0, 0, 2).next_1d());
        let tests: [(&str, f64); 8] = [
            ("both numbers of a pair", pair_p(all().map(|p| first(p, 0).into()))),
            ("pixel to the right", pair_p(all().map(|p| (first(p, 0).x, first((p.0 + 1, p.1), 0).x)))),
            ("pixel below", pair_p(all().map(|p| (first(p, 0).y, first((p.0, p.1 + 1), 0).y)))),
            ("next frame", pair_p(all().map(|p| (first(p, 0).x, first(p, 1).x)))),
            ("next frame, diagonal", pair_p(all().map(|p| (first(p, 0).x, first((p.0 + 1, p.1), 1).y)))),
            ("next dimension", pair_p(all().map(|p| successive(start(p))))),
            ("forks", pair_p(all().map(|p| forks(start(p))))),
            ("seeds", pair_p(all().map(seeds))),
        ];
        for (name, p) in tests {
            assert!(p > SIGNIFICANCE, "{name}: p = {p:.2e}");
        }
        // Canary: equal streams must be found dependent.
        assert!(pair_p(all().map(|p| (first(p, 0).x, first(p, 0).x))) < SIGNIFICANCE);
    }

    #[test]
    fn equal_arguments_give_equal_bits() {
        let draw = |seed| {
            let mut sampler = Sampler::new((u32::MAX, 0), i64::MIN, u32::MAX, seed).fork(7);
            (sampler.next_1d().to_bits(), sampler.next_2d().to_array().map(f32::to_bits))
        };
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        let mut sampler = Sampler::new((0, 0), 0, 3, 0);
        assert_eq!(sampler.with_index(5), Sampler::new((0, 0), 0, 5, 0));
        sampler.next_1d();
        assert_ne!(sampler, Sampler::new((0, 0), 0, 3, 0));
    }
}
