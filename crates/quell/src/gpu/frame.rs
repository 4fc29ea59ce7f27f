//! What goes in and what comes out, as textures on the caller's device.

use super::error::Error;
use super::kernel::check_sampled;
use super::program::{Contents, SignalContents, Slot};
use super::storage::{Storage, Texel};
use crate::camera::Camera;
use crate::pipeline::Image;
use crate::plane::Size;

/// One signal of a frame: colour textures of the caller's.
#[derive(Clone, Copy, Debug)]
pub struct Signal<'a> {
    /// Indirect light of the lobe, without its weight.
    pub light: &'a wgpu::TextureView,
    /// What multiplies it back. Absent: 1.
    pub weight: Option<&'a wgpu::TextureView>,
    /// Noisy direct light of the lobe, passed through unfiltered. Absent: none.
    pub direct: Option<&'a wgpu::TextureView>,
}

impl Signal<'_> {
    fn contents(&self) -> SignalContents {
        SignalContents { weight: self.weight.is_some(), direct: self.direct.is_some() }
    }
}

/// Guides as [`super::pack_guides`] packs them, in the formats of the denoiser's storage. They are copied into the
/// denoiser's own planes: usage `COPY_SRC`.
#[derive(Clone, Copy, Debug)]
pub struct PackedGuides<'a> {
    /// View depth and normal ([`Texel::Geometry`]).
    pub geometry: &'a wgpu::TextureView,
    /// Id and roughness ([`Texel::Surface`]).
    pub surface: &'a wgpu::TextureView,
    /// Motion, hit distance, confidence of the host ([`Texel::Moving`]).
    pub moving: &'a wgpu::TextureView,
}

impl<'a> PackedGuides<'a> {
    pub(super) const fn planes(&self) -> [(Slot, Texel, &'a wgpu::TextureView); 3] {
        [
            (Slot::Geometry, Texel::Geometry, self.geometry),
            (Slot::Surface, Texel::Surface, self.surface),
            (Slot::Moving, Texel::Moving, self.moving),
        ]
    }
}

/// A frame on the GPU: 2D textures of the caller's with one sample, at least of the frame's extent, read from texel (0, 0)
/// on. Colours: any format that a shader reads as floats (rgba16float, rgba32float, rg11b10ufloat, ..), usage
/// `TEXTURE_BINDING`. What they hold means what it means in [`crate::Frame`], and must keep its contract.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The camera that took this frame.
    pub camera: Camera,
    /// The camera of the frame before.
    pub previous_camera: Camera,
    /// Number of the frame; one that does not follow its predecessor by one is a cut.
    pub index: i64,
    /// What the pixels show.
    pub guides: PackedGuides<'a>,
    /// The guides' roughness counts.
    pub has_roughness: bool,
    /// The guides' hit distance counts.
    pub has_glossy_hit: bool,
    /// Radiance that needs no filter.
    pub direct: &'a wgpu::TextureView,
    /// The matte signal.
    pub matte: Option<Signal<'a>>,
    /// The glossy signal.
    pub glossy: Option<Signal<'a>>,
}

impl<'a> Frame<'a> {
    /// Which planes there are.
    pub fn contents(&self) -> Contents {
        Contents {
            matte: self.matte.map(|s| s.contents()),
            glossy: self.glossy.map(|s| s.contents()),
            jitter: self.camera.jitter != [0.0; 2],
        }
    }

    /// The texture behind a resource whose role is [`super::Role::Input`].
    pub(super) fn input(&self, slot: Slot) -> Option<&'a wgpu::TextureView> {
        match slot {
            Slot::Image(Image::MatteInput) => self.matte.map(|s| s.light),
            Slot::Image(Image::GlossyInput) => self.glossy.map(|s| s.light),
            Slot::Image(Image::DirectInput) => Some(self.direct),
            Slot::MatteWeight => self.matte?.weight,
            Slot::GlossyWeight => self.glossy?.weight,
            Slot::DirectMatte => self.matte?.direct,
            Slot::DirectGlossy => self.glossy?.direct,
            _ => None,
        }
    }

    /// Everything that can be known of the textures before the device sees them.
    pub(super) fn check(&self, size: Size, storage: Storage) -> Result<(), Error> {
        let pass = "denoiser";
        for (slot, texel, view) in self.guides.planes() {
            let (binding, format) = (slot.name(), texel.format(storage));
            check_sampled(pass, binding, view, texel.sample_type(), size)?;
            if view.texture().format() != format {
                let (expected, found) = (texel.format_name(storage), view.texture().format());
                return Err(Error::Format { pass, binding, expected, found });
            }
            if !view.texture().usage().contains(wgpu::TextureUsages::COPY_SRC) {
                return Err(Error::Usage { pass, binding, usage: "COPY_SRC" });
            }
        }
        let colour = |binding, view: Option<&wgpu::TextureView>| {
            view.map_or(Ok(()), |v| check_sampled(pass, binding, v, Texel::Colour.sample_type(), size))
        };
        colour("direct", Some(self.direct))?;
        for (signal, names) in [
            (self.matte, ["matte", "matte_weight", "direct_matte"]),
            (self.glossy, ["glossy", "glossy_weight", "direct_glossy"]),
        ] {
            let Some(signal) = signal else { continue };
            for (name, view) in names.into_iter().zip([Some(signal.light), signal.weight, signal.direct]) {
                colour(name, view)?;
            }
        }
        Ok(())
    }
}

/// What was encoded: views of colour textures, in the denoiser's storage. They hold the frame once the caller's encoder
/// has run, until the next frame's has. The composite is the same texture at every frame until `resize`; the others may
/// alternate between two, and a signal that no stage filters is the caller's own.
#[derive(Clone, Debug)]
pub struct Output {
    /// The sum.
    pub composite: wgpu::TextureView,
    /// Direct light, anti-aliased where the frame has jitter.
    pub direct: wgpu::TextureView,
    /// The matte signal, filtered.
    pub matte: Option<wgpu::TextureView>,
    /// The glossy signal, filtered.
    pub glossy: Option<wgpu::TextureView>,
    /// An image whose fourth value is the confidence of the matte signal, or of the glossy one where there is no matte:
    /// its magnitude, 0..1; negative: background.
    pub confidence: Option<wgpu::TextureView>,
    /// History length of the same signal in frames, r32float.
    pub history_length: Option<wgpu::TextureView>,
    /// The frame continued from the one before.
    pub had_history: bool,
}
