//! What stages 3 and 8 share once they know where history lies: fetch, clamp, blend.

use super::change::{Change, rounded_length};
use super::clip::{ColourBox, follow, shareable};
use super::math::{catmull_rom, three};
use super::reproject::Lookup;
use crate::border::Guides;
use crate::frame::Rgb;
use crate::plane::{Plane, Size};
use crate::settings::{Clip, Settings};

/// The part of a temporal stage's parameters that blends.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    /// Most that history may count.
    pub alpha: f32,
    /// N / (N + 1) at first.
    pub ramp: bool,
    /// Clamp of history.
    pub clip: Clip,
    /// Its radius, pixels.
    pub clip_radius: u32,
    /// Its width, standard deviations.
    pub clip_gamma: f32,
    /// History length of full confidence, frames.
    pub confidence_frames: f32,
    /// The detector of changed light; `None`: off, and no fast history.
    pub change: Option<Change>,
    /// Most that history counts in the fast mean; 0 without the detector.
    pub fast: f32,
}

impl Blend {
    /// Of stage 3.
    pub fn matte(settings: &Settings) -> Self {
        let s = &settings.matte_temporal;
        let change = settings.changed_light.matte.then(|| Change::new(&settings.changed_light, s.alpha));
        Self {
            alpha: s.alpha,
            ramp: s.ramp,
            clip: s.clip,
            clip_radius: s.clip_radius,
            clip_gamma: s.clip_gamma,
            confidence_frames: settings.surface.confidence_frames,
            change,
            fast: change.map_or(0.0, |change| change.fast),
        }
    }

    /// Of stage 8.
    pub fn glossy(settings: &Settings) -> Self {
        let s = &settings.glossy_temporal;
        let change = settings.changed_light.glossy.then(|| Change::new(&settings.changed_light, s.alpha));
        Self {
            alpha: s.alpha,
            ramp: s.ramp,
            clip: s.clip,
            clip_radius: s.clip_radius,
            clip_gamma: s.clip_gamma,
            confidence_frames: settings.surface.confidence_frames,
            change,
            fast: change.map_or(0.0, |change| change.fast),
        }
    }

    /// How much history counts, the confidence, and the new history length, from trust rho and the old
    /// length N. `DETECTS`: the detector is on; without it the length is not rounded and there is no fast share.
    #[inline(always)]
    pub fn weigh<const DETECTS: bool>(&self, trust: f32, length: f32) -> Weighed {
        // Without branches, for loops over lanes.
        let none = (trust <= 0.0) | (length <= 0.0);
        let growing = length / (length + 1.0);
        let alpha = if self.ramp { self.alpha.min(growing) } else { self.alpha };
        let longer = (trust * length + 1.0).min(LONGEST_HISTORY);
        let longer = if DETECTS { rounded_length(longer) } else { longer };
        let fast = if DETECTS { trust * self.fast.min(growing) } else { 0.0 };
        Weighed {
            history: if none { 0.0 } else { trust * alpha },
            fast: if none { 0.0 } else { fast },
            confidence: if none { 0.0 } else { trust * (length / self.confidence_frames).min(1.0) },
            length: if none { 1.0 } else { longer },
        }
    }

    /// The clamp's box at pixel (x, y): of the surfaces within the radius, in the unfiltered current signal.
    #[inline]
    pub fn colour_box(&self, current: &Plane<Rgb>, guides: &Guides, x: usize, y: usize) -> ColourBox {
        let r = self.clip_radius as usize;
        let size = current.size();
        let rows = y.saturating_sub(r)..(y + r + 1).min(size.height);
        let columns = x.saturating_sub(r)..(x + r + 1).min(size.width);
        let neighbours = rows
            .flat_map(|ty| columns.clone().map(move |tx| (tx, ty)))
            .filter(|&(tx, ty)| guides.is_surface(tx, ty))
            .map(|(tx, ty)| current.at(tx, ty));
        ColourBox::of(neighbours, self.clip, self.clip_gamma)
    }
}

/// Frames after which history is counted no further.
pub const LONGEST_HISTORY: f32 = 4096.0;

/// How one pixel blends.
#[derive(Clone, Copy, Debug)]
pub struct Weighed {
    /// Share of history, 0..1.
    pub history: f32,
    /// Share of the fast history in what becomes the new one, 0..1.
    pub fast: f32,
    /// Confidence, 0..1.
    pub confidence: f32,
    /// New history length, frames.
    pub length: f32,
}

/// 4x4 previous pixels and their weights.
struct Spline {
    /// The second of them in reading order along both axes: the first of the footprint.
    first: [usize; 2],
    along: [f32; 4],
    across: [f32; 4],
}

impl Spline {
    /// `None`: not asked for, or the pixels reach beyond the image.
    #[inline(always)]
    fn of(lookup: &Lookup, size: Size) -> Option<Self> {
        if !lookup.spline {
            return None;
        }
        let [_, b, c, d] = lookup.weight;
        let k = (0..4).find(|k| lookup.weight[*k] > 0.0)?;
        let (x, y) = (lookup.index[k] % size.width - (k & 1), lookup.index[k] / size.width - (k >> 1));
        let inside = x >= 1 && y >= 1 && x + 2 < size.width && y + 2 < size.height;
        inside.then(|| Self { first: [x, y], along: catmull_rom(b + d), across: catmull_rom(c + d) })
    }
}

/// What history shows at the place: the weighted mean of up to four previous pixels, or Catmull and Rom's spline through 4x4 of
/// them. Linear in the colours.
#[inline(always)]
pub fn fetch_colour(history: &Plane<Rgb>, lookup: &Lookup) -> Rgb {
    let Some(Spline { first: [x, y], along, across }) = Spline::of(lookup, history.size()) else {
        return fetch(history, lookup);
    };
    let mut sum = [0.0; 3];
    for (j, across) in across.into_iter().enumerate() {
        for (i, along) in along.into_iter().enumerate() {
            let colour = history.at(x + i - 1, y + j - 1);
            for c in 0..3 {
                sum[c] += along * across * colour[c];
            }
        }
    }
    sum
}

/// What [`fetch_colour`] fetched, held to the range of the four pixels around the place: the spline may overshoot.
#[inline(always)]
pub fn hold_to_range(history: &Plane<Rgb>, lookup: &Lookup, fetched: Rgb) -> Rgb {
    let Some(Spline { first: [x, y], .. }) = Spline::of(lookup, history.size()) else { return fetched };
    let around = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| history.at(x, y));
    three(|c| {
        let [low, high] = around.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], colour| {
            [if colour[c] < low { colour[c] } else { low }, if colour[c] > high { colour[c] } else { high }]
        });
        hold(fetched[c], low, high)
    })
}

/// `v` held to `low..=high`.
#[inline(always)]
pub(crate) fn hold(v: f32, low: f32, high: f32) -> f32 {
    let v = if v < low { low } else { v };
    if v > high { high } else { v }
}

/// Weighted mean of up to four previous pixels.
#[inline(always)]
pub fn fetch(history: &Plane<Rgb>, lookup: &Lookup) -> Rgb {
    let data = history.data();
    let mut sum = [0.0; 3];
    for (index, weight) in lookup.index.iter().zip(lookup.weight) {
        if weight > 0.0 {
            for c in 0..3 {
                sum[c] += weight * data[*index][c];
            }
        }
    }
    sum
}

/// Weighted mean of a scalar.
#[inline(always)]
pub fn fetch_scalar(history: &Plane<f32>, lookup: &Lookup) -> f32 {
    let data = history.data();
    lookup.index.iter().zip(lookup.weight).filter(|(_, w)| *w > 0.0).map(|(i, w)| w * data[*i]).sum()
}

/// One pixel of one plane: history, clamped as the beauty's is, blended with the current value.
///
/// `beauty`: history before and after the clamp, and the current value, of the signal that the plane is tied to.
#[inline(always)]
pub fn blend(current: Rgb, history: Rgb, share: f32, beauty: (Rgb, Rgb, Rgb)) -> Rgb {
    let (unclamped, clamped, now) = beauty;
    three(|c| {
        let held = follow(history[c], unclamped[c], clamped[c], current[c], now[c]);
        share * held + (1.0 - share) * current[c]
    })
}

/// The beauty's history held to the box, in a form that passes can share. `held`: history as [`hold_to_range`] leaves it.
#[inline(always)]
pub fn clamp_history(history: Rgb, held: Rgb, current: Rgb, bounds: &ColourBox) -> Rgb {
    let clamped = bounds.clamp(held);
    three(|c| shareable(history[c], clamped[c], current[c]))
}
