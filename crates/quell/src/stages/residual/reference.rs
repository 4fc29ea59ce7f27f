//! The specification of `residual`.

use super::{
    LEAST, LEAST_VARIANCE, LEVELS, MOST_SURE, PICTURE_LEVELS, Trust, between, cells, holding, shown, squares, triangle,
};
use crate::frame::Rgb;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Residual;
use crate::stages::recombine::raw;
use crate::window::{LightSlot, PreparedFrame, Rows, Samples};
use std::ops::Range;

/// The filtered light of `frame` (`colours`: three channels a colour plane of `slots`, in the units of the light as it came: divided by the
/// surface's colour), corrected, on the whole image or band. Light that is noise-free comes out as it went in.
pub fn run(frame: &PreparedFrame, slots: &[LightSlot], mut colours: Rows, s: &Residual) -> Rows {
    let noisy = |slot: &&LightSlot| matches!(frame.stored[slot.light], Samples::Black | Samples::Packed(_));
    let (w, first) = (frame.features.size.width, frame.features.first_row);
    for slot in slots.iter().filter(noisy) {
        let own = |x: usize, y: usize| raw(frame, slot, 0, y * w + x).unwrap_or_default();
        correct(&LEVELS, first, &own, (&mut colours, slot.first..slot.first + slot.planes), Trust::of_lights(s));
    }
    colours
}

/// The stabilised `picture` of a frame whose first row is row `first` of the whole picture, corrected by the frame's `input`.
pub fn picture(first: usize, input: &Plane<Rgb>, mut picture: Plane<Rgb>, s: &Residual) -> Plane<Rgb> {
    let mut rows = Rows::new(picture.size(), 3);
    let pixels = |size: Size| (0..size.height).flat_map(move |y| (0..size.width).map(move |x| (x, y)));
    for (x, y) in pixels(picture.size()) {
        (0..3).for_each(|c| rows.set(x, y, c, picture.at(x, y)[c]));
    }
    correct(&PICTURE_LEVELS, first, &|x, y| input.at(x, y), (&mut rows, 0..1), Trust::of_picture(s));
    for (x, y) in pixels(picture.size()) {
        picture.set(x, y, rows.colour(x, y, 0));
    }
    picture
}

/// All levels of one light: `own` has it as it came, the first of the `planes` of `colours` filtered; all of them are corrected.
fn correct(
    levels: &[(usize, usize)],
    first: usize,
    own: &dyn Fn(usize, usize) -> Rgb,
    (colours, planes): (&mut Rows, Range<usize>),
    trust: Trust,
) {
    let mut noise = None;
    for &kind in levels {
        noise = Some(level(first, own, (&mut *colours, &planes), (kind, noise), trust));
    }
}

/// Of each cell of the coarsest level the squared relative noise of a pixel around it, summed over the channels.
struct Noise {
    across: usize,
    squared: Vec<f64>,
}

/// One level. `noise`: what the coarsest level found.
fn level(
    first: usize,
    own: &dyn Fn(usize, usize) -> Rgb,
    (colours, planes): (&mut Rows, &Range<usize>),
    ((cell, radius), noise): ((usize, usize), Option<Noise>),
    trust: Trust,
) -> Noise {
    let (w, h) = (colours.size().width, colours.size().height);
    let (across, down) = (cells(0, w, cell), cells(first, h, cell));
    let of = |x: usize, y: usize| (first % cell + y) / cell * across + x / cell;
    // Of each cell and channel the sums of the filtered light, of the residual and of its square.
    let mut sums = vec![[[0.0f64; 3]; 3]; across * down];
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        let (filtered, own) = (colours.colour(x, y, 3 * planes.start), own(x, y));
        for c in 0..3 {
            let residual = f64::from(own[c]) - f64::from(filtered[c]);
            let sums = &mut sums[of(x, y)][c];
            *sums = [sums[0] + f64::from(filtered[c]), sums[1] + residual, sums[2] + residual * residual];
        }
    }
    let kernel = triangle(radius);
    let near = |v: usize, limit: usize| v.saturating_sub(2 * radius)..(v + 2 * radius + 1).min(limit);
    let (pixels, least) = ((cell * cell) as f64, f64::from(LEAST));
    let relative = |sums: &[[f64; 3]; 3]| -> f64 {
        sums.iter().map(|[light, _, squared]| pixels * squared / (light + least).powi(2)).sum()
    };
    // Of each cell the smoothed sums, and the mean of the cells' own noise.
    let smooth: Vec<([[f64; 3]; 3], f64)> = (0..across * down)
        .map(|place| {
            let (x, y) = (place % across, place / across);
            let (mut smooth, mut around, mut whole) = ([[0.0f64; 3]; 3], 0.0, 0.0);
            let (columns, rows) = (near(x, across), near(y, down));
            for (u, v) in rows.flat_map(|v| columns.clone().map(move |u| (u, v))) {
                let k = f64::from(kernel[u.abs_diff(x)]) * f64::from(kernel[v.abs_diff(y)]);
                let sums = &sums[v * across + u];
                for (smooth, sums) in smooth.iter_mut().flatten().zip(sums.iter().flatten()) {
                    *smooth += k * sums;
                }
                (around, whole) = (around + k * relative(sums), whole + k);
            }
            (smooth, around / whole)
        })
        .collect();
    let is_coarsest = noise.is_none();
    let noise = noise.unwrap_or_else(|| Noise { across, squared: smooth.iter().map(|(_, around)| *around).collect() });
    // Of each cell the relative residual, its squared length, the squared noise of a pixel, and its least.
    let found: Vec<([f64; 3], f64, f64, f64)> = (0..across * down)
        .map(|place| {
            let sums = &smooth[place].0;
            let ratio = sums.map(|[light, residual, _]| residual / (light + least));
            let (x, y) = (holding(0, place % across, cell), holding(first, place / across, cell));
            let around = noise.squared[y * noise.across + x];
            (ratio, ratio.iter().map(|r| r * r).sum(), relative(sums).max(around), around)
        })
        .collect();
    // Variance of a residual, for the windows around.
    let variance = |place: usize| -> f64 {
        let (sums, (ratio, _, _, around)) = (&smooth[place].0, found[place]);
        let noise: f64 = sums
            .iter()
            .zip(ratio)
            .map(|([light, _, squared], r)| pixels * squared / ((light + least).powi(2) * f64::from(shown(r as f32))))
            .sum();
        f64::from(squares(&kernel)) * noise.max(around) / pixels + f64::from(LEAST_VARIANCE)
    };
    // How much of its residual a cell keeps by the windows around.
    let kept_around = |place: usize| -> f64 {
        let Some(limit) = trust.around.filter(|_| is_coarsest) else { return 0.0 };
        let (x, y) = (place % across, place / across);
        let known = |place: usize| found[place].1.is_finite() && variance(place).is_finite();
        let (mut certainty, mut inverse, mut whole) = (0.0, 0.0, 0.0);
        for (u, v) in near(y, down).flat_map(|v| near(x, across).map(move |u| (u, v))) {
            let k = f64::from(kernel[u.abs_diff(x)]) * f64::from(kernel[v.abs_diff(y)]);
            let there = v * across + u;
            whole += k;
            if known(there) {
                certainty += k * (found[there].1 / variance(there)).min(f64::from(MOST_SURE));
                inverse += k / variance(there);
            }
        }
        let beyond = certainty - f64::from(limit) * whole;
        // The squared residual to expect beyond the noise, over the cell's own variance.
        let expected = if beyond > 0.0 && known(place) { beyond / inverse / variance(place) } else { 0.0 };
        expected / (expected + 1.0)
    };
    // What a cell is multiplied by, less 1.
    let [least_change, most_change] = trust.change;
    let changes: Vec<[f64; 3]> = (0..across * down)
        .map(|place| {
            let (ratio, size, squared, _) = found[place];
            let doubt = f64::from(trust.sure) * f64::from(squares(&kernel)) * squared / pixels;
            // NaN, of infinities, is no agreement.
            let kept = if doubt < size { 1.0 - doubt / size } else { 0.0 };
            let share = squared / (squared + 3.0 * (f64::from(trust.noise) + least));
            let kept = if squared.is_finite() { kept * share } else { 0.0 };
            let kept = kept.max(kept_around(place));
            ratio.map(|r| (r * kept).max(f64::from(least_change)).min(f64::from(most_change)))
        })
        .collect();
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        if colours.colour(x, y, 3 * planes.start) == own(x, y) {
            continue;
        }
        let ((left, right, tx), (above, below, ty)) = (between(0, x, cell, across), between(first, y, cell, down));
        for c in 0..3 {
            let row = |y: usize| {
                let (a, b) = (changes[y * across + left][c], changes[y * across + right][c]);
                a + (b - a) * f64::from(tx)
            };
            let change = row(above) + (row(below) - row(above)) * f64::from(ty);
            for plane in planes.clone() {
                let value = f64::from(colours.at(x, y, 3 * plane + c));
                colours.set(x, y, 3 * plane + c, (value * (1.0 + change)) as f32);
            }
        }
    }
    noise
}
