//! The one tone curve of every picture that is looked at or scored as a picture, and PNG.
//!
//! Scene-linear light times the exposure; a shoulder that is the identity up to 0.3 and approaches 1, applied to the
//! largest component so that hue is kept, and fading to white above; then the sRGB transfer function. The shoulder has
//! the form of the Khronos PBR Neutral tone mapper (Khronos Group, 2024), but begins earlier and fades sooner (there
//! 0.76 and 0.15, made for products in even light; in a room, what stands beside a lamp is ten times brighter than
//! the rest). Its first step, which bends blacks, is left out: noise in dark regions must stay visible.

use crate::error::Error;
use quell::{Plane, Rgb, Size};

/// Where the shoulder begins.
const SHOULDER_START: f32 = 0.3;
/// How soon light beyond the shoulder turns white; higher: sooner.
const DESATURATION: f32 = 0.4;
/// Mid grey: what the log-mean luminance of lit surfaces becomes at the automatic exposure.
const MID_GREY: f64 = 0.18;
/// Lit surface pixels: luminance above this part of the mean (evaluation.md, section 3).
pub(crate) const LIT_PART_OF_MEAN: f64 = 1e-3;

pub use quell::luminance;

/// The report's tone curve at a fixed exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Multiplies scene-linear light; > 0. Higher: brighter.
    pub exposure: f32,
}

impl Default for Tone {
    fn default() -> Self {
        Self { exposure: 1.0 }
    }
}

impl Tone {
    /// The exposure that brings the log-mean luminance of the lit pixels of a sequence to mid grey (0.18). Give it
    /// references where there are any: it shall not depend on noise. 1 where nothing is lit.
    pub fn automatic<'a>(frames: impl IntoIterator<Item = &'a Plane<Rgb>>) -> Self {
        let mut luminances: Vec<f64> = Vec::new();
        for frame in frames {
            luminances.extend(frame.data().iter().map(|&c| f64::from(luminance(c))).filter(|l| l.is_finite()));
        }
        let mean = luminances.iter().sum::<f64>() / luminances.len().max(1) as f64;
        let lit: Vec<f64> = luminances.into_iter().filter(|&l| l > LIT_PART_OF_MEAN * mean && l > 0.0).collect();
        if lit.is_empty() {
            return Self::default();
        }
        let log_mean = (lit.iter().map(|l| l.ln()).sum::<f64>() / lit.len() as f64).exp();
        Self { exposure: (MID_GREY / log_mean) as f32 }
    }

    /// Display-linear 0..1 from scene-linear light. Negative components and NaN count as 0.
    pub fn display_linear(self, c: Rgb) -> Rgb {
        let c = c.map(|v| (v * self.exposure).max(0.0));
        let peak = c[0].max(c[1]).max(c[2]);
        if peak < SHOULDER_START {
            return c;
        }
        if peak.is_infinite() {
            return [1.0; 3];
        }
        let room = 1.0 - SHOULDER_START;
        let new_peak = 1.0 - room * room / (peak + room - SHOULDER_START);
        let white = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
        c.map(|v| {
            let scaled = v * (new_peak / peak);
            (scaled + (new_peak - scaled) * white).min(1.0)
        })
    }

    /// sRGB-encoded 0..1 from scene-linear light.
    pub fn srgb(self, c: Rgb) -> Rgb {
        self.display_linear(c).map(srgb_from_linear)
    }

    /// The picture as it is shown, 8 bits a component, rounded to nearest.
    pub fn picture(self, plane: &Plane<Rgb>) -> Picture {
        let mut rgb = Vec::with_capacity(plane.size().pixels() * 3);
        for &c in plane.data() {
            rgb.extend(self.srgb(c).map(|v| (v * 255.0 + 0.5) as u8));
        }
        Picture { size: plane.size(), rgb }
    }
}

/// The sRGB transfer function (IEC 61966-2-1), 0..1 to 0..1.
pub fn srgb_from_linear(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// A picture for the screen: sRGB, 8 bits, row-major, three bytes a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Extent in pixels.
    pub size: Size,
    /// `3 * size.pixels()` bytes.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// A part of the picture; cut off at its edges.
    pub fn crop(&self, x: usize, y: usize, size: Size) -> Self {
        let x1 = (x + size.width).min(self.size.width);
        let y1 = (y + size.height).min(self.size.height);
        let (x, y) = (x.min(x1), y.min(y1));
        let mut rgb = Vec::with_capacity(3 * (x1 - x) * (y1 - y));
        for row in y..y1 {
            let range = 3 * (row * self.size.width + x)..3 * (row * self.size.width + x1);
            // Bytes that do not fit the extent are found out when the part is encoded.
            rgb.extend_from_slice(self.rgb.get(range).unwrap_or(&[]));
        }
        Self { size: Size::new(x1 - x, y1 - y), rgb }
    }

    /// Whether the bytes fit the extent.
    ///
    /// # Errors
    /// [`Error::Encode`] where they do not.
    pub fn check(&self) -> Result<(), Error> {
        if self.rgb.len() == 3 * self.size.pixels() {
            return Ok(());
        }
        Err(Error::Encode { size: self.size, reason: format!("{} bytes do not fit", self.rgb.len()) })
    }

    /// As a PNG file.
    ///
    /// # Errors
    /// [`Error::Encode`] where the extent is empty or does not fit the bytes.
    pub fn png(&self) -> Result<Vec<u8>, Error> {
        png_bytes(&self.rgb, self.size, image::ExtendedColorType::Rgb8)
    }

    /// Writes a PNG file, whole or not at all; missing folders are made.
    ///
    /// # Errors
    /// As [`Picture::png`], and I/O errors that name the file.
    pub fn write_png(&self, path: &std::path::Path) -> Result<(), Error> {
        Ok(quell_frames::files::write_bytes(path, &self.png()?)?)
    }
}

/// A grey picture 0..1 (clamped), 8 bits, as a PNG file.
///
/// # Errors
/// [`Error::Encode`] where the extent is empty.
pub fn grey_png(plane: &Plane<f32>) -> Result<Vec<u8>, Error> {
    let bytes: Vec<u8> = plane.data().iter().map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
    png_bytes(&bytes, plane.size(), image::ExtendedColorType::L8)
}

fn png_bytes(bytes: &[u8], size: Size, colour: image::ExtendedColorType) -> Result<Vec<u8>, Error> {
    use image::ImageEncoder;
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let wrong = |reason: String| Error::Encode { size, reason };
    let (Ok(width), Ok(height)) = (u32::try_from(size.width), u32::try_from(size.height)) else {
        return Err(wrong("an extent is beyond 32 bits".to_owned()));
    };
    let channels = if colour == image::ExtendedColorType::L8 { 1 } else { 3 };
    if size.pixels() == 0 || bytes.len() != size.pixels() * channels {
        return Err(wrong(format!("{} bytes do not fit", bytes.len())));
    }
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::Adaptive)
        .write_image(bytes, width, height, colour)
        .map_err(|e| wrong(e.to_string()))?;
    Ok(png)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_the_identity_then_rises_to_white() {
        let tone = Tone::default();
        assert_eq!(tone.display_linear([0.1, 0.2, 0.29]), [0.1, 0.2, 0.29]);
        let mut last = 0.0;
        for i in 0..4000 {
            let v = tone.display_linear([i as f32 * 0.01; 3])[0];
            assert!(v >= last && v <= 1.0, "{v} after {last}");
            last = v;
        }
        assert!(last > 0.98);
        // Hue stays near the shoulder, very bright light turns white.
        let near = tone.display_linear([0.5, 0.25, 0.125]);
        assert!((near[0] / near[1] - 2.0).abs() < 0.1, "{near:?}");
        let far = tone.display_linear([400.0, 200.0, 100.0]);
        assert!(far[2] > 0.9, "{far:?}");
        assert_eq!(tone.display_linear([f32::INFINITY; 3]), [1.0; 3]);
        assert_eq!(tone.display_linear([f32::NAN, -1.0, 0.0]), [0.0; 3]);
    }

    #[test]
    fn the_automatic_exposure_brings_light_to_mid_grey_and_ignores_black() {
        let size = Size::new(10, 10);
        let plane = Plane::from_fn(size, |x, _| if x < 5 { [0.0; 3] } else { [4.0; 3] });
        assert!((Tone::automatic([&plane]).exposure * 4.0 - 0.18).abs() < 1e-5);
        assert_eq!(Tone::automatic([&Plane::filled(size, [0.0; 3])]), Tone::default());
    }

    #[test]
    fn a_png_reads_back() {
        let size = Size::new(5, 3);
        let picture = Tone::default().picture(&Plane::from_fn(size, |x, y| [x as f32 / 5.0, y as f32 / 3.0, 0.5]));
        let back = image::load_from_memory(&picture.png().unwrap()).unwrap().into_rgb8();
        assert_eq!(back.into_raw(), picture.rgb);
        let crop = picture.crop(3, 1, size);
        assert_eq!(crop.size, Size::new(2, 2));
        assert_eq!(crop.rgb[..6], picture.rgb[3 * (5 + 3)..3 * (5 + 5)]);
        assert!(matches!(picture.crop(9, 9, size).png(), Err(Error::Encode { .. })));
    }
}
