//! Images on surfaces: 8 bit texels with levels of detail, looked up by texture coordinate and footprint.
//!
//! An image does not know whether it holds colours or data: each use says so ([`Encoding`]), and each kind of use has
//! its own levels, averaged in linear values. A lookup never sees texels finer than its footprint, so that one sample
//! a pixel does not alias.

mod decode;
mod level;

pub use decode::{Limits, TextureError, decode};

use glam::{Mat2, Vec2, Vec4};
#[cfg(feature = "gpu")]
pub(crate) use level::linear_of_srgb;
use level::{Level, coarser_levels};
use std::sync::OnceLock;

/// How the colour channels of a texture are stored; alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Colours by the curve of sRGB.
    Srgb,
    /// Plain numbers.
    Linear,
}

/// An image of 8 bit RGBA texels, row by row from the top.
///
/// Coarser levels are made at the first lookup that needs them, once for each [`Encoding`].
pub struct Image {
    base: Level,
    /// Levels 1 and up, of colours and of data.
    coarser: [OnceLock<Vec<Level>>; 2],
    opaque: bool,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image {{ {} x {}, opaque: {} }}", self.width(), self.height(), self.opaque)
    }
}

impl Image {
    /// An image from its texels.
    ///
    /// # Errors
    /// [`TextureError::Extent`] where an extent is 0 or there are not width * height texels.
    pub fn new(width: usize, height: usize, texels: Vec<[u8; 4]>) -> Result<Self, TextureError> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(texels.len()) {
            return Err(TextureError::Extent { width, height, texels: texels.len() });
        }
        let opaque = texels.iter().all(|t| t[3] == 255);
        Ok(Self { base: Level::new(width, height, texels), coarser: [OnceLock::new(), OnceLock::new()], opaque })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.base.width()
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.base.height()
    }

    /// Whether every texel's alpha is full.
    pub fn is_opaque(&self) -> bool {
        self.opaque
    }

    /// Bytes of all levels made so far.
    pub fn bytes(&self) -> usize {
        let coarser = self.coarser.iter().filter_map(OnceLock::get).flatten();
        self.base.bytes() + coarser.map(Level::bytes).sum::<usize>()
    }

    /// Makes the levels of one encoding now rather than at the first lookup.
    pub fn prepare(&self, encoding: Encoding) {
        self.coarser(encoding);
    }

    fn coarser(&self, encoding: Encoding) -> &[Level] {
        self.coarser[encoding as usize].get_or_init(|| coarser_levels(&self.base, encoding))
    }

    /// All levels for an encoding, finest first: columns, rows, texels.
    #[cfg(feature = "gpu")]
    pub(crate) fn levels(&self, encoding: Encoding) -> impl Iterator<Item = (usize, usize, &[[u8; 4]])> {
        let all = std::iter::once(&self.base).chain(self.coarser(encoding));
        all.map(|level| (level.width(), level.height(), level.texels()))
    }

    /// The linear value at `uv`, averaged over a square of about 2^`lod` texels a side; 0 and less: between the four
    /// nearest texels (or the nearest one, by the sampler's magnification filter). Values that are not finite count
    /// as 0.
    pub fn sample(&self, uv: Vec2, lod: f32, sampler: &Sampler, encoding: Encoding) -> Vec4 {
        let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
        if lod.is_nan() || lod <= 0.0 {
            return self.base.filtered(uv, sampler, sampler.mag, encoding);
        }
        let coarser = self.coarser(encoding);
        let lod = lod.min(coarser.len() as f32);
        let floor = lod.floor();
        let level = |index: usize| match index.checked_sub(1).and_then(|i| coarser.get(i)) {
            Some(level) => level.filtered(uv, sampler, sampler.min, encoding),
            None => self.base.filtered(uv, sampler, sampler.min, encoding),
        };
        let fine = level(floor as usize);
        let share = lod - floor;
        if share > 0.0 { fine.lerp(level(floor as usize + 1), share) } else { fine }
    }

    /// Whether all colours between two corners of texture coordinates are 0, as far as a bounded search finds: of
    /// very large regions it says no.
    pub(crate) fn is_black(&self, min: Vec2, max: Vec2) -> bool {
        /// Texels that are looked at, at most.
        const SEARCH: usize = 1 << 16;
        let range = |low: f32, high: f32, extent: usize| -> Option<(i64, i64)> {
            // One texel more on each side: what a blend of four reaches.
            let (low, high) = ((low * extent as f32).floor() - 1.0, (high * extent as f32).ceil() + 1.0);
            if !(low.abs() < 1e9 && high.abs() < 1e9) {
                return None;
            }
            Some(if low < 0.0 || high > extent as f32 { (0, extent as i64) } else { (low as i64, high as i64) })
        };
        let (Some(x), Some(y)) = (range(min.x, max.x, self.width()), range(min.y, max.y, self.height())) else {
            return false;
        };
        if ((x.1 - x.0) * (y.1 - y.0)) as usize > SEARCH {
            return false;
        }
        (y.0..y.1).all(|y| (x.0..x.1).all(|x| self.base.is_black(x as usize, y as usize)))
    }

    /// Alpha at `uv` of the finest level: what decides whether a ray meets a surface.
    pub fn alpha(&self, uv: Vec2, sampler: &Sampler) -> f32 {
        if self.opaque {
            return 1.0;
        }
        self.base.alpha(if uv.is_finite() { uv } else { Vec2::ZERO }, sampler)
    }
}

/// What lies beyond the edges of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// Its mirror image and the image by turns.
    Mirror,
    /// Its outermost texels.
    Clamp,
}

/// What is taken between texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// A blend of the four nearest.
    #[default]
    Linear,
}

/// How an image is looked up. Whatever the file says of levels, coarse footprints read coarse levels and blend between
/// two of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampler {
    /// Along u.
    pub wrap_s: Wrap,
    /// Along v.
    pub wrap_t: Wrap,
    /// Where texels are larger than the footprint.
    pub mag: Filter,
    /// Within a level where they are smaller.
    pub min: Filter,
}

/// Moves texture coordinates: first scaled, then turned, then moved (`KHR_texture_transform`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Added.
    pub offset: Vec2,
    /// Radians, counter-clockwise as seen in the picture, whose v runs down.
    pub rotation: f32,
    /// Multiplies.
    pub scale: Vec2,
}

impl Default for Transform {
    fn default() -> Self {
        Self { offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE }
    }
}

impl Transform {
    /// The linear part.
    pub(crate) fn matrix(&self) -> Mat2 {
        let (s, c) = self.rotation.sin_cos();
        Mat2::from_cols(Vec2::new(c, -s) * self.scale.x, Vec2::new(s, c) * self.scale.y)
    }

    /// The coordinate at which the image is looked up.
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        self.matrix() * uv + self.offset
    }
}

/// One use of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`crate::Scene::images`].
    pub image: usize,
    /// How it is looked up.
    pub sampler: Sampler,
    /// Which texture coordinates: 0 for [`crate::Mesh::uvs`], 1 for [`crate::Mesh::uvs1`].
    pub uv_set: u8,
    /// What is done to them.
    pub transform: Transform,
}

impl TextureRef {
    /// An image as it is, over texture coordinates 0.
    pub fn new(image: usize) -> Self {
        Self { image, sampler: Sampler::default(), uv_set: 0, transform: Transform::default() }
    }
}

#[cfg(test)]
mod tests;
