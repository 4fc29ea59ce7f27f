//! Directional albedo by quadrature: an answer that shares no code with the sampling, for furnace tests.

use super::Bsdf;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// A part of the BRDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// (1 - F)^2 m.
    Matte,
    /// F g.
    Glossy,
    /// g alone.
    GlossyWithoutFresnel,
}

/// Integral of one lobe times the cosine over the hemisphere: the share of constant light that it sends to `wo`.
///
/// Midpoint rule with `resolution` nodes in each of two dimensions; 64 gives three digits, 256 four or five, of any
/// roughness. Only reflection; a mirror's glossy albedo is F(n.wo).
pub fn directional_albedo(bsdf: &Bsdf, lobe: Lobe, resolution: usize) -> Vec3 {
    let n = resolution.max(1);
    if bsdf.is_mirror() && lobe != Lobe::Matte {
        let above = bsdf.is_above(bsdf.mirror_direction());
        let reflectance = if lobe == Lobe::Glossy { bsdf.fresnel_at_mirror() } else { Vec3::ONE };
        return if above { reflectance } else { Vec3::ZERO };
    }
    let mut sum = [0.0f64; 3];
    for i in 0..n {
        for j in 0..n {
            let (s, t) = ((i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32);
            let term = match lobe {
                Lobe::Matte => matte_term(bsdf, s, t),
                Lobe::Glossy | Lobe::GlossyWithoutFresnel => glossy_term(bsdf, lobe, s, t),
            };
            for (total, value) in sum.iter_mut().zip(term.to_array()) {
                *total += f64::from(value);
            }
        }
    }
    Vec3::from_array(sum.map(|v| (v / (n * n) as f64) as f32))
}

/// Integrand over directions, uniform in cos^2 and azimuth: dw cos = pi ds dt.
fn matte_term(bsdf: &Bsdf, s: f32, t: f32) -> Vec3 {
    let cos = s.sqrt();
    let sin = (1.0 - s).sqrt();
    let phi = TAU * t;
    let wi = bsdf.world_from_local(Vec3::new(sin * phi.cos(), sin * phi.sin(), cos));
    bsdf.matte(wi) * PI
}

/// Integrand over half vectors, which is smooth however narrow the lobe is: with tan = alpha r, r = sqrt(q (2 - q)) /
/// (1 - q), the nodes follow the lobe's width and reach far into its tail, which grazing views weigh most; dwi = 4
/// |wo.h| dwh.
fn glossy_term(bsdf: &Bsdf, lobe: Lobe, q: f32, t: f32) -> Vec3 {
    let alpha = bsdf.ggx.alpha();
    let rest2 = (1.0 - q) * (1.0 - q);
    let tan2 = alpha * alpha * (1.0 - rest2) / rest2;
    let cos = 1.0 / (1.0 + tan2).sqrt();
    let sin = tan2.sqrt() * cos;
    let phi = TAU * t;
    let h = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
    let cos_half = bsdf.wo_local.dot(h);
    let wi_local = super::ggx::reflect(bsdf.wo_local, h);
    if cos_half <= 0.0 || wi_local.z <= 0.0 {
        return Vec3::ZERO;
    }
    let wi = bsdf.world_from_local(wi_local);
    let value = match lobe {
        Lobe::Glossy => bsdf.glossy(wi),
        _ => Vec3::splat(bsdf.glossy_without_fresnel(wi)),
    };
    // dwh = sin dtheta dphi = cos^3 tan dtan dphi, and tan dtan = alpha^2 dq / (1 - q)^3.
    let solid_angle_of_node = TAU * cos * cos * cos * alpha * alpha / (rest2 * (1.0 - q));
    value * wi_local.z * 4.0 * cos_half * solid_angle_of_node
}
