//! Light from infinitely far away: constant, a latitude-longitude map, or a simple sky; looked up and importance
//! sampled.
//!
//! World space has y up. Row 0 of a map is the zenith; the centre of the picture is the direction -z, and columns run
//! clockwise seen from above (+x is a quarter of the width to the right).

use crate::material::channel_mean;
use crate::warp;
use glam::{Vec2, Vec3};
use quell::{Plane, Rgb, Size};
use std::f64::consts::{PI, TAU};

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
    background: Background,
    sun: Option<Sun>,
    /// Probability of sampling the sun rather than the background.
    sun_probability: f32,
    /// Mean radiance over the sphere, of background and sun.
    mean_radiance: Vec3,
}

#[derive(Clone, Debug)]
enum Background {
    Constant(Vec3),
    Map(Box<Map>),
}

/// A disc of constant radiance.
#[derive(Clone, Copy, Debug)]
struct Sun {
    direction: Vec3,
    radiance: Vec3,
    /// 1 - cos of the angular radius: the cosine itself would keep four digits of a real sun's size.
    one_minus_cos: f32,
}

/// A latitude-longitude map with its sampling distribution.
#[derive(Clone, Debug)]
struct Map {
    /// Radiance, strength included.
    texels: Plane<Rgb>,
    /// Turn about the y axis in radians: positive moves the picture to larger columns.
    rotation: f32,
    /// Cumulated probability of rows: height + 1 values from 0 to 1.
    row_cdf: Vec<f32>,
    /// Cumulated probability of columns within each row: width + 1 values a row.
    column_cdf: Vec<f32>,
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
        Ok(Self { background: Background::Map(Box::new(map)), sun: None, sun_probability: 0.0, mean_radiance })
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
            background: Background::Map(Box::new(map)),
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
        for y in 0..height {
            let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
            let solid_angle_share = 0.5 * (cos_of_row(y, height) - cos_of_row(y + 1, height)) / width as f64;
            let mut weights = vec![0.0f64; width];
            for x in 0..width {
                let columns = [(x + width - 1) % width, x, (x + 1) % width];
                // The mean of the bilinear lookup over this cell: whatever is brighter than 0 in the cell is found.
                let mut cell = [0.0f64; 3];
                for (j, row) in rows.into_iter().enumerate() {
                    for (i, column) in columns.into_iter().enumerate() {
                        let share = TENT_SHARES[i] * TENT_SHARES[j];
                        for (sum, v) in cell.iter_mut().zip(texels.at(column, row)) {
                            *sum += share * f64::from(v);
                        }
                    }
                }
                weights[x] = (cell[0] + cell[1] + cell[2]) * solid_angle_share;
                row_weights[y] += weights[x];
                for (sum, v) in mean.iter_mut().zip(cell) {
                    *sum += v * solid_angle_share;
                }
            }
            push_cdf(&mut column_cdf, &weights);
        }
        let mut row_cdf = Vec::with_capacity(height + 1);
        push_cdf(&mut row_cdf, &row_weights);
        (Self { texels, rotation, row_cdf, column_cdf }, Vec3::from_array(mean.map(|v| v as f32)))
    }

    /// Position in the picture, both in \[0, 1): (column share, row share).
    fn uv(&self, w: Vec3) -> (f32, f32) {
        let angle = w.x.atan2(-w.z) + self.rotation;
        let u = (0.5 + angle * (0.5 / std::f32::consts::PI)).rem_euclid(1.0);
        let polar = w.x.hypot(w.z).atan2(w.y);
        (u.min(warp::ONE_MINUS_EPSILON), (polar / std::f32::consts::PI).clamp(0.0, warp::ONE_MINUS_EPSILON))
    }

    fn radiance(&self, w: Vec3) -> Vec3 {
        let Size { width, height } = self.texels.size();
        let (u, v) = self.uv(w);
        let (x, y) = (u * width as f32 - 0.5, v * height as f32 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let column = |c: i64| c.rem_euclid(width as i64) as usize;
        let row = |r: i64| r.clamp(0, height as i64 - 1) as usize;
        let (x0, y0) = (x0 as i64, y0 as i64);
        let at = |c, r| Vec3::from_array(self.texels.at(column(c), row(r)));
        let upper = at(x0, y0).lerp(at(x0 + 1, y0), fx);
        let lower = at(x0, y0 + 1).lerp(at(x0 + 1, y0 + 1), fx);
        upper.lerp(lower, fy)
    }

    fn columns_of_row(&self, row: usize) -> &[f32] {
        let stride = self.texels.size().width + 1;
        &self.column_cdf[row * stride..][..stride]
    }

    fn sample(&self, u: Vec2) -> Vec3 {
        let Size { width, height } = self.texels.size();
        let (row, v) = invert_cdf(&self.row_cdf, u.x);
        let (column, s) = invert_cdf(self.columns_of_row(row), u.y);
        // Within a cell directions are uniform in solid angle: in azimuth and in the cosine.
        let (top, bottom) = (cos_of_row(row, height), cos_of_row(row + 1, height));
        let cos = top + (bottom - top) * f64::from(v);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let azimuth = ((column as f64 + f64::from(s)) / width as f64 - 0.5) * TAU - f64::from(self.rotation);
        Vec3::new((sin * azimuth.sin()) as f32, cos as f32, (-sin * azimuth.cos()) as f32).normalize()
    }

    fn pdf(&self, w: Vec3) -> f32 {
        let Size { width, height } = self.texels.size();
        let (u, v) = self.uv(w);
        let column = ((u * width as f32) as usize).min(width - 1);
        let row = ((v * height as f32) as usize).min(height - 1);
        let columns = self.columns_of_row(row);
        let probability =
            f64::from(self.row_cdf[row + 1] - self.row_cdf[row]) * f64::from(columns[column + 1] - columns[column]);
        let solid_angle = TAU / width as f64 * (cos_of_row(row, height) - cos_of_row(row + 1, height));
        (probability / solid_angle) as f32
    }
}

/// Shares of the texel before, at and after in the mean of a linear interpolation over one texel's width.
const TENT_SHARES: [f64; 3] = [0.125, 0.75, 0.125];

/// Cosine with the zenith of the upper edge of a row.
fn cos_of_row(row: usize, height: usize) -> f64 {
    (PI * row as f64 / height as f64).cos()
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
