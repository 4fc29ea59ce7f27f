//! The picture's anti-aliasing on rows: every sum in the order of the reference, so that the bits are the same.

use super::{believed, share};
use crate::frame::Rgb;
use crate::kernels::clip::ColourBox;
use crate::kernels::math::{catmull_rom, luminance, three, ycocg_from_rgb};
use crate::settings::Antialiasing;

/// Rows above, here and below, as far as there are any.
pub(crate) type Lines<'a> = [Option<&'a [f32]>; 3];

/// Motion (x, y) of the nearest depth in 3x3; of equally near ones the first in reading order. `motion` holds rows of x, then of y.
#[inline(always)]
pub(crate) fn nearest_motion(depth: Lines<'_>, motion: Lines<'_>, nearest: &mut [f32], out: [&mut [f32]; 2]) {
    let w = nearest.len();
    let [x, y] = out;
    let (x, y) = (&mut x[..w], &mut y[..w]);
    if let Some(own) = motion[1] {
        x.copy_from_slice(&own[..w]);
        y.copy_from_slice(&own[w..2 * w]);
    }
    nearest.fill(f32::INFINITY);
    for line in 0..3 {
        let (Some(depth), Some(motion)) = (depth[line], motion[line]) else { continue };
        for dx in 0..3 {
            // Pixels whose neighbour lies in the row: those from `first` on, their neighbours from `from` on.
            let (first, from, n) = beside(dx, w);
            let (depth, mx, my) = (&depth[from..][..n], &motion[from..][..n], &motion[w + from..][..n]);
            let (x, y, nearest) = (&mut x[first..][..n], &mut y[first..][..n], &mut nearest[first..][..n]);
            for i in 0..n {
                let nearer = depth[i] < nearest[i];
                x[i] = if nearer { mx[i] } else { x[i] };
                y[i] = if nearer { my[i] } else { y[i] };
                nearest[i] = if nearer { depth[i] } else { nearest[i] };
            }
        }
    }
}

/// Of a row of `w` pixels those that have a neighbour `dx - 1` columns to the right: the first of them, the first's neighbour, how many.
#[inline(always)]
fn beside(dx: usize, w: usize) -> (usize, usize, usize) {
    match dx {
        0 => (1.min(w), 0, w.saturating_sub(1)),
        1 => (0, 0, w),
        _ => (0, 1.min(w), w.saturating_sub(1)),
    }
}

/// Adds a row to the sums over 3x3 pixels: YCoCg, its squares, and the number of pixels, a row of each.
#[inline(always)]
pub(crate) fn add_line(line: &[Rgb], converted: &mut [f32], sums: &mut [f32]) {
    let w = line.len();
    for (x, colour) in line.iter().enumerate() {
        let c = ycocg_from_rgb(*colour);
        (converted[x], converted[w + x], converted[2 * w + x]) = (c[0], c[1], c[2]);
    }
    for dx in 0..3 {
        let (first, from, n) = beside(dx, w);
        for k in 0..3 {
            let value = &converted[k * w + from..][..n];
            let (sum, squares) = sums.split_at_mut(3 * w);
            let (sum, squares) = (&mut sum[k * w + first..][..n], &mut squares[k * w + first..][..n]);
            for i in 0..n {
                sum[i] += value[i];
                squares[i] += value[i] * value[i];
            }
        }
        let count = &mut sums[6 * w + first..][..n];
        for i in 0..n {
            count[i] += 1.0;
        }
    }
}

/// What history was fetched for a run of pixels.
pub(crate) struct Fetched<'a> {
    /// Rows of red, green, blue.
    pub(crate) colour: &'a [f32],
    /// Frames that it holds; 0: none.
    pub(crate) frames: &'a [f32],
    /// Its place between pixels: a row of u, one of v.
    pub(crate) between: &'a [f32],
}

/// The blend with the clamped history; the new frames go to `held`.
#[inline(always)]
pub(crate) fn resolve(
    s: &Antialiasing,
    now: &[Rgb],
    fetched: &Fetched<'_>,
    sums: &[f32],
    out: &mut [Rgb],
    held: &mut [f32],
) {
    let w = now.len();
    let (colour, frames, between) = (&fetched.colour[..3 * w], &fetched.frames[..w], &fetched.between[..2 * w]);
    let (sums, out, held) = (&sums[..7 * w], &mut out[..w], &mut held[..w]);
    for x in 0..w {
        let then = three(|c| colour[c * w + x].max(0.0));
        let count = sums[6 * w + x];
        let mean = three(|c| sums[c * w + x] / count);
        let deviation = three(|c| (sums[(3 + c) * w + x] / count - mean[c] * mean[c]).max(0.0).sqrt());
        let bounds = ColourBox {
            low: three(|c| mean[c] - s.gamma * deviation[c]),
            high: three(|c| mean[c] + s.gamma * deviation[c]),
        };
        let clamped = bounds.clamp(then);
        let frames = frames[x];
        let counted = believed(frames, luminance(then), luminance(clamped), s);
        let a = share(counted, [between[x], between[w + x]], s);
        let is_known = frames > 0.0;
        let blended = three(|c| (1.0 - a) * clamped[c] + a * now[x][c]);
        out[x] = three(|c| if is_known { blended[c] } else { now[x][c] });
        held[x] = if is_known { (counted + 1.0).min(1.0 / s.least) } else { 1.0 };
    }
}

/// The history of a picture: its rows, in each the reds, the greens, the blues, then how many frames the pixels hold.
#[derive(Clone, Debug, Default)]
pub(crate) struct History {
    pub(crate) rows: Vec<f32>,
}

/// Numbers of a pixel in [`History`].
pub(crate) const CHANNELS: usize = 4;

/// Places in the history of a row of pixels.
pub(crate) struct Places<'a> {
    /// Rows of x and y.
    pub(crate) coordinate: &'a [f32],
    /// The host's trust in history.
    pub(crate) trusted: Option<&'a [f32]>,
}

/// What [`fetch`] writes: as [`Fetched`].
pub(crate) struct Target<'a> {
    pub(crate) colour: &'a mut [f32],
    pub(crate) frames: &'a mut [f32],
    pub(crate) between: &'a mut [f32],
}

/// Fetches a row's history: pixels beside each other that moved alike at once.
#[inline(always)]
pub(crate) fn fetch(history: &History, (w, h): (usize, usize), places: &Places<'_>, to: &mut Target<'_>) {
    to.colour[..3 * w].fill(0.0);
    to.frames[..w].fill(0.0);
    let base = |x: usize| {
        let (px, py) = (places.coordinate[x], places.coordinate[w + x]);
        // Unknown motion compares false everywhere.
        let inside = (px >= 0.0) & (py >= 0.0) & (px <= w as f32) & (py <= h as f32);
        let (x, y) = ((px - 0.5).floor(), (py - 0.5).floor());
        inside.then_some((x as isize, y as isize))
    };
    for x in 0..w {
        let (px, py) = (places.coordinate[x] - 0.5, places.coordinate[w + x] - 0.5);
        (to.between[x], to.between[w + x]) = (px - px.floor(), py - py.floor());
    }
    let mut x = 0;
    while x < w {
        let Some((bx, by)) = base(x) else {
            x += 1;
            continue;
        };
        let mut n = 1;
        while n < RUN && x + n < w && base(x + n) == Some((bx + n as isize, by)) {
            n += 1;
        }
        // Rows beyond the picture's edges are those at them; a run of columns must lie within, and ends where it no longer does.
        let whole = bx >= 1 && bx + 3 <= w as isize;
        n = n.min((w as isize - 2 - bx).max(1) as usize);
        if whole {
            run(history, (w, h), (x, n), (bx as usize, by), to);
        } else {
            n = 1;
            single(history, (w, h), x, (bx, by), to);
        }
        x += n;
    }
    if let Some(trusted) = places.trusted {
        for (frames, trust) in to.frames[..w].iter_mut().zip(trusted) {
            *frames *= trust;
        }
    }
    for frames in &mut to.frames[..w] {
        *frames = if *frames > 0.0 { *frames } else { 0.0 };
    }
}

/// Most pixels that are fetched together.
const RUN: usize = 64;

/// The pixels `x..x + n`, whose places lie in row `by`, from column `bx` on.
#[inline(always)]
fn run(
    history: &History,
    (w, h): (usize, usize),
    (x, n): (usize, usize),
    (bx, by): (usize, isize),
    to: &mut Target<'_>,
) {
    let line = |j: isize| {
        let row = (by + j).clamp(0, h as isize - 1) as usize;
        &history.rows[row * CHANNELS * w..][..CHANNELS * w]
    };
    let (mut along, mut across) = ([[0.0; RUN]; 4], [[0.0; RUN]; 4]);
    for i in 0..n {
        let (u, v) = (catmull_rom(to.between[x + i]), catmull_rom(to.between[w + x + i]));
        for k in 0..4 {
            (along[k][i], across[k][i]) = (u[k], v[k]);
        }
    }
    for j in 0..4 {
        let row = line(j as isize - 1);
        for k in 0..4 {
            let (along, across) = (&along[k][..n], &across[j][..n]);
            for c in 0..3 {
                let from = &row[c * w + bx + k - 1..][..n];
                let sum = &mut to.colour[c * w + x..][..n];
                for i in 0..n {
                    sum[i] += along[i] * across[i] * from[i];
                }
            }
        }
    }
    let (u, v) = to.between.split_at(w);
    let (u, v) = (&u[x..][..n], &v[x..][..n]);
    for j in 0..2 {
        let frames = &line(j)[3 * w..];
        for k in 0..2 {
            let from = &frames[bx + k..][..n];
            let sum = &mut to.frames[x..][..n];
            for i in 0..n {
                let across = if j == 0 { 1.0 - v[i] } else { v[i] };
                let along = if k == 0 { 1.0 - u[i] } else { u[i] };
                sum[i] += along * across * from[i];
            }
        }
    }
}

/// One pixel, wherever its place lies; beyond the edge the edge counts.
#[inline(never)]
fn single(history: &History, (w, h): (usize, usize), x: usize, (bx, by): (isize, isize), to: &mut Target<'_>) {
    let at = |i: isize, j: isize, c: usize| {
        let (column, row) = ((bx + i).clamp(0, w as isize - 1), (by + j).clamp(0, h as isize - 1));
        history.rows[(row as usize * CHANNELS + c) * w + column as usize]
    };
    let (u, v) = (to.between[x], to.between[w + x]);
    for (j, across) in (-1..3).zip(catmull_rom(v)) {
        for (i, along) in (-1..3).zip(catmull_rom(u)) {
            for c in 0..3 {
                to.colour[c * w + x] += along * across * at(i, j, c);
            }
        }
    }
    for (j, across) in [(0, 1.0 - v), (1, v)] {
        for (i, along) in [(0, 1.0 - u), (1, u)] {
            to.frames[x] += along * across * at(i, j, 3);
        }
    }
}
