//! The scorecard: ten figures for the artefacts of a denoised sequence (docs/scorecard.md).
//!
//! ```text
//! score.rs        a score, and the ten of them
//! bands.rs        Gaussians, plain and edge-stopping; the fine band and the band of blotches
//! surfaces.rs     what the feature buffers show: same surface or not, where it was a frame ago
//! history.rs      a pixel's past: its age, the stale light of a history without rejection
//! fit.rs          least squares with the reference's halves as instruments
//! instruments.rs  all that depends on the references only
//! measure.rs      a result against the instruments
//! lag.rs          how long indirect light takes to follow a change of the lamps
//! injection.rs    artefacts of known kind and strength, by which the definitions are tried
//! matrix.rs       what each score answers to each artefact, at equal HDR-FLIP
//! ```
//!
//! [`Instruments`] are made once a sequence, from the references and the noise-free guides; [`Instruments::score`] then
//! reads any number of results against them.

mod bands;
mod fit;
mod history;
pub mod injection;
mod instruments;
mod lag;
mod light;
pub mod matrix;
mod measure;
pub mod score;
mod surfaces;

pub use instruments::{Instruments, ReferenceFrame};
pub use score::{Score, Scores};
