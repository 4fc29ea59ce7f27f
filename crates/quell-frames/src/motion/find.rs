//! `--motion auto`: every convention is tried on two neighbouring frames, and the one that warps best is kept.

use super::convention::{Direction, MotionConvention};
use quell::{Plane, Size};
use rayon::prelude::*;

/// Pixels that take part: more change nothing.
const PIXELS: usize = 12_000;

/// Largest part of the error without any motion that a good convention may leave.
const GOOD: f64 = 0.6;

/// What a frame shows, and its vectors as the file has them.
#[derive(Clone, Copy, Debug)]
pub struct MotionGuides<'a> {
    /// The file's two numbers.
    pub vectors: &'a Plane<[f32; 2]>,
    /// World position; compared alone where present.
    pub position: Option<&'a Plane<[f32; 3]>>,
    /// Depth along the axis; +inf: background.
    pub depth: Option<&'a Plane<f32>>,
    /// World normal.
    pub normal: Option<&'a Plane<[f32; 3]>>,
    /// Colour of the surface.
    pub albedo: Option<&'a Plane<[f32; 3]>>,
}

/// How well the conventions warp.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionEvidence {
    /// The best.
    pub best: MotionConvention,
    /// Mean difference of the guides that it leaves, capped at 1 a pixel.
    pub error: f64,
    /// The same without any motion.
    pub still: f64,
    /// The best that leads to another place in half of the pixels at least.
    pub next: Option<(MotionConvention, f64)>,
    /// The difference that each of the 48 leaves.
    pub errors: Vec<(MotionConvention, f64)>,
    /// True where the best is much better than none, or nothing moves and it says so.
    pub good: bool,
}

impl std::fmt::Display for MotionEvidence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}; difference {:.4}, without motion {:.4}", self.best, self.error, self.still)?;
        if let Some((convention, error)) = &self.next {
            write!(f, ", next best {error:.4} ({convention})")?;
        }
        Ok(())
    }
}

/// Tries all 48 conventions on the vectors of two neighbouring frames, `earlier` and `later` by one.
///
/// `None` where a frame has no guide or extents differ.
pub fn find_motion(earlier: &MotionGuides<'_>, later: &MotionGuides<'_>) -> Option<MotionEvidence> {
    let size = earlier.vectors.size();
    let sizes = |g: &MotionGuides<'_>| {
        [Some(g.vectors.size()), g.position.map(|p| p.size()), g.depth.map(|p| p.size()), g.normal.map(|p| p.size())]
    };
    if sizes(earlier).iter().chain(&sizes(later)).flatten().any(|s| *s != size) {
        return None;
    }
    let compare = Comparison::new(earlier, later)?;
    let errors: Vec<(MotionConvention, f64)> = MotionConvention::all()
        .into_par_iter()
        .map(|convention| {
            let (from, to) = match convention.direction {
                Direction::Previous => (later, earlier),
                Direction::Next => (earlier, later),
            };
            (convention, compare.error(from, to, |value| convention.offset(value, size)))
        })
        .collect();
    let still = [(later, earlier), (earlier, later)].map(|(a, b)| compare.error(a, b, |_| [0.0; 2]));
    let still = (still[0] + still[1]) * 0.5;
    let &(best, error) = errors.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let next =
        errors.iter().filter(|(c, _)| differs(c, &best, later.vectors)).min_by(|a, b| a.1.total_cmp(&b.1)).copied();
    // Where nothing moves every convention is as good as none.
    let moves = later.vectors.data().iter().any(|v| v.iter().any(|v| v.is_finite() && *v != 0.0));
    let good = moves && error <= still * GOOD;
    Some(MotionEvidence { best, error, still, next, good, errors })
}

/// True where two conventions lead to different places in many pixels.
fn differs(a: &MotionConvention, b: &MotionConvention, vectors: &Plane<[f32; 2]>) -> bool {
    let size = vectors.size();
    let all = vectors.data().iter().step_by((size.pixels() / 1000).max(1));
    let (mut far, mut count) = (0, 0);
    for value in all {
        let [p, q] = [a, b].map(|c| c.offset(*value, size));
        let same_frame = a.direction == b.direction;
        let q = if same_frame { q } else { [-q[0], -q[1]] };
        far += usize::from((p[0] - q[0]).hypot(p[1] - q[1]) > 0.25);
        count += 1;
    }
    far * 2 >= count
}

/// Guides brought to one scale.
struct Comparison {
    size: Size,
    /// What a difference of position is divided by, per unit of depth or of the scene's extent.
    scale: f32,
}

impl Comparison {
    fn new(earlier: &MotionGuides<'_>, later: &MotionGuides<'_>) -> Option<Self> {
        let both = |f: fn(&MotionGuides<'_>) -> bool| f(earlier) && f(later);
        let some = both(|g| g.position.is_some())
            || both(|g| g.depth.is_some())
            || both(|g| g.normal.is_some())
            || both(|g| g.albedo.is_some());
        if !some {
            return None;
        }
        let mut scale = 1.0;
        if let Some(position) = later.position {
            // The median distance between neighbours is what a pixel is wide in the world.
            let size = position.size();
            let mut steps: Vec<f32> = (0..size.height)
                .step_by((size.height / 60).max(1))
                .flat_map(|y| (1..size.width).map(move |x| (x, y)))
                .map(|(x, y)| distance(position.at(x, y), position.at(x - 1, y)))
                .filter(|d| *d > 0.0 && d.is_finite())
                .collect();
            steps.sort_by(f32::total_cmp);
            // Three pixels away counts as entirely wrong.
            scale = steps.get(steps.len() / 2).map_or(1.0, |step| step * 3.0);
        }
        Some(Self { size: later.vectors.size(), scale })
    }

    fn error(&self, from: &MotionGuides<'_>, to: &MotionGuides<'_>, offset: impl Fn([f32; 2]) -> [f32; 2]) -> f64 {
        let Size { width, height } = self.size;
        let step = (self.size.pixels() / PIXELS).max(1);
        let (mut sum, mut count) = (0.0, 0usize);
        for i in (step / 2..self.size.pixels()).step_by(step) {
            let (x, y) = (i % width, i / width);
            if from.depth.is_some_and(|d| !d.at(x, y).is_finite()) {
                continue;
            }
            let value = from.vectors.at(x, y);
            if !value.iter().all(|v| v.is_finite()) {
                continue;
            }
            let [dx, dy] = offset(value);
            let (tx, ty) = ((x as f32 + 0.5 + dx).floor(), (y as f32 + 0.5 + dy).floor());
            count += 1;
            if !(tx >= 0.0 && ty >= 0.0 && tx < width as f32 && ty < height as f32) {
                // Out of sight is as bad as half wrong: else the largest vectors would win.
                sum += 0.5;
                continue;
            }
            sum += f64::from(self.difference(from, (x, y), to, (tx as usize, ty as usize)));
        }
        if count == 0 { f64::INFINITY } else { sum / count as f64 }
    }

    /// 0: the same surface, 1: another.
    fn difference(&self, a: &MotionGuides<'_>, p: (usize, usize), b: &MotionGuides<'_>, q: (usize, usize)) -> f32 {
        if let (Some(a), Some(b)) = (a.position, b.position) {
            return (distance(a.at(p.0, p.1), b.at(q.0, q.1)) / self.scale).min(1.0);
        }
        let mut difference = 0.0;
        if let (Some(a), Some(b)) = (a.depth, b.depth) {
            let (a, b) = (a.at(p.0, p.1), b.at(q.0, q.1));
            difference += if b.is_finite() { ((a - b).abs() / (0.05 * a.abs().max(1e-20))).min(1.0) } else { 1.0 };
        }
        if let (Some(a), Some(b)) = (a.normal, b.normal) {
            difference += (distance(a.at(p.0, p.1), b.at(q.0, q.1)) / 0.5).min(1.0);
        }
        if let (Some(a), Some(b)) = (a.albedo, b.albedo) {
            difference += (distance(a.at(p.0, p.1), b.at(q.0, q.1)) / 0.3).min(1.0);
        }
        difference.min(1.0)
    }
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    if length.is_nan() { f32::INFINITY } else { length }
}
