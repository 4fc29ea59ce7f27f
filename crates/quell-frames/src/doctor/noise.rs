//! What the noise shows: one seed for all frames, a filter that splats, a picture that was denoised before.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use super::follow::Paths;
use super::grain::{FAR, Shared, grain, shared, tone};
use super::look::Look;
use crate::adapt::noise::{REPEATS, seed_setting};

/// Second differences of neighbours over those of far pixels, of independent noise: 1. Below, one frame alone cannot say
/// whether noise is shared or the picture has detail. Docs/doctor.md has the figures.
const EVEN: f64 = 0.78;
const DENOISED: f64 = 0.2;
/// How much more the changes of neighbours correlate than those of pixels further apart. Docs/doctor.md has the figures.
const SPLATTED: f64 = 0.15;
/// Correlation of neighbours' changes from which a picture may count as denoised (5x5 pixels averaged: 0.65 to 0.8).
const SMEARED: f64 = 0.5;
/// Without guides: correlation of neighbouring frames from which one seed is likely (one seed 0.27, its own for each 0.05).
const BLIND: f64 = 0.15;

/// What noise frames have.
#[derive(Debug, Default)]
pub(super) struct Noise {
    /// Later frame, correlation with the one before.
    seeds: Vec<(i64, f64)>,
    /// Frame, ratio of second differences, deviation of far ones.
    grain: Vec<(i64, f64, f64)>,
    /// Later frame, what neighbouring pixels share.
    shared: Vec<(i64, Shared)>,
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

    pub fn pair(&mut self, earlier: &Look, later: &Look, paths: Option<&Paths>) {
        if earlier.beauty == later.beauty {
            return;
        }
        let correlation = later.trace.correlation(&earlier.trace);
        if let Some(correlation) = correlation {
            self.seeds.push((later.number, correlation));
        }
        // Noise that repeats is not in the change.
        let own = correlation.is_none_or(|c| c <= REPEATS);
        if let Some(paths) = paths.filter(|_| own)
            && let Some(found) = shared(paths, &paths.change(&tone(earlier), &tone(later)), &later.frame)
        {
            self.shared.push((later.number, found));
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
        let mut figures =
            vec![Figure::new("ratio of second differences", ratio, ""), Figure::new("deviation", deviation, "")];
        let mut text = format!(
            "second differences of neighbouring pixels are {:.0} % of those of pixels {FAR} apart (independent noise: 100 %), in {} frames",
            ratio * 100.0,
            self.grain.len()
        );
        let change = self.change();
        if let Some(change) = change {
            figures.push(Figure::new("correlation of neighbours", change.near, ""));
            figures.push(Figure::new("correlation of pixels 3 apart", change.far, ""));
            text += &format!(
                "; what changes from frame to frame on surfaces at rest correlates by {:.2} between neighbours and by {:.2} between \
                 pixels 3 apart, in {} pairs",
                change.near,
                change.far,
                self.shared.len()
            );
        }
        // A picture nearly without noise has small second differences, too: there nothing but noise changes.
        if ratio < DENOISED && change.is_none_or(|change| change.near > SMEARED) {
            denoised(renderer, beauty, first, text, figures, found);
            return true;
        }
        match change {
            Some(change) if change.near - change.far > SPLATTED => {
                splatted(renderer, beauty, first, text, figures, found);
                return false;
            }
            Some(_) => {}
            None if ratio < EVEN && self.blind => {
                found.cannot(
                    "whether noise is independent from pixel to pixel (splatted filter)",
                    "without normals, depth or albedo a texture looks like noise that neighbours share",
                );
                return false;
            }
            None if ratio < EVEN => {
                found.cannot(
                    "whether noise is independent from pixel to pixel (splatted filter)",
                    format!(
                        "fine detail of the picture looks like noise that neighbours share ({:.0} %), and no neighbouring frame shows \
                         the same surfaces at rest",
                        ratio * 100.0
                    ),
                );
                return false;
            }
            None => {}
        }
        found.pass("filter.splatted", format!("noise is independent from pixel to pixel: {text}"));
        false
    }
    /// Medians over the pairs.
    fn change(&self) -> Option<Shared> {
        let middle = |of: &dyn Fn(&Shared) -> f64| {
            let mut all: Vec<f64> = self.shared.iter().map(|(_, s)| of(s)).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied()
        };
        Some(Shared { near: middle(&|s| s.near)?, far: middle(&|s| s.far)? })
    }
}

fn denoised(renderer: &str, beauty: &str, first: i64, text: String, figures: Vec<Figure>, found: &mut Diagnosis) {
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
            .cure("what the first denoiser smeared or made up is kept, and its flicker counts as picture", remedy),
    );
}

fn splatted(renderer: &str, beauty: &str, first: i64, text: String, figures: Vec<Figure>, found: &mut Diagnosis) {
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
}
