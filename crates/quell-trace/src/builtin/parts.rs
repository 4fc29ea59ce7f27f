//! What several built-in scenes are made of. A scene's identity, by which references are cached, is hashed from its sources, this file
//! among them where a scene uses it.

use crate::material::Material;
use crate::scene::{Mesh, Scene};
use crate::shapes::{cylinder, quad, transformed};
use glam::{Affine3A, Quat, Vec3};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A mesh moved by a vector.
pub(super) fn at(mesh: Mesh, to: [f32; 3]) -> Mesh {
    transformed(mesh, Affine3A::from_translation(Vec3::from(to)))
}

/// A dielectric of that base colour.
pub(super) fn plain(color: [f32; 3], roughness: f32) -> Material {
    Material { base_color: Vec3::from(color), roughness, ..Material::default() }
}

/// A metal of that reflectance.
pub(super) fn metal(color: [f32; 3], roughness: f32) -> Material {
    Material { metallic: 1.0, ..plain(color, roughness) }
}

/// Places a mesh that emits that radiance and reflects nothing; returns its instance.
pub(super) fn lamp(scene: &mut Scene, radiance: [f32; 3], mesh: Mesh) -> usize {
    let emission = Vec3::from(radiance);
    let surface = scene.surface(Material { base_color: Vec3::ZERO, emission, ..Material::default() });
    scene.place(mesh, surface)
}

/// The inside of a box on the ground around the origin, from its half width, height and half depth.
pub(super) fn room(scene: &mut Scene, [w, h, d]: [f32; 3], floor: usize, walls: usize, ceiling: usize) {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    scene.place(quad(Vec3::new(-w, 0.0, d), x * 2.0 * w, -z * 2.0 * d), floor);
    scene.place(quad(Vec3::new(-w, h, -d), x * 2.0 * w, z * 2.0 * d), ceiling);
    scene.place(quad(Vec3::new(-w, 0.0, -d), x * 2.0 * w, y * h), walls);
    scene.place(quad(Vec3::new(w, 0.0, d), -x * 2.0 * w, y * h), walls);
    scene.place(quad(Vec3::new(-w, 0.0, d), -z * 2.0 * d, y * h), walls);
    scene.place(quad(Vec3::new(w, 0.0, -d), z * 2.0 * d, y * h), walls);
}

/// A thin cylinder between two points.
pub(super) fn rod(from: Vec3, to: Vec3, radius: f32) -> Mesh {
    let along = to - from;
    let turn = Quat::from_rotation_arc(Vec3::Y, along.normalize_or(Vec3::Y));
    transformed(cylinder(radius, along.length(), 8), Affine3A::from_rotation_translation(turn, from))
}

/// The sine of a period in frames, `phase` in periods.
pub(super) fn wave(frame: f64, period: f64, phase: f64) -> f32 {
    (TAU * (frame / period + phase)).sin() as f32
}

/// A mesh with normals whose points move by a smooth pure function of the frame and the point at rest; normals follow.
pub(super) fn bent(mut mesh: Mesh, to: impl Fn(f64, Vec3) -> Vec3 + Send + Sync + 'static) -> Mesh {
    /// Half the distance over which the change of the function is taken.
    const NEAR: f32 = 1e-3;
    mesh.deform = Some(Arc::new(move |frame, mesh: &Mesh| {
        let positions = mesh.positions.iter().map(|p| to(frame, *p)).collect();
        let turned = |(p, n): (&Vec3, &Vec3)| {
            let (u, v) = n.any_orthonormal_pair();
            let change = |axis: Vec3| to(frame, *p + axis * NEAR) - to(frame, *p - axis * NEAR);
            change(u).cross(change(v)).normalize_or(*n)
        };
        (positions, mesh.positions.iter().zip(&mesh.normals).map(turned).collect())
    }));
    mesh
}
