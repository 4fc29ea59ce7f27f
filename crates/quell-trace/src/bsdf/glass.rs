//! The transmitted lobe without Fresnel and tint: refraction at a smooth or rough interface (Walter et al. 2007).
//!
//! Local frame: z is the shading normal on the viewer's side, so `wo.z > 0` and transmitted `wi.z < 0`. `eta` is the
//! index of the far side over that of the viewer's. Values carry radiance: what comes from the far side is scaled by
//! 1 / eta^2, since radiance divided by the squared index is what an interface conserves; a path that enters and
//! leaves a solid gets both factors, which cancel.

use super::ggx::Ggx;
use glam::Vec3;

/// Indices this close to each other do not bend light visibly, and the density of the half vector degenerates: such
/// an interface transmits straight on, whatever its roughness.
pub(crate) const STRAIGHT_ETA: f32 = 5e-3;

/// `wo` refracted at the normal `h` on its side; `None` beyond the critical angle.
#[inline]
pub(crate) fn refract(wo: Vec3, h: Vec3, eta: f32) -> Option<Vec3> {
    let cos_o = wo.dot(h);
    let sin2_far = (1.0 - cos_o * cos_o).max(0.0) / (eta * eta);
    if sin2_far >= 1.0 || cos_o <= 0.0 {
        return None;
    }
    let cos_far = (1.0 - sin2_far).sqrt();
    Some((-wo / eta + (cos_o / eta - cos_far) * h).normalize())
}

/// What a rough interface does from `wo` to a transmitted `wi`.
pub(crate) struct RoughTransmission {
    /// Cosine between the half vector and `wo`: Fresnel's argument.
    pub(crate) cos_half: f32,
    /// Scattering function per steradian, without Fresnel, tint and cosine.
    pub(crate) value: f32,
    /// Density per steradian of refracting `wo` at its visible normals.
    pub(crate) pdf: f32,
}

/// Evaluates a rough interface; `None` where no microfacet refracts `wo` to `wi`.
#[inline]
pub(crate) fn rough_transmission(ggx: &Ggx, wo: Vec3, wi: Vec3, eta: f32) -> Option<RoughTransmission> {
    if wo.z <= 0.0 || wi.z >= 0.0 {
        return None;
    }
    let mut h = (wo + eta * wi).try_normalize()?;
    if h.z < 0.0 {
        h = -h;
    }
    let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
    // A microfacet seen from its back does not refract.
    if cos_o <= 0.0 || cos_i >= 0.0 {
        return None;
    }
    let spread = cos_i + cos_o / eta;
    let half_per_wi = -cos_i / (spread * spread);
    let pdf = ggx.visible_normal_pdf(wo, h) * half_per_wi;
    let value = ggx.distribution(h) * ggx.masking(wo.z, -wi.z) * cos_o * half_per_wi / (wo.z * -wi.z * eta * eta);
    (pdf.is_finite() && value.is_finite()).then_some(RoughTransmission { cos_half: cos_o, value, pdf })
}
