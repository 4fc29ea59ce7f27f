//! Stage 5: where history is missing or young, the smooth estimate of stage 4 takes the place of the temporal one.
//!
//! | | |
//! |---|---|
//! | reads | matte temporal, matte prefiltered (each with passes), confidence |
//! | writes | matte blended; the same with at least `feedback_floor` of the prefiltered: the next frame's history by default (`pipeline.feedback = blend`) |
//! | reach | `radius` + `blur` pixels |
//! | equation | k = blur(max over (2 radius + 1)^2 of (1 - confidence)); out = lerp(temporal, prefiltered, max(k, floor)) |
//! | source | \[S] that it exists; the action is ours \[O], `docs/paper.md`, stage 5 |
//! | parameters | `disocclusion.*` |
//!
//! What is disoccluded is decided in stages 3 and 8, by the thresholds `surface.*` of `kernels/reproject.rs`; here its confidence acts.
//!
//! The maximum comes first, so that the band around a fresh region is covered whole before its edge is softened.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;
use crate::settings::Disocclusion;

/// How far the stage looks.
pub(crate) fn reach(s: &Disocclusion) -> Reach {
    Reach::around((s.radius + s.blur) as usize)
}
