//! A frame of a scene as bytes for the device.
//!
//! ```text
//! geometry.rs  the hierarchy and its triangles
//! surfaces.rs  instances, materials, attributes of vertices
//! images.rs    texels
//! lights.rs    the light tree, emitters, environment
//! ```

mod geometry;
pub(super) mod images;
mod lights;
mod surfaces;

use super::layout;
use super::shader::Variant;
use crate::appearance::Coverage;
use crate::environment::Background;
use crate::material::Material;
use crate::pattern::Pattern;
use crate::tracer::Tracer;
use images::Images;
use surfaces::Attributes;

/// All of a scene's buffers at one frame.
pub(super) struct Packed {
    pub(super) nodes: Vec<layout::Node>,
    pub(super) triangles: Vec<layout::Triangle>,
    pub(super) attributes: Vec<u32>,
    pub(super) instances: Vec<layout::Instance>,
    pub(super) surfaces: Vec<layout::Surface>,
    pub(super) lights: Vec<layout::Row>,
    pub(super) light_parts: layout::Lights,
    pub(super) triangle_count: u32,
    pub(super) units: [f32; 2],
    pub(super) variant: Variant,
}

impl Packed {
    /// `images` are those of the scene.
    pub(super) fn new(tracer: &Tracer<'_>, images: &Images) -> Self {
        let (world, sources) = (&tracer.world, &tracer.sources);
        let geometry = &world.geometry;
        let mut attributes = Attributes(images.table.clone());
        let instances = surfaces::instances(world, &mut attributes);
        let surfaces = surfaces::surfaces(world, images);
        let (lights, light_parts) = lights::lights(sources);
        let has_map = sources.environment.as_ref().is_some_and(|e| matches!(e.background, Background::Map(_)));
        Self {
            nodes: geometry::nodes(geometry),
            triangles: geometry::triangles(geometry, &sources.emitter_of),
            attributes: attributes.0,
            instances,
            surfaces,
            lights,
            light_parts,
            triangle_count: geometry.len() as u32,
            units: [geometry.inner_from_world, geometry.world_from_inner],
            variant: Variant {
                stack: Variant::rounded_stack(geometry::stack(geometry)),
                coverage: world.has_coverage,
                blends: world.placed.iter().any(|p| p.coverage == Coverage::Blend),
                painted: world.painted,
                patterned: world.scene.surfaces.iter().any(|s| s.pattern != Pattern::Plain),
                transmissive: world.materials.iter().any(Material::is_transmissive),
                looks_through: false,
                mirrors: crate::primary::may_mirror(world.scene),
                infinite: !sources.sampler.infinite.is_empty(),
                environment: sources.environment.is_some(),
                map: has_map,
                varying: !sources.varying.is_empty(),
            },
        }
    }
}
