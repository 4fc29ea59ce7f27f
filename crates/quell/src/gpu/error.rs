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
    /// A texture's format does not fit its plane.
    #[error("plane `{plane}` is a texture of {format:?}; it needs {expected}")]
    TextureFormat {
        /// The plane.
        plane: &'static str,
        /// The texture's format.
        format: wgpu::TextureFormat,
        /// What would do.
        expected: &'static str,
    },
    /// A texture lacks a usage.
    #[error("the texture of plane `{plane}` was made without the usage {usage}")]
    TextureUsage {
        /// The plane.
        plane: &'static str,
        /// What it lacks.
        usage: &'static str,
    },
    /// A texture is multisampled, or not two-dimensional.
    #[error(
        "the texture of plane `{plane}` must be two-dimensional with one sample a texel (it has {samples}); resolve it first"
    )]
    TextureKind {
        /// The plane.
        plane: &'static str,
        /// Its samples.
        samples: u32,
    },
    /// A texture is smaller than the frame.
    #[error("the texture of plane `{plane}` is {found}, smaller than the frame's {size}")]
    TextureSize {
        /// The plane.
        plane: &'static str,
        /// The frame's extent.
        size: Size,
        /// The texture's.
        found: Size,
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
