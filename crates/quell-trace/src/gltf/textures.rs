//! Images of the materials that are shown: found, decoded in parallel, and how each is looked up.

use super::buffers::{Buffers, Folder};
use super::error::{Fault, Place, item};
use super::report::Warnings;
use super::schema::{self, Root, TextureInfo};
use super::{Budget, Counter, Stage, Watcher};
use crate::texture::{self, Filter, Image, Sampler, TextureRef, Transform, Wrap};
use glam::Vec2;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

/// The images that could be decoded.
pub(super) struct Images {
    pub(super) list: Vec<Arc<Image>>,
    /// Place in `list` of an image of the file.
    index: HashMap<usize, usize>,
    /// Hash of what came from files beside the scene.
    pub(super) external: Vec<u64>,
}

/// The image that a texture shows: its WebP one where it has one.
fn source(texture: &schema::Texture) -> Option<usize> {
    texture.extensions.webp.as_ref().and_then(|w| w.source).or(texture.source)
}

impl Images {
    /// Decodes what the textures show. What does not decode is left out with a warning.
    pub(super) fn read(
        root: &Root,
        buffers: &Buffers<'_>,
        folder: &Folder<'_>,
        budget: &Budget,
        textures: &BTreeSet<usize>,
        watcher: Watcher<'_>,
        warnings: &mut Warnings,
    ) -> Result<Self, Fault> {
        let mut wanted = BTreeSet::new();
        let list = Place::root("textures");
        for &texture in textures {
            let place = list.item(texture);
            let Some(image) = source(item(&root.textures, texture, "texture", &list)?) else {
                warnings.push(&place, "shows no image that quell reads: the texture is left out");
                continue;
            };
            item(&root.images, image, "image", &place.field("source"))?;
            wanted.insert(image);
        }
        let list = Place::root("images");
        let counter = Counter::new(watcher, Stage::Images, wanted.len());
        let decode = |&index: &usize| -> Result<(Result<Image, String>, Option<u64>), Fault> {
            let place = list.item(index);
            let image = item(&root.images, index, "image", &list)?;
            let bytes = match buffers.image(root, image, folder, &place) {
                Ok(bytes) => bytes,
                // A missing picture is no reason to show nothing; one outside the folder is refused like all else.
                Err(fault) if image.buffer_view.is_none() => return Ok((Err(fault.problem.to_string()), None)),
                Err(fault) => return Err(fault),
            };
            let external = matches!(bytes, std::borrow::Cow::Owned(_)).then(|| {
                let mut hash = crate::hash::Hash::new();
                hash.bytes(&bytes);
                hash.finish()
            });
            let decoded = texture::decode(&bytes, texture::Limits::default()).map_err(|e| e.to_string());
            counter.one_more();
            if let Ok(image) = &decoded {
                // Levels of detail for colours and for data are a third each.
                budget.charge(image.bytes() as u64 / 3 * 5, &place)?;
            }
            Ok((decoded, external))
        };
        let wanted: Vec<usize> = wanted.into_iter().collect();
        let decoded: Vec<_> = wanted.par_iter().map(decode).collect::<Result<_, Fault>>()?;
        let mut images = Self { list: Vec::new(), index: HashMap::new(), external: Vec::new() };
        for (&index, (decoded, external)) in wanted.iter().zip(decoded) {
            images.external.extend(external);
            match decoded {
                Ok(image) => {
                    images.index.insert(index, images.list.len());
                    images.list.push(Arc::new(image));
                }
                Err(reason) => {
                    warnings.push(&list.item(index), format!("{reason}; until then its textures are left out"));
                }
            }
        }
        Ok(images)
    }

    /// How a texture is looked up; `None` where it is left out.
    pub(super) fn reference(
        &self,
        root: &Root,
        info: &TextureInfo,
        place: &Place<'_>,
        warnings: &mut Warnings,
    ) -> Result<Option<TextureRef>, Fault> {
        let texture = item(&root.textures, info.index, "texture", &place.field("index"))?;
        let Some(&image) = source(texture).and_then(|image| self.index.get(&image)) else { return Ok(None) };
        let transform = info.extensions.transform.as_ref();
        let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        let Some(uv_set) = u8::try_from(set).ok().filter(|set| *set < 2) else {
            warnings
                .push(place, format!("uses texture coordinates {set}; quell reads 0 and 1: the texture is left out"));
            return Ok(None);
        };
        let sampler = match texture.sampler {
            None => Sampler::default(),
            Some(index) => {
                let textures = Place::root("textures");
                let at = textures.item(info.index);
                sampler(item(&root.samplers, index, "sampler", &at.field("sampler"))?)
            }
        };
        let transform = transform.map_or_else(Transform::default, |t| Transform {
            offset: Vec2::from(t.offset.unwrap_or([0.0; 2])),
            rotation: t.rotation.unwrap_or(0.0),
            scale: Vec2::from(t.scale.unwrap_or([1.0; 2])),
        });
        if !(transform.offset.is_finite() && transform.rotation.is_finite() && transform.scale.is_finite()) {
            warnings.push(place, "KHR_texture_transform is not finite: the texture is left out");
            return Ok(None);
        }
        Ok(Some(TextureRef { image, sampler, uv_set, transform }))
    }
}

/// Numbers of OpenGL; unknown ones are the defaults.
fn sampler(sampler: &schema::Sampler) -> Sampler {
    let wrap = |number: Option<u64>| match number {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    let min = match sampler.min_filter {
        Some(9728 | 9984 | 9986) => Filter::Nearest,
        _ => Filter::Linear,
    };
    let mag = if sampler.mag_filter == Some(9728) { Filter::Nearest } else { Filter::Linear };
    Sampler { wrap_s: wrap(sampler.wrap_s), wrap_t: wrap(sampler.wrap_t), mag, min }
}
