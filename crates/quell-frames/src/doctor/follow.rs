//! Surfaces at rest, followed from one frame to the one before: by whole pixels, so that noise is not mixed.

use quell::sequence::SequenceFrame;
use quell::{Plane, Size};

/// Depths and colours of one surface in two frames differ by less.
const DEPTH: f32 = 0.03;
const NORMAL: f32 = 0.1;
const COLOUR: f32 = 0.08;
/// Positions of one point differ by less than so many pixels' width; rounding to whole pixels moves it by up to 0.71.
const WIDTHS: f32 = 1.5;
/// Without positions only what stands still in the picture is known to be at rest, pixels.
const STILL_PX: f32 = 0.1;

/// Where each pixel's surface was in the frame before.
pub(super) struct Paths {
    size: Size,
    /// Whole pixels to the place before; absent: another surface, one that moves, or unknown.
    steps: Vec<Option<[i32; 2]>>,
    /// How far a whole pixel lies beside the place before, pixels.
    beside: Vec<f32>,
}

impl Paths {
    /// `None` where frames differ in extent, or nothing says how surfaces lie in both.
    pub fn new(earlier: &SequenceFrame, later: &SequenceFrame) -> Option<Self> {
        let size = later.size;
        let motion = later.motion_to_previous.as_ref()?;
        let known =
            (later.normal.is_some() || later.depth.is_some() || later.position.is_some()) && earlier.size == size;
        if !known {
            return None;
        }
        let steps = (0..size.pixels()).map(|i| {
            let (x, y) = (i % size.width, i / size.width);
            let m = motion.at(x, y);
            let place = |at: usize, m: f32, extent: usize| -> Option<usize> {
                let to = (at as f32 + m).round();
                (to >= 0.0 && to < extent as f32).then_some(to as usize)
            };
            let before = (place(x, m[0], size.width)?, place(y, m[1], size.height)?);
            let rest = match (&earlier.position, &later.position) {
                (Some(a), Some(b)) => same_point(a, b, before, (x, y)),
                _ => m[0].abs() < STILL_PX && m[1].abs() < STILL_PX,
            };
            (rest && same(earlier, later, before, (x, y)))
                .then_some([before.0 as i32 - x as i32, before.1 as i32 - y as i32])
        });
        let beside = motion.data().iter().map(|m| m.iter().map(|v| (v - v.round()).abs()).fold(0.0, f32::max));
        Some(Self { size, steps: steps.collect(), beside: beside.collect() })
    }

    /// Where a pixel's surface was.
    pub fn before(&self, x: usize, y: usize) -> Option<(usize, usize)> {
        let step = (*self.steps.get(y * self.size.width + x)?)?;
        Some((x.checked_add_signed(step[0] as isize)?, y.checked_add_signed(step[1] as isize)?))
    }

    /// True where two pixels were as far from each other as they are now: neither shares its noise then.
    pub fn together(&self, p: (usize, usize), q: (usize, usize)) -> bool {
        let at = |(x, y): (usize, usize)| self.steps.get(y * self.size.width + x).copied().flatten();
        matches!((at(p), at(q)), (Some(a), Some(b)) if a == b)
    }

    /// How far the pixel that was found lies beside the place before, along the axis where it is more, 0 to 0.5 pixels.
    pub fn beside(&self, (x, y): (usize, usize)) -> f32 {
        self.beside.get(y * self.size.width + x).copied().unwrap_or(f32::NAN)
    }

    /// A light's change from the frame before; NaN where the surface is not at rest or unknown.
    pub fn change(&self, earlier: &Plane<f32>, later: &Plane<f32>) -> Plane<f32> {
        Plane::from_fn(self.size, |x, y| match self.before(x, y) {
            Some((u, v)) => later.at(x, y) - earlier.at(u, v),
            None => f32::NAN,
        })
    }
}

fn differ(a: [f32; 3], b: [f32; 3], limit: f32) -> bool {
    (0..3).any(|c| (a[c] - b[c]).abs() > limit)
}

fn same(earlier: &SequenceFrame, later: &SequenceFrame, before: (usize, usize), now: (usize, usize)) -> bool {
    let depth = match (&earlier.depth, &later.depth) {
        (Some(a), Some(b)) => {
            let (a, b) = (a.at(before.0, before.1), b.at(now.0, now.1));
            // A camera that dollies changes depth; positions tell the rest.
            let limit = if later.position.is_some() { 4.0 * DEPTH } else { DEPTH };
            a.is_finite() && b.is_finite() && (a - b).abs() <= limit * b
        }
        _ => true,
    };
    let three = |a: &Option<Plane<[f32; 3]>>, b: &Option<Plane<[f32; 3]>>, limit: f32| match (a, b) {
        (Some(a), Some(b)) => !differ(a.at(before.0, before.1), b.at(now.0, now.1), limit),
        _ => true,
    };
    // Where positions tell, colours need not: Blender's `Denoising Albedo` holds the light of lamps, which may change.
    let colour = later.position.is_some() || three(&earlier.albedo, &later.albedo, COLOUR);
    depth && colour && three(&earlier.normal, &later.normal, NORMAL)
}

/// True where two frames show one point of the world, within a pixel's width there.
fn same_point(
    earlier: &Plane<[f32; 3]>,
    later: &Plane<[f32; 3]>,
    before: (usize, usize),
    (x, y): (usize, usize),
) -> bool {
    let Size { width, height } = later.size();
    let here = later.at(x, y);
    let apart = |a: [f32; 3], b: [f32; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt();
    let beside = later.at(if x + 1 < width { x + 1 } else { x.saturating_sub(1) }, y);
    let below = later.at(x, if y + 1 < height { y + 1 } else { y.saturating_sub(1) });
    let pixel = apart(here, beside).max(apart(here, below));
    // Background has no position.
    here != [0.0; 3] && apart(here, earlier.at(before.0, before.1)) <= WIDTHS * pixel
}
