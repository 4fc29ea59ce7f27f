//! The specification of the composite.

use super::pixel;
use crate::frame::Rgb;
use crate::par;
use crate::plane::Plane;

/// Composites the whole image; `terms`: (signal, weight), in the order matte, glossy, noisy direct of each.
pub fn run(direct: &Plane<Rgb>, terms: &[(&Plane<Rgb>, &Plane<Rgb>)]) -> Plane<Rgb> {
    par::plane(direct.size(), |x, y| {
        pixel(direct.at(x, y), terms.iter().map(|(signal, weight)| (signal.at(x, y), weight.at(x, y))))
    })
}
