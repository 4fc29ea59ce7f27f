//! Where light has changed: what stages 3 and 8 ask before they trust the light of history.
//!
//! Beside the long mean S each pixel has a fast one, F, of luminance: the same samples, most of them of the last few
//! frames. While light rests both have the same mean. Sums are taken over cells of 8x8 pixels of the frame before, on every
//! `spacing`-th pixel along both axes; each pixel weighs the cells around its own place by a tent:
//!
//! | | |
//! |---|---|
//! | frames of a tap | n = min(N, 1 / (1 - alpha)), of its fast mean m = 1 / (1 - fast) |
//! | its weight | g = max(0, 1 - m / n): what has few frames has the same in both means |
//! | of a cell | G = sum g, s = sum g S / G, f = sum g F / G |
//! | noise of one tap's F | v = max(sum g (F - S - f + s)^2, (n' / m) sum g (S - s)^2) / G, n' = sum g n / G |
//! | weight of a cell | w = t(x) t(y), t = max(0, 1 - d / (8 `radius`)), d the distance from its centre in pixels along an axis |
//! | deviation | d^2 = sum w^2 G v / (sum w G)^2 + (`least` (s' + f'))^2, s' and f' the means of s and f with weights w G |
//! | changed | c = clamp((abs(f' - s') / d - `begin`) / (`certain` - `begin`), 0, 1); 0 where sum w G < 1 |
//! | history of N frames | becomes N (1 - c min(1, 4 g)), g the weight of N |
//!
//! N and F are rounded as they are kept, on every back end: N to 13 significant bits (whole lengths stay), F to 6, from 2^-47 to 2^16, below
//! it is 0. So a GPU keeps both in one number (`gpu/storage.rs`), and no back end sees more than another.
//!
//! Many taps find a change in the noise of one path a pixel, in a frame or two. The variance of F - S shows the noise of light that
//! has come up, and not the light's own shape, which both means have. The variance of S, n / m times smaller, shows the noise of light so
//! rare that no frame of F may have met it: so what is dark by chance is no change. Taken cell by cell, both leave out how light differs
//! from cell to cell. `least` keeps history whole where noise is low: few frames would do there, but nothing calls for it. The window lies
//! around the pixel's own place in the picture, not around where its surface was: it is far wider than motion.

use super::math::luminance;
use crate::frame::{Rgb, Signal};
use crate::par;
use crate::plane::{Plane, Size};
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
    /// Half the width of the window, cells.
    pub radius: u32,
    /// Pixels between taps.
    pub spacing: u32,
}

/// Pixels of a cell along each side: those of a workgroup.
pub const CELL: usize = 8;
/// History counts as changed with its surroundings from this part of a tap's full weight on: one over this.
pub const OWN: f32 = 4.0;

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

impl ChangedLight {
    /// How far the detector of a signal looks in history, pixels.
    pub(crate) fn reach_px(&self, signal: Signal) -> usize {
        let is_on = match signal {
            Signal::Matte => self.matte,
            Signal::Glossy => self.glossy,
        };
        if is_on { CELL * (self.radius as usize + 1) - 1 } else { 0 }
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

    /// The history that is left of `length` frames where light has changed by c.
    #[inline(always)]
    pub fn left(&self, length: f32, changed: f32) -> f32 {
        let own = OWN * self.weight(self.frames(length));
        let own = if own < 1.0 { own } else { 1.0 };
        length * (1.0 - changed * own)
    }

    /// t: along an axis the weight of a cell whose centre lies so far off, pixels.
    #[inline(always)]
    pub fn tent(&self, distance: f32) -> f32 {
        let weight = 1.0 - distance.abs() * (1.0 / (CELL as f32 * self.radius as f32));
        if weight > 0.0 { weight } else { 0.0 }
    }

    /// c, 0..1, for every pixel from the signal, history length and fast history of the frame before: the specification.
    pub fn of_history(&self, signal: &Plane<Rgb>, length: &Plane<f32>, fast: &Plane<f32>) -> Plane<f32> {
        let size = signal.size();
        let cells = Size::new(size.width.div_ceil(CELL), size.height.div_ceil(CELL));
        // G, s, f and v of each.
        let sums = par::plane(cells, |cx, cy| {
            let mut taps = Vec::new();
            let offsets = || (0..CELL).step_by(self.spacing as usize);
            for (x, y) in offsets().flat_map(|dy| offsets().map(move |dx| (CELL * cx + dx, CELL * cy + dy))) {
                if x < size.width && y < size.height {
                    let frames = self.frames(length.at(x, y));
                    let light = luminance(signal.at(x, y));
                    taps.push([self.weight(frames), frames, light, fast.at(x, y)].map(f64::from));
                }
            }
            let total: f64 = taps.iter().map(|[g, ..]| g).sum();
            if total <= 0.0 {
                return [0.0; 4];
            }
            let mean = |k: usize| taps.iter().map(|t| t[0] * t[k]).sum::<f64>() / total;
            let [frames, long, quick] = [1, 2, 3].map(mean);
            let spread =
                |of: fn(&[f64; 4]) -> f64, m: f64| taps.iter().map(|t| t[0] * (of(t) - m).powi(2)).sum::<f64>() / total;
            let of_quick = spread(|[_, _, long, quick]| quick - long, quick - long);
            let of_long = spread(|[_, _, long, _]| *long, long) * frames / f64::from(self.fast_frames);
            [total, long, quick, of_quick.max(of_long)]
        });
        par::plane(size, |x, y| {
            let centre = |cell: usize| (CELL * cell) as f32 + (CELL - 1) as f32 / 2.0;
            let [mut total, mut long, mut quick, mut noise] = [0.0; 4];
            for (cx, cy) in (0..cells.height).flat_map(|cy| (0..cells.width).map(move |cx| (cx, cy))) {
                let w = self.tent(centre(cx) - x as f32) * self.tent(centre(cy) - y as f32);
                if w > 0.0 {
                    let (w, [g, s, f, v]) = (f64::from(w), sums.at(cx, cy));
                    total += w * g;
                    long += w * g * s;
                    quick += w * g * f;
                    noise += w * w * g * v;
                }
            }
            if total < f64::from(LEAST_TAPS) {
                return 0.0;
            }
            let (long, quick) = (long / total, quick / total);
            let floor = f64::from(self.least) * (long + quick);
            let variance = noise / (total * total) + floor * floor + f64::from(LEAST_VARIANCE);
            self.certainty(((quick - long).abs() / variance.sqrt()) as f32)
        })
    }
}
