//! What a frame of a layer takes in memory, in bytes a pixel.

use super::Adapter;
use crate::image::ExrImage;
use crate::roles::Role;

/// Bytes a pixel of a frame on its way through a job; an estimate from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Light passes.
    pub lights: f64,
    /// Planes that multiply them back.
    pub weights: f64,
    /// As decoded from the file.
    pub read_bytes: f64,
    /// Channels that are written anew, as stored.
    pub written_bytes: f64,
}

impl Footprint {
    /// In full precision, while a frame is made ready: lights, weights, beauty twice, guides, and those of the frame before.
    pub fn planes(&self) -> f64 {
        12.0 * (self.lights + self.weights) + 24.0 + 88.0 + 28.0
    }

    /// While it waits in the window: lights, guides, motion, coverage, weights.
    pub fn waiting(&self) -> f64 {
        6.0 * (self.lights + self.weights) + 78.0
    }

    /// Filtered frames that wait for the pictures of their neighbours.
    pub fn estimates(&self, steady: usize) -> f64 {
        // Lights of this frame and of those after it; of all their picture, the input, and what `stabilise` compares.
        (12.0 * self.lights + 4.0) * (steady as f64 + 1.0) + (12.0 + 12.0 + 48.0) * (2.0 * steady as f64 + 1.0)
    }

    /// The filter's images of one frame of so many rows: colours, variances, what is compared, and luminance stops, with some rows of
    /// the first two that wait until nobody reads those before; its guides. Or those of `blend`: what its net makes of a picture, and
    /// of some rows statistics and what it reads.
    pub fn at_work(&self, rows: f64) -> f64 {
        let part = |some: f64| (some / rows.max(1.0)).min(1.0);
        (28.0 * self.lights + 80.0 + 16.0 * self.lights * part(128.0)).max(216.0 + 260.0 * part(150.0))
    }

    /// As it comes out of the filter, with its expected error.
    pub fn filtered(&self) -> f64 {
        12.0 * (self.lights + self.weights) + 44.0
    }
}

impl Adapter {
    /// What a frame takes; the headers of one say how channels are stored.
    pub fn footprint(&self, images: &[ExrImage]) -> Footprint {
        let (lights, weights) = super::lights::count(&self.mapping, &self.rule);
        let bytes = |id: &crate::roles::ChannelId| {
            let channel = images.get(id.file).and_then(|image| image.parts().get(id.part)?.channels().get(id.channel));
            channel.map_or(0.0, |channel| if channel.kind() == crate::image::SampleKind::Half { 2.0 } else { 4.0 })
        };
        let written = |role: Role| role.light().is_some() || matches!(role, Role::Beauty | Role::LightGroup);
        let channels = self.mapping.passes.iter().filter(|pass| written(pass.role));
        Footprint {
            lights: lights as f64,
            weights: weights as f64,
            read_bytes: self.mapping.channels().iter().map(bytes).sum(),
            written_bytes: channels.flat_map(|pass| pass.channels.iter().chain(&pass.alpha)).map(bytes).sum(),
        }
    }
}
