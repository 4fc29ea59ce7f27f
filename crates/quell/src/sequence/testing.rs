//! Frames for the tests of the sequence filter's stages.

use super::{Light, LightKind, SequenceFrame};
use crate::frame::Rgb;
use crate::plane::{Plane, Size};
use std::sync::Arc;

/// Numbers 0..1 that look random, from integers.
pub(crate) fn random(x: usize, y: usize, t: i64, k: u64) -> f32 {
    let mut h = (x as u64) ^ (y as u64) << 16 ^ (t as u64) << 32 ^ k << 56;
    for _ in 0..3 {
        h = (h ^ (h >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}

/// Pixels a frame by which the camera slides along the wall.
const SPEED: f32 = 1.3;

/// Frame `t` of a box of glass that moves before a wall from which it differs in everything, under every kind of light;
/// the wall's right edge is background. Light is noise of one path in three; feature buffers have some noise too.
pub(crate) fn frame(t: i64, size: Size) -> SequenceFrame {
    let (w, h) = (size.width, size.height);
    let inside = |x: usize, y: usize| x > w / 6 && x < w / 2 && y > h / 5 && y < h - h / 5;
    let sky = |x: usize| x + 3 >= w;
    let mut f = SequenceFrame::new(t, size);
    f.depth = Some(Plane::from_fn(size, |x, y| match (sky(x), inside(x, y)) {
        (true, _) => f32::INFINITY,
        (_, true) => 2.0 + 0.05 * random(x, y, t, 5),
        _ => 4.0 + 0.02 * x as f32,
    }));
    f.normal = Some(Plane::from_fn(size, |x, y| {
        let a = if inside(x, y) { 0.6 + 0.3 * random(x, y, t, 6) } else { 0.02 * y as f32 };
        if sky(x) { [0.0; 3] } else { [a.sin(), 0.0, a.cos()] }
    }));
    let depth = f.depth.clone();
    f.position = Some(Plane::from_fn(size, |x, y| {
        let z = depth.as_ref().map_or(1.0, |depth| depth.at(x, y)).min(100.0);
        [(x as f32 + SPEED * t as f32) * 0.1, y as f32 * -0.1, 0.02 * random(x, y, t, 7) - z]
    }));
    let to_previous = |x, y| if inside(x, y) { [0.1, 0.0] } else { [SPEED, 0.0] };
    f.motion_to_previous = Some(Plane::from_fn(size, to_previous));
    // Unknown in the sky, as in files.
    let to_next = |x, y| match (sky(x), inside(x, y)) {
        (true, _) => [f32::NAN; 2],
        (_, true) => [-0.1, 0.12],
        _ => [-SPEED, 0.0],
    };
    f.motion_to_next = Some(Plane::from_fn(size, to_next));
    // What the glass shows slides by a pixel a frame.
    f.seen_albedo =
        Some(Plane::from_fn(size, |x, y| [0.2 + 0.5 * random((x + t as usize) / 3, y / 3, 0, 8), 0.4, 0.3]));
    f.seen_normal = Some(Plane::from_fn(size, |x, y| {
        let a = 3.0 * random((x + t as usize) / 4, y / 4, 0, 3);
        [a.sin(), a.cos(), 0.0]
    }));
    let colour = |x, y| if inside(x, y) { [0.0; 3] } else { [0.1 + 0.5 * random(x / 2, y, 0, 4); 3] };
    f.albedo = Some(Plane::from_fn(size, colour));
    let noisy = |k: u64| {
        Plane::from_fn(size, |x, y| -> Rgb {
            let lit = if random(x, y, t, k) < 0.3 { 3.0 * random(y, x, t, k) } else { 0.0 };
            [1.0, 0.8, 0.5].map(|c| c * lit * if x > y { 1.0 } else { 0.4 })
        })
    };
    for (k, kind) in (20..).zip(KINDS) {
        f.lights.push(Light::new(format!("{kind:?}"), kind, noisy(k)));
    }
    f.lights[0].weight = f.albedo.clone().map(Arc::new);
    f.lights[0].joint = vec![noisy(30)];
    f.lights[2].joint = vec![noisy(31), noisy(32)];
    f.alpha = Some(Plane::from_fn(size, |x, y| if sky(x) { 0.0 } else { 1.0 - 0.2 * random(x, y, t, 9) }));
    f.variance = Some(Plane::from_fn(size, |x, y| if x % 5 == 0 { f32::NAN } else { 0.3 * random(x, y, t, 10) }));
    f
}

/// The lights of [`frame`], in order.
pub(crate) const KINDS: [LightKind; 8] = [
    LightKind::MatteDirect,
    LightKind::MatteIndirect,
    LightKind::GlossyDirect,
    LightKind::GlossyIndirect,
    LightKind::Transmission,
    LightKind::Beauty,
    LightKind::NoiseFree,
    LightKind::Volume,
];
