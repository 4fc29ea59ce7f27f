//! What can go wrong with a pass before the GPU sees it.

use crate::plane::Size;

/// Every error of the GPU back end. None of them leaves anything half done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Another number of resources than the pass has bindings.
    #[error("pass `{pass}` takes {expected} resources, but got {found}")]
    Count {
        /// The pass.
        pass: &'static str,
        /// What it takes.
        expected: usize,
        /// What it was given.
        found: usize,
    },
    /// A resource of another kind: a buffer for a texture, or a texture of another dimension.
    #[error("pass `{pass}`: `{binding}` must be {expected}")]
    Kind {
        /// The pass.
        pass: &'static str,
        /// The binding.
        binding: &'static str,
        /// What it takes.
        expected: &'static str,
    },
    /// A texture cannot hold its plane.
    #[error("pass `{pass}`: texture `{binding}` is {found}; the frame needs {needed}")]
    TextureSize {
        /// The pass.
        pass: &'static str,
        /// The binding.
        binding: &'static str,
        /// The frame's extent.
        needed: Size,
        /// The texture's.
        found: Size,
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
    /// A texture of another format.
    #[error("pass `{pass}`: texture `{binding}` has the format {found:?}; it must be {expected}")]
    Format {
        /// The pass.
        pass: &'static str,
        /// The binding.
        binding: &'static str,
        /// What it takes.
        expected: &'static str,
        /// What it was given.
        found: wgpu::TextureFormat,
    },
    /// A resource lacks a usage.
    #[error("pass `{pass}`: `{binding}` was made without the usage {usage}")]
    Usage {
        /// The pass.
        pass: &'static str,
        /// The binding.
        binding: &'static str,
        /// What it lacks.
        usage: &'static str,
    },
    /// A tile, or an area of one, that lies beyond its picture or not where tiles can.
    #[error(
        "an area of {size} at {origin:?} does not lie in its tile or picture ({whole}); tiles begin at multiples of 4"
    )]
    Tile {
        /// Where it begins in the picture.
        origin: [u32; 2],
        /// Its extent.
        size: Size,
        /// The picture's.
        whole: Size,
    },
    /// A margin from a denoiser that is no neighbour.
    #[error("a tile takes its margin from a tile of the same picture and frame, whose denoiser has the same options")]
    Neighbour,
    /// A debug view of what the last frame did not make.
    #[error("there is no {image} to show: the last frame did not make it")]
    DebugImage {
        /// What was asked for.
        image: &'static str,
    },
    /// A debug view of an image whose texture another one has by now.
    #[error(
        "{image} cannot be shown: another image has its texture by now; make the denoiser with Options::share_planes off"
    )]
    DebugShared {
        /// What was asked for.
        image: &'static str,
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
    /// Resources were not reserved before they were asked for.
    #[error("pass `{pass}`: nothing was reserved for this job")]
    Missing {
        /// The pass.
        pass: &'static str,
    },
}
