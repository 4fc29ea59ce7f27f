//! Metrics, reports, the player page and the cache of references.
//!
//! ```text
//! metrics/       how far a picture is from its reference: relMSE, PSNR, energy, FLIP and HDR-FLIP
//! scorecard/     ten figures for the artefacts of a sequence: blur, ghosting, flicker, boiling and so on
//! compare/       methods side by side: sequences with references, the runner, scores
//! methods/       everything that is compared: the noisy input, quell, the baselines
//! reproduce/     what the talk's slides show, made anew
//! tone.rs        the one tone curve of every picture that is looked at, and PNG
//! report/        the JSON report, the table in the terminal, the player page, the animated strip
//! backend.rs     which back end filters frames that lie in memory
//! tracer.rs      which tracer makes frames and references
//! trial.rs       frames as files, to try a host in another language with (feature `gpu`)
//! whole_frame.rs a frame traced and denoised on one GPU, pass by pass (feature `gpu`)
//! cache.rs       references on disk: found by hash, never half written
//! references.rs  converges a reference in two halves, through the cache, continued where it stopped
//! ```

pub mod backend;
pub mod cache;
pub mod compare;
pub mod error;
pub mod methods;
pub mod metrics;
pub mod references;
pub mod report;
pub mod reproduce;
pub mod scorecard;
pub mod tone;
pub mod tracer;
#[cfg(feature = "gpu")]
pub mod trial;
#[cfg(feature = "gpu")]
pub mod whole_frame;

pub use error::Error;
