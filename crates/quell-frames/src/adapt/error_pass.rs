//! The pass `quell.noise`, and how much noise a frame had and has.

use super::planes::one;
use super::{Adapter, Error};
use crate::image::ExrImage;
use crate::roles::{ChannelId, Role};
use quell::{Plane, Rgb};

/// The pass that holds the expected error of the picture.
pub const NOISE_PASS: &str = "quell.noise";

/// How much noise a frame had, and how much is left: root mean square of the relative error (of x: x / sqrt(b^2 + (0.1 m)^2),
/// b the pixel's brightness in the result, m that of the picture) without the worst thousandth of the pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameNoise {
    /// In the input.
    pub found: f64,
    /// In the result, by the filter's own estimate.
    pub left: f64,
}

/// Fireflies are so many of the pixels, and would decide alone.
const TRIMMED: f64 = 1e-3;
/// Brightness, of the picture's mean, below which errors are not told from those of black.
const DARK: f64 = 0.1;

impl FrameNoise {
    /// From the picture before and after and the expected error after.
    ///
    /// What a good filter leaves is not part of what it removed, so that their squares add up to those of the input's noise.
    /// `None` for a picture that is black, or without one number that is finite.
    pub fn of(before: &Plane<Rgb>, after: &Plane<Rgb>, left: &Plane<f32>) -> Option<Self> {
        let brightness = |value: &Rgb| value.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
        let finite = after.data().iter().map(brightness).filter(|b| b.is_finite());
        let (sum, count) = finite.fold((0.0, 0usize), |(sum, count), b| (sum + b, count + 1));
        let dark = (DARK * sum / count.max(1) as f64).powi(2);
        if dark <= 0.0 {
            return None;
        }
        let (mut all, mut rest) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for ((a, b), error) in before.data().iter().zip(after.data()).zip(left.data()) {
            let scale = brightness(b).powi(2) + dark;
            let apart: f64 = (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>() / 3.0;
            let error = f64::from(*error).powi(2);
            if ((apart + error) / scale).is_finite() {
                all.push((apart + error) / scale);
                rest.push(error / scale);
            }
        }
        Some(Self { found: trimmed(all)?.sqrt(), left: trimmed(rest)?.sqrt() })
    }
}

/// The mean without the largest values.
fn trimmed(mut values: Vec<f64>) -> Option<f64> {
    let kept = values.len() - (values.len() as f64 * TRIMMED) as usize;
    if kept < values.len() {
        values.select_nth_unstable_by(kept, f64::total_cmp);
    }
    let sum: f64 = values.iter().take(kept).sum();
    (kept > 0).then(|| sum / kept as f64)
}

impl Adapter {
    /// The picture as the images hold it now; read again where they wait without their samples. `None` without a beauty.
    ///
    /// # Errors
    /// As [`ExrImage::load`].
    pub fn picture(&self, images: &mut [ExrImage]) -> Result<Option<Plane<Rgb>>, Error> {
        self.mapping.get(Role::Beauty).map(|pass| self.as_it_came(images, pass)).transpose()
    }

    /// Writes the expected error of the picture as a pass of its own beside the beauty: one channel
    /// `quell.noise.Y`, with the names of view layer and view before it. After [`Adapter::write_back`] of every layer.
    ///
    /// # Errors
    /// As [`ExrImage::add_channel`]; [`Error::Invalid`] where the file has no beauty.
    pub fn write_noise(&self, images: &mut [ExrImage], noise: &Plane<f32>) -> Result<(), Error> {
        let path = images.first().map_or_else(std::path::PathBuf::new, |image| image.path().to_owned());
        let beauty = self.mapping.get(Role::Beauty).and_then(|pass| pass.channels.first().copied());
        let Some((id, image)) = beauty.and_then(|id| Some((id, images.get_mut(id.file)?))) else {
            let reason = format!("without a beauty there is no pass `{NOISE_PASS}`");
            return Err(Error::invalid(&path, reason));
        };
        let words = [self.mapping.layer.as_str(), NOISE_PASS, self.mapping.view.as_str()];
        let name = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(".");
        let (part, channel) = image.add_channel(id.part, &name, &format!("{name}.Y"))?;
        let values = noise.data().iter().map(|v| [*v]).collect();
        let mut plane = Plane::from_vec(noise.size(), values).map_err(|source| Error::Frame { path, source })?;
        one(images, ChannelId { file: id.file, part, channel }, self.canvas, &mut plane, 0)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Size;

    #[test]
    fn noise_that_is_known_is_found_and_fireflies_do_not_decide() {
        let size = Size::new(100, 40);
        let sign = |x: usize, y: usize| if (x * 7 + y * 13).is_multiple_of(2) { 1.0 } else { -1.0 };
        let after = Plane::filled(size, [2.0; 3]);
        let left = Plane::filled(size, 0.1);
        let mut before = Plane::from_fn(size, |x, y| [2.0 + 0.6 * sign(x, y); 3]);
        before.data_mut()[77] = [1e4; 3];
        let noise = FrameNoise::of(&before, &after, &left).unwrap();
        let scale = 2.0 * 1.01f64.sqrt();
        assert!((noise.left - 0.1 / scale).abs() < 1e-6, "{noise:?}");
        assert!((noise.found - 0.37f64.sqrt() / scale).abs() < 1e-4, "{noise:?}");
        let black = Plane::filled(size, [0.0; 3]);
        assert_eq!(FrameNoise::of(&black, &black, &left), None);
    }
}
