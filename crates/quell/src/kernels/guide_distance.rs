//! Guide distance: how unlike the feature buffers of two pixels of a frame are, as the exponent of an edge-stopping
//! weight.
//!
//! | feature buffers | distance |
//! |---|---|
//! | depth | ((1/z_q - 1/z_p - s d) / t)^2; s: slope of 1/z, d: pixels between, t: tolerance, which grows with d, with the slope and with the buffer's own noise |
//! | normal | `wavelet.normal` (1 - cos) / (1 + its own noise) |
//! | albedo seen in mirrors and through glass, colour of the surface | \|a - b\|^2 / (2 tolerance^2) |
//! | normal seen there | `wavelet.seen_normal` (1 - cos); 0 where both have none |
//!
//! A weight is exp(-distance), taken as (1 - distance / 16)^16 where that is positive: four multiplications, the same
//! bits on every machine, and nothing beyond a distance of 16. Weights below 2.3e-12 are 0: their squares, times a variance, lie below
//! the least normal number, and sums with such numbers take twice the time. What they would add is less than a sum's own rounding.

use crate::kernels::math::three;
use crate::sequence::settings::Wavelet;
use crate::window::{Class, LocalFeatures};

/// The distance at which a weight reaches 0; a power of two, so that the weight is a few squarings.
pub(crate) const FARTHEST: f32 = 16.0;
/// Sixteenth root of the least weight.
pub(crate) const LEAST_BASE: f32 = 0.1875;
/// Between surface and background, and between divided and undivided reflections: no weight is left.
pub(crate) const APART: f32 = 1e9;
/// Keeps the quotient finite where depth is unknown on both sides.
pub(crate) const LEAST_TOLERANCE: f32 = 1e-20;

/// exp(-distance), nearly: (1 - distance / 16)^16.
#[inline(always)]
pub fn weight(distance: f32) -> f32 {
    let b = 1.0 - distance * (1.0 / FARTHEST);
    let mut b = if b >= LEAST_BASE { b } else { 0.0 };
    b *= b;
    b *= b;
    b *= b;
    b * b
}

/// Guide distance of pixel `q` from pixel `p`, (x, y) each, for light of a class. Not symmetric: slope, noise and
/// tolerances are those of `p`. A pixel's distance from itself is 0.
pub fn guide_distance(f: &LocalFeatures, class: Class, p: (usize, usize), q: (usize, usize), s: &Wavelet) -> f32 {
    if class == Class::Free || p == q {
        return 0.0;
    }
    let (i, j) = (p.1 * f.size.width + p.0, q.1 * f.size.width + q.0);
    let (dx, dy) = (q.0 as f32 - p.0 as f32, q.1 as f32 - p.1 as f32);
    let mut distance = surface_distance(f, i, j, dx, dy, s);
    let colours = |planes: &[Vec<f32>; 3], tolerance: f32| {
        if planes[0].is_empty() {
            return 0.0;
        }
        let squared: f32 = three(|c| (planes[c][i] - planes[c][j]).powi(2)).iter().sum();
        0.5 * squared / (tolerance * tolerance)
    };
    match class {
        Class::Seen => {
            distance += colours(&f.seen_albedo, s.seen_albedo);
            if !f.seen_normal[0].is_empty() {
                let (np, nq) = (three(|c| f.seen_normal[c][i]), three(|c| f.seen_normal[c][j]));
                // The sky in a mirror has none.
                if np != [0.0; 3] || nq != [0.0; 3] {
                    distance += s.seen_normal * (1.0 - three(|c| np[c] * nq[c]).iter().sum::<f32>());
                }
            }
        }
        Class::Coloured => distance += colours(&f.albedo, s.albedo),
        Class::Surface | Class::Free => {}
    }
    distance
}

/// Depth and normal of pixel `j`, seen from pixel `i`, (dx, dy) pixels away.
fn surface_distance(f: &LocalFeatures, i: usize, j: usize, dx: f32, dy: f32, s: &Wavelet) -> f32 {
    let (here, there) = (f.inverse_depth[i], f.inverse_depth[j]);
    if (here > 0.0) != (there > 0.0) {
        return APART;
    }
    let predicted = f.slope[0][i] * dx + f.slope[1][i] * dy;
    let reach = s.depth * (s.depth_near + s.depth_far * (dx * dx + dy * dy).sqrt());
    let tolerance =
        here * (reach + s.guide_noise * f.depth_noise[i]) + s.slope_error * predicted.abs() + LEAST_TOLERANCE;
    let miss = (there - here - predicted) / tolerance;
    let (np, nq) = (three(|c| f.normal[c][i]), three(|c| f.normal[c][j]));
    // Two pixels without normals do not differ in them.
    let bend = if np == [0.0; 3] && nq == [0.0; 3] { 0.0 } else { 1.0 - three(|c| np[c] * nq[c]).iter().sum::<f32>() };
    miss * miss + s.normal * bend / (1.0 + s.guide_noise * s.normal * f.normal_noise[i])
}
