//! The factored BRDF f = m (1 - F)^2 + g F, glass, and their sampling (algorithm.md section 1).
//!
//! A [`Bsdf`] is a surface point seen from one direction. Its matte and glossy lobes are offered apart, as the two
//! estimators need them at the primary surface, and together ([`Bsdf::sample_full`]) for later vertices. All values
//! are without the cosine |n.wi| unless their comment says so; directions are unit, in world space, and point away
//! from the surface.
//!
//! The BRDF is reciprocal. It does not conserve energy strictly: at grazing views of a smooth dielectric the matte
//! part, whose F belongs to the half vector, does not make room for all that the mirror direction reflects (1.25 at
//! n.wo = 0.2, 1.5 at most). Averaged over all views it does: 0.915 matte and 0.085 glossy for a white dielectric.

mod albedo;
mod fresnel;
mod ggx;
mod glass;
mod lambert;

pub use albedo::{Lobe, directional_albedo};
#[cfg(feature = "gpu")]
pub(crate) use glass::STRAIGHT_ETA;

use crate::material::{MIRROR_ROUGHNESS, Material, MaterialModel, channel_mean, unit_color, unit_range};
use fresnel::Fresnel;
use ggx::Ggx;
use glam::{Vec2, Vec3};

/// Largest F that enters the matte weights: beyond it the exact ratio would grow without bound.
pub const MATTE_FRESNEL_CAP: f32 = 0.9;

/// Smallest F_s that enters `glossy_weight`, per channel, for the same reason (algorithm.md section 1).
pub const GLOSSY_FRESNEL_FLOOR: f32 = 0.02;

/// Smallest cosine between shading normal and viewer. Interpolated and mapped normals may lean away from the viewer;
/// they are tilted back until they are this far above the horizon, so that no surface turns black.
pub const MIN_VIEW_COS: f32 = 1e-3;

/// Least share of its albedo that a lobe keeps in the choice between lobes, whatever Fresnel at the mirror direction
/// says: Fresnel at other half vectors may be far lower, and a lobe never chosen is light lost.
pub(crate) const MIN_LOBE_SHARE: f32 = 0.05;

/// A surface point, its material and the direction that it is seen from.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    /// Shading frame: columns x, y, z = the normal on the viewer's side.
    tangent: Vec3,
    bitangent: Vec3,
    normal: Vec3,
    /// True normal of the surface, on the viewer's side.
    geometric_normal: Vec3,
    wo: Vec3,
    wo_local: Vec3,
    ggx: Ggx,
    /// Which part of the visible normals the glossy lobe draws ([`Ggx::reflection_reach`]).
    reflection_reach: f32,
    fresnel: Fresnel,
    /// F at n.wo.
    fresnel_mirror: Vec3,
    /// pi m: base colour of the share that is matte.
    matte_albedo: Vec3,
    /// What is left of light that crosses the interface, without Fresnel; 0: opaque.
    transmission_tint: Vec3,
    /// Index of the far side over that of the viewer's.
    eta: f32,
    thin_walled: bool,
    /// Below the roughness that counts as smooth.
    smooth: bool,
    /// Probability with which `sample_full` chooses the matte lobe; the rest is reflection and transmission.
    matte_probability: f32,
}

/// A direction of the glossy lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlossySample {
    /// The sampled direction, above the surface.
    pub wi: Vec3,
    /// g |n.wi| / pdf, at most 1; 1 for mirrors. Without Fresnel. G2 / G1 but for the bound of the sampled normals,
    /// which makes black samples rarer and the others a little darker.
    pub weight: f32,
    /// Density per steradian; 1 for mirrors.
    pub pdf: f32,
    /// A perfect mirror: `pdf` is a probability and no other sampling can find this direction.
    pub delta: bool,
}

/// A direction through the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransmissionSample {
    /// The sampled direction, below the surface.
    pub wi: Vec3,
    /// Scattering function |n.wi| / pdf, with tint, Fresnel (1 - F) and the 1 / eta^2 of radiance.
    pub weight: Vec3,
    /// Density per steradian; 1 for smooth glass.
    pub pdf: f32,
    /// Smooth glass: `pdf` is a probability.
    pub delta: bool,
}

/// A direction of all lobes together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// The sampled direction.
    pub wi: Vec3,
    /// f |n.wi| / pdf: what the path's throughput is multiplied by.
    pub value_times_cos_over_pdf: Vec3,
    /// Density per steradian of `wi` over all lobes, equal to [`Bsdf::pdf`]; for a delta lobe its probability.
    pub pdf: f32,
    /// A mirror or smooth glass: light sampling cannot find this direction, so it keeps all weight.
    pub delta: bool,
    /// Whether the path goes through the surface.
    pub transmitted: bool,
    /// Perceptual roughness of the lobe that was chosen; 1 for matte. Regularisation and caps may want it.
    pub lobe_roughness: f32,
}

impl Bsdf {
    /// The surface as `wo` (unit, towards the viewer) sees it.
    ///
    /// `shading_normal` and `geometric_normal` are unit, on either side: both are turned to the viewer's side of the
    /// geometric surface. `inside` says that the viewer is inside the solid; it matters to solids that transmit only.
    pub fn new(
        material: &Material,
        model: MaterialModel,
        shading_normal: Vec3,
        geometric_normal: Vec3,
        wo: Vec3,
        inside: bool,
    ) -> Self {
        let wo = wo.try_normalize().unwrap_or(Vec3::Z);
        let ng = geometric_normal.try_normalize().unwrap_or(wo);
        let ng = if ng.dot(wo) < 0.0 { -ng } else { ng };
        let normal = viewer_side_normal(shading_normal, ng, wo);
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let local = Vec3::new(wo.dot(tangent), wo.dot(bitangent), wo.dot(normal));
        let wo_local = local.with_z(local.z.max(MIN_VIEW_COS)).normalize();

        let base_color = unit_color(material.base_color);
        let metallic = unit_range(material.metallic);
        let transmission = unit_range(material.transmission);
        let roughness = unit_range(material.roughness);
        let specular = unit_range(material.specular);
        let ior = if material.ior > 1.0 { material.ior.min(MAX_IOR) } else { 1.0 };

        let solid_glass = transmission > 0.0 && metallic < 1.0 && !material.thin_walled;
        let eta = match (solid_glass, inside) {
            (false, _) => 1.0,
            (true, false) => ior,
            (true, true) => 1.0 / ior,
        };
        // Index 0 stands for an infinite one: what mirrors follows from the specular colour alone.
        let reflectance = if material.ior == 0.0 { 1.0 } else { fresnel::f0_of_ior(ior) };
        let dielectric_f0 = unit_color(reflectance * material.specular_color) * specular;
        let f0 = dielectric_f0.lerp(base_color, metallic);
        let f90 = Vec3::splat(specular + (1.0 - specular) * metallic);
        let fresnel = Fresnel::new(f0, f90, eta, roughness, model);
        let fresnel_mirror = fresnel.at(wo_local.z);
        let smooth = roughness < MIRROR_ROUGHNESS;
        let matte_albedo = base_color * (1.0 - metallic) * (1.0 - transmission);
        let transmission_tint = base_color * (1.0 - metallic) * transmission;

        let ggx = Ggx::new((roughness * roughness).max(MIRROR_ROUGHNESS * MIRROR_ROUGHNESS));
        let mut bsdf = Self {
            tangent,
            bitangent,
            normal,
            geometric_normal: ng,
            wo,
            wo_local,
            ggx,
            reflection_reach: ggx.reflection_reach(wo_local),
            fresnel,
            fresnel_mirror,
            matte_albedo,
            transmission_tint,
            eta,
            thin_walled: material.thin_walled,
            smooth,
            matte_probability: 0.0,
        };
        bsdf.matte_probability = bsdf.choose_matte_probability();
        bsdf
    }

    /// Matte albedo estimated against what the interface reflects and transmits.
    fn choose_matte_probability(&self) -> f32 {
        let full = channel_mean(self.matte_albedo);
        if full <= 0.0 {
            return 0.0;
        }
        // The half vector of a typical matte direction lies half way between normal and viewer.
        let typical_half_cos = (0.5 * (1.0 + self.wo_local.z)).sqrt();
        let passed = Vec3::ONE - self.fresnel.at(typical_half_cos);
        let matte = channel_mean(self.matte_albedo * passed * passed).max(MIN_LOBE_SHARE * full);
        let reflected = channel_mean(self.fresnel_mirror);
        let transmitted = channel_mean(self.transmission_tint * (Vec3::ONE - self.fresnel_mirror));
        let interface = (reflected + transmitted).max(MIN_LOBE_SHARE);
        matte / (matte + interface)
    }

    /// The shading normal that all lobes use, on the viewer's side.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// The true normal, on the viewer's side.
    pub fn geometric_normal(&self) -> Vec3 {
        self.geometric_normal
    }

    /// Direction towards the viewer.
    pub fn wo(&self) -> Vec3 {
        self.wo
    }

    /// |n.wi|.
    pub fn abs_cos(&self, wi: Vec3) -> f32 {
        self.normal.dot(wi).abs()
    }

    /// n.wo, at least [`MIN_VIEW_COS`].
    pub fn view_cos(&self) -> f32 {
        self.wo_local.z
    }

    /// The mirror direction of the viewer; may lie below the geometric surface where the shading normal leans.
    pub fn mirror_direction(&self) -> Vec3 {
        self.world_from_local(ggx::reflect(self.wo_local, Vec3::Z))
    }

    /// Whether light can pass through.
    pub fn is_transmissive(&self) -> bool {
        self.transmission_tint.max_element() > 0.0
    }

    /// Whether the glossy lobe is a perfect mirror.
    pub fn is_mirror(&self) -> bool {
        self.smooth
    }

    /// Whether every lobe is a mirror or smooth glass, so that light sampling finds nothing.
    pub fn is_delta_only(&self) -> bool {
        self.smooth && self.matte_albedo.max_element() <= 0.0
    }

    /// Whether the transmitted lobe is a single direction.
    pub fn is_transmission_delta(&self) -> bool {
        self.smooth || (!self.thin_walled && (self.eta - 1.0).abs() < glass::STRAIGHT_ETA)
    }

    // The factored lobes of the primary surface.

    /// (1 - F)^2 m: the matte lobe.
    pub fn matte(&self, wi: Vec3) -> Vec3 {
        if !self.is_above(wi) {
            return Vec3::ZERO;
        }
        let passed = Vec3::ONE - self.fresnel.at(self.half_cos(self.local_from_world(wi)));
        passed * passed * lambert::brdf(self.matte_albedo)
    }

    /// F g: the glossy lobe; 0 for a mirror, which only [`Self::sample_glossy`] finds.
    pub fn glossy(&self, wi: Vec3) -> Vec3 {
        let lobe = self.glossy_without_fresnel(wi);
        if lobe > 0.0 { lobe * self.fresnel.at(self.half_cos(self.local_from_world(wi))) } else { Vec3::ZERO }
    }

    /// g: the glossy lobe without Fresnel; 0 for a mirror.
    pub fn glossy_without_fresnel(&self, wi: Vec3) -> f32 {
        if self.smooth || !self.is_above(wi) { 0.0 } else { self.ggx.lobe(self.wo_local, self.local_from_world(wi)) }
    }

    /// F where `cos` is the cosine between half vector and viewer.
    pub fn fresnel(&self, cos: f32) -> Vec3 {
        self.fresnel.at(cos)
    }

    /// F_s = F(n.wo).
    pub fn fresnel_at_mirror(&self) -> Vec3 {
        self.fresnel_mirror
    }

    /// A direction with density cos / pi about the shading normal. It may lie below the geometric surface: the lobes
    /// are 0 there.
    pub fn sample_matte(&self, u: Vec2) -> Vec3 {
        self.world_from_local(lambert::sample(u))
    }

    /// Density of [`Self::sample_matte`] per steradian.
    pub fn matte_pdf(&self, wi: Vec3) -> f32 {
        lambert::pdf(self.local_from_world(wi))
    }

    /// A direction of the glossy lobe by visible normals; `None` where the microsurface sends it below the surface:
    /// the sample then counts as black.
    pub fn sample_glossy(&self, u: Vec2) -> Option<GlossySample> {
        if self.smooth {
            let wi = self.mirror_direction();
            return self.is_above(wi).then_some(GlossySample { wi, weight: 1.0, pdf: 1.0, delta: true });
        }
        let h = self.ggx.sample_normal(self.wo_local, u, self.reflection_reach);
        let wi_local = ggx::reflect(self.wo_local, h);
        let wi = self.world_from_local(wi_local);
        if wi_local.z <= 0.0 || !self.is_above(wi) {
            return None;
        }
        let pdf = self.ggx.reflection_pdf(self.wo_local, wi_local, self.reflection_reach);
        let weight = self.ggx.reflection_weight(self.wo_local, wi_local, self.reflection_reach).min(1.0);
        (pdf > 0.0).then_some(GlossySample { wi, weight, pdf, delta: false })
    }

    /// Density of [`Self::sample_glossy`] per steradian; 0 for a mirror.
    pub fn glossy_pdf(&self, wi: Vec3) -> f32 {
        if self.smooth {
            return 0.0;
        }
        self.ggx.reflection_pdf(self.wo_local, self.local_from_world(wi), self.reflection_reach)
    }

    /// (1 - F_s)^2 pi m, with F_s capped at [`MATTE_FRESNEL_CAP`]: what multiplies M in the paper's estimator.
    pub fn matte_weight(&self) -> Vec3 {
        let passed = self.capped_passed();
        passed * passed * self.matte_albedo
    }

    /// F_s, floored at [`GLOSSY_FRESNEL_FLOOR`]: what multiplies G.
    pub fn glossy_weight(&self) -> Vec3 {
        self.fresnel_mirror.max(Vec3::splat(GLOSSY_FRESNEL_FLOOR))
    }

    /// (1 - F_0)^2 pi m, F_0 being Fresnel at normal incidence, capped alike: what multiplies M in the exact estimator.
    ///
    /// Unlike the paper's factor it does not depend on the view: M stays the same on a surface that turns towards the
    /// eye, so history need not catch up with it (measured on the boxes of `cornell-box`: twice too bright).
    pub fn exact_matte_weight(&self) -> Vec3 {
        let passed = self.passed_at_normal();
        passed * passed * self.matte_albedo
    }

    /// The factor that makes `exact_matte_weight * M` exact for a cosine sample `wi`: ((1 - F_i) / (1 - F_0))^2. 0
    /// below the surface. At most 1 but for the cap (100).
    pub fn exact_matte_ratio(&self, wi: Vec3) -> Vec3 {
        if !self.is_above(wi) {
            return Vec3::ZERO;
        }
        let ratio = (Vec3::ONE - self.fresnel.at(self.half_cos(self.local_from_world(wi)))) / self.passed_at_normal();
        ratio * ratio
    }

    /// The factor that makes `glossy_weight * G` exact for a glossy sample `wi`: F_i / F_s. 0 below the surface. At
    /// most 50; for a mirror 1 or less.
    pub fn exact_glossy_ratio(&self, wi: Vec3) -> Vec3 {
        if !self.is_above(wi) {
            return Vec3::ZERO;
        }
        // A mirror's half vector is the normal; computing it from wi would only add rounding.
        let fresnel =
            if self.smooth { self.fresnel_mirror } else { self.fresnel.at(self.half_cos(self.local_from_world(wi))) };
        fresnel / self.glossy_weight()
    }

    /// 1 - F_0 with the cap.
    fn passed_at_normal(&self) -> Vec3 {
        Vec3::ONE - self.fresnel.at(1.0).min(Vec3::splat(MATTE_FRESNEL_CAP))
    }

    /// 1 - F_s with the cap.
    fn capped_passed(&self) -> Vec3 {
        Vec3::ONE - self.fresnel_mirror.min(Vec3::splat(MATTE_FRESNEL_CAP))
    }

    // Transmission.

    /// A direction through the surface by visible normals; `None` for opaque surfaces, total reflection and what the
    /// microsurface sends back. For smooth glass and panes `u` does not matter.
    pub fn sample_transmission(&self, u: Vec2) -> Option<TransmissionSample> {
        if !self.is_transmissive() {
            return None;
        }
        if self.is_transmission_delta() {
            let (wi, weight) = self.delta_transmission()?;
            return Some(TransmissionSample { wi, weight, pdf: 1.0, delta: true });
        }
        let h = self.ggx.sample_normal(self.wo_local, u, 1.0);
        let wi_local = self.transmitted_at(h)?;
        let wi = self.world_from_local(wi_local);
        let (value, pdf) = self.rough_transmission(wi)?;
        (pdf > 0.0).then(|| TransmissionSample { wi, weight: value * (wi_local.z.abs() / pdf), pdf, delta: false })
    }

    /// Direction and weight of smooth transmission.
    fn delta_transmission(&self) -> Option<(Vec3, Vec3)> {
        let straight = self.thin_walled || (self.eta - 1.0).abs() < glass::STRAIGHT_ETA;
        let (wi, scale) = if straight {
            (-self.wo, 1.0)
        } else {
            let wi_local = glass::refract(self.wo_local, Vec3::Z, self.eta)?;
            (self.world_from_local(wi_local), 1.0 / (self.eta * self.eta))
        };
        self.is_below(wi).then(|| (wi, self.transmission_tint * (Vec3::ONE - self.fresnel_mirror) * scale))
    }

    /// The local direction in which a microfacet with normal `h` lets `wo` through.
    fn transmitted_at(&self, h: Vec3) -> Option<Vec3> {
        let wi = if self.thin_walled {
            // A rough pane scatters forwards as it does backwards: the reflected direction on the other side.
            let mirrored = ggx::reflect(self.wo_local, h);
            mirrored.with_z(-mirrored.z)
        } else {
            glass::refract(self.wo_local, h, self.eta)?
        };
        (wi.z < 0.0).then_some(wi)
    }

    /// Value (with tint and Fresnel) and density of rough transmission to `wi`, given that transmission is chosen.
    fn rough_transmission(&self, wi: Vec3) -> Option<(Vec3, f32)> {
        let (value, pdf, cos_half) = self.rough_transmission_terms(wi)?;
        Some((self.transmission_tint * (Vec3::ONE - self.fresnel.at(cos_half)) * value, pdf))
    }

    /// Value without tint and Fresnel, density, and Fresnel's cosine.
    fn rough_transmission_terms(&self, wi: Vec3) -> Option<(f32, f32, f32)> {
        if !self.is_below(wi) {
            return None;
        }
        let wi_local = self.local_from_world(wi);
        if self.thin_walled {
            let mirrored = wi_local.with_z(-wi_local.z);
            let value = self.ggx.lobe(self.wo_local, mirrored);
            let pdf = self.ggx.reflection_pdf(self.wo_local, mirrored, 1.0);
            return Some((value, pdf, self.half_cos(mirrored)));
        }
        let rough = glass::rough_transmission(&self.ggx, self.wo_local, wi_local, self.eta)?;
        Some((rough.value, rough.pdf, rough.cos_half))
    }

    // All lobes together, for later vertices.

    /// All lobes that are not delta, without the cosine; directions on both sides.
    pub fn eval(&self, wi: Vec3) -> Vec3 {
        if self.normal.dot(wi) > 0.0 {
            return self.matte(wi) + self.glossy(wi);
        }
        if !self.is_transmissive() || self.is_transmission_delta() {
            return Vec3::ZERO;
        }
        self.rough_transmission(wi).map_or(Vec3::ZERO, |(value, _)| value)
    }

    /// Density of [`Self::sample_full`] per steradian over all lobes that are not delta.
    pub fn pdf(&self, wi: Vec3) -> f32 {
        let interface = 1.0 - self.matte_probability;
        if self.normal.dot(wi) > 0.0 {
            let wi_local = self.local_from_world(wi);
            let mut pdf = self.matte_probability * lambert::pdf(wi_local);
            if !self.smooth {
                let reflection = self.reflection_probability(self.half_cos(wi_local));
                pdf +=
                    interface * reflection * self.ggx.reflection_pdf(self.wo_local, wi_local, self.interface_reach());
            }
            return pdf;
        }
        if !self.is_transmissive() || self.is_transmission_delta() {
            return 0.0;
        }
        match self.rough_transmission_terms(wi) {
            Some((_, pdf, cos_half)) => interface * (1.0 - self.reflection_probability(cos_half)) * pdf,
            None => 0.0,
        }
    }

    /// Normals that reflection and transmission share are drawn whole: what mirrors below may still refract.
    fn interface_reach(&self) -> f32 {
        if self.is_transmissive() { 1.0 } else { self.reflection_reach }
    }

    /// Probability of reflection rather than transmission at a microfacet.
    fn reflection_probability(&self, cos_half: f32) -> f32 {
        if !self.is_transmissive() {
            return 1.0;
        }
        // A rough interface of index 1 transmits straight on with the Fresnel of the normal, so there the choice must
        // not depend on the microfacet; the bounds keep both lobes reachable.
        let straight = self.is_transmission_delta() && !self.smooth;
        let fresnel = if straight { self.fresnel_mirror } else { self.fresnel.at(cos_half) };
        let reflected = channel_mean(fresnel);
        let transmitted = channel_mean(self.transmission_tint * (Vec3::ONE - fresnel));
        let share = if reflected + transmitted > 0.0 { reflected / (reflected + transmitted) } else { 1.0 };
        if straight { share.clamp(MIN_LOBE_SHARE, 1.0 - MIN_LOBE_SHARE) } else { share }
    }

    /// A direction of any lobe: `u.x` chooses the lobe by its estimated albedo, the rest places. `None`: absorbed.
    pub fn sample_full(&self, u: Vec3) -> Option<BsdfSample> {
        let place = Vec2::new(u.y, u.z);
        if u.x < self.matte_probability {
            return self.finish(self.sample_matte(place), 1.0);
        }
        let interface = 1.0 - self.matte_probability;
        let choice = (u.x - self.matte_probability) / interface;
        let lobe_roughness = self.lobe_roughness();

        let h =
            if self.smooth { Vec3::Z } else { self.ggx.sample_normal(self.wo_local, place, self.interface_reach()) };
        let reflection = self.reflection_probability(self.wo_local.dot(h));
        if choice < reflection {
            if self.smooth {
                let wi = self.mirror_direction();
                let pdf = interface * reflection;
                return self.is_above(wi).then(|| BsdfSample {
                    wi,
                    value_times_cos_over_pdf: self.fresnel_mirror / pdf,
                    pdf,
                    delta: true,
                    transmitted: false,
                    lobe_roughness,
                });
            }
            let wi = ggx::reflect(self.wo_local, h);
            return if wi.z > 0.0 { self.finish(self.world_from_local(wi), lobe_roughness) } else { None };
        }
        if self.is_transmission_delta() {
            let (wi, weight) = self.delta_transmission()?;
            let pdf = interface * (1.0 - reflection);
            return (pdf > 0.0).then(|| BsdfSample {
                wi,
                value_times_cos_over_pdf: weight / pdf,
                pdf,
                delta: true,
                transmitted: true,
                lobe_roughness,
            });
        }
        self.finish(self.world_from_local(self.transmitted_at(h)?), lobe_roughness)
    }

    /// The sample of all non-delta lobes at `wi`.
    fn finish(&self, wi: Vec3, lobe_roughness: f32) -> Option<BsdfSample> {
        let pdf = self.pdf(wi);
        let value = self.eval(wi);
        if !(pdf > 0.0 && pdf.is_finite()) || value.max_element() <= 0.0 {
            return None;
        }
        let cos = self.normal.dot(wi);
        Some(BsdfSample {
            wi,
            value_times_cos_over_pdf: value * (cos.abs() / pdf),
            pdf,
            delta: false,
            transmitted: cos < 0.0,
            lobe_roughness,
        })
    }

    /// Perceptual roughness of reflection and transmission.
    fn lobe_roughness(&self) -> f32 {
        if self.smooth { 0.0 } else { self.ggx.alpha().sqrt() }
    }

    // Geometry.

    /// On the viewer's side of both the shading and the true surface: else light would leak through.
    fn is_above(&self, wi: Vec3) -> bool {
        self.normal.dot(wi) > 0.0 && self.geometric_normal.dot(wi) > 0.0
    }

    /// On the far side of both.
    fn is_below(&self, wi: Vec3) -> bool {
        self.normal.dot(wi) < 0.0 && self.geometric_normal.dot(wi) < 0.0
    }

    /// Cosine between `wo` and the half vector of reflection.
    fn half_cos(&self, wi_local: Vec3) -> f32 {
        // cos^2 = (1 + wo.wi) / 2; at grazing reflection this keeps no digits, |wo + wi| / 2 does.
        0.5 * (self.wo_local + wi_local).length()
    }

    fn local_from_world(&self, w: Vec3) -> Vec3 {
        Vec3::new(w.dot(self.tangent), w.dot(self.bitangent), w.dot(self.normal))
    }

    fn world_from_local(&self, w: Vec3) -> Vec3 {
        w.x * self.tangent + w.y * self.bitangent + w.z * self.normal
    }
}

/// Index of refraction above which inputs are clamped: diamond has 2.4, and nothing transparent reaches this.
pub(crate) const MAX_IOR: f32 = 10.0;

/// The shading normal turned to the side of the true one, then tilted towards the viewer until it faces it.
fn viewer_side_normal(shading: Vec3, geometric: Vec3, wo: Vec3) -> Vec3 {
    let Some(n) = shading.try_normalize() else { return geometric };
    let n = if n.dot(geometric) < 0.0 { -n } else { n };
    let cos = n.dot(wo);
    if cos >= MIN_VIEW_COS { n } else { (n + wo * (MIN_VIEW_COS - cos)).try_normalize().unwrap_or(geometric) }
}

#[cfg(test)]
mod tests;
