//! The GPU back end: each stage's `shader.wgsl` composed into passes that run on the caller's wgpu device, and
//! [`Denoiser`], which encodes the whole plan into the caller's encoder.
//!
//! In its first form: every plane is a storage buffer of 32-bit floats, row by row without padding ([`Denoiser`] holds
//! 312 bytes a pixel), which holds images up to about 2.8 million pixels on WebGPU's default limits; each stage is a pass of
//! its own. Half floats, fused passes, textures and conventions of hosts, joint passes and timings are not here yet, and
//! nothing is repaired: what the buffers hold must keep the contract of [`crate::Frame`].
//!
//! Single passes, for bisecting and tests: [`Pass`], [`Kernel`], told by [`FrameUniforms`], [`SettingsUniforms`].
//!
//! Both are good guests: they take the caller's device and encoder, never submit, block, poll or read back, and ask for no
//! feature and no limit beyond WebGPU's defaults.
//!
//! | plane | one pixel | bytes |
//! |---|---|---|
//! | colour | red, green, blue, unused | 16 |
//! | guides | [`pack_guides`] | 48 |
//! | state | confidence, history length | 8 |
//! | scalar | one number | 4 |

mod convention;
mod denoiser;
mod error;
mod guides;
mod inputs;
mod kernel;
mod pack;
mod pass;
mod prepare;
mod repairs;
mod uniform;
mod uniforms;

pub use convention::{Convention, DepthKind, MotionUnit, NormalEncoding, NormalSpace, RoughnessKind};
pub use denoiser::{Denoiser, Frame, Output, Signal};
pub use error::Error;
pub use guides::{pack_guides, pack_spiral};
pub use inputs::{Channel, GuideTextures, Scalar};
pub use kernel::Kernel;
pub use pack::{PackedFrame, PackedSignal, unpack_colours, unpack_state};
pub use pass::{Access, Binding, Pass};
pub use prepare::{Border, Prepare, count_source, prepare_source};
pub use repairs::Repairs;
pub use uniform::{Member, Uniform};
pub use uniforms::{FrameUniforms, SettingsUniforms, layouts};

/// The wgpu that this release is built for.
pub use wgpu;
