//! Slopes and noise of feature buffers, row by row on all threads.

use super::DIVIDED;
use crate::par;
use crate::plane::Size;
use crate::simd::widest;
use crate::window::{Features, LocalFeatures, Packed, SurfacePoint};

/// Runs the stage on the whole image.
pub(crate) fn run(features: &Features) -> LocalFeatures {
    let size = features.size;
    let (w, h) = (size.width, size.height);
    let of_surface = |of: fn(&SurfacePoint) -> f32| {
        plane(size, |y, out| {
            for (out, surface) in out.iter_mut().zip(&features.surface[y * w..]) {
                *out = of(surface);
            }
        })
    };
    let inverse_depth = of_surface(|s| s.inverse_depth);
    let normal = [of_surface(|s| s.normal[0]), of_surface(|s| s.normal[1]), of_surface(|s| s.normal[2])];
    let depths = |y: usize| &inverse_depth[y * w..][..w];
    let beyond = vec![0.0; w];
    let dx = plane(size, |y, out| {
        widest!(slopes_along(depths(y), out));
    });
    let dy = plane(size, |y, out| {
        let above = if y > 0 { depths(y - 1) } else { &beyond };
        let below = if y + 1 < h { depths(y + 1) } else { &beyond };
        widest!(slopes([above, depths(y), below], out));
    });
    // Neighbours are missing at the border: no noise is assumed.
    let inner = |y: usize| y > 0 && y + 1 < h && w > 2;
    let depth_noise = plane(size, |y, out| {
        if inner(y) {
            widest!(depth_noise([y - 1, y, y + 1].map(depths), out));
        }
    });
    let normals = |y: usize| normal.each_ref().map(|normals| &normals[y * w..][..w]);
    let normal_noise = plane(size, |y, out| {
        if inner(y) {
            widest!(normal_noise([y - 1, y, y + 1].map(normals), out));
        }
    });
    let three = |packed: Option<&Packed>, k: usize| match packed {
        None => [Vec::new(), Vec::new(), Vec::new()],
        Some(packed) => [0, 1, 2].map(|c| plane(size, |y, out| packed.channel(k, c, y, out))),
    };
    let seen = |k: usize| three(features.seen.as_ref().filter(|_| features.has_seen[k]), k);
    let mut seen_albedo = seen(0);
    let mirrors = if features.mirror_colour.is_some() { size.pixels() } else { 0 };
    let mut mirror = vec![false; mirrors];
    let marked = &mut seen_albedo[0];
    if marked.is_empty() {
        par::rows(&mut mirror, w, |y, mirror| {
            (0..w).for_each(|x| mirror[x] = features.is_mirror(y * w + x));
        });
    } else if mirrors > 0 {
        par::two_rows(&mut mirror, w, marked, w, |y, mirror, marked| {
            for (x, (mirror, mark)) in mirror.iter_mut().zip(marked).enumerate() {
                *mirror = features.is_mirror(y * w + x);
                if *mirror {
                    *mark += DIVIDED;
                }
            }
        });
    }
    LocalFeatures {
        size,
        slope: [dx, dy],
        inverse_depth,
        depth_noise,
        normal,
        normal_noise,
        seen_albedo,
        seen_normal: seen(1),
        albedo: three(features.albedo.as_ref(), 0),
        mirror,
    }
}

/// `row(y, values)` writes a row, which is 0 before.
fn plane(size: Size, row: impl Fn(usize, &mut [f32]) + Sync + Send) -> Vec<f32> {
    let mut values = vec![0.0; size.pixels()];
    par::rows(&mut values, size.width.max(1), row);
    values
}

/// Of the two one-sided differences the smaller: the other may cross an edge. Background, and what lies beyond the image, is 0.
#[inline(always)]
fn slope(back: f32, here: f32, forward: f32) -> f32 {
    let (a, b) = (here - back, forward - here);
    let has_back = (here > 0.0) & (back > 0.0);
    let has_forward = (here > 0.0) & (forward > 0.0);
    let forward = if has_forward { b } else { 0.0 };
    if has_back & (!has_forward | (a.abs() < b.abs())) { a } else { forward }
}

#[inline(always)]
fn slopes([above, here, below]: [&[f32]; 3], out: &mut [f32]) {
    for ((out, above), (here, below)) in out.iter_mut().zip(above).zip(here.iter().zip(below)) {
        *out = slope(*above, *here, *below);
    }
}

#[inline(always)]
fn slopes_along(row: &[f32], out: &mut [f32]) {
    let w = row.len();
    if w < 2 {
        return;
    }
    out[0] = slope(0.0, row[0], row[1]);
    slopes([&row[..w - 2], &row[1..w - 1], &row[2..]], &mut out[1..w - 1]);
    out[w - 1] = slope(row[w - 2], row[w - 1], 0.0);
}

/// Pairs of pixels on either side of one within 3x3: rows, then columns.
const PAIRS: [[(usize, usize); 2]; 4] = [[(1, 0), (1, 2)], [(0, 1), (2, 1)], [(0, 0), (2, 2)], [(2, 0), (0, 2)]];

/// Along an edge a clean guide is smooth; where it is smooth in no direction the guide is noisy.
#[inline(always)]
fn depth_noise(rows: [&[f32]; 3], out: &mut [f32]) {
    let w = out.len();
    let inner = &mut out[1..w - 1];
    inner.fill(f32::MAX);
    for [(ya, xa), (yb, xb)] in PAIRS {
        let (a, b, here) = (&rows[ya][xa..][..w - 2], &rows[yb][xb..][..w - 2], &rows[1][1..w - 1]);
        for ((out, here), (a, b)) in inner.iter_mut().zip(here).zip(a.iter().zip(b)) {
            let rough = (a + b - 2.0 * here).abs() / (2.0 * here);
            *out = out.min(if *here > 0.0 { rough } else { 0.0 });
        }
    }
}

/// The same of normals, component by component.
#[inline(always)]
fn normal_noise(rows: [[&[f32]; 3]; 3], out: &mut [f32]) {
    let w = out.len();
    let inner = &mut out[1..w - 1];
    inner.fill(f32::MAX);
    let here = rows[1].map(|row| &row[1..w - 1]);
    for [(ya, xa), (yb, xb)] in PAIRS {
        let (a, b) = (rows[ya].map(|row| &row[xa..][..w - 2]), rows[yb].map(|row| &row[xb..][..w - 2]));
        for x in 0..w - 2 {
            let mut squared = 0.0;
            for c in 0..3 {
                let off = 0.5 * (a[c][x] + b[c][x]) - here[c][x];
                squared += off * off;
            }
            inner[x] = inner[x].min(0.5 * squared);
        }
    }
}
