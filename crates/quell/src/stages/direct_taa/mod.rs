//! Stage 11: temporal anti-aliasing of direct light. Off where the frame has no jitter.
//!
//! | | |
//! |---|---|
//! | reads | direct light, its history, depth, motion, the host's confidence |
//! | writes | direct light, anti-aliased: shown, and the next frame's history |
//! | reach | 1 pixel; 1 of history around the reprojected place |
//! | equation | out = w clamp(h) + (1 - w) c; w = `history` confidence_in max(0, 1 - motion / `motion_falloff`) / (1 + `clamp_falloff` change) |
//! | source | \[S] "TAA on direct term", details \[E]: `docs/paper.md`, stage 11 |
//! | parameters | `direct_taa.*` |
//!
//! History is limited to the range in 3x3 (Karis 2014): jitter moves a sample by half a pixel at most, so what history may hold
//! lies in a neighbour; the size is no parameter.
//!
//! Motion is that of the nearest depth in 3x3, so that silhouettes carry their own anti-aliasing along.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;

/// How far the stage looks.
pub(crate) fn reach() -> Reach {
    Reach { frames: 1, footprint: 1, ..Reach::around(1) }
}
