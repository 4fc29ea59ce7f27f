//! Stage 4: the wide sparse bilateral filter over the accumulated matte signal.
//!
//! | | |
//! |---|---|
//! | reads | matte temporal and passes, guides |
//! | writes | matte prefiltered, which stage 5 reads; the next frame's history where `pipeline.feedback` is `prefilter` |
//! | reach | `radius` pixels (scaled by rows / 720); of the depths for the contact stop, 8 pixels |
//! | equation | out = (c + sum_i w_i c_i) / (1 + sum_i w_i), w = Gaussian * w_z w_n w_p w_g, where `edge.contact` is above 0 times the contact stop (`kernels/edge.rs`) |
//! | source | \[S, E] `docs/paper.md`, stage 4 |
//! | parameters | `matte_prefilter.*`, `edge.*` |
//!
//! The footprint is too big for a full kernel, and separating it gives strong artefacts: so a spiral of sparse taps
//! (`kernels/spiral.rs`). Background passes through.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::kernels::edge::contact_reach;
use crate::kernels::spiral::SpiralShape;
use crate::reach::Reach;
use crate::settings::Settings;

/// How far the stage looks in a picture of `rows` rows.
pub(crate) fn reach(s: &Settings, rows: usize) -> Reach {
    let spiral = SpiralShape::farthest(|frame| SpiralShape::prefilter(&s.matte_prefilter, rows, frame));
    Reach::around(spiral.max(contact_reach(&s.edge)))
}
