//! Frames with the passes of Cycles, made in no time: a camera that glides into a room with a tiled floor, a mirror, a pane of
//! glass and a lamp, with noise of few samples. Guides and motion agree, so that surfaces are found again as in a real sequence.

use quell::sequence::{Light, LightKind, SequenceFrame};
use quell::{Plane, Size};
use rayon::prelude::*;
use std::sync::Arc;

/// Colour planes that are not black.
pub const LIT: usize = 6;
/// Half the width of the room, floor and ceiling, back wall; the eye is at the origin of frame 0.
const ROOM: [f32; 4] = [4.0, -1.5, 2.0, -14.0];
/// The camera's way in one frame, and the width of a pixel at depth 1 in a picture 1 wide.
const STEP: [f32; 3] = [0.03, 0.004, -0.06];
const OPENING: f32 = 1.1;
/// Share of paths that find light.
const FOUND: f32 = 0.35;

type Vec3 = [f32; 3];

/// What a ray meets.
#[derive(Clone, Copy)]
struct Hit {
    position: Vec3,
    normal: Vec3,
    colour: Vec3,
    mirror: bool,
}

fn eye(t: i64) -> Vec3 {
    STEP.map(|v| v * t as f32)
}

/// The wall that a ray from inside meets first.
fn meet(from: Vec3, along: Vec3) -> Hit {
    let planes = [(0, -ROOM[0]), (0, ROOM[0]), (1, ROOM[1]), (1, ROOM[2]), (2, ROOM[3]), (2, 8.0)];
    let distance = |(axis, at): (usize, f32)| {
        let d = (at - from[axis]) / along[axis];
        if d > 1e-4 { d } else { f32::INFINITY }
    };
    let mut best = (planes[0], f32::INFINITY);
    for plane in planes {
        if distance(plane) < best.1 {
            best = (plane, distance(plane));
        }
    }
    let ((axis, _), d) = best;
    let position = [0, 1, 2].map(|c| from[c] + along[c] * d);
    let mut normal = [0.0; 3];
    normal[axis] = -along[axis].signum();
    let tile = (position[(axis + 1) % 3] * 2.0).floor() + (position[(axis + 2) % 3] * 2.0).floor();
    let light = if tile.rem_euclid(2.0) < 1.0 { 0.7 } else { 0.35 };
    let colour = [light, light * (0.6 + 0.1 * axis as f32), light * 0.5];
    // A mirror on the left wall, and one on the back wall.
    let mirror = position[1].abs() < 0.9
        && ((axis == 0 && position[0] < 0.0 && position[2] > -10.0 && position[2] < -5.0)
            || (axis == 2 && position[0] > 0.5 && position[0] < 2.5));
    Hit { position, normal, colour: if mirror { [0.0; 3] } else { colour }, mirror }
}

/// Numbers 0..1 that look random.
fn random(x: usize, y: usize, t: i64, k: u64) -> f32 {
    let mut h = (x as u64) ^ (y as u64) << 16 ^ (t as u64) << 32 ^ k << 56;
    for _ in 0..3 {
        h = (h ^ (h >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}

fn plane<T: Copy + Default + Send>(size: Size, f: impl Fn(usize, usize) -> T + Sync) -> Plane<T> {
    let mut plane = Plane::filled(size, T::default());
    plane.data_mut().par_chunks_mut(size.width.max(1)).enumerate().for_each(|(y, row)| {
        row.iter_mut().enumerate().for_each(|(x, value)| *value = f(x, y));
    });
    plane
}

/// Frame `t`.
pub fn frame(t: i64, size: Size) -> SequenceFrame {
    let (w, h) = (size.width as f32, size.height as f32);
    let scale = OPENING / w;
    let from = eye(t);
    let along = |x: usize, y: usize| [(x as f32 + 0.5 - 0.5 * w) * scale, (0.5 * h - y as f32 - 0.5) * scale, -1.0];
    let hits = plane(size, |x, y| Some(meet(from, along(x, y))));
    let at = |x: usize, y: usize| hits.at(x, y).unwrap_or_else(|| meet(from, along(x, y)));
    // Where a point lies in another frame's picture.
    let motion = |x: usize, y: usize, other: i64| {
        let (p, e) = (at(x, y).position, eye(other));
        let d = [0, 1, 2].map(|c| p[c] - e[c]);
        if d[2] > -0.05 {
            return [f32::NAN; 2];
        }
        let place = [-d[0] / d[2] / scale + 0.5 * w - 0.5, d[1] / d[2] / scale + 0.5 * h - 0.5];
        [place[0] - x as f32, place[1] - y as f32]
    };
    let reflected = |x: usize, y: usize| {
        let (hit, a) = (at(x, y), along(x, y));
        let twice = 2.0 * (0..3).map(|c| a[c] * hit.normal[c]).sum::<f32>();
        if hit.mirror { meet(hit.position, [0, 1, 2].map(|c| a[c] - twice * hit.normal[c])) } else { hit }
    };
    let mut f = SequenceFrame::new(t, size);
    f.depth = Some(plane(size, |x, y| from[2] - at(x, y).position[2]));
    f.normal = Some(plane(size, |x, y| at(x, y).normal));
    f.position = Some(plane(size, |x, y| at(x, y).position));
    f.motion_to_previous = Some(plane(size, |x, y| motion(x, y, t - 1)));
    f.motion_to_next = Some(plane(size, |x, y| motion(x, y, t + 1)));
    f.seen_albedo = Some(plane(size, |x, y| reflected(x, y).colour));
    f.seen_normal = Some(plane(size, |x, y| reflected(x, y).normal));
    let matte = Arc::new(plane(size, |x, y| at(x, y).colour));
    let glossy = Arc::new(plane(size, |x, y| if at(x, y).mirror { [0.9; 3] } else { [0.04; 3] }));
    let clear = Arc::new(plane(size, |x, _| if x % 7 == 0 { [0.1; 3] } else { [0.0; 3] }));
    // As files hold it: half floats.
    let noisy = |k: u64, level: f32| {
        plane(size, |x, y| {
            let p = reflected(x, y).position;
            let lit = level * (1.2 + (p[0] + 0.7 * p[2]).sin());
            let found = random(x, y, t, k) < FOUND;
            let value = if found { lit * 2.0 * random(y, x, t, k) / FOUND } else { 0.0 };
            [value, value * 0.9, value * 0.75].map(half)
        })
    };
    let black = || Plane::filled(size, [0.0; 3]);
    let mut add = |name: &str, kind, light, weight: Option<&Arc<Plane<[f32; 3]>>>| {
        f.lights.push(Light { weight: weight.cloned(), ..Light::new(name, kind, light) });
    };
    add("Diffuse Direct", LightKind::MatteDirect, noisy(1, 0.8), Some(&matte));
    add("Diffuse Indirect", LightKind::MatteIndirect, noisy(2, 0.5), Some(&matte));
    add("Glossy Direct", LightKind::GlossyDirect, noisy(3, 0.6), Some(&glossy));
    add("Glossy Indirect", LightKind::GlossyIndirect, noisy(4, 0.9), Some(&glossy));
    add("Transmission Direct", LightKind::Transmission, noisy(5, 0.2), Some(&clear));
    add("Transmission Indirect", LightKind::Transmission, noisy(6, 0.3), Some(&clear));
    add("Volume Direct", LightKind::Volume, black(), None);
    add("Volume Indirect", LightKind::Volume, black(), None);
    add("Emission", LightKind::NoiseFree, plane(size, |x, y| if x < 8 && y < 8 { [4.0; 3] } else { [0.0; 3] }), None);
    add("Environment", LightKind::NoiseFree, black(), None);
    f.alpha = Some(Plane::filled(size, 1.0));
    f
}

/// Rounded to 11 bits, as half floats are.
fn half(value: f32) -> f32 {
    f32::from_bits((value.to_bits() + 0x1000) & 0xffff_e000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_leads_to_the_same_surface() {
        let size = Size::new(48, 27);
        let (here, next) = (frame(3, size), frame(4, size));
        let (motion, position) = (here.motion_to_next.unwrap(), here.position.unwrap());
        let there = next.position.unwrap();
        let (mut near, mut all) = (0, 0);
        for (x, y) in (0..27).flat_map(|y| (0..48).map(move |x| (x, y))) {
            let [mx, my] = motion.at(x, y);
            let (qx, qy) = ((x as f32 + mx).round(), (y as f32 + my).round());
            if !(qx >= 0.0 && qy >= 0.0 && qx < 48.0 && qy < 27.0) {
                continue;
            }
            let (p, q) = (position.at(x, y), there.at(qx as usize, qy as usize));
            let off = (0..3).map(|c| (p[c] - q[c]).powi(2)).sum::<f32>().sqrt();
            all += 1;
            near += usize::from(off < 0.05 * (eye(3)[2] - p[2]));
        }
        assert!(all > 1000 && near * 20 > all * 19, "{near} of {all}");
    }
}
