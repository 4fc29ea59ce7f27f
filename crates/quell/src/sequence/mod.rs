//! Offline: whole sequences of other renderers, filtered with the past and the future in view.
//!
//! ```text
//! frame.rs       what a frame brings: any number of lights, guides that may be noisy or absent
//! settings.rs    every parameter, declared once; the preset `sequence`
//! denoiser.rs    frames in, filtered frames out; the order of the stages
//! member.rs      a frame of the window, made ready
//! guides.rs      guides made ready: slopes of depth, unit normals, how noisy they are themselves
//! reflections.rs what mirrors show moves by itself: its motion, found by matching
//! follow.rs      stage 1: where a pixel's surface lies in the other frames
//! accumulate.rs  stage 1: the samples met there, averaged
//! variance.rs    stage 2: the variance of that average
//! wavelet.rs     stage 3: edge-avoiding a-trous levels with a luminance stop
//! energy.rs      how unlike two pixels' guides are
//! accelerator.rs what a host may run elsewhere, such as on a GPU: the wavelet alone, or
//! estimate.rs    stages 1 to 3, with the frames of the window kept there (the .wgsl files are twins of the Rust ones)
//! stabilise.rs   stage 4: neighbours in time, limited to the local range
//! spool.rs       frames outside of memory, read back in bands of rows
//! packed.rs      colours of frames that wait, in half precision
//! rows.rs, simd.rs  images of many channels; row loops on wide vectors
//! ```
//!
//! Each frame is estimated from a window of frames around it, never from a filtered predecessor: any split of a job
//! gives the same bits, and the first frame is as clean as the rest.

mod accelerator;
mod accumulate;
mod denoiser;
mod energy;
mod estimate;
mod follow;
pub mod frame;
mod guides;
mod member;
mod packed;
mod reflections;
mod rows;
pub mod settings;
mod simd;
mod spool;
mod stabilise;
mod variance;
mod wavelet;

pub use accelerator::{AcceleratedWindow, Accelerator, Guide, WaveletJob, WaveletLight};
pub use denoiser::{Filtered, FilteredLight, PreparedFrame, SequenceDenoiser};
pub use estimate::{EstimateJob, FramePlane, GatheredLight, OnCpu, Place, WindowFrame};
pub use frame::{Light, LightKind, SequenceFrame};
pub use settings::{SEQUENCE_PARAMETERS, SequenceSettings};
pub use spool::SpooledFrame;
