//! What one frame does on the GPU, as data: the resources and the dispatches in order. It is made from the plan without a
//! device; the denoiser walks it, byte counts and listings come from it, and nothing else decides bindings or order.
//!
//! A resource that alternates has two copies. Frame by frame the denoiser's turn changes between 0 and 1: what is bound
//! as `before` is the copy that the frame before wrote, every other binding is the copy of this turn.

use super::builder::Builder;
use super::pass::{Binding, Pass, Sample};
use super::share;
use super::slot::Slot;
use super::storage::{Storage, Texel};
use crate::pipeline::{Image, Inputs, Plan, Stage};

/// What a frame has of one signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SignalContents {
    /// Its weight.
    pub weight: bool,
    /// Noisy direct light of the lobe.
    pub direct: bool,
}

/// What a frame has; the program depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// The matte signal.
    pub matte: Option<SignalContents>,
    /// The glossy signal.
    pub glossy: Option<SignalContents>,
    /// Direct light.
    pub direct: bool,
    /// Its samples are jittered, or those of the frame before were.
    pub jitter: bool,
    /// Planes that are tied to the matte and to the glossy signal.
    pub joint: [u16; 2],
    /// Guides come as the host's textures, which the first pass makes into those of the stages; else they are packed.
    pub textures: bool,
    /// Repairs of its colours are counted.
    pub counts: bool,
}

impl Contents {
    /// A frame with both signals and their weights, jittered, without noisy direct light; packed guides, nothing counted.
    pub const USUAL: Self = {
        let signal = Some(SignalContents { weight: true, direct: false });
        Self {
            matte: signal,
            glossy: signal,
            direct: true,
            jitter: true,
            joint: [0; 2],
            textures: false,
            counts: false,
        }
    };

    /// What the plan depends on.
    pub const fn inputs(self) -> Inputs {
        Inputs { matte: self.matte.is_some(), glossy: self.glossy.is_some(), direct: self.direct, jitter: self.jitter }
    }
}

/// Whose a resource is, and how long it lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The host's texture: read as it is, of any float format.
    Input,
    /// Packed guides: they are there before the first dispatch. Geometry and surface outlive the frame. (Where guides are
    /// textures, the first dispatch writes them, and they are persistent or transient.)
    Guides,
    /// Outlives the frame.
    Persistent,
    /// Shown to the host: holds the frame until the next one is encoded.
    Output,
    /// Needed within the frame only.
    Transient,
    /// A small buffer, new with every frame: the taps of stage 4 or 7 ([`super::pack_spiral`]).
    Taps,
    /// A uniform buffer, new with every frame.
    Uniform,
    /// A buffer of counts, zero before the first dispatch.
    Counts,
    /// A texture of one texel, always zero, which stands in for what the host has not.
    Absent,
}

/// What a resource is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holds {
    /// A plane of the image's extent. The host's colours may have any format of floats.
    Plane(Texel),
    /// A guide of the host's, in a format of its own; or what stands in for one.
    Host(Sample),
    /// A storage buffer of taps.
    Taps,
    /// A storage buffer of so many 32-bit counts.
    Counts(u32),
    /// A uniform buffer with the struct of this name.
    Uniform(&'static str),
}

/// A texture or a small buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resource {
    /// Which.
    pub slot: Slot,
    /// What it is made of.
    pub holds: Holds,
    /// Whose it is.
    pub role: Role,
    /// There are two of it, which change places at every frame.
    pub alternates: bool,
    /// The host may have none: index of the resource that is bound then.
    pub absent: Option<usize>,
    /// It has no texture of its own, but that of this resource ([`Program::with_shared_planes`]).
    pub shares: Option<usize>,
    /// What it holds lasts until the next frame: no other resource has its texture later in this one.
    pub lasts: bool,
}

impl Resource {
    /// What a texel of a plane holds.
    pub const fn texel(&self) -> Option<Texel> {
        match self.holds {
            Holds::Plane(texel) => Some(texel),
            _ => None,
        }
    }

    /// Bytes of a pixel in byte counts: of the host's colours as if they were in this storage, of its guides as renderers
    /// usually have them ([`super::GuidePlane::usual_bytes`]).
    pub const fn bytes(&self, storage: Storage) -> u32 {
        match (self.holds, self.slot) {
            (Holds::Plane(texel), _) => texel.bytes(storage),
            (Holds::Host(_), Slot::Guide(plane)) => plane.usual_bytes(),
            _ => 0,
        }
    }
}

/// A resource at a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bound {
    /// Index into [`Program::resources`].
    pub resource: usize,
    /// The copy of the frame before.
    pub before: bool,
}

/// A dispatch over the whole image: one workgroup for every [`Pass::workgroup`] pixels along each axis.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// Shader, entry point, names of bindings, stages.
    pub pass: Pass,
    /// The image that it filters comes from the host as it is: see [`Pass::source`].
    pub host_input: bool,
    /// One for each of [`Pass::bindings`], in their order.
    pub bound: Vec<Bound>,
}

/// Which resources the host is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The sum; `None`: nobody asked for it, or there is nothing to add.
    pub composite: Option<usize>,
    /// Direct light, where there is any.
    pub direct: Option<usize>,
    /// The matte signal.
    pub matte: Option<usize>,
    /// The glossy signal.
    pub glossy: Option<usize>,
    /// The image whose fourth value is the confidence (its magnitude; negative: background): of the matte signal, or of
    /// the glossy one where there is no matte.
    pub confidence: Option<usize>,
    /// History length in frames.
    pub length: Option<usize>,
}

/// Device memory in bytes; inputs are the host's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// What outlives a frame: history and the guides of the frame before.
    pub persistent: u64,
    /// What is needed within a frame, outputs included: another user of the device may have it in between.
    pub transient: u64,
}

/// Resources and dispatches of a frame.
#[derive(Clone, Debug)]
pub struct Program {
    /// How planes are stored.
    pub storage: Storage,
    /// Every plane and table.
    pub resources: Vec<Resource>,
    /// In the order in which they run.
    pub dispatches: Vec<Dispatch>,
    /// What comes out.
    pub shown: Shown,
    /// The planes that are tied to the matte and to the glossy signal, in their order.
    pub joint: [Vec<usize>; 2],
}

impl Program {
    /// The program of a plan. `fuse`: stages that can share a pass do; else each has its own.
    pub fn new(plan: &Plan, contents: Contents, storage: Storage, fuse: bool) -> Self {
        Builder::new(plan, contents).build(storage, fuse)
    }

    /// The same with planes that are needed within the frame only, and outputs, in one texture where none of them is needed
    /// while another is.
    #[must_use]
    pub fn with_shared_planes(mut self) -> Self {
        share::share(&mut self);
        self
    }

    /// The resource that has the texture of this one: itself, unless it shares.
    pub(super) fn home(&self, index: usize) -> Option<&Resource> {
        let resource = self.resources.get(index)?;
        self.resources.get(resource.shares.unwrap_or(index))
    }

    /// Bytes a pixel that a dispatch moves: each plane once that it reads or writes ([`Resource::bytes`]).
    pub fn bytes_of(&self, dispatch: &Dispatch) -> u32 {
        let mut seen: Vec<Bound> = Vec::new();
        for bound in &dispatch.bound {
            if !seen.contains(bound) {
                seen.push(*bound);
            }
        }
        seen.iter().filter_map(|bound| self.resources.get(bound.resource)).map(|r| r.bytes(self.storage)).sum()
    }

    /// Bytes a pixel of a stage; `None`: it does not run. Of stages that share a dispatch the first counts all of it, the
    /// others 0.
    pub fn bytes_per_pixel(&self, stage: Stage) -> Option<u32> {
        let dispatch = self.dispatches.iter().find(|d| d.pass.stages.contains(&stage))?;
        Some(if dispatch.pass.stages.first() == Some(&stage) { self.bytes_of(dispatch) } else { 0 })
    }

    /// Bytes a pixel of what comes before the stages: guides made from the host's textures, repairs counted.
    pub fn border_bytes_per_pixel(&self) -> u32 {
        self.dispatches.iter().filter(|d| d.pass.stages.is_empty()).map(|d| self.bytes_of(d)).sum()
    }

    /// Milliseconds that a stage takes at the least where memory is the limit: `bytes_per_pixel` for this many pixels at
    /// `bandwidth` bytes a second.
    pub fn floor_ms(&self, stage: Stage, pixels: usize, bandwidth: f64) -> Option<f64> {
        let bytes = self.bytes_per_pixel(stage)?;
        Some(f64::from(bytes) * pixels as f64 / bandwidth * 1e3)
    }

    /// Device memory of the program's own planes for this many pixels.
    pub fn memory(&self, pixels: usize) -> Memory {
        let mut memory = Memory::default();
        for resource in &self.resources {
            let is_own = resource.role != Role::Input && resource.shares.is_none();
            let Some(texel) = resource.texel().filter(|_| is_own) else { continue };
            let bytes = u64::from(texel.bytes(self.storage)) * pixels as u64;
            if resource.alternates {
                memory.persistent += 2 * bytes;
            } else {
                memory.transient += bytes;
            }
        }
        memory
    }

    /// Where an image of the plan lies that this program reads or makes.
    pub(super) fn slot_of(&self, plan: &Plan, image: Image) -> Option<Slot> {
        let slot = Builder::new(plan, Contents::USUAL).place(image).0;
        self.resources.iter().find(|r| r.slot == slot).map(|r| r.slot)
    }

    /// The bindings of a dispatch with what is bound, in order.
    pub fn bindings<'a>(&'a self, dispatch: &'a Dispatch) -> impl Iterator<Item = (&'a Binding, &'a Resource, bool)> {
        let bound = dispatch.bound.iter().filter_map(|b| Some((self.resources.get(b.resource)?, b.before)));
        dispatch.pass.bindings.iter().zip(bound).map(|(binding, (resource, before))| (binding, resource, before))
    }
}
