//! `cornell-box`: the box of Goral et al. 1984 in the proportions of a wide picture.

use super::SceneInfo;
use crate::material::Material;
use crate::scene::{CameraPath, Scene};
use crate::shapes::{cuboid, quad, transformed};
use glam::{Affine3A, Quat, Vec3};
use std::f64::consts::TAU;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "cornell-box",
    stresses: "colour bleeding and soft indirect light, almost no texture",
    frames: 64,
    exposure: 1.0,
    cameras: 5,
};

/// Half width, height and half depth of the box.
const HALF_WIDTH: f32 = 1.7;
const HEIGHT: f32 = 2.0;
const HALF_DEPTH: f32 = 1.1;

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    let matte =
        |r: f32, g: f32, b: f32| Material { base_color: Vec3::new(r, g, b), roughness: 0.9, ..Material::default() };
    let white = scene.surface(matte(0.74, 0.73, 0.7));
    let red = scene.surface(matte(0.62, 0.07, 0.05));
    let green = scene.surface(matte(0.13, 0.45, 0.1));
    let satin =
        scene.surface(Material { base_color: Vec3::new(0.72, 0.7, 0.68), roughness: 0.35, ..Material::default() });
    let lamp = scene.surface(Material {
        base_color: Vec3::splat(0.7),
        emission: Vec3::new(40.0, 31.0, 20.0),
        ..Material::default()
    });
    let (w, h, d) = (HALF_WIDTH, HEIGHT, HALF_DEPTH);
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    scene.place(quad(Vec3::new(-w, 0.0, d), x * 2.0 * w, -z * 2.0 * d), white);
    scene.place(quad(Vec3::new(-w, h, -d), x * 2.0 * w, z * 2.0 * d), white);
    scene.place(quad(Vec3::new(-w, 0.0, -d), x * 2.0 * w, y * h), white);
    scene.place(quad(Vec3::new(-w, 0.0, d), -z * 2.0 * d, y * h), red);
    scene.place(quad(Vec3::new(w, 0.0, -d), z * 2.0 * d, y * h), green);
    // The lamp hangs a little below the ceiling and shines downwards only.
    scene.place(quad(Vec3::new(-0.35, h - 0.01, -0.28), x * 0.7, z * 0.56), lamp);
    let turned = |mesh, degrees: f32, at: Vec3| {
        transformed(mesh, Affine3A::from_rotation_translation(Quat::from_rotation_y(degrees.to_radians()), at))
    };
    let short = cuboid(Vec3::new(-0.31, 0.0, -0.31), Vec3::new(0.31, 0.62, 0.31));
    let tall = cuboid(Vec3::new(-0.32, 0.0, -0.32), Vec3::new(0.32, 1.25, 0.32));
    scene.place(turned(short, -17.0, Vec3::new(0.6, 0.0, 0.35)), white);
    scene.place(turned(tall, 20.0, Vec3::new(-0.6, 0.0, -0.3)), satin);

    let centre = Vec3::new(0.0, 0.97, 0.0);
    let wave = |frame: f64, period: f64, phase: f64| (TAU * (frame / period + phase)).sin() as f32;
    scene.cameras = vec![
        // 1: still.
        CameraPath::fixed(Vec3::new(0.0, 1.0, 4.1), centre, 36.0),
        // 2: to and fro sideways.
        CameraPath::moving(38.0, move |f| {
            (Vec3::new(0.55 * wave(f, 128.0, 0.0), 1.05, 3.7), centre + Vec3::X * 0.15 * wave(f, 128.0, 0.0))
        }),
        // 3: forwards and backwards.
        CameraPath::moving(40.0, move |f| (Vec3::new(0.2, 1.1, 3.3 - 0.5 * wave(f, 128.0, 0.25)), centre)),
        // 4: an arc from the left to the right at eye level.
        CameraPath::moving(44.0, move |f| {
            let angle = 0.42 * wave(f, 160.0, 0.9);
            (Vec3::new(2.9 * angle.sin(), 0.8, 2.9 * angle.cos()), Vec3::new(0.0, 0.75, -0.2))
        }),
        // 5: high up, looking down and turning.
        CameraPath::moving(50.0, move |f| {
            (Vec3::new(-0.4, 1.75, 2.2), Vec3::new(0.35 * wave(f, 96.0, 0.1), 0.5 + 0.1 * wave(f, 64.0, 0.0), -0.2))
        }),
    ];
    scene
}
