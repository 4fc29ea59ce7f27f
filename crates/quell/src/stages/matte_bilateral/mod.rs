//! Stage 7: the second wide sparse bilateral filter, with another permutation of the spiral.
//!
//! | | |
//! |---|---|
//! | reads | matte after the median and passes, guides |
//! | writes | matte filtered: what the composite shows |
//! | border | `radius` pixels (scaled by rows / 720) |
//! | equation | as stage 4 |
//! | source | \[S, E] `docs/paper.md`, stage 7 |
//! | parameters | `matte_bilateral.*`, `edge.*` |

pub mod reference;
