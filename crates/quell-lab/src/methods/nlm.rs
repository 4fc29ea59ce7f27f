//! `nlm`: non-local means with features (Rousselle, Manzi, Zwicker, Pacific Graphics 2013); `nlm:colour`: with colour
//! alone (Rousselle, Knaus, Zwicker, SIGGRAPH Asia 2012). Constants and departures: docs/baselines-offline.md.

use super::offline::image::{self, Colour, Image};
use super::offline::noisy::{FilteredFeature, Halves, box_mean, features, finished, sample_variance};
use super::offline::weights::{Bound, Filtered, Guide, Kernel, Noisy, filter};
use super::{Input, Method};
use crate::error::Error;
use fearless_simd::Level;
use quell::{Plane, Rgb};

const RADIUS: usize = 10;
/// Strength of colour in both papers.
const K_COLOUR: f32 = 0.45;
/// 2012.
const COLOUR_KERNEL: Kernel = Kernel { radius: RADIUS, patch: 3, k: K_COLOUR };
/// 2013, section 4: features are filtered by non-local means before they guide anything.
const FEATURE_KERNEL: Kernel = Kernel { radius: 5, patch: 3, k: 1.0 };
/// 2013: strength of features.
const K_FEATURE: f32 = 0.6;
/// Radius of the box over what is left of the variance after the first pass.
const RESIDUAL_RADIUS: usize = 1;

/// 2013, section 5: the three filters of which the best is taken at each pixel.
const CANDIDATES: [Candidate; 3] = [
    // Sensitive to colour: fine detail.
    Candidate { colour: true, patch: 1, tau: 1e-3 },
    // Robust against noise in colour.
    Candidate { colour: true, patch: 3, tau: 1e-3 },
    // Features alone: smooth light on detailed surfaces.
    Candidate { colour: false, patch: 0, tau: 1e-4 },
];

#[derive(Clone, Copy)]
struct Candidate {
    colour: bool,
    patch: usize,
    /// Least squared difference of features that counts as a step.
    tau: f32,
}

impl Candidate {
    fn kernel(&self) -> Kernel {
        Kernel { radius: RADIUS, patch: self.patch, k: K_COLOUR }
    }
}

/// The method.
#[derive(Debug)]
pub struct Nlm {
    level: Level,
    with_features: bool,
}

impl Nlm {
    /// With colour and features (2013), or with colour alone (2012).
    pub fn new(with_features: bool) -> Self {
        Self { level: Level::new(), with_features }
    }
}

impl Method for Nlm {
    fn name(&self) -> String {
        if self.with_features { "nlm" } else { "nlm:colour" }.to_owned()
    }

    fn needs_halves(&self) -> bool {
        true
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let noisy = Halves::of(&self.name(), input)?;
        let variance = noisy.variance(sample_variance(input).as_ref());
        let denoised = if self.with_features {
            let features = features(input).map(|f| f.prefiltered(self.level, &FEATURE_KERNEL));
            self.colour_and_features(&noisy, &variance, &features)
        } else {
            // 2012, section 4.2: each half with weights from the other, so that noise and weights are independent.
            let [a, b] = self.cross(&noisy, &variance, &[], &COLOUR_KERNEL, true);
            image::mean(&a.channels, &b.channels)
        };
        Ok(finished(input, &denoised))
    }
}

impl Nlm {
    /// Filters each half with weights from the other half (if `colour`) and from features.
    fn cross(
        &self,
        noisy: &Halves,
        variance: &Colour,
        features: &[Bound<'_>],
        kernel: &Kernel,
        colour: bool,
    ) -> [Filtered<3>; 2] {
        // The variance of a half is twice that of the mean.
        let variance: Colour = std::array::from_fn(|c| variance[c].map(|v| 2.0 * v));
        [(&noisy.a, &noisy.b), (&noisy.b, &noisy.a)].map(|(input, other)| {
            let channels = if colour { other.as_slice() } else { &[] };
            let channels = channels.iter().zip(&variance).map(|(value, variance)| Noisy { value, variance });
            let guide = Guide { colour: channels.collect(), features: features.to_vec() };
            filter(self.level, &guide, kernel, input.each_ref())
        })
    }

    /// 2013.
    fn colour_and_features(&self, noisy: &Halves, variance: &Colour, features: &[FilteredFeature; 3]) -> Colour {
        let means: Vec<(Vec<Image>, Option<&Vec<Image>>)> =
            features.iter().map(|f| (f.mean(), f.variance.as_ref())).collect();
        let bounds = |tau: f32| -> Vec<Bound<'_>> {
            means
                .iter()
                .flat_map(|(mean, variance)| {
                    mean.iter().enumerate().map(move |(c, m)| (m, variance.and_then(|v| v.get(c))))
                })
                .map(|(value, variance)| Bound { value, variance, per_square: per_square(value, variance, tau) })
                .collect()
        };
        // Section 5: the candidates, and Stein's unbiased estimate of their errors.
        let filtered = CANDIDATES.map(|candidate| {
            self.cross(noisy, variance, &bounds(candidate.tau), &candidate.kernel(), candidate.colour)
        });
        let risks = [0, 1, 2].map(|i| risk(noisy, variance, &filtered[i]));
        // The estimates are noisy: they are filtered, compared, and the choices filtered again.
        let first = CANDIDATES[0];
        let mean = noisy.mean();
        let channels = mean.iter().zip(variance).map(|(value, variance)| Noisy { value, variance });
        let guide = Guide { colour: channels.collect(), features: bounds(first.tau) };
        let risks = filter(self.level, &guide, &first.kernel(), risks.each_ref()).channels;
        let least = risks[0].zip(&risks[1], f32::min).zip(&risks[2], f32::min);
        let mut taken = least.map(|_| 0.0);
        let choices = risks.each_ref().map(|risk| {
            let chosen = risk.zip(&least, |r, l| f32::from(u8::from(r <= l))).zip(&taken, |c, t| c * (1.0 - t));
            taken = taken.zip(&chosen, |t, c| t + c);
            chosen
        });
        let shares = filter(self.level, &guide, &first.kernel(), choices.each_ref()).channels;
        let blend = |half: usize| -> Colour {
            std::array::from_fn(|c| {
                let part = |i: usize| filtered[i][half].channels[c].zip(&shares[i], |v, s| v * s);
                part(0).zip(&part(1), |x, y| x + y).zip(&part(2), |x, y| x + y)
            })
        };
        let blended = Halves { a: blend(0), b: blend(1) };
        // The second pass takes what noise is left, by the difference of the filtered halves.
        let left = blended.raw_variance().map(|v| box_mean(&v, RESIDUAL_RADIUS));
        let [a, b] = self.cross(&blended, &left, &bounds(first.tau), &first.kernel(), true);
        image::mean(&a.channels, &b.channels)
    }
}

/// 2013, equation 6: 1 / (k_f^2 max(tau, V, |grad f|^2)).
fn per_square(feature: &Image, variance: Option<&Image>, tau: f32) -> Image {
    let size = feature.size();
    Image::from_fn(size, |x, y| {
        let i = feature.index(x, y);
        let at = |i: usize| feature.data()[i];
        let (gx, gy) = (0.5 * (at(i + 1) - at(i - 1)), 0.5 * (at(i + feature.stride()) - at(i - feature.stride())));
        let floor = tau.max(variance.map_or(0.0, |v| v.data()[i]));
        1.0 / (K_FEATURE * K_FEATURE * floor.max(gx * gx + gy * gy))
    })
}

/// Stein's unbiased risk estimate, mean over halves and channels: (F(u) - u)^2 - V + 2 V dF/du. The weights of a half
/// come from the other one, so the derivative is the pixel's own share in its result, exactly.
fn risk(noisy: &Halves, variance: &Colour, filtered: &[Filtered<3>; 2]) -> Image {
    let mut sum = variance[0].map(|_| 0.0);
    for (input, output) in [(&noisy.a, &filtered[0]), (&noisy.b, &filtered[1])] {
        for c in 0..3 {
            let error = output.channels[c].zip(&input[c], |f, u| (f - u) * (f - u));
            let noise = variance[c].zip(&output.own_share, |v, share| 2.0 * v * (2.0 * share - 1.0));
            sum = sum.zip(&error.zip(&noise, |e, n| (e + n) / 6.0), |s, r| s + r);
        }
    }
    sum
}
