//! Methods side by side on identical frames (evaluation.md, sections 1, 2 and 4).
//!
//! ```text
//! sequence.rs  noisy frames in order, and references of some of them
//! scene.rs     a sequence from a scene: rendered, kept, continued where it stopped
//! folder.rs    a sequence from files
//! runner.rs    one method over all frames: pictures, times, memory; kept and resumed
//! judge.rs     picture metrics and scorecard of what a method delivered
//! statistics.rs  means over seeds
//! memory.rs    the largest memory that a method holds
//! ```

pub mod folder;
pub mod judge;
pub mod memory;
pub mod runner;
pub mod scene;
pub mod sequence;
pub mod statistics;

pub use folder::FolderSource;
pub use judge::{Judge, Verdict};
pub use runner::{Finished, Runner};
pub use scene::SceneSource;
pub use sequence::{NoisyFrame, ReferenceHalf, Sequence, SequenceReference};
