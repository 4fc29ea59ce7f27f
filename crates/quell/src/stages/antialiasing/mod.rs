//! Temporal anti-aliasing of the picture, in place of stage 11, which smooths direct light alone: indirect light is accumulated in
//! stages 3 and 8, but its colours and its silhouettes are those of one sample a pixel. Off where the frame has no jitter.
//!
//! | | |
//! |---|---|
//! | reads | the sum, its history and how many frames that holds, depth, motion, the host's confidence |
//! | writes | the picture, anti-aliased: shown, and the next frame's history |
//! | reach | 1 pixel; 2 of history around the reprojected place |
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

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;
use crate::settings::Antialiasing;

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

/// How far the stage looks.
pub(crate) fn reach() -> Reach {
    Reach { frames: 1, footprint: 2, ..Reach::around(1) }
}
