//! A host for quell's GPU back end. [`quell::gpu`] only encodes into the caller's encoder; this crate finds a device,
//! uploads frames, submits, waits and reads back. A program whose frames lie in memory can so use a GPU like any other
//! back end.
//!
//! - [`Denoiser`]: the real-time filter, [`quell::Denoiser`]'s twin.
//! - [`SequenceAccelerator`]: stages of the sequence filter, for [`quell::sequence::SequenceDenoiser`].
//! - [`manifest`]: the back end's shaders as files, for hosts in other languages.
//!
//! ```no_run
//! # fn filter(frame: &quell::Frame<'_>, settings: &quell::Settings, size: quell::Size) -> Result<(), quell_host::Error> {
//! let gpu = std::sync::Arc::new(quell_host::Gpu::open(quell_host::Wanted::Any)?);
//! let mut denoiser = quell_host::Denoiser::new(gpu, size, settings)?;
//! let output = denoiser.denoise(frame)?;
//! # let _ = output.composite;
//! # Ok(())
//! # }
//! ```
//!
//! ```text
//! adapter.rs    which adapters there are, and which one is meant
//! device.rs     the device, its queue, and what goes wrong with them
//! bandwidth.rs  how many bytes a second the device moves
//! denoiser.rs   frames in, frames out
//! part.rs       one tile of them: upload, encode, unpack
//! readback.rs   results, copied and mapped together
//! tiles.rs      how frames larger than the device's textures are cut
//! manifest.rs   shaders as files with all that a host in another language needs to know
//! sequence.rs   stages of the filter of sequences
//! views.rs      its debug views, as pictures
//! error.rs      every error
//! ```

mod adapter;
mod bandwidth;
mod denoiser;
mod device;
mod error;
pub mod manifest;
mod part;
mod readback;
mod sequence;
mod tiles;
mod views;

pub use adapter::{Adapter, Wanted, adapters};
pub use bandwidth::copy_speed;
pub use denoiser::{Denoiser, Memory, Ran, Tiling};
pub use device::Gpu;
pub use error::Error;
pub use readback::Readback;
pub use sequence::SequenceAccelerator;
pub use views::{SequencePicture, ShowSequence};
