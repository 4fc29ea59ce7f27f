//! A scene that has everything that a program for a scene can hold: every kind of light, lobe, pattern, texture and
//! motion.

use glam::{Affine3A, Quat, Vec2, Vec3, Vec4};
use quell_trace::environment::{Environment, Sky};
use quell_trace::texture::{Filter, Image, Sampler, TextureRef, Transform, Wrap};
use quell_trace::{
    Alpha, CameraPath, Instance, Material, Mesh, NormalMap, Pattern, PointlikeLight, Scene, Surface, SurfaceTextures,
    Track, shapes,
};
use std::sync::Arc;

fn image(width: usize, height: usize, texel: impl Fn(usize, usize) -> [u8; 4]) -> Arc<Image> {
    let texels = (0..width * height).map(|i| texel(i % width, i / width)).collect();
    Arc::new(Image::new(width, height, texels).unwrap())
}

/// A tile of the floor, so that each pattern is seen.
fn tile(scene: &mut Scene, number: usize, pattern: Pattern) {
    let material = Material { base_color: Vec3::new(0.7, 0.6, 0.5), roughness: 0.4, ..Material::default() };
    let surface = scene.surface(Surface { pattern, ..Surface::from(material) });
    let corner = Vec3::new((number % 4) as f32 - 2.0, 0.0, (number / 4) as f32 * 2.0 - 1.0);
    scene.place(shapes::quad(corner, Vec3::Z * 2.0, Vec3::X), surface);
}

fn square(corner: Vec3, side: f32) -> Mesh {
    shapes::quad(corner, Vec3::X * side, Vec3::Y * side)
}

fn textures(scene: &mut Scene) -> SurfaceTextures {
    let begin = scene.images.len();
    scene.images.push(image(16, 12, |x, y| {
        [(x * 16) as u8, (y * 20) as u8, 90, if (x / 3 + y / 3) % 2 == 0 { 255 } else { 60 }]
    }));
    scene.images.push(image(5, 7, |x, y| [128 + (x * 9) as u8, 140 - (y * 7) as u8, 235, 255]));
    scene.images.push(image(8, 8, |x, y| [200, 60 + (x * 20) as u8, (y * 30) as u8, 255 - (x * 10) as u8]));
    let turned = Transform { offset: Vec2::new(0.2, -0.3), rotation: 0.4, scale: Vec2::new(2.0, 3.0) };
    let mirrored = Sampler { wrap_s: Wrap::Mirror, wrap_t: Wrap::Clamp, mag: Filter::Nearest, min: Filter::Linear };
    let of = |number: usize| TextureRef { transform: turned, ..TextureRef::new(begin + number) };
    SurfaceTextures {
        base_color: Some(of(0)),
        metallic_roughness: Some(TextureRef { sampler: mirrored, ..of(2) }),
        normal: Some(NormalMap { texture: of(1), scale: 0.7 }),
        specular: Some(of(2)),
        specular_color: Some(TextureRef { uv_set: 1, ..of(0) }),
        ..SurfaceTextures::default()
    }
}

/// Cameras: 1 sees all, 2 is orthographic.
pub fn scene() -> Scene {
    let mut scene = Scene::new("everything");
    let (brown, grey) = (Vec3::new(0.25, 0.12, 0.06), Vec3::splat(0.3));
    let cells = Vec2::new(3.0, 4.0);
    let patterns = [
        Pattern::Checker { other: brown, cells },
        Pattern::Tiles { joint: grey, cells, width: 0.06, variation: 0.4, shift: 0.5 },
        Pattern::Stripes { other: brown, count: 4.0 },
        Pattern::Wood { dark: brown, rings: 9.0 },
        Pattern::Marble { vein: grey, scale: 2.0 },
        Pattern::Mottled { other: brown, scale: 5.0 },
        Pattern::Planks { dark: brown, cells },
        Pattern::Picture { colors: [brown, grey, Vec3::new(0.1, 0.3, 0.6)], seed: 5 },
    ];
    for (number, pattern) in patterns.into_iter().enumerate() {
        tile(&mut scene, number, pattern);
    }

    // Textures on a sphere that moves and on one that its transform mirrors; second coordinates, colours, tangents.
    let material = Material { metallic: 0.6, roughness: 0.8, specular: 0.9, ..Material::default() };
    let textures = textures(&mut scene);
    let painted = scene.surface(Surface { textures: Some(Box::new(textures)), ..Surface::from(material) });
    let mut ball = shapes::uv_sphere(0.4, 14, 9);
    ball.uvs1 = ball.uvs.iter().map(|uv| *uv * 1.7).collect();
    ball.colors = ball.positions.iter().map(|p| (Vec3::splat(0.7) + 0.3 * p).extend(1.0)).collect();
    scene.place_moving(
        ball.clone(),
        painted,
        Track::function(|f| {
            Affine3A::from_rotation_translation(
                Quat::from_rotation_y(0.1 * f as f32),
                Vec3::new(-1.4, 0.5 + 0.02 * f as f32, 0.4),
            )
        }),
    );
    ball.tangents =
        ball.normals.iter().map(|n| n.cross(Vec3::Y).normalize_or(Vec3::X).extend(-1.0)).collect::<Vec<Vec4>>();
    let mirrored =
        Affine3A::from_scale_rotation_translation(Vec3::new(-1.0, 1.0, 1.0), Quat::IDENTITY, Vec3::new(1.5, 0.45, 0.5));
    scene.place_moving(ball, painted, mirrored);

    // A cloth that deforms.
    let cloth = scene.surface(Material { base_color: Vec3::new(0.2, 0.4, 0.7), roughness: 0.5, ..Material::default() });
    let mut mesh = shapes::grid(Vec3::new(-0.5, 0.6, -0.9), Vec3::X, Vec3::Y * 0.6, 6, 4);
    mesh.deform = Some(Arc::new(|frame, mesh| {
        let wave = |p: &Vec3| *p + Vec3::Z * 0.1 * (4.0 * p.x + 0.3 * frame as f32).sin();
        (mesh.positions.iter().map(wave).collect(), mesh.normals.clone())
    }));
    scene.place(mesh, cloth);

    // Smooth glass that tints, rough glass, a thin pane; a mirror.
    let glass = |roughness: f32, thin_walled: bool| Material {
        base_color: Vec3::new(0.9, 0.95, 1.0),
        roughness,
        transmission: 1.0,
        thin_walled,
        attenuation_color: Vec3::new(0.5, 0.9, 0.6),
        attenuation_distance: 0.5,
        ..Material::default()
    };
    for (place, material) in [(-0.55, glass(0.0, false)), (0.55, glass(0.25, false))] {
        let surface = scene.surface(material);
        let ball = shapes::transformed(
            shapes::uv_sphere(0.3, 20, 12),
            Affine3A::from_translation(Vec3::new(place, 0.35, 1.1)),
        );
        scene.place(ball, surface);
    }
    let pane = scene.surface(glass(0.0, true));
    scene.place(square(Vec3::new(0.9, 0.1, 1.6), 0.6), pane);
    let half = scene.surface(Material { transmission: 0.5, ..glass(0.3, true) });
    scene.place(square(Vec3::new(-1.6, 0.1, 1.5), 0.5), half);
    let mirror = scene.surface(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
    scene.place(square(Vec3::new(0.7, 0.2, -0.9), 1.2), mirror);

    // Holes, and surfaces that cover a part of each point: little and much.
    let leaf = scene.surface(Surface {
        textures: Some(Box::new(SurfaceTextures { base_color: textures.base_color, ..SurfaceTextures::default() })),
        alpha: Alpha::Mask { cutoff: 0.5 },
        ..Surface::default()
    });
    scene.place(square(Vec3::new(-1.9, 0.1, -0.4), 0.9), leaf);
    for (x, alpha_factor) in [(-0.3, 0.3), (0.1, 0.7)] {
        let material = Material { base_color: Vec3::new(0.8, 0.2, 0.2), roughness: 0.6, ..Material::default() };
        let veil = scene.surface(Surface { alpha: Alpha::Blend, alpha_factor, ..Surface::from(material) });
        scene.place(square(Vec3::new(x, 0.7, 1.2), 0.5), veil);
    }

    // Lamps: one triangle, a rectangle that flickers, a fan of five, a picture that shines on both sides.
    let shining = |radiance: f32| Material { emission: Vec3::new(1.0, 0.8, 0.6) * radiance, ..Material::default() };
    let small = scene.surface(shining(30.0));
    let triangle = Mesh {
        positions: vec![Vec3::new(-1.2, 1.9, 0.2), Vec3::new(-0.9, 1.9, 0.1), Vec3::new(-1.0, 1.8, 0.5)],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    scene.place(triangle, small);
    let wide = scene.surface(shining(5.0));
    let mesh = scene.mesh(shapes::quad(Vec3::new(0.3, 1.7, 0.0), Vec3::X * 0.6, Vec3::Z * 0.5));
    let emission_scale = Track::function(|f: f64| 1.0 + 0.5 * (f as f32).sin());
    scene.instances.push(Instance { emission_scale, ..Instance::fixed(mesh, wide) });
    let rim = |k: usize| Vec3::new(1.4 + 0.2 * (1.2 * k as f32).cos(), 1.8, 0.8 + 0.2 * (1.2 * k as f32).sin());
    let fan = Mesh {
        positions: std::iter::once(Vec3::new(1.4, 1.8, 0.8)).chain((0..6).map(rim)).collect(),
        triangles: (1..6).map(|k| [0, k, k + 1]).collect(),
        ..Mesh::default()
    };
    scene.place(fan, small);
    let picture = SurfaceTextures { emissive: textures.base_color, ..SurfaceTextures::default() };
    let screen = Surface { textures: Some(Box::new(picture)), double_sided: true, ..Surface::from(shining(3.0)) };
    let screen = scene.surface(screen);
    scene.place(square(Vec3::new(-1.9, 0.8, -0.95), 0.8), screen);
    let unlit = Surface {
        unlit: true,
        ..Surface::from(Material { base_color: Vec3::new(0.2, 0.9, 0.4), ..Material::default() })
    };
    let unlit = scene.surface(unlit);
    scene.place(square(Vec3::new(1.7, 0.9, -0.5), 0.2), unlit);

    let position = Vec3::new(0.0, 1.6, 0.6);
    scene.lights.push(PointlikeLight::Point { position, intensity: Vec3::new(0.6, 0.7, 1.0) }.into());
    let direction = Vec3::new(0.2, -1.0, 0.1);
    let (intensity, position) = (Vec3::splat(3.0), Vec3::new(-0.5, 1.8, 0.2));
    scene.lights.push(PointlikeLight::Spot { position, direction, intensity, inner: 0.3, outer: 0.6 }.into());
    let direction = Vec3::new(-0.3, -1.0, -0.6);
    scene.lights.push(PointlikeLight::Directional { direction, irradiance: Vec3::splat(0.8) }.into());
    scene.environment = Environment::sky(&Sky {
        zenith: Vec3::new(0.2, 0.4, 1.0),
        horizon: Vec3::splat(0.8),
        ground: Vec3::splat(0.1),
        sun_direction: Vec3::new(1.0, 0.8, 0.6),
        sun_radiance: Vec3::splat(300.0),
        sun_angular_radius: 0.05,
    });
    scene.environment_scale = Track::function(|f| 0.8 + 0.01 * f as f32);

    scene.cameras.push(CameraPath::moving(55.0, |f| {
        (Vec3::new(0.05 * f as f32, 1.3, 3.4), Vec3::new(0.0, 0.7 + 0.01 * f as f32, 0.0))
    }));
    let mut flat = CameraPath::fixed(Vec3::new(0.5, 1.5, 3.0), Vec3::new(0.0, 0.6, 0.0), 50.0);
    flat.orthographic_height = Some(2.4);
    scene.cameras.push(flat);
    scene
}
