//! Ray cones: how wide the part of the scene is that one ray stands for (Akenine-Moller, Nilsson, Andersson,
//! Barre-Brisebois, Toth, Karras 2019, "Texture level of detail strategies for real-time ray tracing"; ellipses on
//! surfaces as in Akenine-Moller, Crassin, Boksansky, Belcour, Panteleev, Wright 2021, "Improved shader and texture
//! level of detail using ray cones").

use glam::{Vec2, Vec3};

/// A scattered cone opens by this share of the lobe's width alpha: less than the whole lobe, which many paths sample,
/// and enough that a path after a matte surface reads coarse texels.
pub(crate) const LOBE_SHARE: f32 = 0.25;

/// Lookups along the longer axis of a footprint, at most.
pub(crate) const MAX_LOOKUPS: f32 = 8.0;

/// The cone of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    /// Diameter where the ray starts, world units; at a surface: there.
    pub(crate) width: f32,
    /// Growth of the diameter a unit of distance, radians.
    pub(crate) spread: f32,
    /// Whether the eye sees along this ray, in mirrors and through smooth glass if need be. No other sampling finds
    /// the same light then, so emission may be filtered too.
    pub(crate) sharp: bool,
}

impl Cone {
    /// A ray without width: every texture at its finest.
    pub(crate) const FINEST: Self = Self { width: 0.0, spread: 0.0, sharp: false };

    /// The cone at distance `t`.
    pub(crate) fn at(self, t: f32) -> Self {
        Self { width: self.width + self.spread * t, ..self }
    }

    /// The cone of a ray that leaves a surface by a lobe of this perceptual roughness (matte: 1).
    pub(crate) fn scattered(self, roughness: f32, delta: bool) -> Self {
        if delta {
            return self;
        }
        Self { spread: self.spread.max(LOBE_SHARE * roughness * roughness), sharp: false, ..self }
    }
}

/// Where a cone meets a triangle: an ellipse, whose axes are given as changes of the weights of corners 1 and 2.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    /// Across the ray.
    short: Vec2,
    /// Along the ray's trace on the surface, longer the more it grazes.
    long: Vec2,
    several: bool,
}

impl Footprint {
    /// `cone` at the hit of a ray along the unit `direction` on a triangle with the unit normal `normal`.
    pub(crate) fn new(cone: Cone, corners: [Vec3; 3], normal: Vec3, direction: Vec3) -> Self {
        let [a, b, c] = corners;
        let (e1, e2) = (b - a, c - a);
        let cross = e1.cross(e2);
        let scale = cone.width / cross.length_squared();
        let cos = normal.dot(direction);
        let along = (direction - normal * cos).try_normalize();
        // Straight down on the surface any pair of axes will do.
        let along = along.unwrap_or_else(|| normal.any_orthonormal_vector());
        let across = normal.cross(along);
        let weights = |v: Vec3| Vec2::new(v.cross(e2).dot(cross), e1.cross(v).dot(cross)) * scale;
        // A cone of some width never covers more than this many widths: beyond, its far end is another surface.
        let stretch = 1.0 / cos.abs().max(1e-2);
        Self { short: weights(across), long: weights(along) * stretch, several: cone.sharp }
    }

    /// How an image is looked up whose coordinates change by `change` from corner 0 to corners 1 and 2, in texels:
    /// level of detail, number of lookups, and the step from one to the next as a change of the weights.
    pub(crate) fn lookups(&self, change: [Vec2; 2]) -> (f32, u32, Vec2) {
        let length = |w: Vec2| (change[0] * w.x + change[1] * w.y).length();
        let (a, b) = (length(self.short), length(self.long));
        let (short, long, axis) = if a < b { (a, b, self.long) } else { (b, a, self.short) };
        if !self.several {
            return (0.5 * (short * long).log2(), 1, Vec2::ZERO);
        }
        let lookups = (long / short.max(1.0)).clamp(1.0, MAX_LOOKUPS).ceil();
        let lod = short.max(long / lookups).log2();
        (lod, lookups as u32, axis / lookups)
    }
}
