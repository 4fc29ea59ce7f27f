//! The specification of stage 5.

use crate::frame::Rgb;
use crate::kernels::math::lerp;
use crate::par;
use crate::plane::Plane;
use crate::settings::Disocclusion;

/// Distrust k, 0..1: the maximum of 1 - confidence, then a box blur; both windows are cut at the image's edge.
pub fn distrust(confidence: &Plane<f32>, settings: &Disocclusion) -> Plane<f32> {
    let size = confidence.size();
    let window = |centre: usize, radius: u32, extent: usize| {
        centre.saturating_sub(radius as usize)..(centre + radius as usize + 1).min(extent)
    };
    let widest = par::plane(size, |x, y| {
        let mut k = 0.0f32;
        for ty in window(y, settings.radius, size.height) {
            for tx in window(x, settings.radius, size.width) {
                k = k.max(1.0 - confidence.at(tx, ty));
            }
        }
        k
    });
    // Rows, then columns: the order of the fast back end's sums.
    let rows = par::plane(size, |x, y| {
        let range = window(x, settings.blur, size.width);
        let n = range.len() as f32;
        range.map(|tx| widest.at(tx, y)).sum::<f32>() / n
    });
    par::plane(size, |x, y| {
        let range = window(y, settings.blur, size.height);
        let n = range.len() as f32;
        range.map(|ty| rows.at(x, ty)).sum::<f32>() / n
    })
}

/// Runs stage 5 on the whole image with at least `floor` of the prefiltered image; signal, then passes.
pub fn run(temporal: &[Plane<Rgb>], prefiltered: &[Plane<Rgb>], distrust: &Plane<f32>, floor: f32) -> Vec<Plane<Rgb>> {
    temporal
        .iter()
        .zip(prefiltered)
        .map(|(a, b)| {
            par::plane(a.size(), |x, y| {
                let k = distrust.at(x, y).max(floor);
                let (a, b) = (a.at(x, y), b.at(x, y));
                [0, 1, 2].map(|c| lerp(a[c], b[c], k))
            })
        })
        .collect()
}
