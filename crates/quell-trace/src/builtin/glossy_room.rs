//! `glossy-room`: an evening room with a polished floor, a warm uplighter and cool light from a window; the demo.
//!
//! The uplighter hides its lamp in a bowl and the window's sky is a small panel, so that nearly all that is seen is lit
//! by the ceiling, the floor and the walls. A striped ball rolls, the leaves of a plant sway, a sculpture turns.

use super::SceneInfo;
use crate::material::Material;
use crate::pattern::Pattern;
use crate::scene::{CameraPath, Mesh, Scene, Surface};
use crate::shapes::{cuboid, cylinder, grid, lathe, merge, quad, rounded_box, torus, transformed, uv_sphere};
use crate::track::Track;
use glam::{Affine3A, EulerRot, Quat, Vec2, Vec3};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const INFO: SceneInfo = SceneInfo {
    name: "glossy-room",
    stresses: "glossy floor, moving objects, moving camera, light that comes from walls and ceiling: the demo",
    frames: 64,
    exposure: 1.25,
    cameras: 5,
};

/// Half width, height and half depth of the room.
const X: f32 = 2.9;
const Y: f32 = 2.75;
const Z: f32 = 2.5;

fn rgb(r: f32, g: f32, b: f32) -> Vec3 {
    Vec3::new(r, g, b)
}

fn plain(color: Vec3, roughness: f32) -> Material {
    Material { base_color: color, roughness, ..Material::default() }
}

fn metal(color: Vec3, roughness: f32) -> Material {
    Material { base_color: color, roughness, metallic: 1.0, ..Material::default() }
}

fn painted(material: Material, pattern: Pattern) -> Surface {
    Surface { material, pattern, ..Default::default() }
}

fn at(mesh: Mesh, x: f32, y: f32, z: f32) -> Mesh {
    transformed(mesh, Affine3A::from_translation(Vec3::new(x, y, z)))
}

fn turned(mesh: Mesh, degrees: f32) -> Mesh {
    transformed(mesh, Affine3A::from_quat(Quat::from_rotation_y(degrees.to_radians())))
}

/// A rounded box of full extents, standing on its own y = 0.
fn block(x: f32, y: f32, z: f32, radius: f32) -> Mesh {
    at(rounded_box(Vec3::new(x, y, z) * 0.5, radius, 3), 0.0, y * 0.5, 0.0)
}

fn walls(scene: &mut Scene) {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let floor = scene.surface(painted(
        Material { ior: 1.7, ..plain(rgb(0.42, 0.22, 0.11), 0.16) },
        Pattern::Planks { dark: rgb(0.16, 0.075, 0.035), cells: Vec2::new(30.0, 2.6) },
    ));
    let plaster = scene.surface(painted(
        plain(rgb(0.80, 0.77, 0.71), 0.9),
        Pattern::Mottled { other: rgb(0.74, 0.71, 0.66), scale: 2.5 },
    ));
    let teal = scene.surface(painted(
        plain(rgb(0.12, 0.36, 0.37), 0.75),
        Pattern::Mottled { other: rgb(0.085, 0.29, 0.31), scale: 3.0 },
    ));
    let brick = scene.surface(painted(
        plain(rgb(0.58, 0.27, 0.17), 0.85),
        Pattern::Tiles {
            joint: rgb(0.52, 0.47, 0.41),
            cells: Vec2::new(20.0, 30.0),
            width: 0.06,
            variation: 0.7,
            shift: 0.5,
        },
    ));
    let white = scene.surface(plain(rgb(0.78, 0.77, 0.74), 0.45));
    let beam = scene.surface(painted(
        plain(rgb(0.33, 0.18, 0.09), 0.6),
        Pattern::Wood { dark: rgb(0.14, 0.065, 0.03), rings: 14.0 },
    ));

    scene.place(quad(Vec3::new(-X, 0.0, Z), x * 2.0 * X, -z * 2.0 * Z), floor);
    scene.place(quad(Vec3::new(-X, Y, -Z), x * 2.0 * X, z * 2.0 * Z), plaster);
    scene.place(quad(Vec3::new(-X, 0.0, -Z), x * 2.0 * X, y * Y), teal);
    scene.place(quad(Vec3::new(X, 0.0, Z), -x * 2.0 * X, y * Y), plaster);
    scene.place(quad(Vec3::new(-X, 0.0, Z), -z * 2.0 * Z, y * Y), brick);
    // The right wall has a window between z0 and z1, from y0 to y1, in a wall of depth `reveal`.
    let (z0, z1, y0, y1, reveal) = (-1.6_f32, 0.1_f32, 0.75_f32, 2.15_f32, 0.25_f32);
    let piece = |za: f32, zb: f32, ya: f32, yb: f32| quad(Vec3::new(X, ya, za), z * (zb - za), y * (yb - ya));
    scene.place(
        merge(&[
            piece(-Z, z0, 0.0, Y),
            piece(z1, Z, 0.0, Y),
            piece(z0, z1, 0.0, y0),
            piece(z0, z1, y1, Y),
            quad(Vec3::new(X, y0, z1), x * reveal, -z * (z1 - z0)),
            quad(Vec3::new(X, y1, z0), x * reveal, z * (z1 - z0)),
            quad(Vec3::new(X, y0, z0), x * reveal, y * (y1 - y0)),
            quad(Vec3::new(X, y1, z1), x * reveal, -y * (y1 - y0)),
        ]),
        plaster,
    );
    let (zm, ym) = (0.5 * (z0 + z1), y0 + 0.62 * (y1 - y0));
    let bar = |za: f32, zb: f32, ya: f32, yb: f32| cuboid(Vec3::new(X + 0.12, ya, za), Vec3::new(X + 0.17, yb, zb));
    scene.place(
        merge(&[
            bar(z0, z0 + 0.06, y0, y1),
            bar(z1 - 0.06, z1, y0, y1),
            bar(z0, z1, y0, y0 + 0.06),
            bar(z0, z1, y1 - 0.06, y1),
            bar(zm - 0.025, zm + 0.025, y0, y1),
            bar(z0, z1, ym - 0.025, ym + 0.025),
            at(cuboid(Vec3::new(-0.16, 0.0, z0 - 0.08), Vec3::new(0.3, 0.04, z1 + 0.08)), X, y0 - 0.04, 0.0),
        ]),
        white,
    );
    // Dusk: a panel of sky that just fills the opening, so that few shadow rays to it end at the wall.
    let sky = scene.surface(Material {
        base_color: Vec3::ZERO,
        emission: rgb(7.5, 11.5, 19.0),
        roughness: 1.0,
        ..Material::default()
    });
    scene.place(quad(Vec3::new(X + reveal, y0, z0), z * (z1 - z0), y * (y1 - y0)), sky);

    let skirting = |a: Vec3, b: Vec3| cuboid(a.min(b), a.max(b));
    let (h, d) = (0.11, 0.02);
    scene.place(
        merge(&[
            skirting(Vec3::new(-X, 0.0, -Z), Vec3::new(X, h, -Z + d)),
            skirting(Vec3::new(-X, 0.0, -Z), Vec3::new(-X + d, h, Z)),
            skirting(Vec3::new(X - d, 0.0, -Z), Vec3::new(X, h, Z)),
        ]),
        white,
    );
    for k in 0..3 {
        let zc = -1.7 + 1.7 * k as f32;
        let rest = rounded_box(Vec3::new(0.09, 0.11, X + 0.01), 0.02, 2);
        let turn = Affine3A::from_rotation_translation(
            Quat::from_rotation_y(std::f32::consts::FRAC_PI_2),
            Vec3::new(0.0, Y - 0.10, zc),
        );
        scene.place_moving(rest, beam, turn);
    }
}

fn uplighter(scene: &mut Scene, position: Vec3, radiance: Vec3) {
    let brass = scene.surface(metal(rgb(0.78, 0.56, 0.26), 0.28));
    let glow = scene.surface(Material { base_color: Vec3::ZERO, emission: radiance, ..Material::default() });
    let profile = [
        (0.0, 0.0),
        (0.17, 0.0),
        (0.17, 0.02),
        (0.025, 0.045),
        (0.016, 0.1),
        (0.016, 1.38),
        (0.04, 1.41),
        (0.17, 1.46),
        (0.25, 1.56),
        (0.243, 1.562),
    ]
    .map(|(r, h)| Vec2::new(r, h));
    scene.place(at(lathe(&profile, 40, false), position.x, position.y, position.z), brass);
    // The inside of the bowl is painted white: a polished one would throw caustics.
    let paint = scene.surface(plain(rgb(0.82, 0.80, 0.76), 0.9));
    let inside = lathe(&[Vec2::new(0.243, 1.562), Vec2::new(0.175, 1.48), Vec2::new(0.0, 1.475)], 40, false);
    scene.place(at(inside, position.x, position.y, position.z), paint);
    // Nobody sees the lamp: a square, two emitters only, is as good as a disc.
    let lamp = quad(Vec3::new(-0.15, 1.5, 0.15), Vec3::X * 0.3, Vec3::NEG_Z * 0.3);
    scene.place(at(lamp, position.x, position.y, position.z), glow);
}

fn armchair(scene: &mut Scene) {
    let fabric = scene.surface(painted(
        plain(rgb(0.66, 0.36, 0.055), 0.95),
        Pattern::Mottled { other: rgb(0.56, 0.28, 0.04), scale: 9.0 },
    ));
    let wood = scene.surface(painted(
        plain(rgb(0.28, 0.14, 0.065), 0.4),
        Pattern::Wood { dark: rgb(0.12, 0.055, 0.025), rings: 25.0 },
    ));
    let back = transformed(
        block(0.78, 0.62, 0.16, 0.07),
        Affine3A::from_rotation_translation(Quat::from_rotation_x(-0.2), Vec3::new(0.0, 0.36, -0.33)),
    );
    let body = merge(&[
        at(block(0.74, 0.2, 0.74, 0.07), 0.0, 0.22, 0.02),
        at(block(0.15, 0.32, 0.78, 0.06), -0.43, 0.24, 0.0),
        at(block(0.15, 0.32, 0.78, 0.06), 0.43, 0.24, 0.0),
        back,
    ]);
    let legs: Vec<Mesh> = [(-0.38, -0.3), (0.38, -0.3), (-0.38, 0.32), (0.38, 0.32)]
        .map(|(x, z)| at(cylinder(0.025, 0.26, 12), x, 0.0, z))
        .to_vec();
    let place = |mesh| at(turned(mesh, -52.0), 1.75, 0.0, -0.75);
    scene.place(place(body), fabric);
    scene.place(place(merge(&legs)), wood);
    let cushion = scene.surface(painted(
        plain(rgb(0.75, 0.73, 0.68), 0.95),
        Pattern::Stripes { other: rgb(0.10, 0.20, 0.36), count: 7.0 },
    ));
    let pillow = transformed(
        rounded_box(Vec3::new(0.23, 0.23, 0.09), 0.085, 4),
        Affine3A::from_rotation_translation(
            Quat::from_euler(EulerRot::YXZ, 0.15, -0.35, 0.25),
            Vec3::new(0.06, 0.62, -0.16),
        ),
    );
    scene.place(place(pillow), cushion);
}

fn sideboard(scene: &mut Scene) {
    let walnut = scene.surface(painted(
        plain(rgb(0.36, 0.19, 0.09), 0.3),
        Pattern::Wood { dark: rgb(0.13, 0.06, 0.028), rings: 16.0 },
    ));
    let legs = scene.surface(metal(rgb(0.75, 0.55, 0.28), 0.3));
    let (cx, cz) = (-0.35, -Z + 0.3);
    // Rest positions turned so that the grain runs along the board.
    let along = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    let body = rounded_box(Vec3::new(0.22, 0.25, 0.95), 0.015, 2);
    scene.place_moving(body, walnut, Affine3A::from_rotation_translation(along, Vec3::new(cx, 0.47, cz)));
    for k in 0..3 {
        let door = rounded_box(Vec3::new(0.012, 0.21, 0.29), 0.008, 2);
        let x = cx - 0.62 + 0.62 * k as f32;
        scene.place_moving(door, walnut, Affine3A::from_rotation_translation(along, Vec3::new(x, 0.47, cz + 0.228)));
        scene.place(at(uv_sphere(0.016, 16, 8), x + 0.24, 0.5, cz + 0.255), legs);
    }
    let feet: Vec<Mesh> = [(-0.8, -0.14), (0.8, -0.14), (-0.8, 0.14), (0.8, 0.14)]
        .map(|(x, z)| at(cylinder(0.018, 0.23, 12), cx + x, 0.0, cz + z))
        .to_vec();
    scene.place(merge(&feet), legs);

    let top = 0.72;
    // A porcelain vase.
    let porcelain = scene.surface(plain(rgb(0.80, 0.82, 0.83), 0.12));
    let vase: Vec<Vec2> = (0..=32)
        .map(|i| {
            let h = i as f32 / 32.0;
            let belly = 0.045 + 0.085 * (std::f32::consts::PI * (h * 0.92 + 0.04)).sin().powf(1.5) - 0.03 * h;
            Vec2::new(belly.max(0.03), 0.42 * h)
        })
        .collect();
    let mut profile = vec![Vec2::ZERO];
    profile.extend(vase.iter());
    profile.extend(vase.iter().rev().map(|p| Vec2::new(p.x - 0.008, p.y.max(0.02))));
    profile.push(Vec2::new(0.0, 0.02));
    scene.place(at(lathe(&profile, 48, true), cx + 0.62, top, cz), porcelain);
    // Books.
    let tones = [rgb(0.55, 0.07, 0.05), rgb(0.06, 0.16, 0.34), rgb(0.70, 0.60, 0.40), rgb(0.08, 0.27, 0.15)];
    for (k, tone) in tones.iter().enumerate() {
        let cover = scene.surface(plain(*tone, 0.55));
        let k = k as f32;
        let book = turned(block(0.27 - 0.015 * k, 0.04, 0.19, 0.004), -8.0 + 9.0 * k);
        scene.place(at(book, cx - 0.55, top + 0.041 * k, cz), cover);
    }
    let copper = scene.surface(metal(rgb(0.90, 0.53, 0.37), 0.22));
    scene.place(at(uv_sphere(0.075, 48, 24), cx - 0.55, top + 0.239, cz), copper);
    // A sculpture that turns about its tilted axis.
    let stone = scene.surface(painted(
        plain(rgb(0.80, 0.78, 0.74), 0.25),
        Pattern::Marble { vein: rgb(0.12, 0.13, 0.16), scale: 7.0 },
    ));
    scene.place(at(block(0.2, 0.05, 0.2, 0.008), cx + 0.02, top, cz), copper);
    let hub = Vec3::new(cx + 0.02, top + 0.23, cz);
    scene.place_moving(
        torus(0.13, 0.042, 64, 24),
        stone,
        Track::function(move |frame| {
            let turn = Quat::from_rotation_y((TAU * frame / 96.0) as f32);
            Affine3A::from_rotation_translation(turn * Quat::from_rotation_x(1.25), hub)
        }),
    );

    // A painting in a brass frame.
    let canvas = scene.surface(painted(
        plain(rgb(0.72, 0.66, 0.55), 0.8),
        Pattern::Picture { colors: [rgb(0.68, 0.20, 0.08), rgb(0.07, 0.12, 0.24), rgb(0.78, 0.55, 0.16)], seed: 5 },
    ));
    let (pw, ph, px, py) = (1.1, 0.72, cx + 0.1, 1.42);
    scene.place(quad(Vec3::new(px - pw / 2.0, py, -Z + 0.02), Vec3::X * pw, Vec3::Y * ph), canvas);
    let bar = |w: f32, h: f32, x: f32, y: f32| at(rounded_box(Vec3::new(w, h, 0.02), 0.008, 2), x, y, -Z + 0.02);
    let frame = merge(&[
        bar(pw / 2.0 + 0.03, 0.02, px, py - 0.01),
        bar(pw / 2.0 + 0.03, 0.02, px, py + ph + 0.01),
        bar(0.02, ph / 2.0 + 0.03, px - pw / 2.0 - 0.01, py + ph / 2.0),
        bar(0.02, ph / 2.0 + 0.03, px + pw / 2.0 + 0.01, py + ph / 2.0),
    ]);
    scene.place(frame, legs);
}

/// A leaf along +z that bends down and sways.
fn leaf(length: f32, width: f32, phase: f64) -> Mesh {
    let mut mesh = grid(Vec3::new(-0.5, 0.0, 0.0), Vec3::X, Vec3::Z, 4, 10);
    mesh.deform = Some(Arc::new(move |frame, mesh: &Mesh| {
        let sway = 0.16 * (TAU * (frame / 48.0) + phase).sin() as f32;
        let point = |u: f32, v: f32| {
            // Narrow at both ends, folded along the middle, arched.
            let half = width * (std::f32::consts::PI * (0.06 + 0.94 * v)).sin().max(0.0).powf(0.7);
            let side = u * half;
            let bend = (1.0 + sway) * v * v;
            Vec3::new(
                side + 0.35 * sway * v * v * length,
                length * (0.75 * v - 0.62 * bend) + 0.35 * (2.0 * u).abs() * half,
                length * (0.35 * v + 0.65 * bend.min(1.4) * 0.8),
            )
        };
        let positions: Vec<Vec3> = mesh.positions.iter().map(|p| point(p.x, p.z)).collect();
        let normals = mesh
            .positions
            .iter()
            .map(|p| {
                let e = 1e-2;
                let du = point(p.x + e, p.z) - point(p.x - e, p.z);
                let dv = point(p.x, (p.z + e).min(1.0)) - point(p.x, (p.z - e).max(0.0));
                dv.cross(du).normalize_or(Vec3::Y)
            })
            .collect();
        (positions, normals)
    }));
    // grid() faces down here: edge_u x edge_v = -y.
    for t in &mut mesh.triangles {
        t.swap(1, 2);
    }
    mesh
}

fn plant(scene: &mut Scene, position: Vec3) {
    let clay = scene.surface(plain(rgb(0.20, 0.33, 0.42), 0.2));
    let soil = scene.surface(plain(rgb(0.06, 0.04, 0.03), 1.0));
    let green = scene.surface(plain(rgb(0.09, 0.27, 0.055), 0.4));
    let profile = [(0.0, 0.0), (0.14, 0.0), (0.185, 0.1), (0.2, 0.3), (0.205, 0.34), (0.18, 0.34), (0.175, 0.29)]
        .map(|(r, h)| Vec2::new(r, h));
    scene.place(at(lathe(&profile, 48, true), position.x, position.y, position.z), clay);
    let disc = lathe(&[Vec2::new(0.178, 0.0), Vec2::new(0.0, 0.0)], 32, false);
    scene.place(at(disc, position.x, position.y + 0.295, position.z), soil);
    let leaves: Vec<usize> =
        (0..3).map(|k| scene.mesh(leaf(0.62 + 0.13 * k as f32, 0.10 + 0.012 * k as f32, f64::from(k) * 2.1))).collect();
    for k in 0..15 {
        let kf = k as f32;
        let index = scene.place(Mesh::default(), green);
        let tilt = -0.95 + 0.085 * kf;
        let turn = Quat::from_rotation_y(2.399_963 * kf) * Quat::from_rotation_x(tilt.min(0.15));
        let instance = &mut scene.instances[index];
        instance.mesh = leaves[k % leaves.len()];
        instance.transform = Affine3A::from_rotation_translation(turn, position + Vec3::new(0.0, 0.30, 0.0)).into();
    }
}

pub(super) fn build() -> Scene {
    let mut scene = Scene::new(INFO.name);
    walls(&mut scene);
    uplighter(&mut scene, Vec3::new(-2.25, 0.0, -1.75), rgb(350.0, 240.0, 134.0));
    armchair(&mut scene);
    sideboard(&mut scene);
    plant(&mut scene, Vec3::new(2.2, 0.0, -2.0));

    // A rug.
    let rug = scene.surface(painted(
        plain(rgb(0.52, 0.10, 0.07), 1.0),
        Pattern::Stripes { other: rgb(0.62, 0.52, 0.38), count: 5.0 },
    ));
    scene.place(
        transformed(
            merge(&[quad(Vec3::new(-0.95, 0.012, 0.6), Vec3::X * 1.9, Vec3::NEG_Z * 1.2)]),
            Affine3A::from_rotation_translation(Quat::from_rotation_y(0.12), Vec3::new(-0.2, 0.0, -0.75)),
        ),
        rug,
    );
    // A low table with a glossy black top.
    let lacquer = scene.surface(plain(rgb(0.022, 0.022, 0.026), 0.08));
    let steel = scene.surface(metal(rgb(0.62, 0.62, 0.64), 0.3));
    let (tx, tz) = (-0.25, -0.72);
    scene.place(at(block(1.0, 0.045, 0.56, 0.02), tx, 0.36, tz), lacquer);
    let legs: Vec<Mesh> = [(-0.42, -0.2), (0.42, -0.2), (-0.42, 0.2), (0.42, 0.2)]
        .map(|(x, z)| at(cylinder(0.016, 0.36, 16), tx + x, 0.0, tz + z))
        .to_vec();
    scene.place(merge(&legs), steel);
    let bowl_profile: Vec<Vec2> = (0..=16)
        .map(|i| {
            let a = i as f32 / 16.0 * 1.35;
            Vec2::new(0.17 * a.sin(), 0.15 * (1.0 - a.cos()))
        })
        .chain((0..=16).rev().map(|i| {
            let a = i as f32 / 16.0 * 1.35;
            Vec2::new(0.158 * a.sin(), 0.012 + 0.143 * (1.0 - a.cos()))
        }))
        .collect();
    let glaze = scene.surface(plain(rgb(0.09, 0.30, 0.36), 0.15));
    scene.place(at(lathe(&bowl_profile, 48, true), tx - 0.2, 0.405, tz), glaze);
    for (k, (x, z, tone)) in [
        (-0.055, 0.03, rgb(0.72, 0.30, 0.03)),
        (0.06, 0.02, rgb(0.70, 0.35, 0.03)),
        (0.0, -0.06, rgb(0.42, 0.52, 0.05)),
        (0.01, 0.0, rgb(0.74, 0.24, 0.03)),
    ]
    .into_iter()
    .enumerate()
    {
        let fruit = scene.surface(plain(tone, 0.45));
        let lift = if k == 3 { 0.13 } else { 0.065 };
        scene.place(at(uv_sphere(0.055, 24, 16), tx - 0.2 + x, 0.405 + lift, tz + z), fruit);
    }
    let spine = scene.surface(plain(rgb(0.72, 0.70, 0.64), 0.5));
    scene.place(at(turned(block(0.24, 0.03, 0.17, 0.004), 24.0), tx + 0.24, 0.405, tz + 0.03), spine);

    // The ball rolls to and fro in front.
    let ball = scene.surface(painted(
        plain(rgb(0.75, 0.73, 0.70), 0.2),
        Pattern::Stripes { other: rgb(0.62, 0.06, 0.04), count: 6.0 },
    ));
    let radius = 0.17_f32;
    scene.place_moving(
        uv_sphere(radius, 64, 32),
        ball,
        Track::function(move |frame| {
            let x = 1.25 * (TAU * (frame / 112.0 - 0.12)).sin() as f32;
            let roll = Quat::from_rotation_z(-x / radius) * Quat::from_rotation_x(1.1);
            Affine3A::from_rotation_translation(roll, Vec3::new(x + 0.1, radius, 0.35))
        }),
    );

    let wave = |frame: f64, period: f64, phase: f64| (TAU * (frame / period + phase)).sin() as f32;
    scene.cameras = vec![
        // 1: the demo: a slow arc at sitting height.
        CameraPath::moving(48.0, move |f| {
            let s = wave(f, 160.0, -0.08);
            (Vec3::new(0.25 + 0.7 * s, 1.2 + 0.06 * s, 2.3), Vec3::new(0.0 + 0.15 * s, 0.72, -1.0))
        }),
        // 2: low over the floor towards the table.
        CameraPath::moving(52.0, move |f| {
            let s = wave(f, 192.0, 0.0);
            (Vec3::new(-1.6 + 0.5 * s, 0.5, 2.1 - 0.3 * s), Vec3::new(0.5, 0.5, -1.2))
        }),
        // 3: from beside the lamp towards armchair and window.
        CameraPath::moving(50.0, move |f| {
            let s = wave(f, 144.0, 0.1);
            (Vec3::new(-2.3, 1.5, 0.9 + 0.5 * s), Vec3::new(1.6, 0.7, -0.8))
        }),
        // 4: from the window side, gliding along.
        CameraPath::moving(50.0, move |f| {
            let s = wave(f, 176.0, 0.2);
            (Vec3::new(2.4, 1.3 + 0.1 * s, 1.5 - 0.6 * s), Vec3::new(-1.0, 0.7, -1.2))
        }),
        // 5: high, turning from the painting to the armchair.
        CameraPath::moving(56.0, move |f| {
            let s = wave(f, 120.0, 0.15);
            (Vec3::new(-0.6, 2.0, 2.2), Vec3::new(0.3 + 0.8 * s, 0.6, -1.2))
        }),
    ];
    scene
}
