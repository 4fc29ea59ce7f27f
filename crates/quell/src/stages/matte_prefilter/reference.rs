//! The specification of stages 4 and 7, which differ in the pattern only.

use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::edge::EdgeStops;
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
                for tap in spiral.at(x, y) {
                    let (Some(qx), Some(qy)) = (
                        land(x as i32 + tap.dx, size.width, shape.off_screen),
                        land(y as i32 + tap.dy, size.height, shape.off_screen),
                    ) else {
                        continue;
                    };
                    let (origin, direction) = guides.ray(qx, qy);
                    let w = tap.weight * stops.weight(&p, &guides.surface(qx, qy), origin, direction, pixel_size);
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
