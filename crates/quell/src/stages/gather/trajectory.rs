//! Where a pixel's surface lies in the other frames of the window, and which of their pixels show it.

use crate::kernels::bilinear::footprint;
use crate::sequence::settings::Gather;
use crate::window::{PreparedFrame, SurfacePoint};

/// A pixel of another frame that shows the surface, with its weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tap {
    /// Place of the frame in the window.
    pub frame: u32,
    /// Frames between.
    pub distance: u32,
    /// Index of the pixel.
    pub pixel: u32,
    /// Share of the pixel, 0..1.
    pub weight: f32,
}

/// All taps of pixel `index` of `window[centre]`, itself first.
pub(crate) fn taps(
    window: &[&PreparedFrame],
    centre: usize,
    index: usize,
    reflected: bool,
    gather: &Gather,
    taps: &mut Vec<Tap>,
) {
    taps.clear();
    taps.push(Tap { frame: centre as u32, distance: 0, pixel: index as u32, weight: 1.0 });
    follow(window, centre, index, false, reflected, gather, taps);
    if gather.future {
        follow(window, centre, index, true, reflected, gather, taps);
    }
}

fn follow(
    window: &[&PreparedFrame],
    centre: usize,
    index: usize,
    forward: bool,
    reflected: bool,
    gather: &Gather,
    taps: &mut Vec<Tap>,
) {
    let here = window[centre];
    // A band counts rows as the whole picture does: sums of floats are the same.
    let (w, h) = (here.features.size.width, here.features.picture_height);
    let farthest = gather.travel * h as f32;
    let steps = if forward { window.len() - 1 - centre } else { centre }.min(gather.frames as usize);
    let origin = ((index % w) as f32, (here.features.first_row + index / w) as f32);
    let mut at = origin;
    let mut nearest = index;
    let mut tracked: SurfacePoint = here.features.surface[index];
    for k in 1..=steps {
        let (from, to) = if forward { (centre + k - 1, centre + k) } else { (centre + 1 - k, centre - k) };
        let (from, member) = (window[from], window[to]);
        let Some(motion) = from.features.motion.get(forward, reflected) else { return };
        let m = motion.data()[nearest];
        at = (at.0 + m[0], at.1 + m[1]);
        // NaN fails too: unknown motion ends the trajectory.
        if !(at.0 > -0.5 && at.1 > -0.5 && at.0 < w as f32 - 0.5 && at.1 < h as f32 - 0.5) {
            return;
        }
        if (at.1 - origin.1).abs() > farthest {
            return;
        }
        let repeated = (from.repeats_noise || member.repeats_noise)
            && (at.0 - origin.0).abs() < gather.same_noise
            && (at.1 - origin.1).abs() < gather.same_noise;
        let back = member.features.motion.get(!forward, reflected);
        let pixel_size =
            if tracked.inverse_depth > 0.0 { member.features.pixel_angle / tracked.inverse_depth } else { 0.0 };
        let mut best = (0.0f32, 0usize);
        for (qx, qy, share) in footprint(at.0, at.1) {
            if share < gather.least_share || qx < 0 || qx >= w as isize {
                continue;
            }
            let Some(row) = member.features.row_here(qy) else { continue };
            let q = row * w + qx as usize;
            let round_trip = back.as_ref().map(|b| b.data()[q]).map(|r| [m[0] + r[0], m[1] + r[1]]);
            let Some(trust) = same_surface(&member.features.surface[q], &tracked, pixel_size, m, round_trip, gather)
            else {
                continue;
            };
            if share > best.0 {
                best = (share, q);
            }
            if !repeated {
                taps.push(Tap { frame: to as u32, distance: k as u32, pixel: q as u32, weight: share * trust });
            }
        }
        if best.0 == 0.0 {
            return;
        }
        nearest = best.1;
        let s = member.features.surface[nearest];
        // A surface that moves carries its reference along; one that stands keeps the first, so that errors do not add.
        if !(pixel_size > 0.0 && off_plane(&s, &tracked) < gather.plane_distance * pixel_size) {
            tracked = s;
        }
    }
}

fn difference(a: &SurfacePoint, b: &SurfacePoint) -> [f32; 3] {
    [0, 1, 2].map(|c| a.position[c] - b.position[c])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Distance of `s` from the tangent plane of `reference`.
fn off_plane(s: &SurfacePoint, reference: &SurfacePoint) -> f32 {
    dot(difference(s, reference), reference.normal).abs()
}

/// How far a pixel of another frame is believed to show the tracked surface; `None`: it shows another.
fn same_surface(
    s: &SurfacePoint,
    tracked: &SurfacePoint,
    pixel_size: f32,
    motion: [f32; 2],
    round_trip: Option<[f32; 2]>,
    gather: &Gather,
) -> Option<f32> {
    if (s.inverse_depth > 0.0) != (tracked.inverse_depth > 0.0) {
        return None;
    }
    let has_normals = s.normal != [0.0; 3] || tracked.normal != [0.0; 3];
    let cosine = if has_normals { dot(s.normal, tracked.normal) } else { 1.0 };
    if pixel_size > 0.0 {
        let off = off_plane(s, tracked);
        let d = difference(s, tracked);
        let near = dot(d, d) < (gather.standing_reach * pixel_size.max(off)).powi(2);
        if off < gather.plane_distance * pixel_size && (near || cosine > gather.plane_normal) {
            return (cosine >= gather.standing_normal).then_some(1.0);
        }
    }
    // It moves, or positions are unknown: the surface there must come from here.
    if let Some(miss) = round_trip {
        let length = (motion[0] * motion[0] + motion[1] * motion[1]).sqrt();
        let miss = (miss[0] * miss[0] + miss[1] * miss[1]).sqrt();
        // NaN is no agreement.
        if miss.is_nan() || miss > gather.round_trip + gather.round_trip_share * length {
            return None;
        }
    }
    let depth_change =
        if tracked.inverse_depth > 0.0 { (s.inverse_depth / tracked.inverse_depth - 1.0).abs() } else { 0.0 };
    (depth_change <= gather.moving_depth && cosine >= gather.moving_normal).then_some(gather.moving_weight)
}
