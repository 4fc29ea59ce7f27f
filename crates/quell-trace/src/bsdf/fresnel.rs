//! Fresnel reflectance by Schlick's approximation (Schlick 1994), with the paper's switches.

use crate::material::{MaterialModel, unit_range};
use glam::Vec3;

/// Fresnel reflectance of one interface, ready to be evaluated for any angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fresnel {
    /// Reflectance at normal incidence.
    f0: Vec3,
    /// What the grazing term adds at most: (f90 - f0) * strength * damping^5.
    rise: Vec3,
    /// Index of the far side over that of the near side; 1 where nothing is transmitted.
    eta: f32,
}

impl Fresnel {
    /// `f90` is the reflectance at grazing incidence, `eta` the index of the far side over that of the viewer's side,
    /// 1 for opaque or thin surfaces; `roughness` is the perceptual one.
    pub(crate) fn new(f0: Vec3, f90: Vec3, eta: f32, roughness: f32, model: MaterialModel) -> Self {
        // s^2 (1 - cos) to the fifth: the damping does not depend on the angle and is taken out of the power.
        let damping = if model.fresnel_rough_damping { (1.0 - roughness).powi(10) } else { 1.0 };
        let rise = (f90 - f0).max(Vec3::ZERO) * unit_range(model.fresnel_strength) * damping;
        Self { f0, rise, eta }
    }

    /// Reflectance where `cos` is the cosine between the half vector and the viewer.
    ///
    /// On the dense side Schlick's cosine is that of the refracted ray, and beyond the critical angle all is
    /// reflected; so both directions of one light path see the same reflectance.
    #[inline]
    pub(crate) fn at(&self, cos: f32) -> Vec3 {
        let mut cos = unit_range(cos);
        if self.eta < 1.0 {
            let sin2_far = (1.0 - cos * cos) / (self.eta * self.eta);
            if sin2_far >= 1.0 {
                return Vec3::ONE;
            }
            cos = (1.0 - sin2_far).sqrt();
        }
        let grazing = 1.0 - cos;
        let grazing2 = grazing * grazing;
        self.f0 + self.rise * (grazing2 * grazing2 * grazing)
    }
}

/// Reflectance at normal incidence between air and an index of refraction.
pub(crate) fn f0_of_ior(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}
