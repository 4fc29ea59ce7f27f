//! The specification of stage 7: stage 4's filter with its own pattern.

use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::edge::EdgeStops;
use crate::kernels::spiral::SpiralShape;
use crate::plane::Plane;
use crate::settings::Settings;
use crate::stages::matte_prefilter::reference::sparse_bilateral;

/// Runs stage 7 on the whole image; `input`: the signal, then its passes; `frame`: index, for the rotation.
pub fn run(input: &[Plane<Rgb>], guides: &Guides, settings: &Settings, frame: i64) -> Vec<Plane<Rgb>> {
    let shape = SpiralShape::bilateral(&settings.matte_bilateral, guides.size.height, frame);
    sparse_bilateral(input, guides, &EdgeStops::matte(&settings.edge), &shape)
}
