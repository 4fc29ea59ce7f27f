//! Metrics, reports, the player page and the cache of references.
//!
//! ```text
//! metrics/   how far a picture is from its reference: relMSE, PSNR, energy, FLIP and HDR-FLIP
//! tone.rs    the one tone curve of every picture that is looked at, and PNG
//! report/    the JSON report, the table in the terminal, the player page, the animated strip
//! cache.rs   references on disk: found by hash, resumed, never half written
//! ```

pub mod cache;
pub mod error;
pub mod metrics;
pub mod report;
pub mod tone;

pub use error::Error;
