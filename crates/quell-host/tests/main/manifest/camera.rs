//! The struct `Frame` from matrices, as docs/shaders.md has a host fill it.

use quell::{Camera, FrameBuf};
use serde_json::{Value, json};

type Vec3 = [f64; 3];

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn scaled(a: Vec3, k: f64) -> Vec3 {
    a.map(|v| v * k)
}

/// A perspective camera for images of an extent.
struct View {
    /// Homogeneous pixel coordinate (u, v, w) of a point X: row . X + constant.
    rows: [(Vec3, f64); 3],
    /// In single precision, as shaders read it.
    eye: Vec3,
    direction: [Vec3; 3],
    forward: Vec3,
    focal_px: f32,
}

impl View {
    fn new(camera: &Camera, extent: [u32; 2]) -> Self {
        let m = camera.clip_from_world.map(f64::from);
        let row = |r: usize| ([m[r], m[4 + r], m[8 + r]], m[12 + r]);
        let ((x, bx), (y, by), (w, bw)) = (row(0), row(1), row(3));
        let half = extent.map(|n| f64::from(n) * 0.5);
        let sum = |a: Vec3, ka: f64, b: Vec3, kb: f64| -> Vec3 { std::array::from_fn(|i| a[i] * ka + b[i] * kb) };
        let u = (sum(x, half[0], w, half[0]), bx * half[0] + bw * half[0]);
        let v = (sum(w, half[1], y, -half[1]), bw * half[1] - by * half[1]);
        // Columns of the inverse of the matrix whose rows are u, v, w.
        let columns = [cross(v.0, w), cross(w, u.0), cross(u.0, v.0)];
        let determinant = dot(w, columns[2]);
        let columns = columns.map(|c| scaled(c, 1.0 / determinant));
        let eye: Vec3 = std::array::from_fn(|i| -(columns[0][i] * u.1 + columns[1][i] * v.1 + columns[2][i] * bw));
        let length = dot(w, w).sqrt();
        let focal = sum(v.0, 1.0, w, -half[1]);
        Self {
            rows: [u, v, (w, bw)],
            eye: eye.map(|v| f64::from(v as f32)),
            direction: [columns[2], columns[0], columns[1]].map(|c| scaled(c, length)),
            forward: scaled(w, 1.0 / length),
            focal_px: dot(focal, focal).sqrt() as f32 / length as f32,
        }
    }

    /// Members of the struct for a frame with this eye.
    fn members(&self, eye: Vec3) -> Value {
        let row = |k: usize| {
            let (a, b) = self.rows[k];
            json!([a[0], a[1], a[2], dot(a, self.eye) + b])
        };
        let relative: Vec3 = std::array::from_fn(|i| self.eye[i] - eye[i]);
        json!({
            "origin": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
            "direction": self.direction,
            "u": row(0), "v": row(1), "w": row(2),
            "forward": self.forward,
            "focal_px": self.focal_px,
            "eye": relative,
            "perspective": 1,
        })
    }
}

fn unit(a: Vec3) -> Vec3 {
    scaled(a, 1.0 / dot(a, a).sqrt())
}

/// The camera's axes to the right and up.
pub fn axes(camera: &Camera) -> [Vec3; 2] {
    let m = camera.clip_from_world.map(f64::from);
    let row = |r: usize| [m[r], m[4 + r], m[8 + r]];
    let forward = unit(row(3)).map(|v| f64::from(v as f32));
    [0, 1].map(|r| {
        let along = dot(row(r), forward);
        unit(std::array::from_fn(|i| row(r)[i] - forward[i] * along))
    })
}

/// The members of `Prepare` that a frame fills, for a device depth whose far end is 0.
pub fn prepare(frame: &FrameBuf, extent: [u32; 2]) -> Value {
    let eye = View::new(&frame.camera, extent).eye;
    let m = frame.camera.clip_from_world.map(f64::from);
    let z = [m[2], m[6], m[10]];
    let [right, up] = axes(&frame.camera);
    let (now, before) = (frame.camera.jitter, frame.previous_camera.jitter);
    json!({
        "device_z": [z[0], z[1], z[2], dot(z, eye) + m[14]],
        "right": right,
        "up": up,
        "device_far": 0.0,
        "motion_shift": [before[0] - now[0], before[1] - now[1]],
    })
}

/// The members of `Frame`; `before`: the frame before, where there is history.
pub fn uniforms(frame: &FrameBuf, before: Option<&FrameBuf>, extent: [u32; 2]) -> Value {
    let now = View::new(&frame.camera, extent);
    let history = u32::from(before.is_some());
    let before = before.unwrap_or(frame);
    json!({
        "view": now.members(now.eye),
        "previous_view": View::new(&frame.previous_camera, extent).members(now.eye),
        "before_view": View::new(&before.camera, extent).members(now.eye),
        "jitter": frame.camera.jitter,
        "before_jitter": before.camera.jitter,
        "size": extent,
        "before_size": extent,
        "to_before": [1.0, 1.0],
        "origin": [0, 0],
        "whole": extent,
        "matte_history": history,
        "glossy_history": history,
        "direct_history": history,
        "picture_history": history,
        "has_glossy_hit": u32::from(frame.glossy_hit_distance.is_some()),
        "has_roughness": u32::from(frame.roughness.is_some()),
    })
}
