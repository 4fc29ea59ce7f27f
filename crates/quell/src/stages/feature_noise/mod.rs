//! Sequence filter: slopes of depth, and how noisy the feature buffers are themselves.
//!
//! | | |
//! |---|---|
//! | reads | feature buffers of the frame ([`Features`](crate::sequence::Features)) |
//! | writes | [`LocalFeatures`](crate::window::LocalFeatures) |
//! | reach | 2 rows: neighbours in 3x3, and theirs where a band ends |
//! | equation | slope: of the two one-sided differences of 1/z the smaller; noise: over four directions the least of \|a - 2 p + b\| / 2 p (1/z), and of \|(a + b) / 2 - p\|^2 / 2 (normals: about 1 - cosine), a and b the neighbours to both sides |
//! | source | ours: `docs/sequence.md` |
//!
//! Along an edge a clean feature buffer is smooth; where it is smooth in no direction it is noisy (depth of field, motion blur,
//! hair), and its edge-stopping function is loosened by that much.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;

/// Added to the first channel of the albedo seen in mirrors and clear glass, where tone-mapped colours lie in 0..2: light that was
/// divided by what it shows does not mix with light that was not (at `wavelet.seen_albedo` up to 1, far above its default).
pub(crate) const DIVIDED: f32 = 8.0;

/// How far the stage looks.
pub(crate) fn reach() -> Reach {
    Reach::around(2)
}
