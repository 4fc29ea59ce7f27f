//! How noise hangs together from pixel to pixel.

use super::follow::Paths;
use super::look::Look;
use quell::sequence::SequenceFrame;
use quell::{Plane, Size};

/// Distances of the differences: neighbours, and pixels that no usual filter joins.
const NEAR: usize = 1;
pub(super) const FAR: usize = 4;
/// A splatted sample reaches two pixels; what pixels this far apart share is picture.
const BEYOND: usize = 3;
/// Least deviation of the noise (of values in 0..1) that says anything.
const VISIBLE: f64 = 0.003;
/// Fewer pairs of pixels say nothing.
const LEAST: usize = 500;
/// Surfaces lie beside whole pixels: detail of the picture is in the change by as much. Where there are enough pixels, those
/// that lie near count; else all.
const BESIDE_PX: [f32; 3] = [0.1, 0.2, 0.5];
/// About so many pixels are looked at.
const PIXELS: usize = 60_000;

/// Light without the surface's colour, between 0 and 1: fireflies must not decide.
pub(super) fn tone(look: &Look) -> Plane<f32> {
    Plane::from_fn(look.frame.size, |x, y| {
        let value = look.beauty.at(x, y);
        let colour = look.frame.albedo.as_ref().map_or([1.0; 3], |a| a.at(x, y));
        let sum: f32 = (0..3).map(|c| value[c].max(0.0) / colour[c].max(0.05)).sum();
        if sum.is_finite() { sum / (1.0 + sum) } else { f32::NAN }
    })
}

/// True where two pixels see one surface.
fn same(frame: &SequenceFrame, p: (usize, usize), q: (usize, usize)) -> bool {
    let depth = frame.depth.as_ref().is_none_or(|d| {
        let (a, b) = (d.at(p.0, p.1), d.at(q.0, q.1));
        a.is_finite() && b.is_finite() && (a - b).abs() < 0.1 * a
    });
    let differ = |a: [f32; 3], b: [f32; 3], limit: f32| (0..3).any(|c| (a[c] - b[c]).abs() > limit);
    depth
        && frame.normal.as_ref().is_none_or(|n| !differ(n.at(p.0, p.1), n.at(q.0, q.1), 0.1))
        && frame.albedo.as_ref().is_none_or(|a| !differ(a.at(p.0, p.1), a.at(q.0, q.1), 0.08))
}

/// How the noise of neighbours hangs together: correlations of the change from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shared {
    /// Of neighbouring pixels.
    pub near: f64,
    /// Of pixels that share no sample: what the picture itself has changed, or is beside its place.
    pub far: f64,
}

/// Signs of what changed between two frames on surfaces at rest, in pixels beside each other. The picture is the same in
/// both, and signs do not mind that noise is stronger here than there: what is left is shared noise. (Of normal deviates
/// with correlation r a share of 1/2 + asin(r) / pi has equal signs.)
pub(super) fn shared(paths: &Paths, change: &Plane<f32>, frame: &SequenceFrame) -> Option<Shared> {
    BESIDE_PX.into_iter().find_map(|beside| shared_within(paths, change, frame, beside))
}

fn shared_within(paths: &Paths, change: &Plane<f32>, frame: &SequenceFrame, beside: f32) -> Option<Shared> {
    let Size { width, height } = frame.size;
    let mut sums = [0i64; 2];
    let mut counts = [0i64; 2];
    let mut sizes = Vec::new();
    let near = |p| paths.beside(p) <= beside;
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        if x + BEYOND >= width || y + BEYOND >= height || !near((x, y)) {
            continue;
        }
        let here = change.at(x, y);
        for (dx, dy) in [(1, 0), (0, 1)] {
            let at = |h: usize| (x + h * dx, y + h * dy);
            let fits = |h: usize| near(at(h)) && paths.together((x, y), at(h)) && same(frame, (x, y), at(h));
            if !(fits(NEAR) && fits(BEYOND)) {
                continue;
            }
            sizes.push(here.abs());
            for (k, h) in [NEAR, BEYOND].into_iter().enumerate() {
                let product = here * change.at(at(h).0, at(h).1);
                if product != 0.0 && product.is_finite() {
                    sums[k] += if product > 0.0 { 1 } else { -1 };
                    counts[k] += 1;
                }
            }
        }
    }
    if counts.iter().any(|count| *count < LEAST as i64) {
        return None;
    }
    sizes.sort_by(f32::total_cmp);
    // The median of |x| of a normal deviate is 0.6745; two frames have twice the variance.
    let deviation = sizes.get(sizes.len() / 2).copied().map_or(0.0, f64::from) / 0.6745 / 2f64.sqrt();
    let [near, far] = [0, 1].map(|k| (0.5 * std::f64::consts::PI * sums[k] as f64 / counts[k] as f64).sin());
    (deviation >= 0.5 * VISIBLE).then_some(Shared { near, far })
}

/// Medians of second differences of light at two distances on smooth surfaces: their ratio, and the deviation that the far
/// ones show. Along rows and columns alike.
pub(super) fn grain(look: &Look) -> Option<(f64, f64)> {
    let Size { width, height } = look.frame.size;
    let frame = &look.frame;
    let light = tone(look);
    if width <= 2 * FAR || height <= 2 * FAR {
        return None;
    }
    let step = (frame.size.pixels() / PIXELS).max(1);
    let mut differences: [Vec<f32>; 2] = Default::default();
    for i in (0..frame.size.pixels()).step_by(step) {
        let (x, y) = (i % width, i / width);
        if x < FAR || y < FAR || x + FAR >= width || y + FAR >= height {
            continue;
        }
        let here = light.at(x, y);
        for (dx, dy) in [(1, 0), (0, 1)] {
            let ends = |h: usize| ((x - h * dx, y - h * dy), (x + h * dx, y + h * dy));
            let (a, b) = ends(FAR);
            if !(same(frame, (x, y), a) && same(frame, (x, y), b)) {
                continue;
            }
            // Black is no noise: shadows without a sample.
            let second = |h: usize| {
                let (a, b) = ends(h);
                let (a, b) = (light.at(a.0, a.1), light.at(b.0, b.1));
                (a + b - 2.0 * here).abs()
            };
            let (near, far) = (second(NEAR), second(FAR));
            if near.is_finite() && far.is_finite() && (near > 0.0 || far > 0.0) {
                differences[0].push(near);
                differences[1].push(far);
            }
        }
    }
    if differences[0].len() < LEAST {
        return None;
    }
    let median = |v: &mut Vec<f32>| {
        v.sort_by(f32::total_cmp);
        v.get(v.len() / 2).copied().map_or(0.0, f64::from)
    };
    let [near, far] = &mut differences;
    let (near, far) = (median(near), median(far));
    // The median of |x| of a normal deviate is 0.6745; a second difference has six times the variance. Squares compare
    // variances.
    let deviation = far / 0.6745 / 6f64.sqrt();
    (deviation >= VISIBLE).then(|| ((near / far).powi(2), deviation))
}
