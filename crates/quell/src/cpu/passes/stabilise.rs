//! Stage `stabilise`, row by row.

use crate::frame::Rgb;
use crate::par;
use crate::plane::Plane;
use crate::sequence::settings::{Gather, Stabilise};
use crate::stages::stabilise::StabiliseFrame;
use crate::stages::stabilise::cpu::Neighbourhood;
use crate::stages::stabilise::joint;

/// As [`crate::stages::stabilise::reference::run`].
pub(crate) fn run(
    window: &[StabiliseFrame<'_>],
    centre: usize,
    gather: &Gather,
    settings: &Stabilise,
) -> (Plane<Rgb>, Option<Plane<f32>>) {
    if settings.net {
        return joint::run(window, centre, gather, settings);
    }
    let here = &window[centre];
    let size = here.picture.size();
    let w = size.width;
    let mut out = here.picture.clone();
    let has_alpha = window.iter().all(|f| f.alpha.is_some());
    let fronts = joint::fronts(window, settings);
    let pixels = Neighbourhood { window, fronts: &fronts, centre, has_alpha, gather, settings };
    if !has_alpha {
        par::rows(out.data_mut(), w, |y, row| {
            row.iter_mut().enumerate().for_each(|(x, value)| *value = pixels.pixel(x, y).0);
        });
        return (out, here.alpha.cloned());
    }
    let mut coverage = Plane::filled(size, 0.0);
    par::two_rows(out.data_mut(), w, coverage.data_mut(), w, |y, row, coverage| {
        for (x, (value, coverage)) in row.iter_mut().zip(coverage).enumerate() {
            (*value, *coverage) = pixels.pixel(x, y);
        }
    });
    (out, Some(coverage))
}
