//! relMSE, trimmed relMSE, fireflies and PSNR; maps of the relative error.

use crate::error::Error;
use crate::tone::{Tone, luminance};
use quell::{Plane, Rgb};

/// eps of relMSE = this times the squared mean luminance of the reference.
pub(crate) const EPSILON_PART: f64 = 0.01;
/// Share of pixels that the trimmed mean leaves out: fireflies.
pub(crate) const TRIMMED_PART: f64 = 0.001;
/// A firefly's error, in units of the percentile below.
const FIREFLY_FACTOR: f64 = 10.0;
/// Percentile of the reference's luminance against which fireflies are counted.
const FIREFLY_PERCENTILE: f64 = 0.999;

/// What [`rel_mse`] measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelMse {
    /// Mean over pixels and components.
    pub mean: f64,
    /// The same without the worst 0.1 % of pixels.
    pub trimmed: f64,
    /// Pixels whose luminance is off by more than 10 times the 99.9th percentile of the reference's luminance.
    pub fireflies: usize,
}

/// Relative mean squared error: the mean over pixels and components of (D - R)^2 / (R^2 + eps), with eps = 0.01 times
/// the squared mean luminance of R. The trimmed mean drops the worst 0.1 % of pixels (rounded up), by the mean of
/// their three components. A pixel that is not finite makes the plain mean infinite and is the first to be trimmed.
///
/// # Errors
/// [`Error::Size`], [`Error::Empty`].
pub fn rel_mse(picture: &Plane<Rgb>, reference: &Plane<Rgb>) -> Result<RelMse, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    let pixels = reference.data().len();
    let mut reference_luminance: Vec<f64> = reference.data().iter().map(|&c| f64::from(luminance(c))).collect();
    let mean_luminance = reference_luminance.iter().sum::<f64>() / pixels as f64;
    // A black reference has no scale of its own; any positive number keeps 0 / 0 away.
    let epsilon = (EPSILON_PART * mean_luminance * mean_luminance).max(f64::MIN_POSITIVE);
    let mut errors: Vec<f64> = picture
        .data()
        .iter()
        .zip(reference.data())
        .map(|(d, r)| {
            let mut sum = 0.0;
            for c in 0..3 {
                let (d, r) = (f64::from(d[c]), f64::from(r[c]));
                sum += (d - r) * (d - r) / (r * r + epsilon);
            }
            if sum.is_nan() { f64::INFINITY } else { sum / 3.0 }
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let kept = pixels - ((pixels as f64 * TRIMMED_PART).ceil() as usize).min(pixels - 1);
    let trimmed = errors[..kept].iter().sum::<f64>() / kept as f64;
    let mean = errors.iter().sum::<f64>() / pixels as f64;

    let differences =
        picture.data().iter().zip(&reference_luminance).map(|(&d, r)| (f64::from(luminance(d)) - r).abs());
    let differences: Vec<f64> = differences.collect();
    reference_luminance.sort_by(f64::total_cmp);
    let percentile = reference_luminance[((pixels - 1) as f64 * FIREFLY_PERCENTILE) as usize];
    let limit = FIREFLY_FACTOR * percentile;
    let fireflies = differences.into_iter().filter(|d| d.is_nan() || *d > limit).count();
    Ok(RelMse { mean, trimmed, fireflies })
}

/// The root of every pixel's part in [`rel_mse`], cut at 1: 0 where the picture is right, 1 where it is off by its own
/// brightness. For error maps.
///
/// # Errors
/// [`Error::Size`], [`Error::Empty`].
pub fn rel_error_map(picture: &Plane<Rgb>, reference: &Plane<Rgb>) -> Result<Plane<f32>, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    let pixels = reference.data().len() as f64;
    let mean = reference.data().iter().map(|&c| f64::from(luminance(c))).sum::<f64>() / pixels;
    let epsilon = (EPSILON_PART * mean * mean).max(f64::MIN_POSITIVE);
    Ok(Plane::from_fn(reference.size(), |x, y| {
        let (d, r) = (picture.at(x, y), reference.at(x, y));
        let sum: f64 = (0..3)
            .map(|c| {
                let (d, r) = (f64::from(d[c]), f64::from(r[c]));
                (d - r) * (d - r) / (r * r + epsilon)
            })
            .sum();
        // f64::min takes the 1 where the sum is NaN.
        (sum / 3.0).sqrt().min(1.0) as f32
    }))
}

/// Peak signal-to-noise ratio after the report's tone curve, in dB: -10 log10 of the mean squared difference of the
/// sRGB values in 0..1 (not rounded to 8 bits). Infinite where the pictures are equal.
///
/// # Errors
/// [`Error::Size`], [`Error::Empty`].
pub fn psnr(picture: &Plane<Rgb>, reference: &Plane<Rgb>, tone: Tone) -> Result<f64, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    let mut sum = 0.0;
    for (&d, &r) in picture.data().iter().zip(reference.data()) {
        let (d, r) = (tone.srgb(d), tone.srgb(r));
        for c in 0..3 {
            let difference = f64::from(d[c]) - f64::from(r[c]);
            sum += difference * difference;
        }
    }
    Ok(-10.0 * (sum / (3 * reference.data().len()) as f64).log10())
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Size;

    #[test]
    fn a_constant_relative_error_has_its_closed_form() {
        let size = Size::new(32, 17);
        let reference = Plane::filled(size, [2.0; 3]);
        let picture = Plane::filled(size, [2.2; 3]);
        let found = rel_mse(&picture, &reference).unwrap();
        let expected = 0.2 * 0.2 / (4.0 + 0.01 * 4.0);
        assert!((found.mean / expected - 1.0).abs() < 1e-5 && (found.trimmed / expected - 1.0).abs() < 1e-5);
        assert_eq!(found.fireflies, 0);
    }

    #[test]
    fn a_firefly_is_trimmed_and_counted() {
        let size = Size::new(40, 40);
        let reference = Plane::filled(size, [1.0; 3]);
        let mut picture = reference.clone();
        picture.set(3, 7, [100.0; 3]);
        picture.set(9, 9, [f32::NAN; 3]);
        let found = rel_mse(&picture, &reference).unwrap();
        assert_eq!((found.trimmed, found.fireflies), (0.0, 2));
        assert!(found.mean.is_infinite());
        // Three bad pixels of 1600 are more than 0.1 % (two): the trimmed mean sees the least of them.
        picture.set(20, 20, [2.0; 3]);
        assert!(rel_mse(&picture, &reference).unwrap().trimmed > 0.0);
    }

    #[test]
    fn the_map_adds_up_to_the_mean() {
        let size = Size::new(13, 11);
        let reference = Plane::from_fn(size, |x, y| [x as f32 + 1.0, y as f32 + 2.0, 3.0]);
        let mut picture = Plane::from_fn(size, |x, y| reference.at(x, y).map(|v| v * 1.1 + 0.01 * x as f32));
        let map = rel_error_map(&picture, &reference).unwrap();
        let mean = map.data().iter().map(|&v| f64::from(v * v)).sum::<f64>() / size.pixels() as f64;
        assert!((mean / rel_mse(&picture, &reference).unwrap().mean - 1.0).abs() < 1e-5);
        picture.set(0, 0, [f32::NAN; 3]);
        assert_eq!(rel_error_map(&picture, &reference).unwrap().at(0, 0), 1.0);
    }

    #[test]
    fn scale_does_not_matter_to_rel_mse() {
        let size = Size::new(13, 11);
        let reference = Plane::from_fn(size, |x, y| [x as f32 + 1.0, y as f32, 0.5]);
        let picture = Plane::from_fn(size, |x, y| [x as f32 + 1.3, y as f32 * 1.1, 0.4]);
        let scaled = |p: &Plane<Rgb>| Plane::from_fn(size, |x, y| p.at(x, y).map(|v| v * 100.0));
        let a = rel_mse(&picture, &reference).unwrap().mean;
        let b = rel_mse(&scaled(&picture), &scaled(&reference)).unwrap().mean;
        assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
    }

    #[test]
    fn psnr_of_a_known_difference() {
        let size = Size::new(8, 8);
        let tone = Tone::default();
        let reference = Plane::filled(size, [0.25; 3]);
        let picture = Plane::filled(size, [0.125; 3]);
        // Below the shoulder: sRGB(0.25) = 0.537099, sRGB(0.125) = 0.388573.
        let expected = -20.0 * (0.537_099_f64 - 0.388_573).log10();
        assert!((psnr(&picture, &reference, tone).unwrap() - expected).abs() < 1e-4);
        assert!(psnr(&reference, &reference, tone).unwrap().is_infinite());
        assert!(psnr(&reference, &Plane::filled(Size::new(8, 9), [0.5; 3]), tone).is_err());
    }
}
