//! The cameras of a frame, for the device.

use super::layout::{self, Row, row};
use crate::primary::Views;
use glam::{DVec3, Vec2, Vec3};
use quell::{Camera, Projection, Size};

/// Pixels between the two places that slopes are taken from: so many that what does not depend on the pixel is lost in
/// rounding.
const FAR_PIXEL: f32 = (1_u64 << 40) as f32;

/// The columns of an affine function of the pixel coordinate.
fn affine(at: impl Fn(Vec2) -> Vec3) -> [Row; 3] {
    let base = at(Vec2::ZERO);
    let slope = |axis: Vec2| (at(axis * FAR_PIXEL) - base) / FAR_PIXEL;
    [base, slope(Vec2::X), slope(Vec2::Y)].map(|v| row(v, 0.0))
}

/// Rows that give homogeneous pixel coordinates of a point relative to `eye`: differences are taken in double precision.
fn rows(camera: &Camera, size: Size, eye: Vec3) -> [Row; 3] {
    let m = camera.clip_from_world.map(f64::from);
    let eye = eye.as_dvec3();
    let of = |r: usize| {
        let v = DVec3::new(m[r], m[4 + r], m[8 + r]);
        (v, v.dot(eye) + m[12 + r])
    };
    let ((x, bx), (y, by), (w, bw)) = (of(0), of(1), of(3));
    let (half_width, half_height) = (size.width as f64 * 0.5, size.height as f64 * 0.5);
    let packed = |v: DVec3, b: f64| row(v.as_vec3(), b as f32);
    [
        packed((x + w) * half_width, (bx + bw) * half_width),
        packed((w - y) * half_height, (bw - by) * half_height),
        packed(w, bw),
    ]
}

fn far_motion(now: &Projection, before: &Projection) -> u32 {
    match (now.perspective, before.perspective) {
        (true, true) => layout::FAR_TURNS,
        (false, false) if now.forward() == before.forward() => layout::FAR_IS_STILL,
        _ => layout::FAR_IS_UNKNOWN,
    }
}

/// The part of the frame's uniform that cameras fill.
pub(super) fn frame(views: &Views, size: Size) -> layout::Frame {
    let eye = Vec3::from(views.now.eye());
    layout::Frame {
        eye: eye.to_array(),
        forward: views.now.forward(),
        previous_eye: views.before.eye(),
        eye_moved: u32::from(views.before.eye() != views.now.eye()),
        width: size.width as u32,
        height: size.height as u32,
        origin: affine(|p| views.now.ray_origin(p)),
        direction: affine(|p| views.now.ray_direction(p)),
        now: rows(&views.camera, size, eye),
        before: rows(&views.previous_camera, size, eye),
        jitter: views.camera.jitter,
        far_motion: far_motion(&views.now, &views.before),
        ..layout::Frame::default()
    }
}
