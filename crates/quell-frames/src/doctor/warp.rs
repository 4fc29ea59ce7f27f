//! How far beside where the vectors lead surfaces are found, in fractions of a pixel.
//!
//! What a surface carries with it (world position; else normal and albedo) is compared between a pixel and where its
//! vector leads. Differences over gradients are displacements (Lucas and Kanade 1981); all pixels together are fitted by
//! one offset and one factor of the vectors, iterated, with weights that ignore what does not fit (moving surfaces,
//! silhouettes).

use crate::adapt::PixelCamera;
use crate::adapt::noise::smooth;
use quell::sequence::SequenceFrame;
use quell::{Plane, Size};

/// Pixels that take part.
const PIXELS: usize = 16_000;
/// Fewer say nothing.
const LEAST: usize = 300;
const ROUNDS: usize = 8;
/// An offset is known where its standard error is below this, in pixels.
const CERTAIN_PX: f64 = 0.03;
/// Offset and factor count where they leave less than this part of the differences.
const EXPLAINED: f64 = 0.5;
/// The same of normals and colours, whose own noise stays.
const EXPLAINED_NOISY: f64 = 0.9;
/// Least change of normal or colour over a pixel that shows a displacement.
const LEAST_SLOPE: f32 = 0.01;

/// What vectors miss: surfaces lie at `scale` times the vector, plus `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Residual {
    /// Pixels, x right, y down.
    pub offset: [f64; 2],
    /// Standard error of an axis.
    pub offset_error: f64,
    pub scale: f64,
    pub scale_error: f64,
    /// Median difference that is left, over that before.
    pub left: f64,
    /// World positions were compared.
    pub positions: bool,
}

impl Residual {
    /// True where offset and factor account for what the vectors miss: noise in vectors makes a factor, too.
    pub fn explains(&self) -> bool {
        self.left < if self.positions { EXPLAINED } else { EXPLAINED_NOISY }
    }

    pub fn certain(&self) -> bool {
        self.offset_error < CERTAIN_PX
    }
}

/// What surfaces carry with them, in two neighbouring frames.
pub(super) struct Warp<'a> {
    earlier: &'a SequenceFrame,
    later: &'a SequenceFrame,
    kinds: Vec<Kind<'a>>,
}

enum Kind<'a> {
    Position(&'a Plane<[f32; 3]>, &'a Plane<[f32; 3]>),
    Other(&'a Plane<[f32; 3]>, &'a Plane<[f32; 3]>),
}

/// One equation: along * displacement = difference.
struct Equation {
    along: [f64; 2],
    difference: f64,
    vector: [f64; 2],
}

impl<'a> Warp<'a> {
    /// `None` where both frames have nothing to compare.
    pub fn new(earlier: &'a SequenceFrame, later: &'a SequenceFrame) -> Option<Self> {
        let size = later.size;
        if earlier.size != size {
            return None;
        }
        let mut kinds = Vec::new();
        if let (Some(a), Some(b)) = (&earlier.position, &later.position) {
            kinds.push(Kind::Position(a, b));
        } else {
            let colour = |f: &'a SequenceFrame| f.albedo.as_ref().or(f.seen_albedo.as_ref());
            for (a, b) in [(earlier.normal.as_ref(), later.normal.as_ref()), (colour(earlier), colour(later))] {
                if let (Some(a), Some(b)) = (a, b) {
                    kinds.push(Kind::Other(a, b));
                }
            }
        }
        (!kinds.is_empty()).then_some(Self { earlier, later, kinds })
    }

    /// Fits what vectors (previous = current + motion, pixels) miss. `None` where too few pixels can be compared.
    pub fn residual(&self, motion: &Plane<[f32; 2]>) -> Option<Residual> {
        let both = self.fit(motion, [true, true, true])?;
        // A pan cannot separate a factor from an offset: the simpler of the two that explains as much.
        let scale = self.fit(motion, [false, false, true]);
        let offset = self.fit(motion, [true, true, false]);
        let good = |fit: &Fit| fit.spread <= both.spread * 1.05 + 1e-3;
        let chosen = match (offset.filter(good), scale.filter(good)) {
            (Some(a), Some(b)) => {
                let miss = (b.scale - 1.0).abs() * b.length;
                if a.offset[0].hypot(a.offset[1]) <= miss.max(0.02) { a } else { b }
            }
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => both,
        };
        let Fit { offset, scale, errors, spread, before, .. } = chosen;
        let left = spread / before.max(1e-9);
        let positions = self.kinds.iter().any(|kind| matches!(kind, Kind::Position(..)));
        Some(Residual {
            offset,
            offset_error: errors[0].max(errors[1]),
            scale,
            scale_error: errors[2],
            left,
            positions,
        })
    }

    fn fit(&self, motion: &Plane<[f32; 2]>, free: [bool; 3]) -> Option<Fit> {
        let mut fit = Fit { scale: 1.0, ..Fit::default() };
        for round in 0..ROUNDS {
            let equations = self.equations(motion, &fit);
            if equations.len() < LEAST {
                return None;
            }
            // Cauchy weights by the median difference.
            let mut sizes: Vec<f64> = equations.iter().map(|e| e.difference.abs()).collect();
            sizes.sort_by(f64::total_cmp);
            let spread = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0).max(1e-6);
            let (mut a, mut b, mut sum, mut count) = ([[0.0; 3]; 3], [0.0; 3], 0.0, 0.0);
            for e in &equations {
                let row = [e.along[0], e.along[1], e.along[0] * e.vector[0] + e.along[1] * e.vector[1]];
                let w = 1.0 / (1.0 + (e.difference / (2.0 * spread)).powi(2)).powi(2);
                for i in 0..3 {
                    b[i] += w * row[i] * e.difference;
                    for j in 0..3 {
                        a[i][j] += w * row[i] * row[j];
                    }
                }
                sum += w * e.difference * e.difference;
                count += w;
            }
            for i in (0..3).filter(|i| !free[*i]) {
                for j in 0..3 {
                    a[i][j] = 0.0;
                    a[j][i] = 0.0;
                }
                a[i][i] = 1.0;
                b[i] = 0.0;
            }
            let inverse = inverse(a)?;
            let step: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| inverse[i][j] * b[j]).sum());
            if !step.iter().all(|v| v.is_finite() && v.abs() < 100.0) {
                return None;
            }
            let variance = sum / f64::max(count, 1.0);
            fit.spread = spread;
            if round == 0 {
                fit.before = spread;
            }
            fit.length = equations.iter().map(|e| e.vector[0].hypot(e.vector[1])).sum::<f64>() / equations.len() as f64;
            // Neighbouring pixels err together: as if a tenth of the equations were independent.
            fit.errors =
                std::array::from_fn(|i| if free[i] { (inverse[i][i] * variance * 10.0).max(0.0).sqrt() } else { 0.0 });
            fit.offset = [fit.offset[0] + step[0], fit.offset[1] + step[1]];
            fit.scale += step[2];
            if step[0].hypot(step[1]) < 1e-3 && step[2].abs() < 1e-4 {
                break;
            }
        }
        Some(fit)
    }

    /// One to three equations for each pixel that can be compared.
    fn equations(&self, motion: &Plane<[f32; 2]>, fit: &Fit) -> Vec<Equation> {
        let Size { width, height } = self.later.size;
        let step = (self.later.size.pixels() / PIXELS).max(1);
        let mut all = Vec::new();
        for i in (step / 2..self.later.size.pixels()).step_by(step) {
            let (x, y) = (i % width, i / width);
            if x < 1 || y < 1 || x + 2 > width || y + 2 > height {
                continue;
            }
            let v = motion.at(x, y).map(f64::from);
            let background = self.later.depth.as_ref().is_some_and(|d| !d.at(x, y).is_finite());
            if background || !(v[0].is_finite() && v[1].is_finite()) {
                continue;
            }
            let q = [0, 1].map(|c| [x, y][c] as f64 + fit.scale * v[c] + fit.offset[c]);
            if q[0] < 1.0 || q[1] < 1.0 || q[0] >= width as f64 - 2.0 || q[1] >= height as f64 - 2.0 {
                continue;
            }
            let (u, w) = (q[0] as usize, q[1] as usize);
            for kind in &self.kinds {
                self.compare(kind, (x, y), (u, w), [q[0].fract() as f32, q[1].fract() as f32], v, &mut all);
            }
        }
        all
    }

    fn compare(
        &self,
        kind: &Kind<'_>,
        at: (usize, usize),
        (u, w): (usize, usize),
        [fx, fy]: [f32; 2],
        vector: [f64; 2],
        all: &mut Vec<Equation>,
    ) {
        let (a, b) = match kind {
            Kind::Position(a, b) | Kind::Other(a, b) => (*a, b.at(at.0, at.1)),
        };
        let corners = [a.at(u, w), a.at(u + 1, w), a.at(u, w + 1), a.at(u + 1, w + 1)];
        if !corners.iter().flatten().chain(&b).all(|v| v.is_finite()) {
            return;
        }
        let mix = |p: f32, q: f32, t: f32| p + (q - p) * t;
        let each =
            |f: &dyn Fn([f32; 4]) -> f32| -> [f32; 3] { std::array::from_fn(|c| f(corners.map(|corner| corner[c]))) };
        let value = each(&|[p, q, r, s]| mix(mix(p, q, fx), mix(r, s, fx), fy));
        let dx = each(&|[p, q, r, s]| mix(q - p, s - r, fy));
        let dy = each(&|[p, q, r, s]| mix(r - p, s - q, fx));
        match kind {
            Kind::Position(..) => {
                let zero = corners.contains(&[0.0; 3]) || b == [0.0; 3];
                let span = |d: [f32; 3]| (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                // The four corners lie in one plane where the surface is one: the twist is small beside the steps.
                let twist = each(&|[p, q, r, s]| p - q - r + s);
                let step = span(dx).max(span(dy));
                if zero
                    || step <= 0.0
                    || span(twist) > 0.1 * step
                    || !smooth_at(self.earlier, u, w)
                    || !smooth_at(self.later, at.0, at.1)
                {
                    return;
                }
                for c in 0..3 {
                    all.push(Equation {
                        along: [f64::from(dx[c] / step), f64::from(dy[c] / step)],
                        difference: f64::from((b[c] - value[c]) / step),
                        vector,
                    });
                }
            }
            Kind::Other(..) => {
                for c in 0..3 {
                    // Where nothing changes nothing can be measured; where all changes at once a silhouette lies between.
                    let slope = dx[c].abs().max(dy[c].abs());
                    if slope > LEAST_SLOPE && slope < 0.5 {
                        all.push(Equation {
                            along: [f64::from(dx[c]), f64::from(dy[c])],
                            difference: f64::from(b[c] - value[c]),
                            vector,
                        });
                    }
                }
            }
        }
    }
}

fn smooth_at(frame: &SequenceFrame, x: usize, y: usize) -> bool {
    let Size { width, height } = frame.size;
    x >= 1 && y >= 1 && x + 1 < width && y + 1 < height && smooth(frame, x, y)
}

#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    offset: [f64; 2],
    scale: f64,
    errors: [f64; 3],
    /// Median difference at the end, and before anything was fitted.
    spread: f64,
    before: f64,
    length: f64,
}

fn inverse(m: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let matrix = glam::DMat3::from_cols_array_2d(&m);
    let size = m.iter().flatten().fold(0.0f64, |a, v| a.max(v.abs()));
    // What cannot be separated is left as it is: a little damping, far below what any equation says.
    let damped = matrix + glam::DMat3::IDENTITY * (size * 1e-9);
    let inverse = damped.inverse();
    inverse.is_finite().then(|| inverse.to_cols_array_2d())
}

/// World positions of a frame that has none, from its depth and its camera.
pub(super) fn positions(frame: &SequenceFrame, camera: &PixelCamera) -> Option<Plane<[f32; 3]>> {
    let depth = frame.depth.as_ref()?;
    let width = frame.size.width;
    let values = depth.data().iter().enumerate().map(|(i, depth)| {
        if !depth.is_finite() {
            return [0.0; 3];
        }
        let ray = camera.direction((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
        std::array::from_fn(|c| camera.eye[c] + ray[c] * depth)
    });
    Plane::from_vec(frame.size, values.collect()).ok()
}
