//! Materials: metallic-roughness and its extensions as quell's own.

use super::error::{Fault, Place};
use super::report::Warnings;
use super::schema::{self, Root, TextureInfo};
use super::textures::Images;
use crate::material::Material;
use crate::scene::{Alpha, NormalMap, Surface, SurfaceTextures};
use glam::Vec3;

/// A number of the file, or what stands for it where it is missing or not finite.
fn finite(value: Option<f32>, default: f32) -> f32 {
    value.filter(|v| v.is_finite()).unwrap_or(default)
}

fn finite_color(value: Option<[f32; 3]>, default: Vec3) -> Vec3 {
    value.map(Vec3::from).filter(|v| v.is_finite()).unwrap_or(default)
}

/// The textures that a material's surface needs, with the fields that name them.
pub(super) fn textures(material: &schema::Material) -> impl Iterator<Item = &TextureInfo> {
    let pbr = &material.pbr_metallic_roughness;
    let extensions = &material.extensions;
    let specular = extensions.specular.as_ref();
    [
        pbr.base_color_texture.as_ref(),
        pbr.metallic_roughness_texture.as_ref(),
        material.normal_texture.as_ref(),
        material.emissive_texture.as_ref(),
        extensions.transmission.as_ref().and_then(|t| t.transmission_texture.as_ref()),
        specular.and_then(|s| s.specular_texture.as_ref()),
        specular.and_then(|s| s.specular_color_texture.as_ref()),
    ]
    .into_iter()
    .flatten()
}

/// All materials of the file, in order, and the default one behind them.
pub(super) fn read(root: &Root, images: &Images, warnings: &mut Warnings) -> Result<Vec<Surface>, Fault> {
    let list = Place::root("materials");
    let mut surfaces = Vec::with_capacity(root.materials.len() + 1);
    for (index, material) in root.materials.iter().enumerate() {
        let place = list.item(index);
        surfaces.push(Surface {
            textures: textured(root, material, images, &place, warnings)?,
            ..constant(material, &place, warnings)
        });
    }
    surfaces.push(constant(&schema::Material::default(), &list, warnings));
    Ok(surfaces)
}

/// What images paint over the surface.
fn textured(
    root: &Root,
    material: &schema::Material,
    images: &Images,
    place: &Place<'_>,
    warnings: &mut Warnings,
) -> Result<Option<Box<SurfaceTextures>>, Fault> {
    let pbr = &material.pbr_metallic_roughness;
    let extensions = &material.extensions;
    let mut look_up = |info: Option<&TextureInfo>, field: &str| match info {
        None => Ok(None),
        Some(info) => images.reference(root, info, &place.field(field), warnings),
    };
    let specular = extensions.specular.as_ref();
    let transmission = extensions.transmission.as_ref();
    let normal = look_up(material.normal_texture.as_ref(), "normalTexture")?;
    let scale = finite(material.normal_texture.as_ref().and_then(|n| n.scale), 1.0);
    let textures = SurfaceTextures {
        base_color: look_up(pbr.base_color_texture.as_ref(), "pbrMetallicRoughness.baseColorTexture")?,
        metallic_roughness: look_up(
            pbr.metallic_roughness_texture.as_ref(),
            "pbrMetallicRoughness.metallicRoughnessTexture",
        )?,
        normal: normal.map(|texture| NormalMap { texture, scale }),
        emissive: look_up(material.emissive_texture.as_ref(), "emissiveTexture")?,
        transmission: look_up(
            transmission.and_then(|t| t.transmission_texture.as_ref()),
            "extensions.KHR_materials_transmission.transmissionTexture",
        )?,
        thickness: None,
        specular: look_up(
            specular.and_then(|s| s.specular_texture.as_ref()),
            "extensions.KHR_materials_specular.specularTexture",
        )?,
        specular_color: look_up(
            specular.and_then(|s| s.specular_color_texture.as_ref()),
            "extensions.KHR_materials_specular.specularColorTexture",
        )?,
    };
    if material.occlusion_texture.is_some() {
        warnings.ignore(&place.field("occlusionTexture"), "not used: what it fakes is traced");
    }
    if extensions.volume.as_ref().is_some_and(|v| v.thickness_texture.is_some()) {
        let field = place.field("extensions.KHR_materials_volume.thicknessTexture");
        warnings.ignore(&field, "not used: rays find the far side of a body themselves");
    }
    Ok((textures != SurfaceTextures::default()).then(|| Box::new(textures)))
}

/// What does not vary over the surface.
fn constant(material: &schema::Material, place: &Place<'_>, warnings: &mut Warnings) -> Surface {
    let pbr = &material.pbr_metallic_roughness;
    let extensions = &material.extensions;
    let [r, g, b, opacity] = pbr.base_color_factor.unwrap_or([1.0; 4]);
    let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| finite(e.emissive_strength, 1.0).max(0.0));
    let mut emission = finite_color(material.emissive_factor, Vec3::ZERO).max(Vec3::ZERO) * strength;
    if !emission.is_finite() {
        warnings.push(place, "the emission is not finite: the surface does not emit");
        emission = Vec3::ZERO;
    }
    let mut out = Material {
        base_color: finite_color(Some([r, g, b]), Vec3::ONE),
        metallic: finite(pbr.metallic_factor, 1.0),
        roughness: finite(pbr.roughness_factor, 1.0),
        emission,
        two_sided_emission: material.double_sided,
        ior: ior(extensions, place, warnings),
        ..Material::default()
    };
    if let Some(transmission) = &extensions.transmission {
        out.transmission = finite(Some(transmission.transmission_factor), 0.0).clamp(0.0, 1.0);
        out.thin_walled = true;
    }
    if let Some(volume) = &extensions.volume {
        // Without thickness the surface is a thin sheet, as without the extension.
        out.thin_walled = volume.thickness_factor.is_nan() || volume.thickness_factor <= 0.0;
        out.attenuation_distance = match volume.attenuation_distance {
            Some(distance) if distance > 0.0 => distance,
            _ => f32::INFINITY,
        };
        out.attenuation_color = finite_color(volume.attenuation_color, Vec3::ONE);
    }
    if let Some(specular) = &extensions.specular {
        out.specular = finite(specular.specular_factor, 1.0);
        out.specular_color = finite_color(specular.specular_color_factor, Vec3::ONE);
    }
    let alpha = match material.alpha_mode.as_deref() {
        None | Some("OPAQUE") => Alpha::Opaque,
        Some("MASK") => Alpha::Mask { cutoff: finite(material.alpha_cutoff, 0.5) },
        Some("BLEND") => Alpha::Blend,
        Some(_) => {
            warnings.push(&place.field("alphaMode"), "is unknown: the surface is opaque");
            Alpha::Opaque
        }
    };
    Surface {
        material: out,
        alpha,
        alpha_factor: finite(Some(opacity), 1.0),
        double_sided: material.double_sided,
        unlit: extensions.unlit.is_some(),
        ..Surface::default()
    }
}

/// Index of refraction; 0 stands for a surface that reflects everything.
fn ior(extensions: &schema::MaterialExtensions, place: &Place<'_>, warnings: &mut Warnings) -> f32 {
    match extensions.ior.as_ref().map_or(1.5, |e| finite(e.ior, 1.5)) {
        ior if ior >= 1.0 || ior == 0.0 => ior,
        _ => {
            let field = place.field("extensions.KHR_materials_ior.ior");
            warnings.push(&field, "an index of refraction below 1 is not modelled: 1.5 is used");
            1.5
        }
    }
}
