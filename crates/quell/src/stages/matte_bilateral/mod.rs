//! Stage 7: the second wide sparse bilateral filter, with another permutation of the spiral.
//!
//! | | |
//! |---|---|
//! | reads | matte after the median and passes, guides |
//! | writes | matte filtered: what the composite shows |
//! | reach | `radius` pixels (scaled by rows / 720) |
//! | equation | as stage 4 |
//! | source | \[S, E] `docs/paper.md`, stage 7 |
//! | parameters | `matte_bilateral.*`, `edge.*` |

pub mod reference;

use crate::kernels::spiral::SpiralShape;
use crate::reach::Reach;
use crate::settings::MatteBilateral;

/// How far the stage looks in a picture of `rows` rows.
pub(crate) fn reach(s: &MatteBilateral, rows: usize) -> Reach {
    Reach::around(SpiralShape::farthest(|frame| SpiralShape::bilateral(s, rows, frame)))
}
