//! Light from infinitely far away: constant, a latitude-longitude map, or a simple sky; looked up and importance
//! sampled.
//!
//! World space has y up. Row 0 of a map is the zenith; the centre of the picture is the direction -z, and columns run
//! clockwise seen from above (+x is a quarter of the width to the right).

pub mod file;

use crate::material::channel_mean;
use crate::warp;
use glam::{Vec2, Vec3};
use quell::{Plane, Rgb, Size};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// What is wrong with an environment map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// An extent is 0.
    #[error("the environment map is {size}; both extents must be at least 1")]
    Empty {
        /// Extent of the map.
        size: Size,
    },
    /// A radiance is negative, infinite or not a number.
    #[error("the environment map holds radiance {value:?} at column {x}, row {y}; it must be finite and at least 0")]
    Radiance {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The value found.
        value: Rgb,
    },
    /// Strength is negative, infinite or not a number.
    #[error("the environment's strength is {strength}; it must be finite and at least 0")]
    Strength {
        /// The value given.
        strength: f32,
    },
}

/// A direction towards the environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentSample {
    /// Direction, unit, world space.
    pub wi: Vec3,
    /// Radiance from there.
    pub radiance: Vec3,
    /// Density per steradian.
    pub pdf: f32,
}

/// Parameters of [`Environment::sky`]: a gradient and a sun's disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Radiance straight up.
    pub zenith: Vec3,
    /// Radiance at the horizon.
    pub horizon: Vec3,
    /// Radiance from below the horizon.
    pub ground: Vec3,
    /// Direction towards the sun.
    pub sun_direction: Vec3,
    /// Radiance of the disc; 0: no sun.
    pub sun_radiance: Vec3,
    /// Half of the disc's apparent width in radians; the real sun's is 0.00465.
    pub sun_angular_radius: f32,
}

/// Light from infinitely far away.
#[derive(Clone, Debug)]
pub struct Environment {
    pub(crate) background: Background,
    pub(crate) sun: Option<Sun>,
    /// Probability of sampling the sun rather than the background.
    pub(crate) sun_probability: f32,
    /// Mean radiance over the sphere, of background and sun.
    pub(crate) mean_radiance: Vec3,
}

#[derive(Clone, Debug)]
pub(crate) enum Background {
    Constant(Vec3),
    Map(Arc<Map>),
}

/// A disc of constant radiance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sun {
    pub(crate) direction: Vec3,
    pub(crate) radiance: Vec3,
    /// 1 - cos of the angular radius: the cosine itself would keep four digits of a real sun's size.
    pub(crate) one_minus_cos: f32,
}

/// A latitude-longitude map with its sampling distribution.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    /// Radiance, strength included.
    pub(crate) texels: Plane<Rgb>,
    /// Turn about the y axis in radians: positive moves the picture to larger columns.
    pub(crate) rotation: f32,
    /// Cumulated probability of the texels' rows: height + 1 values from 0 to 1.
    pub(crate) row_cdf: Vec<f32>,
    /// Cumulated probability of texels within each row: width + 1 values a row.
    pub(crate) column_cdf: Vec<f32>,
}

/// Rows of the map that [`Environment::sky`] makes; the gradient is smooth.
const SKY_ROWS: usize = 64;
const SKY_COLUMNS: usize = 8;

impl Environment {
    /// The same radiance from everywhere.
    pub fn constant(radiance: Vec3) -> Self {
        let radiance = non_negative(radiance);
        Self { background: Background::Constant(radiance), sun: None, sun_probability: 0.0, mean_radiance: radiance }
    }

    /// A latitude-longitude map. `rotation_rad` turns it about the y axis, `strength` multiplies its radiance.
    ///
    /// # Errors
    /// [`EnvironmentError`] where the map is empty, or a radiance or the strength is not finite or negative.
    pub fn map(texels: Plane<Rgb>, rotation_rad: f32, strength: f32) -> Result<Self, EnvironmentError> {
        let size = texels.size();
        if size.pixels() == 0 {
            return Err(EnvironmentError::Empty { size });
        }
        if !(strength.is_finite() && strength >= 0.0) {
            return Err(EnvironmentError::Strength { strength });
        }
        let mut scaled = texels;
        for y in 0..size.height {
            for (x, texel) in scaled.row_mut(y).iter_mut().enumerate() {
                let value = *texel;
                *texel = value.map(|v| v * strength);
                if texel.iter().any(|v| !(v.is_finite() && *v >= 0.0)) {
                    return Err(EnvironmentError::Radiance { x, y, value });
                }
            }
        }
        let rotation = if rotation_rad.is_finite() { rotation_rad } else { 0.0 };
        let (map, mean_radiance) = Map::new(scaled, rotation);
        Ok(Self { background: Background::Map(Arc::new(map)), sun: None, sun_probability: 0.0, mean_radiance })
    }

    /// A clear sky: a gradient from horizon to zenith, an even ground, and a sun.
    pub fn sky(sky: &Sky) -> Self {
        let (zenith, horizon, ground) = (non_negative(sky.zenith), non_negative(sky.horizon), non_negative(sky.ground));
        let texels = Plane::from_fn(Size::new(SKY_COLUMNS, SKY_ROWS), |_, y| {
            let elevation = (0.5 - (y as f32 + 0.5) / SKY_ROWS as f32) * std::f32::consts::PI;
            let radiance = if elevation > 0.0 {
                // Real skies brighten near the horizon only: the square root spends the gradient there.
                horizon.lerp(zenith, elevation.sin().sqrt())
            } else {
                ground
            };
            radiance.to_array()
        });
        let (map, map_mean) = Map::new(texels, 0.0);
        let sun = Sun::new(sky);
        let sun_mean = sun.map_or(Vec3::ZERO, |sun| sun.radiance * (sun.one_minus_cos * 0.5));
        let mean_radiance = map_mean + sun_mean;
        let sun_share = channel_mean(sun_mean) / channel_mean(mean_radiance).max(f32::MIN_POSITIVE);
        Self {
            background: Background::Map(Arc::new(map)),
            sun,
            // Both parts keep a share, whatever their power: the weaker one may be what a surface sees.
            sun_probability: if sun.is_some() { sun_share.clamp(0.1, 0.9) } else { 0.0 },
            mean_radiance,
        }
    }

    /// Radiance from direction `w` (unit, pointing away from the scene).
    pub fn radiance(&self, w: Vec3) -> Vec3 {
        let background = match &self.background {
            Background::Constant(radiance) => *radiance,
            Background::Map(map) => map.radiance(w),
        };
        match &self.sun {
            Some(sun) if sun.contains(w) => background + sun.radiance,
            _ => background,
        }
    }

    /// Mean radiance over all directions; pi times it is a typical irradiance, by which sources are chosen.
    pub fn mean_radiance(&self) -> Vec3 {
        self.mean_radiance
    }

    /// A direction drawn about in proportion to radiance. For a constant environment it is drawn by the cosine about
    /// `normal`, unless that is 0. `None` where nothing shines.
    pub fn sample(&self, normal: Vec3, u: Vec2) -> Option<EnvironmentSample> {
        if channel_mean(self.mean_radiance) <= 0.0 {
            return None;
        }
        let mut u = u;
        let wi = match &self.sun {
            Some(sun) if u.x < self.sun_probability => {
                u.x /= self.sun_probability;
                sun.sample(u)
            }
            _ => {
                u.x = ((u.x - self.sun_probability) / (1.0 - self.sun_probability)).min(warp::ONE_MINUS_EPSILON);
                match &self.background {
                    Background::Constant(_) if normal != Vec3::ZERO => about(normal, warp::cosine_hemisphere(u)),
                    Background::Constant(_) => warp::uniform_sphere(u),
                    Background::Map(map) => map.sample(u),
                }
            }
        };
        let pdf = self.pdf(normal, wi);
        (pdf > 0.0).then(|| EnvironmentSample { wi, radiance: self.radiance(wi), pdf })
    }

    /// Density per steradian of [`Self::sample`] with the same `normal`.
    pub fn pdf(&self, normal: Vec3, wi: Vec3) -> f32 {
        if channel_mean(self.mean_radiance) <= 0.0 {
            return 0.0;
        }
        let background = match &self.background {
            Background::Constant(_) if normal != Vec3::ZERO => warp::cosine_hemisphere_pdf(normal.dot(wi)),
            Background::Constant(_) => 0.25 * std::f32::consts::FRAC_1_PI,
            Background::Map(map) => map.pdf(wi),
        };
        match &self.sun {
            Some(sun) => {
                let in_sun = if sun.contains(wi) { sun.pdf() } else { 0.0 };
                self.sun_probability * in_sun + (1.0 - self.sun_probability) * background
            }
            None => background,
        }
    }
}

impl Sun {
    fn new(sky: &Sky) -> Option<Self> {
        let direction = sky.sun_direction.try_normalize()?;
        let radiance = non_negative(sky.sun_radiance);
        let half = 0.5 * sky.sun_angular_radius.clamp(0.0, std::f32::consts::PI);
        let one_minus_cos = 2.0 * half.sin() * half.sin();
        (channel_mean(radiance) > 0.0 && one_minus_cos > 0.0).then_some(Self { direction, radiance, one_minus_cos })
    }

    fn contains(&self, w: Vec3) -> bool {
        0.5 * (w - self.direction).length_squared() <= self.one_minus_cos
    }

    fn pdf(&self) -> f32 {
        1.0 / (std::f32::consts::TAU * self.one_minus_cos)
    }

    fn sample(&self, u: Vec2) -> Vec3 {
        // Slightly inside, so that rounding never puts a sample outside of the disc.
        let one_minus_cos = u.x * self.one_minus_cos * 0.999_99;
        let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
        let phi = std::f32::consts::TAU * u.y;
        about(self.direction, Vec3::new(sin * phi.cos(), sin * phi.sin(), 1.0 - one_minus_cos))
    }
}

impl Map {
    /// The map and its mean radiance over the sphere.
    fn new(texels: Plane<Rgb>, rotation: f32) -> (Self, Vec3) {
        let Size { width, height } = texels.size();
        let mut row_weights = vec![0.0f64; height];
        let mut column_cdf = Vec::with_capacity((width + 1) * height);
        let mut mean = [0.0f64; 3];
        let mut solid_angle = 0.0;
        for y in 0..height {
            let sin = (PI * (y as f64 + 0.5) / height as f64).sin();
            let mut weights = vec![0.0f64; width];
            for x in 0..width {
                let texel = texels.at(x, y).map(|v| f64::from(v) * sin);
                weights[x] = texel[0] + texel[1] + texel[2];
                row_weights[y] += weights[x];
                for (sum, v) in mean.iter_mut().zip(texel) {
                    *sum += v;
                }
                solid_angle += sin;
            }
            push_cdf(&mut column_cdf, &weights);
        }
        let mut row_cdf = Vec::with_capacity(height + 1);
        push_cdf(&mut row_cdf, &row_weights);
        let mean = Vec3::from_array(mean.map(|v| (v / solid_angle) as f32));
        (Self { texels, rotation, row_cdf, column_cdf }, mean)
    }

    /// Position in the picture, both in \[0, 1): (column share, row share).
    fn uv(&self, w: Vec3) -> (f32, f32) {
        let angle = w.x.atan2(-w.z) + self.rotation;
        let u = (0.5 + angle * (0.5 / std::f32::consts::PI)).rem_euclid(1.0);
        let polar = w.x.hypot(w.z).atan2(w.y);
        (u.min(warp::ONE_MINUS_EPSILON), (polar / std::f32::consts::PI).clamp(0.0, warp::ONE_MINUS_EPSILON))
    }

    /// The four texels about a direction, as (column, row), and their bilinear weights. Columns wrap, rows are clamped.
    fn footprint(&self, w: Vec3) -> [((usize, usize), f32); 4] {
        let Size { width, height } = self.texels.size();
        let (u, v) = self.uv(w);
        let (x, y) = (u * width as f32 - 0.5, v * height as f32 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let columns = [x0 as i64, x0 as i64 + 1].map(|c| c.rem_euclid(width as i64) as usize);
        let rows = [y0 as i64, y0 as i64 + 1].map(|r| r.clamp(0, height as i64 - 1) as usize);
        [
            ((columns[0], rows[0]), (1.0 - fx) * (1.0 - fy)),
            ((columns[1], rows[0]), fx * (1.0 - fy)),
            ((columns[0], rows[1]), (1.0 - fx) * fy),
            ((columns[1], rows[1]), fx * fy),
        ]
    }

    fn radiance(&self, w: Vec3) -> Vec3 {
        self.footprint(w).into_iter().map(|((x, y), weight)| Vec3::from_array(self.texels.at(x, y)) * weight).sum()
    }

    fn columns_of_row(&self, row: usize) -> &[f32] {
        let stride = self.texels.size().width + 1;
        &self.column_cdf[row * stride..][..stride]
    }

    /// Draws a texel by its power, then a place under its tent. The density in the picture is then the bilinear
    /// interpolation of the texels' probabilities: it has the very shape of the lookup.
    fn sample(&self, u: Vec2) -> Vec3 {
        let Size { width, height } = self.texels.size();
        let (row, s) = invert_cdf(&self.row_cdf, u.x);
        let (column, t) = invert_cdf(self.columns_of_row(row), u.y);
        let x = (column as f64 + 0.5 + tent(t)) / width as f64;
        // Reflection at the poles keeps the density of the clamped lookup.
        let y = ((row as f64 + 0.5 + tent(s)) / height as f64).abs();
        let y = if y > 1.0 { 2.0 - y } else { y };
        let (sin, cos) = (PI * y).sin_cos();
        let azimuth = (x - 0.5) * TAU - f64::from(self.rotation);
        Vec3::new((sin * azimuth.sin()) as f32, cos as f32, (-sin * azimuth.cos()) as f32).normalize()
    }

    fn pdf(&self, w: Vec3) -> f32 {
        let Size { width, height } = self.texels.size();
        let probability: f32 = self
            .footprint(w)
            .into_iter()
            .map(|((x, y), weight)| {
                let columns = self.columns_of_row(y);
                weight * (self.row_cdf[y + 1] - self.row_cdf[y]) * (columns[x + 1] - columns[x])
            })
            .sum();
        // The picture's unit square covers 2 pi^2 sin steradians per area.
        let sin = w.x.hypot(w.z).max(MIN_POLAR_SIN);
        probability * (width * height) as f32 / (2.0 * std::f32::consts::PI * std::f32::consts::PI * sin)
    }
}

/// Sine of the polar angle below which directions count as the pole: the density of the picture's first row is
/// infinite there.
pub(crate) const MIN_POLAR_SIN: f32 = 1e-6;

/// A number in (-1, 1) with density 1 - |x|.
fn tent(u: f32) -> f64 {
    let u = f64::from(u);
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).sqrt() }
}

/// Appends the cumulated shares of `weights`, from 0 to 1; even shares where all are 0.
fn push_cdf(cdf: &mut Vec<f32>, weights: &[f64]) {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    cdf.push(0.0);
    for (i, weight) in weights.iter().enumerate() {
        sum += weight;
        let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / weights.len() as f64 };
        cdf.push(if i + 1 == weights.len() { 1.0 } else { share as f32 });
    }
}

/// The interval that `u` falls in, and where within it, in \[0, 1). Never an interval of probability 0.
fn invert_cdf(cdf: &[f32], u: f32) -> (usize, f32) {
    let u = u.clamp(0.0, warp::ONE_MINUS_EPSILON);
    let i = cdf.partition_point(|&c| c <= u).clamp(1, cdf.len() - 1) - 1;
    let width = cdf[i + 1] - cdf[i];
    let within = if width > 0.0 { (u - cdf[i]) / width } else { 0.0 };
    (i, within.clamp(0.0, warp::ONE_MINUS_EPSILON))
}

/// A local direction turned so that its pole is `axis`.
fn about(axis: Vec3, local: Vec3) -> Vec3 {
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    (local.x * tangent + local.y * bitangent + local.z * axis).normalize()
}

fn non_negative(radiance: Vec3) -> Vec3 {
    Vec3::from_array(radiance.to_array().map(|v| if v > 0.0 && v.is_finite() { v } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Sampler;
    use crate::testing::{Noise, SphereDomain, assert_chi_squared};

    fn random_map(width: usize, height: usize, contrast: f32) -> Plane<Rgb> {
        let mut noise = Noise::new(31);
        Plane::from_fn(Size::new(width, height), |_, _| {
            [1.0, 0.7, 0.4].map(|tint| tint * contrast.powf(noise.next()) / contrast)
        })
    }

    /// One bright texel in the dark: bilinear lookup spreads it over its neighbours.
    fn one_bright_texel(width: usize, height: usize, x: usize, y: usize) -> Plane<Rgb> {
        let mut map = Plane::filled(Size::new(width, height), [0.0; 3]);
        map.set(x, y, [100.0; 3]);
        map
    }

    /// Integral over the sphere, by a midpoint rule in cos and azimuth.
    fn integral(n: usize, f: impl Fn(Vec3) -> Vec3) -> Vec3 {
        let mut sum = glam::DVec3::ZERO;
        for i in 0..n {
            let cos = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
            let sin = (1.0 - cos * cos).sqrt();
            for j in 0..2 * n {
                let phi = TAU * (j as f64 + 0.5) / (2 * n) as f64;
                let w = Vec3::new((sin * phi.sin()) as f32, cos as f32, (sin * phi.cos()) as f32);
                sum += f(w).as_dvec3();
            }
        }
        (sum * (2.0 * TAU / (2 * n * n) as f64)).as_vec3()
    }

    #[test]
    fn directions_find_their_place_in_the_picture() {
        // 8 x 4; texel centres are looked up exactly.
        let map = Plane::from_fn(Size::new(8, 4), |x, y| [x as f32, y as f32, 1.0]);
        let environment = Environment::map(map.clone(), 0.0, 1.0).unwrap();
        let at = |u: f32, v: f32| {
            let (azimuth, polar) = ((u - 0.5) * 2.0 * std::f32::consts::PI, v * std::f32::consts::PI);
            Vec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos())
        };
        for (x, y) in [(0, 0), (3, 1), (7, 3)] {
            let w = at((x as f32 + 0.5) / 8.0, (y as f32 + 0.5) / 4.0);
            assert!(environment.radiance(w).abs_diff_eq(Vec3::new(x as f32, y as f32, 1.0), 1e-4));
        }
        // -z lies between columns 3 and 4, rows 1 and 2; +x two columns to the right of it.
        assert!(environment.radiance(-Vec3::Z).abs_diff_eq(Vec3::new(3.5, 1.5, 1.0), 1e-4));
        assert!(environment.radiance(Vec3::X).abs_diff_eq(Vec3::new(5.5, 1.5, 1.0), 1e-4));
        // The seam is a mean of the last and the first column; the poles are clamped.
        assert!(environment.radiance(Vec3::Z).abs_diff_eq(Vec3::new(3.5, 1.5, 1.0), 1e-4));
        assert!((environment.radiance(Vec3::Y).y, environment.radiance(-Vec3::Y).y) == (0.0, 3.0));
        // A quarter turn moves the picture by two columns; strength scales.
        let turned = Environment::map(map, std::f32::consts::FRAC_PI_2, 2.0).unwrap();
        assert!(turned.radiance(-Vec3::Z).abs_diff_eq(2.0 * Vec3::new(5.5, 1.5, 1.0), 1e-4));
    }

    #[test]
    fn samples_follow_their_density() {
        let mut noise = Noise::new(32);
        for (size, rotation) in [((12, 6), 0.0), ((5, 9), 0.9), ((3, 4), -4.0)] {
            let environment = Environment::map(random_map(size.0, size.1, 8.0), rotation, 1.0).unwrap();
            assert_chi_squared(
                &format!("environment map of {size:?}"),
                &SphereDomain::around(noise.direction()),
                |w| environment.pdf(Vec3::ZERO, w),
                |u| environment.sample(Vec3::ZERO, Vec2::new(u.x, u.y)).map(|s| s.wi),
            );
        }
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let constant = Environment::constant(Vec3::ONE);
        for normal in [normal, Vec3::ZERO] {
            assert_chi_squared(
                "constant environment",
                &SphereDomain::around(Vec3::new(0.6, 0.0, 0.8)),
                |w| constant.pdf(normal, w),
                |u| constant.sample(normal, Vec2::new(u.x, u.y)).map(|s| s.wi),
            );
        }
    }

    #[test]
    fn sampling_is_unbiased_for_the_bilinear_lookup() {
        let sky = Sky {
            zenith: Vec3::new(0.2, 0.4, 1.0),
            horizon: Vec3::splat(0.8),
            ground: Vec3::splat(0.1),
            sun_direction: Vec3::new(1.0, 1.0, 0.3),
            sun_radiance: Vec3::splat(50.0),
            sun_angular_radius: 0.2,
        };
        let environments = [
            ("random", Environment::map(random_map(12, 6, 30.0), 1.0, 1.0).unwrap(), 3.0),
            ("single row", Environment::map(random_map(3, 1, 5.0), 0.0, 1.0).unwrap(), 4.0),
            ("one texel", Environment::map(one_bright_texel(16, 8, 5, 2), 0.0, 1.0).unwrap(), 3.0),
            ("texel at the seam", Environment::map(one_bright_texel(16, 8, 0, 4), 0.3, 1.0).unwrap(), 3.0),
            ("texel at the pole", Environment::map(one_bright_texel(16, 8, 3, 0), 0.0, 1.0).unwrap(), 4.0),
            ("sky", Environment::sky(&sky), 20.0),
        ];
        // Integrands that see where light comes from, not only how much.
        let tests: [fn(Vec3) -> f32; 3] = [|_| 1.0, |w| w.x.max(0.0), |w| w.y * w.y];
        for (name, environment, largest_weight) in &environments {
            for f in tests {
                let n = 1 << 15;
                let mut sum = glam::DVec3::ZERO;
                for i in 0..n {
                    let u = Sampler::new((2, 3), 0, i, 5).next_2d();
                    let s = environment.sample(Vec3::ZERO, u).unwrap();
                    assert_eq!(s.pdf, environment.pdf(Vec3::ZERO, s.wi));
                    let weight = s.radiance / s.pdf;
                    sum += (weight * f(s.wi)).as_dvec3();
                    // No sample is much brighter than the mean: fireflies would come from pdf and lookup differing.
                    let mean = environment.mean_radiance().max_element() * 4.0 * std::f32::consts::PI;
                    assert!(weight.max_element() <= largest_weight * mean, "{name}: {weight} against {mean}");
                }
                let ours = (sum / f64::from(n)).as_vec3();
                let expected = integral(400, |w| environment.radiance(w) * f(w));
                assert!(
                    (ours - expected).abs().max_element() < 0.01 * expected.max_element() + 1e-4,
                    "{name}: {ours} against {expected}"
                );
            }
            // An estimate over texel centres; at the poles and for a single row it is rough.
            let mean = integral(400, |w| environment.radiance(w)) / (4.0 * std::f32::consts::PI);
            assert!(
                matches!(*name, "texel at the pole" | "single row")
                    || (mean - environment.mean_radiance()).abs().max_element() < 0.05 * mean.max_element(),
                "{name}: {mean}"
            );
        }
    }

    #[test]
    fn whatever_shines_can_be_found() {
        let mut noise = Noise::new(33);
        for (x, y) in [(0, 0), (15, 3), (7, 7)] {
            let environment = Environment::map(one_bright_texel(16, 8, x, y), 0.7, 1.0).unwrap();
            for _ in 0..20_000 {
                let w = noise.direction();
                let lit = environment.radiance(w).max_element();
                // Below this the lookup's own rounding decides on which side of a cell's edge the direction lies.
                assert!(lit < 1e-3 || environment.pdf(Vec3::ZERO, w) > 0.0, "{lit} from {w}");
            }
        }
    }

    #[test]
    fn the_sun_gives_its_irradiance() {
        let sky = Sky {
            zenith: Vec3::ZERO,
            horizon: Vec3::ZERO,
            ground: Vec3::ZERO,
            sun_direction: Vec3::Y,
            sun_radiance: Vec3::splat(1e5),
            sun_angular_radius: 0.00465,
        };
        let environment = Environment::sky(&sky);
        let n = 4096;
        let irradiance: f64 = (0..n)
            .filter_map(|i| environment.sample(Vec3::ZERO, Sampler::new((0, 0), 0, i, 0).next_2d()))
            .map(|s| f64::from(s.radiance.x * s.wi.y.max(0.0) / s.pdf) / f64::from(n))
            .sum();
        // pi sin^2 of the radius.
        let expected = 1e5 * PI * 0.00465f64.sin().powi(2);
        assert!((irradiance / expected - 1.0).abs() < 2e-3, "{irradiance} {expected}");
    }

    #[test]
    fn bad_maps_are_refused_by_name() {
        let mut map = random_map(4, 2, 2.0);
        map.set(3, 1, [1.0, f32::NAN, 0.0]);
        let error = Environment::map(map, 0.0, 1.0).unwrap_err();
        assert!(error.to_string().contains("column 3, row 1"), "{error}");
        let empty = Plane::filled(Size::new(0, 3), [0.0; 3]);
        assert!(matches!(Environment::map(empty, 0.0, 1.0), Err(EnvironmentError::Empty { .. })));
        let strength = Environment::map(random_map(2, 2, 2.0), 0.0, -1.0);
        assert!(matches!(strength, Err(EnvironmentError::Strength { .. })));
        // Darkness is no error, and is not sampled.
        let dark = Environment::map(random_map(2, 2, 2.0), 0.0, 0.0).unwrap();
        assert!(dark.sample(Vec3::Y, Vec2::splat(0.5)).is_none() && dark.pdf(Vec3::Y, Vec3::Y) == 0.0);
    }
}
