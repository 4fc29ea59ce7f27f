//! Stage 4: the wide sparse bilateral filter over the accumulated matte signal.
//!
//! | | |
//! |---|---|
//! | reads | matte temporal and passes, guides |
//! | writes | matte prefiltered, which stage 5 reads; the next frame's history where `pipeline.feedback` is `prefilter` |
//! | reach | `radius` pixels (scaled by rows / 720) |
//! | equation | out = (c + sum_i w_i c_i) / (1 + sum_i w_i), w = Gaussian * w_z w_n w_p w_g (`kernels/edge.rs`) |
//! | source | \[S, E] `docs/paper.md`, stage 4 |
//! | parameters | `matte_prefilter.*`, `edge.*` |
//!
//! The footprint is too big for a full kernel, and separating it gives strong artefacts: so a spiral of sparse taps
//! (`kernels/spiral.rs`). Background passes through.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::kernels::spiral::SpiralShape;
use crate::reach::Reach;
use crate::settings::MattePrefilter;

/// How far the stage looks in a picture of `rows` rows.
pub(crate) fn reach(s: &MattePrefilter, rows: usize) -> Reach {
    Reach::around(SpiralShape::farthest(|frame| SpiralShape::prefilter(s, rows, frame)))
}
