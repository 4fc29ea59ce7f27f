//! `mirror-ball`: a ball of facets that turns, a wall of small tilted mirrors, a curtain of beads.

use super::SceneInfo;
use super::parts::{at, lamp, metal, plain, room, wave};
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Mesh, Scene, Surface};
use crate::shapes::{cuboid, cylinder, flat, merge, quad, rounded_box, transformed, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, EulerRot, Quat, Vec2, Vec3};
use std::f64::consts::TAU;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "mirror-ball",
    stresses: "hundreds of small mirrors, plane and curved, some turning; camera 5 whips",
    frames: 64,
    exposure: 1.8,
    cameras: 5,
};

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    let floor = scene.surface(Surface {
        material: plain([0.50, 0.36, 0.24], 0.35),
        pattern: Pattern::Tiles {
            joint: Vec3::new(0.16, 0.10, 0.06),
            cells: Vec2::new(12.0, 6.0),
            width: 0.03,
            variation: 0.25,
            shift: 0.5,
        },
        ..Default::default()
    });
    let walls = scene.surface(Surface {
        material: plain([0.50, 0.22, 0.26], 0.9),
        pattern: Pattern::Stripes { other: Vec3::new(0.40, 0.15, 0.19), count: 14.0 },
        ..Default::default()
    });
    let ceiling = scene.surface(plain([0.70, 0.70, 0.74], 0.9));
    room(&mut scene, [2.6, 2.8, 2.4], floor, walls, ceiling);
    lamp(&mut scene, [6.0, 5.8, 5.2], quad(Vec3::new(-1.6, 2.78, -0.4), Vec3::X * 0.9, Vec3::Z * 0.9));
    lamp(&mut scene, [4.0, 5.0, 7.0], quad(Vec3::new(0.8, 2.78, -0.9), Vec3::X * 0.9, Vec3::Z * 0.9));

    let mirror = scene.surface(metal([0.93, 0.93, 0.92], 0.0));
    scene.place_moving(
        flat(&uv_sphere(0.42, 26, 14)),
        mirror,
        Track::function(|frame| {
            let turn = Quat::from_rotation_y((TAU * frame / 160.0) as f32);
            Affine3A::from_rotation_translation(turn, Vec3::new(0.1, 1.65, -0.9))
        }),
    );
    let cord = scene.surface(plain([0.12, 0.12, 0.12], 0.8));
    scene.place(at(cylinder(0.01, 0.75, 8), [0.1, 2.05, -0.9]), cord);

    // Tiles on the wall, each tilted by up to six degrees.
    let tiles: Vec<Mesh> = (0..60)
        .map(|i| {
            let (column, row) = ((i % 10) as f32, (i / 10) as f32);
            let tilt = |k: f32| 0.2 * ((i as f32 * k).fract() - 0.5);
            let turn = Quat::from_euler(EulerRot::XYZ, tilt(0.618_034), tilt(0.754_877_7), 0.0);
            let place = Vec3::new(-1.8 + 0.26 * column, 0.45 + 0.26 * row, -2.36);
            let tile = rounded_box(Vec3::new(0.115, 0.115, 0.006), 0.004, 1);
            transformed(tile, Affine3A::from_rotation_translation(turn, place))
        })
        .collect();
    scene.place(merge(&tiles), mirror);

    // Beads on strings, in front of the wall on the right.
    let polished = scene.surface(metal([0.95, 0.78, 0.50], 0.04));
    let beads: Vec<Mesh> = (0..7)
        .flat_map(|string| {
            (0..14).map(move |bead| {
                let x = 1.2 + 0.14 * string as f32;
                at(uv_sphere(0.035, 20, 10), [x, 0.5 + 0.13 * bead as f32, -1.6 + 0.05 * (string % 2) as f32])
            })
        })
        .collect();
    scene.place(merge(&beads), polished);

    // What they show.
    let yellow = scene.surface(plain([0.75, 0.58, 0.10], 0.5));
    let blue = scene.surface(Surface {
        material: plain([0.06, 0.15, 0.50], 0.5),
        pattern: Pattern::Stripes { other: Vec3::new(0.70, 0.70, 0.66), count: 6.0 },
        ..Default::default()
    });
    let green = scene.surface(plain([0.10, 0.40, 0.16], 0.6));
    scene.place(at(cuboid(Vec3::new(-0.3, 0.0, -0.3), Vec3::new(0.3, 0.45, 0.3)), [-1.5, 0.0, -0.6]), yellow);
    scene.place(at(cylinder(0.2, 0.7, 48), [1.3, 0.0, 0.0]), blue);
    scene.place_moving(
        uv_sphere(0.22, 48, 24),
        green,
        Track::function(|frame| Affine3A::from_translation(Vec3::new(0.9 * wave(frame, 72.0, 0.0), 0.22, -0.2))),
    );

    scene.cameras = vec![
        CameraPath::moving(52.0, |f| (Vec3::new(0.2 + 0.5 * wave(f, 144.0, 0.0), 1.4, 2.1), Vec3::new(0.0, 1.2, -1.2))),
        CameraPath::moving(46.0, |f| {
            (Vec3::new(-1.6, 1.3 + 0.1 * wave(f, 128.0, 0.1), 1.6), Vec3::new(0.6, 1.2, -1.3))
        }),
        CameraPath::moving(46.0, |f| {
            (Vec3::new(1.8, 1.5, 1.5 + 0.2 * wave(f, 112.0, 0.2)), Vec3::new(-0.7, 1.1, -1.4))
        }),
        CameraPath::moving(54.0, |f| {
            (Vec3::new(-0.3, 1.2, 1.9), Vec3::new(0.2 + 0.5 * wave(f, 120.0, 0.0), 1.2, -1.2))
        }),
        CameraPath::moving(54.0, |f| (Vec3::new(0.0, 1.4, 2.0), Vec3::new(1.6 * wave(f, 24.0, 0.0), 1.2, -1.2))),
    ];
    scene
}
