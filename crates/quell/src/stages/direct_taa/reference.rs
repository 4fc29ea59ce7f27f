//! The specification of stage 11.

use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::clip::ColourBox;
use crate::kernels::math::luminance;
use crate::par;
use crate::plane::Plane;
use crate::settings::{Clip, DirectTaa, REFERENCE_ROWS};
use glam::Vec2;

/// Runs stage 11 on the whole image. The frame has jitter; without history the result is `current`.
pub fn run(current: &Plane<Rgb>, history: Option<&Plane<Rgb>>, guides: &Guides, settings: &DirectTaa) -> Plane<Rgb> {
    let size = guides.size;
    let Some(history) = history else { return current.clone() };
    let falloff_px = settings.motion_falloff * size.height as f32 / REFERENCE_ROWS;
    par::plane(size, |x, y| {
        let now = current.at(x, y);
        let window = |centre: usize, extent: usize| centre.saturating_sub(1)..(centre + 2).min(extent);
        let (mut nearest, mut depth) = ((x, y), f32::INFINITY);
        for ty in window(y, size.height) {
            for tx in window(x, size.width) {
                if guides.depth.at(tx, ty) < depth {
                    depth = guides.depth.at(tx, ty);
                    nearest = (tx, ty);
                }
            }
        }
        let motion = Vec2::from(guides.motion.at(nearest.0, nearest.1));
        let speed = motion.length();
        let coordinate = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + motion;
        let trust = settings.history * (1.0 - speed / falloff_px).max(0.0) * guides.confidence_in.at(x, y);
        let outside = coordinate.x < 0.0
            || coordinate.y < 0.0
            || coordinate.x > size.width as f32
            || coordinate.y > size.height as f32;
        if trust.is_nan() || trust <= 0.0 || outside {
            return now;
        }
        let fetched = bilinear(history, coordinate);
        let neighbours = window(y, size.height)
            .flat_map(|ty| window(x, size.width).map(move |tx| (tx, ty)))
            .map(|(tx, ty)| current.at(tx, ty));
        let clamped = ColourBox::of(neighbours, Clip::Box, 0.0).clamp(fetched);
        let change = (luminance(clamped) - luminance(fetched)).abs();
        let scale = luminance(clamped).abs().max(luminance(fetched).abs());
        let relative = if scale > 0.0 { change / scale } else { 0.0 };
        let w = trust / (1.0 + settings.clamp_falloff * relative);
        [0, 1, 2].map(|c| w * clamped[c] + (1.0 - w) * now[c])
    })
}

/// Bilinear fetch, clamped to the edge.
fn bilinear(plane: &Plane<Rgb>, coordinate: Vec2) -> Rgb {
    let size = plane.size();
    let corner = coordinate - 0.5;
    let base = corner.floor();
    let t = corner - base;
    let hold = |v: f32, extent: usize| (v.max(0.0) as usize).min(extent - 1);
    let (x0, x1) = (hold(base.x, size.width), hold(base.x + 1.0, size.width));
    let (y0, y1) = (hold(base.y, size.height), hold(base.y + 1.0, size.height));
    let (a, b, c, d) = (plane.at(x0, y0), plane.at(x1, y0), plane.at(x0, y1), plane.at(x1, y1));
    [0, 1, 2].map(|k| {
        let top = a[k] * (1.0 - t.x) + b[k] * t.x;
        let bottom = c[k] * (1.0 - t.x) + d[k] * t.x;
        top * (1.0 - t.y) + bottom * t.y
    })
}
