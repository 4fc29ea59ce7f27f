//! The specification of stage 6.

use super::MIDDLE;
use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::math::luminance;
use crate::par;
use crate::plane::Plane;
use crate::settings::{Firefly, Median};

/// Runs stage 6 on the whole image; `input`: the signal, then its passes.
pub fn run(input: &[Plane<Rgb>], guides: &Guides, settings: &Firefly) -> Vec<Plane<Rgb>> {
    let size = guides.size;
    // For each channel, the linear index of the pixel chosen.
    let chosen = par::plane(size, |x, y| {
        let own = y * size.width + x;
        if !guides.is_surface(x, y) {
            return [own; 3];
        }
        let neighbours: [usize; 9] = std::array::from_fn(|k| {
            let (tx, ty) = ((x + k % 3) as isize - 1, (y + k / 3) as isize - 1);
            if size.contains(tx, ty) && guides.is_surface(tx as usize, ty as usize) {
                ty as usize * size.width + tx as usize
            } else {
                own
            }
        });
        let pick = |value: &dyn Fn(Rgb) -> f32| {
            let mut ranked = neighbours.map(|i| (value(input[0].data()[i]), i));
            // Stable: of equal values the first in reading order.
            ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (middle, index) = ranked[MIDDLE];
            let is_firefly = value(input[0].data()[own]) > settings.threshold * middle;
            if settings.plain || is_firefly { index } else { own }
        };
        match settings.median {
            Median::Channel => [pick(&|c| c[0]), pick(&|c| c[1]), pick(&|c| c[2])],
            Median::Luminance => [pick(&luminance); 3],
        }
    });
    input
        .iter()
        .map(|plane| {
            par::plane(size, |x, y| {
                let index = chosen.at(x, y);
                [0, 1, 2].map(|c| plane.data()[index[c]][c])
            })
        })
        .collect()
}
