//! The specification of the picture's anti-aliasing.

use super::{believed, moves_with, share, stands_before};
use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::clip::ColourBox;
use crate::kernels::math::{catmull_rom, luminance};
use crate::plane::Plane;
use crate::settings::{Antialiasing, Clip};
use glam::Vec2;

/// A picture, and how many frames each of its pixels holds.
#[derive(Clone, Debug)]
pub struct Accumulated {
    /// Anti-aliased, scene-linear.
    pub picture: Plane<Rgb>,
    /// At least 1.
    pub frames: Plane<f32>,
}

/// Runs the stage on the whole picture. Without history the result is `current`.
pub fn run(
    current: &Plane<Rgb>,
    history: Option<&Accumulated>,
    guides: &Guides,
    settings: &Antialiasing,
) -> Accumulated {
    let size = guides.size;
    let mut out = Accumulated { picture: current.clone(), frames: Plane::filled(size, 1.0) };
    let Some(history) = history else { return out };
    for y in 0..size.height {
        for x in 0..size.width {
            if let Some((colour, frames)) = pixel(current, history, guides, settings, (x, y)) {
                out.picture.set(x, y, colour);
                out.frames.set(x, y, frames);
            }
        }
    }
    out
}

/// `None`: there is no history.
fn pixel(
    current: &Plane<Rgb>,
    history: &Accumulated,
    guides: &Guides,
    settings: &Antialiasing,
    (x, y): (usize, usize),
) -> Option<(Rgb, f32)> {
    let size = guides.size;
    let around = |r: usize| {
        let window = move |centre: usize, extent: usize| centre.saturating_sub(r)..(centre + r + 1).min(extent);
        window(y, size.height).flat_map(move |ty| window(x, size.width).map(move |tx| (tx, ty)))
    };
    let (mut nearest, mut depth, mut farthest) = ((x, y), f32::INFINITY, 0.0f32);
    for (tx, ty) in around(1) {
        let there = guides.depth.at(tx, ty);
        if there < depth {
            depth = there;
            nearest = (tx, ty);
        }
        farthest = farthest.max(there);
    }
    let motion = Vec2::from(guides.motion.at(nearest.0, nearest.1));
    let coordinate = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + motion;
    // Unknown motion compares false everywhere.
    let inside = coordinate.x >= 0.0
        && coordinate.y >= 0.0
        && coordinate.x <= size.width as f32
        && coordinate.y <= size.height as f32;
    if !inside {
        return None;
    }
    let corner = coordinate - 0.5;
    let base = corner.floor();
    let [u, v] = (corner - base).to_array();
    let column = |i: i32| (base.x as i32 + i).clamp(0, size.width as i32 - 1) as usize;
    let row = |j: i32| (base.y as i32 + j).clamp(0, size.height as i32 - 1) as usize;
    let mut held = 0.0;
    for (j, across) in [(0, 1.0 - v), (1, v)] {
        for (i, along) in [(0, 1.0 - u), (1, u)] {
            held += along * across * history.frames.at(column(i), row(j));
        }
    }
    let held = held * guides.confidence_in.at(x, y);
    if held.is_nan() || held <= 0.0 {
        return None;
    }
    let mut fetched = [0.0f32; 3];
    for (j, across) in (-1..3).zip(catmull_rom(v)) {
        for (i, along) in (-1..3).zip(catmull_rom(u)) {
            let colour = history.picture.at(column(i), row(j));
            for c in 0..3 {
                fetched[c] += along * across * colour[c];
            }
        }
    }
    // The spline may overshoot.
    let fetched = fetched.map(|v| v.max(0.0));
    let neighbours = around(1).map(|(tx, ty)| current.at(tx, ty));
    let mut bounds = ColourBox::of(neighbours, Clip::Sigma, settings.gamma);
    let before = around(settings.thin_radius as usize);
    for (tx, ty) in before.filter(|_| settings.thin_radius > 0) {
        let moved = Vec2::from(guides.motion.at(tx, ty));
        if stands_before(guides.depth.at(tx, ty), farthest, settings) && moves_with(moved, motion, settings) {
            bounds.widen(current.at(tx, ty));
        }
    }
    let clamped = bounds.clamp(fetched);
    let frames = believed(held, luminance(fetched), luminance(clamped), settings);
    let a = share(frames, [u, v], settings);
    let now = current.at(x, y);
    let colour = [0, 1, 2].map(|c| (1.0 - a) * clamped[c] + a * now[c]);
    Some((colour, (frames + 1.0).min(1.0 / settings.least)))
}
