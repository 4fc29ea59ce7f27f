//! The sequence filter, offline: frames of other renderers, filtered with the past and the future in view.
//!
//! ```text
//! frame.rs       the contract: any number of lights, feature buffers that may be noisy or absent; what comes out
//! settings.rs    every parameter, declared once; the preset `sequence`
//! pipeline.rs    the order of the stages (in `crate::stages`), what each reads and writes, how far it looks
//! run.rs         the walk along that order on one back end
//! denoiser.rs    frames in, filtered frames out
//! accelerator.rs what a host may run on a device: the wavelet alone, or
//! estimate.rs    gather to residual, with the frames of the window kept there, and
//! finish.rs      stabilise to blend
//! planes.rs      planes of frames as a device takes them
//! ```
//!
//! Frames of the window as the stages read them: `crate::window`.
//!
//! Each frame is estimated from a window of frames around it, never from a filtered predecessor: any split of a job
//! gives the same bits, and the first frame is as clean as the rest.

mod accelerator;
#[cfg(all(test, feature = "cpu"))]
mod agreement;
mod denoiser;
mod estimate;
mod finish;
pub mod frame;
pub mod pipeline;
mod planes;
mod run;
pub mod settings;
#[cfg(all(test, feature = "cpu"))]
pub(crate) mod testing;

#[cfg(feature = "internals")]
pub use crate::window::{Features, LightSlot, Motion, MotionPlanes, Sparse, SurfacePoint, Vectors};
pub use crate::window::{PreparedFrame, SpooledFrame};
pub use accelerator::Accelerator;
pub use denoiser::SequenceDenoiser;
pub use frame::{Filtered, FilteredLight, Light, LightKind, SequenceFrame};
pub use pipeline::{SequencePlan, SequenceStage};
#[cfg(all(feature = "internals", feature = "cpu"))]
pub use run::BlendView;
pub(crate) use run::SequenceStages;
pub use settings::{SEQUENCE_PARAMETERS, SequencePreset, SequenceSettings};

/// What a device is handed, for hosts that run stages on one ([`Accelerator`]), and for tests.
#[allow(unused_imports, reason = "without the feature `internals` few are used")]
mod device {
    pub use super::accelerator::{AcceleratedWindow, Guide, WaveletJob, WaveletLight};
    pub use super::estimate::{EstimateJob, GatheredLight, LightPlace, OnCpu, WindowFrame};
    pub use super::finish::{FinishJob, FinishedOnCpu, PictureFrame};
    pub use super::planes::FramePlane;
    pub use crate::window::{Features, LightSlot, Motion, MotionPlanes, Sparse, SurfacePoint, Vectors};
}
#[cfg(feature = "internals")]
pub use device::*;
#[cfg(not(feature = "internals"))]
#[allow(unused_imports, reason = "which ones are used depends on the other features")]
pub(crate) use device::*;

#[cfg(all(test, feature = "cpu"))]
pub(crate) use run::stages_of;
