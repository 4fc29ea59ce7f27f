//! The specification of stages 4 and 7, which differ in the pattern only.

use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::edge::{CONTACT_STEPS, EdgeStops, closeness, contact_stop};
use crate::kernels::spiral::{Spiral, SpiralShape, land};
use crate::par;
use crate::plane::Plane;
use crate::settings::Settings;

/// Runs stage 4 on the whole image; `input`: the signal, then its passes; `frame`: index, for the rotation.
pub fn run(input: &[Plane<Rgb>], guides: &Guides, settings: &Settings, frame: i64) -> Vec<Plane<Rgb>> {
    let shape = SpiralShape::prefilter(&settings.matte_prefilter, guides.size.height, frame);
    sparse_bilateral(input, guides, &EdgeStops::matte(&settings.edge), &shape)
}

/// The sparse cross-bilateral filter with a given spiral.
pub(crate) fn sparse_bilateral(
    input: &[Plane<Rgb>],
    guides: &Guides,
    stops: &EdgeStops,
    shape: &SpiralShape,
) -> Vec<Plane<Rgb>> {
    let spiral = Spiral::new(shape);
    let size = guides.size;
    // K of the contact stop.
    let nearest = |x: usize, y: usize| {
        let p = guides.surface(x, y);
        let mut most = 0.0f32;
        for (dx, dy) in CONTACT_STEPS.into_iter().flat_map(|s| [(-s, 0), (s, 0), (0, -s), (0, s)]) {
            let (rx, ry) = (x as isize + dx as isize, y as isize + dy as isize);
            if !size.contains(rx, ry) {
                continue;
            }
            let r = guides.surface(rx as usize, ry as usize);
            if r.view_depth.is_finite() {
                let offset = r.position - p.position;
                most = most.max(closeness(offset.dot(p.normal), offset.length_squared()));
            }
        }
        most
    };
    input
        .iter()
        .map(|plane| {
            par::plane(size, |x, y| {
                let centre = plane.at(x, y);
                let p = guides.surface(x, y);
                if !p.view_depth.is_finite() {
                    return centre;
                }
                let pixel_size = guides.view.pixel_size(p.view_depth);
                let mut sum = centre.map(f64::from);
                let mut total = 1.0f64;
                let nearest = if stops.contact > 0.0 { nearest(x, y) } else { 0.0 };
                for tap in spiral.at(x, y) {
                    let (Some(qx), Some(qy)) = (
                        land(x as i32 + tap.dx, size.width, shape.off_screen),
                        land(y as i32 + tap.dy, size.height, shape.off_screen),
                    ) else {
                        continue;
                    };
                    let (origin, direction) = guides.ray(qx, qy);
                    let q = guides.surface(qx, qy);
                    let mut w = tap.weight * stops.weight(&p, &q, origin, direction, pixel_size);
                    if stops.contact > 0.0 {
                        let gain = 1.0 / (stops.contact * stops.contact);
                        w *= contact_stop((q.position - p.position).length_squared(), nearest, gain);
                    }
                    if w > 0.0 {
                        let q = plane.at(qx, qy);
                        for c in 0..3 {
                            sum[c] += f64::from(w) * f64::from(q[c]);
                        }
                        total += f64::from(w);
                    }
                }
                sum.map(|s| (s / total) as f32)
            })
        })
        .collect()
}
