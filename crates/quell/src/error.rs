//! What can go wrong, each with the quantity, the value and the plane.

use crate::plane::Size;

/// Every error of the denoiser. None of them leaves the denoiser in a changed state.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An extent is 0.
    #[error("image size {size} has no pixels; both extents must be at least 1")]
    EmptySize {
        /// The size given.
        size: Size,
    },
    /// An extent is beyond what the denoiser can index.
    #[error("image size {size} is too large; each extent may be at most {limit}")]
    SizeTooLarge {
        /// The size given.
        size: Size,
        /// Largest extent.
        limit: usize,
    },
    /// The system refuses the memory that images of this size need.
    #[error(
        "images of {size} need at least {:.1} GiB, which this system refuses; take a smaller size",
        *.bytes as f64 / (1u64 << 30) as f64
    )]
    Memory {
        /// The size given.
        size: Size,
        /// What it takes at the least, in bytes.
        bytes: u64,
    },
    /// A slice does not hold the rows it is said to hold.
    #[error("a plane of {size} with a stride of {stride} does not fit {len} elements")]
    PlaneLength {
        /// The extent given.
        size: Size,
        /// Elements from row to row.
        stride: usize,
        /// Elements in the slice.
        len: usize,
    },
    /// A plane's extent differs from the frame's.
    #[error("plane `{plane}` is {found}, but the denoiser was made for {expected}")]
    PlaneSize {
        /// Name of the plane.
        plane: String,
        /// Extent expected.
        expected: Size,
        /// Extent found.
        found: Size,
    },
    /// What a host runs on a device failed ([`crate::sequence::Accelerator`]); the filter gave up the frames inside it.
    #[error("{name}: {reason}")]
    Accelerator {
        /// What computes.
        name: String,
        /// Its words.
        reason: String,
    },
    /// A pass names a signal that the frame does not have.
    #[error("pass `{pass}` is tied to the {signal} signal, which the frame does not have")]
    PassWithoutSignal {
        /// Name of the pass.
        pass: String,
        /// Name of the signal.
        signal: &'static str,
    },
    /// A camera cannot be used.
    #[error("{which} cannot be used: its clip_from_world matrix is singular or not finite")]
    Camera {
        /// `camera` or `previous_camera`.
        which: &'static str,
    },
    /// A parameter that does not exist.
    #[error("unknown parameter `{name}`{}", nearest_hint(.nearest))]
    UnknownParameter {
        /// The name given.
        name: String,
        /// Names that are close to it.
        nearest: Vec<String>,
    },
    /// A parameter's value is not of its kind or out of its range.
    #[error("parameter `{name}`: `{value}` is not {expected}")]
    ParameterValue {
        /// The parameter.
        name: String,
        /// The value given.
        value: String,
        /// What would be accepted.
        expected: String,
    },
    /// A preset that does not exist.
    #[error("unknown preset `{name}`; there are: {known}")]
    UnknownPreset {
        /// The name given.
        name: String,
        /// All presets.
        known: String,
    },
}

fn nearest_hint(nearest: &[String]) -> String {
    if nearest.is_empty() { String::new() } else { format!("; did you mean {}?", nearest.join(", ")) }
}
