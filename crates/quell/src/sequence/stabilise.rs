//! The last stage: a filtered picture averaged with its neighbours in time, each fetched along the motion and limited to
//! the picture's own range in 3x3. Silhouettes gain samples, and what the wavelet decided differently from frame to
//! frame evens out.

use super::member::Member;
use super::settings::Stabilise;
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};

/// A frame of the window with its filtered picture.
pub(super) struct Filtered<'a> {
    pub member: &'a Member,
    pub picture: &'a Plane<Rgb>,
    pub alpha: Option<&'a Plane<f32>>,
}

/// The steadier picture of `window[centre]`, and its coverage.
pub(super) fn stabilise(
    window: &[Filtered<'_>],
    centre: usize,
    future: bool,
    s: &Stabilise,
) -> (Plane<Rgb>, Option<Plane<f32>>) {
    let here = &window[centre];
    let size = here.picture.size();
    let (w, h) = (size.width, size.height);
    let mut alpha = here.alpha.cloned();
    let mut out = here.picture.clone();
    let mut coverage = alpha.take().map(Plane::into_vec).unwrap_or_default();
    let has_alpha = !coverage.is_empty() && window.iter().all(|f| f.alpha.is_some());
    let alpha_width = if coverage.is_empty() { 0 } else { w };
    let mut nothing = vec![0.0f32; if alpha_width == 0 { h } else { 0 }];
    let alpha_rows = if alpha_width == 0 { &mut nothing } else { &mut coverage };
    par::two_rows(out.data_mut(), w, alpha_rows, alpha_width, |y, row, alpha_row| {
        for (x, value) in row.iter_mut().enumerate() {
            let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
            let (mut low_alpha, mut high_alpha) = (f32::MAX, f32::MIN);
            for qy in y.saturating_sub(1)..(y + 2).min(h) {
                for qx in x.saturating_sub(1)..(x + 2).min(w) {
                    let c = here.picture.at(qx, qy);
                    for i in 0..3 {
                        low[i] = low[i].min(c[i]);
                        high[i] = high[i].max(c[i]);
                    }
                    if let (true, Some(a)) = (has_alpha, here.alpha) {
                        low_alpha = low_alpha.min(a.at(qx, qy));
                        high_alpha = high_alpha.max(a.at(qx, qy));
                    }
                }
            }
            let (mut sum, mut total) = (*value, 1.0);
            let mut sum_alpha = if has_alpha { alpha_row[x] } else { 0.0 };
            for forward in [false, true] {
                if forward && !future {
                    continue;
                }
                let steps = if forward { window.len() - 1 - centre } else { centre }.min(s.frames as usize);
                let (mut at, mut nearest, mut weight) = ((x as f32, y as f32), y * w + x, 1.0);
                for k in 1..=steps {
                    let (from, to) = if forward { (centre + k - 1, centre + k) } else { (centre + 1 - k, centre - k) };
                    let from = window[from].member;
                    let motion = if forward { &from.motion_to_next } else { &from.motion_to_previous };
                    let Some(motion) = motion else { break };
                    let m = motion.data()[nearest];
                    at = (at.0 + m[0], at.1 + m[1]);
                    // NaN fails too: unknown motion ends the way.
                    if !(at.0 >= 0.0 && at.1 >= 0.0 && at.0 <= (w - 1) as f32 && at.1 <= (h - 1) as f32) {
                        break;
                    }
                    nearest = at.1.round() as usize * w + at.0.round() as usize;
                    let other = &window[to];
                    let taps = CubicTaps::new(size, at);
                    let c = taps.fetch(|i| other.picture.data()[i]);
                    for i in 0..3 {
                        sum[i] += weight * c[i].max(low[i]).min(high[i]);
                    }
                    if let (true, Some(a)) = (has_alpha, other.alpha) {
                        let [a, ..] = taps.fetch(|i| [a.data()[i]; 3]);
                        sum_alpha += weight * a.max(low_alpha).min(high_alpha);
                    }
                    total += weight;
                    weight *= s.decay;
                }
            }
            *value = sum.map(|c| c / total);
            if has_alpha {
                alpha_row[x] = sum_alpha / total;
            }
        }
    });
    let coverage = if alpha_width == 0 { None } else { Plane::from_vec(size, coverage).ok() };
    (out, coverage)
}

/// Catmull-Rom's sixteen taps; beyond the border the border counts.
struct CubicTaps {
    x: [usize; 4],
    y: [usize; 4],
    weights: [[f32; 4]; 2],
    width: usize,
}

impl CubicTaps {
    fn new(size: Size, (x, y): (f32, f32)) -> Self {
        let spline = |t: f32| {
            [
                ((-0.5 * t + 1.0) * t - 0.5) * t,
                (1.5 * t - 2.5) * t * t + 1.0,
                ((-1.5 * t + 2.0) * t + 0.5) * t,
                (0.5 * t - 0.5) * t * t,
            ]
        };
        let place = |v: f32, limit: usize| {
            [0isize, 1, 2, 3].map(|i| (v.floor() as isize + i - 1).clamp(0, limit as isize - 1) as usize)
        };
        Self {
            x: place(x, size.width),
            y: place(y, size.height),
            weights: [spline(x - x.floor()), spline(y - y.floor())],
            width: size.width,
        }
    }

    fn fetch(&self, at: impl Fn(usize) -> Rgb) -> Rgb {
        let mut sum = [0.0; 3];
        for (j, y) in self.y.iter().enumerate() {
            for (i, x) in self.x.iter().enumerate() {
                let weight = self.weights[0][i] * self.weights[1][j];
                let c = at(y * self.width + x);
                for k in 0..3 {
                    sum[k] += weight * c[k];
                }
            }
        }
        sum
    }
}
