//! Temporal accumulation alone: the running mean of each surface's light over at most 32 frames.
//!
//! The surface tests are those of SVGF (Schied et al. 2017, section 4.1; thresholds of their later code); the mean is
//! plain, so on still surfaces variance falls as 1/N. No spatial filter, no clamp.

use super::surface::{Guides, Reprojection, Rows, signals};
use super::{Input, Method, composite};
use crate::error::Error;
use quell::{Plane, Rgb};

/// Frames that count at most: from then on an exponential mean with this weight for the newest.
const LONGEST: f32 = 32.0;
/// Channel of the number of frames, after six of light.
const LENGTH: usize = 6;

/// Accumulates.
#[derive(Default)]
pub struct Temporal {
    history: Option<History>,
}

struct History {
    index: i64,
    guides: Guides,
    /// Both signals' means, and the number of frames in them.
    light: Rows,
    /// Buffers of the next frame.
    next: (Guides, Rows, Rows),
}

impl Method for Temporal {
    fn name(&self) -> String {
        "temporal".to_owned()
    }

    fn reset(&mut self) {
        self.history = None;
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let frame = input.frame;
        let kept = self.history.take().filter(|h| h.guides.size() == frame.size);
        let follows = kept.as_ref().is_some_and(|h| h.index.abs_diff(frame.index) == 1);
        let mut history = kept.unwrap_or_else(|| History {
            index: frame.index,
            guides: Guides::new(frame.size),
            light: Rows::new(frame.size, LENGTH + 1),
            next: (Guides::new(frame.size), Rows::new(frame.size, 6), Rows::new(frame.size, LENGTH + 1)),
        });
        let width = frame.size.width;
        let (guides, noisy, light) = &mut history.next;
        guides.read(frame);
        signals(frame, noisy);
        let reprojection = follows.then(|| Reprojection::new(frame, guides, &history.guides));
        light.fill(|y, row| {
            for x in 0..width {
                let taps = reprojection.as_ref().map(|r| r.taps(x, y)).unwrap_or_default();
                let length = (taps.mean(&history.light, LENGTH) + 1.0).min(LONGEST);
                for c in 0..6 {
                    let new = noisy.at(x, y, c);
                    let old = if taps.is_empty() { new } else { taps.mean(&history.light, c) };
                    row[c * width + x] = old + (new - old) / length;
                }
                row[LENGTH * width + x] = length;
            }
        });
        history.index = frame.index;
        std::mem::swap(&mut history.guides, &mut history.next.0);
        std::mem::swap(&mut history.light, &mut history.next.2);
        let [matte, glossy] = [0, 3].map(|c| history.light.picture(c));
        self.history = Some(history);
        Ok(composite(frame, Some(matte.view()), Some(glossy.view())))
    }
}
