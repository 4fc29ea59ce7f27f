//! The glossy lobe without Fresnel: GGX with height-correlated Smith masking, sampled by visible normals.
//!
//! Everything is in the local frame: z is the shading normal, and `wo.z > 0`. Distribution and masking: Walter et al.
//! 2007, "Microfacet models for refraction through rough surfaces"; height-correlated form: Heitz 2014,
//! "Understanding the masking-shadowing function"; sampling: Dupuy and Benyoub 2023, "Sampling visible GGX normals
//! with spherical caps"; leaving out normals that would mirror light below the surface: Eto and Tokuyoshi 2023,
//! "Bounded VNDF sampling for Smith-GGX reflections". The lobe scatters once, so rough white surfaces lose some energy, as in the paper's model.

use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A GGX lobe of width `alpha` > 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    alpha: f32,
}

impl Ggx {
    pub(crate) fn new(alpha: f32) -> Self {
        Self { alpha }
    }

    pub(crate) fn alpha(&self) -> f32 {
        self.alpha
    }

    /// Density D of microfacet normals `h` (unit, z >= 0) per steradian and unit of macroscopic area.
    #[inline]
    pub(crate) fn distribution(&self, h: Vec3) -> f32 {
        // From the sine, not from 1 - cos^2: that would have no digits left where alpha is small.
        let sin2 = h.x * h.x + h.y * h.y;
        let a2 = self.alpha * self.alpha;
        let d = a2 * h.z * h.z + sin2;
        a2 / (PI * d * d)
    }

    /// cos * sqrt(1 + alpha^2 tan^2): the quantity of which Smith's terms are made.
    #[inline]
    fn smith(&self, cos: f32) -> f32 {
        let a2 = self.alpha * self.alpha;
        (a2 + (1.0 - a2) * cos * cos).max(0.0).sqrt()
    }

    /// The lobe g = D G2 / (4 |n.wi| |n.wo|) per steradian; 0 unless both directions are above the surface.
    #[inline]
    pub(crate) fn lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        let visibility = 0.5 / (wo.z * self.smith(wi.z) + wi.z * self.smith(wo.z));
        self.distribution((wo + wi).normalize()) * visibility
    }

    /// How far below its equator the spherical cap of visible normals must reach for reflection, as a share of what it
    /// reaches for all visible normals; the rest mirrors below the surface (Eto and Tokuyoshi 2023, equation 5).
    #[inline]
    pub(crate) fn reflection_reach(&self, wo: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        let s = 1.0 + wo.x.hypot(wo.y);
        (1.0 - a2) * s * s / (s * s + a2 * wo.z * wo.z)
    }

    /// Density, per steradian, of the directions that mirroring `wo` at the normals of
    /// [`Self::sample_normal`] gives, with the same `reach`.
    #[inline]
    pub(crate) fn reflection_pdf(&self, wo: Vec3, wi: Vec3, reach: f32) -> f32 {
        let h = wo + wi;
        // The mirrored direction may lie below the surface; its half vector never does.
        if wo.z <= 0.0 || h.z <= 0.0 {
            return 0.0;
        }
        self.distribution(h.normalize()) * 0.5 / (reach * wo.z + self.smith(wo.z))
    }

    /// g |n.wi| / pdf: G2 / G1, or less where `reach` is below 1; at most 1.
    #[inline]
    pub(crate) fn reflection_weight(&self, wo: Vec3, wi: Vec3, reach: f32) -> f32 {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        let smith_o = self.smith(wo.z);
        wi.z * (reach * wo.z + smith_o) / (wo.z * self.smith(wi.z) + wi.z * smith_o)
    }

    /// Height-correlated G2 for directions on either side of the surface; arguments are absolute cosines.
    #[inline]
    pub(crate) fn masking(&self, cos_o: f32, cos_i: f32) -> f32 {
        2.0 * cos_o * cos_i / (cos_o * self.smith(cos_i) + cos_i * self.smith(cos_o))
    }

    /// Density per steradian with which [`Self::sample_normal`] draws `h` at a reach of 1.
    #[inline]
    pub(crate) fn visible_normal_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        if h.z <= 0.0 {
            return 0.0;
        }
        self.distribution(h) * wo.dot(h).max(0.0) * 2.0 / (wo.z + self.smith(wo.z))
    }

    /// A microfacet normal as `wo` sees them: unit, z >= 0, on the side of `wo`. `reach` 1: all of them;
    /// [`Self::reflection_reach`]: without those that mirror below the surface, as far as is known beforehand.
    #[inline]
    pub(crate) fn sample_normal(&self, wo: Vec3, u: Vec2, reach: f32) -> Vec3 {
        let stretched = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let phi = TAU * u.x;
        let lowest = reach * stretched.z;
        let z = (1.0 - u.y) * (1.0 + lowest) - lowest;
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(sin * phi.cos(), sin * phi.sin(), z) + stretched;
        // u.y -> 1 can cancel all of h at grazing views; the pole is then as visible as any other.
        Vec3::new(self.alpha * h.x, self.alpha * h.y, h.z.max(0.0)).try_normalize().unwrap_or(Vec3::Z)
    }
}

/// `wo` mirrored at the normal `h`.
#[inline]
pub(crate) fn reflect(wo: Vec3, h: Vec3) -> Vec3 {
    2.0 * wo.dot(h) * h - wo
}
