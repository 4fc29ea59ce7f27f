//! A host for [`quell::gpu::Denoiser`], which itself is a pure guest: it finds a device, uploads frames, submits, waits and
//! reads back, so that a program whose frames lie in memory can use the GPU like any back end.
//!
//! ```text
//! adapter.rs    which adapters there are, and which one is meant
//! device.rs     the device, its queue, and what goes wrong with them
//! bandwidth.rs  how many bytes a second the device moves
//! denoiser.rs   frames in, frames out
//! part.rs       one tile of them: upload, encode, read back
//! tiles.rs      how frames larger than the device's textures are cut
//! manifest.rs   shaders as files with all that a host in another language needs to know
//! sequence.rs   stages of the filter of sequences
//! trial.rs      frames to try such a host with, as files
//! error.rs      every error
//! ```

mod adapter;
mod bandwidth;
mod denoiser;
mod device;
mod error;
pub mod manifest;
mod part;
mod sequence;
mod tiles;
pub mod trial;

pub use adapter::{Adapter, Wanted, adapters};
pub use bandwidth::copy_speed;
pub use denoiser::{Denoiser, Ran, Tiling};
pub use device::Gpu;
pub use error::Error;
pub use sequence::SequenceAccelerator;
