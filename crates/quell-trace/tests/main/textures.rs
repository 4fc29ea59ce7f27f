//! Textures, opacity and textured light, from outside.

use crate::scenes::lambert;
use glam::{Vec2, Vec3, Vec4};
use quell::{FrameBuf, Plane, Rgb, Size};
use quell_trace::texture::{Image, TextureRef, Transform};
use quell_trace::{
    Alpha, CameraPath, Control, Half, Material, Mesh, NormalMap, Reference, ReferenceKind, RenderOptions, Scene,
    SceneError, Surface, SurfaceTextures, Tracer, shapes,
};
use std::sync::Arc;

const CONTROL: Control<'_> = Control { cancel: None, progress: None };

fn image(width: usize, height: usize, texel: impl Fn(usize, usize) -> [u8; 4]) -> Arc<Image> {
    let texels = (0..width * height).map(|i| texel(i % width, i / width)).collect();
    Arc::new(Image::new(width, height, texels).unwrap())
}

fn checker(cells: usize) -> Arc<Image> {
    image(cells, cells, |x, y| if (x + y) % 2 == 0 { [255, 255, 255, 255] } else { [0, 0, 0, 255] })
}

fn textured(material: Material, textures: SurfaceTextures) -> Surface {
    Surface { material, textures: Some(Box::new(textures)), ..Surface::default() }
}

fn base_color(image: usize) -> SurfaceTextures {
    SurfaceTextures { base_color: Some(TextureRef::new(image)), ..SurfaceTextures::default() }
}

fn frame(scene: &Scene, size: Size) -> FrameBuf {
    let options = RenderOptions { direct_samples: 1, bounces: 0, ..RenderOptions::new(size) };
    Tracer::new(scene, 0, 1).unwrap().render(&options, &CONTROL).unwrap().frame
}

fn reference(scene: &Scene, size: Size, kind: ReferenceKind, samples: u32) -> Reference {
    let options = RenderOptions { direct_samples: 2, bounces: 2, ..RenderOptions::new(size) };
    Tracer::new(scene, 0, 1).unwrap().reference(&options, kind, Half::A, 0..samples, &CONTROL).unwrap()
}

fn mean(plane: &Plane<Rgb>) -> Vec3 {
    plane.data().iter().map(|p| Vec3::from(*p)).sum::<Vec3>() / plane.data().len() as f32
}

/// A square of side 2 in the xy plane, facing +z.
fn square() -> Mesh {
    shapes::quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0)
}

#[test]
fn a_fine_checker_far_away_is_its_mean_at_one_sample_a_pixel() {
    let size = Size::new(48, 27);
    let weights = |eye: Vec3, fov: f32, repeats: f32| {
        let mut scene = Scene::new("checker");
        scene.images.push(checker(64));
        let mut texture = TextureRef::new(0);
        texture.transform = Transform { scale: Vec2::splat(repeats), ..Transform::default() };
        let textures = SurfaceTextures { base_color: Some(texture), ..SurfaceTextures::default() };
        let surface = scene.surface(textured(lambert(Vec3::ONE, Vec3::ZERO), textures));
        scene.place(square(), surface);
        scene.cameras.push(CameraPath::fixed(eye, Vec3::ZERO, fov));
        let weight = frame(&scene, size).matte_weight.unwrap();
        let values: Vec<f32> = weight.data().iter().map(|w| w[0]).collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let deviation = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32;
        (mean, deviation.sqrt())
    };
    // Straight on, with 9 texels in a pixel, and at 9 degrees over it.
    for eye in [Vec3::new(0.0, 0.0, 4.0), Vec3::new(0.0, 3.95, 0.63)] {
        let (mean, deviation) = weights(eye, 3.0, 32.0);
        assert!((mean - 0.5).abs() < 0.01 && deviation < 0.02, "mean {mean}, deviation {deviation} from {eye}");
    }
    // Canary: seen closely the squares are there.
    let (mean, deviation) = weights(Vec3::new(0.0, 0.0, 4.0), 4.0, 1.0);
    assert!((mean - 0.5).abs() < 0.1 && deviation > 0.12, "mean {mean}, deviation {deviation}");
}

/// A floor under a lamp whose image is all but even.
fn textured_lamp(alpha: Alpha, unlit: bool) -> Scene {
    let mut scene = Scene::new("textured lamp");
    // Bright spots in a corner; nearly clear in all other places.
    scene.images.push(image(16, 8, |x, y| {
        let bright = (x * 7 + y * 5) % 11 < 2 || (x < 4 && y < 4);
        if bright { [255, 200, 120, 255] } else { [10, 20, 90, 60] }
    }));
    let mut texture = TextureRef::new(0);
    texture.transform.scale = Vec2::new(0.8, 1.3);
    let mut textures = SurfaceTextures { emissive: Some(texture), ..SurfaceTextures::default() };
    let mut material = lambert(Vec3::ZERO, Vec3::splat(5.0));
    if unlit || alpha != Alpha::Opaque {
        textures.base_color = Some(texture);
    }
    if unlit {
        material = lambert(Vec3::splat(0.9), Vec3::ZERO);
    }
    let lamp = scene.surface(Surface { alpha, unlit, ..textured(material, textures) });
    let floor = scene.surface(lambert(Vec3::splat(0.8), Vec3::ZERO));
    scene.place(shapes::quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0), floor);
    let mut mirrored = glam::Affine3A::from_translation(Vec3::new(0.2, 0.7, 0.0));
    mirrored.matrix3.x_axis *= -1.0;
    scene.place_moving(shapes::quad(Vec3::new(-0.5, 0.0, -0.5), Vec3::Z, Vec3::X), lamp, mirrored);
    scene.place(shapes::quad(Vec3::new(-1.2, 0.5, 0.3), Vec3::new(0.3, 0.6, -0.9), Vec3::X * 0.4), lamp);
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.3, 1.6, 2.4), Vec3::new(0.0, 0.1, 0.0), 45.0));
    scene
}

#[test]
fn textured_lamps_light_alike_by_light_sampling_and_by_hits() {
    // The factored direct term of a rough floor samples lights only; the full integral balances both; the eye sees the
    // lamp by hits only.
    let size = Size::new(12, 7);
    for (alpha, unlit) in
        [(Alpha::Opaque, false), (Alpha::Blend, false), (Alpha::Mask { cutoff: 0.5 }, false), (Alpha::Opaque, true)]
    {
        let scene = textured_lamp(alpha, unlit);
        let factored = reference(&scene, size, ReferenceKind::Factored, 6000);
        let full = reference(&scene, size, ReferenceKind::FullIntegral, 12000);
        let (a, b) = (mean(&factored.beauty), mean(&full.beauty));
        assert!(a.min_element() > 0.01, "{alpha:?}: {a}");
        assert!((a / b - 1.0).abs().max_element() < 0.012, "{alpha:?}, unlit {unlit}: {a} against {b}");
        let mut worst: f32 = 0.0;
        for i in 0..size.pixels() {
            for c in 0..3 {
                let deviation = (factored.variance.data()[i][c] + full.variance.data()[i][c]).sqrt();
                let difference = factored.beauty.data()[i][c] - full.beauty.data()[i][c];
                worst = worst.max(difference.abs() / (deviation + 2e-4 * a.max_element()));
            }
        }
        assert!(worst < 5.5, "{alpha:?}, unlit {unlit}: {worst} standard errors");
    }
}

#[test]
fn the_floor_under_a_textured_lamp_has_the_light_of_its_texels() {
    // Quadrature over the lamp, which shares no code with the tracer's sampling. One lamp faces down at height 1.
    let mut scene = Scene::new("quadrature");
    let radiance = |u: f32, v: f32| if (0.25..0.5).contains(&u) && v < 0.5 { 1.0 } else { 0.0 };
    let code =
        |x: usize, y: usize| if radiance((x as f32 + 0.5) / 64.0, (y as f32 + 0.5) / 64.0) > 0.0 { 255 } else { 0 };
    scene.images.push(image(64, 64, |x, y| [code(x, y), 0, 0, 255]));
    let emissive = SurfaceTextures { emissive: Some(TextureRef::new(0)), ..SurfaceTextures::default() };
    let lamp = scene.surface(textured(lambert(Vec3::ZERO, Vec3::splat(10.0)), emissive));
    let floor = scene.surface(lambert(Vec3::splat(0.8), Vec3::ZERO));
    scene.place(shapes::quad(Vec3::new(-9.0, 0.0, 9.0), Vec3::X * 18.0, Vec3::NEG_Z * 18.0), floor);
    // u along +x, v along +z: the front faces down.
    scene.place(shapes::quad(Vec3::new(-1.0, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0), lamp);
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.0, 0.9, 0.01), Vec3::ZERO, 2.0));
    let found = mean(&reference(&scene, Size::new(3, 3), ReferenceKind::Factored, 4000).direct).x;
    let n = 512;
    let mut irradiance = 0.0_f64;
    for i in 0..n {
        for j in 0..n {
            let (u, v) = ((i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32);
            let (x, z) = (2.0 * u - 1.0, 2.0 * v - 1.0);
            let squared = x * x + z * z + 1.0;
            irradiance += f64::from(10.0 * radiance(u, v) / (squared * squared)) * 4.0 / f64::from(n * n);
        }
    }
    let expected = (0.8 * irradiance / std::f64::consts::PI) as f32;
    assert!((found / expected - 1.0).abs() < 0.01, "{found} instead of {expected}");
}

#[test]
fn masks_cut_holes_for_the_eye_and_for_shadows() {
    // A plate with a clear middle, half way between a floor and a parallel light.
    let mut scene = Scene::new("mask");
    scene.images.push(image(3, 3, |x, y| [255, 255, 255, if (x, y) == (1, 1) { 0 } else { 255 }]));
    let nearest = {
        let mut texture = TextureRef::new(0);
        texture.sampler.mag = quell_trace::texture::Filter::Nearest;
        SurfaceTextures { base_color: Some(texture), ..SurfaceTextures::default() }
    };
    let plate = textured(lambert(Vec3::splat(0.5), Vec3::ZERO), nearest);
    let plate = scene.surface(Surface { alpha: Alpha::Mask { cutoff: 0.5 }, ..plate });
    let floor = scene.surface(lambert(Vec3::splat(0.8), Vec3::ZERO));
    scene.place(shapes::quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0), floor);
    scene.place(shapes::quad(Vec3::new(-1.5, 1.0, 1.5), Vec3::X * 3.0, Vec3::NEG_Z * 3.0), plate);
    let sun = quell_trace::PointlikeLight::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::splat(2.0) };
    scene.lights.push(sun.into());
    scene
        .cameras
        .push(CameraPath { up: Vec3::Z.into(), ..CameraPath::fixed(Vec3::new(0.0, 8.0, 0.0), Vec3::ZERO, 30.0) });
    let frame = frame(&scene, Size::new(31, 31));
    let (ids, direct) = (frame.surface_id.unwrap(), frame.direct.unwrap());
    // The hole shows the floor, in the light that falls through the hole.
    assert_eq!(ids.at(15, 15), 1);
    assert!((direct.at(15, 15)[0] - 0.8 * 2.0 / std::f32::consts::PI).abs() < 1e-3, "{:?}", direct.at(15, 15));
    assert_eq!(ids.at(8, 15), 2);
    // Under the plate, beside the hole, the floor is dark: seen from beside.
    let mut low = scene.clone();
    low.cameras = vec![CameraPath::fixed(Vec3::new(1.0, 0.3, 4.0), Vec3::new(1.0, 0.0, 0.0), 5.0)];
    let shadowed = self::frame(&low, Size::new(5, 5)).direct.unwrap();
    assert_eq!(shadowed.at(2, 2), [0.0; 3]);
}

/// A matte floor under a lamp, with a veil of one opacity between the two and before the eye.
fn veiled(opacity: f32) -> Scene {
    let mut scene = Scene::new("veil");
    let floor = scene.surface(lambert(Vec3::new(0.8, 0.6, 0.4), Vec3::ZERO));
    let lamp = scene.surface(lambert(Vec3::ZERO, Vec3::splat(4.0)));
    let veil = scene.surface(Surface {
        alpha: Alpha::Blend,
        alpha_factor: opacity,
        ..Surface::from(lambert(Vec3::new(0.2, 0.5, 0.9), Vec3::ZERO))
    });
    scene.place(shapes::quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0), floor);
    scene.place(shapes::quad(Vec3::new(-0.5, 2.0, -0.5), Vec3::X, Vec3::Z), lamp);
    scene.place(shapes::quad(Vec3::new(-2.0, 1.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0), veil);
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.3, 1.7, 2.4), Vec3::new(0.0, 0.1, 0.0), 40.0));
    scene
}

#[test]
fn veils_give_the_same_light_by_chance_and_by_choice() {
    let size = Size::new(12, 7);
    for opacity in [0.2, 0.7] {
        let scene = veiled(opacity);
        let a = mean(&reference(&scene, size, ReferenceKind::Factored, 3000).beauty);
        let b = mean(&reference(&scene, size, ReferenceKind::FullIntegral, 12000).beauty);
        assert!((a / b - 1.0).abs().max_element() < 0.012, "opacity {opacity}: {a} against {b}");
        // Canary: another opacity is another picture.
        let other = mean(&reference(&veiled(opacity + 0.05), size, ReferenceKind::FullIntegral, 12000).beauty);
        assert!((a / other - 1.0).abs().max_element() > 0.015, "opacity {opacity}: {a} against {other}");
    }
}

#[test]
fn guides_of_veiled_pixels_have_no_noise() {
    for (opacity, id) in [(0.2, 1), (0.7, 3)] {
        let scene = veiled(opacity);
        let render = |seed| {
            let options = RenderOptions { direct_samples: 1, seed, ..RenderOptions::new(Size::new(16, 9)) };
            Tracer::new(&scene, 0, 1).unwrap().render(&options, &CONTROL).unwrap().frame
        };
        let (a, b) = (render(1), render(2));
        assert_eq!(a.matte_weight, b.matte_weight);
        assert_eq!(a.normal, b.normal);
        assert_eq!(a.view_depth, b.view_depth);
        assert_eq!(a.surface_id, b.surface_id);
        assert_ne!(a.direct, b.direct);
        // Guides describe what shows most.
        assert_eq!(a.surface_id.unwrap().at(8, 5), id, "opacity {opacity}");
        let whole = if opacity < 0.5 { 0.8 * (1.0 - opacity) } else { 0.2 * opacity };
        assert!((a.matte_weight.unwrap().at(8, 5)[0] - whole).abs() < 1e-5, "opacity {opacity}");
    }
}

#[test]
fn opaque_images_do_not_blend() {
    // Files mark materials as blended whose images have no alpha: they cost nothing and change nothing.
    let mut scene = veiled(1.0);
    scene.images.push(checker(4));
    scene.surfaces[2].textures = Some(Box::new(base_color(0)));
    let mut opaque = scene.clone();
    opaque.surfaces[2].alpha = Alpha::Opaque;
    assert_eq!(frame(&scene, Size::new(16, 9)), frame(&opaque, Size::new(16, 9)));
}

/// A square with one texture for everything.
fn mapped(texel: [u8; 4], change: impl Fn(&mut Material, &mut SurfaceTextures, &mut Mesh)) -> Scene {
    let mut scene = Scene::new("mapped");
    scene.images.push(image(1, 1, |_, _| texel));
    let (mut material, mut textures, mut mesh) = (Material::default(), SurfaceTextures::default(), square());
    change(&mut material, &mut textures, &mut mesh);
    let surface = scene.surface(textured(material, textures));
    scene.place(mesh, surface);
    scene.cameras.push(CameraPath::fixed(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 20.0));
    scene
}

#[test]
fn each_texture_multiplies_its_factor() {
    let at = |scene: &Scene| {
        let frame = frame(scene, Size::new(3, 3));
        (
            Vec3::from(frame.matte_weight.unwrap().at(1, 1)),
            Vec3::from(frame.glossy_weight.unwrap().at(1, 1)),
            frame.roughness.unwrap().at(1, 1),
        )
    };
    // sRGB 188 is 0.503 in linear light.
    let half = 0.502_886_5_f32;
    let one = TextureRef::new(0);
    let passed = 0.96_f32 * 0.96;
    let (matte, ..) = at(&mapped([188, 255, 0, 255], |m, t, _| {
        m.base_color = Vec3::splat(0.5);
        t.base_color = Some(one);
    }));
    assert!((matte - Vec3::new(0.5 * half, 0.5, 0.0) * passed).abs().max_element() < 1e-4, "{matte}");
    let (matte, ..) = at(&mapped([255; 4], |_, _, mesh| mesh.colors = vec![Vec4::new(0.5, 0.25, 1.0, 1.0); 4]));
    assert!((matte - Vec3::new(0.5, 0.25, 1.0) * passed).abs().max_element() < 1e-4, "{matte}");
    let (matte, glossy, roughness) = at(&mapped([9, 51, 255, 255], |m, t, _| {
        (m.roughness, m.metallic) = (0.5, 1.0);
        m.base_color = Vec3::splat(0.7);
        t.metallic_roughness = Some(one);
    }));
    assert!((roughness - 0.1).abs() < 1e-4 && (glossy - 0.7).abs().max_element() < 1e-3, "{roughness}, {glossy}");
    assert!(matte.max_element() < 1e-6);
    let (_, glossy, _) = at(&mapped([255, 188, 0, 128], |m, t, _| {
        m.ior = 2.0;
        t.specular = Some(one);
        t.specular_color = Some(one);
    }));
    // Specular by alpha, its colour by sRGB; a ninth is the reflectance of index 2. The floor is 0.02.
    let expected = Vec3::new(1.0, half, 0.0) / 9.0 * (128.0 / 255.0);
    assert!((glossy - expected.max(Vec3::splat(0.02))).abs().max_element() < 1e-3, "{glossy}, not {expected}");
    let (matte, ..) = at(&mapped([51, 9, 9, 9], |m, t, _| {
        (m.transmission, m.thin_walled) = (1.0, true);
        t.transmission = Some(one);
    }));
    assert!((matte.x - 0.8 * passed).abs() < 1e-3, "{matte}");
}

#[test]
fn normal_maps_lean_along_the_texture() {
    // Red leans along +u, green up the picture, whose v runs down.
    let normal = |texel: [u8; 4], change: &dyn Fn(&mut Mesh, &mut TextureRef)| {
        let scene = mapped(texel, |_, textures, mesh| {
            let mut texture = TextureRef::new(0);
            change(mesh, &mut texture);
            textures.normal = Some(NormalMap { texture, scale: 1.0 });
        });
        Vec3::from(frame(&scene, Size::new(3, 3)).normal.unwrap().at(1, 1))
    };
    // 0.6 and 0.8 as codes.
    let (right, up) = ([204, 128, 230, 255], [128, 204, 230, 255]);
    let near = |a: Vec3, b: Vec3| assert!((a - b).abs().max_element() < 0.02, "{a} instead of {b}");
    near(normal(right, &|_, _| {}), Vec3::new(0.6, 0.0, 0.8));
    // The square's v runs up in the world, so up in the picture is down in the world.
    near(normal(up, &|_, _| {}), Vec3::new(0.0, -0.6, 0.8));
    let upright = |mesh: &mut Mesh, _: &mut TextureRef| mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    near(normal(up, &upright), Vec3::new(0.0, 0.6, 0.8));
    near(normal(right, &upright), Vec3::new(0.6, 0.0, 0.8));
    // Mirrored texture coordinates mirror the slope.
    near(normal(right, &|mesh, _| mesh.uvs.iter_mut().for_each(|uv| uv.x = 1.0 - uv.x)), Vec3::new(-0.6, 0.0, 0.8));
    // Given tangents rule: here u is said to run up, and the bitangent to lie on either side.
    for sign in [1.0, -1.0] {
        let given = |mesh: &mut Mesh, _: &mut TextureRef| mesh.tangents = vec![Vec4::new(0.0, 1.0, 0.0, sign); 4];
        near(normal(right, &given), Vec3::new(0.0, 0.6, 0.8));
        near(normal(up, &given), Vec3::new(-0.6 * sign, 0.0, 0.8));
    }
    // A slope that faces away from the viewer is bent back, so that it still mirrors something visible.
    let steep = normal([255, 128, 128, 255], &|_, _| {});
    assert!(steep.x > 0.5 && steep.z > 0.7, "{steep}");
}

#[test]
fn back_sides_of_single_sided_surfaces_are_seen_but_emit_nothing() {
    for (double_sided, seen) in [(false, 0.0), (true, 3.0)] {
        let mut scene = Scene::new("back");
        let surface = Surface { double_sided, ..Surface::from(lambert(Vec3::splat(0.5), Vec3::splat(3.0))) };
        let surface = scene.surface(surface);
        scene.place(square(), surface);
        scene.cameras.push(CameraPath::fixed(Vec3::new(0.0, 0.0, -4.0), Vec3::ZERO, 20.0));
        let frame = frame(&scene, Size::new(3, 3));
        assert_eq!(frame.direct.unwrap().at(1, 1), [seen; 3]);
        assert_eq!(frame.surface_id.unwrap().at(1, 1), 1);
        assert_eq!(frame.normal.unwrap().at(1, 1), [0.0, 0.0, -1.0]);
    }
}

#[test]
fn what_textures_need_and_is_not_there_is_named() {
    let check = |change: &dyn Fn(&mut Scene), expected: &str| {
        let mut scene = mapped([255; 4], |_, textures, _| textures.base_color = Some(TextureRef::new(0)));
        change(&mut scene);
        let Err(error) = Tracer::new(&scene, 0, 1) else { panic!("{expected} is accepted") };
        assert!(matches!(error, SceneError::Index { .. }) && error.to_string().contains(expected), "{error}");
    };
    check(&|scene| scene.images.clear(), "image 0 does not exist");
    check(&|scene| scene.meshes[0].uvs1 = vec![Vec2::ZERO; 3], "second texture coordinate 3 does not exist");
    check(&|scene| scene.meshes[0].colors = vec![Vec4::ONE; 3], "vertex colour 3 does not exist");
    check(&|scene| scene.meshes[0].tangents = vec![Vec4::X; 3], "tangent 3 does not exist");
    // Texture coordinates that are not finite, or absent, are no reason to fail.
    let mut scene = mapped([255; 4], |_, textures, _| textures.base_color = Some(TextureRef::new(0)));
    scene.meshes[0].uvs = vec![Vec2::NAN; 4];
    assert!(frame(&scene, Size::new(3, 3)).matte_weight.unwrap().at(1, 1)[0].is_finite());
    scene.meshes[0].uvs.clear();
    assert!(frame(&scene, Size::new(3, 3)).matte_weight.unwrap().at(1, 1)[0] > 0.9);
}
