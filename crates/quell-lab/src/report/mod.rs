//! What a run says about itself: one JSON object, a table in the terminal, a page to look at, a strip for a README.
//!
//! ```text
//! json.rs    `Report`: the one JSON type (interfaces.md, section 5)
//! comparison.rs  the page of a comparison
//! figures.rs every figure of a comparison: tables, CSV, LaTeX
//! table.rs   metrics and stage times as text
//! player.rs  the self-contained page
//! strip.rs   the animated picture
//! ```

pub mod comparison;
pub mod figures;
pub mod json;
pub mod player;
pub mod strip;
pub mod table;

pub use json::{FrameStatus, Machine, MethodScores, Report, Sanitised, Spread, StageTime, Status};
