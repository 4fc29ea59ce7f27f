//! The matte lobe without Fresnel: Lambert's constant reflectance, sampled by the cosine.

use crate::warp;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// m = albedo / pi.
#[inline]
pub(crate) fn brdf(albedo: Vec3) -> Vec3 {
    albedo * FRAC_1_PI
}

/// A direction in the local frame with density cos / pi.
#[inline]
pub(crate) fn sample(u: Vec2) -> Vec3 {
    warp::cosine_hemisphere(u)
}

/// Density of [`sample`] per steradian; `wi` in the local frame.
#[inline]
pub(crate) fn pdf(wi: Vec3) -> f32 {
    warp::cosine_hemisphere_pdf(wi.z)
}
