//! What the offline methods share: images with margins, colour in halves, features, non-local means.
//!
//! ```text
//! image.rs     one channel with a margin, read past the edge as the edge
//! noisy.rs     colour in two halves, its variance, the features of a frame
//! weights.rs   non-local means: weights by offsets, and the filter
//! solve.rs     normal equations of many pixels at a time
//! ```

pub mod image;
pub mod noisy;
pub mod solve;
pub mod weights;

#[cfg(test)]
mod tests;
