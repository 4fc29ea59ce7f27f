//! The direct term: light that needs no filter.

use super::Tracer;
use crate::integrator::{Domain, Integrator, RayCounts};
use crate::primary::{Primary, Vertex};
use crate::sampler::Sampler;
use glam::Vec3;

impl Tracer<'_> {
    /// What needs no filter: background, emission, direct light, light through a surface that is not looked through;
    /// and behind glass, what the two signals do not carry.
    pub(super) fn unfiltered(
        &self,
        integrator: &Integrator<'_, '_>,
        primary: &Primary,
        direct_samples: u32,
        pass: u32,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let count = direct_samples.div_ceil(4).max(1);
        let stream = |i: u32| sampler.with_index(pass.wrapping_mul(count).wrapping_add(i));
        let mut light = Vec3::ZERO;
        match &primary.surface {
            None => {
                let (direction, throughput) = primary.escape;
                light += throughput * self.sources.environment(direction);
            }
            Some(Vertex { point, bsdf, throughput }) => {
                let mut own = point.material.emitted(point.front);
                own += integrator.direct(point, bsdf, direct_samples, pass, sampler, rays);
                let mut through = Vec3::ZERO;
                for i in 0..count {
                    if bsdf.is_transmissive() {
                        through += integrator.transmission_path(point, bsdf, &stream(i), rays);
                    }
                    if !primary.glass.is_empty() {
                        // The glossy signal is taken by the glass: this surface's own lobe is traced unfiltered.
                        let sampler = stream(i).fork(Domain::BehindGlass as u32);
                        let path = integrator.glossy_path(point, bsdf, true, &sampler, rays);
                        through += bsdf.glossy_weight() * path.radiance;
                    }
                }
                light += *throughput * (own + through / count as f32);
            }
        }
        for (number, veil) in primary.veils.iter().enumerate() {
            let sampler = sampler.fork(Domain::Veil as u32 + number as u32);
            light += veil.throughput * Self::unsplit(integrator, veil, direct_samples, pass, &sampler, rays);
        }
        for (number, ray) in primary.behind.iter().enumerate() {
            let mut sum = Vec3::ZERO;
            for i in 0..count {
                let mut sampler = stream(i).fork(Domain::BehindVeil as u32 + number as u32);
                sum += integrator.full(ray.origin, ray.direction, ray.cone, &mut sampler, rays);
            }
            light += ray.throughput * sum / count as f32;
        }
        // Reflections of glass that no signal carries: all but the first, or all before a background.
        let carried = usize::from(primary.surface.is_some());
        for (number, vertex) in primary.glass.iter().enumerate().skip(carried) {
            let mut sum = Vec3::ZERO;
            for i in 0..count {
                let sampler = stream(i).fork(Domain::BehindGlass as u32 + 1 + number as u32);
                let path = integrator.glossy_path(&vertex.point, &vertex.bsdf, true, &sampler, rays);
                sum += vertex.bsdf.glossy_weight() * path.radiance;
            }
            light += vertex.throughput * sum / count as f32;
        }
        light
    }

    /// All light that leaves a surface towards the eye, with no signal left for the denoiser.
    fn unsplit(
        integrator: &Integrator<'_, '_>,
        vertex: &Vertex,
        direct_samples: u32,
        pass: u32,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let Vertex { point, bsdf, .. } = vertex;
        let count = direct_samples.div_ceil(4).max(1);
        let mut scattered = Vec3::ZERO;
        for i in 0..count {
            let sampler = sampler.with_index(pass.wrapping_mul(count).wrapping_add(i));
            scattered += integrator.transmission_path(point, bsdf, &sampler, rays);
            scattered += integrator.matte_weight(bsdf) * integrator.matte_path(point, bsdf, &sampler, rays).radiance;
            scattered += bsdf.glossy_weight() * integrator.glossy_path(point, bsdf, true, &sampler, rays).radiance;
        }
        point.material.emitted(point.front)
            + integrator.direct(point, bsdf, direct_samples, pass, sampler, rays)
            + scattered / count as f32
    }
}
