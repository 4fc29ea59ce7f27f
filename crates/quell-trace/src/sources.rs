//! What lights a world, as the integrator asks for it: emissive triangles found by rays, and light sampling.

use crate::environment::Environment;
use crate::lights::{Emitter, LightSample, LightSampler, Patch};
use crate::scene::{PointlikeLight, Scene};
use crate::world::{EmissiveTriangle, World};
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// No emitter.
const NONE: u32 = u32::MAX;

/// All sources of a world.
pub(crate) struct Sources {
    pub(crate) sampler: LightSampler,
    /// Emitter of each triangle of the geometry, or [`NONE`].
    pub(crate) emitter_of: Vec<u32>,
    /// Triangle of the geometry of each emitter whose radiance varies, or [`NONE`]; empty where none does.
    pub(crate) varying: Vec<u32>,
    pub(crate) environment: Option<Arc<Environment>>,
    /// Number of the environment among the emitters.
    pub(crate) environment_index: usize,
    pub(crate) environment_scale: f32,
    pub(crate) has_area: bool,
}

impl Sources {
    pub(crate) fn new(world: &World<'_>, scene: &Scene) -> Self {
        let mut emitters = Vec::with_capacity(world.emissive.len() + world.lights.len() + 1);
        let mut emitter_of = if world.emissive.is_empty() { Vec::new() } else { vec![NONE; world.geometry.len()] };
        let mut varying = Vec::new();
        let any_varies = world.emissive.iter().any(|e| e.varies);
        let mut rest = world.emissive.as_slice();
        while let Some(first) = rest.first() {
            let (count, patch) = leading_patch(rest);
            for triangle in &rest[..count] {
                emitter_of[triangle.triangle as usize] = emitters.len() as u32;
            }
            let EmissiveTriangle { corners, radiance, two_sided, varies, triangle } = *first;
            if any_varies {
                varying.push(if varies { triangle } else { NONE });
            }
            emitters.push(match patch {
                Some(patch) => Emitter::Patch { patch, radiance, two_sided },
                None => Emitter::Triangle { vertices: corners, radiance, two_sided },
            });
            rest = &rest[count..];
        }
        for light in &world.lights {
            emitters.push(match *light {
                PointlikeLight::Point { position, intensity } => Emitter::Point { position, intensity },
                PointlikeLight::Spot { position, direction, intensity, inner, outer } => Emitter::Spot {
                    position,
                    direction: direction.normalize_or(Vec3::NEG_Y),
                    intensity,
                    inner_angle: inner,
                    outer_angle: outer,
                },
                PointlikeLight::Directional { direction, irradiance } => {
                    Emitter::Directional { direction: direction.normalize_or(Vec3::NEG_Y), irradiance }
                }
            });
        }
        let environment_index = emitters.len();
        let shines = world.environment_scale > 0.0 && scene.environment.mean_radiance().max_element() > 0.0;
        let environment = shines.then(|| Arc::new(scene.environment.clone()));
        if let Some(environment) = &environment {
            emitters.push(Emitter::Environment(Arc::clone(environment)));
        }
        Self {
            sampler: LightSampler::new(emitters),
            emitter_of,
            varying,
            environment,
            environment_index,
            environment_scale: world.environment_scale,
            has_area: !world.emissive.is_empty(),
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.sampler.is_empty()
    }

    pub(crate) fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    /// Whether a ray can find any source.
    pub(crate) fn can_be_hit(&self) -> bool {
        self.has_area || self.environment.is_some()
    }

    pub(crate) fn is_emitter(&self, triangle: u32) -> bool {
        self.emitter_of.get(triangle as usize).is_some_and(|&e| e != NONE)
    }

    /// Radiance from infinitely far away.
    #[inline]
    pub(crate) fn environment(&self, direction: Vec3) -> Vec3 {
        match &self.environment {
            Some(environment) => environment.radiance(direction) * self.environment_scale,
            None => Vec3::ZERO,
        }
    }

    /// A direction towards light; `normal` is 0 where light may come from both sides.
    #[inline]
    pub(crate) fn sample(&self, point: Vec3, normal: Vec3, u: Vec3) -> Option<LightSample> {
        self.finish(self.sampler.sample(point, normal, u)?)
    }

    /// The triangle whose radiance at the sampled point is the world's to say.
    #[inline]
    pub(crate) fn varying_triangle(&self, sample: &LightSample) -> Option<u32> {
        self.varying.get(sample.emitter_index).copied().filter(|&t| t != NONE)
    }

    fn finish(&self, mut sample: LightSample) -> Option<LightSample> {
        if sample.emitter_index == self.environment_index {
            sample.radiance *= self.environment_scale;
        }
        (sample.pdf > 0.0 && sample.pdf.is_finite()).then_some(sample)
    }

    /// [`LightSampler::sample_many`] of these sources.
    #[inline]
    pub(crate) fn sample_many(
        &self,
        point: Vec3,
        normal: Vec3,
        count: u32,
        shift: f32,
        place: impl FnMut(u32) -> Vec2,
        mut take: impl FnMut(LightSample, f32),
    ) {
        self.sampler.sample_many(point, normal, count, shift, place, |sample, times| {
            if let Some(sample) = self.finish(sample) {
                take(sample, times);
            }
        });
    }

    /// Density with which [`Sources::sample`] finds an emissive triangle that the direction meets.
    #[inline]
    pub(crate) fn pdf_of_triangle(&self, point: Vec3, normal: Vec3, triangle: u32, direction: Vec3) -> f32 {
        match self.emitter_of.get(triangle as usize) {
            Some(&emitter) if emitter != NONE => self.sampler.pdf(point, normal, emitter as usize, direction),
            _ => 0.0,
        }
    }

    /// Density with which [`Sources::sample`] finds the environment in this direction.
    #[inline]
    pub(crate) fn pdf_of_environment(&self, point: Vec3, normal: Vec3, direction: Vec3) -> f32 {
        match &self.environment {
            Some(_) => self.sampler.pdf(point, normal, self.environment_index, direction),
            None => 0.0,
        }
    }
}

/// How many of the first triangles make up one flat lamp, and that lamp where they are several: as many as follow each
/// other in the scene, share edges, lie in one plane and shine alike.
fn leading_patch(triangles: &[EmissiveTriangle]) -> (usize, Option<Patch>) {
    let Some(first) = triangles.first() else { return (0, None) };
    if first.varies {
        return (1, None);
    }
    let plane_normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).normalize_or_zero();
    let normal = plane_normal(first.corners);
    let mut joined = vec![first.corners];
    for next in &triangles[1..] {
        let alike = next.radiance == first.radiance && next.two_sided == first.two_sided && !next.varies;
        // Cheap tests first: `Patch::new` has the last word.
        let shares_edge = |t: &[Vec3; 3]| t.iter().filter(|v| next.corners.contains(v)).count() == 2;
        let faces_same_way = || plane_normal(next.corners).dot(normal) > SAME_PLANE_COS;
        if joined.len() == Patch::MAX_TRIANGLES || !alike || !joined.iter().any(shares_edge) || !faces_same_way() {
            break;
        }
        joined.push(next.corners);
    }
    // A strip that bends slowly is flat at its beginning only.
    while joined.len() > 1 {
        if let Some(patch) = Patch::new(&joined) {
            return (joined.len(), Some(patch));
        }
        joined.pop();
    }
    (1, None)
}

/// Cosine above which two triangles may lie in one plane.
const SAME_PLANE_COS: f32 = 0.9999;
