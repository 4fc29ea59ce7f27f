//! The pass `quell.noise`, and how much noise a frame had and has.

use super::planes::one;
use super::{Adapter, Error};
use crate::image::ExrImage;
use crate::roles::{ChannelId, Role};
use quell::{Plane, Rgb};

/// The pass that holds the expected error of the picture.
pub const NOISE_PASS: &str = "quell.noise";

/// How much noise a frame had, and how much is left: root mean square over the picture, relative to its mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameNoise {
    /// In the input.
    pub found: f64,
    /// In the result, by the filter's own estimate.
    pub left: f64,
}

impl FrameNoise {
    /// From the picture before and after and the expected error after.
    ///
    /// What a good filter leaves is not part of what it removed, so that their squares add up to those of the input's noise.
    /// `None` for a picture that is black, or without one number that is finite.
    pub fn of(before: &Plane<Rgb>, after: &Plane<Rgb>, left: &Plane<f32>) -> Option<Self> {
        let (mut removed, mut rest, mut bright, mut count) = (0.0, 0.0, 0.0, 0usize);
        for ((a, b), error) in before.data().iter().zip(after.data()).zip(left.data()) {
            let apart: f64 = (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>() / 3.0;
            let error = f64::from(*error).powi(2);
            let light = b.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
            if (apart + error + light).is_finite() {
                removed += apart;
                rest += error;
                bright += light;
                count += 1;
            }
        }
        let n = count as f64;
        (count > 0 && bright > 0.0).then(|| Self {
            found: ((removed + rest) / n).sqrt() / (bright / n),
            left: (rest / n).sqrt() / (bright / n),
        })
    }
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
