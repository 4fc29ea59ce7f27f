//! Sequence filter: the motion of what mirrors and clear glass show. It is not the surface's, and no file holds it.
//!
//! | | |
//! |---|---|
//! | reads | albedo and normal seen in mirrors and through glass (Cycles' `Denoising Albedo`, `Denoising Normal`) of two neighbouring frames; motion of their surfaces |
//! | writes | motion of reflections, both ways; at other pixels the surface's |
//! | reach | none that bands must know: it runs on whole pictures, before a frame is cut into bands |
//! | equation | the offset o that minimises mean min(\|a(p) - b(p + o)\|^2, `most_difference`) + `departure` \|o - surface's motion\|^2 over the pixels p of a patch that show a mirror; the surface's motion counts `surface_bonus` of its cost; then a median over 3x3, and a parabola between pixels |
//! | parameters | `reflections.*` |
//! | source | block matching over a pyramid; ours: `docs/sequence.md` |
//!
//! The real-time filter finds reflections from hit distances instead: `kernels/mirror_image.rs`.
//!
//! Coarse to fine: at the coarsest level every offset near the surface's motion is tried, at finer ones what the level above
//! found there and beside. Where nothing is to be told apart, the surface's own motion stays.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::plane::Plane;
use crate::reach::Reach;

/// Motion of reflections between two neighbouring frames, in pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct ReflectionMotion {
    /// From the later frame to the earlier; `None`: that of surfaces is unknown.
    pub to_previous: Option<Plane<[f32; 2]>>,
    /// From the earlier frame to the later.
    pub to_next: Option<Plane<[f32; 2]>>,
}

/// How far the stage looks.
pub(crate) fn reach() -> Reach {
    Reach { whole_picture: true, ..Reach::NONE }
}
