//! Stage `variance`, row by row.

use crate::kernels::lit_blocks::LitBlocks;
use crate::plane::Plane;
use crate::sequence::settings::{Variance, Wavelet};
use crate::simd::dispatch;
use crate::stages::gather::Gathered;
use crate::stages::variance::cpu::row;
use crate::window::{LocalFeatures, Rows};

/// As [`crate::stages::variance::reference::run`].
pub(crate) fn run(
    local: &LocalFeatures,
    gathered: &Gathered,
    given: &[Option<Plane<f32>>],
    s: &Variance,
    wavelet: &Wavelet,
) -> Rows {
    let (slots, lights) = (&gathered.slots, gathered.slots.len());
    let lit = LitBlocks::new(local.size, lights, |y, l| {
        // Only the first plane's luminance counts.
        let colour = (0..3).map(move |c| gathered.colours.row(y, 3 * slots[l].first + c));
        colour.chain(std::iter::once(gathered.moments.row(y, 2 * l)))
    });
    Rows::written(local.size, lights, |y, out| {
        dispatch!(crate::simd::level(), simd => row(simd, local, (gathered, &lit), given, (s, wavelet), y, out));
    })
}
