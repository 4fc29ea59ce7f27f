//! The past of a pixel: how long its surface has been in view, and the stale light that a history without rejection
//! would show there.

use super::bands::Map;
use super::surfaces::{Surfaces, centre, cubic, pixel_at};
use glam::Vec2;
use quell::{Plane, Size};
use rayon::prelude::*;

/// Age of what has been in view since the sequence began, or for longer than can be counted.
pub const OLD: u8 = u8::MAX;
/// Share that the stale history keeps from frame to frame.
const KEPT: f32 = 0.7;
/// Frames that the stale history looks back.
const DEPTH: usize = 8;

/// Where every pixel's surface was one frame before, continuous pixel coordinates; NaN: unknown.
pub type Previous = Plane<[f32; 2]>;

/// The coordinates of [`Surfaces::previous`].
pub fn previous(surfaces: &Surfaces<'_>) -> Previous {
    let size = surfaces.size();
    let unknown = Vec2::NAN;
    Plane::from_fn(size, |x, y| surfaces.previous(y * size.width + x).unwrap_or(unknown).to_array())
}

/// Frames for which the surface at each pixel has been in view before this one, by noise-free motion, depth, normal and
/// id: 0 where it has just appeared. [`OLD`] for background and in the first frame, whose past nobody knows.
pub fn ages(now: &Surfaces<'_>, before: Option<(&Surfaces<'_>, &[u8])>) -> Vec<u8> {
    let Some((before, ages)) = before else { return vec![OLD; now.size().pixels()] };
    (0..now.size().pixels())
        .into_par_iter()
        .map(|i| match now.seen_before(before, i) {
            _ if !now.is_surface(i) => OLD,
            Some(tap) => ages[tap].saturating_add(1),
            None => 0,
        })
        .collect()
}

/// Follows the motion of the surface at `start` back from frame `t`: `previous[j]` belongs to frame j. Stops where
/// motion is unknown, off screen, or at the first frame. Item k is the coordinate in frame t - 1 - k.
pub fn back<'p>(previous: &'p [&'p Previous], t: usize, start: usize) -> impl Iterator<Item = Vec2> + 'p {
    let size = previous.get(t).map_or(Size::new(0, 0), |p| p.size());
    let mut place = (t > 0 && start < size.pixels()).then(|| centre(size, start));
    let mut frame = t;
    std::iter::from_fn(move || {
        let here = place.take()?;
        let pixel = pixel_at(size, here)?;
        let motion = Vec2::from(previous.get(frame)?.data()[pixel]) - centre(size, pixel);
        let there = here + motion;
        // A NaN lies in no pixel.
        pixel_at(size, there)?;
        frame -= 1;
        place = (frame > 0).then_some(there);
        Some(there)
    })
}

/// h_t = sum over k = 1..8 of 0.7^k P(R_(t-k)), each fetched once by a cubic at the coordinate composed along the
/// motion, with no rejection, normalised by the weights of the frames that there are; P itself where there is none.
/// One map for each half; `p[half][j]` belongs to frame j.
pub fn stale(previous: &[&Previous], p: &[Vec<&Map>], t: usize) -> Vec<Map> {
    let Some(size) = previous.get(t).map(|p| p.size()) else { return Vec::new() };
    let halves = p.len();
    let values: Vec<f32> = (0..size.pixels())
        .into_par_iter()
        .flat_map_iter(|i| {
            let mut sums = [0.0f32; 2];
            let (mut weight, mut total) = (1.0, 0.0);
            for (k, place) in back(previous, t, i).take(DEPTH).enumerate() {
                weight *= KEPT;
                total += weight;
                for (sum, p) in sums.iter_mut().zip(p) {
                    *sum += weight * cubic(p[t - 1 - k], place);
                }
            }
            (0..halves.min(2)).map(move |h| if total > 0.0 { sums[h] / total } else { p[h][t].data()[i] })
        })
        .collect();
    (0..halves).map(|h| Plane::from_fn(size, |x, y| values[(y * size.width + x) * halves + h])).collect()
}
