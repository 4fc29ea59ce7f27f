//! Offline: whole sequences of other renderers, filtered with the past and the future in view.
//!
//! Each frame is estimated from a window of frames around it, never from a filtered predecessor: any split of a job
//! gives the same bits, and the first frame is as clean as the rest.

pub mod frame;

pub use frame::{Light, LightKind, SequenceFrame};
