//! What a picture shows without its noise, and how far that may be off: by it `stabilise` counts a neighbour in time.

use super::{LEAST_NOISE, Likeness, POOL};
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Stabilise;

/// As [`super::reference::likeness`].
pub(crate) fn run(picture: &Plane<Rgb>, raw: &Plane<Rgb>, s: &Stabilise) -> Likeness {
    let size = picture.size();
    let median = par::plane(size, |x, y| median(picture, x, y));
    let guide = par::plane(size, |x, y| binomial(&median, x, y));
    let fine = par::plane(size, |x, y| squared(picture.at(x, y), binomial(picture, x, y)));
    let noise = par::plane(size, |x, y| squared(picture.at(x, y), raw.at(x, y)));
    let tolerance = par::plane(size, |x, y| {
        let (noise, g) = (mean(&noise, POOL, x, y), guide.at(x, y));
        let calm = s.low_noise * s.low_noise * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
        let share = noise / (noise + calm + LEAST_NOISE);
        (s.likeness * mean(&fine, 1, x, y)).min(s.residue * share * share * noise)
    });
    Likeness { guide, tolerance }
}

fn squared(a: Rgb, b: Rgb) -> f32 {
    (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2])
}

/// Rows or columns around `v`; beyond the border the border counts.
fn around(v: usize, extent: usize) -> [usize; 3] {
    [v.saturating_sub(1), v, (v + 1).min(extent - 1)]
}

fn median(plane: &Plane<Rgb>, x: usize, y: usize) -> Rgb {
    let size = plane.size();
    let (xs, ys) = (around(x, size.width), around(y, size.height));
    let of = |c: usize| {
        let mut v = [0.0f32; 9];
        for (j, y) in ys.iter().enumerate() {
            for (i, x) in xs.iter().enumerate() {
                v[3 * j + i] = plane.at(*x, *y)[c];
            }
        }
        *v.select_nth_unstable_by(4, f32::total_cmp).1
    };
    [of(0), of(1), of(2)]
}

fn binomial(plane: &Plane<Rgb>, x: usize, y: usize) -> Rgb {
    let size = plane.size();
    let (xs, ys) = (around(x, size.width), around(y, size.height));
    let mut sum = [0.0f32; 3];
    for (j, y) in ys.iter().enumerate() {
        for (i, x) in xs.iter().enumerate() {
            let share = [0.25, 0.5, 0.25][i] * [0.25, 0.5, 0.25][j];
            let c = plane.at(*x, *y);
            for k in 0..3 {
                sum[k] += share * c[k];
            }
        }
    }
    sum
}

fn mean(plane: &Plane<f32>, radius: usize, x: usize, y: usize) -> f32 {
    let Size { width, height } = plane.size();
    let (mut sum, mut n) = (0.0f32, 0.0f32);
    for qy in y.saturating_sub(radius)..(y + radius + 1).min(height) {
        for qx in x.saturating_sub(radius)..(x + radius + 1).min(width) {
            sum += plane.at(qx, qy);
            n += 1.0;
        }
    }
    sum / n
}

/// What is left of a neighbour's weight where the guides differ by more than both tolerances.
pub(crate) fn share(here: (Rgb, f32), there: (Rgb, f32)) -> f32 {
    let t = here.1 + there.1;
    let d = squared(here.0, there.0);
    if d > 0.0 { t / (t + d) } else { 1.0 }
}
