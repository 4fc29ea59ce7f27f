//! The specification of the filter of young history.

use super::{Lobe, counted, ends, fade, step_px};
use crate::border::Guides;
use crate::frame::{Rgb, Signal};
use crate::kernels::edge::EdgeStops;
use crate::par;
use crate::plane::Plane;
use crate::settings::Settings;

/// Runs a level on the whole image; `input`: the signal, then its passes; `length`: frames, at least 1.
pub fn run(
    input: &[Plane<Rgb>],
    length: &Plane<f32>,
    guides: &Guides,
    settings: &Settings,
    signal: Signal,
    level: u32,
) -> Vec<Plane<Rgb>> {
    let size = guides.size;
    let young = &settings.young_filter;
    let end = ends(young)[level as usize];
    let lobe = Lobe::new(young, guides.view.focal_px, level);
    let (stops, has_lobe) = match signal {
        Signal::Matte => (EdgeStops::matte(&settings.edge), false),
        Signal::Glossy => (EdgeStops::glossy(&settings.edge), guides.has_roughness),
    };
    let step = step_px(level) as isize;
    let frames = |x, y| f64::from(counted(length.at(x, y), young.frames));
    input
        .iter()
        .map(|plane| {
            par::plane(size, |x, y| {
                let centre = plane.at(x, y);
                let p = guides.surface(x, y);
                if !p.view_depth.is_finite() {
                    return centre;
                }
                let room = if has_lobe { lobe.room(p.roughness) } else { 1.0 };
                let share = fade(length.at(x, y), end) * room;
                if share <= 0.0 {
                    return centre;
                }
                let pixel_size = guides.view.pixel_size(p.view_depth);
                let mut total = frames(x, y);
                let mut sum = centre.map(|v| total * f64::from(v));
                for (dx, dy) in (0..9).map(|k| ((k % 3 - 1) * step, (k / 3 - 1) * step)) {
                    let (qx, qy) = (x as isize + dx, y as isize + dy);
                    if (dx, dy) == (0, 0) || !size.contains(qx, qy) {
                        continue;
                    }
                    let (qx, qy) = (qx as usize, qy as usize);
                    let (origin, direction) = guides.ray(qx, qy);
                    let edge = stops.weight(&p, &guides.surface(qx, qy), origin, direction, pixel_size);
                    let w = f64::from(share * edge) * frames(qx, qy);
                    let q = plane.at(qx, qy);
                    for c in 0..3 {
                        sum[c] += w * f64::from(q[c]);
                    }
                    total += w;
                }
                sum.map(|s| (s / total) as f32)
            })
        })
        .collect()
}
