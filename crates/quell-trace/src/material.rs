//! Materials: what a surface is made of at one point, and the switches of the material model.

use glam::Vec3;

/// Perceptual roughness below which the glossy lobe is a perfect mirror (and glass perfectly smooth).
///
/// At 0.02 the lobe is 0.05 degrees wide, a sixth of a pixel of a usual picture; below it the density of the
/// half vector leaves the range that single precision resolves.
pub const MIRROR_ROUGHNESS: f32 = 0.02;

/// A material at a hit point: textures are already looked up.
///
/// Colours are linear Rec. 709. Values out of range are clamped where the material is used ([`crate::bsdf::Bsdf`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Albedo of the matte part, reflectance of the metallic part, tint of the transmitted part; 0..1.
    pub base_color: Vec3,
    /// 0: dielectric, 1: metal.
    pub metallic: f32,
    /// Perceptual roughness, 0..1; the GGX width alpha is its square.
    pub roughness: f32,
    /// Emitted radiance, on the front side (vertices counter-clockwise) only unless `two_sided_emission`.
    pub emission: Vec3,
    /// Whether the back side emits as well.
    pub two_sided_emission: bool,
    /// Share of the matte part that is replaced by transmission, 0..1.
    pub transmission: f32,
    /// Index of refraction, at least 1; sets the reflectance of the dielectric part at normal incidence (1.5: 0.04). 0
    /// stands for an infinite one (`KHR_materials_ior`): a reflectance of 1, which `specular_color` tints.
    pub ior: f32,
    /// A pane without inside: light passes straight through, and no medium begins behind the surface.
    pub thin_walled: bool,
    /// Colour that white light has after `attenuation_distance` inside the solid, 0..1.
    pub attenuation_color: Vec3,
    /// Distance in scene units; +inf: the inside is clear.
    pub attenuation_distance: f32,
    /// Strength of the dielectric reflection, 0..1 (`KHR_materials_specular`); 1 is physical.
    pub specular: f32,
    /// Tint of the dielectric reflection at normal incidence, >= 0 (`KHR_materials_specular`); white is physical. Above 1
    /// it brightens, up to a reflectance of 1.
    pub specular_color: Vec3,
}

impl Default for Material {
    /// A white, fully rough dielectric that neither emits nor transmits.
    fn default() -> Self {
        Self {
            base_color: Vec3::ONE,
            metallic: 0.0,
            roughness: 1.0,
            emission: Vec3::ZERO,
            two_sided_emission: false,
            transmission: 0.0,
            ior: 1.5,
            thin_walled: false,
            attenuation_color: Vec3::ONE,
            attenuation_distance: f32::INFINITY,
            specular: 1.0,
            specular_color: Vec3::ONE,
        }
    }
}

impl Material {
    /// True where a path can go through the surface.
    pub fn is_transmissive(&self) -> bool {
        self.transmission > 0.0 && self.metallic < 1.0
    }

    /// True where the surface emits on at least one side.
    pub fn is_emissive(&self) -> bool {
        self.emission.max_element() > 0.0
    }

    /// Emitted radiance seen from the front (`front_side`) or from the back.
    pub fn emitted(&self, front_side: bool) -> Vec3 {
        if front_side || self.two_sided_emission { self.emission } else { Vec3::ZERO }
    }

    /// Share of light that survives `distance` inside the solid, per channel (Beer and Lambert).
    pub fn transmittance(&self, distance: f32) -> Vec3 {
        let clear = self.thin_walled || !(self.attenuation_distance > 0.0 && self.attenuation_distance < f32::INFINITY);
        if clear || distance.is_nan() || distance <= 0.0 {
            return Vec3::ONE;
        }
        let color = self.attenuation_color.to_array().map(unit_range);
        Vec3::from_array(color.map(|c| c.powf(distance / self.attenuation_distance)))
    }
}

/// Switches of the material model that tracer, weights and reference share (algorithm.md section 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialModel {
    /// Factor of Schlick's grazing term; 1: plain Schlick, 0.9: the paper's engine.
    pub fresnel_strength: f32,
    /// Whether roughness weakens the grazing term: (1 - cos) becomes s^2 (1 - cos), s = 1 - perceptual roughness.
    pub fresnel_rough_damping: bool,
}

impl Default for MaterialModel {
    fn default() -> Self {
        Self { fresnel_strength: 1.0, fresnel_rough_damping: false }
    }
}

/// `x` within 0..1; NaN becomes 0.
pub(crate) fn unit_range(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

/// A colour within 0..1 per channel; NaN becomes 0.
pub(crate) fn unit_color(c: Vec3) -> Vec3 {
    Vec3::from_array(c.to_array().map(unit_range))
}

/// Mean of the channels: the scalar by which lobes and lights are chosen.
pub(crate) fn channel_mean(c: Vec3) -> f32 {
    (c.x + c.y + c.z) * (1.0 / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transmittance_follows_beer() {
        let glass = Material {
            transmission: 1.0,
            attenuation_color: Vec3::new(0.5, 0.25, 1.0),
            attenuation_distance: 2.0,
            ..Material::default()
        };
        assert!(glass.transmittance(2.0).abs_diff_eq(Vec3::new(0.5, 0.25, 1.0), 1e-6));
        assert!(glass.transmittance(4.0).abs_diff_eq(Vec3::new(0.25, 0.0625, 1.0), 1e-6));
        assert_eq!(Material::default().transmittance(1e9), Vec3::ONE);
        assert_eq!(Material { attenuation_distance: 0.0, ..glass }.transmittance(1.0), Vec3::ONE);
    }

    #[test]
    fn back_sides_emit_only_when_asked() {
        let lamp = Material { emission: Vec3::ONE, ..Material::default() };
        assert_eq!(lamp.emitted(false), Vec3::ZERO);
        assert_eq!(lamp.emitted(true), Vec3::ONE);
        assert_eq!(Material { two_sided_emission: true, ..lamp }.emitted(false), Vec3::ONE);
    }
}
