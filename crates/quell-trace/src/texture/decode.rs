//! PNG, JPEG and WebP files to images, under limits that are checked before anything is decoded.

use super::Image;
use image::{DynamicImage, ImageDecoder, ImageReader};
use std::io::Cursor;

/// How large an image may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Largest width and height, texels.
    pub extent: usize,
    /// Most texels.
    pub pixels: usize,
    /// Most bytes that decoding may take, without the file.
    pub bytes: u64,
}

impl Default for Limits {
    /// 16384 a side, 2^26 texels (8192 x 8192), 1 GiB.
    fn default() -> Self {
        Self { extent: 1 << 14, pixels: 1 << 26, bytes: 1 << 30 }
    }
}

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TextureError {
    /// Neither PNG nor JPEG nor WebP by its first bytes.
    #[error("the image is neither PNG nor JPEG nor WebP; convert it to one of them")]
    Format,
    /// The file is damaged or uses what the decoder lacks.
    #[error("the image cannot be decoded ({reason}); open and save it again in an image editor")]
    Decode {
        /// What the decoder says.
        reason: String,
    },
    /// The image is larger than the limits.
    #[error(
        "the image is {width} x {height}, over the limit of {} a side, {} texels and {} MiB while decoding; scale it down",
        .limits.extent, .limits.pixels, .limits.bytes >> 20
    )]
    TooLarge {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// What is allowed.
        limits: Limits,
    },
    /// Texels and extent do not fit together.
    #[error("an image of {width} x {height} texels cannot be made of {texels}; both extents must be at least 1")]
    Extent {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Texels given.
        texels: usize,
    },
}

/// Decodes an image file. Samples of 16 bits are rounded to 8; grey becomes colour; a missing alpha is full.
///
/// # Errors
/// [`TextureError`]: another format, damage, or more than `limits` allow.
pub fn decode(bytes: &[u8], limits: Limits) -> Result<Image, TextureError> {
    let damaged = |error: image::ImageError| TextureError::Decode { reason: error.to_string() };
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| TextureError::Decode { reason: error.to_string() })?;
    let Some(image::ImageFormat::Png | image::ImageFormat::Jpeg | image::ImageFormat::WebP) = reader.format() else {
        return Err(TextureError::Format);
    };
    let mut allowed = image::Limits::default();
    allowed.max_alloc = Some(limits.bytes);
    reader.limits(allowed);
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    let too_large = || TextureError::TooLarge { width, height, limits };
    // Texels as decoded, and as kept.
    let texels = width.checked_mul(height).ok_or_else(too_large)?;
    let needed = decoder.total_bytes().saturating_add(4 * texels as u64);
    if width > limits.extent || height > limits.extent || texels > limits.pixels || needed > limits.bytes {
        return Err(too_large());
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(damaged)?.into_rgba8();
    let texels = decoded.pixels().map(|p| p.0).collect();
    Image::new(width, height, texels)
}
