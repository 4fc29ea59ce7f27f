//! Stage 6: a value that exceeds `threshold` times the median of its 3x3 neighbourhood becomes that median. A firefly spread
//! by sparse taps is isolated bright pixels on a spiral: those exceed it.
//!
//! | | |
//! |---|---|
//! | reads | matte blended (`firefly.input = temporal`: matte temporal) and passes, guides (which neighbours are surfaces) |
//! | writes | matte without fireflies |
//! | reach | 1 pixel |
//! | equation | out = m where c > `threshold` m, else c; m the median of 3x3, per channel, or of luminance; `plain`: out = m |
//! | source | \[S], \[E] per channel; the threshold is ours; `docs/paper.md`, stage 6 |
//! | parameters | `firefly.*` |
//!
//! Passes take the value of the very pixel that the beauty's channel took, so that they still add up. Neighbours that
//! are background or off screen count as the centre. Background passes through.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;

/// How far the stage looks.
pub(crate) fn reach() -> Reach {
    Reach::around(1)
}

/// Rank of the median among nine.
pub(crate) const MIDDLE: usize = 4;
