//! `moving-lamps`: a lantern that swings, a lamp that travels behind a parapet, one that pulses; most of it lights by bounces.

use super::SceneInfo;
use super::parts::{at, lamp, metal, plain, rod, room, wave};
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Scene, Surface};
use crate::shapes::{cuboid, cylinder, lathe, merge, quad, rounded_box, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, Quat, Vec2, Vec3};

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "moving-lamps",
    stresses: "lamps that swing, travel and pulse: shadows and bounce light that move; camera 5 whips",
    frames: 64,
    exposure: 1.6,
    cameras: 5,
};

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    let floor = scene.surface(Surface {
        material: plain([0.58, 0.52, 0.44], 0.25),
        pattern: Pattern::Checker { other: Vec3::new(0.30, 0.26, 0.22), cells: Vec2::new(10.0, 9.0) },
        ..Default::default()
    });
    let walls = scene.surface(plain([0.74, 0.70, 0.64], 0.9));
    let ceiling = scene.surface(plain([0.82, 0.81, 0.78], 0.9));
    room(&mut scene, [2.8, 2.6, 2.4], floor, walls, ceiling);

    // The lantern: a bright bulb in a shade that leaves it open below and a slit above.
    let pivot = Vec3::new(-0.4, 2.5, -0.7);
    let hang = move |frame: f64| {
        Affine3A::from_rotation_translation(Quat::from_rotation_z(0.6 * wave(frame, 64.0, 0.0)), pivot)
    };
    let bulb = lamp(&mut scene, [150.0, 112.0, 70.0], at(uv_sphere(0.05, 32, 16), [0.0, -1.0, 0.0]));
    scene.instances[bulb].transform = Track::function(hang);
    let shade = scene.surface(plain([0.60, 0.20, 0.12], 0.7));
    let profile = [Vec2::new(0.24, -1.06), Vec2::new(0.09, -0.86), Vec2::new(0.085, -0.86), Vec2::new(0.23, -1.06)];
    scene.place_moving(lathe(&profile, 48, false), shade, Track::function(hang));
    let cord = scene.surface(plain([0.10, 0.10, 0.10], 0.8));
    scene.place_moving(rod(Vec3::new(0.0, -0.9, 0.0), Vec3::ZERO, 0.006), cord, Track::function(hang));

    // A strip that travels along the wall behind a parapet and shines at the ceiling only.
    let parapet = scene.surface(plain([0.45, 0.52, 0.60], 0.8));
    scene.place(cuboid(Vec3::new(-2.8, 1.75, -2.16), Vec3::new(2.8, 1.95, -2.12)), parapet);
    scene.place(cuboid(Vec3::new(-2.8, 1.73, -2.4), Vec3::new(2.8, 1.75, -2.12)), parapet);
    let strip = lamp(&mut scene, [34.0, 46.0, 64.0], quad(Vec3::new(-0.35, 0.0, 0.06), Vec3::X * 0.7, -Vec3::Z * 0.12));
    scene.instances[strip].transform =
        Track::function(|frame| Affine3A::from_translation(Vec3::new(1.9 * wave(frame, 80.0, 0.1), 1.80, -2.28)));

    // A panel that pulses, to the right, behind a screen.
    let pulse = lamp(&mut scene, [20.0, 7.0, 9.0], quad(Vec3::new(2.78, 0.3, -0.9), Vec3::Z * 0.8, Vec3::Y * 0.8));
    scene.instances[pulse].emission_scale = Track::function(|frame| {
        let bright = 0.5 + 0.5 * wave(frame, 36.0, 0.0);
        bright * bright
    });
    let screen = scene.surface(plain([0.60, 0.62, 0.50], 0.85));
    scene.place(cuboid(Vec3::new(2.2, 0.0, -1.1), Vec3::new(2.24, 1.3, 0.1)), screen);

    // What casts shadows, and what reflects.
    let column = scene.surface(Surface {
        material: plain([0.72, 0.70, 0.66], 0.5),
        pattern: Pattern::Marble { vein: Vec3::new(0.35, 0.34, 0.36), scale: 3.0 },
        ..Default::default()
    });
    let columns = [-1.7_f32, -0.6, 0.6, 1.7].map(|x| at(cylinder(0.09, 1.3, 32), [x, 0.0, -1.5]));
    scene.place(merge(&columns), column);
    let blue = scene.surface(plain([0.12, 0.22, 0.50], 0.5));
    let crate_box = at(rounded_box(Vec3::new(0.3, 0.25, 0.25), 0.02, 2), [0.9, 0.25, -0.5]);
    scene.place(crate_box, blue);
    let gold = scene.surface(metal([0.95, 0.70, 0.32], 0.15));
    scene.place(at(uv_sphere(0.24, 64, 32), [-1.2, 0.24, -0.3]), gold);
    let green = scene.surface(plain([0.16, 0.40, 0.18], 0.7));
    scene.place(at(cuboid(Vec3::splat(-0.14), Vec3::splat(0.14)), [0.1, 0.14, 0.2]), green);

    scene.cameras = vec![
        CameraPath::fixed(Vec3::new(0.2, 1.3, 2.1), Vec3::new(0.0, 0.9, -1.2), 54.0),
        CameraPath::moving(52.0, |f| {
            (Vec3::new(-0.6 + 0.6 * wave(f, 144.0, 0.0), 1.2, 2.1), Vec3::new(0.1, 0.8, -1.2))
        }),
        CameraPath::moving(50.0, |f| {
            (Vec3::new(1.7, 1.4, 1.8 + 0.2 * wave(f, 128.0, 0.1)), Vec3::new(-0.6, 0.7, -1.0))
        }),
        CameraPath::moving(54.0, |f| (Vec3::new(-2.0, 1.3 + 0.1 * wave(f, 96.0, 0.2), 1.8), Vec3::new(0.5, 0.7, -1.0))),
        CameraPath::moving(54.0, |f| (Vec3::new(0.0, 1.3, 2.1), Vec3::new(1.6 * wave(f, 24.0, 0.0), 0.8, -1.2))),
    ];
    scene
}
