//! `disocclusion`: fast things before a textured wall that is lit by bounces only.

use super::SceneInfo;
use crate::material::Material;
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Mesh, Scene, Surface};
use crate::shapes::{cuboid, cylinder, merge, quad, rounded_box, transformed, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, Quat, Vec2, Vec3};
use std::f64::consts::TAU;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "disocclusion",
    stresses: "fast occluders before a textured wall that is lit by bounces only",
    frames: 64,
    exposure: 1.0,
    cameras: 5,
};

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
    let brick = scene.surface(Surface {
        material: plain(0.62, 0.30, 0.19, 0.85),
        pattern: Pattern::Tiles {
            joint: Vec3::new(0.60, 0.56, 0.49),
            cells: Vec2::new(20.0, 30.0),
            width: 0.06,
            variation: 0.8,
            shift: 0.5,
        },
        ..Default::default()
    });
    let tiles = scene.surface(Surface {
        material: plain(0.50, 0.52, 0.50, 0.3),
        pattern: Pattern::Tiles {
            joint: Vec3::new(0.22, 0.21, 0.20),
            cells: Vec2::new(12.0, 10.0),
            width: 0.035,
            variation: 0.5,
            shift: 0.0,
        },
        ..Default::default()
    });
    let plaster = scene.surface(Surface {
        material: plain(0.80, 0.78, 0.72, 0.9),
        pattern: Pattern::Mottled { other: Vec3::new(0.72, 0.69, 0.62), scale: 2.0 },
        ..Default::default()
    });
    let sage = scene.surface(plain(0.36, 0.46, 0.36, 0.85));
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let (w, h, d) = (3.0_f32, 2.6_f32, 2.4_f32);
    scene.place(quad(Vec3::new(-w, 0.0, d), x * 2.0 * w, -z * 2.0 * d), tiles);
    scene.place(quad(Vec3::new(-w, h, -d), x * 2.0 * w, z * 2.0 * d), plaster);
    scene.place(quad(Vec3::new(-w, 0.0, -d), x * 2.0 * w, y * h), brick);
    scene.place(quad(Vec3::new(w, 0.0, d), -x * 2.0 * w, y * h), plaster);
    scene.place(quad(Vec3::new(-w, 0.0, d), -z * 2.0 * d, y * h), sage);
    scene.place(quad(Vec3::new(w, 0.0, -d), z * 2.0 * d, y * h), sage);
    // A luminous band in the plane of the brick wall: it lights all the room but that wall, which sees bounces only.
    let lamp =
        scene.surface(Material { base_color: Vec3::ZERO, emission: Vec3::new(13.0, 11.0, 8.5), ..Material::default() });
    scene.place(quad(Vec3::new(-2.8, h - 0.32, -d + 0.004), x * 5.6, y * 0.3), lamp);
    // Pictures on the wall.
    for (k, px) in [-1.9_f32, -0.25, 1.35].into_iter().enumerate() {
        let canvas = scene.surface(Surface {
            material: plain(0.75, 0.70, 0.58, 0.8),
            pattern: Pattern::Picture {
                colors: [Vec3::new(0.62, 0.16, 0.08), Vec3::new(0.08, 0.20, 0.34), Vec3::new(0.70, 0.48, 0.12)],
                seed: 3 + 2 * k as u32,
            },
            ..Default::default()
        });
        scene.place(quad(Vec3::new(px, 1.0, -d + 0.03), x * 0.85, y * 0.95), canvas);
    }
    // Still things to cast contact shadows.
    let bench = scene.surface(Surface {
        material: plain(0.40, 0.22, 0.11, 0.45),
        pattern: Pattern::Wood { dark: Vec3::new(0.17, 0.08, 0.04), rings: 16.0 },
        ..Default::default()
    });
    let seat = rounded_box(Vec3::new(0.22, 0.04, 0.9), 0.02, 2);
    let across = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    scene.place_moving(seat, bench, Affine3A::from_rotation_translation(across, Vec3::new(0.3, 0.44, -1.9)));
    scene.place(
        merge(&[at(cuboid(Vec3::new(-0.03, 0.0, -0.18), Vec3::new(0.03, 0.4, 0.18)), -0.4, 0.0, -1.9), {
            at(cuboid(Vec3::new(-0.03, 0.0, -0.18), Vec3::new(0.03, 0.4, 0.18)), 1.0, 0.0, -1.9)
        }]),
        bench,
    );

    // The occluders: a post that rushes to and fro, a wheel of bars, and a ball that bounces.
    let teal = scene.surface(plain(0.06, 0.36, 0.38, 0.5));
    let orange = scene.surface(plain(0.72, 0.27, 0.04, 0.5));
    scene.place_moving(
        merge(&[cylinder(0.13, 2.1, 32), at(rounded_box(Vec3::new(0.3, 0.06, 0.3), 0.03, 2), 0.0, 0.06, 0.0)]),
        orange,
        Track::function(|frame| {
            // A triangle wave: constant speed, two sudden turns a cycle.
            let phase = (frame / 32.0).rem_euclid(1.0);
            let s = if phase < 0.5 { 4.0 * phase - 1.0 } else { 3.0 - 4.0 * phase };
            Affine3A::from_translation(Vec3::new(2.1 * s as f32, 0.0, -0.6))
        }),
    );
    let spokes: Vec<Mesh> = (0..3)
        .map(|k| {
            let turn = Quat::from_rotation_z(std::f32::consts::PI / 3.0 * k as f32);
            transformed(rounded_box(Vec3::new(0.8, 0.045, 0.02), 0.015, 2), Affine3A::from_quat(turn))
        })
        .collect();
    scene.place_moving(
        merge(&spokes),
        teal,
        Track::function(|frame| {
            let turn = Quat::from_rotation_z((TAU * frame / 40.0) as f32);
            Affine3A::from_rotation_translation(turn, Vec3::new(1.45, 1.25, -1.2))
        }),
    );
    let ball = scene.surface(Surface {
        material: plain(0.75, 0.73, 0.68, 0.35),
        pattern: Pattern::Stripes { other: Vec3::new(0.10, 0.15, 0.40), count: 5.0 },
        ..Default::default()
    });
    scene.place_moving(
        uv_sphere(0.2, 48, 24),
        ball,
        Track::function(|frame| {
            let phase = (frame / 18.0).rem_euclid(1.0) as f32;
            let height = 0.2 + 3.6 * phase * (1.0 - phase);
            let spin = Quat::from_rotation_z((-TAU * frame / 30.0) as f32);
            let x = -1.3 + 0.5 * (TAU * frame / 72.0).sin() as f32;
            Affine3A::from_rotation_translation(spin, Vec3::new(x, height, -1.1))
        }),
    );

    let wave = |frame: f64, period: f64, phase: f64| (TAU * (frame / period + phase)).sin() as f32;
    scene.cameras = vec![
        CameraPath::fixed(Vec3::new(0.1, 1.35, 2.2), Vec3::new(0.0, 1.1, -2.0), 46.0),
        CameraPath::moving(48.0, move |f| {
            let s = wave(f, 96.0, 0.0);
            (Vec3::new(1.1 * s, 1.3, 2.1), Vec3::new(0.2 * s, 1.1, -2.0))
        }),
        CameraPath::moving(44.0, move |f| {
            let s = wave(f, 128.0, 0.1);
            (Vec3::new(-1.9, 1.5, 1.6 + 0.4 * s), Vec3::new(0.6, 1.0, -1.8))
        }),
        CameraPath::moving(50.0, move |f| {
            let s = wave(f, 80.0, 0.2);
            (Vec3::new(1.8, 0.9 + 0.3 * s, 1.7), Vec3::new(-0.5, 1.0, -1.8))
        }),
        CameraPath::moving(52.0, move |f| {
            let s = wave(f, 64.0, 0.05);
            (Vec3::new(0.0, 1.8, 2.1), Vec3::new(0.8 * s, 0.9, -1.8))
        }),
    ];
    scene
}
