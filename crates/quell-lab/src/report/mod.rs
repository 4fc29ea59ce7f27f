//! What a run says about itself: one JSON object, a table in the terminal, a page to look at, a strip for a README.
//!
//! ```text
//! json.rs        `Report`: the one JSON type (interfaces.md, section 5)
//! table.rs       metrics and stage times as text
//! figures.rs     every figure of a comparison: tables, CSV, LaTeX
//! comparison.rs  the page of a comparison
//! player.rs      the page of a sequence
//! doctor.rs      the page of the doctor
//! document.rs    a page to read: tables and figures
//! template.rs    places in a page's file
//! strip.rs       the animated picture
//! ```

pub mod comparison;
pub mod doctor;
pub mod document;
pub mod figures;
pub mod json;
pub mod player;
pub mod strip;
pub mod table;
mod template;

pub use json::{FrameStatus, Machine, MethodScores, Report, Sanitised, Spread, StageTime, Status};
