//! Stage 8: the glossy signal blended with its history, fetched where the mirror image was.
//!
//! | | |
//! |---|---|
//! | reads | glossy signal and passes, glossy history, history length, hit distance, guides now and before |
//! | writes | glossy temporal (which is the next frame's history), confidence, history length |
//! | changed light | as stage 3 |
//! | reach | 1 pixel of history around the virtual place, 2 below `spline_roughness`; 1 of the hit distance; `clip_radius` of the signal; with `changed_light` up to 8 `radius` + 7 pixels of history around the pixel's own place |
//! | equation | blend as stage 3; history at the projection of X + d v (reflector at rest), or of the hit point mirrored in its previous plane; on curved ones where the previous eye ray was reflected to the hit point |
//! | source | \[E, S, I] `docs/paper.md`, stage 8 |
//! | parameters | `glossy_temporal.*`, `surface.*`, `changed_light.*` |
//!
//! Without hit distance history is fetched where the surface was, as in stage 3; with it, d is
//! the hit distance after `glossy_temporal.hit_filter` over 3x3 of the same reflector.
//! Trust is the product of two tests: the surface was visible (at x + motion), and the virtual place lies on the same
//! reflector.
//!
//! Every fetch between pixels blurs, frame after frame, what polished surfaces show. Below `glossy_temporal.spline_roughness`, where all four
//! pixels around the place show the reflector, colours are fetched by Catmull and Rom's spline, and held to the range of those four
//! as part of the clamp, so that passes still add up.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Signal;
use crate::reach::Reach;
use crate::settings::Settings;

/// How far the stage looks.
pub(crate) fn reach(s: &Settings) -> Reach {
    let spline = usize::from(s.glossy_temporal.spline_below() > 0.0);
    let footprint = 1 + spline + s.changed_light.reach_px(Signal::Glossy);
    // 1: the hit distance around the pixel.
    Reach { frames: 1, footprint, ..Reach::around(s.glossy_temporal.clip_radius.max(1) as usize) }
}
