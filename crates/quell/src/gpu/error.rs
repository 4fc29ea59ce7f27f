//! What can go wrong with a pass before the GPU sees it.

use crate::plane::Size;

/// Every error of the GPU back end. None of them leaves anything half done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Another number of buffers than the pass has bindings.
    #[error("pass `{pass}` takes {expected} buffers, but got {found}")]
    BufferCount {
        /// The pass.
        pass: &'static str,
        /// What it takes.
        expected: usize,
        /// What it was given.
        found: usize,
    },
    /// A buffer cannot hold its plane.
    #[error("pass `{pass}`: buffer `{binding}` holds {found} bytes; a plane of {size} needs {needed}")]
    BufferSize {
        /// The pass.
        pass: &'static str,
        /// The binding.
        binding: &'static str,
        /// The image's extent.
        size: Size,
        /// Bytes needed.
        needed: u64,
        /// Bytes there.
        found: u64,
    },
    /// A buffer lacks a usage.
    #[error("pass `{pass}`: buffer `{binding}` was made without the usage {usage}")]
    BufferUsage {
        /// The pass.
        pass: &'static str,
        /// The binding.
        binding: &'static str,
        /// What it lacks.
        usage: &'static str,
    },
    /// A setting, a size or a camera that no back end takes.
    #[error(transparent)]
    Denoiser(#[from] crate::Error),
    /// An extent of 0, or a plane or a dispatch beyond the device's limits.
    #[error("pass `{pass}`: images of {size} are beyond this device's limits ({limit})")]
    Size {
        /// The pass.
        pass: &'static str,
        /// The image's extent.
        size: Size,
        /// Which limit.
        limit: &'static str,
    },
}
