//! The picture's anti-aliasing on rows: every sum in the order of the reference, so that the bits are the same.

use super::{believed, share, stands_before};
use crate::frame::Rgb;
use crate::kernels::clip::ColourBox;
use crate::kernels::math::{catmull_rom, luminance, three, ycocg_from_rgb};
use crate::settings::Antialiasing;

/// Columns beside a row that hold no surface, on both sides: the most that `thin_radius` may be.
pub(crate) const MARGIN: usize = 3;

/// Rows of a line, each of them `MARGIN`, the pixels in the host's order, `MARGIN`: depth, motion (x, y), YCoCg.
pub(crate) const ROWS: usize = 6;

/// A row of the frame, as all rows beside it need it.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a> {
    rows: &'a [f32],
    w: usize,
}

impl<'a> Line<'a> {
    /// Numbers of a line of `w` pixels.
    pub(crate) fn numbers(w: usize) -> usize {
        ROWS * (w + 2 * MARGIN)
    }

    /// `rows`: [`ROWS`] rows.
    pub(crate) fn new(rows: &'a [f32], w: usize) -> Self {
        Self { rows, w }
    }

    /// A row's pixels.
    #[inline(always)]
    fn row(&self, k: usize) -> &'a [f32] {
        &self.rows[k * (self.w + 2 * MARGIN) + MARGIN..][..self.w]
    }

    /// Of a row the `n` pixels that lie `dx - MARGIN` columns to the right of those from `x` on.
    #[inline(always)]
    fn beside(&self, k: usize, dx: usize, x: usize, n: usize) -> &'a [f32] {
        &self.rows[k * (self.w + 2 * MARGIN) + x + dx..][..n]
    }
}

/// Fills a line: `rows` holds depth and motion in the pixels' columns.
#[inline(always)]
pub(crate) fn complete_line(colours: &[Rgb], rows: &mut [f32]) {
    let w = colours.len();
    let (surfaces, converted) = rows.split_at_mut(3 * (w + 2 * MARGIN));
    let (c0, rest) = converted.split_at_mut(w + 2 * MARGIN);
    let (c1, c2) = rest.split_at_mut(w + 2 * MARGIN);
    let (c0, c1, c2) = (&mut c0[MARGIN..][..w], &mut c1[MARGIN..][..w], &mut c2[MARGIN..][..w]);
    for (x, colour) in colours.iter().enumerate() {
        let c = ycocg_from_rgb(*colour);
        (c0[x], c1[x], c2[x]) = (c[0], c[1], c[2]);
    }
    surfaces[..MARGIN].fill(f32::INFINITY);
    surfaces[MARGIN + w..][..MARGIN].fill(f32::INFINITY);
}

/// Lines above, here and below, as far as there are any.
pub(crate) type Lines<'a> = [Option<Line<'a>>; 3];

/// Motion (x, y) of the nearest depth in 3x3, of equally near ones the first in reading order; and the farthest depth.
#[inline(always)]
pub(crate) fn nearest_motion(lines: Lines<'_>, nearest: &mut [f32], farthest: &mut [f32], out: [&mut [f32]; 2]) {
    let w = nearest.len();
    let [x, y] = out;
    let (x, y, farthest) = (&mut x[..w], &mut y[..w], &mut farthest[..w]);
    if let Some(own) = lines[1] {
        x.copy_from_slice(own.row(1));
        y.copy_from_slice(own.row(2));
    }
    nearest.fill(f32::INFINITY);
    farthest.fill(0.0);
    for line in lines.into_iter().flatten() {
        for dx in 0..3 {
            let (first, from, n) = beside(dx, w);
            let (depth, mx, my) = (&line.row(0)[from..][..n], &line.row(1)[from..][..n], &line.row(2)[from..][..n]);
            let (x, y, nearest) = (&mut x[first..][..n], &mut y[first..][..n], &mut nearest[first..][..n]);
            let farthest = &mut farthest[first..][..n];
            for i in 0..n {
                let nearer = depth[i] < nearest[i];
                x[i] = if nearer { mx[i] } else { x[i] };
                y[i] = if nearer { my[i] } else { y[i] };
                nearest[i] = if nearer { depth[i] } else { nearest[i] };
                farthest[i] = if depth[i] > farthest[i] { depth[i] } else { farthest[i] };
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

/// Adds a line to the sums over 3x3 pixels: YCoCg, its squares, and the number of pixels, a row of each.
#[inline(always)]
pub(crate) fn add_line(line: Line<'_>, sums: &mut [f32]) {
    let w = line.w;
    for dx in 0..3 {
        let (first, from, n) = beside(dx, w);
        for k in 0..3 {
            let value = &line.row(3 + k)[from..][..n];
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

/// Most pixels that [`ranges_before`] looks at together, and of how many one must need it.
const WIDE: usize = 64;
const BLOCK: usize = 16;

/// For the pixels of a row the least and greatest YCoCg of what stands before `farthest` within `thin_radius` and moves with `motion`;
/// nothing does: +infinity and -infinity. `lines`: those within the radius, the pixels' own among them. `ranges`: three rows of the
/// least, three of the greatest; `near` is overwritten.
#[inline(always)]
pub(crate) fn ranges_before(
    s: &Antialiasing,
    lines: &[Line<'_>],
    farthest: &[f32],
    motion: [&[f32]; 2],
    near: &mut [f32],
    ranges: &mut [f32],
) {
    let w = farthest.len();
    let (low, high) = ranges.split_at_mut(3 * w);
    low.fill(f32::INFINITY);
    high.fill(f32::NEG_INFINITY);
    let radius = s.thin_radius as usize;
    if radius == 0 {
        return;
    }
    // The nearest of each column.
    let near = &mut near[..w + 2 * MARGIN];
    near.fill(f32::INFINITY);
    for line in lines {
        let depth = &line.rows[..w + 2 * MARGIN];
        for x in 0..w + 2 * MARGIN {
            near[x] = if depth[x] < near[x] { depth[x] } else { near[x] };
        }
    }
    let needs = |x: usize| {
        let end = (x + BLOCK).min(w);
        let mut far = 0.0f32;
        for value in &farthest[x..end] {
            far = if *value > far { *value } else { far };
        }
        let mut least = f32::INFINITY;
        for value in &near[x + MARGIN - radius..end + MARGIN + radius] {
            least = if *value < least { *value } else { least };
        }
        stands_before(least, far, s)
    };
    let mut x = 0;
    while x < w {
        if !needs(x) {
            x += BLOCK;
            continue;
        }
        let mut end = x + BLOCK;
        while end < w && end - x < WIDE && needs(end) {
            end += BLOCK;
        }
        let n = end.min(w) - x;
        let motion = [&motion[0][x..][..n], &motion[1][x..][..n]];
        let (least, most) = run_before(s, lines, x, &farthest[x..][..n], motion);
        for k in 0..3 {
            low[k * w + x..][..n].copy_from_slice(&least[k][..n]);
            high[k * w + x..][..n].copy_from_slice(&most[k][..n]);
        }
        x = end;
    }
}

/// [`ranges_before`] for the pixels of a row from `x` on.
#[inline(always)]
fn run_before(
    s: &Antialiasing,
    lines: &[Line<'_>],
    x: usize,
    farthest: &[f32],
    motion: [&[f32]; 2],
) -> ([[f32; WIDE]; 3], [[f32; WIDE]; 3]) {
    let n = farthest.len().min(WIDE);
    let radius = s.thin_radius as usize;
    let (mut counts, mut least, mut most) = ([0u32; WIDE], [[f32::INFINITY; WIDE]; 3], [[f32::NEG_INFINITY; WIDE]; 3]);
    let (counts, ux, uy, farthest) = (&mut counts[..n], &motion[0][..n], &motion[1][..n], &farthest[..n]);
    for line in lines {
        for dx in MARGIN - radius..=MARGIN + radius {
            let [depth, mx, my] = [line.beside(0, dx, x, n), line.beside(1, dx, x, n), line.beside(2, dx, x, n)];
            for i in 0..n {
                let before = stands_before(depth[i], farthest[i], s);
                let (ax, ay) = ((mx[i] - ux[i]).abs(), (my[i] - uy[i]).abs());
                counts[i] = u32::from(before & (ax <= s.thin_motion) & (ay <= s.thin_motion));
            }
            for k in 0..3 {
                let colour = line.beside(3 + k, dx, x, n);
                let (least, most) = (&mut least[k][..n], &mut most[k][..n]);
                for i in 0..n {
                    let c = colour[i];
                    least[i] = if (counts[i] != 0) & (c < least[i]) { c } else { least[i] };
                    most[i] = if (counts[i] != 0) & (c > most[i]) { c } else { most[i] };
                }
            }
        }
    }
    (least, most)
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

/// Makes `ranges` of [`ranges_before`] boxes that also hold mean and deviation, from `sums` of [`add_line`].
#[inline(always)]
pub(crate) fn boxes(s: &Antialiasing, sums: &[f32], ranges: &mut [f32]) {
    let w = ranges.len() / 6;
    let (low, high) = ranges.split_at_mut(3 * w);
    let count = &sums[6 * w..][..w];
    for c in 0..3 {
        let (sum, squares) = (&sums[c * w..][..w], &sums[(3 + c) * w..][..w]);
        let (low, high) = (&mut low[c * w..][..w], &mut high[c * w..][..w]);
        for x in 0..w {
            let mean = sum[x] / count[x];
            let deviation = (squares[x] / count[x] - mean * mean).max(0.0).sqrt();
            let (least, most) = (mean - s.gamma * deviation, mean + s.gamma * deviation);
            low[x] = if low[x] < least { low[x] } else { least };
            high[x] = if high[x] > most { high[x] } else { most };
        }
    }
}

/// The blend with the history that is clamped to `boxes`, rows of the least and of the greatest YCoCg; the new frames go to `held`.
#[inline(always)]
pub(crate) fn resolve(
    s: &Antialiasing,
    now: &[Rgb],
    fetched: &Fetched<'_>,
    boxes: &[f32],
    out: &mut [Rgb],
    held: &mut [f32],
) {
    let w = now.len();
    let (colour, frames, between) = (&fetched.colour[..3 * w], &fetched.frames[..w], &fetched.between[..2 * w]);
    let (boxes, out, held) = (&boxes[..6 * w], &mut out[..w], &mut held[..w]);
    for x in 0..w {
        let then = three(|c| colour[c * w + x].max(0.0));
        let bounds = ColourBox { low: three(|c| boxes[c * w + x]), high: three(|c| boxes[(3 + c) * w + x]) };
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
