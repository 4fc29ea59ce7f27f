//! A flat lamp of several triangles, sampled as one surface: samples that are spread evenly over the unit square are
//! spread evenly over the whole lamp.

use super::triangle::{MAX_SPHERICAL_SOLID_ANGLE, MIN_SPHERICAL_SOLID_ANGLE, TriangleSample, TriangleView};
use crate::warp::ONE_MINUS_EPSILON;
use glam::{DVec3, Vec2, Vec3};

/// Largest distance of a vertex from the plane, as a share of the patch's extent.
const FLATNESS: f32 = 1e-5;

/// The patch is sampled by area from points farther from its centre than this many of its radii: there the densities
/// per area and per steradian differ little, and the samples' even spread takes care of the difference.
pub(crate) const NEAR_RADII: f32 = 1.5;

/// Triangles in one plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Fans turn about the middle vertex, each triangle beginning where the one before ended.
    pub(crate) triangles: Vec<[Vec3; 3]>,
    /// Share of the area up to and with each triangle.
    pub(crate) cumulative: Vec<f32>,
    /// Corner and edges where the patch is a parallelogram.
    pub(crate) parallelogram: Option<[Vec3; 3]>,
    pub(crate) normal: Vec3,
    pub(crate) area: f32,
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
}

impl Patch {
    /// Largest number of triangles: views keep a table of this length on the stack.
    pub const MAX_TRIANGLES: usize = 32;

    /// Joins triangles that lie in one plane, face one way and do not overlap. `None` where they do not, or where they
    /// are more than a patch may hold or have no area.
    pub fn new(triangles: &[[Vec3; 3]]) -> Option<Self> {
        let first = triangles.first()?;
        let normal = (first[1] - first[0]).cross(first[2] - first[0]).try_normalize()?;
        let vertices = || triangles.iter().flatten();
        let (low, high) =
            vertices().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
        let reach = FLATNESS * (high - low).length();
        let areas: Vec<f32> = triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).dot(normal)).collect();
        let area: f32 = areas.iter().sum();
        let flat = vertices().all(|v| (*v - first[0]).dot(normal).abs() <= reach);
        let usable =
            triangles.len() <= Self::MAX_TRIANGLES && flat && areas.iter().all(|a| *a > 0.0) && area.is_finite();
        if !usable {
            return None;
        }
        let triangles = fan(triangles);
        let mut sum = 0.0;
        let cumulative = triangles
            .iter()
            .map(|[a, b, c]| {
                sum += 0.5 * (*b - *a).cross(*c - *a).dot(normal) / area;
                sum
            })
            .collect();
        let parallelogram = match triangles.as_slice() {
            [[p, apex, q], [p2, apex2, q2]] => {
                let closed = q == p2 && apex == apex2 && (*q - *p).distance(*q2 - *apex) <= reach;
                closed.then_some([*apex, *p - *apex, *q2 - *apex])
            }
            _ => None,
        };
        Some(Self { triangles, cumulative, parallelogram, normal, area, low, high })
    }

    /// Total area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// Unit normal of the front side.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Corners of the box around it.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        (self.low, self.high)
    }

    /// The triangles, each a rotation of one that was given.
    pub fn triangles(&self) -> &[[Vec3; 3]] {
        &self.triangles
    }
}

/// Turns the triangles of a fan so that the common vertex is in the middle of each, and puts them in sequence. Triangles
/// without a common vertex are left as they are: only the spread of samples suffers.
fn fan(triangles: &[[Vec3; 3]]) -> Vec<[Vec3; 3]> {
    let Some(apex) = triangles[0].into_iter().find(|v| triangles.iter().all(|t| t.contains(v))) else {
        return triangles.to_vec();
    };
    let mut rest: Vec<[Vec3; 3]> = triangles
        .iter()
        .map(|&[a, b, c]| {
            if b == apex {
                [a, b, c]
            } else if a == apex {
                [c, a, b]
            } else {
                [b, c, a]
            }
        })
        .collect();
    let start = rest.iter().position(|t| rest.iter().all(|other| other[2] != t[0])).unwrap_or(0);
    let mut sequence = vec![rest.swap_remove(start)];
    while !rest.is_empty() {
        let end = sequence[sequence.len() - 1][2];
        let next = rest.iter().position(|t| t[0] == end).unwrap_or(0);
        sequence.push(rest.swap_remove(next));
    }
    sequence
}

/// A patch seen from a point on a side that emits.
pub(crate) struct PatchView<'a> {
    patch: &'a Patch,
    point: Vec3,
    /// Distance of the point from the patch's plane.
    height: f64,
    /// Sampled by solid angle: that of the triangles up to and with each, in steradians.
    solid_angles: Option<[f64; Patch::MAX_TRIANGLES]>,
    /// Views of the first triangles, where they are sampled by solid angle: they are not made anew for every sample.
    views: [Option<TriangleView>; KEPT_VIEWS],
}

/// Rectangles have two triangles; larger patches are rare.
const KEPT_VIEWS: usize = 2;

impl<'a> PatchView<'a> {
    /// `None` where the point sees a side that does not emit, or the patch edge-on.
    pub(crate) fn new(patch: &'a Patch, two_sided: bool, point: Vec3) -> Option<Self> {
        let height = (point.as_dvec3() - patch.triangles[0][1].as_dvec3()).dot(patch.normal.as_dvec3());
        if height == 0.0 || !height.is_finite() || (height < 0.0 && !two_sided) {
            return None;
        }
        let centre = 0.5 * (patch.low + patch.high);
        let near = NEAR_RADII * 0.5 * (patch.high - patch.low).length();
        let mut views = [const { None }; KEPT_VIEWS];
        let solid_angles = if point.distance_squared(centre) < near * near {
            cumulative_solid_angles(&patch.triangles, point, &mut views)
        } else {
            None
        };
        Some(Self { patch, point, height: height.abs(), solid_angles, views })
    }

    /// The same view, ready for many samples.
    pub(crate) fn prepared(mut self) -> Self {
        if self.solid_angles.is_some() {
            self.views = self.views.map(|view| view.map(TriangleView::prepared));
        }
        self
    }

    #[cfg(test)]
    pub(crate) fn is_by_solid_angle(&self) -> bool {
        self.solid_angles.is_some()
    }

    /// Density of [`Self::sample`] per steradian, for a direction that meets the patch.
    pub(crate) fn pdf(&self, wi: Vec3) -> f32 {
        if let Some(cumulative) = &self.solid_angles {
            return (1.0 / cumulative[self.patch.triangles.len() - 1]) as f32;
        }
        let cos = wi.as_dvec3().dot(self.patch.normal.as_dvec3()).abs();
        if cos <= 0.0 {
            return 0.0;
        }
        // dw = |cos| dA / distance^2.
        let distance = self.height / cos;
        (distance * distance / (cos * f64::from(self.patch.area))) as f32
    }

    pub(crate) fn sample(&self, u: Vec2) -> Option<TriangleSample> {
        let triangles = &self.patch.triangles;
        if let Some(cumulative) = &self.solid_angles {
            let count = triangles.len();
            let target = f64::from(u.x) * cumulative[count - 1];
            let index = cumulative[..count - 1].partition_point(|end| *end <= target);
            let start = if index > 0 { cumulative[index - 1] } else { 0.0 };
            let within = ((target - start) / (cumulative[index] - start)) as f32;
            let u = Vec2::new(within.clamp(0.0, ONE_MINUS_EPSILON), u.y);
            let (wi, distance) = match self.views.get(index) {
                Some(view) => view.as_ref()?.cast(u),
                None => TriangleView::new(&triangles[index], true, self.point)?.cast(u),
            };
            let distance = distance as f32;
            return (distance > 0.0 && distance.is_finite()).then(|| TriangleSample {
                wi: wi.as_vec3(),
                distance,
                pdf: (1.0 / cumulative[count - 1]) as f32,
                barycentrics: Vec3::ZERO,
            });
        }
        let place = match self.patch.parallelogram {
            Some([corner, e1, e2]) => corner + u.x * e1 + u.y * e2,
            None => {
                let cumulative = &self.patch.cumulative;
                let index = cumulative[..cumulative.len() - 1].partition_point(|end| *end <= u.x);
                let start = if index > 0 { cumulative[index - 1] } else { 0.0 };
                let within = ((u.x - start) / (cumulative[index] - start)).clamp(0.0, 1.0);
                let [p, apex, q] = triangles[index];
                // Even along the far edge and in the square of the distance from the apex: even in area.
                apex + u.y.sqrt() * (p.lerp(q, within) - apex)
            }
        };
        let to_light: DVec3 = place.as_dvec3() - self.point.as_dvec3();
        let distance = to_light.length();
        let wi = (to_light / distance).as_vec3().normalize();
        let pdf = self.pdf(wi);
        (distance > 0.0 && distance.is_finite() && pdf > 0.0 && pdf.is_finite()).then_some(TriangleSample {
            wi,
            distance: distance as f32,
            pdf,
            barycentrics: Vec3::ZERO,
        })
    }
}

/// `None` where the whole looks too small or too large for sampling by solid angle. A single triangle may be as small as
/// it likes: then it is hardly ever chosen.
fn cumulative_solid_angles(
    triangles: &[[Vec3; 3]],
    point: Vec3,
    views: &mut [Option<TriangleView>; KEPT_VIEWS],
) -> Option<[f64; Patch::MAX_TRIANGLES]> {
    let mut cumulative = [0.0; Patch::MAX_TRIANGLES];
    let mut sum = 0.0;
    for (index, (end, triangle)) in cumulative.iter_mut().zip(triangles).enumerate() {
        let view = TriangleView::new(triangle, true, point);
        sum += view.as_ref().map_or(0.0, |view| view.solid_angle());
        *end = sum;
        if let Some(kept) = views.get_mut(index) {
            *kept = view;
        }
    }
    (MIN_SPHERICAL_SOLID_ANGLE..=MAX_SPHERICAL_SOLID_ANGLE).contains(&sum).then_some(cumulative)
}
