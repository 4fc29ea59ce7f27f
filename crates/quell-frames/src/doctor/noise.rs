//! What the noise shows: one seed for all frames, a filter that splats, a picture that was denoised before.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use super::look::Look;
use crate::adapt::noise::{REPEATS, seed_setting};
use quell::{Plane, Size};

/// Distances of the differences: neighbours, and pixels that no usual filter joins.
const NEAR: usize = 1;
const FAR: usize = 4;
/// Second differences of neighbours over those of far pixels, of independent noise: 1. Docs/doctor.md has the figures.
const SPLATTED: f64 = 0.78;
const DENOISED: f64 = 0.2;
/// Without guides: correlation of neighbouring frames from which one seed is likely (one seed 0.27, its own for each 0.05).
const BLIND: f64 = 0.15;
/// Least deviation of the noise (of values in 0..1) that says anything.
const VISIBLE: f64 = 0.003;

/// What noise frames have.
#[derive(Debug, Default)]
pub(super) struct Noise {
    /// Later frame, correlation with the one before.
    seeds: Vec<(i64, f64)>,
    /// Frame, ratio of second differences, deviation of far ones.
    grain: Vec<(i64, f64, f64)>,
    /// No feature buffer says what is texture.
    blind: bool,
}

impl Noise {
    pub fn look(&mut self, look: &Look) {
        let frame = &look.frame;
        self.blind = frame.normal.is_none() && frame.depth.is_none() && frame.albedo.is_none();
        if let Some((ratio, deviation)) = grain(look) {
            self.grain.push((look.number, ratio, deviation));
        }
    }

    pub fn pair(&mut self, earlier: &Look, later: &Look) {
        if earlier.beauty != later.beauty
            && let Some(correlation) = later.trace.correlation(&earlier.trace)
        {
            self.seeds.push((later.number, correlation));
        }
    }

    pub fn judge(&self, renderer: &str, beauty: &str, several: bool, found: &mut Diagnosis) {
        let denoised = self.structure(renderer, beauty, found);
        if found.has("frames.on_twos") || found.has("frames.repeated") {
            return;
        }
        let mut all: Vec<f64> = self.seeds.iter().map(|(_, c)| *c).collect();
        all.sort_by(f64::total_cmp);
        let Some(middle) = all.get(all.len() / 2).copied() else {
            let why = if several {
                "too little noise, or no surface that is smooth over some pixels, in neighbouring frames"
            } else {
                "there is one frame only"
            };
            found.cannot("whether every frame has the same seed", why);
            return;
        };
        if self.blind && middle > BLIND && !denoised {
            found.cannot(
                "whether every frame has the same seed",
                format!(
                    "without guides a texture that stands still looks like noise that repeats; neighbouring frames do correlate by \
                     {middle:.2} (independent noise: below 0.05), so look whether the seed varies by frame: {}",
                    seed_setting(renderer)
                ),
            );
            return;
        }
        let repeats = self.seeds.iter().filter(|(_, c)| *c > REPEATS).count();
        if repeats * 2 > self.seeds.len() && !denoised {
            let first = self.seeds.iter().find(|(_, c)| *c > REPEATS).map_or(0, |s| s.0);
            found.findings.push(
                Finding::new("seed.repeated", Severity::Fault, "every frame has the same noise: one seed for all")
                    .frame(first)
                    .channel(beauty)
                    .evidence(
                        format!(
                            "the noise of neighbouring frames correlates by {middle:.2} in the middle of {} pairs ({repeats} above {REPEATS}; \
                             independent noise: 0.02)",
                            self.seeds.len()
                        ),
                        vec![Figure::new("correlation", middle, "")],
                    )
                    .cure(
                        "frames before and after bring nothing new, so the noise cannot be averaged away: it stays, as a pattern that sticks to the \
                         picture",
                        format!("vary the seed by frame: {}", seed_setting(renderer)),
                    ),
            );
        } else {
            found.pass("seed.repeated", format!("noise of neighbouring frames correlates by {middle:.3}"));
        }
    }

    fn structure(&self, renderer: &str, beauty: &str, found: &mut Diagnosis) -> bool {
        let mut ratios: Vec<f64> = self.grain.iter().map(|g| g.1).collect();
        ratios.sort_by(f64::total_cmp);
        let (Some(ratio), Some((first, _, deviation))) =
            (ratios.get(ratios.len() / 2).copied(), self.grain.first().copied())
        else {
            found.cannot(
                "whether noise is independent from pixel to pixel (splatted filter, denoised input)",
                "no noise is seen on surfaces that are smooth over some pixels",
            );
            return false;
        };
        let figures =
            vec![Figure::new("ratio of second differences", ratio, ""), Figure::new("deviation", deviation, "")];
        let text = format!(
            "second differences of neighbouring pixels are {:.0} % of those of pixels {FAR} apart (independent noise: 100 %), in {} frames",
            ratio * 100.0,
            self.grain.len()
        );
        if ratio < DENOISED {
            let remedy = if renderer == "blender" {
                "switch denoising off (Render > Sampling > Denoise), or keep its `Noisy Image` in the file (View Layer > Data > Denoising Data)"
            } else {
                "write the picture before the renderer's own denoiser; quell cannot bring back what that took away"
            };
            found.findings.push(
                Finding::new("input.denoised", Severity::Fault, "the picture was denoised, or blurred, before")
                    .frame(first)
                    .channel(beauty)
                    .evidence(text, figures)
                    .cure(
                        "what the first denoiser smeared or made up is kept, and its flicker counts as picture",
                        remedy,
                    ),
            );
            return true;
        }
        if ratio < SPLATTED && self.blind {
            found.cannot(
                "whether noise is independent from pixel to pixel (splatted filter)",
                "without normals, depth or albedo a texture looks like noise that neighbours share",
            );
            return false;
        }
        if ratio < SPLATTED {
            let remedy = match renderer {
                "mitsuba" => "`<rfilter type=\"box\"/>`",
                "arnold" => "options: filter `box_filter`, width 1, for all passes",
                "renderman" => "Ri:PixelFilter `box`, width 1 1 (or `importance` mode)",
                "pbrt" => "PixelFilter \"box\"",
                "vray" => "switch the image filter off, or box with size 1",
                _ => "a box filter of one pixel, or filter importance sampling",
            };
            found.findings.push(
                Finding::new(
                    "filter.splatted",
                    Severity::Fault,
                    "noise is shared between neighbouring pixels: each sample was splatted over several",
                )
                .frame(first)
                .channel(beauty)
                .evidence(text, figures)
                .cure("noise is taken for picture, since it is smooth: blotches of some pixels are left", remedy),
            );
            return false;
        }
        found.pass("filter.splatted", format!("noise is independent from pixel to pixel: {text}"));
        false
    }
}

/// Medians of second differences of light at two distances on smooth surfaces: their ratio, and the deviation that the far
/// ones show. Along rows and columns alike.
fn grain(look: &Look) -> Option<(f64, f64)> {
    let Size { width, height } = look.frame.size;
    let frame = &look.frame;
    // Light without the surface's colour, between 0 and 1: fireflies must not decide.
    let light = Plane::from_fn(frame.size, |x, y| {
        let value = look.beauty.at(x, y);
        let colour = frame.albedo.as_ref().map_or([1.0; 3], |a| a.at(x, y));
        let sum: f32 = (0..3).map(|c| value[c].max(0.0) / colour[c].max(0.05)).sum();
        if sum.is_finite() { sum / (1.0 + sum) } else { f32::NAN }
    });
    let same = |p: (usize, usize), q: (usize, usize)| {
        let depth = frame.depth.as_ref().is_none_or(|d| {
            let (a, b) = (d.at(p.0, p.1), d.at(q.0, q.1));
            a.is_finite() && b.is_finite() && (a - b).abs() < 0.1 * a
        });
        let differ = |a: [f32; 3], b: [f32; 3], limit: f32| (0..3).any(|c| (a[c] - b[c]).abs() > limit);
        depth
            && frame.normal.as_ref().is_none_or(|n| !differ(n.at(p.0, p.1), n.at(q.0, q.1), 0.1))
            && frame.albedo.as_ref().is_none_or(|a| !differ(a.at(p.0, p.1), a.at(q.0, q.1), 0.08))
    };
    if width <= 2 * FAR || height <= 2 * FAR {
        return None;
    }
    let step = (frame.size.pixels() / 60_000).max(1);
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
            if !(same((x, y), a) && same((x, y), b)) {
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
    if differences[0].len() < 500 {
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
