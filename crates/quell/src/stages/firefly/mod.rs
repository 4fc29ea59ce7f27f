//! Stage 6: a 3x3 median. A firefly spread by sparse taps is isolated bright pixels on a spiral: just what it kills.
//!
//! | | |
//! |---|---|
//! | reads | matte blended and passes, guides (which neighbours are surfaces) |
//! | writes | matte without fireflies |
//! | border | 1 pixel |
//! | equation | out = the median of the 3x3 neighbourhood, per channel, or of luminance |
//! | source | \[S], \[E] per channel; `docs/paper.md`, stage 6 |
//! | parameters | `firefly.*` |
//!
//! Passes take the value of the very pixel that the beauty's channel took, so that they still add up. Neighbours that
//! are background or off screen are replaced by the centre.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;
