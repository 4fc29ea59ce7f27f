//! Everything that can keep a picture from being shown, in words for its user.

use quell_trace::environment::EnvironmentError;
use quell_trace::environment::file::EnvironmentFileError;
use quell_trace::gpu::GpuError;
use std::path::PathBuf;

/// Why there is no picture, or no new one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// No built-in scene of this name, or one that cannot be traced.
    #[error(transparent)]
    Scene(#[from] quell_trace::SceneError),
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] quell_trace::gltf::GltfError),
    /// A picture that cannot surround a scene.
    #[error(transparent)]
    Environment(#[from] EnvironmentFileError),
    /// The same: its texels times its strength are no light.
    #[error("{}: {}", .0.display(), .1)]
    Surround(PathBuf, EnvironmentError),
    /// The tracer: the scene is beyond a limit of the device, or uses what the GPU's tracer lacks.
    #[error("{0}")]
    Tracer(GpuError),
    /// The denoiser.
    #[error(transparent)]
    Denoiser(#[from] quell::gpu::Error),
    /// Pictures that the device cannot hold.
    #[error("pictures of {size} are beyond this device's textures ({limit} pixels a side)")]
    Size {
        /// What was asked for.
        size: quell::Size,
        /// Most pixels a side.
        limit: u32,
    },
    /// Nothing was opened yet.
    #[error("no scene is open")]
    NoScene,
    /// The camera looks at nothing: its place or direction is not finite.
    #[error("this camera cannot be used: {0}")]
    Camera(&'static str),
    /// A file could not be fetched.
    #[error("{0}")]
    Read(String),
    /// A file could not be written.
    #[error("{0}")]
    Write(String),
    /// What the device reports.
    #[error("{0}")]
    Device(String),
}

impl From<GpuError> for LiveError {
    fn from(error: GpuError) -> Self {
        match error {
            // The command's word for it does not exist here.
            GpuError::TooLarge { what, needed, limit } => Self::Device(format!(
                "the scene's {what} take {needed} bytes, and this device gives {limit} to one buffer: `quell render` traces it on \
                 the CPU"
            )),
            other => Self::Tracer(other),
        }
    }
}
