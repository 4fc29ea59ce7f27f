//! Where light has changed: what stages 3 and 8 ask before they trust the light of history.
//!
//! Beside the long mean S each pixel has a fast one, F, of luminance: the same samples, most of them of the last few
//! frames. While light rests both have the same mean. Over a window of `radius` taps on each side along both axes, `spacing` pixels apart:
//!
//! | | |
//! |---|---|
//! | frames of a tap | n = min(N, 1 / (1 - alpha)), of its fast mean m = 1 / (1 - fast) |
//! | its weight | g = max(0, 1 - m / n): what has few frames has the same in both means |
//! | means | s = sum g S / sum g, f = sum g F / sum g |
//! | noise of one tap's F | v = max(sum g (F - f)^2, (n' / m) sum g (S - s)^2) / sum g, n' the mean of n |
//! | deviation | d^2 = v sum g^2 / (sum g)^2 + (`least` (s + f))^2 |
//! | changed | c = clamp((abs(f - s) / d - `begin`) / (`certain` - `begin`), 0, 1); 0 where sum g < 1 or the pixel's own g is 0 |
//!
//! N and F are rounded as they are kept, on every back end: N to 13 significant bits (whole lengths stay), F to 6, from 2^-47 to 2^16, below
//! it is 0. So a GPU keeps both in one number (`gpu/storage.rs`), and no back end sees more than another.
//!
//! The variance of F shows the noise of light that has come up, the variance of S, n / m times smaller, that of light so rare
//! that no frame of F may have met it: so what is dark by chance is no change. `least` keeps history whole where noise is low: few
//! frames would do there, but nothing calls for it.

use super::math::luminance;
use super::reproject::Lookup;
use crate::frame::{Rgb, Signal};
use crate::par;
use crate::plane::Plane;
use crate::settings::ChangedLight;

/// The detector of one signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Most that history counts in the fast mean.
    pub fast: f32,
    /// Frames of a fast mean: 1 / (1 - fast).
    pub fast_frames: f32,
    /// Most frames of a long mean: 1 / (1 - alpha).
    pub long_frames: f32,
    /// Deviations from which light counts as changed.
    pub begin: f32,
    /// One over the deviations from there on to certainty.
    pub slope: f32,
    /// A difference that counts as one deviation, of the sum of both means.
    pub least: f32,
    /// Taps on each side along an axis.
    pub radius: u32,
    /// Pixels between taps.
    pub spacing: u32,
}

/// Under these weights of all taps together nothing is known.
pub const LEAST_TAPS: f32 = 1.0;
/// Keeps quotients finite where all is black.
pub const LEAST_VARIANCE: f32 = 1e-30;
/// Least width of the transition, deviations.
const LEAST_WIDTH: f32 = 1e-3;
/// Largest luminance of the fast history: that of a half-precision float.
pub const MOST_LIGHT: f32 = 65504.0;

/// The upper 14 bits of the float 2^-47: light as dark as that is kept as 0.
pub const DARKEST: u32 = (127 - 47) << LIGHT_BITS;
/// Bits of a kept luminance's fraction, without the leading one.
const LIGHT_BITS: u32 = 5;
/// The same of a kept length.
const LENGTH_BITS: u32 = 12;

/// The float nearest to `value` whose fraction has `bits` bits, the even one of two.
#[inline(always)]
fn rounded(value: f32, bits: u32) -> f32 {
    let drop = 23 - bits;
    let own = value.to_bits();
    f32::from_bits((own + ((1 << drop) / 2 - 1) + ((own >> drop) & 1)) >> drop << drop)
}

/// A history length, 1..4096, as it is kept.
#[inline(always)]
pub fn rounded_length(length: f32) -> f32 {
    rounded(length, LENGTH_BITS)
}

/// A luminance, 0..65504, as the fast history keeps it.
#[inline(always)]
pub fn rounded_light(light: f32) -> f32 {
    let light = rounded(light, LIGHT_BITS);
    if light.to_bits() >> (23 - LIGHT_BITS) > DARKEST { light } else { 0.0 }
}

/// The luminance of a colour that the fast history takes in.
#[inline(always)]
pub fn kept_light(colour: Rgb) -> f32 {
    let light = luminance(colour);
    let light = if light > 0.0 { light } else { 0.0 };
    if light < MOST_LIGHT { light } else { MOST_LIGHT }
}

/// The pixel of a lookup that counts most, the first of equals.
#[inline]
pub fn nearest(lookup: &Lookup) -> usize {
    let mut best = 0;
    for k in 1..4 {
        if lookup.weight[k] > lookup.weight[best] {
            best = k;
        }
    }
    lookup.index[best]
}

impl ChangedLight {
    /// How far the detector of a signal looks in history, pixels.
    pub(crate) fn reach_px(&self, signal: Signal) -> usize {
        let is_on = match signal {
            Signal::Matte => self.matte,
            Signal::Glossy => self.glossy,
        };
        if is_on { (self.radius * self.spacing) as usize } else { 0 }
    }
}

impl Change {
    /// For a long mean in which history counts at most `alpha`.
    pub fn new(s: &ChangedLight, alpha: f32) -> Self {
        Self {
            fast: s.fast,
            fast_frames: 1.0 / (1.0 - s.fast),
            long_frames: 1.0 / (1.0 - alpha),
            begin: s.begin,
            slope: 1.0 / (s.certain - s.begin).max(LEAST_WIDTH),
            least: s.least,
            radius: s.radius,
            spacing: s.spacing,
        }
    }

    /// Frames of a pixel's long mean.
    #[inline(always)]
    pub fn frames(&self, length: f32) -> f32 {
        if length < self.long_frames { length } else { self.long_frames }
    }

    /// The weight of a tap whose long mean has so many frames.
    #[inline(always)]
    pub fn weight(&self, frames: f32) -> f32 {
        let weight = 1.0 - self.fast_frames / frames;
        if weight > 0.0 { weight } else { 0.0 }
    }

    /// c from the deviations by which the means differ.
    #[inline(always)]
    pub fn certainty(&self, deviations: f32) -> f32 {
        let c = (deviations - self.begin) * self.slope;
        let c = if c < 1.0 { c } else { 1.0 };
        if c > 0.0 { c } else { 0.0 }
    }

    /// c, 0..1, for every pixel of a frame from its signal, history length and fast history: the specification.
    pub fn of_history(&self, signal: &Plane<Rgb>, length: &Plane<f32>, fast: &Plane<f32>) -> Plane<f32> {
        let size = signal.size();
        let (radius, spacing) = (self.radius as isize, self.spacing as isize);
        par::plane(size, |x, y| {
            let mut taps = Vec::new();
            for (dx, dy) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy))) {
                let (qx, qy) = (x as isize + dx * spacing, y as isize + dy * spacing);
                if size.contains(qx, qy) {
                    let (qx, qy) = (qx as usize, qy as usize);
                    let frames = self.frames(length.at(qx, qy));
                    let light = luminance(signal.at(qx, qy));
                    taps.push([self.weight(frames), frames, light, fast.at(qx, qy)].map(f64::from));
                }
            }
            let total: f64 = taps.iter().map(|[g, ..]| g).sum();
            if total < f64::from(LEAST_TAPS) || self.weight(self.frames(length.at(x, y))) <= 0.0 {
                return 0.0;
            }
            let mean = |k: usize| taps.iter().map(|t| t[0] * t[k]).sum::<f64>() / total;
            let [frames, long, quick] = [1, 2, 3].map(mean);
            let spread = |k: usize, m: f64| taps.iter().map(|t| t[0] * (t[k] - m).powi(2)).sum::<f64>() / total;
            let of_long = spread(2, long) * frames / f64::from(self.fast_frames);
            let noise = spread(3, quick).max(of_long);
            let squares: f64 = taps.iter().map(|[g, ..]| g * g).sum();
            let floor = f64::from(self.least) * (long + quick);
            let variance = noise * squares / (total * total) + floor * floor + f64::from(LEAST_VARIANCE);
            self.certainty(((quick - long).abs() / variance.sqrt()) as f32)
        })
    }
}
