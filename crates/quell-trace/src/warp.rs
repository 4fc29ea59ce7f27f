//! Maps from the unit square to directions and points, each with its density.
//!
//! `u` is in \[0, 1)^2. Directions are in a local frame whose z axis is the pole.

use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// The largest single precision number below 1.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// A point of the unit disc, uniform in area; keeps strata compact (Shirley and Chiu 1997, concentric map).
pub fn concentric_disc(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p.x == 0.0 && p.y == 0.0 {
        return Vec2::ZERO;
    }
    let (radius, angle) =
        if p.x.abs() > p.y.abs() { (p.x, PI / 4.0 * (p.y / p.x)) } else { (p.y, PI / 2.0 - PI / 4.0 * (p.x / p.y)) };
    radius * Vec2::new(angle.cos(), angle.sin())
}

/// A direction above the xy plane with density cos / pi (Malley's method).
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disc(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`] per steradian; `cos` is the cosine with the pole.
pub fn cosine_hemisphere_pdf(cos: f32) -> f32 {
    cos.max(0.0) * FRAC_1_PI
}

/// A direction whose cosine with the pole is uniform in \[cos_min, 1\]: uniform in the cone. -1: the whole sphere.
pub fn uniform_cone(u: Vec2, cos_min: f32) -> Vec3 {
    // 1 - cos is drawn, since for narrow cones cos itself has no digits left.
    let one_minus_cos = u.x * (1.0 - cos_min);
    let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    let phi = TAU * u.y;
    Vec3::new(sin * phi.cos(), sin * phi.sin(), 1.0 - one_minus_cos)
}

/// Density of [`uniform_cone`] per steradian inside the cone.
pub fn uniform_cone_pdf(cos_min: f32) -> f32 {
    1.0 / (TAU * (1.0 - cos_min))
}

/// A direction, uniform over the sphere: density 1 / (4 pi).
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    uniform_cone(u, -1.0)
}

/// Barycentric coordinates (b0, b1, b2) of a point uniform in a triangle; no square root and no folding across the
/// whole triangle (Heitz 2019, "A low-distortion map between triangle and square").
pub fn uniform_triangle(u: Vec2) -> Vec3 {
    let (b0, b1) = if u.x < u.y {
        let b0 = u.x / 2.0;
        (b0, u.y - b0)
    } else {
        let b1 = u.y / 2.0;
        (u.x - b1, b1)
    };
    Vec3::new(b0, b1, (1.0 - b0 - b1).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{SphereDomain, assert_chi_squared};

    #[test]
    fn cosine_hemisphere_follows_its_density() {
        assert_chi_squared(
            "cosine hemisphere",
            &SphereDomain::around(Vec3::Z),
            |w| cosine_hemisphere_pdf(w.z),
            |u| Some(cosine_hemisphere(Vec2::new(u.x, u.y))),
        );
    }

    #[test]
    fn cones_and_spheres_follow_their_density() {
        // Edges of the cones lie on edges of the cells.
        for cos_min in [-1.0, 0.0, 0.75] {
            assert_chi_squared(
                "uniform cone",
                &SphereDomain::around(Vec3::Z),
                |w| if w.z >= cos_min { uniform_cone_pdf(cos_min) } else { 0.0 },
                |u| Some(uniform_cone(Vec2::new(u.x, u.y), cos_min)),
            );
        }
    }

    #[test]
    fn triangle_points_have_the_moments_of_a_uniform_triangle() {
        // For uniform barycentrics E[b] = 1/3 and E[b^2] = 1/6, each; the grid makes the error of order 1/n^2.
        let n = 64;
        let (mut mean, mut square) = (Vec3::ZERO, Vec3::ZERO);
        for i in 0..n * n {
            let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
            let b = uniform_triangle(u);
            assert!(b.min_element() >= 0.0 && (b.x + b.y + b.z - 1.0).abs() < 1e-6);
            mean += b / (n * n) as f32;
            square += b * b / (n * n) as f32;
        }
        assert!(mean.abs_diff_eq(Vec3::splat(1.0 / 3.0), 2e-3), "{mean}");
        assert!(square.abs_diff_eq(Vec3::splat(1.0 / 6.0), 2e-3), "{square}");
    }
}
