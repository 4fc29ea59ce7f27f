//! Triangles of one frame in world space, and the rays that are shot at them.
//!
//! All instances are flattened into one list of world-space triangles with one eight-wide BVH a frame.

use crate::bvh::Bvh;
use fearless_simd::dispatch;
use glam::{Vec2, Vec3, Vec3A};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The geometry of the last frame that was traced, for the next one in which nothing has moved: most files are still,
/// and the BVH of half a million triangles takes longer than a small frame. Clones share it.
#[derive(Clone, Default)]
pub(crate) struct GeometryCache(Arc<Mutex<Option<Arc<Geometry>>>>);

impl std::fmt::Debug for GeometryCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("GeometryCache")
    }
}

impl GeometryCache {
    /// The geometry of these triangles: the last one where it is of the very same.
    pub(crate) fn geometry(&self, triangles: Vec<Triangle>, sources: Vec<TriangleSource>) -> Arc<Geometry> {
        if let Some(last) = self.last().clone().filter(|last| last.is_of(&triangles, &sources)) {
            return last;
        }
        // Freed first: two of them may not fit. The lock is not held while building, which runs other tasks of rayon.
        *self.last() = None;
        let geometry = Arc::new(Geometry::new(triangles, sources));
        *self.last() = Some(Arc::clone(&geometry));
        geometry
    }

    fn last(&self) -> MutexGuard<'_, Option<Arc<Geometry>>> {
        // Whoever panicked while holding the lock left a whole value behind.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How far a new ray starts from the surface it leaves, as a share of the largest coordinate of the triangle's
/// corners: 64 units in the last place of that coordinate. Points made from barycentric coordinates are off by a few.
pub(crate) const OFFSET_SHARE: f32 = 1.0 / (1 << 18) as f32;

/// By how much a triangle's box is larger than the triangle, as a share of its largest coordinate: 16 units in the last
/// place.
const BOX_MARGIN: f32 = 1.0 / (1 << 20) as f32;

/// Shadow rays end this share short of the light, so that the light does not shadow itself.
pub(crate) const SHADOW_END: f32 = 1.0 - 1e-4;

/// A triangle in world space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    pub(crate) v: [Vec3A; 3],
}

impl Boundable for Triangle {
    fn aabb(&self) -> Aabb {
        self.bounds()
    }
}

impl Triangle {
    /// The box that the hierarchy is built of.
    pub(crate) fn bounds(&self) -> Aabb {
        // Slab tests round: without a margin a ray along a shared edge may miss the boxes of both triangles.
        let margin = Vec3A::splat(self.v[0].abs().max(self.v[1].abs()).max(self.v[2].abs()).max_element() * BOX_MARGIN);
        let exact = Aabb::from_points(&self.v);
        Aabb::new(exact.min - margin, exact.max + margin)
    }

    /// Ray parameter and barycentric coordinates (weights of corners 1 and 2), or nothing.
    ///
    /// The signs of three edge functions decide. Each is exactly negated for the neighbour that shares the edge, so
    /// no ray passes between two triangles that share an edge.
    #[inline(always)]
    fn intersect(&self, origin: Vec3A, direction: Vec3A, tmax: f32) -> Option<(f32, f32, f32)> {
        let a = self.v[0] - origin;
        let b = self.v[1] - origin;
        let c = self.v[2] - origin;
        let (e0, e1, e2) = (c - a, a - b, b - c);
        let u = e0.cross(c + a).dot(direction);
        let v = e1.cross(a + b).dot(direction);
        let w = e2.cross(b + c).dot(direction);
        if !((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0)) {
            return None;
        }
        let normal = e1.cross(e0);
        let along = normal.dot(direction);
        let sum = u + v + w;
        if along == 0.0 || sum == 0.0 {
            return None;
        }
        let t = normal.dot(a) / along;
        if t > 0.0 && t <= tmax { Some((t, u / sum, v / sum)) } else { None }
    }
}

/// Where a ray met a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    /// Distance, directions being unit.
    pub(crate) t: f32,
    /// Index of the triangle in [`Geometry`].
    pub(crate) triangle: u32,
    /// Weights of the corners 1 and 2.
    pub(crate) barycentric: Vec2,
}

/// Which instance and which of its mesh's triangles a world-space triangle is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TriangleSource {
    pub(crate) instance: u32,
    pub(crate) triangle: u32,
}

/// Exponent of two up to which coordinates reach inside the BVH, whatever the scene's unit: its bounds of directions hold
/// for this size.
const INNER_EXPONENT: i32 = 12;

/// The triangles of one frame and their BVH.
pub(crate) struct Geometry {
    /// Corners times `inner_from_world`.
    pub(crate) triangles: Vec<Triangle>,
    /// A power of two and its inverse: scaling is exact.
    pub(crate) inner_from_world: f32,
    pub(crate) world_from_inner: f32,
    pub(crate) sources: Vec<TriangleSource>,
    /// Position in `triangles` of the n-th triangle that was handed in.
    pub(crate) position_of: Vec<u32>,
    pub(crate) bvh: Option<Bvh>,
}

impl Geometry {
    /// Takes finite triangles that have an area.
    pub(crate) fn new(triangles: Vec<Triangle>, sources: Vec<TriangleSource>) -> Self {
        let largest =
            triangles.iter().flat_map(|t| t.v).map(|v| v.abs().max_element()).fold(f32::MIN_POSITIVE, f32::max);
        // The clamp keeps both powers finite and normal.
        let shift = (INNER_EXPONENT - largest.log2().ceil() as i32).clamp(-60, 60);
        let (inner_from_world, world_from_inner) = (2_f32.powi(shift), 2_f32.powi(-shift));
        if triangles.is_empty() {
            let position_of = Vec::new();
            return Self { triangles, inner_from_world, world_from_inner, sources, position_of, bvh: None };
        }
        let triangles: Vec<Triangle> =
            triangles.into_iter().map(|t| Triangle { v: t.v.map(|v| v * inner_from_world) }).collect();
        // Triangles are stored in the order of the leaves: no indirection while tracing.
        let (bvh, order) = Bvh::new(&triangles);
        let mut position_of = vec![0; triangles.len()];
        for (position, &index) in order.iter().enumerate() {
            position_of[index as usize] = position as u32;
        }
        let triangles = order.iter().map(|&i| triangles[i as usize]).collect();
        let sources = order.iter().map(|&i| sources[i as usize]).collect();
        Self { triangles, inner_from_world, world_from_inner, sources, position_of, bvh: Some(bvh) }
    }

    /// Whether it was made of these triangles in this order.
    fn is_of(&self, triangles: &[Triangle], sources: &[TriangleSource]) -> bool {
        triangles.len() == self.triangles.len()
            && triangles.iter().zip(sources).zip(&self.position_of).all(|((triangle, source), &position)| {
                let position = position as usize;
                let kept = &self.triangles[position];
                *source == self.sources[position] && triangle.v.map(|v| v * self.inner_from_world) == kept.v
            })
    }

    pub(crate) fn source(&self, triangle: u32) -> TriangleSource {
        self.sources[triangle as usize]
    }

    pub(crate) fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].v.map(|v| Vec3::from(v * self.world_from_inner))
    }

    /// Index here of the n-th triangle that was handed to [`Geometry::new`].
    pub(crate) fn position_of(&self, n: usize) -> u32 {
        self.position_of[n]
    }

    pub(crate) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// The nearest triangle along a unit direction; of several at the same distance the one with the least source.
    #[inline]
    pub(crate) fn closest(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.closest_where(origin, direction, |_, _| true)
    }

    /// The same among the points (triangle, weights of corners 1 and 2) for which `is_there` holds.
    #[inline(always)]
    pub(crate) fn closest_where(
        &self,
        origin: Vec3,
        direction: Vec3,
        is_there: impl Fn(u32, Vec2) -> bool,
    ) -> Option<Hit> {
        let bvh = self.bvh.as_ref()?;
        if !(origin.is_finite() && direction.is_finite()) {
            return None;
        }
        let (origin, direction) = (Vec3A::from(origin) * self.inner_from_world, Vec3A::from(direction));
        let mut best: Option<Hit> = None;
        let test = |index: usize, limit: f32| match self.triangles[index].intersect(origin, direction, limit) {
            None => limit,
            Some((_, u, v)) if !is_there(index as u32, Vec2::new(u, v)) => limit,
            Some((t, u, v)) => {
                let triangle = index as u32;
                if best.is_none_or(|b| t < b.t || (t == b.t && self.rank(triangle) < self.rank(b.triangle))) {
                    best = Some(Hit { t, triangle, barycentric: Vec2::new(u, v) });
                }
                t
            }
        };
        dispatch!(bvh.level(), simd => bvh.walk_to_nearest(simd, origin, direction, test));
        best.map(|hit| Hit { t: hit.t * self.world_from_inner, ..hit })
    }

    fn rank(&self, triangle: u32) -> (u32, u32) {
        let source = self.sources[triangle as usize];
        (source.instance, source.triangle)
    }

    /// True where something lies between the origin and `distance` along a unit direction (infinite: anywhere).
    #[inline]
    pub(crate) fn occluded(&self, origin: Vec3, direction: Vec3, distance: f32) -> bool {
        self.occluded_where(origin, direction, distance, |_, _| true)
    }

    /// The same among the points (triangle, weights of corners 1 and 2) for which `is_there` holds.
    #[inline(always)]
    pub(crate) fn occluded_where(
        &self,
        origin: Vec3,
        direction: Vec3,
        distance: f32,
        is_there: impl Fn(u32, Vec2) -> bool,
    ) -> bool {
        let Some(bvh) = self.bvh.as_ref() else { return false };
        if !(origin.is_finite() && direction.is_finite()) {
            return true;
        }
        let (origin, direction) = (Vec3A::from(origin) * self.inner_from_world, Vec3A::from(direction));
        let limit = if distance.is_finite() { distance * SHADOW_END * self.inner_from_world } else { f32::MAX };
        let test = |index: usize| match self.triangles[index].intersect(origin, direction, limit) {
            Some((_, u, v)) => is_there(index as u32, Vec2::new(u, v)),
            None => false,
        };
        dispatch!(bvh.level(), simd => bvh.walk_to_any(simd, origin, direction, limit, test))
    }

    /// How far a ray that leaves this triangle must start from it, in world units. Grows with the scene's unit.
    #[inline]
    pub(crate) fn offset(&self, triangle: u32) -> f32 {
        let v = &self.triangles[triangle as usize].v;
        v[0].abs().max(v[1].abs()).max(v[2].abs()).max_element() * OFFSET_SHARE * self.world_from_inner
    }

    /// The nearest triangle by testing all of them: the oracle of the BVH's test.
    #[cfg(test)]
    fn closest_by_brute_force(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for (index, triangle) in self.triangles.iter().enumerate() {
            let origin = Vec3A::from(origin) * self.inner_from_world;
            if let Some((t, u, v)) = triangle.intersect(origin, direction.into(), f32::INFINITY) {
                let index = index as u32;
                if best.is_none_or(|b| t < b.t || (t == b.t && self.rank(index) < self.rank(b.triangle))) {
                    best = Some(Hit { t, triangle: index, barycentric: Vec2::new(u, v) });
                }
            }
        }
        best.map(|hit| Hit { t: hit.t * self.world_from_inner, ..hit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn soup(seed: u32, count: usize, scale: f32) -> Geometry {
        // A small multiplicative generator: the test needs variety, not quality.
        let mut state = seed.wrapping_mul(747_796_405).wrapping_add(1);
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut point = |s: f32| Vec3A::new(next(), next(), next()) * s;
        let triangles = (0..count)
            .map(|_| {
                let c = point(2.0 * scale);
                Triangle { v: [c + point(0.3 * scale), c + point(0.3 * scale), c + point(0.3 * scale)] }
            })
            .collect();
        let sources = (0..count as u32).map(|i| TriangleSource { instance: 0, triangle: i }).collect();
        Geometry::new(triangles, sources)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn bvh_agrees_with_brute_force(
            seed in 0_u32..1000, count in 1_usize..200, scale in prop::sample::select(vec![0.01_f32, 1.0, 100.0]),
            rays in prop::collection::vec((-1.5_f32..1.5, -1.5_f32..1.5, -1.5_f32..1.5, -1.0_f32..1.0, -1.0_f32..1.0), 50),
        ) {
            let geometry = soup(seed, count, scale);
            let mut hits = 0;
            for (x, y, z, a, b) in rays {
                let origin = Vec3::new(x, y, z) * scale;
                let direction = (Vec3::new(a, b, 0.3) * scale - origin).normalize();
                let expected = geometry.closest_by_brute_force(origin, direction);
                let found = geometry.closest(origin, direction);
                prop_assert_eq!(found, expected);
                if let Some(hit) = expected {
                    hits += 1;
                    prop_assert!(geometry.occluded(origin, direction, hit.t * 1.01));
                    prop_assert!(!geometry.occluded(origin, direction, hit.t * 0.99));
                }
                prop_assert_eq!(geometry.occluded(origin, direction, f32::INFINITY), expected.is_some());
            }
            // Without hits the comparison above would say nothing.
            prop_assert!(count < 100 || hits > 0);
        }
    }

    #[test]
    fn axis_aligned_rays_and_flat_boxes_are_hit() {
        let v = [Vec3A::new(-1.0, 0.0, -1.0), Vec3A::new(1.0, 0.0, -1.0), Vec3A::new(0.0, 0.0, 1.0)];
        let geometry = Geometry::new(vec![Triangle { v }], vec![TriangleSource { instance: 0, triangle: 0 }]);
        assert_eq!(geometry.closest(Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y).unwrap().t, 2.0);
        assert!(geometry.closest(Vec3::new(0.0, 2.0, 0.0), Vec3::Y).is_none());
        assert!(geometry.closest(Vec3::new(0.0, f32::NAN, 0.0), Vec3::Y).is_none());
    }

    #[test]
    fn near_hits_are_found_in_any_unit() {
        for scale in [1e-4_f32, 1.0, 1e4] {
            let v = [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, y)| Vec3A::new(x, y, 0.0) * scale);
            let geometry = Geometry::new(vec![Triangle { v }], vec![TriangleSource { instance: 0, triangle: 0 }]);
            let height = 1e-5 * scale;
            let hit = geometry.closest(Vec3::Z * height, Vec3::NEG_Z).unwrap();
            assert!((hit.t / height - 1.0).abs() < 1e-5, "{hit:?} at {scale}");
            assert!(geometry.occluded(Vec3::Z * height, Vec3::NEG_Z, 2.0 * height));
        }
    }

    #[test]
    fn geometry_is_kept_while_nothing_moves() {
        let of = |height: f32, instance: u32| {
            let v = [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, y)| Vec3A::new(x, y, height));
            let still = Triangle { v: v.map(|v| v + Vec3A::X * 3.0) };
            let sources = [instance, 1].map(|instance| TriangleSource { instance, triangle: 0 });
            (vec![Triangle { v }, still], sources.to_vec())
        };
        let cache = GeometryCache::default();
        let at = |(triangles, sources)| cache.geometry(triangles, sources);
        let first = at(of(0.5, 0));
        assert!(Arc::ptr_eq(&first, &at(of(0.5, 0))));
        let moved = at(of(0.25, 0));
        assert!(!Arc::ptr_eq(&first, &moved));
        assert_eq!(moved.closest(Vec3::Z, Vec3::NEG_Z).unwrap().t, 0.75);
        assert!(!Arc::ptr_eq(&moved, &at(of(0.25, 2))));
        assert_eq!(at((Vec::new(), Vec::new())).len(), 0);
    }

    #[test]
    fn a_closed_mesh_does_not_leak() {
        let mesh = crate::shapes::uv_sphere(1.0, 37, 19);
        let triangles: Vec<_> =
            mesh.triangles.iter().map(|t| Triangle { v: t.map(|i| mesh.positions[i as usize].into()) }).collect();
        let sources = (0..triangles.len() as u32).map(|i| TriangleSource { instance: 0, triangle: i }).collect();
        let corners: Vec<Vec3> = triangles.iter().map(|t| Vec3::from(t.v[0])).collect();
        let geometry = Geometry::new(triangles, sources);
        // Straight at corners and edges: the worst case. (Exactly through a corner where many triangles meet, rounding
        // can turn all edges the same way; so corners are not aimed at from the centre, where that happens.)
        for pair in corners.windows(2) {
            for s in [0.0, 0.25, 0.5] {
                let direction = pair[0].lerp(pair[1], s).normalize_or(Vec3::X);
                for origin in [Vec3::ZERO, Vec3::new(0.1, -0.07, 0.03)] {
                    if (s == 0.0 || pair[0] == pair[1]) && origin == Vec3::ZERO {
                        continue;
                    }
                    let found = geometry.closest(origin, direction);
                    let expected = geometry.closest_by_brute_force(origin, direction);
                    assert!(found.is_some(), "from {origin} to {direction}: {expected:?}");
                    assert_eq!(found, geometry.closest_by_brute_force(origin, direction));
                }
            }
        }
    }
}
