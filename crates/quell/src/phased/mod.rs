//! Images of the real-time filter's fast back end: rows in phase order, so that the sparse taps of a run of pixels are a run of
//! memory. What stages and kernels compute on vectors is loaded from and stored to these.
//!
//! ```text
//! layout.rs    the order of pixels: four interleaved column phases a row; colours of a signal and its passes
//! guides.rs    feature buffers in that order, repaired as the border does
//! rows.rs      loops over rows of several images at once
//! ```

pub(crate) mod guides;
pub(crate) mod layout;
pub(crate) mod rows;
