//! FLIP and HDR-FLIP: the difference that a viewer sees when flipping between two pictures.
//!
//! FLIP: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: "FLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020. HDR-FLIP: Andersson, Nilsson, Shirley, Akenine-Möller: "Visualizing Errors in
//! Rendered High Dynamic Range Images", Eurographics Short Papers 2021.
//!
//! Per pixel, 0 to 1:
//!
//! ```text
//! colour   filter YCxCz with the eye's contrast sensitivity, clamp to the display's gamut,
//!          Hunt-adjusted L*a*b*, HyAB distance to the power 0.7, stretched to 0..1           = dC
//! feature  difference of the strength of edges and of points of (Y + 16) / 116,
//!          (the larger of the two / sqrt 2) to the power 0.5                                 = dF
//! FLIP     dC^(1 - dF)
//! HDR      the largest FLIP over a series of exposures, each through the ACES curve
//! ```
//!
//! Colour and feature filters are sums of products of one-dimensional kernels, which is what makes this affordable;
//! the result is that of the full two-dimensional kernels of the papers.

use crate::error::Error;
use crate::tone::{LIT_PART_OF_MEAN, luminance};
use quell::{Plane, Rgb, Size};
use rayon::prelude::*;

/// Pixels a degree of visual angle, 67.02: 0.7 m from a screen that is 0.7 m and 3840 pixels wide (2020, section 5).
pub const PIXELS_PER_DEGREE: f32 = 3840.0 * std::f32::consts::PI / 180.0;

/// Contrast sensitivity (2020, table 1): a sum of two Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees.
struct Sensitivity {
    a: [f64; 2],
    b: [f64; 2],
}
/// Of Y, Cx, Cz.
const SENSITIVITY: [Sensitivity; 3] = [
    Sensitivity { a: [1.0, 0.0], b: [0.0047, 1e-5] },
    Sensitivity { a: [1.0, 0.0], b: [0.0053, 1e-5] },
    Sensitivity { a: [34.1, 13.5], b: [0.04, 0.025] },
];
/// The widest Gaussian above, which sets the radius of all.
const WIDEST_B: f64 = 0.04;
/// Exponent of the colour difference (2020, q_c).
const COLOUR_EXPONENT: f32 = 0.7;
/// Part of the largest colour difference (p_c) that is mapped to the part `SMALL_TO` (p_t) of the range.
const SMALL_PART: f32 = 0.4;
const SMALL_TO: f32 = 0.95;
/// Width of the feature detectors, degrees (2020, w).
const FEATURE_WIDTH_DEGREES: f64 = 0.082;
/// Exponent of the feature difference (q_f).
const FEATURE_EXPONENT: f32 = 0.5;
/// Kernels reach this many standard deviations.
const REACH: f64 = 3.0;

/// Display luminance at which exposures are chosen (2021, t).
const TARGET_LUMINANCE: f64 = 0.85;
/// The ACES curve (2021): (k0 x^2 + k1 x) / (k3 x^2 + k4 x + k5), with the pre-exposure 0.6.
const ACES: [f64; 6] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];
/// The brightest light for which exposures are chosen is this percentile of the surfaces': a single firefly left in a
/// reference must not add stops.
const BRIGHTEST_PERCENTILE: f64 = 0.999;
/// More stops than this show nothing that a viewer would meet.
const MOST_STOPS: f64 = 16.0;
/// Exposures are never more than these, whatever range is asked for.
const MOST_PICTURES: usize = 64;
/// Light is clamped to this before the curve, so that its square stays finite.
const LARGEST_LIGHT: f32 = 1e9;

/// The difference of every pixel, and its mean.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipMap {
    /// 0 (equal) to 1.
    pub map: Plane<f32>,
    /// Mean over the pixels.
    pub mean: f64,
}

impl FlipMap {
    fn new(map: Plane<f32>) -> Self {
        let mean = map.data().iter().map(|&v| f64::from(v)).sum::<f64>() / map.data().len() as f64;
        Self { map, mean }
    }
}

/// The series of exposures of HDR-FLIP, in stops: light is multiplied by 2^stop. Fixed once a sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// The darkest picture.
    pub start: f64,
    /// The brightest picture; at least `start`.
    pub stop: f64,
    /// Number of pictures, evenly spaced, at least 2.
    pub count: usize,
}

impl Exposures {
    /// From `start` to `stop` with the papers' number of exposures, max(2, ceil(stop - start)), at most 64.
    pub fn new(start: f64, stop: f64) -> Self {
        let stop = stop.max(start);
        Self { start, stop, count: ((stop - start).ceil() as usize).clamp(2, MOST_PICTURES) }
    }

    /// From the luminances that shall be shown at 0.85 in the darkest (`brightest`) and in the brightest picture
    /// (`median`): log2(x / luminance), ACES(x) = 0.85 (2021, section 3).
    pub fn from_luminances(brightest: f64, median: f64) -> Self {
        let [k0, k1, k2, k3, k4, k5] = ACES;
        let (a, b, c) = (k0 - TARGET_LUMINANCE * k3, k1 - TARGET_LUMINANCE * k4, k2 - TARGET_LUMINANCE * k5);
        let x = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
        Self::new((x / brightest).log2(), (x / median).log2())
    }

    /// Fixed from the references of a sequence, each with its view depth where there is one: the papers' rule on the
    /// lit surface pixels (finite depth, luminance above 1e-3 of their mean), with the 99.9th percentile for the
    /// brightest light and at most 16 stops. Automatic exposures of whole pictures vary from frame to frame and run
    /// over 27 stops where much is black.
    ///
    /// # Errors
    /// [`Error::Empty`] where no surface is lit, [`Error::Size`].
    pub fn from_reference<'a>(
        frames: impl IntoIterator<Item = (&'a Plane<Rgb>, Option<&'a Plane<f32>>)>,
    ) -> Result<Self, Error> {
        let mut luminances = Vec::new();
        for (reference, depth) in frames {
            if let Some(depth) = depth {
                Error::same_size("view depth", depth.size(), reference.size())?;
            }
            for (i, &c) in reference.data().iter().enumerate() {
                let l = f64::from(luminance(c));
                if l.is_finite() && depth.is_none_or(|d| d.data()[i].is_finite()) {
                    luminances.push(l);
                }
            }
        }
        let mean = luminances.iter().sum::<f64>() / luminances.len().max(1) as f64;
        luminances.retain(|&l| l > LIT_PART_OF_MEAN * mean && l > 0.0);
        if luminances.is_empty() {
            return Err(Error::Empty { what: "no surface of the reference is lit: no exposure fits".to_owned() });
        }
        luminances.sort_by(f64::total_cmp);
        let at = |part: f64| luminances[((luminances.len() - 1) as f64 * part) as usize];
        let found = Self::from_luminances(at(BRIGHTEST_PERCENTILE), at(0.5));
        Ok(Self::new(found.start.max(found.stop - MOST_STOPS), found.stop))
    }

    /// The stops.
    pub fn stops(&self) -> impl Iterator<Item = f64> + '_ {
        let step = (self.stop - self.start) / (self.count.max(2) - 1) as f64;
        (0..self.count).map(move |i| self.start + i as f64 * step)
    }
}

/// FLIP of two pictures of display-linear Rec. 709 colours (clamped to 0..1), at [`PIXELS_PER_DEGREE`].
///
/// # Errors
/// [`Error::Size`], [`Error::Empty`].
pub fn ldr_flip(picture: &Plane<Rgb>, reference: &Plane<Rgb>) -> Result<FlipMap, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    let clamp = |c: Rgb| c.map(|v| positive(v).min(1.0));
    Ok(FlipMap::new(Flip::new(PIXELS_PER_DEGREE).compare(picture, reference, clamp)))
}

/// HDR-FLIP of two scene-linear pictures, at [`PIXELS_PER_DEGREE`].
///
/// # Errors
/// [`Error::Size`], [`Error::Empty`].
pub fn hdr_flip(picture: &Plane<Rgb>, reference: &Plane<Rgb>, exposures: &Exposures) -> Result<FlipMap, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    let flip = Flip::new(PIXELS_PER_DEGREE);
    let stops: Vec<f64> = exposures.stops().collect();
    let largest = stops
        .into_par_iter()
        .map(|stop| {
            let scale = stop.exp2() as f32;
            flip.compare(picture, reference, |c| c.map(|v| aces(v * scale)))
        })
        .reduce_with(|mut a, b| {
            for (a, b) in a.data_mut().iter_mut().zip(b.data()) {
                *a = a.max(*b);
            }
            a
        });
    largest.map(FlipMap::new).ok_or_else(|| Error::Empty { what: "HDR-FLIP needs at least one exposure".to_owned() })
}

/// NaN and negative light count as black.
fn positive(v: f32) -> f32 {
    if v > 0.0 { v } else { 0.0 }
}

fn aces(v: f32) -> f32 {
    let v = positive(v).min(LARGEST_LIGHT);
    let [k0, k1, _, k3, k4, k5] = ACES.map(|k| k as f32);
    ((k0 * v + k1) * v / ((k3 * v + k4) * v + k5)).min(1.0)
}

/// One channel of a picture.
type Channel = Plane<f32>;

/// All kernels for one viewing distance.
struct Flip {
    /// Of Y, Cx, Cz: one or two kernels, each the product of one row with itself; summed.
    sensitivity: [Vec<Vec<f32>>; 3],
    /// Gaussian, first and second derivative, each normalised as the paper has it.
    feature: [Vec<f32>; 3],
    largest_colour_difference: f32,
}

impl Flip {
    fn new(pixels_per_degree: f32) -> Self {
        use std::f64::consts::PI;
        let ppd = f64::from(pixels_per_degree);
        let radius = (REACH * (WIDEST_B / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i32;
        let sensitivity = SENSITIVITY.map(|s| {
            let gaussians: Vec<(f64, Vec<f64>)> = (0..2)
                .filter(|&i| s.a[i] != 0.0)
                .map(|i| {
                    let row = kernel(radius, |x| (-PI * PI * (x / ppd).powi(2) / s.b[i]).exp());
                    (s.a[i] * (PI / s.b[i]).sqrt(), row)
                })
                .collect();
            let total: f64 = gaussians.iter().map(|(a, row)| a * row.iter().sum::<f64>().powi(2)).sum();
            // The amplitude goes to both one-dimensional factors alike.
            let scaled = |(a, row): (f64, Vec<f64>)| {
                row.into_iter().map(|v| (v * (a / total).sqrt()) as f32).collect::<Vec<f32>>()
            };
            gaussians.into_iter().map(scaled).collect()
        });
        let sd = 0.5 * FEATURE_WIDTH_DEGREES * ppd;
        let radius = (REACH * sd).ceil() as i32;
        let gaussian = |x: f64| (-x * x / (2.0 * sd * sd)).exp();
        let feature = [
            kernel(radius, gaussian),
            kernel(radius, |x| -x * gaussian(x)),
            kernel(radius, |x| (x * x / (sd * sd) - 1.0) * gaussian(x)),
        ]
        .map(|row| {
            // Positive and negative weights each sum to 1.
            let positive: f64 = row.iter().filter(|v| **v > 0.0).sum();
            let negative: f64 = -row.iter().filter(|v| **v < 0.0).sum::<f64>();
            row.into_iter().map(|v| (v / if v > 0.0 { positive } else { negative }) as f32).collect()
        });
        let largest_colour_difference =
            hyab(hunt(lab([0.0, 1.0, 0.0])), hunt(lab([0.0, 0.0, 1.0]))).powf(COLOUR_EXPONENT);
        Self { sensitivity, feature, largest_colour_difference }
    }

    fn compare(&self, picture: &Plane<Rgb>, reference: &Plane<Rgb>, display: impl Fn(Rgb) -> Rgb + Sync) -> Channel {
        let (a, b) = rayon::join(|| self.seen(picture, &display), || self.seen(reference, &display));
        Plane::from_fn(reference.size(), |x, y| {
            let colour = self.stretched(hyab(a.colour.at(x, y), b.colour.at(x, y)).powf(COLOUR_EXPONENT));
            let edges = (a.edges.at(x, y) - b.edges.at(x, y)).abs();
            let points = (a.points.at(x, y) - b.points.at(x, y)).abs();
            let feature = (edges.max(points) * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
            colour.powf(1.0 - feature).clamp(0.0, 1.0)
        })
    }

    /// Small differences get most of the range (2020, equation 12).
    fn stretched(&self, difference: f32) -> f32 {
        let knee = SMALL_PART * self.largest_colour_difference;
        if difference < knee {
            difference * SMALL_TO / knee
        } else {
            SMALL_TO + (difference - knee) / (self.largest_colour_difference - knee) * (1.0 - SMALL_TO)
        }
    }

    fn seen(&self, picture: &Plane<Rgb>, display: impl Fn(Rgb) -> Rgb) -> Seen {
        let size = picture.size();
        let opponent = Plane::from_fn(size, |x, y| ycxcz(display(picture.at(x, y))));
        let channel = |i: usize| Plane::from_fn(size, |x, y| opponent.at(x, y)[i]);
        let filtered: [Channel; 3] = std::array::from_fn(|i| {
            let source = channel(i);
            let mut sum = Plane::filled(size, 0.0);
            for row in &self.sensitivity[i] {
                let once = convolved(&source, row, row);
                for (s, v) in sum.data_mut().iter_mut().zip(once.data()) {
                    *s += v;
                }
            }
            sum
        });
        let colour = Plane::from_fn(size, |x, y| {
            let rgb = linear_from_ycxcz([filtered[0].at(x, y), filtered[1].at(x, y), filtered[2].at(x, y)]);
            hunt(lab(rgb.map(|v| v.clamp(0.0, 1.0))))
        });
        let grey = Plane::from_fn(size, |x, y| (opponent.at(x, y)[0] + 16.0) / 116.0);
        let [gaussian, first, second] = &self.feature;
        let magnitude = |derivative: &[f32]| {
            let across = convolved(&grey, derivative, gaussian);
            let along = convolved(&grey, gaussian, derivative);
            Plane::from_fn(size, |x, y| across.at(x, y).hypot(along.at(x, y)))
        };
        Seen { colour, edges: magnitude(first), points: magnitude(second) }
    }
}

/// A picture as the eye has it.
struct Seen {
    colour: Plane<[f32; 3]>,
    edges: Channel,
    points: Channel,
}

fn kernel(radius: i32, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|x| f(f64::from(x))).collect()
}

/// The rows with `horizontal`, then the columns with `vertical`; beyond the edge the last pixel repeats. Both kernels
/// are mirrored as in a correlation: element k weighs the pixel k - radius to the right of, or below, the centre.
pub(crate) fn convolved(source: &Channel, horizontal: &[f32], vertical: &[f32]) -> Channel {
    let Size { width, height } = source.size();
    let radius = horizontal.len() / 2;
    let mut rows = Plane::filled(source.size(), 0.0);
    let mut padded = vec![0.0; width + 2 * radius];
    for y in 0..height {
        let row = source.row(y);
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        let out = rows.row_mut(y);
        for (k, &weight) in horizontal.iter().enumerate() {
            for (o, i) in out.iter_mut().zip(&padded[k..k + width]) {
                *o += weight * i;
            }
        }
    }
    let radius = vertical.len() / 2;
    let mut result = Plane::filled(source.size(), 0.0);
    for y in 0..height {
        let out = result.row_mut(y);
        for (k, &weight) in vertical.iter().enumerate() {
            let from = (y + k).saturating_sub(radius).min(height - 1);
            for (o, i) in out.iter_mut().zip(rows.row(from)) {
                *o += weight * i;
            }
        }
    }
    result
}

/// XYZ of linear Rec. 709 colours, as FLIP has it: the white point is the sum of the rows.
const XYZ_FROM_LINEAR: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

const fn row_sum(row: [f64; 3]) -> f64 {
    row[0] + row[1] + row[2]
}
const WHITE: [f64; 3] = [row_sum(XYZ_FROM_LINEAR[0]), row_sum(XYZ_FROM_LINEAR[1]), row_sum(XYZ_FROM_LINEAR[2])];

/// The inverse of a 3x3 matrix, by cofactors.
const fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut cofactors = [[0.0; 3]; 3];
    let mut i = 0;
    while i < 3 {
        let mut j = 0;
        while j < 3 {
            let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
            cofactors[i][j] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
            j += 1;
        }
        i += 1;
    }
    let determinant = m[0][0] * cofactors[0][0] + m[0][1] * cofactors[0][1] + m[0][2] * cofactors[0][2];
    let mut inverse = [[0.0; 3]; 3];
    let mut i = 0;
    while i < 3 {
        let mut j = 0;
        while j < 3 {
            inverse[j][i] = cofactors[i][j] / determinant;
            j += 1;
        }
        i += 1;
    }
    inverse
}
const LINEAR_FROM_XYZ: [[f64; 3]; 3] = inverse(XYZ_FROM_LINEAR);

fn times(m: &[[f64; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] as f32 * v[0] + row[1] as f32 * v[1] + row[2] as f32 * v[2])
}

/// XYZ in units of the white point.
fn relative_xyz(linear: Rgb) -> [f32; 3] {
    let xyz = times(&XYZ_FROM_LINEAR, linear);
    std::array::from_fn(|i| xyz[i] / WHITE[i] as f32)
}

/// The linear opponent space of the contrast sensitivity.
fn ycxcz(linear: Rgb) -> [f32; 3] {
    let [x, y, z] = relative_xyz(linear);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_from_ycxcz(c: [f32; 3]) -> Rgb {
    let y = (c[0] + 16.0) / 116.0;
    let relative = [y + c[1] / 500.0, y, y - c[2] / 200.0];
    times(&LINEAR_FROM_XYZ, std::array::from_fn(|i| relative[i] * WHITE[i] as f32))
}

/// CIE L*a*b* of a linear Rec. 709 colour.
fn lab(linear: Rgb) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let [x, y, z] = relative_xyz(linear)
        .map(|t| if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Hunt effect: chroma grows with lightness (2020, equation 8).
fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// City-block distance in lightness plus Euclidean in chroma.
fn hyab(p: [f32; 3], q: [f32; 3]) -> f32 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_is_zero_and_black_on_white_is_nearly_one() {
        let size = Size::new(40, 30);
        let black = Plane::filled(size, [0.0; 3]);
        let white = Plane::filled(size, [1.0; 3]);
        assert_eq!(ldr_flip(&white, &white).unwrap().mean, 0.0);
        assert!(ldr_flip(&white, &black).unwrap().mean > 0.9);
        // Green and blue are, by definition, the largest difference.
        let green = Plane::filled(size, [0.0, 1.0, 0.0]);
        let blue = Plane::filled(size, [0.0, 0.0, 1.0]);
        assert!((ldr_flip(&green, &blue).unwrap().mean - 1.0).abs() < 1e-4);
    }

    #[test]
    fn exposures_come_from_lit_surfaces() {
        let size = Size::new(100, 10);
        // Half is black, a tenth is sky of brightness 1000, the rest are surfaces of luminance 1 and 2.
        let plane = Plane::from_fn(size, |x, _| match x {
            0..50 => [0.0; 3],
            50..60 => [1000.0; 3],
            60..90 => [1.0; 3],
            _ => [2.0; 3],
        });
        let depth = Plane::from_fn(size, |x, _| if (50..60).contains(&x) { f32::INFINITY } else { 1.0 });
        let found = Exposures::from_reference([(&plane, Some(&depth))]).unwrap();
        assert!((found.stop - found.start - 1.0).abs() < 1e-5, "{found:?}");
        assert_eq!(found.count, 2);
        // At the brightest exposure the median is shown at 0.85.
        assert!((aces(found.stop.exp2() as f32) - 0.85).abs() < 1e-4);
        let black = Plane::filled(size, [0.0; 3]);
        assert!(Exposures::from_reference([(&black, None)]).is_err());
    }

    #[test]
    fn anything_can_be_compared() {
        let size = Size::new(1, 3);
        let odd = Plane::from_vec(size, vec![[f32::NAN, -1.0, 0.0], [f32::INFINITY; 3], [1e38; 3]]).unwrap();
        let found = hdr_flip(&odd, &Plane::filled(size, [1.0; 3]), &Exposures::new(-2.0, 2.0)).unwrap();
        assert!(found.map.data().iter().all(|v| (0.0..=1.0).contains(v)), "{found:?}");
        assert!(hdr_flip(&odd, &odd, &Exposures::new(0.0, 0.0)).unwrap().mean < 1e-6);
    }
}
