//! The specification of slopes and noise of feature buffers.

use super::DIVIDED;
use crate::window::{Features, LocalFeatures, SurfacePoint};

/// Runs the stage on the whole image.
pub fn run(f: &Features) -> LocalFeatures {
    let (w, h) = (f.size.width, f.size.height);
    let n = f.size.pixels();
    let at = |x: usize, y: usize| f.surface[y * w + x];
    let mut out = LocalFeatures {
        size: f.size,
        slope: [vec![0.0; n], vec![0.0; n]],
        inverse_depth: vec![0.0; n],
        depth_noise: vec![0.0; n],
        normal: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
        normal_noise: vec![0.0; n],
        seen_albedo: Default::default(),
        seen_normal: Default::default(),
        albedo: Default::default(),
        mirror: (0..n).filter(|_| f.mirror_colour.is_some()).map(|p| f.is_mirror(p)).collect(),
    };
    for y in 0..h {
        for x in 0..w {
            let p = y * w + x;
            let here = at(x, y);
            out.inverse_depth[p] = here.inverse_depth;
            for c in 0..3 {
                out.normal[c][p] = here.normal[c];
            }
            let left = (x > 0).then(|| at(x - 1, y).inverse_depth);
            let right = (x + 1 < w).then(|| at(x + 1, y).inverse_depth);
            let above = (y > 0).then(|| at(x, y - 1).inverse_depth);
            let below = (y + 1 < h).then(|| at(x, y + 1).inverse_depth);
            out.slope[0][p] = smaller_slope(left, here.inverse_depth, right);
            out.slope[1][p] = smaller_slope(above, here.inverse_depth, below);
            if x == 0 || y == 0 || x + 1 == w || y + 1 == h {
                continue; // neighbours are missing: no noise is assumed
            }
            let pairs = [
                (at(x - 1, y), at(x + 1, y)),
                (at(x, y - 1), at(x, y + 1)),
                (at(x - 1, y - 1), at(x + 1, y + 1)),
                (at(x - 1, y + 1), at(x + 1, y - 1)),
            ];
            out.depth_noise[p] = pairs.iter().map(|(a, b)| depth_bend(a, &here, b)).fold(f32::MAX, f32::min);
            out.normal_noise[p] = pairs.iter().map(|(a, b)| normal_bend(a, &here, b)).fold(f32::MAX, f32::min);
        }
    }
    for p in 0..n {
        for c in 0..3 {
            if let Some(seen) = &f.seen {
                if f.has_seen[0] {
                    // The first channel holds mirrors apart from all else.
                    let mark = if c == 0 && f.is_mirror(p) { DIVIDED } else { 0.0 };
                    out.seen_albedo[c].push(seen.at(0, p)[c] + mark);
                }
                if f.has_seen[1] {
                    out.seen_normal[c].push(seen.at(1, p)[c]);
                }
            }
            if let Some(albedo) = &f.albedo {
                out.albedo[c].push(albedo.at(0, p)[c]);
            }
        }
    }
    out
}

/// The one-sided difference that is smaller: the other may cross an edge. Background has no slope.
fn smaller_slope(before: Option<f32>, here: f32, after: Option<f32>) -> f32 {
    if here <= 0.0 {
        return 0.0;
    }
    let back = before.filter(|v| *v > 0.0).map(|v| here - v);
    let forward = after.filter(|v| *v > 0.0).map(|v| v - here);
    match (back, forward) {
        (Some(a), Some(b)) if a.abs() < b.abs() => a,
        (_, Some(b)) => b,
        (Some(a), None) => a,
        (None, None) => 0.0,
    }
}

/// How far the depth in the middle lies from the line through its neighbours, relative.
fn depth_bend(a: &SurfacePoint, middle: &SurfacePoint, b: &SurfacePoint) -> f32 {
    if middle.inverse_depth <= 0.0 {
        return 0.0;
    }
    (a.inverse_depth + b.inverse_depth - 2.0 * middle.inverse_depth).abs() / (2.0 * middle.inverse_depth)
}

/// Half the squared distance of the normal from its neighbours' mean: 1 - cosine, nearly.
fn normal_bend(a: &SurfacePoint, middle: &SurfacePoint, b: &SurfacePoint) -> f32 {
    (0..3).map(|c| (0.5 * (a.normal[c] + b.normal[c]) - middle.normal[c]).powi(2)).sum::<f32>() * 0.5
}
