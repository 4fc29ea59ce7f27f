//! Depth, normals, motion vectors, hit distances.

use crate::scenes::lambert;
use glam::{Affine3A, Quat, Vec2, Vec3};
use quell::{FrameBuf, Projection, Size};
use quell_trace::environment::Environment;
use quell_trace::{
    CameraPath, Control, Material, PrimaryReplacement, RenderOptions, Scene, Tracer, Track, builtin, builtin_scenes,
    shapes,
};
use std::sync::Arc;

const SIZE: Size = Size::new(64, 48);

/// Mirrors are surfaces.
fn render(scene: &Scene, frame: i64) -> FrameBuf {
    traced(scene, frame, PrimaryReplacement::Glass)
}

fn traced(scene: &Scene, frame: i64, primary_replacement: PrimaryReplacement) -> FrameBuf {
    let options = RenderOptions { direct_samples: 1, bounces: 0, primary_replacement, ..RenderOptions::new(SIZE) };
    Tracer::new(scene, frame, 1).unwrap().render(&options, &Control::default()).unwrap().frame
}

/// Calls back with pixel coordinate, world position, id and motion of each surface pixel.
fn each_surface(frame: &FrameBuf, mut f: impl FnMut(Vec2, Vec3, u32, Vec2, &Projection, &Projection)) {
    let now = frame.camera.projection(SIZE).unwrap();
    let before = frame.previous_camera.projection(SIZE).unwrap();
    for y in 0..SIZE.height {
        for x in 0..SIZE.width {
            let depth = frame.view_depth.as_ref().unwrap().at(x, y);
            if depth.is_finite() {
                let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let id = frame.surface_id.as_ref().unwrap().at(x, y);
                let motion = Vec2::from(frame.motion.as_ref().unwrap().at(x, y));
                f(pixel, now.world(pixel, depth), id, motion, &now, &before);
            }
        }
    }
}

fn moving_camera() -> CameraPath {
    CameraPath::moving(50.0, |f| {
        let f = f as f32;
        (Vec3::new(0.1 * f, 1.0 + 0.03 * f, 4.0 - 0.05 * f), Vec3::new(0.02 * f, 0.2, 0.0))
    })
}

#[test]
fn motion_of_turning_objects_under_a_moving_camera() {
    let transform = |frame: f64| {
        let f = frame as f32;
        Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 0.7, 1.2),
            Quat::from_rotation_y(0.2 * f) * Quat::from_rotation_x(0.1 * f),
            Vec3::new(0.05 * f, 0.0, 0.02 * f),
        )
    };
    let mut scene = Scene::new("motion");
    let surface = scene.surface(lambert(Vec3::splat(0.5), Vec3::ZERO));
    scene.place_moving(shapes::uv_sphere(0.8, 48, 24), surface, Track::function(transform));
    scene.place(shapes::quad(Vec3::new(-5.0, -1.0, 5.0), Vec3::X * 10.0, Vec3::NEG_Z * 10.0), surface);
    scene.cameras.push(moving_camera());
    for number in [1_i64, 5] {
        let frame = render(&scene, number);
        let before_from_now = transform((number - 1) as f64) * transform(number as f64).inverse();
        let mut seen = [0, 0];
        each_surface(&frame, |pixel, world, id, motion, _, before| {
            let previous = if id == 1 { before_from_now.transform_point3(world) } else { world };
            let expected = before.pixel(previous).unwrap();
            assert!((pixel + motion - expected).length() < 0.01, "{pixel} id {id}: {motion}");
            seen[id as usize - 1] += 1;
        });
        assert!(seen.iter().all(|n| *n > 100), "{seen:?}");
    }
}

#[test]
fn motion_of_a_mesh_that_deforms() {
    // A shear that grows from frame to frame: exact between vertices, too.
    let shear = |frame: f64, p: Vec3| Vec3::new(p.x, p.y + 0.08 * frame as f32 * p.x, p.z);
    let mut mesh = shapes::grid(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0, 6, 5);
    mesh.deform = Some(Arc::new(move |frame, mesh| {
        (mesh.positions.iter().map(|p| shear(frame, *p)).collect(), mesh.normals.clone())
    }));
    let mut scene = Scene::new("deform");
    let surface = scene.surface(lambert(Vec3::splat(0.5), Vec3::ZERO));
    scene.place(mesh, surface);
    scene.cameras.push(moving_camera());
    let frame = render(&scene, 4);
    let mut seen = 0;
    each_surface(&frame, |pixel, world, _, motion, _, before| {
        let rest = Vec3::new(world.x, world.y - 0.08 * 4.0 * world.x, world.z);
        let expected = before.pixel(shear(3.0, rest)).unwrap();
        assert!((pixel + motion - expected).length() < 0.01, "{pixel}: {motion}");
        seen += 1;
    });
    assert!(seen > 300);
}

#[test]
fn what_does_not_move_does_not_move() {
    let mut scene = builtin("cornell-box").unwrap();
    scene.cameras.truncate(1);
    let frame = render(&scene, 3);
    assert!(frame.motion.unwrap().data().iter().flatten().all(|m| *m == 0.0));
}

#[test]
fn the_background_moves_with_the_cameras_rotation_alone() {
    let mut scene = Scene::new("sky");
    scene.environment = Environment::constant(Vec3::ONE);
    scene.cameras.push(CameraPath::moving(50.0, |f| {
        let eye = Vec3::X * (3.0 * f as f32);
        (eye, eye + Vec3::NEG_Z)
    }));
    let frame = render(&scene, 2);
    // Single precision, through the two matrices.
    assert!(frame.motion.as_ref().unwrap().data().iter().flatten().all(|m| m.abs() < 1e-3));
    assert!(frame.view_depth.unwrap().data().iter().all(|d| *d == f32::INFINITY));
    assert!(frame.surface_id.unwrap().data().iter().all(|id| *id == 0));

    scene.cameras[0] = CameraPath::moving(50.0, |f| {
        let angle = 0.05 * f as f32;
        (Vec3::ZERO, Vec3::new(angle.sin(), 0.0, -angle.cos()))
    });
    let frame = render(&scene, 2);
    let now = frame.camera.projection(SIZE).unwrap();
    let before = frame.previous_camera.projection(SIZE).unwrap();
    for (x, y) in [(5, 7), (32, 24), (60, 40)] {
        let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let expected = before.pixel_of_direction(now.ray_direction(pixel)).unwrap();
        let motion = Vec2::from(frame.motion.as_ref().unwrap().at(x, y));
        assert!((pixel + motion - expected).length() < 0.01 && motion.length() > 1.0, "{motion}");
    }
}

#[test]
fn what_was_behind_the_eye_has_unknown_motion() {
    let mut scene = Scene::new("behind");
    let surface = scene.surface(lambert(Vec3::splat(0.5), Vec3::ZERO));
    scene.place(shapes::cuboid(Vec3::new(-1.0, -1.0, -4.0), Vec3::new(1.0, 1.0, -3.0)), surface);
    // The camera turns round between two frames.
    scene.cameras.push(CameraPath::moving(50.0, |f| (Vec3::ZERO, Vec3::Z * if f < 1.0 { 1.0 } else { -1.0 })));
    let frame = render(&scene, 1);
    let mut seen = 0;
    each_surface(&frame, |_, _, _, motion, _, _| {
        assert!(motion.is_nan());
        seen += 1;
    });
    assert!(seen > 300);
}

#[test]
fn depth_normals_and_hit_distances_of_two_mirrors() {
    // A mirror floor at y = 0 under a ceiling at y = 3: the mirror ray's length is known.
    let mut scene = Scene::new("mirrors");
    let mirror = scene.surface(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
    let white = scene.surface(lambert(Vec3::splat(0.5), Vec3::ONE));
    let far = 40.0;
    scene.place(shapes::quad(Vec3::new(-far, 0.0, far), Vec3::X * 2.0 * far, Vec3::NEG_Z * 2.0 * far), mirror);
    scene.place(shapes::quad(Vec3::new(-far, 3.0, -far), Vec3::X * 2.0 * far, Vec3::Z * 2.0 * far), white);
    let eye = Vec3::new(0.0, 1.5, 0.0);
    for orthographic_height in [None, Some(2.0)] {
        scene.cameras =
            vec![CameraPath { orthographic_height, ..CameraPath::fixed(eye, eye + Vec3::new(0.3, -0.9, -1.0), 40.0) }];
        let frame = render(&scene, 0);
        let now = frame.camera.projection(SIZE).unwrap();
        let mut seen = 0;
        each_surface(&frame, |pixel, world, id, _, _, _| {
            let (x, y) = (pixel.x as usize, pixel.y as usize);
            assert_eq!(id, 1);
            assert!(world.y.abs() < 1e-4, "{world}");
            assert!((Vec3::from(frame.normal.as_ref().unwrap().at(x, y)) - Vec3::Y).length() < 1e-5);
            let direction = now.ray_direction(pixel).normalize();
            let expected = 3.0 / -direction.y;
            let found = frame.glossy_hit_distance.as_ref().unwrap().at(x, y);
            assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
            assert!(frame.matte_hit_distance.as_ref().unwrap().at(x, y) >= 3.0 - 1e-4);
            seen += 1;
        });
        assert_eq!(seen, SIZE.pixels());
    }
}

#[test]
fn a_plane_mirror_shows_the_unfolded_world() {
    // A mirror that turns and moves, a thing that moves before it, a camera that moves.
    let mirror_at = |frame: f64| {
        let f = frame as f32;
        Affine3A::from_rotation_translation(
            Quat::from_rotation_y(0.03 * f) * Quat::from_rotation_x(-0.02 * f),
            Vec3::new(0.02 * f, 0.0, 0.03 * f),
        )
    };
    let thing_at =
        |frame: f64| Affine3A::from_rotation_translation(Quat::from_rotation_z(0.1 * frame as f32), Vec3::Z * 6.0);
    let mut scene = Scene::new("mirror");
    let mirror = scene.surface(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
    let matte = scene.surface(lambert(Vec3::splat(0.5), Vec3::ZERO));
    scene.place_moving(
        shapes::quad(Vec3::new(-3.0, -3.0, 0.0), Vec3::X * 6.0, Vec3::Y * 6.0),
        mirror,
        Track::function(mirror_at),
    );
    let thing = shapes::quad(Vec3::new(-9.0, 9.0, 0.0), Vec3::X * 18.0, Vec3::Y * -18.0);
    scene.place_moving(thing, matte, Track::function(thing_at));
    scene.cameras.push(moving_camera());
    let number = 3.0;
    let frame = traced(&scene, number as i64, PrimaryReplacement::GlassAndMirrors);
    let mirrored = |p: Vec3, frame: f64| {
        let place = mirror_at(frame);
        let (point, normal) = (place.transform_point3(Vec3::ZERO), place.transform_vector3(Vec3::Z));
        p - 2.0 * (p - point).dot(normal) * normal
    };
    let mut seen = 0;
    each_surface(&frame, |pixel, virtual_point, id, motion, _, before| {
        // What is at this virtual point really lies on the thing's plane.
        let real = mirrored(virtual_point, number);
        let rest = thing_at(number).inverse().transform_point3(real);
        assert!(rest.z.abs() < 1e-3, "{pixel}: {rest}");
        assert!(id != 1 && id != 2);
        let previous = mirrored(thing_at(number - 1.0).transform_point3(rest), number - 1.0);
        let expected = before.pixel(previous).unwrap();
        assert!((pixel + motion - expected).length() < 0.05, "{pixel}: {motion}, expected {expected}");
        let (x, y) = (pixel.x as usize, pixel.y as usize);
        let normal = Vec3::from(frame.normal.as_ref().unwrap().at(x, y));
        let place = mirror_at(number);
        let n = place.transform_vector3(Vec3::Z);
        let expected = -Vec3::Z + 2.0 * Vec3::Z.dot(n) * n;
        assert!((normal - expected).length() < 1e-4 || (normal + expected).length() < 1e-4, "{normal} {expected}");
        assert!(normal.dot(virtual_point - Vec3::from(before.eye())) < 0.0);
        seen += 1;
    });
    assert!(seen > 1000, "{seen}");
}

/// What a ray sees in a mirroring ball of radius 1: a point of the wall z = 5, else a direction. `None` beside the ball and near its rim.
fn in_ball(origin: Vec3, direction: Vec3, centre: Vec3) -> Option<Result<Vec3, Vec3>> {
    let from = origin - centre;
    let along = from.dot(direction);
    let within = along * along - from.length_squared() + 1.0;
    let normal = (within > 0.0).then(|| from + direction * (-along - within.sqrt()))?;
    let away = direction - 2.0 * direction.dot(normal) * normal;
    let place = centre + normal;
    let on_wall = place + away * ((5.0 - place.z) / away.z);
    let seen = if away.z > 0.0 && on_wall.abs().max_element() < WALL { Ok(on_wall) } else { Err(away) };
    (direction.dot(normal) < -0.35).then_some(seen)
}

/// Half the extent of the wall.
const WALL: f32 = 9.0;

#[test]
fn images_in_a_curved_mirror_move_as_the_law_of_reflection_says() {
    let ball_at = |frame: f64| Vec3::new(0.03 * frame as f32, 0.0, 0.02 * frame as f32);
    for moves in [false, true] {
        let place = move |frame: f64| {
            let frame = if moves { frame } else { 0.0 };
            Affine3A::from_rotation_translation(Quat::from_rotation_y(0.1 * frame as f32), ball_at(frame))
        };
        let mut scene = Scene::new("ball");
        let mirror = scene.surface(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
        let matte = scene.surface(lambert(Vec3::splat(0.5), Vec3::ZERO));
        scene.place_moving(shapes::uv_sphere(1.0, 256, 128), mirror, Track::function(place));
        scene.place(shapes::quad(Vec3::new(-WALL, WALL, 5.0), Vec3::X * 2.0 * WALL, Vec3::Y * -2.0 * WALL), matte);
        scene.cameras.push(moving_camera());
        let frame = traced(&scene, 3, PrimaryReplacement::GlassAndMirrors);
        let now = frame.camera.projection(SIZE).unwrap();
        let before = frame.previous_camera.projection(SIZE).unwrap();
        let ball = |frame: f64| Vec3::from(place(frame).translation);
        let (mut seen, mut background) = (0, 0);
        for y in 0..SIZE.height {
            for x in 0..SIZE.width {
                let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let ray = |p: &Projection, at: Vec2| (Vec3::from(p.eye()), p.ray_direction(at).normalize());
                let (eye, direction) = ray(&now, pixel);
                let Some(shown) = in_ball(eye, direction, ball(3.0)) else { continue };
                let motion = Vec2::from(frame.motion.as_ref().unwrap().at(x, y));
                let (old_eye, old_direction) = ray(&before, pixel + motion);
                let Some(was) = in_ball(old_eye, old_direction, ball(2.0)) else { continue };
                let beside = ray(&now, pixel + Vec2::X);
                // Against the change of what is shown from pixel to pixel.
                match (shown, was, in_ball(beside.0, beside.1, ball(3.0))) {
                    (Ok(a), Ok(b), Some(Ok(next))) => {
                        assert!((a - b).length() < 0.1 * (a - next).length(), "{pixel}: {a} {b}, beside {next}");
                        seen += 1;
                    }
                    (Err(a), Err(b), Some(Err(next))) => {
                        assert!((a - b).length() < 0.1 * (a - next).length(), "{pixel}: {a} {b}, beside {next}");
                        background += 1;
                    }
                    _ => {}
                }
            }
        }
        assert!(seen > 100 && background > 20, "{seen} {background}");
    }
}

#[test]
fn a_pane_of_glass_changes_no_guide() {
    let mut scene = builtin("cornell-box").unwrap();
    scene.cameras.truncate(1);
    let without = render(&scene, 0);
    let glass = scene.surface(Material {
        transmission: 1.0,
        roughness: 0.0,
        thin_walled: true,
        base_color: Vec3::splat(0.8),
        ..Material::default()
    });
    scene.place(shapes::quad(Vec3::new(-4.0, -4.0, 2.0), Vec3::X * 8.0, Vec3::Y * 8.0), glass);
    let with = render(&scene, 0);
    assert_eq!(without.view_depth.unwrap().data().len(), with.view_depth.as_ref().unwrap().data().len());
    assert_eq!(without.surface_id, with.surface_id);
    assert_eq!(without.motion.unwrap().data(), with.motion.unwrap().data());
    let (a, b) = (without.matte_weight.unwrap(), with.matte_weight.unwrap());
    for (a, b) in a.data().iter().zip(b.data()) {
        let share = b[0] / a[0];
        assert!(a[0] == 0.0 || (0.5..0.8).contains(&share), "{a:?} {b:?}");
    }
}

#[test]
fn every_builtin_scene_gives_a_whole_frame() {
    for info in builtin_scenes() {
        let scene = builtin(info.name).unwrap();
        for camera in 1..=info.cameras {
            let frame_number = (7 * camera) as i64;
            let tracer = Tracer::new(&scene, frame_number, camera).unwrap();
            let mut options = RenderOptions { direct_samples: 1, ..RenderOptions::new(Size::new(32, 18)) };
            if info.name == "furnace" {
                // One of its cameras sees a mirror alone, which shows the background.
                options.primary_replacement = PrimaryReplacement::Glass;
            }
            let frame = tracer.render(&options, &Control::default()).unwrap().frame;
            frame.frame(&[]).check(options.size).unwrap();
            let name = format!("{} camera {camera}", info.name);
            assert_eq!(frame.index, frame_number);
            let finite = |plane: &Option<quell::Plane<[f32; 3]>>, what: &str| {
                let data = plane.as_ref().unwrap().data();
                assert!(data.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{name}: {what}");
            };
            finite(&frame.direct, "direct");
            finite(&frame.matte, "matte");
            finite(&frame.glossy, "glossy");
            finite(&frame.matte_weight, "matte weight");
            finite(&frame.glossy_weight, "glossy weight");
            for (normal, depth) in
                frame.normal.as_ref().unwrap().data().iter().zip(frame.view_depth.as_ref().unwrap().data())
            {
                let length = Vec3::from(*normal).length();
                assert!(*depth > 0.0 && (length - if depth.is_finite() { 1.0 } else { 0.0 }).abs() < 1e-4, "{name}");
            }
            let surfaces = frame.view_depth.unwrap().data().iter().filter(|d| d.is_finite()).count();
            let least = if info.name == "furnace" { 5 } else { 60 };
            assert!(surfaces * 100 > least * options.size.pixels(), "{name}: {surfaces} surface pixels");
        }
    }
}
