//! The specification of stage 3.

use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::change::{kept_light, rounded_light};
use crate::kernels::reproject::{Lookup, expected_surface, surface_lookup};
use crate::kernels::temporal::{Blend, blend, clamp_history, fetch, fetch_colour, fetch_scalar, hold_to_range};
use crate::par;
use crate::plane::Plane;
use crate::settings::Settings;

/// What stage 3 or 8 writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Temporal {
    /// The signal, then its passes.
    pub planes: Vec<Plane<Rgb>>,
    /// 0..1.
    pub confidence: Plane<f32>,
    /// Frames, at least 1.
    pub length: Plane<f32>,
    /// The fast history: luminance of the signal, 0..65504; `None`: nobody asks whether light has changed.
    pub fast: Option<Plane<f32>>,
}

/// What stages 3 and 8 remember of the frame before.
#[derive(Clone, Copy, Debug)]
pub struct Remembered<'a> {
    /// The signal's history, then its passes'.
    pub planes: &'a [Plane<Rgb>],
    /// History length, frames.
    pub length: &'a Plane<f32>,
    /// The fast history; without one, the long one's luminance is taken for it.
    pub fast: Option<&'a Plane<f32>>,
    /// The guides of that frame.
    pub guides: &'a Guides,
}

/// Runs stage 3 on the whole image; `current`: the signal, then its passes.
pub fn run(current: &[Plane<Rgb>], history: Option<Remembered<'_>>, now: &Guides, settings: &Settings) -> Temporal {
    let weights = Blend::matte(settings);
    accumulate(current, history, now, &weights, |before, x, y| {
        expected_surface(now, before, &settings.surface, x, y)
            .map(|expected| surface_lookup(now, before, &settings.surface, &expected, x, y))
            .unwrap_or_default()
    })
}

/// Fetch, clamp and blend at the places that `look_up` finds: what stages 3 and 8 have in common.
pub(crate) fn accumulate(
    current: &[Plane<Rgb>],
    history: Option<Remembered<'_>>,
    now: &Guides,
    weights: &Blend,
    look_up: impl Fn(&Guides, usize, usize) -> Lookup + Sync + Send,
) -> Temporal {
    let size = now.size;
    let light = |x: usize, y: usize| kept_light(current[0].at(x, y));
    let Some(history) = history else {
        return Temporal {
            planes: current.to_vec(),
            confidence: par::plane(size, |x, y| if now.is_surface(x, y) { 0.0 } else { 1.0 }),
            length: Plane::filled(size, 1.0),
            fast: weights.change.map(|_| par::plane(size, |x, y| rounded_light(light(x, y)))),
        };
    };
    let changed = weights
        .change
        .zip(history.fast)
        .map(|(change, fast)| change.of_history(&history.planes[0], history.length, fast));
    // Every plane asks for the same lookup: kept once, not computed per pass.
    let lookups = par::plane(size, |x, y| {
        let mut lookup = if now.is_surface(x, y) { look_up(history.guides, x, y) } else { Lookup::default() };
        lookup.trust *= now.confidence_in.at(x, y);
        let mut length = fetch_scalar(history.length, &lookup);
        if let Some((change, changed)) = weights.change.zip(changed.as_ref()) {
            length = change.left(length, changed.at(x, y));
        }
        let weighed = match weights.change {
            Some(_) => weights.weigh::<true>(lookup.trust, length),
            None => weights.weigh::<false>(lookup.trust, length),
        };
        let old = match history.fast {
            Some(fast) => fetch_scalar(fast, &lookup),
            None => kept_light(fetch(&history.planes[0], &lookup)),
        };
        let fast = rounded_light(weighed.fast * old + (1.0 - weighed.fast) * light(x, y));
        let confidence = if now.is_surface(x, y) { weighed.confidence } else { 1.0 };
        (lookup, weighed.history, confidence, weighed.length, fast)
    });
    let beauty = par::plane(size, |x, y| {
        let (lookup, share, ..) = lookups.at(x, y);
        let now_value = current[0].at(x, y);
        if share <= 0.0 {
            return (now_value, now_value, now_value);
        }
        let unclamped = fetch_colour(&history.planes[0], &lookup);
        let held = hold_to_range(&history.planes[0], &lookup, unclamped);
        let clamped = clamp_history(unclamped, held, now_value, &weights.colour_box(&current[0], now, x, y));
        (unclamped, clamped, now_value)
    });
    let planes = current
        .iter()
        .zip(history.planes)
        .map(|(current, history)| {
            par::plane(size, |x, y| {
                let (lookup, share, ..) = lookups.at(x, y);
                if share <= 0.0 {
                    return current.at(x, y);
                }
                blend(current.at(x, y), fetch_colour(history, &lookup), share, beauty.at(x, y))
            })
        })
        .collect();
    Temporal {
        planes,
        confidence: par::plane(size, |x, y| lookups.at(x, y).2),
        length: par::plane(size, |x, y| lookups.at(x, y).3),
        fast: weights.change.map(|_| par::plane(size, |x, y| lookups.at(x, y).4)),
    }
}
