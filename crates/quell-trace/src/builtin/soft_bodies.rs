//! `soft-bodies`: cloth in the wind, an arm that bends as a skin does, a body that changes its shape, one that is squashed.

use super::SceneInfo;
use super::parts::{at, bent, lamp, metal, plain, rod, room, wave};
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Scene, Surface};
use crate::shapes::{cuboid, flip, grid, lathe, merge, quad, rounded_box, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, Quat, Vec2, Vec3};

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "soft-bodies",
    stresses: "surfaces that deform: cloth, a bending arm, a changing shape; camera 5 whips",
    frames: 64,
    exposure: 1.0,
    cameras: 5,
};

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    let floor = scene.surface(Surface {
        material: plain([0.46, 0.44, 0.42], 0.3),
        pattern: Pattern::Checker { other: Vec3::new(0.62, 0.60, 0.56), cells: Vec2::new(10.0, 9.0) },
        ..Default::default()
    });
    let walls = scene.surface(plain([0.58, 0.66, 0.62], 0.9));
    let ceiling = scene.surface(plain([0.82, 0.81, 0.78], 0.9));
    room(&mut scene, [2.6, 2.6, 2.4], floor, walls, ceiling);
    lamp(&mut scene, [9.0, 8.4, 7.4], quad(Vec3::new(-0.3, 2.58, -0.6), Vec3::X * 1.2, Vec3::Z * 1.0));
    lamp(&mut scene, [9.0, 11.0, 15.0], quad(Vec3::new(-2.58, 0.8, 0.3), -Vec3::Z * 1.0, Vec3::Y * 1.0));

    // A flag at a pole: free at its far end. Two sheets, so that both sides have a front.
    let cloth = scene.surface(Surface {
        material: plain([0.70, 0.14, 0.10], 0.8),
        pattern: Pattern::Stripes { other: Vec3::new(0.78, 0.74, 0.66), count: 3.0 },
        ..Default::default()
    });
    let sheet = grid(Vec3::new(0.0, -0.35, 0.0), Vec3::X * 1.2, Vec3::Y * 0.7, 40, 20);
    let mut back = sheet.clone();
    flip(&mut back);
    back.normals.iter_mut().for_each(|n| *n = -*n);
    let flutter = |frame: f64, p: Vec3| {
        let ripple = wave(frame, 28.0, -1.1 * f64::from(p.x) - 0.15 * f64::from(p.y));
        p + Vec3::new(-0.06 * p.x, -0.12 * p.x * p.x, 0.14 * p.x * ripple)
    };
    let pole = Vec3::new(-1.5, 1.5, -1.2);
    let turn = Quat::from_rotation_y(-0.25);
    for side in [sheet, back] {
        scene.place_moving(bent(side, flutter), cloth, Affine3A::from_rotation_translation(turn, pole));
    }
    let wood = scene.surface(plain([0.34, 0.20, 0.10], 0.5));
    scene.place(rod(Vec3::new(pole.x, 0.0, pole.z), Vec3::new(pole.x, 1.95, pole.z), 0.025), wood);

    // An arm that sways: each height turns by its own angle, as joints along it would have it.
    let profile: Vec<Vec2> = std::iter::once(Vec2::ZERO)
        .chain((0..=40).map(|i| {
            let s = i as f32 / 40.0;
            Vec2::new((0.15 - 0.10 * s) * (1.0 - s.powi(8)).max(0.0).sqrt(), 1.2 * s)
        }))
        .collect();
    let sway = |frame: f64, p: Vec3| {
        // An arc of the length of the arm up to this height.
        let bend = 0.9 * wave(frame, 48.0, 0.0);
        let angle = bend * p.y / 1.2;
        let (sine, cosine) = angle.sin_cos();
        let spine = if bend.abs() < 1e-3 {
            Vec3::new(0.0, p.y, 0.0)
        } else {
            Vec3::new((1.0 - cosine) * 1.2 / bend, sine * 1.2 / bend, 0.0)
        };
        spine + Vec3::new(p.x * cosine, -p.x * sine, p.z)
    };
    let purple = scene.surface(Surface {
        material: plain([0.36, 0.16, 0.42], 0.3),
        pattern: Pattern::Mottled { other: Vec3::new(0.62, 0.40, 0.50), scale: 6.0 },
        ..Default::default()
    });
    let place = Affine3A::from_translation(Vec3::new(1.0, 0.0, -0.9));
    scene.place_moving(bent(lathe(&profile, 40, true), sway), purple, place);

    // A body between two shapes, glossy.
    let bronze = scene.surface(metal([0.80, 0.55, 0.36], 0.18));
    let morph = |frame: f64, p: Vec3| {
        let share = 0.5 + 0.5 * wave(frame, 40.0, 0.25);
        let lobes = 1.0 + 0.7 * share * p.x * p.z / 0.09;
        Vec3::new(p.x * lobes, p.y * (1.0 - 0.25 * share), p.z * lobes)
    };
    let place = Affine3A::from_translation(Vec3::new(-0.1, 0.33, -0.3));
    scene.place_moving(bent(uv_sphere(0.3, 64, 32), morph), bronze, place);

    // A box that hops and is squashed where it lands.
    let ochre = scene.surface(plain([0.74, 0.52, 0.14], 0.5));
    scene.place_moving(
        rounded_box(Vec3::splat(0.2), 0.05, 3),
        ochre,
        Track::function(|frame| {
            let up = wave(frame, 64.0, 0.0).abs();
            let flat = 1.0 + 0.35 * (1.0 - up).powi(4);
            let height = 0.2 / flat + 0.6 * up;
            Affine3A::from_scale_rotation_translation(
                Vec3::new(flat.sqrt(), 1.0 / flat, flat.sqrt()),
                Quat::from_rotation_y(0.5),
                Vec3::new(-1.2, height, 0.1),
            )
        }),
    );
    let bench = [
        cuboid(Vec3::new(1.6, 0.0, -2.0), Vec3::new(2.4, 0.5, -1.4)),
        cuboid(Vec3::new(1.7, 0.5, -1.9), Vec3::new(2.1, 0.9, -1.5)),
    ];
    scene.place(merge(&bench), wood);
    let blue = scene.surface(plain([0.12, 0.24, 0.52], 0.4));
    scene.place(at(uv_sphere(0.25, 48, 24), [0.6, 0.25, 0.5]), blue);

    scene.cameras = vec![
        CameraPath::fixed(Vec3::new(0.1, 1.3, 2.1), Vec3::new(-0.1, 0.8, -0.9), 52.0),
        CameraPath::moving(50.0, |f| {
            (Vec3::new(0.4 + 0.5 * wave(f, 144.0, 0.0), 1.2, 2.1), Vec3::new(-0.1, 0.8, -0.9))
        }),
        CameraPath::moving(48.0, |f| {
            (Vec3::new(1.9, 1.2, 1.5 + 0.2 * wave(f, 128.0, 0.1)), Vec3::new(-0.5, 0.8, -0.8))
        }),
        CameraPath::moving(50.0, |f| (Vec3::new(-1.9, 1.4 + 0.1 * wave(f, 96.0, 0.2), 1.7), Vec3::new(0.3, 0.7, -0.7))),
        CameraPath::moving(54.0, |f| (Vec3::new(0.0, 1.3, 2.1), Vec3::new(1.6 * wave(f, 24.0, 0.0), 0.8, -1.0))),
    ];
    scene
}
