//! Stage 11 on runs of pixels.

use crate::kernels::clip::ColourBox;
use crate::kernels::math::luminance;
use crate::kernels::reproject_cpu::{LANES, Lanes, Lanes3};
use crate::settings::DirectTaa;

/// How much history may count at motions of given speed, before the clamp is known; 0: no history. `coordinate`: the
/// place in the previous image, of extent `size`.
#[inline(always)]
pub(crate) fn trust(
    settings: &DirectTaa,
    falloff_px: f32,
    motion: &[Lanes; 2],
    coordinate: &[Lanes; 2],
    size: (f32, f32),
    trusted: &Lanes,
    out: &mut Lanes,
) {
    for i in 0..LANES {
        let speed = (motion[0][i] * motion[0][i] + motion[1][i] * motion[1][i]).sqrt();
        let slow = 1.0 - speed / falloff_px;
        let slow = if slow > 0.0 { slow } else { 0.0 };
        let trust = settings.history * slow * trusted[i];
        let (x, y) = (coordinate[0][i], coordinate[1][i]);
        // Unknown motion compares false everywhere.
        let inside = (x >= 0.0) & (y >= 0.0) & (x <= size.0) & (y <= size.1);
        out[i] = if inside & (trust > 0.0) { trust } else { 0.0 };
    }
}

/// The blend with the clamped history.
#[inline(always)]
pub(crate) fn resolve(
    settings: &DirectTaa,
    trust: &Lanes,
    now: &Lanes3,
    fetched: &Lanes3,
    bounds: (&Lanes3, &Lanes3),
    out: &mut Lanes3,
) {
    for i in 0..LANES {
        let at = |v: &Lanes3| [v[0][i], v[1][i], v[2][i]];
        let (current, then) = (at(now), at(fetched));
        let clamped = ColourBox { low: at(bounds.0), high: at(bounds.1) }.clamp(then);
        let change = (luminance(clamped) - luminance(then)).abs();
        let (a, b) = (luminance(clamped).abs(), luminance(then).abs());
        let scale = if b > a { b } else { a };
        let relative = if scale > 0.0 { change / scale } else { 0.0 };
        let w = trust[i] / (1.0 + settings.clamp_falloff * relative);
        for c in 0..3 {
            let blended = w * clamped[c] + (1.0 - w) * current[c];
            out[c][i] = if trust[i] > 0.0 { blended } else { current[c] };
        }
    }
}
