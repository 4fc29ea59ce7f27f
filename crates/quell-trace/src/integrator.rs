//! The estimators of `algorithm.md` section 1: direct light, one matte and one glossy path, and the full integral.
//!
//! Vertices are counted from the eye: x0 is the eye, x1 the primary surface. A path of M or G leaves x1 and is
//! scattered at most `bounces` times, at x2, x3, ..; light is looked for at each of these vertices and once more by
//! the segment after the last. So the picture holds all light that is scattered at most `bounces` + 1 times between
//! source and eye, and the reference holds the very same.

use crate::bsdf::Bsdf;
use crate::cone::Cone;
use crate::lights::LightSample;
use crate::material::MaterialModel;
use crate::primary::{self, PrimaryReplacement};
use crate::sampler::Sampler;
use crate::sources::Sources;
use crate::world::{SurfacePoint, World};
use glam::Vec3;

/// Paths are ended at random from this scattering (counted from 1 at x2) onwards.
pub(crate) const ROULETTE_FROM: u32 = 2;

/// Least probability to survive the roulette, so that no path's weight grows more than tenfold there.
pub(crate) const ROULETTE_FLOOR: f32 = 0.1;

/// Perceptual roughness up to which a lamp is seen in the glossy signal, and from which its light is sampled for the
/// direct term (algorithm.md section 1).
pub(crate) const LAMP_IN_GLOSSY: (f32, f32) = (0.1, 0.3);

/// Of the direct term's rays, one such ray per this many shadow rays follows the glossy lobe.
pub(crate) const GLOSSY_RAYS_DIVISOR: u32 = 4;

/// Above this roughness light sampling alone serves the glossy lobe's direct light.
pub(crate) const GLOSSY_RAYS_MAX_ROUGHNESS: f32 = 0.75;

/// Domains of the sampler, so that the number of draws of one purpose does not shift another's.
#[derive(Clone, Copy)]
pub(crate) enum Domain {
    Matte = 1,
    Glossy,
    Full,
    DirectLight,
    DirectMatte,
    DirectGlossy,
    Transmission,
    /// This and the following, one for each interface of glass.
    BehindGlass,
    /// This and the following, one for each veil that the eye looks through.
    Veil = 64,
    /// This and the following, one for each surface that covers a part of its points only.
    BehindVeil = 128,
    /// Where in the pixel a sample of a reference lies.
    Pixel = 192,
}

/// What a segment's end adds when it meets a source.
#[derive(Clone, Copy)]
pub(crate) enum Seen {
    /// This share of the source's light, whatever way the direction was found.
    Share(f32),
    /// The share that light sampling leaves to a direction that was found with density `pdf` per steradian at a
    /// point with this normal (multiple importance sampling).
    Balanced { pdf: f32, point: Vec3, normal: Vec3 },
}

/// Light along a ray.
pub(crate) struct Incoming {
    pub(crate) radiance: Vec3,
    /// Length of the first segment, +inf where it leaves the scene.
    pub(crate) distance: f32,
}

/// Rays shot so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Rays that ask what is hit first.
    pub closest: u64,
    /// Rays that ask whether anything is hit.
    pub shadow: u64,
}

impl RayCounts {
    /// All rays.
    pub fn total(&self) -> u64 {
        self.closest + self.shadow
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.closest += other.closest;
        self.shadow += other.shadow;
    }
}

/// Light transport in one world.
pub(crate) struct Integrator<'w, 's> {
    pub(crate) world: &'w World<'s>,
    pub(crate) sources: &'w Sources,
    pub(crate) model: MaterialModel,
    /// Scatterings after the primary surface.
    pub(crate) bounces: u32,
    /// Samples carry the ratio of their own factor to the weight's.
    pub(crate) exact: bool,
    /// Surfaces that the eye looks through.
    pub(crate) replacement: PrimaryReplacement,
}

/// Share of a lamp's light that the glossy signal carries at its first hit; the direct term carries the rest.
pub(crate) fn lamp_share_of_glossy(roughness: f32) -> f32 {
    let (low, high) = LAMP_IN_GLOSSY;
    let x = ((roughness - low) / (high - low)).clamp(0.0, 1.0);
    1.0 - x * x * (3.0 - 2.0 * x)
}

/// The side from which a surface takes light, for light sampling: its normal, or 0 for both sides.
fn light_side(bsdf: &Bsdf) -> Vec3 {
    if bsdf.is_transmissive() { Vec3::ZERO } else { bsdf.normal() }
}

fn power_heuristic(a: f32, b: f32) -> f32 {
    let squares = (a * a, b * b);
    if squares.0.is_infinite() {
        // Lamps seen nearly edge-on have densities whose squares overflow.
        let ratio = if a.is_infinite() { 0.0 } else { b / a };
        return 1.0 / (1.0 + ratio * ratio);
    }
    let (a, b) = squares;
    if a + b > 0.0 { a / (a + b) } else { 0.0 }
}

impl Integrator<'_, '_> {
    pub(crate) fn bsdf(&self, point: &SurfacePoint, direction: Vec3) -> Bsdf {
        Bsdf::new(&point.material, self.model, point.shading_normal, point.geometric_normal, -direction, !point.front)
    }

    #[expect(clippy::too_many_arguments, reason = "a ray and what it is for")]
    /// Radiance that arrives along a ray, from surfaces that it meets and scatters at at most `scatterings` times.
    pub(crate) fn incoming(
        &self,
        origin: Vec3,
        direction: Vec3,
        cone: Cone,
        seen: Seen,
        scatterings: u32,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Incoming {
        self.walk(origin, direction, cone, seen, scatterings, false, sampler, rays)
    }

    /// The full integral along an eye ray by one ordinary path. Surfaces that are looked through do not count as
    /// scatterings, as they do not for the factored estimators.
    pub(crate) fn full(
        &self,
        origin: Vec3,
        direction: Vec3,
        cone: Cone,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        self.walk(origin, direction, cone, Seen::Share(1.0), self.bounces + 1, true, sampler, rays).radiance
    }

    #[expect(clippy::too_many_arguments, reason = "the state of a path")]
    fn walk(
        &self,
        mut origin: Vec3,
        mut direction: Vec3,
        mut cone: Cone,
        mut seen: Seen,
        mut scatterings: u32,
        mut from_eye: bool,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Incoming {
        let mut chain = 0;
        let mut throughput = Vec3::ONE;
        let mut radiance = Vec3::ZERO;
        let mut distance = f32::INFINITY;
        let mut segment = 0;
        loop {
            let last = segment == scatterings;
            if last && segment > 0 && (!self.sources.can_be_hit() || matches!(seen, Seen::Share(0.0))) {
                break;
            }
            rays.closest += 1;
            let veils = self.world.veils(sampler, direction);
            let Some(hit) = self.world.closest(origin, direction, veils) else {
                let environment = self.sources.environment(direction);
                if environment.max_element() > 0.0 {
                    let share = match seen {
                        Seen::Share(share) => share,
                        Seen::Balanced { pdf, point, normal } => {
                            power_heuristic(pdf, self.sources.pdf_of_environment(point, normal, direction))
                        }
                    };
                    radiance += throughput * environment * share;
                }
                break;
            };
            if segment == 0 {
                distance = hit.t;
            }
            if last && !self.sources.is_emitter(hit.triangle) {
                break;
            }
            let point = self.world.surface_point(&hit, direction, cone);
            if !point.front && point.material.is_transmissive() {
                throughput *= point.material.transmittance(hit.t);
            }
            let emission = point.material.emitted(point.front);
            if emission.max_element() > 0.0 {
                let share = match seen {
                    Seen::Share(share) => share,
                    Seen::Balanced { pdf, point: from, normal } => {
                        power_heuristic(pdf, self.sources.pdf_of_triangle(from, normal, hit.triangle, direction))
                    }
                };
                radiance += throughput * emission * share;
            }
            if last {
                break;
            }
            let bsdf = self.bsdf(&point, direction);
            if !bsdf.is_delta_only() {
                radiance += throughput * self.one_light_sample(&point, &bsdf, sampler, rays);
            } else {
                // The dimensions that the light sample would have drawn.
                sampler.next_3d();
            }
            let Some(next) = bsdf.sample_full(sampler.next_3d()) else { break };
            throughput *= next.value_times_cos_over_pdf;
            // A path that goes on where the eye looks through has not been scattered yet.
            from_eye &= chain < primary::MAX_CHAIN
                && emission.max_element() <= 0.0
                && match primary::link(&bsdf, self.replacement) {
                    Some(primary::Link::Transmitted { .. }) => next.transmitted,
                    Some(primary::Link::Mirrored { .. }) => true,
                    None => false,
                };
            if from_eye {
                chain += 1;
                scatterings += 1;
            }
            let roulette = sampler.next_1d();
            if segment + 1 >= ROULETTE_FROM && !from_eye {
                let survival = throughput.max_element().clamp(ROULETTE_FLOOR, 1.0);
                if roulette >= survival {
                    break;
                }
                throughput /= survival;
            }
            if throughput.max_element() <= 0.0 {
                break;
            }
            origin = point.ray_origin(next.wi);
            direction = next.wi;
            cone = point.cone.scattered(next.lobe_roughness, next.delta);
            seen = if next.delta {
                Seen::Share(1.0)
            } else {
                Seen::Balanced { pdf: next.pdf, point: point.position, normal: light_side(&bsdf) }
            };
            segment += 1;
        }
        Incoming { radiance, distance }
    }

    /// Radiance of a sampled point, where the sampler knows but a mean.
    fn look_up(&self, light: &mut LightSample) {
        if let Some(triangle) = self.sources.varying_triangle(light) {
            light.radiance = self.world.radiance_of(triangle, light.barycentrics);
        }
    }

    /// Light of one sampled source, weighted against the surface's own sampling.
    fn one_light_sample(&self, point: &SurfacePoint, bsdf: &Bsdf, sampler: &mut Sampler, rays: &mut RayCounts) -> Vec3 {
        let u = sampler.next_3d();
        let Some(mut light) = self.sources.sample(point.position, light_side(bsdf), u) else { return Vec3::ZERO };
        self.look_up(&mut light);
        let value = bsdf.eval(light.wi);
        if value.max_element() <= 0.0 || light.radiance.max_element() <= 0.0 {
            return Vec3::ZERO;
        }
        rays.shadow += 1;
        let (origin, direction, distance) = point.shadow_ray(light.wi, light.distance);
        if self.world.occluded(origin, direction, distance, self.world.veils(sampler, direction)) {
            return Vec3::ZERO;
        }
        let weight = if light.delta { 1.0 } else { power_heuristic(light.pdf, bsdf.pdf(light.wi)) };
        value * light.radiance * (bsdf.abs_cos(light.wi) * weight / light.pdf)
    }

    /// Direct light of the reflecting lobes at the primary surface: `count` shadow rays and a few rays of the lobes,
    /// all balanced against each other. `pass` counts repetitions, so that their samples stratify together.
    pub(crate) fn direct(
        &self,
        point: &SurfacePoint,
        bsdf: &Bsdf,
        count: u32,
        pass: u32,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        if count == 0 || self.sources.is_empty() || bsdf.is_delta_only() {
            return Vec3::ZERO;
        }
        let roughness = point.material.roughness;
        let glossy_share = 1.0 - lamp_share_of_glossy(roughness);
        // Few sources are as wide as an environment: only there are rays of the matte lobe worth their price.
        let matte_count = if self.sources.has_environment() { count.div_ceil(2) } else { 0 };
        let glossy_rays = glossy_share > 0.0 && roughness < GLOSSY_RAYS_MAX_ROUGHNESS && self.sources.can_be_hit();
        let glossy_count = if glossy_rays { count.div_ceil(GLOSSY_RAYS_DIVISOR) } else { 0 };
        let (n_light, n_matte, n_glossy) = (count as f32, matte_count as f32, glossy_count as f32);
        let position = point.position;
        let normal = bsdf.normal();
        let lobes = |wi: Vec3| {
            let matte = bsdf.matte(wi);
            if glossy_share > 0.0 { matte + bsdf.glossy(wi) * glossy_share } else { matte }
        };
        let lobe_density = |wi: Vec3| {
            let matte = if matte_count > 0 { n_matte * bsdf.matte_pdf(wi) } else { 0.0 };
            if glossy_count > 0 { matte + n_glossy * bsdf.glossy_pdf(wi) } else { matte }
        };

        let mut sum = Vec3::ZERO;
        let stream = sampler.fork(Domain::DirectLight as u32);
        // The choice among sources runs through 0..1 in step with the samples: each source then gets a run of
        // successive points, which is spread evenly over the source by itself.
        let choice_shift = stream.with_index(pass).next_1d();
        let places = stream.fork(0);
        let place = |i: u32| places.with_index(pass.wrapping_mul(count).wrapping_add(i)).next_2d();
        self.sources.sample_many(position, normal, count, choice_shift, place, |mut light, times| {
            self.look_up(&mut light);
            let value = if light.delta { bsdf.matte(light.wi) + bsdf.glossy(light.wi) } else { lobes(light.wi) };
            if value.max_element() <= 0.0 || light.radiance.max_element() <= 0.0 {
                return;
            }
            rays.shadow += 1;
            let (origin, direction, distance) = point.shadow_ray(light.wi, light.distance);
            if self.world.occluded(origin, direction, distance, self.world.veils(sampler, direction)) {
                return;
            }
            let density = n_light * light.pdf + if light.delta { 0.0 } else { lobe_density(light.wi) };
            sum += value * light.radiance * (times * bsdf.abs_cos(light.wi) / density);
        });

        let mut follow = |wi: Vec3| {
            let value = lobes(wi);
            if value.max_element() <= 0.0 {
                return Vec3::ZERO;
            }
            let (radiance, pdf) = self.source_along(point, normal, wi, sampler, rays);
            if radiance.max_element() <= 0.0 {
                return Vec3::ZERO;
            }
            let density = n_light * pdf + lobe_density(wi);
            if density > 0.0 { value * radiance * (bsdf.abs_cos(wi) / density) } else { Vec3::ZERO }
        };
        let stream = sampler.fork(Domain::DirectMatte as u32);
        for i in 0..matte_count {
            let u = stream.with_index(pass.wrapping_mul(matte_count).wrapping_add(i)).next_2d();
            sum += follow(bsdf.sample_matte(u));
        }
        let stream = sampler.fork(Domain::DirectGlossy as u32);
        for i in 0..glossy_count {
            let u = stream.with_index(pass.wrapping_mul(glossy_count).wrapping_add(i)).next_2d();
            if let Some(glossy) = bsdf.sample_glossy(u) {
                sum += follow(glossy.wi);
            }
        }
        sum
    }

    /// The source that is seen in a direction: its radiance and the density with which light sampling finds it.
    fn source_along(
        &self,
        from: &SurfacePoint,
        normal: Vec3,
        wi: Vec3,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> (Vec3, f32) {
        rays.closest += 1;
        match self.world.closest(from.ray_origin(wi), wi, self.world.veils(sampler, wi)) {
            None => (self.sources.environment(wi), self.sources.pdf_of_environment(from.position, normal, wi)),
            Some(hit) => {
                if !self.sources.is_emitter(hit.triangle) {
                    return (Vec3::ZERO, 0.0);
                }
                let point = self.world.surface_point(&hit, wi, Cone::FINEST);
                let emission = point.material.emitted(point.front);
                if emission.max_element() <= 0.0 {
                    return (Vec3::ZERO, 0.0);
                }
                let pdf = self.sources.pdf_of_triangle(from.position, normal, hit.triangle, wi);
                (emission, pdf)
            }
        }
    }

    /// What multiplies M: the estimators differ in the direction at which Fresnel is taken.
    pub(crate) fn matte_weight(&self, bsdf: &Bsdf) -> Vec3 {
        if self.exact { bsdf.exact_matte_weight() } else { bsdf.matte_weight() }
    }

    /// One matte path: light of a cosine-distributed direction, without the weight of the surface.
    pub(crate) fn matte_path(
        &self,
        point: &SurfacePoint,
        bsdf: &Bsdf,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Incoming {
        let mut sampler = sampler.fork(Domain::Matte as u32);
        let wi = bsdf.sample_matte(sampler.next_2d());
        if bsdf.normal().dot(wi) <= 0.0 || bsdf.geometric_normal().dot(wi) <= 0.0 {
            // Below the geometric surface. A hit distance of 0 keeps filters from reaching out.
            return Incoming { radiance: Vec3::ZERO, distance: 0.0 };
        }
        // Every source is sampled by the direct term: the first segment carries none.
        let cone = point.cone.scattered(1.0, false);
        let seen = Seen::Share(0.0);
        let mut incoming = self.incoming(point.ray_origin(wi), wi, cone, seen, self.bounces, &mut sampler, rays);
        // A metal's matte weight is 0, and so would the ratio be; M is still the light there, so that no black bleeds
        // into its neighbours.
        if self.exact && self.matte_weight(bsdf).max_element() > 0.0 {
            incoming.radiance *= bsdf.exact_matte_ratio(wi);
        }
        incoming
    }

    /// One glossy path: light of a direction of the lobe, times g |n.w| / p, without the weight of the surface.
    pub(crate) fn glossy_path(
        &self,
        point: &SurfacePoint,
        bsdf: &Bsdf,
        exact: bool,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Incoming {
        let mut sampler = sampler.fork(Domain::Glossy as u32);
        let Some(sample) = bsdf.sample_glossy(sampler.next_2d()) else {
            // Below the horizon: no light. The distance must not say so, or filters sized by it would treat dark
            // samples differently from bright ones, which is bias: it is that of the lobe's middle.
            let mirror = bsdf.mirror_direction();
            rays.closest += 1;
            let veils = self.world.veils(&sampler, mirror);
            let hit = self.world.closest(point.ray_origin(mirror), mirror, veils);
            let distance = hit.map_or(f32::INFINITY, |h| h.t);
            return Incoming { radiance: Vec3::ZERO, distance };
        };
        let seen = Seen::Share(lamp_share_of_glossy(point.material.roughness));
        let cone = point.cone.scattered(point.material.roughness, sample.delta);
        let mut incoming =
            self.incoming(point.ray_origin(sample.wi), sample.wi, cone, seen, self.bounces, &mut sampler, rays);
        incoming.radiance *= sample.weight;
        if exact {
            incoming.radiance *= bsdf.exact_glossy_ratio(sample.wi);
        }
        incoming
    }

    /// Light through a surface, traced without any split: one path with all emission.
    pub(crate) fn transmission_path(
        &self,
        point: &SurfacePoint,
        bsdf: &Bsdf,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let mut sampler = sampler.fork(Domain::Transmission as u32);
        let Some(sample) = bsdf.sample_transmission(sampler.next_2d()) else { return Vec3::ZERO };
        let cone = point.cone.scattered(point.material.roughness, sample.delta);
        let seen = Seen::Share(1.0);
        let incoming =
            self.incoming(point.ray_origin(sample.wi), sample.wi, cone, seen, self.bounces, &mut sampler, rays);
        sample.weight * incoming.radiance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_extreme_densities_are_numbers() {
        let extremes = [0.0, f32::MIN_POSITIVE, 1e-20, 1.0, 1e10, 1e20, 1e30, f32::MAX];
        for a in extremes {
            for b in extremes {
                let (w, v) = (power_heuristic(a, b), power_heuristic(b, a));
                assert!((0.0..=1.0).contains(&w) && w + v <= 1.0 + 1e-6, "{a}, {b}: {w}, {v}");
            }
        }
        assert_eq!(power_heuristic(f32::INFINITY, 1.0), 1.0);
        assert_eq!((power_heuristic(1e25, 1.0), power_heuristic(1.0, 1e25)), (1.0, 0.0));
    }
}
