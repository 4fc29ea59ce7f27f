//! The GPU back end: each stage's `shader.wgsl` composed into passes that run on the caller's wgpu device, and
//! [`Denoiser`], which encodes the whole plan into the caller's encoder.
//!
//! Every plane is a 2D texture, in half precision by default ([`Storage`] says what a texel holds). What a frame does is
//! data, [`Program`]: resources and dispatches in order, made without a device; the denoiser walks it, and byte counts and
//! listings come from it.
//!
//! A host hands over its own textures: [`GuideTextures`] in its own [`Convention`], colours of any float format. One dispatch
//! ([`Pass::PREPARE`]) makes guides of them that every stage may trust; colours are repaired wherever they are loaded, without a
//! copy. [`DebugViews`] shows what a frame holds, and what the usual mistakes look like.
//!
//! Single passes, for bisecting and tests: [`Pass`], [`Kernel`], with [`FrameUniforms`], [`SettingsUniforms`], [`PrepareUniforms`]. The sequence
//! filter's frames on the device: [`SequenceWindow`].
//!
//! ```text
//! program.rs, builder.rs, slot.rs   what a frame does, as data; made from the plan; names of its resources
//! pass.rs, passes.rs, passes/       a pass: its bindings and its pieces of WGSL; the real-time filter's, with entry points
//! kernel.rs, kernels.rs             a pass compiled, checked and encoded; each once
//! denoiser.rs, planes.rs, share.rs  walks the program; its textures, of which those never needed at once are one (transient aliasing)
//! taps.rs, small.rs, groups.rs      per-frame uniforms and tables of taps; bind groups that are kept
//! uniform.rs, uniforms.rs, constants.rs   structs by WGSL's layout rules; cameras and settings; constants from Rust
//! storage.rs, guides.rs, pack.rs    what a texel holds: half precision, packed feature buffers; frames of the CPU as texels
//! frame.rs, inputs.rs, convention.rs, options.rs, error.rs   what goes in and comes out, all checked before anything is encoded
//! repairs.rs, timing.rs, debug.rs   what was repaired, times by timestamps, debug views
//! tile.rs                           pictures larger than a device's textures
//! sequence/                         the sequence filter: the window of frames on the device, its passes and schedule
//! ```
//!
//! ```no_run
//! # use quell::gpu::{self, wgpu};
//! # fn frame(
//! #     device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, denoiser: &mut gpu::Denoiser,
//! #     views: [&wgpu::TextureView; 7], cameras: [quell::Camera; 2], index: i64,
//! # ) -> Result<(), gpu::Error> {
//! # let [depth, normal, motion, orm, matte, albedo, target] = views;
//! # let [camera, previous_camera] = cameras;
//! # let size = denoiser.size();
//! // Made once: gpu::Denoiser::new(&device, size, &gpu::Options::new(&settings))?
//! let guides = gpu::GuideTextures {
//!     convention: gpu::Convention::BEVY,
//!     view_depth: Some(depth),
//!     normal: Some(normal),
//!     motion: Some(motion),
//!     roughness: Some(gpu::Scalar { view: orm, channel: gpu::Channel::G }),
//!     ..Default::default()
//! };
//! let frame = gpu::Frame {
//!     matte: Some(gpu::Signal { light: matte, weight: Some(albedo), direct: None }),
//!     targets: gpu::Targets { matte: Some(target), ..Default::default() },
//!     ..gpu::Frame::new(size, camera, previous_camera, index, guides)
//! };
//! denoiser.encode(device, encoder, &frame)?; // the filtered signal is in `target` once the encoder has run
//! # Ok(())
//! # }
//! ```
//!
//! All are good guests: they take the caller's device and encoder, never submit, block, poll or read back, and ask for no
//! feature and no limit beyond WebGPU's defaults.

mod builder;
mod constants;
mod convention;
mod debug;
mod denoiser;
mod error;
mod frame;
mod groups;
mod guides;
mod inputs;
mod kernel;
mod kernels;
mod options;
mod pack;
mod pass;
mod passes;
mod planes;
mod program;
mod repairs;
mod sequence;
mod share;
mod slot;
mod small;
mod storage;
mod taps;
mod tile;
mod timing;
mod uniform;
mod uniforms;

pub use convention::{Convention, DepthKind, MotionUnit, NormalEncoding, NormalSpace, RoughnessKind};
pub use debug::{DebugTarget, DebugView, DebugViews};
pub use denoiser::Denoiser;
pub use error::Error;
pub use frame::{Frame, Guides, JointPlane, Output, PackedGuides, Signal, Targets};
pub use inputs::{Channel, GuidePlane, GuideTextures, Scalar};
pub use options::Options;
pub use repairs::Repairs;
pub use storage::Storage;
pub use timing::Timing;

/// The parts of a program, for hosts that walk it themselves, and for tests.
#[allow(unused_imports, reason = "without the feature `internals` few are used")]
mod internals {
    pub use super::convention::PrepareUniforms;
    pub use super::debug::debug_view_numbers;
    pub use super::guides::{GuideTexels, pack_guides, pack_spiral};
    pub use super::kernel::{Bindable, Kernel, PerFrameUniforms};
    pub use super::pack::{PackedFrame, PackedSignal, unpack_colours, unpack_fourth, unpack_numbers};
    pub use super::pass::{Binding, BindingKind, Element, FIRST_BINDING, Pass, Sample, WORKGROUP};
    pub use super::program::{
        Bound, Contents, Dispatch, Holds, Memory, Program, Resource, Role, Shown, SignalContents,
    };
    pub use super::sequence::{
        Band, Estimated, Finished, SequenceKernels, SequenceStage, SequenceView, SequenceWavelet, SequenceWindow,
        WaveletBuffers,
    };
    pub use super::slot::Slot;
    pub use super::storage::{Texel, beside, parted};
    pub use super::taps::{TAP_FRAMES, pack_taps};
    pub use super::tile::{Area, Tile, reach_px};
    pub use super::uniform::{Member, Uniform};
    pub use super::uniforms::{FrameUniforms, SettingsUniforms, layouts};
}
#[cfg(feature = "internals")]
pub use internals::*;
#[cfg(not(feature = "internals"))]
#[allow(unused_imports, reason = "few are used")]
pub(crate) use internals::*;

/// The wgpu that this release is built for.
pub use wgpu;
