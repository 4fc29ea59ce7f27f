//! Sampling an emitting triangle from a point: uniform in solid angle where it looks large, in area where it looks
//! small (Arvo 1995, "Stratified sampling of spherical triangles").

use crate::warp;
use glam::{DVec3, Vec2, Vec3};

/// Solid angle in steradians below which the triangle is sampled by area. Then it is under 2 degrees wide, and both
/// densities are nearly equal; the spherical construction would lose its digits.
pub(crate) const MIN_SPHERICAL_SOLID_ANGLE: f64 = 1e-3;

/// Solid angle above which, too: the point nearly lies in the triangle.
pub(crate) const MAX_SPHERICAL_SOLID_ANGLE: f64 = 6.2;

/// A triangle seen from a point on a side that emits.
pub(crate) struct TriangleView {
    /// Vertices relative to the point.
    vertices: [DVec3; 3],
    /// Twice the area times the unit normal.
    cross: DVec3,
    /// Directions of the vertices.
    directions: [DVec3; 3],
    solid_angle: f64,
    arcs: Option<Arcs>,
}

/// What all samples of one view by solid angle share: angle at vertex a between the planes of the arcs ab and ac, the
/// tangent of ac there, and the arc ab.
#[derive(Clone, Copy)]
struct Arcs {
    tangent_ac: DVec3,
    cos_alpha: f64,
    sin_alpha: f64,
    cos_ab: f64,
}

pub(crate) struct TriangleSample {
    pub(crate) wi: Vec3,
    pub(crate) distance: f32,
    /// Density per steradian.
    pub(crate) pdf: f32,
    pub(crate) barycentrics: Vec3,
}

impl TriangleView {
    /// `None` where the point sees a side that does not emit, or the triangle edge-on.
    pub(crate) fn new(vertices: &[Vec3; 3], two_sided: bool, point: Vec3) -> Option<Self> {
        let vertices = vertices.map(|v| v.as_dvec3() - point.as_dvec3());
        let cross = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]);
        // Positive: the point lies on the front side.
        let height = -vertices[0].dot(cross);
        if height == 0.0 || !height.is_finite() || (height < 0.0 && !two_sided) {
            return None;
        }
        let directions = [vertices[0].try_normalize()?, vertices[1].try_normalize()?, vertices[2].try_normalize()?];
        let solid_angle = solid_angle(&directions);
        (solid_angle > 0.0).then_some(Self { vertices, cross, directions, solid_angle, arcs: None })
    }

    /// The same view, ready for many samples.
    pub(crate) fn prepared(self) -> Self {
        let arcs = Some(self.arcs());
        Self { arcs, ..self }
    }

    fn arcs(&self) -> Arcs {
        let [a, b, c] = self.directions;
        let (tangent_ab, tangent_ac) = (orthogonal_part(b, a), orthogonal_part(c, a));
        Arcs {
            tangent_ac,
            cos_alpha: tangent_ab.dot(tangent_ac).clamp(-1.0, 1.0),
            sin_alpha: tangent_ab.cross(tangent_ac).length(),
            cos_ab: a.dot(b),
        }
    }

    /// Steradians that the triangle covers.
    pub(crate) fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    fn is_spherical(&self) -> bool {
        (MIN_SPHERICAL_SOLID_ANGLE..=MAX_SPHERICAL_SOLID_ANGLE).contains(&self.solid_angle)
    }

    /// Density of [`Self::sample`] per steradian, for a direction that meets the triangle.
    pub(crate) fn pdf(&self, wi: Vec3) -> f32 {
        if self.is_spherical() {
            return (1.0 / self.solid_angle) as f32;
        }
        let wi = wi.as_dvec3();
        // dw = |cos| dA / distance^2, with distance = height / |n.w| and dA / area uniform.
        let across = wi.dot(self.cross).abs();
        if across <= 0.0 {
            return 0.0;
        }
        let distance = (self.vertices[0].dot(self.cross) / across).abs();
        (2.0 * distance * distance / across) as f32
    }

    pub(crate) fn sample(&self, u: Vec2) -> Option<TriangleSample> {
        if self.is_spherical() {
            return self.sample_by_solid_angle(u);
        }
        let [a, b, c] = self.vertices;
        let barycentrics = warp::uniform_triangle(u).as_dvec3();
        let hit = a * barycentrics.x + b * barycentrics.y + c * barycentrics.z;
        let wi = hit.try_normalize()?;
        self.finish(wi, a.dot(self.cross) / wi.dot(self.cross), barycentrics)
    }

    fn sample_by_solid_angle(&self, u: Vec2) -> Option<TriangleSample> {
        let [a, b, c] = self.vertices;
        let (wi, distance) = self.cast(u);
        let hit = wi * distance;
        let norm = self.cross.length_squared();
        let wb = (hit - a).cross(c - a).dot(self.cross) / norm;
        let wc = (b - a).cross(hit - a).dot(self.cross) / norm;
        let (wb, wc) = (wb.clamp(0.0, 1.0), wc.clamp(0.0, 1.0));
        self.finish(wi, distance, DVec3::new((1.0 - wb - wc).max(0.0), wb, wc))
    }

    /// A direction uniform in solid angle, however small the triangle looks, and the distance to the triangle's plane
    /// along it.
    #[inline]
    pub(super) fn cast(&self, u: Vec2) -> (DVec3, f64) {
        let wi = self.sample_direction(u);
        (wi, self.vertices[0].dot(self.cross) / wi.dot(self.cross))
    }

    fn finish(&self, wi: DVec3, distance: f64, barycentrics: DVec3) -> Option<TriangleSample> {
        let wi = wi.as_vec3().normalize();
        let pdf = self.pdf(wi);
        (distance > 0.0 && distance.is_finite() && pdf > 0.0 && pdf.is_finite()).then(|| TriangleSample {
            wi,
            distance: distance as f32,
            pdf,
            barycentrics: barycentrics.as_vec3(),
        })
    }

    /// A direction uniform over the spherical triangle: `u.x` cuts off a triangle of that share of the area, with the
    /// same vertices a and b; `u.y` places along the arc from its third vertex to b.
    fn sample_direction(&self, u: Vec2) -> DVec3 {
        let [a, b, _] = self.directions;
        let Arcs { tangent_ac, cos_alpha, sin_alpha, cos_ab } = self.arcs.unwrap_or_else(|| self.arcs());

        let (sin_area, cos_area) = (f64::from(u.x) * self.solid_angle).sin_cos();
        // s = sin(area - alpha), t = cos(area - alpha).
        let s = sin_area * cos_alpha - cos_area * sin_alpha;
        let t = cos_area * cos_alpha + sin_area * sin_alpha;
        let p = t - cos_alpha;
        let q = s + sin_alpha * cos_ab;
        let denominator = (q * s + p * t) * sin_alpha;
        let along = ((q * t - p * s) * cos_alpha - q) / denominator;
        let along = if along.is_finite() { along.clamp(-1.0, 1.0) } else { 1.0 };
        let cut = along * a + (1.0 - along * along).sqrt() * tangent_ac;

        // The direction at height z above b's plane in the plane of b and `cut`. sqrt(1 - z^2) over the length of the
        // orthogonal part, written without differences of nearly equal numbers.
        let cos = cut.dot(b);
        let y = f64::from(u.y);
        let z = 1.0 - y * (1.0 - cos);
        z * b + (y * (1.0 + z) / (1.0 + cos).max(f64::MIN_POSITIVE)).sqrt() * (cut - cos * b)
    }
}

/// The unit vector of the part of `x` that is orthogonal to the unit vector `axis`.
fn orthogonal_part(x: DVec3, axis: DVec3) -> DVec3 {
    (x - x.dot(axis) * axis).normalize_or_zero()
}

/// Solid angle of a spherical triangle (Van Oosterom and Strackee 1983, "The solid angle of a plane triangle").
fn solid_angle(directions: &[DVec3; 3]) -> f64 {
    let [a, b, c] = *directions;
    let volume = a.dot(b.cross(c)).abs();
    2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}
