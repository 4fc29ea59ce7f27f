//! Paths for cameras of scenes in which nothing moves.

use crate::hash::Hash;
use crate::scene::{CameraPath, Scene, SceneError};
use crate::track::Track;
use glam::{Mat3, Vec3, Vec3A};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// How a camera moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// To and fro on an arc about what it looks at.
    Orbit,
    /// Forwards and backwards along its axis.
    Dolly,
    /// Not at all: as it stands at frame 0.
    Still,
}

/// Frames after which a path repeats.
const PERIOD: f64 = 96.0;
/// Largest angle of an orbit to either side.
const ORBIT_RAD: f32 = 0.26;
/// Share of the distance to what is looked at by which a dolly goes forwards.
const DOLLY_SHARE: f32 = 0.25;
/// A path keeps this share of the way to any obstacle free.
const CLEARANCE: f32 = 0.8;

impl Motion {
    /// By its name on the command line.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "orbit" => Some(Self::Orbit),
            "dolly" => Some(Self::Dolly),
            "still" => Some(Self::Still),
            _ => None,
        }
    }
}

/// Adds a camera that starts where camera `camera` (from 1) stands at frame 0, and returns its number. The scene's
/// identity changes: a path depends on the geometry.
///
/// # Errors
/// A camera that does not exist or cannot be used.
pub fn add(scene: &mut Scene, motion: Motion, camera: usize) -> Result<usize, SceneError> {
    let count = scene.cameras.len();
    let unknown = SceneError::UnknownCamera { scene: scene.name.clone(), number: camera, count };
    let from = camera.checked_sub(1).and_then(|c| scene.cameras.get(c)).ok_or(unknown)?.clone();
    let (eye, up) = (from.position.at(0.0), from.up.at(0.0));
    let unusable = SceneError::Camera { scene: scene.name.clone(), number: camera, frame: 0 };
    let forward = (from.target.at(0.0) - eye).try_normalize().ok_or(unusable)?;
    let distance = first_hit(scene, eye, forward).unwrap_or((from.target.at(0.0) - eye).length());
    let pivot = eye + forward * distance;
    let axis = up.normalize_or(Vec3::Y);
    let wave = |frame: f64| (TAU * frame / PERIOD).sin() as f32;
    let fixed = CameraPath {
        name: String::new(),
        position: eye.into(),
        target: pivot.into(),
        up: up.into(),
        vertical_fov: from.vertical_fov.at(0.0).into(),
        orthographic_height: from.orthographic_height,
    };
    let path = match motion {
        Motion::Still => fixed,
        Motion::Dolly => {
            let way = forward * distance * DOLLY_SHARE;
            CameraPath {
                // Starts slowly, is farthest forward after half a period.
                position: Track::function(move |frame| eye + way * (0.5 - 0.5 * (TAU * frame / PERIOD).cos() as f32)),
                target: (pivot + forward * distance).into(),
                ..fixed
            }
        }
        Motion::Orbit => {
            let at = move |angle: f32| pivot + Mat3::from_axis_angle(axis, angle) * (eye - pivot);
            let angle = free_angle(scene, eye, &at);
            CameraPath { position: Track::function(move |frame| at(angle * wave(frame))), ..fixed }
        }
    };
    let mut identity = Hash::new();
    identity.number(scene.identity);
    identity.number(motion as u64);
    identity.number(camera as u64);
    scene.identity = identity.finish();
    scene.cameras.push(path);
    Ok(scene.cameras.len())
}

/// The largest angle, up to [`ORBIT_RAD`], to which the arc stays clear of what stands beside the camera.
fn free_angle(scene: &Scene, eye: Vec3, at: &dyn Fn(f32) -> Vec3) -> f32 {
    let mut angle = ORBIT_RAD;
    for side in [1.0, -1.0] {
        let way = at(side * ORBIT_RAD) - eye;
        if let Some(direction) = way.try_normalize()
            && let Some(hit) = first_hit(scene, eye, direction)
        {
            angle = angle.min(ORBIT_RAD * (hit / way.length() * CLEARANCE).min(1.0));
        }
    }
    angle
}

/// Distance to the first triangle along a unit direction at frame 0: all are tried, which is less work for a few rays
/// than a BVH.
fn first_hit(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<f32> {
    let (origin, direction) = (Vec3A::from(origin), Vec3A::from(direction));
    let nearest = |instance: &crate::Instance| -> f32 {
        let Some(mesh) = scene.meshes.get(instance.mesh) else { return f32::INFINITY };
        let transform = instance.transform.at(0.0);
        let moved = mesh.deform.as_ref().map(|deform| deform(0.0, mesh).0);
        let positions = moved.as_ref().unwrap_or(&mesh.positions);
        let world: Vec<Vec3A> = positions.iter().map(|p| transform.transform_point3a((*p).into())).collect();
        let hit = |corners: &[u32; 3]| -> f32 {
            let [Some(a), Some(b), Some(c)] = corners.map(|i| world.get(i as usize).copied()) else {
                return f32::INFINITY;
            };
            let (ab, ac, to) = (b - a, c - a, origin - a);
            let p = direction.cross(ac);
            let determinant = ab.dot(p);
            let (u, q) = (to.dot(p) / determinant, to.cross(ab));
            let (v, t) = (direction.dot(q) / determinant, ac.dot(q) / determinant);
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 { t } else { f32::INFINITY }
        };
        mesh.triangles.iter().map(hit).fold(f32::INFINITY, f32::min)
    };
    let least = scene.instances.par_iter().map(nearest).reduce(|| f32::INFINITY, f32::min);
    (least < f32::INFINITY).then_some(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Size;

    #[test]
    fn paths_start_where_the_camera_stands_and_stay_clear() {
        let scene = crate::builtin("cornell-box").unwrap();
        let size = Size::new(16, 9);
        let start = scene.cameras[0].at(0.0, size).unwrap();
        for (motion, far) in [(Motion::Orbit, 24.0), (Motion::Dolly, 48.0), (Motion::Still, 24.0)] {
            let mut scene = scene.clone();
            let before = scene.identity;
            let number = add(&mut scene, motion, 1).unwrap();
            assert_eq!(number, scene.cameras.len());
            assert_ne!(scene.identity, before);
            let path = &scene.cameras[number - 1];
            let begin = path.at(0.0, size).unwrap();
            assert!((Vec3::from(begin.position) - Vec3::from(start.position)).length() < 1e-4, "{motion:?}");
            let moved = (Vec3::from(path.at(far, size).unwrap().position) - Vec3::from(start.position)).length();
            assert_eq!(moved > 0.1, motion != Motion::Still, "{motion:?} {moved}");
        }
        assert!(add(&mut scene.clone(), Motion::Orbit, 9).is_err());
    }
}
