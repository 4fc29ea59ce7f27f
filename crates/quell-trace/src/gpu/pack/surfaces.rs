//! Instances, what they are made of, and the attributes of their vertices.

use super::images::Images;
use crate::appearance::Coverage;
use crate::gpu::layout::{self, NONE, TextureRef, row};
use crate::material::Material;
use crate::pattern::Pattern;
use crate::scene::{Mesh, Surface};
use crate::texture::{Encoding, Filter, Wrap};
use crate::world::{Placed, World};
use glam::{Vec2, Vec3, Vec4};
use std::collections::HashMap;

/// Attributes of vertices, one after the other.
pub(super) struct Attributes(pub(super) Vec<u32>);

impl Attributes {
    /// Where the list begins; [`NONE`] where it is empty.
    fn add<const N: usize>(&mut self, list: impl ExactSizeIterator<Item = [f32; N]>) -> u32 {
        if list.len() == 0 {
            return NONE;
        }
        let first = self.0.len() as u32;
        self.0.extend(list.flatten().map(f32::to_bits));
        first
    }

    fn vec2(&mut self, list: &[Vec2]) -> u32 {
        self.add(list.iter().map(|v| v.to_array()))
    }

    fn vec3(&mut self, list: &[Vec3]) -> u32 {
        self.add(list.iter().map(|v| v.to_array()))
    }

    fn vec4(&mut self, list: &[Vec4]) -> u32 {
        self.add(list.iter().map(|v| v.to_array()))
    }
}

/// Where the attributes of a mesh at rest begin.
#[derive(Clone, Copy)]
struct AtRest {
    corners: u32,
    positions: u32,
    normals: u32,
    uvs: u32,
    uvs1: u32,
    colors: u32,
    tangents: u32,
}

impl AtRest {
    fn of(mesh: &Mesh, attributes: &mut Attributes) -> Self {
        let corners = attributes.0.len() as u32;
        attributes.0.extend(mesh.triangles.iter().flatten());
        Self {
            corners,
            positions: attributes.vec3(&mesh.positions),
            normals: attributes.vec3(&mesh.normals),
            uvs: attributes.vec2(&mesh.uvs),
            uvs1: attributes.vec2(&mesh.uvs1),
            colors: attributes.vec4(&mesh.colors),
            tangents: attributes.vec4(&mesh.tangents),
        }
    }
}

pub(super) fn instances(world: &World<'_>, attributes: &mut Attributes) -> Vec<layout::Instance> {
    let mut meshes: HashMap<usize, AtRest> = HashMap::new();
    let mut packed = Vec::with_capacity(world.placed.len().max(1));
    for (instance, placed) in world.scene.instances.iter().zip(&world.placed) {
        let mesh = &world.scene.meshes[instance.mesh];
        let rest = *meshes.entry(instance.mesh).or_insert_with(|| AtRest::of(mesh, attributes));
        let (normals, previous_positions, tangents) = match &placed.deformed {
            None => (rest.normals, rest.positions, rest.tangents),
            // Tangents at rest do not fit what is deformed.
            Some([now, before]) => (attributes.vec3(&now.1), attributes.vec3(&before.0), NONE),
        };
        let previous = &placed.previous_transform;
        let [x, y, z] = layout::columns(previous.matrix3);
        packed.push(layout::Instance {
            normal_matrix: layout::columns(placed.normal_matrix),
            world_from_mesh: layout::columns(placed.transform.matrix3),
            previous: [x, y, z, row(previous.translation.into(), 0.0)],
            surface: instance.surface as u32,
            flags: flags_of(placed),
            emission_scale: placed.emission_scale,
            cutoff: if let Coverage::Mask(cutoff) = placed.coverage { cutoff } else { 0.0 },
            corners: rest.corners,
            rest_positions: rest.positions,
            previous_positions,
            normals,
            uvs: rest.uvs,
            uvs1: rest.uvs1,
            colors: rest.colors,
            tangents,
        });
    }
    if packed.is_empty() {
        packed.push(bytemuck::Zeroable::zeroed());
    }
    packed
}

fn flags_of(placed: &Placed) -> u32 {
    let still = placed.deformed.is_none() && placed.transform == placed.previous_transform;
    let flags = [
        (placed.handedness < 0.0, layout::MIRRORED),
        (still, layout::STILL),
        (placed.painted, layout::IS_PAINTED),
        (matches!(placed.coverage, Coverage::Mask(_)), layout::MASKED),
        (placed.coverage == Coverage::Blend, layout::BLENDED),
    ];
    flags.into_iter().filter(|(there, _)| *there).map(|(_, flag)| flag).sum()
}

pub(super) fn surfaces(world: &World<'_>, images: &Images) -> Vec<layout::Surface> {
    let all = world.scene.surfaces.iter().zip(&world.materials);
    let mut packed: Vec<layout::Surface> =
        all.map(|(surface, material)| packed_surface(surface, material, images)).collect();
    if packed.is_empty() {
        packed.push(bytemuck::Zeroable::zeroed());
    }
    packed
}

fn packed_surface(surface: &Surface, material: &Material, images: &Images) -> layout::Surface {
    let textures = surface.textures.as_deref().copied().unwrap_or_default();
    let normal = textures.normal;
    // In the order of their numbers.
    let textures = [
        (textures.base_color, Encoding::Srgb),
        (textures.metallic_roughness, Encoding::Linear),
        (textures.transmission, Encoding::Linear),
        (textures.specular, Encoding::Linear),
        (textures.specular_color, Encoding::Srgb),
        (textures.emissive, Encoding::Srgb),
        (normal.map(|n| n.texture), Encoding::Linear),
    ];
    let flags = [
        (material.two_sided_emission, layout::TWO_SIDED_EMISSION),
        (material.thin_walled, layout::THIN_WALLED),
        (surface.unlit, layout::UNLIT),
    ];
    let distance = material.attenuation_distance;
    layout::Surface {
        base_color: material.base_color.to_array(),
        metallic: material.metallic,
        emission: material.emission.to_array(),
        roughness: material.roughness,
        attenuation_color: material.attenuation_color.to_array(),
        attenuation_distance: if distance > 0.0 && distance.is_finite() { distance } else { 0.0 },
        specular_color: material.specular_color.to_array(),
        specular: material.specular,
        transmission: material.transmission,
        ior: material.ior,
        alpha_factor: surface.alpha_factor,
        flags: flags.into_iter().filter(|(there, _)| *there).map(|(_, flag)| flag).sum(),
        normal_scale: normal.map_or(1.0, |n| n.scale),
        pad: [0.0; 3],
        pattern: packed_pattern(&surface.pattern),
        textures: textures.map(|(texture, encoding)| packed_texture(texture.as_ref(), encoding, images)),
    }
}

fn packed_texture(texture: Option<&crate::texture::TextureRef>, encoding: Encoding, images: &Images) -> TextureRef {
    let found = texture.and_then(|texture| Some((texture, images.levels(texture.image, encoding)?)));
    let Some((texture, levels)) = found else {
        return TextureRef { levels: NONE, ..bytemuck::Zeroable::zeroed() };
    };
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => layout::WRAP_REPEAT,
        Wrap::Mirror => layout::WRAP_MIRROR,
        Wrap::Clamp => layout::WRAP_CLAMP,
    };
    let nearest = |filter: Filter| u32::from(filter == Filter::Nearest);
    let sampler = &texture.sampler;
    let matrix = texture.transform.matrix();
    TextureRef {
        levels: levels.table,
        level_count: levels.count,
        lookup: nearest(sampler.mag)
            | nearest(sampler.min) << 1
            | wrap(sampler.wrap_s) << 2
            | wrap(sampler.wrap_t) << 4,
        uv_set: u32::from(texture.uv_set),
        matrix: [matrix.x_axis.x, matrix.x_axis.y, matrix.y_axis.x, matrix.y_axis.y],
        offset: texture.transform.offset.to_array(),
        extent: levels.extent.map(|n| n as f32),
    }
}

fn packed_pattern(pattern: &Pattern) -> layout::Pattern {
    let zero = row(Vec3::ZERO, 0.0);
    let (kind, colors, numbers) = match *pattern {
        Pattern::Plain => (layout::PLAIN, [zero; 3], Vec3::ZERO),
        Pattern::Checker { other, cells } => (layout::CHECKER, [row(other, 0.0), zero, zero], cells.extend(0.0)),
        Pattern::Tiles { joint, cells, width, variation, shift } => {
            let colors = [row(joint, width), row(Vec3::ZERO, variation), row(Vec3::ZERO, shift)];
            (layout::TILES, colors, cells.extend(0.0))
        }
        Pattern::Stripes { other, count } => (layout::STRIPES, [row(other, count), zero, zero], Vec3::ZERO),
        Pattern::Wood { dark, rings } => (layout::WOOD, [row(dark, rings), zero, zero], Vec3::ZERO),
        Pattern::Marble { vein, scale } => (layout::MARBLE, [row(vein, scale), zero, zero], Vec3::ZERO),
        Pattern::Mottled { other, scale } => (layout::MOTTLED, [row(other, scale), zero, zero], Vec3::ZERO),
        Pattern::Planks { dark, cells } => (layout::PLANKS, [row(dark, 0.0), zero, zero], cells.extend(0.0)),
        Pattern::Picture { colors, seed } => {
            (layout::PICTURE, colors.map(|c| row(c, 0.0)), Vec3::new(0.0, 0.0, seed as f32))
        }
    };
    layout::Pattern { colors, numbers: numbers.to_array(), kind }
}
