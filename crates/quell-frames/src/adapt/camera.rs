//! The camera of a frame: from world positions, or from matrices in the header.
//!
//! A pixel is a projective function of the world point: (u, v, w) = M (X, 1), pixel = (u, v) / w. Twelve numbers, found
//! by least squares from thousands of points (the direct linear transform of Hartley and Zisserman, "Multiple View
//! Geometry", section 7.1, points normalised as there).

use glam::{DMat3, DVec3};
use quell::{Plane, Size};

/// Points that take part in a solution: more change nothing.
const POINTS: usize = 4000;

/// Least ratio of the second smallest to the largest eigenvalue: below it points lie in a plane, say, and many cameras
/// explain them.
const DISTINCT: f64 = 1e-9;

/// A camera by its pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelCamera {
    /// Homogeneous pixel from world: rows u, v, w; pixel = (u, v) / w, x right, y down, w grows into the scene.
    rows: [(DVec3, f64); 3],
    /// World direction from (pixel, 1).
    direction: DMat3,
    /// Where the camera is.
    pub eye: [f32; 3],
    /// Median distance between pixel centres and projected positions, pixels; 0 where it was not measured.
    pub residual_px: f64,
}

impl PixelCamera {
    fn from_rows(rows: [(DVec3, f64); 3]) -> Option<Self> {
        let length = rows[2].0.length();
        if !(length.is_finite() && length > 0.0) {
            return None;
        }
        let rows = rows.map(|(a, b)| (a / length, b / length));
        let direction = DMat3::from_cols(rows[0].0, rows[1].0, rows[2].0).transpose().inverse();
        if !direction.is_finite() {
            return None;
        }
        let eye = -(direction * DVec3::new(rows[0].1, rows[1].1, rows[2].1));
        Some(Self { rows, direction, eye: eye.as_vec3().to_array(), residual_px: 0.0 })
    }

    /// From a matrix that takes world points to clip space (x right, y up, -1..1 over the picture), column-major for
    /// column vectors (the same sixteen numbers as a row-major matrix for row vectors).
    pub fn from_clip(m: &[f32; 16], size: Size) -> Option<Self> {
        let row = |r: usize| {
            let [a, b, c, d] = [m[r], m[4 + r], m[8 + r], m[12 + r]].map(f64::from);
            (DVec3::new(a, b, c), d)
        };
        let (x, y, w) = (row(0), row(1), row(3));
        let half = [size.width as f64 * 0.5, size.height as f64 * 0.5];
        let u = (x.0 * half[0] + w.0 * half[0], x.1 * half[0] + w.1 * half[0]);
        let v = (w.0 * half[1] - y.0 * half[1], w.1 * half[1] - y.1 * half[1]);
        Self::from_rows([u, v, w])
    }

    /// From world positions, each seen at its pixel's centre; pixels for which `is_surface` is false are left out.
    /// `None` where points are too few or many cameras explain them.
    pub fn solve(position: &Plane<[f32; 3]>, is_surface: impl Fn(usize) -> bool) -> Option<Self> {
        let size = position.size();
        let step = ((size.pixels() as f64 / POINTS as f64).sqrt().ceil() as usize).max(1);
        let mut points = Vec::new();
        for y in (0..size.height).step_by(step) {
            for x in (0..size.width).step_by(step) {
                let at = position.at(x, y);
                if is_surface(y * size.width + x) && at.iter().all(|v| v.is_finite()) {
                    let at = DVec3::from(at.map(f64::from));
                    points.push((at, [x as f64 + 0.5, y as f64 + 0.5]));
                }
            }
        }
        let mut camera = Self::fit(&points)?;
        // Positions that are means over a pixel's samples lie beside every surface at edges.
        for _ in 0..2 {
            let mut errors: Vec<f64> = points.iter().map(|p| camera.miss(p)).collect();
            let mut sorted = errors.clone();
            sorted.sort_by(f64::total_cmp);
            let limit = sorted[sorted.len() / 2] * 4.0 + 1e-6;
            let mut keep = errors.drain(..).map(|e| e <= limit);
            points.retain(|_| keep.next().unwrap_or(false));
            camera = Self::fit(&points)?;
        }
        Some(camera)
    }

    fn fit(points: &[(DVec3, [f64; 2])]) -> Option<Self> {
        if points.len() < 24 {
            return None;
        }
        let count = points.len() as f64;
        let centre = points.iter().map(|p| p.0).sum::<DVec3>() / count;
        let spread = points.iter().map(|p| (p.0 - centre).length()).sum::<f64>() / count;
        let middle = [0, 1].map(|i| points.iter().map(|p| p.1[i]).sum::<f64>() / count);
        let width = points.iter().map(|p| (p.1[0] - middle[0]).hypot(p.1[1] - middle[1])).sum::<f64>() / count;
        if !(spread > 0.0 && width > 0.0) {
            return None;
        }
        let mut normal = [[0.0; 12]; 12];
        for (at, pixel) in points {
            let p = (*at - centre) / spread;
            let p = [p.x, p.y, p.z, 1.0];
            for axis in 0..2 {
                let value = (pixel[axis] - middle[axis]) / width;
                let mut row = [0.0; 12];
                for i in 0..4 {
                    row[axis * 4 + i] = p[i];
                    row[8 + i] = -value * p[i];
                }
                for i in 0..12 {
                    for j in 0..12 {
                        normal[i][j] += row[i] * row[j];
                    }
                }
            }
        }
        let (values, vectors) = eigen(normal);
        let mut order: Vec<usize> = (0..12).collect();
        order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
        let (least, second, most) = (order[0], values[order[1]], values[order[11]]);
        if second <= most * DISTINCT {
            return None;
        }
        let p: [f64; 12] = std::array::from_fn(|i| vectors[i][least]);
        // Back from normalised points and pixels.
        let world = |r: usize| {
            let a = DVec3::new(p[4 * r], p[4 * r + 1], p[4 * r + 2]) / spread;
            (a, p[4 * r + 3] - a.dot(centre))
        };
        let w = world(2);
        let pixel = |r: usize| {
            let a = world(r);
            (a.0 * width + w.0 * middle[r], a.1 * width + w.1 * middle[r])
        };
        let mut rows = [pixel(0), pixel(1), w];
        // The scene lies in front.
        let ahead: f64 = points.iter().map(|q| (w.0.dot(q.0) + w.1).signum()).sum();
        if ahead < 0.0 {
            rows = rows.map(|(a, b)| (-a, -b));
        }
        let mut camera = Self::from_rows(rows)?;
        let mut errors: Vec<f64> = points.iter().map(|p| camera.miss(p)).collect();
        errors.sort_by(f64::total_cmp);
        camera.residual_px = errors[errors.len() / 2];
        camera.residual_px.is_finite().then_some(camera)
    }

    /// The same camera for pixels counted from another corner.
    #[must_use]
    pub fn shifted(self, x: f64, y: f64) -> Self {
        let [u, v, w] = self.rows;
        let by = |row: (DVec3, f64), shift: f64| (row.0 + w.0 * shift, row.1 + w.1 * shift);
        Self::from_rows([by(u, x), by(v, y), w]).unwrap_or(self)
    }

    fn miss(&self, point: &(DVec3, [f64; 2])) -> f64 {
        let found = self.homogeneous(point.0, 1.0);
        (found.x / found.z - point.1[0]).hypot(found.y / found.z - point.1[1])
    }

    /// Median distance in pixels between pixel centres and where the positions project to.
    pub fn residual(&self, position: &Plane<[f32; 3]>, is_surface: impl Fn(usize) -> bool) -> Option<f64> {
        let size = position.size();
        let mut errors: Vec<f64> = (0..size.pixels())
            .step_by((size.pixels() / POINTS).max(1))
            .filter(|i| is_surface(*i))
            .map(|i| {
                let (x, y) = (i % size.width, i / size.width);
                let at = DVec3::from(position.at(x, y).map(f64::from));
                self.miss(&(at, [x as f64 + 0.5, y as f64 + 0.5]))
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        errors.get(errors.len() / 2).copied()
    }

    fn homogeneous(&self, at: DVec3, w: f64) -> DVec3 {
        let [u, v, z] = self.rows.map(|(a, b)| a.dot(at) + b * w);
        DVec3::new(u, v, z)
    }

    /// Pixel of a world point; NaN behind the camera.
    pub fn pixel(&self, at: [f32; 3]) -> [f32; 2] {
        let p = self.homogeneous(DVec3::from(at.map(f64::from)), 1.0);
        if p.z > 0.0 { [(p.x / p.z) as f32, (p.y / p.z) as f32] } else { [f32::NAN; 2] }
    }

    /// Distance of a world point along the camera's axis.
    pub fn depth(&self, at: [f32; 3]) -> f32 {
        self.homogeneous(DVec3::from(at.map(f64::from)), 1.0).z as f32
    }

    /// World direction seen at a pixel position, as long as planar depth 1 makes it.
    pub fn direction(&self, x: f32, y: f32) -> [f32; 3] {
        (self.direction * DVec3::new(f64::from(x), f64::from(y), 1.0)).as_vec3().to_array()
    }

    /// Pixel at which this camera sees what lies infinitely far in a world direction; NaN behind the camera.
    pub fn pixel_of_direction(&self, direction: [f32; 3]) -> [f32; 2] {
        let p = self.homogeneous(DVec3::from(direction.map(f64::from)), 0.0);
        if p.z > 0.0 { [(p.x / p.z) as f32, (p.y / p.z) as f32] } else { [f32::NAN; 2] }
    }

    /// A camera-space vector (x right, y up, z into the scene) in world space.
    pub fn world_from_camera(&self, v: [f32; 3]) -> [f32; 3] {
        let forward = self.rows[2].0;
        let across = |row: DVec3| (row - forward * row.dot(forward)).normalize_or_zero();
        let (right, up) = (across(self.rows[0].0), -across(self.rows[1].0));
        let [x, y, z] = v.map(f64::from);
        (right * x + up * y + forward * z).as_vec3().to_array()
    }
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi's rotations: slow, exact, short.
fn eigen<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut v: [[f64; N]; N] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..60 {
        let off: f64 = (0..N).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i][j] * a[i][j]).sum();
        let diagonal: f64 = (0..N).map(|i| a[i][i] * a[i][i]).sum();
        if off <= diagonal * 1e-30 {
            break;
        }
        for p in 0..N {
            for q in p + 1..N {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                for k in 0..N {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                }
                for row in &mut v {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
    }
    (std::array::from_fn(|i| a[i][i]), v)
}
