//! The cross-bilateral weight of stages 4, 7, 9 and 10 \[E]: geometry only, no colour.
//!
//! Centre p, tap q, dX = X_q - X_p:
//! - w_z = max(0, 1 - Kz |z_q - z_plane(q)| / z_p), z_plane the view depth that p's tangent plane has at q; 0 where
//!   that plane is edge-on or behind the eye;
//! - w_n = max(0, 1 - Kn (1 - max(0, n_p.n_q)^4));
//! - w_p = max(0, 1 - 2 Kp e / |dX|)^2, e = max(|dX.n_p|, |dX.n_q|); 1 where |dX| is under a hundredth of a pixel;
//! - w_g = max(0, 1 - 10 Kg |s_q - s_p|), s = 1 - roughness;
//! - differing ids, or background: 0.
//!
//! The contact stop (ours), of matte light where `edge.contact` a is above 0, is no part of it. In the filter by history, for a tap that
//! lies (dx, dy) pixels away: w_c(dx, 0) w_c(0, dy), along an axis
//! w_c(e) = max(0, 1 - (t / a)^2)^2, t = |X_{p+e} - X_p| max(h(p, p - e), h(p + e, p + 2e)), h(c, r) = max(0, (X_r - X_c).n_p) / |X_r - X_c|^2,
//! 0 where r is background or lies beyond the picture; w_c is 1 where p + e is or does, and where e is 0. In stages 4 and 7, whose many taps
//! lie in all directions: max(0, 1 - (|dX| K / a)^2)^2, K the largest h(p, r) of the r that lie 2 and 8 pixels away along both axes. Indirect light changes as fast as surfaces are
//! near (the split-sphere model of Ward, Rubinstein and Clear, SIGGRAPH 1988): in a corner from pixel to pixel, so that two
//! pixels of one wall may show different light though geometry says that they are alike.

use crate::settings::Edge;
use glam::Vec3;

/// Distances under this share of a pixel's size have no direction worth testing \[E].
pub const COINCIDENT_PX: f32 = 0.01;
/// Kg counts per tenth of smoothness \[E].
pub const GLOSS_SCALE: f32 = 10.0;

/// What a pixel shows: a surface point, or background where the depth is infinite.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World position relative to the eye.
    pub(crate) position: Vec3,
    /// World normal, unit.
    pub(crate) normal: Vec3,
    /// View depth; +inf: background.
    pub view_depth: f32,
    /// Perceptual roughness.
    pub roughness: f32,
    /// Object or material.
    pub id: u32,
}

/// Distances, in pixels along both axes, at which stages 4 and 7 look for what is close to a pixel.
pub const CONTACT_STEPS: [i32; 2] = [2, 8];

/// How far stages 4 and 7 look for the contact stop, in pixels.
pub(crate) fn contact_reach(edge: &Edge) -> usize {
    if edge.contact > 0.0 { CONTACT_STEPS[1] as usize } else { 0 }
}

/// h: how closely what lies `above` a tangent plane, at a squared distance, faces its pixel; 1 / world unit.
#[inline(always)]
pub fn closeness(above: f32, squared: f32) -> f32 {
    if above > 0.0 { above / squared } else { 0.0 }
}

/// The contact stop of a pair at a squared distance; `nearest`: the largest h; `gain`: 1 / a^2.
#[inline(always)]
pub fn contact_stop(squared: f32, nearest: f32, gain: f32) -> f32 {
    let left = 1.0 - squared * (nearest * nearest) * gain;
    let left = if left > 0.0 { left } else { 0.0 };
    left * left
}

/// The gains of the weight for one lobe.
#[derive(Clone, Copy, Debug)]
pub struct EdgeStops {
    depth: f32,
    normal: f32,
    plane: f32,
    gloss: f32,
    /// a; 0: no contact stop. [`EdgeStops::weight`] does not hold it.
    pub(crate) contact: f32,
}

impl EdgeStops {
    /// For stages 4 and 7.
    pub fn matte(edge: &Edge) -> Self {
        Self {
            depth: edge.depth,
            normal: edge.normal,
            plane: edge.plane,
            gloss: edge.matte_gloss,
            contact: edge.contact,
        }
    }

    /// For stages 9 and 10.
    pub fn glossy(edge: &Edge) -> Self {
        Self { gloss: edge.glossy_gloss, contact: 0.0, ..Self::matte(edge) }
    }

    /// The weight of tap `q` for centre `p`, 0..1, without the Gaussian.
    ///
    /// `q_origin`, `q_direction`: the ray of q's pixel, relative to the eye, direction scaled to one unit of view
    /// depth. `pixel_size`: of a pixel at p's depth, world units.
    #[inline(always)]
    pub fn weight(&self, p: &Surface, q: &Surface, q_origin: Vec3, q_direction: Vec3, pixel_size: f32) -> f32 {
        if q.id != p.id || !q.view_depth.is_finite() {
            return 0.0;
        }
        let facing = p.normal.dot(q_direction);
        let plane_depth = p.normal.dot(p.position - q_origin) / facing;
        let w_depth = if plane_depth > 0.0 && plane_depth.is_finite() {
            (1.0 - self.depth * (q.view_depth - plane_depth).abs() / p.view_depth).max(0.0)
        } else {
            0.0
        };
        let cosine = p.normal.dot(q.normal).max(0.0);
        let squared = cosine * cosine;
        let w_normal = (1.0 - self.normal * (1.0 - squared * squared)).max(0.0);
        let offset = q.position - p.position;
        let distance = offset.length();
        let w_plane = if distance < COINCIDENT_PX * pixel_size {
            1.0
        } else {
            let out_of_plane = offset.dot(p.normal).abs().max(offset.dot(q.normal).abs());
            let w = (1.0 - 2.0 * self.plane * out_of_plane / distance).max(0.0);
            w * w
        };
        let w_gloss = (1.0 - GLOSS_SCALE * self.gloss * (q.roughness - p.roughness).abs()).max(0.0);
        w_depth * w_normal * w_plane * w_gloss
    }
}
