//! `lights-out`: a lamp that reaches what is seen by bounces only goes up, down to a remaining light, down to black.

use super::SceneInfo;
use crate::material::Material;
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Mesh, Scene, Surface};
use crate::shapes::{cuboid, lathe, merge, quad, rounded_box, transformed, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, Quat, Vec2, Vec3};
use std::f64::consts::TAU;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "lights-out",
    stresses: "a hidden lamp goes up at frame 24, down to a remaining light at 52, to black at 80",
    frames: 96,
    exposure: 1.0,
    cameras: 5,
};

/// Frames from which the lamp shines fully, only the remaining light is left, and nothing.
const UP: f64 = 24.0;
const DOWN: f64 = 52.0;
const BLACK: f64 = 80.0;

fn at(mesh: Mesh, x: f32, y: f32, z: f32) -> Mesh {
    transformed(mesh, Affine3A::from_translation(Vec3::new(x, y, z)))
}

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    let plain = |r: f32, g: f32, b: f32, roughness: f32| Material {
        base_color: Vec3::new(r, g, b),
        roughness,
        ..Material::default()
    };
    let floor = scene.surface(Surface {
        material: plain(0.62, 0.55, 0.45, 0.25),
        pattern: Pattern::Checker { other: Vec3::new(0.20, 0.17, 0.15), cells: Vec2::new(12.0, 10.0) },
        ..Default::default()
    });
    let plaster = scene.surface(plain(0.80, 0.78, 0.74, 0.9));
    let rose = scene.surface(Surface {
        material: plain(0.68, 0.36, 0.34, 0.85),
        pattern: Pattern::Stripes { other: Vec3::new(0.58, 0.28, 0.27), count: 18.0 },
        ..Default::default()
    });
    let blue = scene.surface(plain(0.25, 0.36, 0.58, 0.8));
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let (w, h, d) = (2.6_f32, 2.5_f32, 2.2_f32);
    scene.place(quad(Vec3::new(-w, 0.0, d), x * 2.0 * w, -z * 2.0 * d), floor);
    scene.place(quad(Vec3::new(-w, h, -d), x * 2.0 * w, z * 2.0 * d), plaster);
    scene.place(quad(Vec3::new(-w, 0.0, -d), x * 2.0 * w, y * h), rose);
    scene.place(quad(Vec3::new(w, 0.0, d), -x * 2.0 * w, y * h), plaster);
    scene.place(quad(Vec3::new(-w, 0.0, d), -z * 2.0 * d, y * h), blue);
    scene.place(quad(Vec3::new(w, 0.0, -d), z * 2.0 * d, y * h), plaster);
    // A screen before the right wall hides the lamp behind it, which shines at the ceiling there.
    let ochre = scene.surface(plain(0.72, 0.58, 0.36, 0.85));
    scene.place(cuboid(Vec3::new(1.55, 0.0, -d), Vec3::new(1.63, 1.85, 0.2)), ochre);
    let lamp = |scene: &mut Scene, radiance: Vec3, mesh: Mesh, scale: Track<f32>| {
        let surface = scene.surface(Material { base_color: Vec3::ZERO, emission: radiance, ..Material::default() });
        let index = scene.place(mesh, surface);
        scene.instances[index].emission_scale = scale;
    };
    lamp(
        &mut scene,
        Vec3::new(62.0, 49.0, 34.0),
        quad(Vec3::new(1.75, 0.9, -0.3), x * 0.7, -z * 1.4),
        Track::function(|frame| if (UP..DOWN).contains(&frame) { 1.0 } else { 0.0 }),
    );
    // The remaining light: a dim cool strip on top of a shelf, shining at the ceiling.
    scene.place(cuboid(Vec3::new(-w, 1.95, -d), Vec3::new(-w + 0.3, 1.99, 0.5)), plaster);
    scene.place(cuboid(Vec3::new(-w + 0.28, 1.95, -d), Vec3::new(-w + 0.3, 2.08, 0.5)), plaster);
    lamp(
        &mut scene,
        Vec3::new(16.0, 21.0, 29.0),
        quad(Vec3::new(-w + 0.08, 2.0, 0.4), x * 0.1, -z * 2.4),
        Track::function(|frame| if frame < BLACK { 1.0 } else { 0.0 }),
    );

    let wood = scene.surface(Surface {
        material: plain(0.42, 0.24, 0.12, 0.4),
        pattern: Pattern::Wood { dark: Vec3::new(0.18, 0.09, 0.04), rings: 15.0 },
        ..Default::default()
    });
    scene.place(at(rounded_box(Vec3::new(0.6, 0.03, 0.4), 0.015, 2), -0.2, 0.6, -0.9), wood);
    let legs: Vec<Mesh> = [(-0.5, -0.3), (0.5, -0.3), (-0.5, 0.3), (0.5, 0.3)]
        .map(|(lx, lz)| at(cuboid(Vec3::new(-0.03, 0.0, -0.03), Vec3::new(0.03, 0.58, 0.03)), lx - 0.2, 0.0, lz - 0.9))
        .to_vec();
    scene.place(merge(&legs), wood);
    let glaze = scene.surface(plain(0.12, 0.38, 0.30, 0.15));
    let profile: Vec<Vec2> = std::iter::once(Vec2::ZERO)
        .chain((0..=24).map(|i| {
            let s = i as f32 / 24.0;
            Vec2::new(0.06 + 0.10 * (s * 3.0).sin().abs().powf(1.3), 0.36 * s)
        }))
        .collect();
    scene.place(at(lathe(&profile, 48, true), -0.45, 0.63, -0.9), glaze);
    let brass = scene.surface(Material { metallic: 1.0, ..plain(0.85, 0.62, 0.30, 0.2) });
    scene.place(at(uv_sphere(0.14, 64, 32), 0.1, 0.77, -0.8), brass);
    let chair = scene.surface(plain(0.70, 0.45, 0.08, 0.9));
    let turn = Quat::from_rotation_y(0.6);
    scene.place(
        transformed(
            merge(&[
                at(rounded_box(Vec3::new(0.35, 0.12, 0.35), 0.06, 3), 0.0, 0.32, 0.0),
                at(rounded_box(Vec3::new(0.35, 0.35, 0.08), 0.06, 3), 0.0, 0.62, -0.3),
            ]),
            Affine3A::from_rotation_translation(turn, Vec3::new(-1.5, 0.0, -0.9)),
        ),
        chair,
    );

    let wave = |frame: f64, period: f64, phase: f64| (TAU * (frame / period + phase)).sin() as f32;
    scene.cameras = vec![
        CameraPath::fixed(Vec3::new(-0.3, 1.3, 2.0), Vec3::new(-0.1, 0.65, -1.4), 50.0),
        CameraPath::moving(52.0, move |f| {
            let s = wave(f, 160.0, 0.0);
            (Vec3::new(-0.4 + 0.7 * s, 1.3, 1.95), Vec3::new(-0.2, 0.65, -1.4))
        }),
        CameraPath::moving(50.0, move |f| {
            let s = wave(f, 128.0, 0.1);
            (Vec3::new(1.1, 1.4, 1.7 + 0.2 * s), Vec3::new(-0.8, 0.6, -1.2))
        }),
        CameraPath::moving(54.0, move |f| {
            let s = wave(f, 144.0, 0.2);
            (Vec3::new(-2.0, 1.1 + 0.15 * s, 1.7), Vec3::new(0.4, 0.6, -1.3))
        }),
        CameraPath::moving(56.0, move |f| {
            let s = wave(f, 112.0, 0.0);
            (Vec3::new(0.3, 1.9, 2.0), Vec3::new(-0.3 + 0.5 * s, 0.6, -1.2))
        }),
    ];
    scene
}
