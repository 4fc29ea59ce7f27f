//! The last stage: a filtered picture averaged with its neighbours in time, each fetched along the motion and limited to
//! the picture's own range in 3x3. Silhouettes gain samples, and what the wavelet decided differently from frame to
//! frame evens out.

use super::energy;
use super::follow;
use super::member::Member;
use super::settings::{Gather, Stabilise};
use crate::frame::Rgb;
use crate::par;
use crate::plane::Plane;

/// Rows around a pixel that this stage reads besides those that motion leads to.
pub(super) const BORDER: usize = 2;

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
    gather: &Gather,
    s: &Stabilise,
) -> (Plane<Rgb>, Option<Plane<f32>>) {
    let here = &window[centre];
    let size = here.picture.size();
    let (w, h) = (size.width, size.height);
    // A band counts rows as the whole picture does: sums of floats are the same.
    let farthest = gather.travel * here.member.picture_height as f32;
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
                if forward && !gather.future {
                    continue;
                }
                let steps = if forward { window.len() - 1 - centre } else { centre }.min(s.frames as usize);
                let origin = ((x as f32), (here.member.first_row + y) as f32);
                let (mut at, mut decayed) = (origin, 1.0);
                let mut front = front(here.member, x, y);
                for k in 1..=steps {
                    let (from, to) = if forward { (centre + k - 1, centre + k) } else { (centre + 1 - k, centre - k) };
                    let from = window[from].member;
                    let specular = here.member.specular(y * w + x);
                    let there = window[to].member;
                    // What a mirror or a glass shows moves by itself; where that motion is unsure, the surface's counts,
                    // unless it leads elsewhere.
                    let along = |reflected: bool| {
                        step(from, there, forward, reflected, at, &front)
                            .filter(|(at, _)| (at.1 - origin.1).abs() <= farthest)
                    };
                    let mut tolerance = s.seen_albedo;
                    let step = match along(specular) {
                        None if specular && departs(from, forward, front.pixel) <= NO_DEPARTURE => {
                            tolerance *= UNSURE;
                            along(false)
                        }
                        step => step,
                    };
                    let Some((place, next)) = step else { break };
                    (at, front) = (place, next);
                    let Some(row) = there.row_here(at.1.round() as isize) else { break };
                    let q = row * w + at.0.round() as usize;
                    let p = y * w + x;
                    let unlike = if specular { seen_difference(here.member, p, window[to].member, q) } else { 0.0 };
                    let weight = decayed * energy::weight(unlike / (2.0 * tolerance * tolerance));
                    let other = &window[to];
                    let taps = CubicTaps::new(window[to].member, at);
                    let c = taps.fetch(|i| other.picture.data()[i]);
                    for i in 0..3 {
                        sum[i] += weight * c[i].max(low[i]).min(high[i]);
                    }
                    if let (true, Some(a)) = (has_alpha, other.alpha) {
                        let [a, ..] = taps.fetch(|i| [a.data()[i]; 3]);
                        sum_alpha += weight * a.max(low_alpha).min(high_alpha);
                    }
                    total += weight;
                    decayed *= s.decay;
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

/// The surface nearest to the eye around a pixel: a silhouette moves with it.
struct Front {
    pixel: usize,
    inverse_depth: f32,
}

/// Most relative change of depth from frame to frame.
const DEPTH_CHANGE: f32 = 0.1;

impl Front {
    fn same(&self, other: &Self) -> bool {
        (self.inverse_depth - other.inverse_depth).abs() <= DEPTH_CHANGE * other.inverse_depth
    }
}

/// Squared difference of the tone-mapped colours that mirrors or glass show around two pixels.
fn seen_difference(here: &Member, p: usize, other: &Member, q: usize) -> f32 {
    let (Some(a), Some(b)) = (&here.guides.seen_around, &other.guides.seen_around) else { return 0.0 };
    let (a, b) = (a.at(0, p), b.at(0, q));
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

/// Where a silhouette lies one frame further, and what is in front there; `None`: it is lost.
fn step(
    from: &Member,
    to: &Member,
    forward: bool,
    reflected: bool,
    at: (f32, f32),
    front: &Front,
) -> Option<((f32, f32), Front)> {
    let (w, h) = (from.size.width, from.picture_height);
    let m = follow::motion(from, forward, reflected)?.data()[front.pixel];
    let at = (at.0 + m[0], at.1 + m[1]);
    // NaN fails too: unknown motion ends the way.
    if !(at.0 >= 0.0 && at.1 >= 0.0 && at.0 <= (w - 1) as f32 && at.1 <= (h - 1) as f32) {
        return None;
    }
    let there = self::front(to, at.0.round() as usize, to.row_here(at.1.round() as isize)?);
    (there.same(front) && returns(to, forward, reflected, there.pixel, m)).then_some((at, there))
}

/// How much more alike a mirror must look where the surface's motion stands in.
const UNSURE: f32 = 0.125;
/// Pixels by which the motion of what is seen at a pixel may differ from the surface's and still be the same.
const NO_DEPARTURE: f32 = 1.0;

fn departs(member: &Member, forward: bool, pixel: usize) -> f32 {
    let at = |reflected: bool| follow::motion(member, forward, reflected).map_or([0.0; 2], |m| m.data()[pixel]);
    let (seen, surface) = (at(true), at(false));
    ((seen[0] - surface[0]).powi(2) + (seen[1] - surface[1]).powi(2)).sqrt()
}

/// Misses of the way there and back: in pixels, and as a part of its length.
const ROUND_TRIP: [f32; 2] = [0.5, 0.1];

/// True where the motion at `pixel` leads back by `motion`, or is unknown.
fn returns(member: &Member, forward: bool, reflected: bool, pixel: usize, motion: [f32; 2]) -> bool {
    let back = follow::motion(member, !forward, reflected);
    let Some(back) = back else { return true };
    let r = back.data()[pixel];
    let length = (motion[0] * motion[0] + motion[1] * motion[1]).sqrt();
    let miss = ((motion[0] + r[0]).powi(2) + (motion[1] + r[1]).powi(2)).sqrt();
    miss <= ROUND_TRIP[0] + ROUND_TRIP[1] * length
}

/// How much nearer a neighbour must be to stand in front: more than the slope of one surface makes.
const NEARER: f32 = 1.02;

fn front(member: &Member, x: usize, y: usize) -> Front {
    let (w, h) = (member.size.width, member.size.height);
    let mut best = Front { pixel: y * w + x, inverse_depth: member.guides.surface[y * w + x].inverse_depth };
    for qy in y.saturating_sub(1)..(y + 2).min(h) {
        for qx in x.saturating_sub(1)..(x + 2).min(w) {
            let inverse_depth = member.guides.surface[qy * w + qx].inverse_depth;
            if inverse_depth > best.inverse_depth * NEARER {
                best = Front { pixel: qy * w + qx, inverse_depth };
            }
        }
    }
    best
}

/// Catmull-Rom's sixteen taps; beyond the border the border counts.
struct CubicTaps {
    x: [usize; 4],
    y: [usize; 4],
    weights: [[f32; 4]; 2],
    width: usize,
}

impl CubicTaps {
    fn new(member: &Member, (x, y): (f32, f32)) -> Self {
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
        let last = member.size.height.saturating_sub(1);
        Self {
            x: place(x, member.size.width),
            y: place(y, member.picture_height).map(|row| row.saturating_sub(member.first_row).min(last)),
            weights: [spline(x - x.floor()), spline(y - y.floor())],
            width: member.size.width,
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
