//! `furnace`: pictures with a known answer.
//!
//! Convex bodies with flat faces under a constant environment of radiance 1, so far apart that they do not see each
//! other: every pixel of a body is the directional albedo of its material at that angle, times 1. Camera 5 is inside a
//! closed matte box (albedo [`BOX_ALBEDO`], no interface) whose walls emit [`BOX_EMISSION`]: every pixel is
//! emission times the sum of albedo^k, k = 0..=bounces + 1.

use super::SceneInfo;
use crate::environment::Environment;
use crate::material::Material;
use crate::scene::{CameraPath, Mesh, Scene};
use crate::shapes::{room, transformed, uv_sphere};
use glam::{Affine3A, Vec3};
use std::f64::consts::TAU;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "furnace",
    stresses: "energy: bodies under constant light (cameras 1 to 4) and a closed box (5), with known answers",
    frames: 64,
    exposure: 0.6,
    cameras: 5,
};

/// Albedo of the closed box of camera 5.
const BOX_ALBEDO: f32 = 0.6;
/// Radiance that its walls emit.
const BOX_EMISSION: f32 = 0.4;
/// Distance between bodies of radius 1: each covers 6e-6 of the others' sky.
const APART: f32 = 200.0;

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    scene.environment = Environment::constant(Vec3::ONE);
    let white = Material { base_color: Vec3::ONE, roughness: 1.0, ..Material::default() };
    let bodies = [
        white,
        Material { base_color: Vec3::new(0.8, 0.5, 0.2), roughness: 0.3, ..white },
        Material { base_color: Vec3::splat(0.9), metallic: 1.0, roughness: 0.5, ..white },
        Material { base_color: Vec3::new(0.9, 0.7, 0.4), metallic: 1.0, roughness: 0.0, ..white },
    ];
    // Flat faces: interpolated normals would cut off a share of grazing reflections.
    let body = scene.mesh(Mesh { normals: Vec::new(), ..uv_sphere(1.0, 40, 20) });
    for (k, material) in bodies.into_iter().enumerate() {
        let surface = scene.surface(material);
        let index = scene.place(Mesh::default(), surface);
        let centre = Vec3::X * (APART * k as f32);
        scene.instances[index].mesh = body;
        scene.instances[index].transform = Affine3A::from_translation(centre).into();
        scene.cameras.push(CameraPath::moving(36.0, move |frame| {
            let angle = (TAU * frame / 256.0) as f32;
            (centre + Vec3::new(4.0 * angle.sin(), 0.6, 4.0 * angle.cos()), centre)
        }));
    }
    let walls = scene.surface(Material {
        base_color: Vec3::splat(BOX_ALBEDO),
        emission: Vec3::splat(BOX_EMISSION),
        specular: 0.0,
        ..white
    });
    let centre = Vec3::Y * APART;
    scene.place(transformed(room(Vec3::splat(-1.0), Vec3::ONE), Affine3A::from_translation(centre)), walls);
    scene.cameras.push(CameraPath::moving(60.0, move |frame| {
        let angle = (TAU * frame / 128.0) as f32;
        let eye = centre + Vec3::new(0.4 * angle.sin(), 0.2, 0.4 * angle.cos());
        (eye, centre + Vec3::new(-0.5, -0.2, -0.9))
    }));
    scene
}
