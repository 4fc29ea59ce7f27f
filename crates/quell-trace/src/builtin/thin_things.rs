//! `thin-things`: a fence of wires, a cage, a wheel with spokes, a blind and grass, all thinner than a pixel somewhere.

use super::SceneInfo;
use super::parts::{at, bent, lamp, metal, plain, rod, room, wave};
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Mesh, Scene, Surface};
use crate::shapes::{cuboid, cylinder, flat, merge, quad, torus, transformed, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, Quat, Vec2, Vec3};
use std::f32::consts::TAU;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "thin-things",
    stresses: "wires, spokes, slats and blades of grass: pixels that mix surfaces; camera 5 whips",
    frames: 64,
    exposure: 1.0,
    cameras: 5,
};

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    let floor = scene.surface(Surface {
        material: plain([0.55, 0.45, 0.34], 0.5),
        pattern: Pattern::Tiles {
            joint: Vec3::new(0.20, 0.16, 0.12),
            cells: Vec2::new(8.0, 7.0),
            width: 0.04,
            variation: 0.2,
            shift: 0.5,
        },
        ..Default::default()
    });
    let walls = scene.surface(Surface {
        material: plain([0.62, 0.66, 0.70], 0.9),
        pattern: Pattern::Mottled { other: Vec3::new(0.50, 0.55, 0.60), scale: 3.0 },
        ..Default::default()
    });
    let ceiling = scene.surface(plain([0.82, 0.81, 0.78], 0.9));
    room(&mut scene, [2.6, 2.6, 2.4], floor, walls, ceiling);
    lamp(&mut scene, [7.0, 6.6, 6.0], quad(Vec3::new(-0.7, 2.58, -0.6), Vec3::X * 1.4, Vec3::Z * 1.0));
    // A bright pane behind a blind whose slats are a few millimetres thick.
    lamp(&mut scene, [11.0, 13.0, 16.0], quad(Vec3::new(-2.58, 0.9, 0.4), -Vec3::Z * 1.4, Vec3::Y * 1.1));
    let slats: Vec<Mesh> = (0..16)
        .map(|i| {
            let slat = cuboid(Vec3::new(-0.035, -0.002, -0.75), Vec3::new(0.035, 0.002, 0.75));
            let place = Vec3::new(-2.50, 0.93 + 0.07 * i as f32, -0.3);
            transformed(slat, Affine3A::from_rotation_translation(Quat::from_rotation_z(0.5), place))
        })
        .collect();
    let slat = scene.surface(plain([0.75, 0.72, 0.64], 0.6));
    scene.place(merge(&slats), slat);

    // A fence of crossed wires between two posts.
    let wire = scene.surface(metal([0.62, 0.63, 0.65], 0.3));
    let (left, right, top) = (-1.5, 0.4, 1.3);
    let wires: Vec<Mesh> = (0..24)
        .flat_map(|i| {
            let x = left + (right - left) * (i as f32 + 0.5) / 24.0;
            let lean = |to: f32| (x + to).clamp(left, right);
            let height = |to: f32| top * ((lean(to) - x) / to).abs();
            [0.9_f32, -0.9].map(|to| {
                rod(Vec3::new(x, 0.02, -0.7), Vec3::new(lean(to), 0.02 + height(to), -0.7 + 0.01 * to), 0.004)
            })
        })
        .collect();
    scene.place(merge(&wires), wire);
    let post = scene.surface(plain([0.30, 0.18, 0.10], 0.7));
    let rail = |y: f32| rod(Vec3::new(left, y, -0.7), Vec3::new(right, y, -0.7), 0.012);
    let posts = [at(cylinder(0.03, 1.4, 16), [left, 0.0, -0.7]), at(cylinder(0.03, 1.4, 16), [right, 0.0, -0.7])];
    scene.place(merge(&[rail(0.02), rail(top + 0.02), posts[0].clone(), posts[1].clone()]), post);

    // Behind it things with edges and colours.
    let red = scene.surface(plain([0.66, 0.10, 0.07], 0.4));
    let yellow = scene.surface(plain([0.72, 0.55, 0.10], 0.6));
    scene.place(at(uv_sphere(0.32, 64, 32), [-0.9, 0.32, -1.4]), red);
    scene.place(at(cuboid(Vec3::new(-0.25, 0.0, -0.25), Vec3::new(0.25, 0.9, 0.25)), [0.0, 0.0, -1.5]), yellow);

    // A wheel that turns by a third of the angle between its spokes in a frame.
    let rim = torus(0.42, 0.014, 64, 10);
    let spokes: Vec<Mesh> = (0..20)
        .map(|i| {
            let angle = TAU * i as f32 / 20.0;
            rod(Vec3::ZERO, Vec3::new(0.42 * angle.cos(), 0.0, 0.42 * angle.sin()), 0.004)
        })
        .collect();
    let wheel = merge(&[rim, flat(&merge(&spokes)), at(cylinder(0.03, 0.06, 16), [0.0, -0.03, 0.0])]);
    scene.place_moving(
        wheel,
        wire,
        Track::function(|frame| {
            let stand = Quat::from_rotation_y(-0.5) * Quat::from_rotation_x(TAU * 0.25);
            let turn = Quat::from_rotation_y((frame * f64::from(TAU) / 60.0) as f32);
            Affine3A::from_rotation_translation(stand * turn, Vec3::new(1.2, 0.5, -0.5))
        }),
    );
    scene.place(rod(Vec3::new(1.2, 0.0, -0.5), Vec3::new(1.2, 0.5, -0.5), 0.012), post);

    // A cage that hangs from the ceiling, and what sits in it.
    let bars: Vec<Mesh> = (0..18)
        .map(|i| {
            let angle = TAU * i as f32 / 18.0;
            let (x, z) = (0.2 * angle.cos(), 0.2 * angle.sin());
            rod(Vec3::new(x, -0.25, z), Vec3::new(0.6 * x, 0.25, 0.6 * z), 0.004)
        })
        .collect();
    let rings = [at(torus(0.2, 0.006, 48, 8), [0.0, -0.25, 0.0]), at(torus(0.12, 0.006, 48, 8), [0.0, 0.25, 0.0])];
    let hook = rod(Vec3::new(0.0, 0.25, 0.0), Vec3::new(0.0, 1.0, 0.0), 0.003);
    let brass = scene.surface(metal([0.85, 0.62, 0.30], 0.2));
    let hang = |frame: f64| {
        let swing = Quat::from_rotation_z(0.08 * wave(frame, 72.0, 0.0));
        Affine3A::from_rotation_translation(swing, Vec3::new(-0.3, 1.6, 0.1))
    };
    scene.place_moving(merge(&[flat(&merge(&bars)), merge(&rings), flat(&hook)]), brass, Track::function(hang));
    scene.place_moving(at(uv_sphere(0.07, 32, 16), [0.0, -0.17, 0.0]), yellow, Track::function(hang));

    // Grass in a box, which the wind bends.
    let blades: Vec<Mesh> = (0..140)
        .map(|i| {
            let even = |k: f32| (i as f32 * k).fract();
            let (x, z) = (1.1 * (even(0.618_034) - 0.5), 0.3 * (even(0.754_877_7) - 0.5));
            let (height, turn) = (0.18 + 0.16 * even(0.569_840_3), TAU * even(0.381_966));
            let side = Vec3::new(turn.cos(), 0.0, turn.sin()) * 0.006;
            let root = Vec3::new(x, 0.0, z);
            let normal = side.cross(Vec3::Y).normalize_or(Vec3::Z);
            let tip = root + Vec3::new(0.05 * turn.sin(), height, 0.05 * turn.cos());
            let middle = root + Vec3::new(0.0, 0.6 * height, 0.0);
            Mesh {
                positions: vec![root - side, root + side, middle + side * 0.7, middle - side * 0.7, tip],
                normals: vec![normal; 5],
                uvs: vec![Vec2::ZERO; 5],
                triangles: vec![[0, 1, 2], [0, 2, 3], [3, 2, 4]],
                ..Default::default()
            }
        })
        .collect();
    let green = scene.surface(plain([0.12, 0.34, 0.06], 0.5));
    let blow = |frame: f64, p: Vec3| {
        let reach = 6.0 * p.y * p.y;
        p + Vec3::new(0.10 * wave(frame, 40.0, 0.3 * f64::from(p.x)), 0.0, 0.04 * wave(frame, 28.0, 0.0)) * reach
    };
    let place = Affine3A::from_translation(Vec3::new(0.9, 0.2, 0.5));
    scene.place_moving(bent(merge(&blades), blow), green, place);
    let planter = cuboid(Vec3::new(-0.6, 0.0, -0.2), Vec3::new(0.6, 0.2, 0.2));
    scene.place(at(planter, [0.9, 0.0, 0.5]), post);

    scene.cameras = vec![
        CameraPath::moving(50.0, |f| {
            (Vec3::new(0.3 + 0.5 * wave(f, 144.0, 0.0), 1.2, 2.1), Vec3::new(-0.1, 0.8, -0.8))
        }),
        CameraPath::moving(48.0, |f| (Vec3::new(1.8, 1.3 + 0.1 * wave(f, 96.0, 0.1), 1.6), Vec3::new(-0.7, 0.7, -0.8))),
        CameraPath::moving(44.0, |f| {
            (Vec3::new(-1.7, 1.2, 1.9 + 0.2 * wave(f, 128.0, 0.2)), Vec3::new(0.7, 0.7, -0.7))
        }),
        CameraPath::moving(54.0, |f| (Vec3::new(0.0, 1.5, 2.0), Vec3::new(0.1 + 0.6 * wave(f, 112.0, 0.0), 0.8, -1.0))),
        CameraPath::moving(52.0, |f| (Vec3::new(0.0, 1.3, 2.0), Vec3::new(1.6 * wave(f, 24.0, 0.0), 0.8, -1.0))),
    ];
    scene
}
