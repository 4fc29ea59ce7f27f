//! Why the GPU's tracer cannot make a picture.

use crate::tracer::TraceError;

/// Why the GPU's tracer cannot make a picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The scene, the camera or the size cannot be used by any tracer.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The scene does not fit in the device's buffers.
    #[error("the scene's {what} take {needed} bytes, and this device's limit is {limit}; --backend cpu traces it")]
    TooLarge {
        /// Which part of the scene.
        what: &'static str,
        /// Its bytes.
        needed: u64,
        /// As many as the device gives to one binding.
        limit: u64,
    },
}
