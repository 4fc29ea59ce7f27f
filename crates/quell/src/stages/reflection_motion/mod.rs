//! Sequence filter: the motion of what mirrors and clear glass show. It is not the surface's, and no file holds it.
//!
//! | | |
//! |---|---|
//! | reads | albedo and normal seen in mirrors and through glass (Cycles' `Denoising Albedo`, `Denoising Normal`) of two neighbouring frames; motion of their surfaces |
//! | writes | motion of reflections, both ways; at other pixels the surface's |
//! | reach | the whole picture: done before a frame is cut into bands |
//! | equation | least mean of min(\|a - b\|^2, most) over 7x7 of mirror, plus a cost of departing from the surface's motion; parabola between pixels |
//! | source | block matching over a pyramid; ours: `docs/sequence.md` |
//!
//! Coarse to fine: at the coarsest level every offset near the surface's motion is tried, at finer ones what the level above
//! found there and beside. Where nothing is to be told apart, the surface's own motion stays.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::plane::Plane;

/// Motion of reflections between two neighbouring frames, in pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct ReflectionMotion {
    /// From the later frame to the earlier; `None`: that of surfaces is unknown.
    pub to_previous: Option<Plane<[f32; 2]>>,
    /// From the earlier frame to the later.
    pub to_next: Option<Plane<[f32; 2]>>,
}

/// Levels halve the picture until one side is shorter than twice this.
pub(crate) const COARSEST: usize = 40;
/// Offsets tried at the coarsest level, each way.
pub(crate) const SEARCH: i32 = 3;
/// Half the side of the compared patches.
pub(crate) const PATCH: i32 = 3;
/// The most that one pixel of a patch may differ by: edges of what is seen cover and uncover.
pub(crate) const MOST_DIFFERENCE: f32 = 0.25;
/// What a pixel of departure from the surface's motion costs, squared, at the level where it is taken.
pub(crate) const DEPARTURE: f32 = 2e-5;
/// Another motion than the surface's must be better by this factor.
pub(crate) const SURFACE_BONUS: f32 = 0.7;
/// Another offset than the one found at the level above, likewise.
pub(crate) const STAY: f32 = 0.95;
/// Pixels of mirror that a patch must hold: what is thin tells nothing.
pub(crate) const LEAST_PATCH: usize = 30;
/// Share of mirror in a coarse pixel from which it takes part.
pub(crate) const LEAST_SHARE: f32 = 0.5;
