//! What can go wrong in the lab.

use quell::Size;
use std::path::PathBuf;

/// Every error of the lab.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Two pictures that belong together differ in extent.
    #[error("`{what}` is {found}, but {expected} was expected")]
    Size {
        /// Which picture.
        what: &'static str,
        /// Extent expected.
        expected: Size,
        /// Extent found.
        found: Size,
    },
    /// Nothing to measure: no pixel, no frame, or no light.
    #[error("{what}")]
    Empty {
        /// What is missing.
        what: String,
    },
    /// A picture could not be encoded.
    #[error("cannot encode a picture of {size}: {reason}")]
    Encode {
        /// Its extent.
        size: Size,
        /// The encoder's answer.
        reason: String,
    },
    /// A file of the cache is not what it should be.
    #[error("{}: {reason}; delete it to start this reference afresh", .path.display())]
    Cache {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A report could not be turned into JSON.
    #[error("cannot write the report as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// No method has this name.
    #[error("no method is called `{name}`{}", crate::error::did_you_mean(.nearest))]
    UnknownMethod {
        /// As it was asked for.
        name: String,
        /// The nearest names.
        nearest: Vec<String>,
    },
    /// A method cannot work on what it was given.
    #[error("{method}: {reason}")]
    Method {
        /// Its name.
        method: String,
        /// What it misses, and what to do.
        reason: String,
    },
    /// The denoiser refused a frame or a setting.
    #[error(transparent)]
    Quell(#[from] quell::Error),
    /// The GPU, or the denoiser on it.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] quell_host::Error),
    /// The tracer on the GPU.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    GpuTracer(quell_trace::gpu::GpuError),
    /// Tracing failed or was stopped.
    #[error(transparent)]
    Trace(#[from] quell_trace::TraceError),
    /// Reading or writing a file failed; names the file.
    #[error(transparent)]
    File(#[from] quell_frames::Error),
}

#[cfg(feature = "gpu")]
impl From<quell_trace::gpu::GpuError> for Error {
    fn from(error: quell_trace::gpu::GpuError) -> Self {
        match error {
            quell_trace::gpu::GpuError::Trace(error) => Self::Trace(error),
            error => Self::GpuTracer(error),
        }
    }
}

impl Error {
    pub(crate) fn same_size(what: &'static str, found: Size, expected: Size) -> Result<(), Self> {
        if expected.pixels() == 0 {
            return Err(Self::Empty { what: format!("a picture of {expected} has no pixels to measure") });
        }
        if found == expected { Ok(()) } else { Err(Self::Size { what, expected, found }) }
    }
}

pub(crate) fn did_you_mean(nearest: &[String]) -> String {
    if nearest.is_empty() { String::new() } else { format!("; did you mean {}?", nearest.join(", ")) }
}
