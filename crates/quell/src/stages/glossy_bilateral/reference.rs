//! The specification of stages 9 and 10.

use super::{Axis, KernelSize, radius_px};
use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::edge::EdgeStops;
use crate::kernels::math::exp_negative;
use crate::par;
use crate::plane::Plane;
use crate::settings::Settings;

/// Runs stage 9 or 10 on the whole image; `input`: the signal, then its passes.
pub fn run(input: &[Plane<Rgb>], guides: &Guides, settings: &Settings, axis: Axis) -> Vec<Plane<Rgb>> {
    let size = guides.size;
    let glossy = &settings.glossy_bilateral;
    let kernel = KernelSize::new(glossy, size.height);
    let stops = EdgeStops::glossy(&settings.edge);
    input
        .iter()
        .map(|plane| {
            par::plane(size, |x, y| {
                let centre = plane.at(x, y);
                let p = guides.surface(x, y);
                if !p.view_depth.is_finite() {
                    return centre;
                }
                let radius = radius_px(glossy, &kernel, guides, axis, x, y);
                if radius <= 0.0 {
                    return centre;
                }
                let pixel_size = guides.view.pixel_size(p.view_depth);
                let sigma = glossy.sigma * radius;
                let mut sum = centre.map(f64::from);
                let mut total = 1.0f64;
                for side in [-1isize, 1] {
                    let mut ceiling = f32::INFINITY;
                    for k in 1..=kernel.reach {
                        let offset = (k * kernel.step_px) as f32;
                        if offset > radius {
                            break;
                        }
                        let step = side * (k * kernel.step_px) as isize;
                        let (qx, qy) = match axis {
                            Axis::Horizontal => (x as isize + step, y as isize),
                            Axis::Vertical => (x as isize, y as isize + step),
                        };
                        if !size.contains(qx, qy) {
                            break;
                        }
                        let (qx, qy) = (qx as usize, qy as usize);
                        let (origin, direction) = guides.ray(qx, qy);
                        let mut edge = stops.weight(&p, &guides.surface(qx, qy), origin, direction, pixel_size);
                        if settings.edge.monotone {
                            edge = edge.min(ceiling);
                            ceiling = edge;
                        }
                        let w = edge * exp_negative(-offset * offset / (2.0 * sigma * sigma));
                        if w > 0.0 {
                            let q = plane.at(qx, qy);
                            for c in 0..3 {
                                sum[c] += f64::from(w) * f64::from(q[c]);
                            }
                            total += f64::from(w);
                        }
                    }
                }
                sum.map(|s| (s / total) as f32)
            })
        })
        .collect()
}
