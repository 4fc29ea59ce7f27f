//! Temporal anti-aliasing of the picture, in place of stage 11, which smooths direct light alone: indirect light is accumulated in
//! stages 3 and 8, but its colours and its silhouettes are those of one sample a pixel. Off where the frame has no jitter.
//!
//! | | |
//! |---|---|
//! | reads | the sum, its history and how many frames that holds, depth, motion, the host's confidence |
//! | writes | the picture, anti-aliased: shown, and the next frame's history |
//! | reach | `thin_radius` pixels, 1 at least; 2 of history around the reprojected place |
//! | equation | out = (1 - a) clamp(h) + a c; a = max(1 / (n + 1), `least` + 2 `resampling` (u (1 - u) + v (1 - v))) |
//! | source | Karis (SIGGRAPH 2014), Salvi (GDC 2016); a final stage after denoising as in SVGF (Schied et al. 2017); a: ours |
//! | parameters | `antialiasing.*` |
//!
//! h is fetched by Catmull and Rom's spline (Catmull and Rom 1974), (u, v) its place between pixels: every fetch between them blurs a
//! little, so that history counts less there. n is how many frames it holds, less where the clamp had to change it:
//! n = confidence_in n' / (1 + `change_falloff` change).
//!
//! Colours are averaged as they are, not by weights that fall with brightness: the mean over the pixel's area is what a picture of many
//! samples tends to, and energy is kept.
//!
//! Motion is that of the nearest depth in 3x3, so that silhouettes carry their own anti-aliasing along.
//!
//! The clamp holds history to the mean and deviation of 3x3 new pixels (Salvi). Where none of their samples hit a wire thinner than a
//! pixel, this would forget it: wires became rows of dots. So the box also holds the colours of all nearer surfaces within
//! `thin_radius`, of those only that move as history was fetched, else moving silhouettes would leave copies behind.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;
use crate::settings::Antialiasing;
use glam::Vec2;

/// Share of the new frame where history holds `frames` and lies at `(u, v)` between pixels.
#[inline(always)]
pub(crate) fn share(frames: f32, [u, v]: [f32; 2], s: &Antialiasing) -> f32 {
    let between = 2.0 * (u * (1.0 - u) + v * (1.0 - v));
    (1.0 / (frames + 1.0)).max(s.least + s.resampling * between).min(1.0)
}

/// Frames that count of `frames`, where the clamp took a luminance from `before` to `after`.
#[inline(always)]
pub(crate) fn believed(frames: f32, before: f32, after: f32, s: &Antialiasing) -> f32 {
    let scale = before.abs().max(after.abs());
    let change = if scale > 0.0 { (after - before).abs() / scale } else { 0.0 };
    frames / (1.0 + s.change_falloff * change)
}

/// Whether a surface at `depth` stands before one at `farthest`, the farthest of 3x3 pixels: a pixel there may hold both.
#[inline(always)]
pub(crate) fn stands_before(depth: f32, farthest: f32, s: &Antialiasing) -> bool {
    depth * (1.0 + s.thin_depth) < farthest
}

/// Whether what moved by `moved` was, in the history that `motion` leads to, where it is now. Unknown motion was not.
#[inline(always)]
pub(crate) fn moves_with(moved: Vec2, motion: Vec2, s: &Antialiasing) -> bool {
    let apart = (moved - motion).abs();
    apart.x <= s.thin_motion && apart.y <= s.thin_motion
}

/// How far the stage looks.
pub(crate) fn reach(s: &Antialiasing) -> Reach {
    Reach { frames: 1, footprint: 2, ..Reach::around((s.thin_radius as usize).max(1)) }
}
