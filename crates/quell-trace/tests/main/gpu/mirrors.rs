//! Primary surface replacement in mirrors: guides of what they show, unfolded, as the CPU's.

use super::device::Device;
use super::pixels::{SIZE, agreement, assert_same};
use glam::{Affine3A, Quat, Vec3};
use quell_trace::gpu::Kernels;
use quell_trace::{
    CameraPath, Control, Material, PointlikeLight, PrimaryReplacement, RenderOptions, Scene, Track, builtin, shapes,
};
use std::collections::BTreeSet;

/// Differences that must be seen; `SHOWN` is true while one shows.
const PLANTED: &[(&str, &str)] = &[
    ("return normalize_or(turned, normal);", "return select(normalize_or(turned, normal), normal, SHOWN);"),
    (
        "chain[3] + 2.0 * dot(point, normal) * across",
        "chain[3] + select(2.0, 1.9, SHOWN) * dot(point, normal) * across",
    ),
    ("normal = unfold * vec4f(normal, 0.0);", "normal = select(unfold * vec4f(normal, 0.0), normal, SHOWN);"),
    (
        "b.fresnel_mirror, select(0.0, 1.0, bsdf_is_above",
        "b.fresnel_mirror * select(1.0, 0.99, SHOWN), select(0.0, 1.0, bsdf_is_above",
    ),
    ("let along_u = half.slope_u - (", "let along_u = half.slope_u - select(1.0, 0.5, SHOWN) * ("),
    ("0.5 * dot(along, turn)", "select(0.5, 0.0, SHOWN) * dot(along, turn)"),
    ("/ length(mean);", "/ length(mean) * select(1.0, 0.8, SHOWN);"),
    ("sum += shown.xyz;", "sum += shown.xyz * select(1.0, 1.05, SHOWN);"),
];

/// Two mirrors that face each other, one of them turned and moved, and scaled unevenly; between them a thing that moves.
fn scene() -> Scene {
    let place = |f: f32, z: f32| Affine3A::from_translation(Vec3::new(0.02 * f, 0.0, z + 0.03 * f));
    let turned = move |frame: f64| {
        let f = frame as f32;
        let turn = Quat::from_rotation_y(0.04 * f + 0.2) * Quat::from_rotation_x(-0.03 * f);
        place(f, 0.0) * Affine3A::from_scale_rotation_translation(Vec3::new(1.4, 0.8, 1.0), turn, Vec3::ZERO)
    };
    let moved = |frame: f64| {
        Affine3A::from_rotation_translation(Quat::from_rotation_z(0.1 * frame as f32), Vec3::new(0.4, 0.2, 2.0))
    };
    let mut scene = Scene::new("mirrors");
    let tint = Vec3::new(0.9, 0.7, 0.5);
    let mirror = scene.surface(Material { base_color: tint, metallic: 1.0, roughness: 0.0, ..Material::default() });
    let red = scene.surface(Material { base_color: Vec3::new(0.6, 0.2, 0.1), roughness: 0.5, ..Material::default() });
    let grey = scene.surface(Material { base_color: Vec3::splat(0.5), roughness: 0.8, ..Material::default() });
    let square = |side: f32| shapes::quad(Vec3::new(-side, -side, 0.0), Vec3::X * 2.0 * side, Vec3::Y * 2.0 * side);
    scene.place_moving(square(2.5), mirror, Track::function(turned));
    let facing = shapes::quad(Vec3::new(-3.0, -2.0, 9.0), Vec3::Y * 4.0, Vec3::X * 6.0);
    scene.place(facing, mirror);
    scene.place_moving(square(0.7), red, Track::function(moved));
    let rolled = move |frame: f64| {
        place(frame as f32, 2.5)
            * Affine3A::from_scale_rotation_translation(
                Vec3::new(1.3, 1.0, 1.2),
                Quat::from_rotation_z(0.1 * frame as f32),
                Vec3::new(-1.1, 0.3, 0.0),
            )
    };
    scene.place_moving(shapes::uv_sphere(0.8, 32, 16), mirror, Track::function(rolled));
    scene.place(shapes::quad(Vec3::new(-8.0, -2.0, -4.0), Vec3::Z * 20.0, Vec3::X * 16.0), grey);
    scene
        .lights
        .push(PointlikeLight::Point { position: Vec3::new(1.0, 4.0, 4.0), intensity: Vec3::splat(60.0) }.into());
    scene.cameras.push(CameraPath::moving(50.0, |f| (Vec3::new(0.6, 0.9 + 0.03 * f as f32, 6.0), Vec3::ZERO)));
    scene
}

#[test]
fn mirrors_show_what_the_cpus_show_and_planted_differences_are_seen() {
    let texts: Vec<(&str, String)> = (1..)
        .zip(PLANTED)
        .map(|(number, (from, to))| (*from, to.replace("SHOWN", &format!("(frame.planted == {number}u)"))))
        .collect();
    let texts: Vec<(&str, &str)> = texts.iter().map(|(from, to)| (*from, to.as_str())).collect();
    let Some(device) = Device::with(Kernels::planted(&texts)) else { return };
    let primary_replacement = PrimaryReplacement::GlassAndMirrors;
    let options = RenderOptions { direct_samples: 4, primary_replacement, ..RenderOptions::new(SIZE) };
    assert_same(&device, &builtin("mirror-hall").unwrap(), 3, 1, &options);
    let scene = scene();
    assert_same(&device, &scene, 3, 1, &options);

    let mut gpu = device.tracer(&scene, 3, 1);
    let expected = gpu.tracer().render(&options, &Control::default()).unwrap().frame;
    // Mirrors in mirrors are seen: chains of several kinds.
    let ids = expected.surface_id.as_ref().unwrap().data();
    let chains: BTreeSet<u32> = ids.iter().map(|id| id & 0xffff_0000).filter(|chain| *chain != 0).collect();
    assert!(chains.len() >= 3, "{chains:?}");
    for (number, (from, _)) in (1..).zip(PLANTED) {
        gpu.show_planted(number);
        let found = agreement(&device.render(&gpu, &options).unwrap().frame, &expected);
        let least = found.iter().map(|(_, share)| *share).fold(1.0, f64::min);
        println!("{number}: {:.3} of a plane by `{from}`", 1.0 - least);
        assert!(least < 0.95, "nobody sees `{from}` changed: {found:.4?}");
    }
}
