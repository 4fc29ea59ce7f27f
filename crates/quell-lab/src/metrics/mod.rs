//! How far a picture is from its reference (evaluation.md, section 2).
//!
//! ```text
//! error.rs   relMSE, trimmed relMSE, fireflies, PSNR; maps of the relative error
//! ssim.rs    SSIM
//! energy.rs  sum of the picture over sum of the reference, in total and by region
//! flip.rs    FLIP and HDR-FLIP
//! ```
//!
//! All take `Plane<Rgb>`, scene-linear. [`FrameScores::measure`] takes them all at once, [`mean_scores`] sums a
//! sequence up.

pub mod energy;
pub mod error;
pub mod flip;
pub mod ssim;

pub use energy::{RegionEnergy, energy, energy_by_region, grid_regions};
pub use error::{RelMse, psnr, rel_error_map, rel_mse};
pub use flip::{Exposures, FlipMap, PIXELS_PER_DEGREE, hdr_flip, ldr_flip};
pub use ssim::{Ssim, ssim};

use crate::error::Error;
use crate::tone::Tone;
use quell::{Plane, Rgb};
use serde::{Deserialize, Serialize};

/// All picture metrics of one frame, or their means over a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameScores {
    /// Relative mean squared error; lower is better.
    pub rel_mse: f64,
    /// The same without the worst 0.1 % of pixels.
    pub rel_mse_trimmed: f64,
    /// Pixels far too bright or too dark (see [`RelMse::fireflies`]); in a mean over frames: their mean.
    pub fireflies: f64,
    /// Peak signal-to-noise ratio of the tone-mapped picture, dB; higher is better. Infinite (null in JSON) where the
    /// pictures are equal.
    #[serde(with = "infinite_as_null")]
    pub psnr: f64,
    /// Sum of the picture over sum of the reference; 1 is right.
    pub energy: f64,
    /// Structural similarity of the tone-mapped luma (see [`ssim()`]); 1 is equal, higher is better.
    /// NaN (null in JSON) where an older report does not say.
    #[serde(default = "unknown", with = "unknown_as_null")]
    pub ssim: f64,
    /// Mean FLIP of the tone-mapped picture, 0..1; lower is better. NaN where it was not measured.
    #[serde(default = "unknown", with = "unknown_as_null")]
    pub ldr_flip: f64,
    /// Mean HDR-FLIP, 0..1; lower is better.
    pub hdr_flip: f64,
}

impl FrameScores {
    /// Measures `picture` against `reference`; also gives the HDR-FLIP map, for error maps.
    ///
    /// # Errors
    /// [`Error::Size`], [`Error::Empty`].
    pub fn measure(
        picture: &Plane<Rgb>,
        reference: &Plane<Rgb>,
        tone: Tone,
        exposures: &Exposures,
    ) -> Result<(Self, FlipMap), Error> {
        let relative = rel_mse(picture, reference)?;
        let flip = hdr_flip(picture, reference, exposures)?;
        let shown = |p: &Plane<Rgb>| Plane::from_fn(p.size(), |x, y| tone.display_linear(p.at(x, y)));
        let scores = Self {
            rel_mse: relative.mean,
            rel_mse_trimmed: relative.trimmed,
            fireflies: relative.fireflies as f64,
            psnr: psnr(picture, reference, tone)?,
            energy: energy(picture, reference)?,
            ssim: ssim(picture, reference, tone)?.mean,
            ldr_flip: ldr_flip(&shown(picture), &shown(reference))?.mean,
            hdr_flip: flip.mean,
        };
        Ok((scores, flip))
    }
}

/// Arithmetic means over the frames of a sequence; `None` without frames. PSNR is the mean of the frames' dB.
pub fn mean_scores(frames: &[FrameScores]) -> Option<FrameScores> {
    if frames.is_empty() {
        return None;
    }
    let mean = |f: fn(&FrameScores) -> f64| frames.iter().map(f).sum::<f64>() / frames.len() as f64;
    Some(FrameScores {
        rel_mse: mean(|s| s.rel_mse),
        rel_mse_trimmed: mean(|s| s.rel_mse_trimmed),
        fireflies: mean(|s| s.fireflies),
        psnr: mean(|s| s.psnr),
        energy: mean(|s| s.energy),
        ssim: mean(|s| s.ssim),
        ldr_flip: mean(|s| s.ldr_flip),
        hdr_flip: mean(|s| s.hdr_flip),
    })
}

/// JSON has no infinity.
mod infinite_as_null {
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() { serializer.serialize_f64(*value) } else { serializer.serialize_none() }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}

fn unknown() -> f64 {
    f64::NAN
}

/// JSON has no NaN.
mod unknown_as_null {
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_nan() { serializer.serialize_none() } else { serializer.serialize_f64(*value) }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
    }
}
