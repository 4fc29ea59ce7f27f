//! SSIM: Wang, Bovik, Sheikh, Simoncelli: "Image Quality Assessment: From Error Visibility to Structural Similarity",
//! IEEE Transactions on Image Processing 13(4), 2004.
//!
//! ```text
//! SSIM(x, y) = (2 mx my + C1) (2 sxy + C2) / ((mx^2 + my^2 + C1) (sx^2 + sy^2 + C2))
//! ```
//!
//! with means, variances and covariance under a Gaussian of 1.5 pixels cut to 11x11, C1 = 0.01^2, C2 = 0.03^2 for values
//! 0..1. The values are the luma 0.2126 R + 0.7152 G + 0.0722 B of the picture after the report's tone curve, sRGB-encoded
//! as it is shown. The mean is over the pixels whose whole window lies in the picture, as the authors have it; over all
//! (the border's pixels repeated) where the picture is smaller than a window.

use super::flip::convolved;
use crate::error::Error;
use crate::tone::{Tone, luminance};
use quell::{Plane, Rgb};

/// Sigma of the window, pixels.
const SIGMA: f32 = 1.5;
/// The window is 2 * 5 + 1 pixels wide.
const RADIUS: usize = 5;
/// (K1 L)^2 and (K2 L)^2 (section III.B).
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

/// The similarity of every pixel, and its mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Ssim {
    /// 1: equal; may be negative.
    pub map: Plane<f32>,
    /// Mean over the pixels with a whole window.
    pub mean: f64,
}

/// SSIM of two scene-linear pictures as they are shown.
///
/// # Errors
/// [`Error::Size`], [`Error::Empty`].
pub fn ssim(picture: &Plane<Rgb>, reference: &Plane<Rgb>, tone: Tone) -> Result<Ssim, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    let size = reference.size();
    let luma = |p: &Plane<Rgb>| Plane::from_fn(size, |x, y| luminance(tone.srgb(p.at(x, y))));
    let (x, y) = (luma(picture), luma(reference));
    let mut row: Vec<f32> = (0..=2 * RADIUS)
        .map(|i| {
            let d = i as f32 - RADIUS as f32;
            (-d * d / (2.0 * SIGMA * SIGMA)).exp()
        })
        .collect();
    let sum: f32 = row.iter().sum();
    row.iter_mut().for_each(|v| *v /= sum);
    let product = |a: &Plane<f32>, b: &Plane<f32>| Plane::from_fn(size, |px, py| a.at(px, py) * b.at(px, py));
    let mean = |p: &Plane<f32>| convolved(p, &row, &row);
    let (mx, my) = (mean(&x), mean(&y));
    let (xx, yy, xy) = (mean(&product(&x, &x)), mean(&product(&y, &y)), mean(&product(&x, &y)));
    let map = Plane::from_fn(size, |px, py| {
        let (mx, my) = (mx.at(px, py), my.at(px, py));
        let (vx, vy, cov) = (xx.at(px, py) - mx * mx, yy.at(px, py) - my * my, xy.at(px, py) - mx * my);
        (2.0 * mx * my + C1) * (2.0 * cov + C2) / ((mx * mx + my * my + C1) * (vx + vy + C2))
    });
    let margin = if size.width > 2 * RADIUS && size.height > 2 * RADIUS { RADIUS } else { 0 };
    let (mut sum, mut count) = (0.0, 0u64);
    for py in margin..size.height - margin {
        for &v in &map.row(py)[margin..size.width - margin] {
            sum += f64::from(v);
            count += 1;
        }
    }
    Ok(Ssim { map, mean: sum / count.max(1) as f64 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Size;

    #[test]
    fn equal_pictures_are_1_and_a_shift_of_brightness_has_its_closed_form() {
        let size = Size::new(31, 17);
        let tone = Tone::default();
        let flat = |v: f32| Plane::filled(size, [v; 3]);
        assert!((ssim(&flat(0.2), &flat(0.2), tone).unwrap().mean - 1.0).abs() < 1e-6);
        let found = ssim(&flat(0.1), &flat(0.2), tone).unwrap().mean;
        let (a, b) = (tone.srgb([0.1; 3])[0], tone.srgb([0.2; 3])[0]);
        let expected = f64::from((2.0 * a * b + C1) / (a * a + b * b + C1));
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        // Smaller than a window, not finite, one pixel: a number nevertheless.
        let odd = Plane::from_vec(Size::new(1, 3), vec![[f32::NAN; 3], [f32::INFINITY; 3], [-1.0; 3]]).unwrap();
        assert!(ssim(&odd, &odd, tone).unwrap().mean > 0.99);
        assert!(ssim(&odd, &flat(0.1), tone).is_err());
    }
}
