//! Frames of a sequence as the stages read them: feature buffers, samples in half precision, bands of rows.
//!
//! ```text
//! features.rs    feature buffers of a frame
//! light_means/   means of the light around each pixel, and how sure they are
//! local.rs       slopes and noise beside them; which of them a light's filter reads
//! background.rs  the background as mirrors show it, less its noise
//! mirrors.rs     which pixels are mirrors or clear glass, and the colour of what they show
//! prepared.rs    a frame made ready: its feature buffers and its light
//! packed.rs      colours in half precision
//! rows.rs        images of many channels, row by row
//! sparse.rs      images that hold in most places what is known without them
//! vectors.rs     motion in half precision
//! spool.rs       frames as bytes outside of memory, read back in bands of rows
//! ```
//!
//! A band of rows knows where it lies in the picture ([`Features::first_row`]), so that every stage gives the bits that
//! it gives for the whole picture.

mod background;
pub(crate) mod features;
pub(crate) mod light_means;
pub(crate) mod local;
mod mirrors;
pub(crate) mod packed;
pub(crate) mod prepared;
pub(crate) mod rows;
mod sparse;
pub(crate) mod spool;
mod vectors;

pub use features::{Features, Motion, MotionPlanes, SurfacePoint};
pub use local::{Class, LocalFeatures};
pub(crate) use packed::{Packed, Weight};
pub(crate) use prepared::Samples;
pub use prepared::{LightSlot, PreparedFrame};
pub use rows::{HalfRows, Rows};
pub use sparse::Sparse;
pub use spool::SpooledFrame;
pub use vectors::Vectors;
