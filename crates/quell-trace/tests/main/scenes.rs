//! Small scenes with known answers.

use glam::Vec3;
use quell_trace::environment::Environment;
use quell_trace::{CameraPath, Material, Scene, shapes};

/// A closed box whose every face is matte with the same albedo and emits the same radiance.
pub fn closed_box(albedo: f32, emission: f32) -> Scene {
    let mut scene = Scene::new("closed box");
    let surface = scene.surface(lambert(Vec3::splat(albedo), Vec3::splat(emission)));
    scene.place(shapes::room(Vec3::splat(-1.0), Vec3::ONE), surface);
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.2, 0.1, 0.5), Vec3::new(-0.1, -0.3, -1.0), 70.0));
    scene
}

/// A surface without interface: pure Lambert.
pub fn lambert(albedo: Vec3, emission: Vec3) -> Material {
    Material { base_color: albedo, emission, roughness: 1.0, specular: 0.0, ..Material::default() }
}

/// A sphere under light that is the same from everywhere.
pub fn sphere_under_constant_light(material: Material) -> Scene {
    let mut scene = Scene::new("sphere");
    let surface = scene.surface(material);
    scene.place(shapes::uv_sphere(1.0, 96, 48), surface);
    scene.environment = Environment::constant(Vec3::ONE);
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 40.0));
    scene
}

/// A floor of one material under a rectangular lamp, with a wall of another colour that sends indirect light.
pub fn lamp_over(material: Material) -> Scene {
    let mut scene = Scene::new("lamp over a floor");
    let floor = scene.surface(material);
    let wall = scene.surface(lambert(Vec3::new(0.7, 0.5, 0.3), Vec3::ZERO));
    let lamp = scene.surface(lambert(Vec3::splat(0.5), Vec3::new(6.0, 5.0, 4.0)));
    scene.place(shapes::quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0), floor);
    scene.place(shapes::quad(Vec3::new(-2.0, 0.0, -1.5), Vec3::X * 4.0, Vec3::Y * 3.0), wall);
    scene.place(shapes::quad(Vec3::new(-0.5, 1.5, -1.2), Vec3::X, Vec3::new(0.0, 0.3, 0.6)), lamp);
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.3, 1.2, 2.5), Vec3::new(0.0, 0.3, -0.5), 50.0));
    scene
}
