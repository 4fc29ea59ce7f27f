//! Noise that repeats: one seed for all frames draws the same noise over every picture.

use super::camera::PixelCamera;
use quell::sequence::SequenceFrame;
use quell::{Plane, Rgb, Size};
use rayon::prelude::*;

/// Correlation from which noise counts as repeated. Independent noise: 0.02 with guides (hall), at most 0.1 without (a
/// moving camera, Blender's factory settings). One seed: above 0.5 with guides, 0.28 to 0.31 without.
pub(crate) const REPEATS: f64 = 0.2;

/// Least deviation of the residuals (tone-mapped, 0..1) for which noise can be recognised at all.
const NOISY: f64 = 0.004;

/// Every how many rows are looked at.
const ROWS: usize = 3;

/// Side of the blocks that are looked at one by one, pixels; fewer pixels in one say nothing.
const BLOCK: usize = 24;
const BLOCK_LEAST: usize = 60;
/// With fewer blocks the whole picture is one.
const BLOCKS: usize = 8;

/// What a frame leaves for its successor to compare with.
#[derive(Clone, Debug)]
pub(crate) struct Trace {
    pub number: i64,
    pub size: Size,
    pub camera: Option<PixelCamera>,
    /// Tone-mapped light minus its mean over 3x3 pixels; NaN where the pixel's guides are not smooth.
    residuals: Vec<f32>,
    guides: Vec<f32>,
}

impl Trace {
    pub fn of(frame: &SequenceFrame, beauty: &Plane<Rgb>, camera: Option<PixelCamera>) -> Self {
        let Size { width, height } = frame.size;
        let tone = |x: usize, y: usize| {
            // Without the surface's colour: texture would correlate, too.
            let i = y * width + x;
            let value = beauty.data().get(i).copied().unwrap_or([0.0; 3]);
            let colour = frame.albedo.as_ref().and_then(|a| a.data().get(i)).copied().unwrap_or([1.0; 3]);
            let light: f32 = (0..3).map(|c| value[c].max(0.0) / colour[c].max(0.05)).sum();
            light / (1.0 + light)
        };
        let residual = |x: usize, y: usize| {
            if !smooth(frame, x, y) {
                return f32::NAN;
            }
            let mut sum = 0.0;
            for v in y - 1..=y + 1 {
                for u in x - 1..=x + 1 {
                    sum += tone(u, v);
                }
            }
            tone(x, y) - sum / 9.0
        };
        let rows = (1..height.saturating_sub(1)).into_par_iter().step_by(ROWS);
        let rows = rows.map(|y| (1..width.saturating_sub(1)).map(|x| residual(x, y)).collect::<Vec<_>>());
        let residuals = rows.collect::<Vec<_>>().concat();
        Self { number: frame.number, size: frame.size, camera, residuals, guides: guides(frame) }
    }

    /// True where the noise of `self` is that of `last`.
    pub fn repeats(&self, last: &Self) -> bool {
        self.correlation(last).is_some_and(|c| c > REPEATS)
    }

    /// Correlation of the noise of two frames, pixel by pixel; `None` where there is too little of it.
    ///
    /// It is that of the middle one of many blocks: one seed correlates everywhere, fine detail that stands still only
    /// where it is.
    pub fn correlation(&self, last: &Self) -> Option<f64> {
        let across = self.size.width / BLOCK + 1;
        let per_row = self.size.width.saturating_sub(2).max(1);
        let mut blocks = vec![Sums::default(); across * (self.size.height / BLOCK + 1)];
        let mut all = Sums::default();
        for (i, (a, b)) in self.residuals.iter().zip(&last.residuals).enumerate() {
            let (x, y) = (1 + i % per_row, 1 + ROWS * (i / per_row));
            let (a, b) = (f64::from(*a), f64::from(*b));
            if a.is_finite() && b.is_finite() {
                all.add(a, b);
                if let Some(block) = blocks.get_mut(y / BLOCK * across + x / BLOCK) {
                    block.add(a, b);
                }
            }
        }
        if all.count < 200 || (all.aa.min(all.bb) / all.count as f64).sqrt() < NOISY {
            return None;
        }
        let full = blocks.iter().filter(|block| block.count >= BLOCK_LEAST && block.aa.min(block.bb) > 0.0);
        let mut each: Vec<f64> = full.map(Sums::correlation).collect();
        each.sort_by(f64::total_cmp);
        if each.len() < BLOCKS { Some(all.correlation()) } else { each.get(each.len() / 2).copied() }
    }

    /// True where positions, depths or normals of `frame` differ from this one's in many pixels.
    pub fn guides_changed(&self, frame: &SequenceFrame) -> bool {
        let now = guides(frame);
        let changed = now.iter().zip(&self.guides).filter(|(a, b)| (*a - *b).abs() > 1e-3 * b.abs().max(1e-3)).count();
        now.len() == self.guides.len() && changed * 5 > now.len()
    }
}

/// Sums over pixels of two frames.
#[derive(Clone, Default)]
struct Sums {
    aa: f64,
    bb: f64,
    ab: f64,
    count: usize,
}

impl Sums {
    fn add(&mut self, a: f64, b: f64) {
        self.aa += a * a;
        self.bb += b * b;
        self.ab += a * b;
        self.count += 1;
    }

    fn correlation(&self) -> f64 {
        self.ab / (self.aa * self.bb).sqrt()
    }
}

/// True where a pixel and its neighbours are one smooth surface.
pub(crate) fn smooth(frame: &SequenceFrame, x: usize, y: usize) -> bool {
    let near = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
    let depth = frame.depth.as_ref().is_none_or(|d| {
        let here = d.at(x, y);
        here.is_finite() && near.iter().all(|(u, v)| (d.at(*u, *v) - here).abs() < 0.03 * here)
    });
    let differ = |a: [f32; 3], b: [f32; 3], limit: f32| (0..3).any(|c| (a[c] - b[c]).abs() > limit);
    let normal = frame.normal.as_ref().is_none_or(|n| near.iter().all(|(u, v)| !differ(n.at(*u, *v), n.at(x, y), 0.1)));
    let albedo =
        frame.albedo.as_ref().is_none_or(|a| near.iter().all(|(u, v)| !differ(a.at(*u, *v), a.at(x, y), 0.25)));
    depth && normal && albedo
}

/// The guide that is least noisy, at few pixels.
fn guides(frame: &SequenceFrame) -> Vec<f32> {
    let Size { width, height } = frame.size;
    let places = (0..height).step_by(7).flat_map(|y| (0..width).step_by(7).map(move |x| (x, y)));
    if let Some(position) = &frame.position {
        return places.flat_map(|(x, y)| position.at(x, y)).collect();
    }
    if let Some(depth) = &frame.depth {
        return places.map(|(x, y)| depth.at(x, y)).map(|d| if d.is_finite() { d } else { -1.0 }).collect();
    }
    frame.normal.as_ref().map_or_else(Vec::new, |normal| places.flat_map(|(x, y)| normal.at(x, y)).collect())
}

/// Where a renderer's seed is set.
pub(crate) fn seed_setting(renderer: &str) -> &'static str {
    match renderer {
        "blender" => "Render > Sampling > Advanced: the clock beside Seed, `cycles.use_animated_seed`",
        "mitsuba" => "`seed` of `mi.render`",
        "pbrt" => "`--seed`",
        "arnold" => "options, `AA_seed` by frame",
        _ => "the renderer's sampling seed",
    }
}
