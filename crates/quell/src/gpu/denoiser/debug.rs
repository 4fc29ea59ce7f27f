//! Debug views of the frame that was encoded last.

use super::Denoiser;
use crate::gpu::debug::{DebugInputs, DebugTarget, DebugView, DebugViews};
use crate::gpu::error::Error;
use crate::gpu::slot::Slot;
use crate::gpu::small::Part;
use crate::plane::Size;
use std::collections::HashMap;

/// What a debug view needs of a frame besides the denoiser's own planes.
#[derive(Debug)]
pub(super) struct Last {
    pub(super) size: Size,
    /// The host's textures in an image's place.
    pub(super) hosts: HashMap<Slot, wgpu::TextureView>,
}

impl Denoiser {
    /// Draws a view of the frame that was encoded last, into the same encoder or a later one. `views` are of the
    /// denoiser's storage. The host's own inputs and targets are shown as they are when the encoder runs.
    ///
    /// # Errors
    /// No frame was encoded since `new` or `resize`; an image that it did not make, or whose texture another one has by
    /// now; a target of another format, too small
    /// or without its usage.
    pub fn encode_debug(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        views: &DebugViews,
        view: DebugView,
        target: DebugTarget<'_>,
    ) -> Result<(), Error> {
        let missing = |image| Error::DebugImage { image };
        let last = self.last.as_ref().ok_or(missing("frame"))?;
        let (plan, _, program) = &self.program;
        let plane = |slot: Slot, before| self.planes.view(slot, before, self.turn).ok_or(missing(slot.name()));
        let of = |index: Option<usize>| self.planes.view(program.home(index?)?.slot, false, self.turn);
        let uniform = |part| self.small.binding(part).ok_or(missing("frame"));
        let image = match view {
            DebugView::Light(image) => {
                let slot = program.slot_of(plan, image).ok_or(missing(image.name()))?;
                match last.hosts.get(&slot) {
                    Some(view) => view,
                    None if program.resources.iter().any(|r| r.slot == slot && !r.lasts) => {
                        return Err(Error::DebugShared { image: slot.name() });
                    }
                    None => self.plane(slot).ok_or(missing(slot.name()))?,
                }
            }
            _ => of(program.shown.confidence).unwrap_or(views.nothing()),
        };
        let inputs = DebugInputs {
            uniforms: [uniform(Part::Frame)?, uniform(Part::Settings)?],
            guides: [
                plane(Slot::Geometry, false)?,
                plane(Slot::Surface, false)?,
                plane(Slot::Moving, false)?,
                plane(Slot::Geometry, true)?,
                plane(Slot::Surface, true)?,
            ],
            image,
            length: of(program.shown.length).unwrap_or(views.nothing()),
            taps: self.small.binding(Part::Resource(Slot::BilateralTaps)),
            tap_count: self.options.settings.matte_bilateral.taps,
            eye: self.before.as_ref().map_or(glam::Vec3::ZERO, |c| c.view.eye),
            has_confidence: program.shown.confidence.is_some(),
            size: last.size,
        };
        views.encode(device, encoder, &inputs, view, target)
    }
}
