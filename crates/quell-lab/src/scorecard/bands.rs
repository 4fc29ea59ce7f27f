//! Bands of a picture: plain Gaussians, and Gaussians that stop at edges.
//!
//! ```text
//! G_s(x)  a Gaussian of sigma s; beyond the border the last pixel repeats
//! F(x)    x - G_1.5(x), the fine band
//! M(x)    G_5(x) - G_16(x), the band of blotches
//! E_s(x)  a Gaussian of sigma s over the pixels that show the same surface: same id, normal, plane
//! ```
//!
//! Radii are pixels of a picture of 225 rows and scale with the height ([`Radii`]).

use super::surfaces::Surfaces;
use crate::metrics::flip::convolved;
use quell::{Plane, Size};
use rayon::prelude::*;

/// One number a pixel.
pub type Map = Plane<f32>;

/// Kernels end after so many standard deviations.
const REACH: f32 = 3.0;
/// No Gaussian is narrower, pixels.
const LEAST_SIGMA: f32 = 0.5;
/// The height for which radii are given.
const ROWS: f32 = 225.0;

/// Converts radii that are given for 225 rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radii(f32);

impl Radii {
    /// For pictures of this extent.
    pub fn of(size: Size) -> Self {
        Self(size.height as f32 / ROWS)
    }

    /// Pixels of this picture for `px` pixels at 225 rows.
    pub fn px(self, px: f32) -> f32 {
        px * self.0
    }

    /// Sigma of a Gaussian, pixels of this picture: at least half a pixel, below which it would do nothing.
    fn sigma(self, px: f32) -> f32 {
        self.px(px).max(LEAST_SIGMA)
    }

    /// G_s, `sigma` in pixels at 225 rows.
    pub fn gaussian(self, map: &Map, sigma: f32) -> Map {
        let row = gaussian_row(self.sigma(sigma));
        convolved(map, &row, &row)
    }

    /// F: the map without its Gaussian of 1.5.
    pub fn fine(self, map: &Map) -> Map {
        difference(map, &self.gaussian(map, FINE))
    }

    /// M: the Gaussian of 5 without that of 16.
    pub fn blotches(self, map: &Map) -> Map {
        difference(&self.gaussian(map, 5.0), &self.gaussian(map, 16.0))
    }
}

/// Sigma of the fine band, pixels at 225 rows.
pub const FINE: f32 = 1.5;

/// A normalised Gaussian over -r..=r; the identity for a sigma too small to matter.
fn gaussian_row(sigma: f32) -> Vec<f32> {
    let radius = (REACH * sigma).ceil().max(0.0) as i32;
    let row: Vec<f32> = (-radius..=radius).map(|x| spatial((x * x) as f32, sigma)).collect();
    let sum: f32 = row.iter().sum();
    row.into_iter().map(|v| v / sum).collect()
}

fn spatial(squared: f32, sigma: f32) -> f32 {
    (-squared / (2.0 * sigma * sigma).max(1e-6)).exp()
}

/// a - b.
pub fn difference(a: &Map, b: &Map) -> Map {
    combined(a, b, |a, b| a - b)
}

/// `f` of each pixel of both; the extent is that of `a`.
pub fn combined(a: &Map, b: &Map, f: impl Fn(f32, f32) -> f32) -> Map {
    let mut out = a.clone();
    for (a, b) in out.data_mut().iter_mut().zip(b.data()) {
        *a = f(*a, *b);
    }
    out
}

/// `f` of each pixel.
pub fn mapped(a: &Map, f: impl Fn(f32) -> f32) -> Map {
    let mut out = a.clone();
    out.data_mut().iter_mut().for_each(|v| *v = f(*v));
    out
}

/// E_s of every map for every sigma (pixels at 225 rows): `out[map][sigma]`. Pixels without a surface stay as they are.
pub fn edge_stopping(surfaces: &Surfaces<'_>, maps: &[&Map], sigmas: &[f32]) -> Vec<Vec<Map>> {
    edge_stopping_by(surfaces, maps, sigmas, 1, None)
}

/// [`edge_stopping`] from every `step`-th pixel of a row and column, for maps that are smooth already, and from and for pixels
/// where `mask` is not 0 only.
fn edge_stopping_by(
    surfaces: &Surfaces<'_>,
    maps: &[&Map],
    sigmas: &[f32],
    step: usize,
    mask: Option<&Map>,
) -> Vec<Vec<Map>> {
    let allowed = |i: usize| mask.is_none_or(|m| m.data()[i] != 0.0);
    let size = surfaces.size();
    let radii = Radii::of(size);
    let step = step.max(1) as isize;
    let sigmas: Vec<f32> = sigmas.iter().map(|&s| radii.sigma(s)).collect();
    let reach = sigmas.iter().map(|s| REACH * s).fold(0.0, f32::max);
    let radius = (reach / step as f32).ceil() as isize;
    // A disc of taps with a weight for each sigma, 0 beyond its own reach.
    let mut taps: Vec<(isize, isize)> = Vec::new();
    let mut weights: Vec<f32> = Vec::new();
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let (dx, dy) = (step * dx, step * dy);
            let squared = (dx * dx + dy * dy) as f32;
            if squared.sqrt() <= reach {
                taps.push((dx, dy));
                weights.extend(
                    sigmas.iter().map(|&s| if squared.sqrt() <= REACH * s { spatial(squared, s) } else { 0.0 }),
                );
            }
        }
    }
    let (kinds, count) = (sigmas.len(), maps.len());
    let rows: Vec<Vec<f32>> = (0..size.height)
        .into_par_iter()
        .map(|y| {
            let mut out = Vec::with_capacity(size.width * kinds * count);
            let mut sums = vec![0.0f32; kinds * count];
            let mut totals = vec![0.0f32; kinds];
            for x in 0..size.width {
                let centre = y * size.width + x;
                let Some(here) = surfaces.element(centre).filter(|_| allowed(centre)) else {
                    maps.iter().for_each(|m| out.extend(std::iter::repeat_n(m.data()[centre], kinds)));
                    continue;
                };
                sums.fill(0.0);
                totals.fill(0.0);
                for (&(dx, dy), w) in taps.iter().zip(weights.chunks_exact(kinds)) {
                    let (tx, ty) = (x as isize + dx, y as isize + dy);
                    if !size.contains(tx, ty) {
                        continue;
                    }
                    let tap = ty as usize * size.width + tx as usize;
                    if !allowed(tap) || !surfaces.continues(&here, tap) {
                        continue;
                    }
                    for (total, w) in totals.iter_mut().zip(w) {
                        *total += w;
                    }
                    for (sums, map) in sums.chunks_exact_mut(kinds).zip(maps) {
                        let value = map.data()[tap];
                        for (sum, w) in sums.iter_mut().zip(w) {
                            *sum += w * value;
                        }
                    }
                }
                for sums in sums.chunks_exact(kinds) {
                    // The centre itself always counts, so no total is 0.
                    out.extend(sums.iter().zip(&totals).map(|(s, t)| s / t));
                }
            }
            out
        })
        .collect();
    (0..count)
        .map(|m| (0..kinds).map(|k| Plane::from_fn(size, |x, y| rows[y][(x * count + m) * kinds + k])).collect())
        .collect()
}

/// The band E_3(x) - E_12(x) of a map on each surface, over the pixels where `mask` is 1; else 0. Each Gaussian is
/// taken of the narrower one's result, from pixels further apart.
pub fn surface_band(surfaces: &Surfaces<'_>, map: &Map, mask: &Map) -> Map {
    let radii = Radii::of(surfaces.size());
    let (mut smooth, mut reached, mut near) = (map.clone(), 0.0_f32, None);
    // Sigma, and how far apart pixels are taken; at 225 rows.
    for (sigma, step) in [(FINE, 1.0), (NARROW, 2.0), (WIDE, 4.0)] {
        let step = radii.px(step).round().max(1.0) as usize;
        // Variances of Gaussians add up.
        let rest = (sigma * sigma - reached * reached).sqrt();
        let found = edge_stopping_by(surfaces, &[&smooth], &[rest], step, Some(mask)).pop().and_then(|mut k| k.pop());
        let before = std::mem::replace(&mut smooth, found.unwrap_or_else(|| map.clone()));
        near = Some(before);
        reached = sigma;
    }
    let near = near.unwrap_or_else(|| map.clone());
    combined(&difference(&near, &smooth), mask, |v, m| v * m)
}

/// Sigmas of the band's ends, pixels at 225 rows. The narrow one is wide enough that lost detail, which `blur` scores,
/// hardly counts.
const NARROW: f32 = 3.0;
const WIDE: f32 = 12.0;

/// Pixels within `radius` (pixels of this picture) of a marked one.
pub fn dilated(marked: &Plane<bool>, radius: f32) -> Plane<bool> {
    let size = marked.size();
    let reach = radius.floor() as isize;
    let half_widths: Vec<(isize, isize)> =
        (-reach..=reach).map(|dy| (dy, (radius * radius - (dy * dy) as f32).max(0.0).sqrt() as isize)).collect();
    let mut out = Plane::filled(size, false);
    for y in 0..size.height {
        for x in 0..size.width {
            if !marked.at(x, y) {
                continue;
            }
            for &(dy, half) in &half_widths {
                let ty = y as isize + dy;
                if ty < 0 || ty >= size.height as isize {
                    continue;
                }
                let from = (x as isize - half).max(0) as usize;
                let to = ((x as isize + half) as usize + 1).min(size.width);
                out.row_mut(ty as usize)[from..to].fill(true);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_keep_constants_and_have_their_variance() {
        let size = Size::new(61, 225);
        let radii = Radii::of(size);
        let constant = radii.gaussian(&Plane::filled(size, 3.0), 5.0);
        assert!(constant.data().iter().all(|v| (v - 3.0).abs() < 1e-5));
        let mut point = Plane::filled(size, 0.0);
        point.set(30, 112, 1.0);
        let spread = radii.gaussian(&point, 3.0);
        let variance: f32 = (0..61).map(|x| spread.at(x, 112) * (x as f32 - 30.0).powi(2)).sum::<f32>()
            / (0..61).map(|x| spread.at(x, 112)).sum::<f32>();
        assert!((variance.sqrt() - 3.0).abs() < 0.1, "{variance}");
        // Twice the rows, twice the pixels.
        assert_eq!(Radii::of(Size::new(1, 450)).px(6.0), 12.0);
    }

    #[test]
    fn a_mark_grows_to_a_disc() {
        let mut marked = Plane::filled(Size::new(21, 21), false);
        marked.set(10, 10, true);
        let disc = dilated(&marked, 6.0);
        for y in 0..21 {
            for x in 0..21 {
                let distance = (x as f32 - 10.0).hypot(y as f32 - 10.0);
                assert_eq!(disc.at(x, y), distance <= 6.0, "{x} {y}");
            }
        }
    }
}
