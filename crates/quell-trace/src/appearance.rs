//! What textures and vertex colours make of a surface at a point.

use crate::cone::{Cone, Footprint};
use crate::material::Material;
use crate::scene::{Alpha, Mesh, NormalMap, Scene, Surface};
use crate::texture::{Encoding, TextureRef};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

/// Least cosine between the mirror direction of a mapped normal and the true normal, and the share of the viewer's own
/// cosine where that is less: what lies lower would be lost behind the surface.
pub(crate) const MIRROR_COS: (f32, f32) = (0.01, 0.9);

/// A point of a triangle and the attributes of its corners.
#[derive(Clone, Copy)]
pub(crate) struct Spot<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) surface: &'s Surface,
    pub(crate) mesh: &'s Mesh,
    pub(crate) corners: [u32; 3],
    /// Weights of corners 1 and 2.
    pub(crate) weights: Vec2,
}

/// Linear values at weights.
fn between<T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>>(v: [T; 3], weights: Vec2) -> T {
    v[0] * (1.0 - weights.x - weights.y) + v[1] * weights.x + v[2] * weights.y
}

impl Spot<'_> {
    /// Transformed texture coordinates of the corners.
    fn coordinates(&self, texture: &TextureRef) -> [Vec2; 3] {
        let all = if texture.uv_set == 0 { &self.mesh.uvs } else { &self.mesh.uvs1 };
        self.corners.map(|i| texture.transform.apply(all.get(i as usize).copied().unwrap_or(Vec2::ZERO)))
    }

    /// The texture's value, averaged over the footprint; `None`: at the finest level.
    fn value(&self, texture: &TextureRef, footprint: Option<&Footprint>, encoding: Encoding) -> Vec4 {
        let Some(image) = self.scene.images.get(texture.image) else { return Vec4::ONE };
        let uv = self.coordinates(texture);
        let Some(footprint) = footprint else {
            return image.sample(between(uv, self.weights), 0.0, &texture.sampler, encoding);
        };
        let texels = Vec2::new(image.width() as f32, image.height() as f32);
        let (lod, count, step) = footprint.lookups([(uv[1] - uv[0]) * texels, (uv[2] - uv[0]) * texels]);
        let middle = 0.5 * (count as f32 - 1.0);
        let mut sum = Vec4::ZERO;
        for i in 0..count {
            let weights = self.weights + step * (i as f32 - middle);
            sum += image.sample(between(uv, weights), lod, &texture.sampler, encoding);
        }
        sum / count as f32
    }

    fn vertex_color(&self) -> Vec4 {
        if self.mesh.colors.is_empty() {
            return Vec4::ONE;
        }
        between(self.corners.map(|i| self.mesh.colors.get(i as usize).copied().unwrap_or(Vec4::ONE)), self.weights)
    }

    /// Opacity, 0..1, at the finest level: holes are as sharp as the image says from any distance.
    pub(crate) fn opacity(&self) -> f32 {
        let mut opacity = self.surface.alpha_factor;
        if !self.mesh.colors.is_empty() {
            opacity *= self.vertex_color().w;
        }
        if let Some(texture) = self.surface.textures.as_ref().and_then(|t| t.base_color)
            && let Some(image) = self.scene.images.get(texture.image)
        {
            opacity *= image.alpha(between(self.coordinates(&texture), self.weights), &texture.sampler);
        }
        crate::material::unit_range(opacity)
    }

    /// The image whose colours the surface shines with.
    fn shining(&self) -> Option<&TextureRef> {
        let textures = self.surface.textures.as_ref()?;
        if self.surface.unlit { textures.base_color.as_ref() } else { textures.emissive.as_ref() }
    }

    /// What emission is multiplied by here.
    pub(crate) fn emission(&self, footprint: Option<&Footprint>) -> Vec3 {
        let image = self.shining().map_or(Vec3::ONE, |t| self.value(t, footprint, Encoding::Srgb).xyz());
        if self.surface.unlit { image * self.vertex_color().xyz() } else { image }
    }

    /// Whether emission differs from point to point.
    pub(crate) fn emission_varies(&self) -> bool {
        self.shining().is_some() || (self.surface.unlit && !self.mesh.colors.is_empty())
    }

    /// About the mean of [`Self::emission`] over the whole triangle: what light sampling goes by. 0 only where nothing
    /// shines, so that no light is left out.
    pub(crate) fn mean_emission(&self) -> Vec3 {
        /// The triangle is cut into this many times as many alike.
        const PARTS: usize = 4;
        /// Share of full brightness that is assumed at least.
        const FLOOR: f32 = 1e-3;
        let image = self.shining().and_then(|t| Some((t, self.scene.images.get(t.image)?)));
        let mut level = f32::NEG_INFINITY;
        if let Some((texture, image)) = image {
            let uv = self.coordinates(texture);
            if image.is_black(uv[0].min(uv[1]).min(uv[2]), uv[0].max(uv[1]).max(uv[2])) {
                return Vec3::ZERO;
            }
            let texels = Vec2::new(image.width() as f32, image.height() as f32);
            let area = ((uv[1] - uv[0]) * texels).perp_dot((uv[2] - uv[0]) * texels).abs() * 0.5;
            level = 0.5 * (area / (PARTS * PARTS) as f32).log2();
        }
        let mut sum = Vec3::ZERO;
        for row in 0..PARTS {
            for column in 0..2 * (PARTS - row) - 1 {
                // Centroids of the parts that point up and of those that point down.
                let shift = if column % 2 == 0 { 1.0 / 3.0 } else { 2.0 / 3.0 };
                let weights = Vec2::new((column / 2) as f32 + shift, row as f32 + shift) / PARTS as f32;
                let spot = Self { weights, ..*self };
                let color = match image {
                    Some((texture, image)) => {
                        let uv = between(spot.coordinates(texture), weights);
                        image.sample(uv, level, &texture.sampler, Encoding::Srgb).xyz()
                    }
                    None => Vec3::ONE,
                };
                let color = if self.surface.unlit { color * spot.vertex_color().xyz() } else { color };
                sum += color * if self.surface.alpha == Alpha::Opaque { 1.0 } else { spot.opacity() };
            }
        }
        (sum / (PARTS * PARTS) as f32).max(Vec3::splat(FLOOR))
    }

    /// Multiplies textures and vertex colours into a material that holds their factors.
    pub(crate) fn paint(&self, material: &mut Material, footprint: &Footprint, cone: Cone) {
        if material.is_emissive() && self.emission_varies() {
            material.emission *= self.emission(cone.sharp.then_some(footprint));
        }
        if self.surface.unlit {
            return;
        }
        material.base_color *= self.vertex_color().xyz();
        let Some(textures) = &self.surface.textures else { return };
        let value = |texture: &TextureRef, encoding| self.value(texture, Some(footprint), encoding);
        if let Some(texture) = &textures.base_color {
            material.base_color *= value(texture, Encoding::Srgb).xyz();
        }
        if let Some(texture) = &textures.metallic_roughness {
            let v = value(texture, Encoding::Linear);
            material.roughness *= v.y;
            material.metallic *= v.z;
        }
        if let Some(texture) = &textures.transmission {
            material.transmission *= value(texture, Encoding::Linear).x;
        }
        if let Some(texture) = &textures.specular {
            material.specular *= value(texture, Encoding::Linear).w;
        }
        if let Some(texture) = &textures.specular_color {
            material.specular_color *= value(texture, Encoding::Srgb).xyz();
        }
    }

    /// The mapped normal of a point, on the side of `frame.normal`.
    pub(crate) fn mapped_normal(&self, map: &NormalMap, footprint: &Footprint, frame: &Frame) -> Vec3 {
        let n = frame.normal;
        let Some((tangent, bitangent)) = self.tangents(map, frame) else { return n };
        let v = self.value(&map.texture, Some(footprint), Encoding::Linear).xyz() * 2.0 - Vec3::ONE;
        let slope = v.truncate() * map.scale;
        (tangent * slope.x + bitangent * slope.y + n * v.z.max(1e-3)).try_normalize().unwrap_or(n)
    }

    /// Unit directions of u and of up in the picture, orthogonal to the normal.
    fn tangents(&self, map: &NormalMap, frame: &Frame) -> Option<(Vec3, Vec3)> {
        let n = frame.normal;
        let orthogonal = |v: Vec3| (v - n * n.dot(v)).try_normalize();
        if !self.mesh.tangents.is_empty() && !frame.deformed {
            let given = self.corners.map(|i| self.mesh.tangents.get(i as usize).copied().unwrap_or(Vec4::ZERO));
            let tangent = orthogonal(frame.world_from_mesh * between(given.map(|t| t.xyz()), self.weights))?;
            let sign = if given[0].w < 0.0 { -1.0 } else { 1.0 } * frame.handedness;
            return Some((tangent, n.cross(tangent) * sign));
        }
        let uv = self.coordinates(&map.texture);
        let ([a, b, c], d1, d2) = (frame.corners, uv[1] - uv[0], uv[2] - uv[0]);
        let determinant = d1.perp_dot(d2);
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        // Only directions matter: the determinant's sign is all that is needed of it.
        let side = determinant.signum();
        let along_u = ((b - a) * d2.y - (c - a) * d1.y) * side;
        let along_v = ((c - a) * d1.x - (b - a) * d2.x) * side;
        let tangent = orthogonal(along_u)?;
        let bitangent = n.cross(tangent);
        // v runs down the picture.
        Some((tangent, if bitangent.dot(along_v) > 0.0 { -bitangent } else { bitangent }))
    }
}

/// The surface about a point, in world space.
pub(crate) struct Frame {
    pub(crate) corners: [Vec3; 3],
    /// Interpolated normal, unit.
    pub(crate) normal: Vec3,
    pub(crate) world_from_mesh: glam::Mat3,
    /// -1 where the transform mirrors.
    pub(crate) handedness: f32,
    /// Tangents at rest do not fit.
    pub(crate) deformed: bool,
}

/// A mapped normal turned back towards the true one until its mirror direction leaves the surface, as seen from `wo`; all on one side, unit.
/// Without it mapped bumps have black spots at grazing views and reflections from behind the surface.
pub(crate) fn usable_normal(mapped: Vec3, geometric: Vec3, wo: Vec3) -> Vec3 {
    let Some(aside) = (mapped - geometric * geometric.dot(mapped)).try_normalize() else { return geometric };
    // In the plane of both normals, at the angle x from the true one, the mirror direction's cosine is
    // a sin 2x + c cos 2x = r cos(2x - p).
    let (a, c) = (wo.dot(aside), wo.dot(geometric).max(0.0));
    let (r, p) = (a.hypot(c), a.atan2(c));
    if r <= 0.0 {
        return geometric;
    }
    let least = (MIRROR_COS.1 * c).min(MIRROR_COS.0);
    let largest = 0.5 * (p + (least / r).clamp(-1.0, 1.0).acos());
    if mapped.dot(aside).atan2(mapped.dot(geometric)) <= largest {
        return mapped;
    }
    (geometric * largest.cos() + aside * largest.sin()).try_normalize().unwrap_or(geometric)
}

/// Whether a ray meets a surface, before its image is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Coverage {
    /// Always.
    Full,
    /// Where opacity is at least this.
    Mask(f32),
    /// With opacity as probability.
    Blend,
}

/// What a surface on a mesh needs of each ray.
pub(crate) fn coverage(scene: &Scene, surface: &Surface, mesh: &Mesh) -> Coverage {
    let image = surface.textures.as_ref().and_then(|t| t.base_color).and_then(|t| scene.images.get(t.image));
    let even = image.is_none_or(|i| i.is_opaque()) && mesh.colors.iter().all(|c| c.w >= 1.0);
    match surface.alpha {
        Alpha::Mask { cutoff } if !(even && surface.alpha_factor >= cutoff) => Coverage::Mask(cutoff),
        Alpha::Blend if !(even && surface.alpha_factor >= 1.0) => Coverage::Blend,
        _ => Coverage::Full,
    }
}

/// The material that a surface has before textures: factors as they are, emission by its rules.
pub(crate) fn plain_material(surface: &Surface) -> Material {
    let mut material = surface.material;
    material.two_sided_emission |= surface.double_sided;
    if surface.unlit {
        return Material {
            base_color: Vec3::ZERO,
            emission: material.base_color,
            two_sided_emission: true,
            specular: 0.0,
            ..Material::default()
        };
    }
    material
}

/// Makes the levels of detail that will be read, on all of rayon's current threads.
pub(crate) fn prepare_images(scene: &Scene) {
    let mut uses = vec![[false; 2]; scene.images.len()];
    for textures in scene.surfaces.iter().filter_map(|s| s.textures.as_ref()) {
        for texture in textures.all() {
            let color = [&textures.base_color, &textures.emissive, &textures.specular_color];
            let encoding =
                if color.into_iter().flatten().any(|t| t == texture) { Encoding::Srgb } else { Encoding::Linear };
            if let Some(used) = uses.get_mut(texture.image) {
                used[encoding as usize] = true;
            }
        }
    }
    scene.images.par_iter().zip(uses).for_each(|(image, used)| {
        for encoding in [Encoding::Srgb, Encoding::Linear] {
            if used[encoding as usize] {
                image.prepare(encoding);
            }
        }
    });
}
