//! Stage 7: the second wide sparse bilateral filter, with another permutation of the spiral.
//!
//! | | |
//! |---|---|
//! | reads | matte after the median and passes, guides |
//! | writes | matte filtered: what the composite shows |
//! | reach | `radius` pixels (scaled by rows / 720); of the depths for the contact stop, 8 pixels |
//! | equation | as stage 4 |
//! | source | \[S, E] `docs/paper.md`, stage 7 |
//! | parameters | `matte_bilateral.*`, `edge.*` |

pub mod reference;

use crate::kernels::edge::contact_reach;
use crate::kernels::spiral::SpiralShape;
use crate::reach::Reach;
use crate::settings::Settings;

/// How far the stage looks in a picture of `rows` rows.
pub(crate) fn reach(s: &Settings, rows: usize) -> Reach {
    let spiral = SpiralShape::farthest(|frame| SpiralShape::bilateral(&s.matte_bilateral, rows, frame));
    Reach::around(spiral.max(contact_reach(&s.edge)))
}
