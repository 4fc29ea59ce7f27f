//! Guide distances of whole rows at once: the fast twin of [`super::guide_distance`].

use super::guide_distance::{APART, LEAST_TOLERANCE};
use crate::sequence::settings::Wavelet;
use crate::window::LocalFeatures;
use std::ops::Range;

/// One tap of a kernel, seen from the rows of its centres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offset {
    pub y: usize,
    /// Row of the taps.
    pub qy: usize,
    /// Pixels to the right and down.
    pub dx: isize,
    pub dy: isize,
    /// Centres whose tap lies in the image.
    pub from: usize,
    pub to: usize,
}

/// Columns that filters work on at once, tap by tap: sums of all channels, and what the taps read, stay in the nearest cache.
const STRIP: usize = 128;

/// The strips of a row.
pub(crate) fn strips(w: usize) -> impl Iterator<Item = Range<usize>> {
    (0..w).step_by(STRIP).map(move |from| from..(from + STRIP).min(w))
}

impl Offset {
    /// `None` where no tap lies in the image.
    pub(crate) fn new(w: usize, h: usize, y: usize, dx: isize, dy: isize) -> Option<Self> {
        let qy = y as isize + dy;
        let from = (-dx).max(0) as usize;
        let to = (w as isize - dx.max(0)).max(0) as usize;
        (qy >= 0 && qy < h as isize && from < to).then_some(Self { y, qy: qy as usize, dx, dy, from, to })
    }

    /// The part of it whose centres lie in a strip of columns.
    #[inline(always)]
    pub(crate) fn within(self, strip: &Range<usize>) -> Option<Self> {
        let (from, to) = (self.from.max(strip.start), self.to.min(strip.end));
        (from < to).then_some(Self { from, to, ..self })
    }

    /// The centres' part of a row.
    #[inline(always)]
    pub(crate) fn centres<'a>(&self, row: &'a [f32]) -> &'a [f32] {
        &row[self.from..self.to]
    }

    /// The taps' part of a row.
    #[inline(always)]
    pub(crate) fn taps<'a>(&self, row: &'a [f32]) -> &'a [f32] {
        &row[(self.from as isize + self.dx) as usize..][..self.to - self.from]
    }
}

fn row(plane: &[f32], w: usize, y: usize) -> &[f32] {
    &plane[y * w..][..w]
}

/// Guide distances of one tap for a row of centres, for the classes that are wanted.
#[inline(always)]
pub(crate) fn guide_distances(
    local: &LocalFeatures,
    w: usize,
    o: &Offset,
    s: &Wavelet,
    wanted: [bool; 4],
    out: &mut [Vec<f32>; 4],
) {
    let [surface, seen, coloured, free] = out;
    let n = o.to - o.from;
    let distance = ((o.dx * o.dx + o.dy * o.dy) as f32).sqrt();
    let (dx, dy) = (o.dx as f32, o.dy as f32);
    {
        let iz_p = o.centres(row(&local.inverse_depth, w, o.y));
        let iz_q = o.taps(row(&local.inverse_depth, w, o.qy));
        let sx = o.centres(row(&local.slope[0], w, o.y));
        let sy = o.centres(row(&local.slope[1], w, o.y));
        let noise = o.centres(row(&local.depth_noise, w, o.y));
        let np = [0, 1, 2].map(|c| o.centres(row(&local.normal[c], w, o.y)));
        let nq = [0, 1, 2].map(|c| o.taps(row(&local.normal[c], w, o.qy)));
        let rough = o.centres(row(&local.normal_noise, w, o.y));
        let surface = &mut surface[..n];
        let reach = s.depth * (s.depth_near + s.depth_far * distance);
        for i in 0..n {
            let along = sx[i] * dx + sy[i] * dy;
            let miss = iz_q[i] - iz_p[i] - along;
            let tolerance =
                iz_p[i] * (reach + s.guide_noise * noise[i]) + s.slope_error * along.abs() + LEAST_TOLERANCE;
            let r = miss / tolerance;
            let both = (iz_p[i] > 0.0) == (iz_q[i] > 0.0);
            let cosine = np[0][i] * nq[0][i] + np[1][i] * nq[1][i] + np[2][i] * nq[2][i];
            // Two pixels without normals do not differ in them.
            let length =
                np[0][i].abs() + np[1][i].abs() + np[2][i].abs() + nq[0][i].abs() + nq[1][i].abs() + nq[2][i].abs();
            let bend = if length > 0.0 { 1.0 - cosine } else { 0.0 };
            let normal = s.normal * bend / (1.0 + s.guide_noise * s.normal * rough[i]);
            surface[i] = if both { r * r + normal } else { APART };
        }
    }
    if wanted[1] {
        seen[..n].copy_from_slice(&surface[..n]);
        if !local.seen_albedo[0].is_empty() {
            let scale = 0.5 / (s.seen_albedo * s.seen_albedo);
            for c in 0..3 {
                let (p, q) =
                    (o.centres(row(&local.seen_albedo[c], w, o.y)), o.taps(row(&local.seen_albedo[c], w, o.qy)));
                for i in 0..n {
                    let d = p[i] - q[i];
                    seen[i] += scale * d * d;
                }
            }
        }
        if !local.seen_normal[0].is_empty() {
            let np = [0, 1, 2].map(|c| o.centres(row(&local.seen_normal[c], w, o.y)));
            let nq = [0, 1, 2].map(|c| o.taps(row(&local.seen_normal[c], w, o.qy)));
            let seen = &mut seen[..n];
            for i in 0..n {
                let cosine = np[0][i] * nq[0][i] + np[1][i] * nq[1][i] + np[2][i] * nq[2][i];
                // The sky in a mirror has none.
                let length =
                    np[0][i].abs() + np[1][i].abs() + np[2][i].abs() + nq[0][i].abs() + nq[1][i].abs() + nq[2][i].abs();
                seen[i] += if length > 0.0 { s.seen_normal * (1.0 - cosine) } else { 0.0 };
            }
        }
    }
    if wanted[2] {
        coloured[..n].copy_from_slice(&surface[..n]);
        if !local.albedo[0].is_empty() {
            let scale = 0.5 / (s.albedo * s.albedo);
            for c in 0..3 {
                let (p, q) = (o.centres(row(&local.albedo[c], w, o.y)), o.taps(row(&local.albedo[c], w, o.qy)));
                for i in 0..n {
                    let d = p[i] - q[i];
                    coloured[i] += scale * d * d;
                }
            }
        }
    }
    if wanted[3] {
        free[..n].fill(0.0);
    }
}
