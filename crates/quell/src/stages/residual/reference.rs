//! The specification of `residual`.

use super::{LEAST, LEVELS, between, cells, change, squares, triangle};
use crate::sequence::settings::Residual;
use crate::stages::recombine::raw;
use crate::window::{LightSlot, PreparedFrame, Rows, Samples};

/// The filtered light of `frame` (`colours`: three channels a colour plane of `slots`, in the units of the light as it came: divided by the
/// surface's colour), corrected, on the whole image or band. Light that is noise-free comes out as it went in.
pub fn run(frame: &PreparedFrame, slots: &[LightSlot], mut colours: Rows, s: &Residual) -> Rows {
    let noisy = |slot: &&LightSlot| matches!(frame.stored[slot.light], Samples::Black | Samples::Packed(_));
    for slot in slots.iter().filter(noisy) {
        for (cell, radius) in LEVELS {
            level(frame, slot, &mut colours, (cell, radius), s);
        }
    }
    colours
}

/// One level of one light.
fn level(frame: &PreparedFrame, slot: &LightSlot, colours: &mut Rows, (cell, radius): (usize, usize), s: &Residual) {
    let (w, h, first) = (frame.features.size.width, frame.features.size.height, frame.features.first_row);
    let input = |x: usize, y: usize| raw(frame, slot, 0, y * w + x).unwrap_or_default();
    let (across, down) = (cells(0, w, cell), cells(first, h, cell));
    let of = |x: usize, y: usize| (first % cell + y) / cell * across + x / cell;
    // Of each cell and channel the sums of the filtered light, of the residual and of its square.
    let mut sums = vec![[[0.0f64; 3]; 3]; across * down];
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        let (filtered, own) = (colours.colour(x, y, 3 * slot.first), input(x, y));
        for c in 0..3 {
            let residual = f64::from(own[c]) - f64::from(filtered[c]);
            let sums = &mut sums[of(x, y)][c];
            *sums = [sums[0] + f64::from(filtered[c]), sums[1] + residual, sums[2] + residual * residual];
        }
    }
    // What a cell is multiplied by, less 1.
    let [least_change, most_change] = change(s);
    let kernel = triangle(radius);
    let near = |v: usize, limit: usize| v.saturating_sub(2 * radius)..(v + 2 * radius + 1).min(limit);
    let changes: Vec<[f64; 3]> = (0..across * down)
        .map(|place| {
            let (x, y) = (place % across, place / across);
            let mut smooth = [[0.0f64; 3]; 3];
            for (u, v) in near(y, down).flat_map(|v| near(x, across).map(move |u| (u, v))) {
                let k = f64::from(kernel[u.abs_diff(x)]) * f64::from(kernel[v.abs_diff(y)]);
                for (smooth, sums) in smooth.iter_mut().flatten().zip(sums[v * across + u].iter().flatten()) {
                    *smooth += k * sums;
                }
            }
            let least = f64::from(LEAST);
            let ratio = smooth.map(|[light, residual, _]| residual / (light + least));
            let variance: f64 = (smooth.iter())
                .map(|[light, _, squared]| f64::from(squares(&kernel)) * squared / (light + least).powi(2))
                .sum();
            let size: f64 = ratio.iter().map(|r| r * r).sum();
            let doubt = f64::from(s.sure) * variance;
            // NaN, of infinities, is no agreement.
            let kept = if doubt < size { 1.0 - doubt / size } else { 0.0 };
            let noise: f64 = (smooth.iter())
                .map(|[light, _, squared]| (cell * cell) as f64 * squared / (light + least).powi(2) / 3.0)
                .sum();
            let kept = kept * noise / (noise + f64::from(s.noise).powi(2) + least);
            ratio.map(|r| (r * kept).max(f64::from(least_change)).min(f64::from(most_change)))
        })
        .collect();
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        if colours.colour(x, y, 3 * slot.first) == input(x, y) {
            continue;
        }
        let ((left, right, tx), (above, below, ty)) = (between(0, x, cell, across), between(first, y, cell, down));
        for c in 0..3 {
            let row = |y: usize| {
                let (a, b) = (changes[y * across + left][c], changes[y * across + right][c]);
                a + (b - a) * f64::from(tx)
            };
            let change = row(above) + (row(below) - row(above)) * f64::from(ty);
            for k in 0..slot.planes {
                let channel = 3 * (slot.first + k) + c;
                let value = f64::from(colours.at(x, y, channel));
                colours.set(x, y, channel, (value * (1.0 + change)) as f32);
            }
        }
    }
}
