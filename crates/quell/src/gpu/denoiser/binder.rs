//! What the dispatches of a frame bind, what comes out of it, and where that goes.

use crate::frame::Signal;
use crate::gpu::error::Error;
use crate::gpu::frame::{Frame, Output};
use crate::gpu::planes::{Planes, extent_of};
use crate::gpu::program::{Bound, Program, Resource, Role};
use crate::gpu::repairs::Repairs;
use crate::gpu::slot::Slot;
use crate::gpu::small::{Part, Small};
use crate::history::Validity;
use crate::pipeline::Image;
use std::collections::HashMap;

/// Looks up, for one frame, the texture or buffer behind each resource of the program.
#[derive(Clone, Copy)]
pub(super) struct Binder<'a> {
    pub(super) program: &'a Program,
    pub(super) planes: &'a Planes,
    pub(super) small: &'a Small,
    pub(super) repairs: Option<&'a Repairs>,
    pub(super) frame: &'a Frame<'a>,
    pub(super) turn: usize,
}

type Target<'a> = (&'static str, Option<usize>, Option<&'a wgpu::TextureView>);

/// Outputs that may be aimed at a texture of the caller's: name, resource, that texture.
fn targets<'a>(program: &Program, frame: &Frame<'a>) -> [Target<'a>; 3] {
    let (shown, targets) = (program.shown, frame.targets);
    [
        ("composite", shown.composite, targets.composite),
        ("matte", shown.matte, targets.matte),
        ("glossy", shown.glossy, targets.glossy),
    ]
}

/// A target that nothing writes is a mistake.
pub(super) fn check_targets(program: &Program, frame: &Frame<'_>) -> Result<(), Error> {
    for (binding, shown, target) in targets(program, frame) {
        let resource = shown.and_then(|index| program.resources.get(index));
        if target.is_some() && resource.is_none_or(|r| r.role == Role::Input) {
            let expected = "left out: no stage writes it";
            return Err(Error::Kind { pass: "target", binding, expected });
        }
    }
    Ok(())
}

impl<'a> Binder<'a> {
    fn resource(&self, index: usize) -> Option<&'a Resource> {
        self.program.resources.get(index)
    }

    /// The texture at a binding; `None`: a buffer lies there.
    pub(super) fn view(&self, bound: Bound) -> Option<&'a wgpu::TextureView> {
        let resource = self.resource(bound.resource)?;
        match resource.role {
            Role::Taps | Role::Uniform | Role::Counts => None,
            Role::Input => {
                let stand_in = || self.own(resource.absent?, false);
                self.frame.input(resource.slot).or_else(stand_in)
            }
            _ => {
                let target = self.target(bound.resource).filter(|_| !bound.before);
                target.or_else(|| self.own(bound.resource, bound.before))
            }
        }
    }

    /// What lies at a binding.
    pub(super) fn binding(&self, bound: Bound) -> Option<wgpu::BindingResource<'a>> {
        let resource = self.resource(bound.resource)?;
        match resource.role {
            Role::Taps | Role::Uniform => self.small.binding(Part::Resource(resource.slot)),
            Role::Counts => self.repairs.map(|repairs| repairs.buffer().as_entire_binding()),
            _ => self.view(bound).map(wgpu::BindingResource::TextureView),
        }
    }

    fn own(&self, index: usize, before: bool) -> Option<&'a wgpu::TextureView> {
        self.planes.view(self.program.home(index)?.slot, before, self.turn)
    }

    /// The caller's texture in the place of an image that is shown and not remembered.
    fn target(&self, index: usize) -> Option<&'a wgpu::TextureView> {
        self.resource(index).filter(|r| r.role == Role::Output)?;
        targets(self.program, self.frame).into_iter().find(|(_, shown, _)| *shown == Some(index))?.2
    }

    /// Copies what is shown and remembered at once.
    pub(super) fn fill_targets(&self, encoder: &mut wgpu::CommandEncoder) {
        for (_, shown, target) in targets(self.program, self.frame) {
            let (Some(index), Some(target)) = (shown, target) else { continue };
            let remembered = self.resource(index).filter(|r| r.role == Role::Persistent);
            if let Some(own) = remembered.and_then(|_| self.own(index, false)) {
                let (from, to) = (own.texture().as_image_copy(), target.texture().as_image_copy());
                encoder.copy_texture_to_texture(from, to, extent_of(self.frame.size));
            }
        }
    }

    /// The host's textures in an image's place, for debug views.
    pub(super) fn hosts(&self) -> HashMap<Slot, wgpu::TextureView> {
        let inputs = [Image::DirectInput, Image::MatteInput, Image::GlossyInput].map(Slot::Image);
        let given = inputs.into_iter().filter_map(|slot| Some((slot, self.frame.input(slot)?.clone())));
        let aimed = targets(self.program, self.frame)
            .into_iter()
            .filter_map(|(_, index, target)| Some((self.resource(index?)?.slot, target?.clone())));
        given.chain(aimed).collect()
    }

    pub(super) fn output(&self, valid: Validity, repairs: Option<Repairs>) -> Output {
        let view = |resource| self.view(Bound { resource, before: false }).cloned();
        let (program, shown) = (self.program, self.program.shown);
        let mut joint = Signal::ALL.map(|signal| program.joint[signal as usize].iter());
        Output {
            composite: shown.composite.and_then(view),
            direct: shown.direct.and_then(view),
            matte: shown.matte.and_then(view),
            glossy: shown.glossy.and_then(view),
            confidence: shown.confidence.and_then(view),
            history_length: shown.length.and_then(view),
            joint: self.frame.joint.iter().filter_map(|p| view(*joint[p.signal as usize].next()?)).collect(),
            repairs,
            had_history: valid.matte || valid.glossy,
        }
    }
}
