//! Sequence filter: slopes of depth, and how noisy the feature buffers are themselves.
//!
//! | | |
//! |---|---|
//! | reads | feature buffers of the frame ([`Features`](crate::sequence::Features)) |
//! | writes | [`LocalFeatures`](crate::window::LocalFeatures) |
//! | reach | 2 rows: neighbours in 3x3, and theirs where a band ends |
//! | equation | slope: of the two one-sided differences of 1/z the smaller; noise: over four directions the least \|a - 2 p + b\|, relative to p (depth), as 1 - cosine (normal) |
//! | source | ours: `docs/sequence.md` |
//!
//! Along an edge a clean feature buffer is smooth; where it is smooth in no direction it is noisy (depth of field, motion blur,
//! hair), and its edge-stopping function is loosened by that much.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;

/// Added to the albedo seen in mirrors and clear glass, beyond what tone-mapped colours (0..2) and any tolerance bridge:
/// light that was divided by what it shows never mixes with light that was not.
pub(crate) const APART: f32 = 8.0;

/// How far the stage looks.
pub fn reach() -> Reach {
    Reach::around(2)
}
