//! The primary surface of a pixel: what is hit first, or what is seen through smooth glass and in mirrors.
//!
//! Primary surface replacement: where the eye ray meets smooth glass or a perfect mirror it is followed to the surface
//! behind. That surface is handed to the denoiser *unfolded*, as if the eye ray had gone on
//! straight: depth along the chain, normal mirrored back through it, motion from projecting the virtual point of this
//! frame and of the one before. In one curved mirror the image moves otherwise than in its tangent plane: `curved_mirror.rs`.

use crate::bsdf::Bsdf;
use crate::cone::Cone;
use crate::curved_mirror::{CurvedMirror, Shown};
use crate::integrator::{Integrator, RayCounts};
use crate::material::MIRROR_ROUGHNESS;
use crate::pattern::Pattern;
use crate::scene::Scene;
use crate::world::{SurfacePoint, Veils};
use glam::{Vec2, Vec3};
use quell::{Camera, Projection};

/// Interfaces that are looked through at most; the next one is the primary surface, whatever it is.
pub(crate) const MAX_CHAIN: usize = 8;

/// A surface that blends is looked through where it covers less than this share of a point. Guides then belong to what
/// shows most, and do not flicker.
pub(crate) const VEIL_OPACITY: f32 = 0.5;

/// Which surfaces the eye looks through before guides are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PrimaryReplacement {
    /// None: glass and mirrors are surfaces; what is seen through glass is traced into the direct term.
    Off,
    /// Smooth glass.
    Glass,
    /// Smooth glass and perfect mirrors: what they show is denoised as what is seen directly.
    #[default]
    GlassAndMirrors,
}

/// Patterns multiply roughness by no less.
const LEAST_PATTERN_ROUGHNESS: f32 = 0.85;

/// Whether a surface may be a perfect mirror somewhere.
pub(crate) fn may_mirror(scene: &Scene) -> bool {
    scene.surfaces.iter().any(|surface| {
        let material = &surface.material;
        let roughness = match surface.pattern {
            Pattern::Plain => material.roughness,
            _ => LEAST_PATTERN_ROUGHNESS * material.roughness,
        };
        let textures = surface.textures.as_ref();
        let varies = textures.is_some_and(|t| t.metallic_roughness.is_some());
        let is_glass = textures.is_none() && material.is_transmissive() && material.base_color.max_element() > 0.0;
        varies || (roughness < MIRROR_ROUGHNESS && !is_glass)
    })
}

/// The cameras of a frame, for one image size.
pub(crate) struct Views {
    pub(crate) camera: Camera,
    pub(crate) previous_camera: Camera,
    pub(crate) now: Projection,
    pub(crate) before: Projection,
}

/// What is known of a pixel's primary surface without noise.
#[derive(Clone, Copy)]
pub(crate) struct Guides {
    pub(crate) matte_weight: Vec3,
    pub(crate) glossy_weight: Vec3,
    pub(crate) view_depth: f32,
    pub(crate) normal: Vec3,
    pub(crate) roughness: f32,
    pub(crate) motion: Vec2,
    pub(crate) surface_id: u32,
}

/// A surface point with its scattering, and what the chain before it leaves of its light.
pub(crate) struct Vertex {
    pub(crate) point: SurfacePoint,
    pub(crate) bsdf: Bsdf,
    pub(crate) throughput: Vec3,
}

/// What the eye sees through a pixel.
pub(crate) struct Primary {
    /// The surface that guides and paths belong to; `None`: background.
    pub(crate) surface: Option<Vertex>,
    /// Glass on the way, nearest first. Its own reflections are still to be added.
    pub(crate) glass: Vec<Vertex>,
    /// Surfaces on the way that cover little of their points, nearest first; opacity is in their throughput.
    pub(crate) veils: Vec<Vertex>,
    /// Rays to what shows through surfaces that cover most of their points but not all.
    pub(crate) behind: Vec<Behind>,
    /// Background: direction in which it is seen, and what the chain leaves of it.
    pub(crate) escape: (Vec3, Vec3),
    pub(crate) guides: Guides,
}

/// A ray that goes on past a surface which is not all there.
pub(crate) struct Behind {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) cone: Cone,
    pub(crate) throughput: Vec3,
}

/// How the path goes on through a vertex of the chain.
pub(crate) enum Link {
    Transmitted { wi: Vec3, weight: Vec3 },
    Mirrored { wi: Vec3, weight: Vec3 },
}

/// Whether a surface is looked through, and how.
pub(crate) fn link(bsdf: &Bsdf, replacement: PrimaryReplacement) -> Option<Link> {
    if replacement == PrimaryReplacement::Off {
        return None;
    }
    if bsdf.is_transmissive() {
        // Only where reflection and transmission are all there is: a matte share would need a signal of its own.
        if !(bsdf.is_delta_only() && bsdf.is_transmission_delta()) {
            return None;
        }
        let sample = bsdf.sample_transmission(Vec2::ZERO)?;
        return Some(Link::Transmitted { wi: sample.wi, weight: sample.weight });
    }
    if replacement == PrimaryReplacement::GlassAndMirrors && bsdf.is_delta_only() {
        let sample = bsdf.sample_glossy(Vec2::ZERO)?;
        return Some(Link::Mirrored { wi: sample.wi, weight: bsdf.fresnel_at_mirror() * sample.weight });
    }
    None
}

/// The tangent plane of a mirror in this frame and in the one before.
struct Mirror {
    surface: SurfacePoint,
    normal: Vec3,
    previous_point: Vec3,
    previous_normal: Vec3,
}

/// A point mirrored in a plane.
fn mirrored(p: Vec3, point: Vec3, normal: Vec3) -> Vec3 {
    p - 2.0 * (p - point).dot(normal) * normal
}

impl Integrator<'_, '_> {
    /// The ray through a place of the picture: origin, direction and the cone of one pixel.
    pub(crate) fn eye_ray(&self, views: &Views, pixel: Vec2) -> (Vec3, Vec3, Cone) {
        let at =
            |p: Vec2| (views.now.ray_origin(p), views.now.ray_direction(p).normalize_or(views.now.forward().into()));
        let (origin, direction) = at(pixel);
        let mut cone = Cone { sharp: true, ..Cone::FINEST };
        if self.world.painted {
            for step in [Vec2::X, Vec2::Y] {
                let (beside, turned) = at(pixel + step);
                cone.width += 0.5 * (beside - origin).length();
                cone.spread += 0.5 * (turned - direction).length();
            }
        }
        (origin, direction, cone)
    }

    /// Follows the eye ray to the primary surface.
    pub(crate) fn primary(&self, views: &Views, pixel: Vec2, rays: &mut RayCounts) -> Primary {
        let (eye, eye_direction, mut cone) = self.eye_ray(views, pixel);
        let (mut origin, mut direction) = (eye, eye_direction);
        let mut veils: Vec<Vertex> = Vec::new();
        let mut behind: Vec<Behind> = Vec::new();
        let mut throughput = Vec3::ONE;
        let mut length = 0.0;
        let mut glass: Vec<Vertex> = Vec::new();
        let mut mirrors: Vec<Mirror> = Vec::new();
        // Stays 0 while the chain only looks straight through panes: light behind them is the same as beside them.
        let mut chain_id = 0_u32;
        loop {
            rays.closest += 1;
            let Some(hit) = self.world.closest(origin, direction, Veils::All) else {
                let motion = match (chain_id, glass.as_slice()) {
                    (0, _) => background_motion(views, direction, direction),
                    (_, []) => self.mirrored_background_motion(views, eye_direction, direction, &mirrors),
                    // A lens, whose own motion would have to be known.
                    _ => Vec2::NAN,
                };
                let guides = background(motion);
                return Primary { surface: None, glass, veils, behind, escape: (direction, throughput), guides };
            };
            length += hit.t;
            let point = self.world.surface_point(&hit, direction, cone);
            cone = point.cone;
            if !point.front && point.material.is_transmissive() {
                throughput *= point.material.transmittance(hit.t);
            }
            let bsdf = self.bsdf(&point, direction);
            let opacity = self.world.opacity(&hit);
            if opacity < VEIL_OPACITY && veils.len() < MAX_CHAIN {
                origin = point.ray_origin(direction);
                veils.push(Vertex { point, bsdf, throughput: throughput * opacity });
                throughput *= 1.0 - opacity;
                continue;
            }
            if opacity < 1.0 {
                let through = throughput * (1.0 - opacity);
                behind.push(Behind { origin: point.ray_origin(direction), direction, cone, throughput: through });
                throughput *= opacity;
            }
            let next = if glass.len() + mirrors.len() < MAX_CHAIN && !self.emits(&point) {
                link(&bsdf, self.replacement)
            } else {
                None
            };
            let Some(next) = next else {
                let replaced = !glass.is_empty() || !mirrors.is_empty();
                let guides = if replaced {
                    let virtual_point = eye + eye_direction * length;
                    let mirrors = (mirrors.as_slice(), glass.is_empty());
                    self.virtual_guides(views, virtual_point, eye_direction, &point, &bsdf, mirrors, chain_id)
                } else {
                    Guides {
                        matte_weight: self.matte_weight(&bsdf),
                        glossy_weight: bsdf.glossy_weight(),
                        view_depth: views.now.view_depth(point.position).max(f32::MIN_POSITIVE),
                        normal: bsdf.normal(),
                        roughness: point.material.roughness.clamp(0.0, 1.0),
                        motion: motion(views, point.position, self.world.previous_position(&point)),
                        surface_id: point.instance + 1,
                    }
                };
                let mut guides = guides;
                guides.matte_weight = self.matte_weight(&bsdf) * throughput;
                guides.glossy_weight = bsdf.glossy_weight() * throughput;
                if let Some(first) = glass.first() {
                    // The glossy signal is the glass's own reflection.
                    guides.glossy_weight = first.bsdf.glossy_weight() * first.throughput;
                    guides.roughness = first.point.material.roughness.clamp(0.0, 1.0);
                }
                let surface = Some(Vertex { point, bsdf, throughput });
                return Primary { surface, glass, veils, behind, escape: (direction, Vec3::ZERO), guides };
            };
            let wi = match next {
                Link::Transmitted { wi, weight } => {
                    if wi.dot(direction) < 1.0 - 1e-6 {
                        chain_id = chain_id.wrapping_mul(31).wrapping_add(point.instance + 1);
                    }
                    let next_throughput = throughput * weight;
                    origin = point.ray_origin(wi);
                    glass.push(Vertex { point, bsdf, throughput });
                    throughput = next_throughput;
                    wi
                }
                Link::Mirrored { wi, weight } => {
                    chain_id = chain_id.wrapping_mul(31).wrapping_add(point.instance + 1);
                    throughput *= weight;
                    origin = point.ray_origin(wi);
                    mirrors.push(Mirror {
                        normal: bsdf.normal(),
                        previous_point: self.world.previous_position(&point),
                        previous_normal: self.world.previous_normal(&point, bsdf.normal()),
                        surface: point,
                    });
                    wi
                }
            };
            direction = wi;
        }
    }

    fn emits(&self, point: &SurfacePoint) -> bool {
        point.material.emitted(point.front).max_element() > 0.0
    }

    /// The place on a curved mirror that showed this in the frame before. `None`: the mirror is plane, nothing moved, or it is not
    /// found.
    fn seen_in_curved(&self, views: &Views, mirror: &Mirror, moved: bool, shown: Shown) -> Option<Vec3> {
        let moved = moved
            || views.now.eye() != views.before.eye()
            || mirror.previous_point != mirror.surface.position
            || mirror.previous_normal != mirror.normal;
        if !(moved && views.now.perspective && views.before.perspective) {
            return None;
        }
        let (point, normal) = (mirror.previous_point, mirror.previous_normal);
        let (edges, bend) = self.world.previous_bend(&mirror.surface, mirror.normal)?;
        CurvedMirror { point, normal, edges, bend }.seen_at(views.before.eye().into(), shown)
    }

    /// Motion of what is infinitely far away in `direction`, seen along `eye_direction` in mirrors alone.
    fn mirrored_background_motion(
        &self,
        views: &Views,
        eye_direction: Vec3,
        direction: Vec3,
        mirrors: &[Mirror],
    ) -> Vec2 {
        if let [mirror] = mirrors
            && let Some(place) = self.seen_in_curved(views, mirror, false, Shown::Direction(direction))
        {
            return match (views.now.pixel_of_direction(eye_direction), views.before.pixel(place)) {
                (Some(now), Some(before)) => before - now,
                _ => Vec2::NAN,
            };
        }
        if !(views.now.perspective && views.before.perspective) {
            return Vec2::NAN;
        }
        // Both through the same arithmetic: what does not move moves by exactly 0.
        let (mut now, mut previous) = (direction, direction);
        for mirror in mirrors.iter().rev() {
            now -= 2.0 * now.dot(mirror.normal) * mirror.normal;
            previous -= 2.0 * previous.dot(mirror.previous_normal) * mirror.previous_normal;
        }
        background_motion(views, now, previous)
    }

    /// Guides of a surface that is seen at the end of a chain; weights are the caller's. `mirrors`: those of the chain, and whether it
    /// holds no glass.
    #[expect(clippy::too_many_arguments, reason = "called from one place")]
    fn virtual_guides(
        &self,
        views: &Views,
        virtual_point: Vec3,
        eye_direction: Vec3,
        point: &SurfacePoint,
        bsdf: &Bsdf,
        (mirrors, alone): (&[Mirror], bool),
        chain_id: u32,
    ) -> Guides {
        let mut unfolded = point.position;
        let mut previous = self.world.previous_position(point);
        let mut normal = bsdf.normal();
        let mut curved = None;
        if let ([mirror], true) = (mirrors, alone) {
            let moved = previous != point.position;
            curved = self.seen_in_curved(views, mirror, moved, Shown::Point(previous));
        }
        for mirror in mirrors.iter().rev() {
            unfolded = mirrored(unfolded, mirror.surface.position, mirror.normal);
            previous = mirrored(previous, mirror.previous_point, mirror.previous_normal);
            normal -= 2.0 * normal.dot(mirror.normal) * mirror.normal;
        }
        // Refraction bends the chain: the virtual point lies on the eye ray, beside the unfolded one.
        let previous_virtual = previous + (virtual_point - unfolded);
        let away = normal.dot(eye_direction);
        if away > -crate::bsdf::MIN_VIEW_COS {
            normal = (normal - eye_direction * (away + crate::bsdf::MIN_VIEW_COS)).normalize_or(-eye_direction);
        }
        // Ids of chains lie above those of the instances, for as many as fit.
        let surface_id = (point.instance + 1).wrapping_add(chain_id.wrapping_mul(0x9e37_79b9) & 0xffff_0000).max(1);
        Guides {
            matte_weight: Vec3::ZERO,
            glossy_weight: Vec3::ZERO,
            view_depth: views.now.view_depth(virtual_point).max(f32::MIN_POSITIVE),
            normal: normal.normalize_or(-eye_direction),
            roughness: point.material.roughness.clamp(0.0, 1.0),
            motion: motion(views, virtual_point, curved.unwrap_or(previous_virtual)),
            surface_id,
        }
    }
}

/// Pixels from where a point is seen now to where it was seen one frame before; NaN where it was behind the eye.
fn motion(views: &Views, now: Vec3, before: Vec3) -> Vec2 {
    match (views.now.pixel(now), views.before.pixel(before)) {
        // Both through the same arithmetic: what does not move moves by exactly 0.
        (Some(now), Some(before)) => before - now,
        _ => Vec2::NAN,
    }
}

/// Motion of what is infinitely far away, seen in direction `now`, and in direction `before` had the eye been where it is: only the
/// camera's rotation moves it.
fn background_motion(views: &Views, now: Vec3, before: Vec3) -> Vec2 {
    match (views.now.perspective, views.before.perspective) {
        (true, true) => match (views.now.pixel_of_direction(now), views.before.pixel_of_direction(before)) {
            (Some(now), Some(before)) => before - now,
            _ => Vec2::NAN,
        },
        // An orthographic camera sees one direction everywhere: unknown unless it did not turn.
        (false, false) if views.now.forward() == views.before.forward() => Vec2::ZERO,
        _ => Vec2::NAN,
    }
}

/// Guides where nothing is hit.
fn background(motion: Vec2) -> Guides {
    Guides {
        matte_weight: Vec3::ZERO,
        glossy_weight: Vec3::ZERO,
        view_depth: f32::INFINITY,
        normal: Vec3::ZERO,
        roughness: 1.0,
        motion,
        surface_id: 0,
    }
}
