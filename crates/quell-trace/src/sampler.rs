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
