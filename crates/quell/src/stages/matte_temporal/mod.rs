//! Stage 3: the matte signal blended with its history, fetched where the surface was.
//!
//! | | |
//! |---|---|
//! | reads | matte signal and passes, matte history, history length N, feature buffers now and before, the host's `confidence_in` |
//! | writes | matte temporal, confidence, the new history length min(rho N + 1, 4096) |
//! | changed light | where `changed_light` is on: N is first shortened as `kernels/change.rs` says; written beside N: the fast history F' = v F + (1 - v) luminance of c, v = rho min(`fast`, N / (N + 1)) |
//! | reach | 1 pixel of history around the reprojected place; `clip_radius` pixels of the current signal; with `changed_light` up to 8 `radius` + 7 pixels of history around the pixel's own place |
//! | equation | out = w h + (1 - w) c, w = rho min(alpha, N / (N + 1)) (without `ramp`: rho alpha); confidence = rho min(1, N / `surface.confidence_frames`); h clamped to the neighbourhood of c where `clip` says so |
//! | source | \[E, S, I] `docs/paper.md`, stage 3 |
//! | parameters | `matte_temporal.*`, `surface.*`, `changed_light.*` |
//!
//! rho, the trust in history, is where disocclusion is detected: `kernels/reproject.rs` compares the surface that motion leads to with the one
//! that was there (`surface.plane_distance` and what stands beside it), takes from it where only part of the footprint shows the
//! surface (`surface.lost_footprint`), and the host's `confidence_in` multiplies it.
//!
//! Background and pixels without history take the current value. Their confidence is 0, that of background 1: nothing
//! there needs help.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Signal;
use crate::reach::Reach;
use crate::settings::Settings;

/// How far the stage looks.
pub(crate) fn reach(s: &Settings) -> Reach {
    let footprint = 1 + s.changed_light.reach_px(Signal::Matte);
    Reach { frames: 1, footprint, ..Reach::around(s.matte_temporal.clip_radius as usize) }
}
