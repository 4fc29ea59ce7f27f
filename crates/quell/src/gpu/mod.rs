//! The GPU back end, in the making: each stage's `shader.wgsl` composed into passes that run on the caller's wgpu device.
//!
//! There is no denoiser here yet, only its parts: single passes ([`Pass`], [`Kernel`]) and what they are told
//! ([`FrameUniforms`], [`SettingsUniforms`], [`pack_guides`]). Every plane is a storage buffer of 32-bit floats, row by row
//! without padding: exactness first, half floats later. Joint passes do not run on the GPU yet.
//!
//! A [`Kernel`] is a good guest: it takes the caller's device and encoder, never submits, blocks, polls or reads back, and
//! asks for no feature and no limit beyond WebGPU's defaults.
//!
//! | plane | one pixel | bytes |
//! |---|---|---|
//! | colour | red, green, blue, unused | 16 |
//! | guides | [`pack_guides`] | 48 |
//! | state | confidence, history length | 8 |
//! | scalar | one number | 4 |

mod error;
mod guides;
mod kernel;
mod pass;
mod uniform;
mod uniforms;

pub use error::Error;
pub use guides::{pack_guides, pack_spiral};
pub use kernel::Kernel;
pub use pass::{Access, Binding, Pass};
pub use uniform::{Member, Uniform};
pub use uniforms::{FrameUniforms, SettingsUniforms, layouts};

/// The wgpu that this release is built for.
pub use wgpu;
