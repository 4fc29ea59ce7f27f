//! Slopes and noise of feature buffers on all threads.

use super::DIVIDED;
use crate::par;
use crate::window::{Features, LocalFeatures, Packed, SurfacePoint};

/// Runs the stage on the whole image.
pub(crate) fn run(features: &Features) -> LocalFeatures {
    let size = features.size;
    let (w, h) = (size.width, size.height);
    let surface = &features.surface;
    let plane = |f: &(dyn Fn(usize, usize) -> f32 + Sync)| -> Vec<f32> { par::plane(size, f).into_vec() };
    let at = |x: usize, y: usize| &surface[y * w + x];
    // Of the two one-sided differences the smaller: the other may cross an edge.
    let slope = |here: f32, back: Option<f32>, forward: Option<f32>| -> f32 {
        let known = |v: &f32| here > 0.0 && *v > 0.0;
        match (back.filter(known).map(|v| here - v), forward.filter(known).map(|v| v - here)) {
            (Some(a), Some(b)) => {
                if a.abs() < b.abs() {
                    a
                } else {
                    b
                }
            }
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => 0.0,
        }
    };
    let inverse = |x: usize, y: usize| at(x, y).inverse_depth;
    let dx = plane(&|x, y| {
        let (back, forward) = ((x > 0).then(|| inverse(x - 1, y)), (x + 1 < w).then(|| inverse(x + 1, y)));
        slope(inverse(x, y), back, forward)
    });
    let dy = plane(&|x, y| {
        let (back, forward) = ((y > 0).then(|| inverse(x, y - 1)), (y + 1 < h).then(|| inverse(x, y + 1)));
        slope(inverse(x, y), back, forward)
    });
    // Along an edge a clean guide is smooth; where it is smooth in no direction the guide is noisy.
    let calmest = |x: usize, y: usize, rough: &dyn Fn(&SurfacePoint, &SurfacePoint, &SurfacePoint) -> f32| -> f32 {
        if x == 0 || y == 0 || x + 1 >= w || y + 1 >= h {
            return 0.0;
        }
        [(1isize, 0isize), (0, 1), (1, 1), (1, -1)].into_iter().fold(f32::MAX, |least, (i, j)| {
            let a = at((x as isize - i) as usize, (y as isize - j) as usize);
            let b = at((x as isize + i) as usize, (y as isize + j) as usize);
            least.min(rough(a, at(x, y), b))
        })
    };
    let depth_noise = plane(&|x, y| {
        calmest(x, y, &|a, p, b| {
            if p.inverse_depth > 0.0 {
                (a.inverse_depth + b.inverse_depth - 2.0 * p.inverse_depth).abs() / (2.0 * p.inverse_depth)
            } else {
                0.0
            }
        })
    });
    let normal_noise = plane(&|x, y| {
        calmest(x, y, &|a, p, b| {
            let middle = [0, 1, 2].map(|c| 0.5 * (a.normal[c] + b.normal[c]));
            0.5 * (0..3).map(|c| (middle[c] - p.normal[c]).powi(2)).sum::<f32>()
        })
    });
    let component = |c: usize| plane(&|x, y| at(x, y).normal[c]);
    let three = |packed: Option<&Packed>, k: usize| match packed {
        None => [Vec::new(), Vec::new(), Vec::new()],
        Some(packed) => [0, 1, 2].map(|c| plane(&|x, y| packed.at(k, y * w + x)[c])),
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
        inverse_depth: plane(&inverse),
        depth_noise,
        normal: [component(0), component(1), component(2)],
        normal_noise,
        seen_albedo,
        seen_normal: seen(1),
        albedo: three(features.albedo.as_ref(), 0),
        mirror,
    }
}
