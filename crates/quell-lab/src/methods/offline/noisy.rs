//! What the offline methods read of a frame: colour in two halves, its variance, and features.

use super::image::{self, Colour, Image};
use super::weights::{Guide, Kernel, Noisy, filter};
use crate::error::Error;
use crate::methods::Input;
use crate::tone::luminance;
use fearless_simd::Level;
use quell::{Frame, Plane, Rgb, Size};

/// Channels of all features: albedo 3, normal 3, depth 1.
pub const FEATURES: usize = 7;

/// Radius of the box that smooths a variance from two halves, which has but one degree of freedom a pixel.
const SMOOTHING_RADIUS: usize = 2;
/// Part of the samples' variance by which it differs from that of the halves, below which both are the same numbers.
const SAME: f64 = 0.01;

/// Light from two independent halves of the samples, without the frame's direct term: that has no noise, and a filter
/// could only blur it. [`finished`] adds it again.
pub struct Halves {
    /// From the first half.
    pub a: Colour,
    /// From the second.
    pub b: Colour,
}

impl Halves {
    /// The composites of both halves, less the direct term.
    ///
    /// # Errors
    /// [`Error::Method`] where the frame has none.
    pub fn of(method: &str, input: &Input<'_>) -> Result<Self, Error> {
        let frame = Frame { direct: None, ..*input.frame };
        let [a, b] = Input { frame: &frame, ..*input }.half_composites().ok_or_else(|| Error::Method {
            method: method.to_owned(),
            reason: "needs two independent halves of the samples; render at least 2 samples a pixel, with halves"
                .to_owned(),
        })?;
        Ok(Self { a: Image::colour(&a), b: Image::colour(&b) })
    }

    /// The mean of both.
    pub fn mean(&self) -> Colour {
        image::mean(&self.a, &self.b)
    }

    /// Variance of the mean, per pixel and channel: (A - B)^2 / 4. Unbiased, and as noisy as one degree of freedom is.
    pub fn raw_variance(&self) -> Colour {
        image::zip(&self.a, &self.b, |a, b| 0.25 * (a - b) * (a - b))
    }

    /// Variance of the mean, smoothed (Rousselle et al. 2012, section 5): the raw one averaged over a box. Where the
    /// frame brings the samples' own variance (`shape`, of luminance), that gives the detail and the halves, which are
    /// right for stratified samples too, the scale.
    pub fn variance(&self, shape: Option<&Image>) -> Colour {
        let smooth_shape = shape.map(|s| box_mean(s, SMOOTHING_RADIUS));
        self.raw_variance().map(|raw| {
            let smooth = box_mean(&raw, SMOOTHING_RADIUS);
            let (Some(shape), Some(smooth_shape)) = (shape, &smooth_shape) else { return smooth };
            let relative = shape.zip(smooth_shape, |s, mean| if mean > 0.0 { s / mean } else { 1.0 });
            smooth.zip(&relative, |v, r| v * r)
        })
    }
}

/// The finished picture: filtered light, no less than 0 (a linear model may predict that), and the direct term.
pub fn finished(input: &Input<'_>, filtered: &Colour) -> Plane<Rgb> {
    let [r, g, b] = filtered;
    Plane::from_fn(input.frame.size, |x, y| {
        let direct = input.frame.direct.map_or([0.0; 3], |p| p.at(x, y));
        let light = [r, g, b].map(|c| c.at(x, y).max(0.0));
        std::array::from_fn(|c| light[c] + if direct[c].is_finite() { direct[c] } else { 0.0 })
    })
}

/// The variance of the composite's luminance from that of the signals, up to a factor; where the frame has both, and
/// where they say more than the halves do: of two samples the variance is the difference of the halves, so that a pixel
/// whose two paths found nothing would count as known to be black.
pub fn sample_variance(input: &Input<'_>) -> Option<Image> {
    let frame = input.frame;
    let (matte, glossy) = (frame.matte_variance?, frame.glossy_variance?);
    if let Some([a, b]) = input.halves {
        let halves = |x, y| 0.25 * (luminance(a.matte.at(x, y)) - luminance(b.matte.at(x, y))).powi(2);
        let (mut apart, mut all) = (0.0_f64, 0.0_f64);
        for y in 0..frame.size.height {
            for x in 0..frame.size.width {
                let (own, of_halves) = (f64::from(matte.at(x, y)), f64::from(halves(x, y)));
                apart += (own - of_halves).abs();
                all += own.abs();
            }
        }
        // What is not a number says nothing either.
        if apart.is_nan() || apart <= SAME * all {
            return None;
        }
    }
    let weight = |plane: Option<quell::PlaneRef<'_, Rgb>>, x, y| plane.map_or(1.0, |p| luminance(p.at(x, y)));
    Some(Image::from_fn(frame.size, |x, y| {
        let (m, g) = (weight(frame.matte_weight, x, y), weight(frame.glossy_weight, x, y));
        m * m * matte.at(x, y) + g * g * glossy.at(x, y)
    }))
}

/// The mean over a box of (2 `radius` + 1)^2 pixels, as far as they lie in the image.
pub fn box_mean(image: &Image, radius: usize) -> Image {
    let size = image.size();
    let along = |count: usize, i: usize| i.saturating_sub(radius)..(i + radius + 1).min(count);
    let mean = |range: std::ops::Range<usize>, at: &dyn Fn(usize) -> f32| {
        let n = range.len() as f32;
        range.map(at).sum::<f32>() / n
    };
    let rows = Image::from_fn(size, |x, y| mean(along(size.width, x), &|i| image.at(i, y)));
    Image::from_fn(size, |x, y| mean(along(size.height, y), &|i| rows.at(x, i)))
}

/// Channels of a scene's property that guides filters; of about unit range.
#[derive(Clone)]
pub struct Feature {
    /// Mean over all samples, one image a channel.
    pub mean: Vec<Image>,
    /// Absent where the feature is noise-free, as all are that the tracer delivers: one sample position a pixel.
    pub noise: Option<FeatureNoise>,
}

/// What is known about the noise of a feature.
#[derive(Clone)]
pub struct FeatureNoise {
    /// From two independent halves of the samples.
    pub halves: [Vec<Image>; 2],
    /// Variance of the mean.
    pub variance: Vec<Image>,
}

/// A feature after its filter.
#[derive(Clone)]
pub struct FilteredFeature {
    /// From each half; equal where the feature is noise-free.
    pub halves: [Vec<Image>; 2],
    /// Variance of the mean that is left; `None`: noise-free.
    pub variance: Option<Vec<Image>>,
}

impl FilteredFeature {
    /// The mean of both halves.
    pub fn mean(&self) -> Vec<Image> {
        let [a, b] = &self.halves;
        a.iter().zip(b).map(|(a, b)| a.zip(b, |a, b| 0.5 * (a + b))).collect()
    }
}

impl Feature {
    /// A noise-free feature.
    pub fn clean(mean: Vec<Image>) -> Self {
        Self { mean, noise: None }
    }

    /// Filters each half with weights from the other. A noise-free feature needs no filter and gets none.
    pub fn prefiltered(&self, level: Level, kernel: &Kernel) -> FilteredFeature {
        let Some(noise) = &self.noise else {
            return FilteredFeature { halves: [self.mean.clone(), self.mean.clone()], variance: None };
        };
        // The variance of a half is twice that of the mean.
        let doubled: Vec<Image> = noise.variance.iter().map(|v| v.map(|v| 2.0 * v)).collect();
        let cross = |from: usize| -> Vec<Image> {
            let guide = noise.halves[1 - from].iter().zip(&doubled);
            let guide =
                Guide { colour: guide.map(|(value, variance)| Noisy { value, variance }).collect(), features: vec![] };
            noise.halves[from].iter().flat_map(|channel| filter(level, &guide, kernel, [channel]).channels).collect()
        };
        let [a, b] = [cross(0), cross(1)];
        let left = a.iter().zip(&b).map(|(a, b)| box_mean(&a.zip(b, |a, b| 0.25 * (a - b) * (a - b)), 1));
        FilteredFeature { variance: Some(left.collect()), halves: [a, b] }
    }
}

/// Albedo, normal and depth of a frame, noise-free and of about unit range. Depth is divided by the largest of the
/// surfaces; the background has depth 1, normal 0 and albedo 0. What the frame lacks is constant and guides nothing.
pub fn features(input: &Input<'_>) -> [Feature; 3] {
    let frame = input.frame;
    let albedo = input.albedo();
    let normal = Plane::from_fn(frame.size, |x, y| frame.normal.map_or([0.0; 3], |p| p.at(x, y).map(|v| 0.5 * v)));
    let depth_at = |x, y| frame.view_depth.map_or(1.0, |p| p.at(x, y));
    let pixels = |size: Size| (0..size.height).flat_map(move |y| (0..size.width).map(move |x| (x, y)));
    let depths = pixels(frame.size).map(|(x, y)| depth_at(x, y)).filter(|d| d.is_finite());
    let largest = depths.fold(f32::MIN_POSITIVE, f32::max);
    let depth = Image::from_fn(frame.size, |x, y| {
        let d = depth_at(x, y) / largest;
        if d.is_finite() { d } else { 1.0 }
    });
    [
        Feature::clean(Image::colour(&albedo).into()),
        Feature::clean(Image::colour(&normal).into()),
        Feature::clean(vec![depth]),
    ]
}
