//! The files of ../shared/scenes, where they are.

use crate::gltf::file::warnings;
use glam::{Vec2, Vec3};
use quell::{FrameBuf, Size};
use quell_trace::gltf::{Loaded, Options, load};
use quell_trace::{Control, PrimaryReplacement, RenderOptions, Scene, Tracer};
use std::path::PathBuf;

const SIZE: Size = Size::new(64, 36);

/// A file of the shared folder; the skip is printed where it is absent.
fn shared(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes").join(name);
    if !path.is_file() {
        eprintln!("skipped: ../shared/scenes/{name} is not there");
        return None;
    }
    Some(path)
}

fn loaded(name: &str) -> Option<Loaded> {
    shared(name).map(|path| load(&path, &Options::default()).unwrap_or_else(|e| panic!("{e}")))
}

/// As the README of the folder has it: triangles, cameras, whether anything moves.
const FILES: [(&str, usize, usize, bool); 15] = [
    ("bathroom_mareck", 380_008, 1, false),
    ("bathroom_salle_de_bain", 383_756, 1, false),
    ("cornell_box", 36, 1, false),
    ("cornell_box_animated", 6_660, 2, true),
    ("fox_animated", 584, 1, true),
    ("khr_alpha_mask", 10, 1, false),
    ("khr_attenuation_test", 304, 1, false),
    ("khr_hierarchy_lights", 126, 1, true),
    ("khr_texture_transform", 10, 1, false),
    ("khr_transmission_spheres", 4_808, 1, false),
    ("modern_hall", 28_655, 1, false),
    ("morph_stress_test", 2_420, 1, true),
    ("sponza_dabrovic", 66_447, 3, false),
    ("sponza_glossy", 66_447, 3, false),
    ("white_room", 400_378, 1, false),
];

#[test]
fn every_file_holds_what_its_row_says() {
    for (name, triangles, cameras, moves) in FILES {
        let Some(Loaded { scene, report }) = loaded(&format!("{name}.glb")) else { return };
        assert!(report.warnings.is_empty(), "{name}: {:?}", report.warnings);
        assert_eq!(report.triangles, triangles, "{name}");
        assert_eq!(scene.cameras.len(), cameras, "{name}");
        assert_eq!(!report.clips.is_empty(), moves, "{name}");
        assert!(report.lights + report.emitters > 0, "{name}");
        assert_eq!(scene.images.len(), report.images, "{name}");
    }
}

/// The nearest triangle along a ray among all instances at a frame: instance, triangle, distance, weights.
fn first_hit(scene: &Scene, frame: f64, origin: Vec3, direction: Vec3) -> Option<(usize, usize, f32, Vec3)> {
    let mut best: Option<(usize, usize, f32, Vec3)> = None;
    for (number, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh];
        let transform = instance.transform.at(frame).inverse();
        // In the mesh's own space, in double precision.
        let (o, d) = (transform.transform_point3(origin).as_dvec3(), transform.transform_vector3(direction).as_dvec3());
        let moved = mesh.deform.as_ref().map(|deform| deform(frame, mesh).0);
        let positions = moved.as_ref().unwrap_or(&mesh.positions);
        for (index, corners) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|i| positions[i as usize].as_dvec3());
            let (ab, ac, ao) = (b - a, c - a, o - a);
            let p = d.cross(ac);
            let inverse = 1.0 / ab.dot(p);
            let (u, q) = (ao.dot(p) * inverse, ao.cross(ab));
            let (v, t) = (d.dot(q) * inverse, ac.dot(q) * inverse);
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && best.is_none_or(|b| (t as f32) < b.2) {
                best = Some((number, index, t as f32, glam::DVec3::new(1.0 - u - v, u, v).as_vec3()));
            }
        }
    }
    best
}

/// Where a point of a triangle is at a frame.
fn point(scene: &Scene, instance: usize, triangle: usize, weights: Vec3, frame: f64) -> Vec3 {
    let instance = &scene.instances[instance];
    let mesh = &scene.meshes[instance.mesh];
    let moved = mesh.deform.as_ref().map(|deform| deform(frame, mesh).0);
    let positions = moved.as_ref().unwrap_or(&mesh.positions);
    let [a, b, c] = mesh.triangles[triangle].map(|i| positions[i as usize]);
    instance.transform.at(frame).transform_point3(a * weights.x + b * weights.y + c * weights.z)
}

fn traced(scene: &Scene, frame: i64) -> FrameBuf {
    let options = RenderOptions {
        direct_samples: 1,
        bounces: 0,
        // Motion is that of what is met first.
        primary_replacement: PrimaryReplacement::Off,
        ..RenderOptions::new(SIZE)
    };
    Tracer::new(scene, frame, 1).unwrap().render(&options, &Control::default()).unwrap().frame
}

/// The largest error of a frame's motion in pixels, and how many pixels moved by more than a tenth.
fn motion_error(scene: &Scene, number: i64) -> (f32, usize) {
    let frame = traced(scene, number);
    let now = frame.camera.projection(SIZE).unwrap();
    let before = frame.previous_camera.projection(SIZE).unwrap();
    let (depths, motions) = (frame.view_depth.as_ref().unwrap(), frame.motion.as_ref().unwrap());
    let (mut worst, mut moving, mut tried) = (0.0_f32, 0, 0);
    for (x, y) in (0..SIZE.height).flat_map(|y| (0..SIZE.width).map(move |x| (x, y))) {
        // A share of the pixels: the search tries every triangle.
        if (x + 3 * y) % 5 != 0 {
            continue;
        }
        let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let (origin, direction) = (now.ray_origin(pixel), now.ray_direction(pixel).normalize());
        let Some((instance, triangle, t, weights)) = first_hit(scene, number as f64, origin, direction) else {
            continue;
        };
        // Rounding decides at silhouettes and between surfaces that lie in each other.
        let depth = now.view_depth(origin + direction * t);
        if (depths.at(x, y) - depth).abs() > 1e-3 * depth {
            continue;
        }
        let previous = point(scene, instance, triangle, weights, number as f64 - 1.0);
        let Some(expected) = before.pixel(previous) else { continue };
        let motion = Vec2::from(motions.at(x, y));
        worst = worst.max((pixel + motion - expected).length());
        moving += usize::from(motion.length() > 0.1);
        tried += 1;
    }
    assert!(tried > 200, "{tried}");
    (worst, moving)
}

#[test]
fn motion_vectors_lead_to_where_surfaces_were() {
    for (name, frame) in
        [("fox_animated", 30), ("morph_stress_test", 25), ("khr_hierarchy_lights", 5), ("cornell_box_animated", 40)]
    {
        let Some(Loaded { mut scene, .. }) = loaded(&format!("{name}.glb")) else { return };
        // The camera moves as well, so that all kinds of motion add up.
        let still = scene.cameras[0].clone();
        let eye = still.position.clone();
        scene.cameras[0].position = quell_trace::Track::function(move |f| eye.at(f) + Vec3::X * (0.01 * f as f32));
        let (worst, moving) = motion_error(&scene, frame);
        eprintln!("{name}: largest error {worst:.5} pixel, {moving} pixels move");
        assert!(worst < 0.02, "{name}: {worst}");
        assert!(moving > 20, "{name}: {moving}");
        // A motion vector that forgot the objects would be found out: only the camera's is left.
        let mut frozen = scene.clone();
        for instance in &mut frozen.instances {
            instance.transform = instance.transform.at(frame as f64).into();
        }
        for mesh in &mut frozen.meshes {
            if let Some(deform) = mesh.deform.take() {
                let (positions, normals) = deform(frame as f64, mesh);
                (mesh.positions, mesh.normals) = (positions, normals);
            }
        }
        let wrong = traced(&frozen, frame);
        let right = traced(&scene, frame);
        let (a, b) = (wrong.motion.unwrap(), right.motion.unwrap());
        let largest = a
            .data()
            .iter()
            .zip(b.data())
            .map(|(a, b)| (Vec2::from(*a) - Vec2::from(*b)).length())
            .filter(|d| d.is_finite())
            .fold(0.0, f32::max);
        assert!(largest > 0.02, "{name}: nothing but the camera moves at frame {frame}");
    }
}

#[test]
fn the_fox_stands_where_its_joints_are_and_rest_is_not_a_clip() {
    let Some(path) = shared("fox_animated.glb") else { return };
    let height = |clip: Option<&str>| {
        let options = Options { clip: clip.map(str::to_owned), ..Options::default() };
        let scene = load(&path, &options).unwrap().scene;
        let fox = scene.instances.iter().map(|i| &scene.meshes[i.mesh]).max_by_key(|m| m.triangles.len()).unwrap();
        let positions = fox.deform.as_ref().map_or_else(|| fox.positions.clone(), |d| d(0.0, fox).0);
        let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        high - low
    };
    // About as high as the stage's other things, not a hundred times that: the node's scale is in the joints once.
    for clip in [None, Some("none"), Some("Run")] {
        let extent = height(clip);
        assert!(extent.max_element() > 0.5 && extent.max_element() < 3.0, "{clip:?}: {extent}");
    }
    let options = Options { clip: Some("Walk".to_owned()), ..Options::default() };
    assert_eq!(load(&path, &options).unwrap().scene.frames, 18);
    assert!(warnings(&load(&path, &options).unwrap()).is_empty());
}
