//! What one frame does on the GPU, as data: the resources and the dispatches in order. It is made from the plan without a
//! device; the denoiser walks it, byte counts and listings come from it, and nothing else decides bindings or order.
//!
//! A resource that alternates has two copies. Frame by frame the denoiser's turn changes between 0 and 1: what is bound
//! as `before` is the copy that the frame before wrote, every other binding is the copy of this turn.

use super::builder::Builder;
use super::pass::{Binding, Pass};
use super::storage::{Storage, Texel};
use crate::frame::Signal;
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
    /// Its samples are jittered.
    pub jitter: bool,
    /// Planes that are tied to the matte and to the glossy signal.
    pub joint: [u16; 2],
}

impl Contents {
    /// A frame with both signals and their weights, jittered, without noisy direct light.
    pub const USUAL: Self = {
        let signal = Some(SignalContents { weight: true, direct: false });
        Self { matte: signal, glossy: signal, direct: true, jitter: true, joint: [0; 2] }
    };

    /// What the plan depends on.
    pub const fn inputs(self) -> Inputs {
        let jitter = self.jitter && self.direct;
        Inputs { matte: self.matte.is_some(), glossy: self.glossy.is_some(), jitter }
    }
}

/// Which resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the name says it")]
pub enum Slot {
    /// An image of the pipeline. What is remembered lies in `MatteHistory`, `GlossyHistory`, `DirectHistory`, whichever
    /// stage writes it.
    Image(Image),
    /// What a plane that is tied to a signal has in an image's place; counted from 0 for each signal.
    Joint {
        signal: Signal,
        index: u16,
        image: Image,
    },
    Geometry,
    Surface,
    Moving,
    MatteLength,
    GlossyLength,
    MatteWeight,
    GlossyWeight,
    DirectMatte,
    DirectGlossy,
    PrefilterTaps,
    BilateralTaps,
}

impl Slot {
    /// For listings and labels.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Image(image) | Self::Joint { image, .. } => image.name(),
            Self::Geometry => "guides geometry",
            Self::Surface => "guides surface",
            Self::Moving => "guides moving",
            Self::MatteLength => "matte length",
            Self::GlossyLength => "glossy length",
            Self::MatteWeight => "matte weight",
            Self::GlossyWeight => "glossy weight",
            Self::DirectMatte => "direct matte",
            Self::DirectGlossy => "direct glossy",
            Self::PrefilterTaps => "matte prefilter taps",
            Self::BilateralTaps => "matte bilateral taps",
        }
    }

    pub(super) const fn alternates(self) -> bool {
        matches!(
            self,
            Self::Geometry
                | Self::Surface
                | Self::MatteLength
                | Self::GlossyLength
                | Self::Image(Image::MatteHistory | Image::GlossyHistory | Image::DirectHistory)
                | Self::Joint { image: Image::MatteHistory | Image::GlossyHistory, .. }
        )
    }

    pub(super) const fn is_input(self) -> bool {
        matches!(
            self,
            Self::Image(Image::MatteInput | Image::GlossyInput | Image::DirectInput)
                | Self::Joint { image: Image::MatteInput | Image::GlossyInput, .. }
                | Self::MatteWeight
                | Self::GlossyWeight
                | Self::DirectMatte
                | Self::DirectGlossy
        )
    }
}

/// Whose a resource is, and how long it lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The host's texture: read as it is, of any float format.
    Input,
    /// Packed guides: they are there before the first dispatch. Geometry and surface outlive the frame.
    Guides,
    /// Outlives the frame.
    Persistent,
    /// Shown to the host: holds the frame until the next one is encoded.
    Output,
    /// Needed within the frame only.
    Transient,
    /// A small buffer, new with every frame: the taps of stage 4 or 7 ([`super::pack_spiral`]).
    Taps,
}

/// A plane of the image's extent, or a table of taps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resource {
    /// Which.
    pub slot: Slot,
    /// What a texel holds; `None`: a storage buffer of taps.
    pub texel: Option<Texel>,
    /// Whose it is.
    pub role: Role,
    /// There are two of it, which change places at every frame.
    pub alternates: bool,
}

/// A resource at a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bound {
    /// Index into [`Program::resources`].
    pub resource: usize,
    /// The copy of the frame before.
    pub before: bool,
}

/// A dispatch over the whole image: one workgroup for every 8x8 pixels.
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
    /// History length in frames, likewise.
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
    /// Likewise of the planes that are tied to the matte and to the glossy signal, in their order.
    pub joint: [Vec<usize>; 2],
}

impl Program {
    /// The program of a plan. `fuse`: stages that can share a pass do; else each has its own.
    pub fn new(plan: &Plan, contents: Contents, storage: Storage, fuse: bool) -> Self {
        Builder::new(plan, contents).build(storage, fuse)
    }

    /// Bytes a pixel that a dispatch moves: each plane once that it reads or writes (host's colours as if they were in
    /// the program's storage).
    pub fn bytes_of(&self, dispatch: &Dispatch) -> u32 {
        let mut seen: Vec<Bound> = Vec::new();
        for bound in &dispatch.bound {
            if !seen.contains(bound) {
                seen.push(*bound);
            }
        }
        let texels = seen.iter().filter_map(|bound| self.resources.get(bound.resource)?.texel);
        texels.map(|texel| texel.bytes(self.storage)).sum()
    }

    /// Bytes a pixel of a stage; `None`: it does not run. Of stages that share a dispatch the first counts all of it, the
    /// others 0.
    pub fn bytes_per_pixel(&self, stage: Stage) -> Option<u32> {
        let dispatch = self.dispatches.iter().find(|d| d.pass.stages.contains(&stage))?;
        Some(if dispatch.pass.stages.first() == Some(&stage) { self.bytes_of(dispatch) } else { 0 })
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
            let Some(texel) = resource.texel.filter(|_| resource.role != Role::Input) else { continue };
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
