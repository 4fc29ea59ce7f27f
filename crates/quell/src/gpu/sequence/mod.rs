//! The sequence filter on the GPU: all stages but the motion of reflections and the sums, with the frames of a window and their pictures
//! kept on the device.
//!
//! ```text
//! passes.rs     what each pass binds
//! uniforms.rs   what it reads besides planes
//! kernels.rs    all of them, compiled
//! window.rs     frames of a window in arrays of textures, buffers for the frame at work
//! schedule.rs   the order of a frame's dispatches, and what each binds
//! residual.rs   stage `residual`, of lights and of the picture
//! wavelet.rs    stage 3 alone: its levels, and bands of rows where a picture does not fit
//! debug.rs      what these hold, as pictures
//! finish/       stages `stabilise` to `blend`, with the pictures of neighbouring frames
//! ```

mod debug;
mod finish;
mod kernels;
mod passes;
mod residual;
mod schedule;
mod uniforms;
mod wavelet;
mod window;

pub use debug::SequenceView;
pub use finish::Finished;
pub use kernels::SequenceKernels;
pub use schedule::{Estimated, SequenceStage};
pub use wavelet::{Band, SequenceWavelet, WaveletBuffers};
pub use window::SequenceWindow;

pub(super) use debug::{
    DEBUG_PASSES, SHOWS_COLOUR, SHOWS_COUNT, SHOWS_DEPTH, SHOWS_DEVIATION, SHOWS_LIGHT, SHOWS_NOISE, SHOWS_SAMPLES,
};
pub(super) use finish::{LAST_LAYER, MOST_VISITS, SHARE_NET};
pub(super) use uniforms::*;
