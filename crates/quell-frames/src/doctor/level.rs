//! How much noise there is: relative deviation, median over pixels, by light.

use super::finding::Level;
use super::follow::Paths;
use super::look::Look;
use quell::sequence::{Light, LightKind};
use quell::{Plane, Rgb, Size};
use std::collections::BTreeMap;

/// About so many pixels are looked at.
const PIXELS: usize = 60_000;
/// Fewer say nothing.
const LEAST: usize = 300;
/// The median of |x| of a normal deviate.
const NORMAL_MEDIAN: f64 = 0.6745;

/// Deviations over means of each light, of frames and of pairs of frames.
#[derive(Default)]
pub(super) struct Levels {
    space: BTreeMap<String, Vec<f64>>,
    time: BTreeMap<String, Vec<f64>>,
    /// In the file's order, the beauty first.
    names: Vec<String>,
}

impl Levels {
    pub fn look(&mut self, beauty: &str, look: &Look) {
        for (name, plane) in lights(beauty, look) {
            if !self.names.contains(&name) {
                self.names.push(name.clone());
            }
            self.space.entry(name).or_default().extend(in_space(&plane));
        }
    }

    pub fn pair(&mut self, beauty: &str, earlier: &Look, later: &Look, paths: &Paths) {
        if earlier.beauty == later.beauty {
            return;
        }
        for ((name, a), (other, b)) in lights(beauty, earlier).into_iter().zip(lights(beauty, later)) {
            if name == other {
                self.time.entry(name).or_default().extend(in_time(paths, &a, &b));
            }
        }
    }

    /// The lesser of both estimates: detail of the picture adds to either.
    pub fn found(&self) -> Vec<Level> {
        let middle = |all: &BTreeMap<String, Vec<f64>>, name: &str| {
            let mut values = all.get(name)?.clone();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied()
        };
        let both = |name: &str| -> Option<f64> {
            middle(&self.space, name).into_iter().chain(middle(&self.time, name)).min_by(f64::total_cmp)
        };
        self.names.iter().filter_map(|name| Some(Level { pass: name.clone(), relative: both(name)? })).collect()
    }
}

/// Brightness of the picture and of each light that has noise.
fn lights(beauty: &str, look: &Look) -> Vec<(String, Plane<f32>)> {
    let bright = |plane: &Plane<Rgb>| Plane::from_fn(plane.size(), |x, y| plane.at(x, y).iter().sum::<f32>() / 3.0);
    // What no pass holds, or a beauty that could not be divided, is no pass of its own.
    let noisy = |light: &&Light| light.in_beauty && !matches!(light.kind, LightKind::NoiseFree | LightKind::Beauty);
    let passes = look.frame.lights.iter().filter(noisy).map(|light| (light.name.clone(), bright(&light.light)));
    std::iter::once((beauty.to_owned(), bright(&look.beauty))).chain(passes).collect()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    (values.len() >= LEAST).then(|| values.get(values.len() / 2).copied()).flatten()
}

/// Second differences along rows and columns over the mean of their pixels.
fn in_space(light: &Plane<f32>) -> Option<f64> {
    let Size { width, height } = light.size();
    if width < 3 || height < 3 {
        return None;
    }
    let step = (light.size().pixels() / PIXELS).max(1);
    let mut found = Vec::new();
    for i in (0..light.size().pixels()).step_by(step) {
        let (x, y) = (i % width, i / width);
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            continue;
        }
        for (a, b) in [((x - 1, y), (x + 1, y)), ((x, y - 1), (x, y + 1))] {
            let [a, b, c] = [a, b, (x, y)].map(|(u, v)| f64::from(light.at(u, v)));
            let mean = (a + b + c) / 3.0;
            let ratio = (a + b - 2.0 * c).abs() / (6f64.sqrt() * NORMAL_MEDIAN * mean);
            if mean > 0.0 && ratio.is_finite() {
                found.push(ratio);
            }
        }
    }
    median(found)
}

/// Differences of neighbours' changes, which have the noise of four pixels, over the mean of the four.
fn in_time(paths: &Paths, earlier: &Plane<f32>, later: &Plane<f32>) -> Option<f64> {
    let Size { width, height } = later.size();
    let step = (later.size().pixels() / PIXELS).max(1);
    let mut found = Vec::new();
    for i in (0..later.size().pixels()).step_by(step) {
        let (x, y) = (i % width, i / width);
        for q in [(x + 1, y), (x, y + 1)] {
            if q.0 >= width || q.1 >= height || !paths.together((x, y), q) {
                continue;
            }
            let (Some(p0), Some(q0)) = (paths.before(x, y), paths.before(q.0, q.1)) else { continue };
            let [a, b] = [(x, y), q].map(|(u, v)| f64::from(later.at(u, v)));
            let [c, d] = [p0, q0].map(|(u, v)| f64::from(earlier.at(u, v)));
            let mean = (a + b + c + d) / 4.0;
            let ratio = ((a - c) - (b - d)).abs() / (2.0 * NORMAL_MEDIAN * mean);
            if mean > 0.0 && ratio.is_finite() {
                found.push(ratio);
            }
        }
    }
    median(found)
}
