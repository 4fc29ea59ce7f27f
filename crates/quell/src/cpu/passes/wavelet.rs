//! Stage `wavelet`, level by level and row by row.

use crate::par;
use crate::sequence::settings::Wavelet;
use crate::stages::wavelet::cpu::{Level, compared_row};
use crate::stages::wavelet::levels;
use crate::window::{LightSlot, LocalFeatures, Rows};
use fearless_simd::dispatch;

/// As [`crate::stages::wavelet::reference::run`].
pub(crate) fn run(local: &LocalFeatures, slots: &[LightSlot], colours: Rows, variance: Rows, s: &Wavelet) -> Rows {
    let (mut colours, mut variance) = (colours, variance);
    let most = slots.iter().map(|slot| levels(s, slot.kind)).max().unwrap_or(0);
    let mut first: Option<Rows> = None;
    for level in 0..most {
        let compared = compared(local, slots, &colours, &variance, s);
        let active: Vec<usize> = (0..slots.len()).filter(|&l| levels(s, slots[l].kind) > level).collect();
        (colours, variance) = filter(&Level {
            local,
            slots,
            colours: &colours,
            variance: &variance,
            compared: &compared,
            first: first.as_ref().unwrap_or(&compared),
            step: 1 << level,
            active: &active,
            settings: s,
        });
        first.get_or_insert(compared);
    }
    colours
}

fn compared(local: &LocalFeatures, slots: &[LightSlot], colours: &Rows, variance: &Rows, s: &Wavelet) -> Rows {
    let lights = slots.len();
    let mut out = Rows::new(local.size, 2 * lights);
    par::rows(out.data_mut(), (2 * lights * local.size.width).max(1), |y, out| {
        dispatch!(crate::simd::level(), simd => compared_row(simd, local, slots, (colours, variance), s, y, out));
    });
    out
}

fn filter(level: &Level<'_>) -> (Rows, Rows) {
    let size = level.local.size;
    let lights = level.slots.len();
    let mut colours = Rows::new(size, level.colours.channels());
    let mut variance = Rows::new(size, lights);
    let (cw, vw) = (level.colours.channels() * size.width, lights * size.width);
    par::two_rows(colours.data_mut(), cw, variance.data_mut(), vw, |y, colours, variance| {
        dispatch!(crate::simd::level(), simd => level.row(simd, y, colours, variance));
    });
    (colours, variance)
}
