//! Cameras: where a world point lands in the image, and which world point a pixel and a depth mean.

use crate::plane::Size;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};

/// The camera of one frame.
///
/// Only rows x, y and w of the matrix are used, so reversed, infinite and off-centre projections work. Clip space has
/// x to the right and y up; row w of a perspective camera grows along the viewing direction. Orthographic cameras
/// (row w constant) look along minus the cross product of rows x and y, as every right-handed camera does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Clip from world, column-major, without jitter.
    pub clip_from_world: [f32; 16],
    /// Eye position in world space, the scene's own unit.
    pub position: [f32; 3],
    /// Where this frame's samples lie, in pixels from the pixel centres: pixel (x, y) was sampled at
    /// (x + 0.5 + jitter.0, y + 0.5 + jitter.1). Where it is not 0, in this frame or the one before, the picture is anti-aliased over time
    /// (`antialiasing`, or stage 11).
    pub jitter: [f32; 2],
}

impl Camera {
    /// A perspective camera.
    ///
    /// `position`, `forward`, `up` in world space (`forward` need not be unit, `up` must not be parallel to it),
    /// `vertical_fov` in radians, `aspect` = width / height. Right-handed, infinite reversed depth.
    pub fn perspective(position: [f32; 3], forward: [f32; 3], up: [f32; 3], vertical_fov: f32, aspect: f32) -> Self {
        let eye = Vec3::from(position).as_dvec3();
        let forward = Vec3::from(forward).as_dvec3().normalize();
        let right = forward.cross(Vec3::from(up).as_dvec3()).normalize();
        let up = right.cross(forward);
        let fy = 1.0 / (f64::from(vertical_fov) * 0.5).tan();
        let fx = fy / f64::from(aspect);
        let row = |v: DVec3| [v.x, v.y, v.z, -v.dot(eye)];
        // Row z of an infinite reversed projection is the constant near distance; nothing here reads it.
        let rows = [row(right * fx), row(up * fy), [0.0, 0.0, 0.0, 1.0], row(forward)];
        let mut clip_from_world = [0.0; 16];
        for (r, row) in rows.iter().enumerate() {
            for (c, value) in row.iter().enumerate() {
                clip_from_world[c * 4 + r] = *value as f32;
            }
        }
        Self { clip_from_world, position, jitter: [0.0; 2] }
    }

    /// The map between pixels and the world for an image of `size`; `None` where the matrix is singular or not
    /// finite.
    pub fn projection(&self, size: Size) -> Option<Projection> {
        let m = &self.clip_from_world;
        if m.iter().chain(&self.position).chain(&self.jitter).any(|v| !v.is_finite()) {
            return None;
        }
        let row =
            |r: usize| (DVec3::new(f64::from(m[r]), f64::from(m[4 + r]), f64::from(m[8 + r])), f64::from(m[12 + r]));
        let (ax, bx) = row(0);
        let (ay, by) = row(1);
        let (aw, bw) = row(3);
        let half = DVec2::new(size.width as f64, size.height as f64) * 0.5;
        // Rows that give homogeneous pixel coordinates: (u, v, w) = A X + b, pixel = (u, v) / w.
        let (au, bu) = (ax * half.x + aw * half.x, bx * half.x + bw * half.x);
        let (av, bv) = (aw * half.y - ay * half.y, bw * half.y - by * half.y);
        let forward_length = aw.length();
        let scale = ax.length().max(ay.length());
        if scale == 0.0 {
            return None;
        }
        if forward_length > 1e-6 * scale {
            let inverse = DMat3::from_cols(au, av, aw).transpose().inverse();
            if !inverse.is_finite() {
                return None;
            }
            // A (X - eye) = w (px, py, 1): the direction for pixel (px, py) at view depth 1 is affine in the pixel.
            let eye = -(inverse * DVec3::new(bu, bv, bw));
            let direction = inverse * forward_length;
            Some(Projection {
                u: (au, bu),
                v: (av, bv),
                w: (aw, bw),
                forward: (aw / forward_length).as_vec3(),
                eye: eye.as_vec3(),
                origin: [eye.as_vec3(), Vec3::ZERO, Vec3::ZERO],
                direction: [direction.z_axis.as_vec3(), direction.x_axis.as_vec3(), direction.y_axis.as_vec3()],
                focal_px: (av - aw * half.y).length() as f32 / forward_length as f32,
                perspective: true,
            })
        } else {
            if bw == 0.0 {
                return None;
            }
            let forward = -ax.cross(ay).normalize_or_zero();
            let inverse = DMat3::from_cols(au / bw, av / bw, forward).transpose().inverse();
            if forward == DVec3::ZERO || !inverse.is_finite() {
                return None;
            }
            let eye = Vec3::from(self.position).as_dvec3();
            // (u, v, depth) = A X + (bu, bv, -forward.eye): solve for X.
            let base = inverse * DVec3::new(-bu / bw, -bv / bw, forward.dot(eye));
            Some(Projection {
                u: (au, bu),
                v: (av, bv),
                w: (aw, bw),
                forward: forward.as_vec3(),
                eye: eye.as_vec3(),
                origin: [base.as_vec3(), inverse.x_axis.as_vec3(), inverse.y_axis.as_vec3()],
                direction: [forward.as_vec3(), Vec3::ZERO, Vec3::ZERO],
                focal_px: (av / bw).length() as f32,
                perspective: false,
            })
        }
    }
}

/// The map between pixels and the world for one camera and one image size.
///
/// A pixel coordinate is continuous: the centre of pixel (x, y) is (x + 0.5, y + 0.5). View depth is the distance
/// along the camera's axis.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// Homogeneous pixel coordinate (u, v, w) of a world point X: a . X + b each; pixel = (u, v) / w.
    pub(crate) u: (DVec3, f64),
    pub(crate) v: (DVec3, f64),
    pub(crate) w: (DVec3, f64),
    /// Unit viewing direction, world space.
    pub(crate) forward: Vec3,
    /// Eye position, world space.
    pub(crate) eye: Vec3,
    /// World position of view depth 0 for pixel coordinate (u, v): `origin[0] + u origin[1] + v origin[2]`.
    pub(crate) origin: [Vec3; 3],
    /// World displacement of one unit of view depth, affine in the pixel coordinate as `origin` is.
    pub(crate) direction: [Vec3; 3],
    /// Focal length in pixels (rows); orthographic: pixels a unit of length.
    pub focal_px: f32,
    /// False for orthographic cameras.
    pub perspective: bool,
}

impl Projection {
    /// Unit viewing direction, world space.
    pub fn forward(&self) -> [f32; 3] {
        self.forward.to_array()
    }

    /// Eye position, world space.
    pub fn eye(&self) -> [f32; 3] {
        self.eye.to_array()
    }

    /// World position at view depth 0 for a pixel coordinate: the eye, or a point of an orthographic camera's plane.
    #[inline]
    pub fn ray_origin(&self, pixel: Vec2) -> Vec3 {
        self.origin[0] + self.origin[1] * pixel.x + self.origin[2] * pixel.y
    }

    /// Ray direction scaled to one unit of view depth.
    #[inline]
    pub fn ray_direction(&self, pixel: Vec2) -> Vec3 {
        self.direction[0] + self.direction[1] * pixel.x + self.direction[2] * pixel.y
    }

    /// World position of a pixel coordinate and a finite view depth.
    #[inline]
    pub fn world(&self, pixel: Vec2, view_depth: f32) -> Vec3 {
        self.ray_origin(pixel) + self.ray_direction(pixel) * view_depth
    }

    /// Pixel coordinate of a world point; `None` behind the eye.
    #[inline]
    pub fn pixel(&self, world: Vec3) -> Option<Vec2> {
        let p = world.as_dvec3();
        let w = self.w.0.dot(p) + self.w.1;
        if w.is_nan() || w <= 0.0 {
            return None;
        }
        let u = self.u.0.dot(p) + self.u.1;
        let v = self.v.0.dot(p) + self.v.1;
        Some(DVec2::new(u / w, v / w).as_vec2())
    }

    /// Pixel coordinate in which a world direction is seen (a point at infinity); `None` behind the eye.
    #[inline]
    pub fn pixel_of_direction(&self, direction: Vec3) -> Option<Vec2> {
        let d = direction.as_dvec3();
        let w = self.w.0.dot(d);
        if w.is_nan() || w <= 0.0 {
            return None;
        }
        Some(DVec2::new(self.u.0.dot(d) / w, self.v.0.dot(d) / w).as_vec2())
    }

    /// View depth of a world point.
    #[inline]
    pub fn view_depth(&self, world: Vec3) -> f32 {
        (world - self.eye).dot(self.forward)
    }

    /// Size of a pixel at a view depth, in world units.
    #[inline]
    pub fn pixel_size(&self, view_depth: f32) -> f32 {
        if self.perspective { view_depth / self.focal_px } else { 1.0 / self.focal_px }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_worlds_are_inverse() {
        let size = Size::new(160, 90);
        let mut orthographic =
            Camera::perspective([1.0, 2.0, 3.0], [0.3, -0.2, -1.0], [0.0, 1.0, 0.0], 0.8, 16.0 / 9.0);
        for c in 0..4 {
            orthographic.clip_from_world[c * 4 + 3] = if c == 3 { 2.0 } else { 0.0 };
        }
        let perspective = Camera::perspective([1.0, 2.0, 3.0], [0.3, -0.2, -1.0], [0.0, 1.0, 0.0], 0.8, 16.0 / 9.0);
        for (camera, is_perspective) in [(perspective, true), (orthographic, false)] {
            let projection = camera.projection(size).unwrap();
            assert_eq!(projection.perspective, is_perspective);
            assert!((projection.forward - Vec3::new(0.3, -0.2, -1.0).normalize()).length() < 1e-5);
            for (pixel, depth) in
                [(Vec2::new(0.5, 0.5), 1.0), (Vec2::new(159.5, 3.25), 7.0), (Vec2::new(80.0, 45.0), 0.1)]
            {
                let world = projection.world(pixel, depth);
                assert!((projection.pixel(world).unwrap() - pixel).length() < 1e-3, "{pixel}");
                assert!((projection.view_depth(world) - depth).abs() < 1e-4, "{depth}");
            }
            // One pixel apart at depth 5 is one pixel size apart.
            let a = projection.world(Vec2::new(80.0, 45.0), 5.0);
            let b = projection.world(Vec2::new(80.0, 46.0), 5.0);
            assert!(((a - b).length() / projection.pixel_size(5.0) - 1.0).abs() < 1e-3);
        }
    }

    #[test]
    fn a_singular_matrix_is_refused() {
        let camera = Camera { clip_from_world: [0.0; 16], position: [0.0; 3], jitter: [0.0; 2] };
        assert!(camera.projection(Size::new(4, 4)).is_none());
    }
}
