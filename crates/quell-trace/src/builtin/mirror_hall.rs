//! `mirror-hall`: a gallery of plane and curved mirrors, lit from coves, under a moving camera.

use super::SceneInfo;
use crate::material::Material;
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Mesh, Scene, Surface};
use crate::shapes::{cuboid, cylinder, lathe, merge, quad, rounded_box, torus, transformed, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, Quat, Vec2, Vec3};
use std::f64::consts::TAU;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "mirror-hall",
    stresses: "plane and curved mirrors under a moving camera: virtual reprojection of glossy history",
    frames: 64,
    exposure: 1.0,
    cameras: 5,
};

/// Half width, height and half depth of the hall.
const X: f32 = 3.2;
const Y: f32 = 3.2;
const Z: f32 = 4.0;

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
    let metal = |r: f32, g: f32, b: f32, roughness: f32| Material { metallic: 1.0, ..plain(r, g, b, roughness) };
    let painted = |material: Material, pattern: Pattern| Surface { material, pattern, ..Default::default() };

    let floor = scene.surface(painted(
        plain(0.72, 0.68, 0.60, 0.45),
        Pattern::Checker { other: Vec3::new(0.16, 0.05, 0.06), cells: Vec2::new(10.0, 12.0) },
    ));
    let wall = scene.surface(painted(
        plain(0.42, 0.55, 0.42, 0.85),
        Pattern::Stripes { other: Vec3::new(0.30, 0.44, 0.32), count: 24.0 },
    ));
    let end_wall = scene.surface(painted(
        plain(0.72, 0.50, 0.20, 0.85),
        Pattern::Mottled { other: Vec3::new(0.60, 0.38, 0.13), scale: 2.5 },
    ));
    let ceiling = scene.surface(plain(0.82, 0.81, 0.78, 0.9));
    let plinth = scene.surface(painted(
        plain(0.80, 0.78, 0.74, 0.4),
        Pattern::Marble { vein: Vec3::new(0.18, 0.18, 0.22), scale: 3.0 },
    ));
    let clear_mirror = scene.surface(metal(0.94, 0.94, 0.93, 0.0));
    let polished = scene.surface(metal(0.92, 0.92, 0.92, 0.06));
    let satin = scene.surface(metal(0.90, 0.88, 0.84, 0.16));
    let gold = scene.surface(metal(0.95, 0.70, 0.32, 0.12));
    let frame = scene.surface(metal(0.72, 0.48, 0.18, 0.35));
    let red = scene.surface(plain(0.65, 0.07, 0.05, 0.5));
    let blue = scene.surface(painted(
        plain(0.05, 0.13, 0.45, 0.45),
        Pattern::Stripes { other: Vec3::new(0.75, 0.72, 0.65), count: 8.0 },
    ));

    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    scene.place(quad(Vec3::new(-X, 0.0, Z), x * 2.0 * X, -z * 2.0 * Z), floor);
    scene.place(quad(Vec3::new(-X, Y, -Z), x * 2.0 * X, z * 2.0 * Z), ceiling);
    scene.place(quad(Vec3::new(-X, 0.0, -Z), x * 2.0 * X, y * Y), end_wall);
    scene.place(quad(Vec3::new(X, 0.0, Z), -x * 2.0 * X, y * Y), end_wall);
    scene.place(quad(Vec3::new(-X, 0.0, Z), -z * 2.0 * Z, y * Y), wall);
    scene.place(quad(Vec3::new(X, 0.0, -Z), z * 2.0 * Z, y * Y), wall);
    // Coves along both side walls: a ledge hides a strip that shines at the ceiling, warm on one side, cool on the
    // other.
    for (side, radiance) in [(-1.0_f32, Vec3::new(44.0, 30.0, 18.0)), (1.0, Vec3::new(19.0, 25.0, 36.0))] {
        let strip = scene.surface(Material { base_color: Vec3::ZERO, emission: radiance, ..Material::default() });
        let inner = side * (X - 0.32);
        let low = Vec3::new(inner.min(side * X), 2.55, -Z);
        let high = Vec3::new(inner.max(side * X), 2.60, Z);
        let lip = cuboid(Vec3::new(inner - 0.02, 2.55, -Z), Vec3::new(inner + 0.02, 2.70, Z));
        scene.place(merge(&[cuboid(low, high), lip]), ceiling);
        let x0 = side * (X - 0.16) - 0.05;
        scene.place(quad(Vec3::new(x0, 2.61, 3.6), x * 0.1, -z * 7.2), strip);
    }

    // A laylight: large and soft, so that light reaches nearly every bounce.
    let laylight =
        scene.surface(Material { base_color: Vec3::ZERO, emission: Vec3::new(4.6, 4.4, 4.0), ..Material::default() });
    scene.place(quad(Vec3::new(-1.3, Y - 0.02, -2.6), x * 2.6, z * 5.2), laylight);

    // Framed mirrors: panels a little before the walls, of three finishes.
    let panel = |scene: &mut Scene, finish: usize, centre: Vec3, size: Vec2, degrees: f32, tilt: f32| {
        let place = Affine3A::from_rotation_translation(
            Quat::from_rotation_y(degrees.to_radians()) * Quat::from_rotation_x(tilt.to_radians()),
            centre,
        );
        let (w, h) = (size.x * 0.5, size.y * 0.5);
        scene.place_moving(quad(Vec3::new(-w, -h, 0.0), x * size.x, y * size.y), finish, place);
        let bar =
            |bx: f32, by: f32, px: f32, py: f32| at(rounded_box(Vec3::new(bx, by, 0.03), 0.012, 2), px, py, -0.01);
        let border = merge(&[
            bar(w + 0.05, 0.025, 0.0, h + 0.025),
            bar(w + 0.05, 0.025, 0.0, -h - 0.025),
            bar(0.025, h, w + 0.025, 0.0),
            bar(0.025, h, -w - 0.025, 0.0),
        ]);
        scene.place_moving(border, frame, place);
    };
    panel(&mut scene, clear_mirror, Vec3::new(0.0, 1.35, -Z + 0.06), Vec2::new(2.2, 1.9), 0.0, 0.0);
    panel(&mut scene, polished, Vec3::new(-X + 0.06, 1.35, -1.7), Vec2::new(1.7, 1.8), 90.0, 0.0);
    panel(&mut scene, satin, Vec3::new(X - 0.06, 1.35, -1.7), Vec2::new(1.7, 1.8), -90.0, 0.0);
    panel(&mut scene, clear_mirror, Vec3::new(X - 0.20, 1.4, 1.1), Vec2::new(1.3, 1.8), -90.0, 6.0);
    panel(&mut scene, clear_mirror, Vec3::new(0.0, 1.4, Z - 0.06), Vec2::new(2.0, 1.8), 180.0, 0.0);

    // Curved mirrors on plinths.
    let pedestal = |px: f32, pz: f32, h: f32| at(rounded_box(Vec3::new(0.24, h * 0.5, 0.24), 0.02, 2), px, h * 0.5, pz);
    scene.place(merge(&[pedestal(-1.25, -1.4, 0.62), pedestal(1.25, -1.2, 0.62), pedestal(0.0, -2.7, 0.4)]), plinth);
    scene.place(at(uv_sphere(0.36, 128, 64), -1.25, 0.98, -1.4), clear_mirror);
    let profile: Vec<Vec2> = (0..=48)
        .map(|i| {
            let h = i as f32 / 48.0;
            Vec2::new(0.13 + 0.09 * (h * 9.0).sin() * (1.0 - h) + 0.05 * (1.0 - h), 0.9 * h)
        })
        .collect();
    scene.place(at(lathe(&profile, 96, true), 1.25, 0.62, -1.2), gold);
    // A bent sheet, concave towards the hall.
    let bent: Vec<Mesh> = (0..40)
        .map(|i| {
            let angle = |k: i32| (k as f32 / 40.0 - 0.5) * 1.6;
            let p = |a: f32| Vec3::new(0.75 * a.sin(), 0.0, -0.75 * a.cos());
            let (a, b) = (p(angle(i)), p(angle(i + 1)));
            let mut piece = quad(a, b - a, y * 1.3);
            let (na, nb) = (-a.normalize(), -b.normalize());
            piece.normals = vec![na, nb, nb, na];
            piece
        })
        .collect();
    scene.place(at(merge(&bent), 0.0, 0.45, -2.35), polished);

    // Things to be reflected, some of them moving.
    scene.place(at(cylinder(0.16, 0.5, 48), -2.1, 0.0, 0.4), red);
    scene.place(at(cylinder(0.12, 0.8, 48), 2.2, 0.0, -0.2), blue);
    let hub = Vec3::new(0.0, 1.45, -1.2);
    scene.place_moving(
        torus(0.3, 0.075, 64, 24),
        red,
        Track::function(move |frame| {
            let turn = Quat::from_rotation_y((TAU * frame / 80.0) as f32);
            Affine3A::from_rotation_translation(turn * Quat::from_rotation_x(1.2), hub)
        }),
    );
    scene.place(at(cylinder(0.01, Y - 1.75, 8), hub.x, 1.75, hub.z), frame);
    scene.place_moving(
        uv_sphere(0.2, 64, 32),
        blue,
        Track::function(|frame| {
            let z = -0.4 + 1.2 * (TAU * (frame / 96.0 + 0.1)).sin() as f32;
            Affine3A::from_rotation_translation(Quat::from_rotation_x((z + 0.4) / 0.2), Vec3::new(0.55, 0.2, z))
        }),
    );
    // A mirror that turns: a revolving panel.
    let revolving = scene.surface(metal(0.93, 0.93, 0.94, 0.0));
    scene.place_moving(
        rounded_box(Vec3::new(0.36, 0.55, 0.012), 0.01, 2),
        revolving,
        Track::function(|frame| {
            let turn = Quat::from_rotation_y(0.6 + 0.5 * (TAU * frame / 72.0).sin() as f32);
            Affine3A::from_rotation_translation(turn, Vec3::new(-2.15, 0.95, -0.2))
        }),
    );

    let wave = |frame: f64, period: f64, phase: f64| (TAU * (frame / period + phase)).sin() as f32;
    scene.cameras = vec![
        CameraPath::moving(52.0, move |f| {
            let s = wave(f, 144.0, 0.0);
            (Vec3::new(0.2 + 0.7 * s, 1.5, 2.5 + 0.2 * s), Vec3::new(0.0, 1.05, -2.0))
        }),
        CameraPath::moving(50.0, move |f| {
            let s = wave(f, 160.0, 0.1);
            (Vec3::new(1.9, 1.3 + 0.1 * s, 1.4 - 0.8 * s), Vec3::new(-1.8, 0.95, -1.5))
        }),
        CameraPath::moving(48.0, move |f| {
            let s = wave(f, 128.0, 0.2);
            (Vec3::new(-1.9, 1.6, 1.6 + 0.3 * s), Vec3::new(1.5 + 0.3 * s, 1.0, -1.0))
        }),
        CameraPath::moving(45.0, move |f| {
            let s = wave(f, 176.0, 0.0);
            (Vec3::new(0.8 * s, 1.15, 1.2), Vec3::new(-0.1 * s, 1.15, -3.0))
        }),
        CameraPath::moving(58.0, move |f| {
            let s = wave(f, 112.0, 0.15);
            (Vec3::new(-0.3, 2.2, 2.9), Vec3::new(0.6 * s, 0.8, -1.2))
        }),
    ];
    scene
}
