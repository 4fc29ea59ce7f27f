//! Frames that look like traced ones to the filters, made in no time: a floor and a wall with a few pillars, noise where
//! indirect light would be.

use quell::{Camera, FrameBuf, Plane, Rgb, Size};
use rayon::prelude::*;

/// Share of pixels whose path found light, as in a dim room.
const LIT: u32 = u32::MAX / 4;

/// A frame with every plane that the pipeline reads. The camera moves a little from frame to frame.
pub fn frame(size: Size) -> FrameBuf {
    let (w, h) = (size.width as f32, size.height as f32);
    let (eye, forward, up) = ([0.0, 1.5, 0.0], [0.0, -0.1, -1.0], [0.0, 1.0, 0.0]);
    let camera = Camera::perspective(eye, forward, up, 0.9, w / h);
    let mut frame = FrameBuf::new(size, camera);
    let plane = |f: &(dyn Fn(f32, f32) -> [f32; 3] + Sync)| filled(size, f);
    let pillar = |u: f32| (u * 7.0).fract() < 0.3;
    // Where the wall meets the floor.
    let horizon = 0.6;
    let depth = move |u: f32, v: f32| {
        if v > horizon {
            2.0 + 6.0 * (1.0 - v) / (1.0 - horizon)
        } else if pillar(u) {
            5.0
        } else {
            8.0
        }
    };
    frame.view_depth = Some(one(size, &depth));
    frame.normal = Some(plane(&move |_, v| if v > horizon { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] }));
    frame.roughness = Some(one(size, &move |u, v| if v > horizon { 0.25 } else { 0.4 + 0.4 * u }));
    frame.glossy_hit_distance = Some(one(size, &|u, v| 1.0 + u + 2.0 * v));
    frame.matte_hit_distance = Some(one(size, &|u, v| 1.5 + v - 0.5 * u));
    frame.surface_id = Some(Plane::from_fn(size, |x, y| {
        let (u, v) = (x as f32 / w, y as f32 / h);
        if v > horizon {
            1
        } else if pillar(u) {
            2
        } else {
            3
        }
    }));
    frame.motion = Some(Plane::filled(size, [0.37, -0.21]));
    frame.direct = Some(plane(&|u, v| [0.2 + 0.1 * u, 0.2, 0.2 + 0.1 * v]));
    frame.matte_weight = Some(plane(&|u, v| [0.6, 0.5 + 0.1 * (40.0 * u).sin(), 0.4 + 0.1 * (40.0 * v).sin()]));
    frame.glossy_weight = Some(plane(&|_, v| [0.04 + 0.2 * v; 3]));
    frame.matte = Some(Plane::filled(size, [0.0; 3]));
    frame.glossy = Some(Plane::filled(size, [0.0; 3]));
    frame
}

/// New noise for the frame's number.
pub fn renew(frame: &mut FrameBuf) {
    let number = frame.index as u32;
    for (salt, signal) in [(1u32, &mut frame.matte), (2, &mut frame.glossy)] {
        let Some(signal) = signal else { continue };
        let width = signal.size().width;
        signal.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let random = hash(x as u32 ^ hash(y as u32 ^ hash(number ^ hash(salt))));
                let light = if random < LIT { 4.0 * (hash(random) as f32 / u32::MAX as f32) } else { 0.0 };
                *pixel = [light, 0.9 * light, 0.8 * light];
            }
        });
    }
}

/// Bob Jenkins' style of mixing: three rounds of xor, shift and odd multiplication (lowbias32, Wellons 2018).
fn hash(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

fn filled(size: Size, f: &(dyn Fn(f32, f32) -> Rgb + Sync)) -> Plane<Rgb> {
    let (w, h) = (size.width as f32, size.height as f32);
    Plane::from_fn(size, |x, y| f((x as f32 + 0.5) / w, (y as f32 + 0.5) / h))
}

fn one(size: Size, f: &(dyn Fn(f32, f32) -> f32 + Sync)) -> Plane<f32> {
    let (w, h) = (size.width as f32, size.height as f32);
    Plane::from_fn(size, |x, y| f((x as f32 + 0.5) / w, (y as f32 + 0.5) / h))
}
