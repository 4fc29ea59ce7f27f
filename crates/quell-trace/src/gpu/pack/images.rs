//! Texels of all images and levels, one after the other, in the layers of one array texture.

use crate::scene::Scene;
use crate::texture::{Encoding, Image, linear_of_srgb};

/// Extent of a layer along both axes, in texels: 16 MiB.
pub(in crate::gpu) const HEAP_WIDTH: u32 = 2048;

/// Where the levels of an image lie.
#[derive(Clone, Copy)]
pub(super) struct Levels {
    /// Where in the attributes they are listed.
    pub(super) table: u32,
    pub(super) count: u32,
    pub(super) extent: [u32; 2],
}

pub(in crate::gpu) struct Images {
    /// By image and encoding.
    levels: Vec<[Option<Levels>; 2]>,
    /// What attributes begin with: the curve of sRGB and the levels.
    pub(super) table: Vec<u32>,
    pub(in crate::gpu) texels: Vec<[u8; 4]>,
    /// Layers of the texture; at least one.
    pub(in crate::gpu) layers: u32,
}

impl Images {
    /// The levels that the scene's textures read.
    pub(in crate::gpu) fn new(scene: &Scene) -> Self {
        let table = linear_of_srgb().map(f32::to_bits).to_vec();
        let mut images = Self { levels: vec![[None; 2]; scene.images.len()], table, texels: Vec::new(), layers: 1 };
        let mut bases = vec![None; scene.images.len()];
        for textures in scene.surfaces.iter().filter_map(|s| s.textures.as_deref()) {
            let uses = [
                (textures.base_color, Encoding::Srgb),
                (textures.emissive, Encoding::Srgb),
                (textures.specular_color, Encoding::Srgb),
                (textures.metallic_roughness, Encoding::Linear),
                (textures.transmission, Encoding::Linear),
                (textures.specular, Encoding::Linear),
                (textures.normal.map(|n| n.texture), Encoding::Linear),
            ];
            for (texture, encoding) in uses {
                let Some(number) = texture.map(|t| t.image) else { continue };
                let Some(image) = scene.images.get(number) else { continue };
                if images.levels[number][encoding as usize].is_none() {
                    let levels = images.add(image, encoding, &mut bases[number]);
                    images.levels[number][encoding as usize] = Some(levels);
                }
            }
        }
        images.layers = (images.texels.len().div_ceil((HEAP_WIDTH * HEAP_WIDTH) as usize) as u32).max(1);
        images
    }

    /// `base` is where the finest level lies, which both encodings share.
    fn add(&mut self, image: &Image, encoding: Encoding, base: &mut Option<u32>) -> Levels {
        let table = self.table.len() as u32;
        let mut count = 0;
        for (width, height, texels) in image.levels(encoding) {
            let first = match (count, *base) {
                (0, Some(first)) => first,
                _ => {
                    let first = self.texels.len() as u32;
                    self.texels.extend_from_slice(texels);
                    first
                }
            };
            if count == 0 {
                *base = Some(first);
            }
            self.table.extend([first, width as u32, height as u32]);
            count += 1;
        }
        Levels { table, count, extent: [image.width() as u32, image.height() as u32] }
    }

    pub(super) fn levels(&self, image: usize, encoding: Encoding) -> Option<Levels> {
        self.levels.get(image)?[encoding as usize]
    }
}
