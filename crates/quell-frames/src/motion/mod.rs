//! Motion vectors: what a renderer's numbers mean, and how to find out.

mod convention;
mod find;

pub use convention::{Direction, MotionConvention, Unit};
pub use find::{MotionEvidence, MotionGuides, find_motion};
