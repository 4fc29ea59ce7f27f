//! What does not move: topologies, accessors, hierarchies, cameras, lights, materials, textures.

use crate::gltf::file::{File, warnings};
use glam::{Vec2, Vec3, Vec4};
use quell::Size;
use quell_trace::scene::Alpha;
use quell_trace::texture::{Filter, Wrap};
use quell_trace::{PointlikeLight, Scene, Tracer};
use serde_json::json;

/// World positions of an instance's vertices at a frame.
pub fn world(scene: &Scene, instance: usize, frame: f64) -> Vec<Vec3> {
    let instance = &scene.instances[instance];
    let mesh = &scene.meshes[instance.mesh];
    let transform = instance.transform.at(frame);
    let moved = mesh.deform.as_ref().map_or_else(|| mesh.positions.clone(), |d| d(frame, mesh).0);
    moved.into_iter().map(|p| transform.transform_point3(p)).collect()
}

#[test]
fn a_triangle_without_camera_and_light_is_framed_under_a_sky() {
    let loaded = File::triangle().load();
    assert_eq!(loaded.report.triangles, 1);
    assert_eq!(loaded.scene.frames, 64);
    assert_eq!(loaded.report.notes.len(), 2, "{:?}", loaded.report.notes);
    assert!(loaded.scene.environment.mean_radiance().min_element() > 0.0);
    // The camera sees all of it.
    let size = Size::new(32, 18);
    let camera = loaded.scene.cameras[0].at(0.0, size).unwrap().projection(size).unwrap();
    for p in world(&loaded.scene, 0, 0.0) {
        let pixel = camera.pixel(p).unwrap();
        assert!(pixel.cmpgt(Vec2::ZERO).all() && pixel.cmplt(Vec2::new(32.0, 18.0)).all(), "{pixel}");
    }
    assert_eq!(Tracer::new(&loaded.scene, 0, 1).unwrap().triangles(), 1);
}

#[test]
fn all_component_types_topologies_and_sparse_accessors_give_the_same_square() {
    let square = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)];
    let check = |file: &File, what: &str| {
        let loaded = file.load();
        assert!(warnings(&loaded).is_empty(), "{what}: {}", warnings(&loaded));
        let scene = &loaded.scene;
        let mesh = &scene.meshes[0];
        let positions = world(scene, 0, 0.0);
        let mut area = 0.0;
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            let normal = (b - a).cross(c - a) * 0.5;
            assert!(normal.z > 0.0, "{what}: {t:?}");
            area += normal.z;
        }
        assert!((area - 1.0).abs() < 1e-4, "{what}: {area}");
        for p in square {
            assert!(positions.iter().any(|q| q.abs_diff_eq(p, 1e-4)), "{what}: {p}");
        }
    };
    let flat: Vec<f32> = square.iter().flat_map(|p| p.to_array()).collect();
    let list = [0_u16, 1, 3, 0, 3, 2];
    // Indices of each width, in each topology.
    for (what, component, mode, indices) in [
        ("bytes", 5121, 4, list.to_vec()),
        ("shorts", 5123, 4, list.to_vec()),
        ("ints", 5125, 4, list.to_vec()),
        ("strip", 5123, 5, vec![0, 1, 2, 3]),
        ("fan", 5123, 6, vec![0, 1, 3, 2]),
    ] {
        let mut file = File::empty();
        let positions = file.floats("VEC3", &flat);
        let bytes: Vec<u8> = indices
            .iter()
            .flat_map(|&i| match component {
                5121 => vec![i as u8],
                5123 => i.to_le_bytes().to_vec(),
                _ => u32::from(i).to_le_bytes().to_vec(),
            })
            .collect();
        let indices = file.accessor("SCALAR", component, indices.len(), &bytes);
        let mesh = file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices, "mode": mode}));
        file.shown(json!({"mesh": mesh}));
        check(&file, what);
    }
    // Without indices.
    let mut file = File::empty();
    let corners: Vec<f32> = list.iter().flat_map(|&i| square[usize::from(i)].to_array()).collect();
    let positions = file.floats("VEC3", &corners);
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions}}));
    file.shown(json!({"mesh": mesh}));
    check(&file, "no indices");
    // Quantised: normalised or scaled by the node.
    for (what, component, one, normalized) in [
        ("i8 normalised", 5120, 127_i32, true),
        ("u8 normalised", 5121, 255, true),
        ("i16 normalised", 5122, 32767, true),
        ("u16 normalised", 5123, 65535, true),
        ("i8", 5120, 100, false),
        ("u16", 5123, 40000, false),
    ] {
        let mut file = File::empty();
        let wide = matches!(component, 5122 | 5123);
        // Elements are padded to a multiple of four bytes.
        let bytes: Vec<u8> = square
            .iter()
            .flat_map(|p| {
                let [x, y, z] = p.to_array().map(|v| v as i32 * one);
                [x, y, z, 0]
                    .into_iter()
                    .flat_map(move |v| if wide { (v as u16).to_le_bytes().to_vec() } else { vec![v as u8] })
            })
            .collect();
        let positions = file.accessor("VEC3", component, 4, &bytes);
        let view = file.json["accessors"][positions]["bufferView"].as_u64().unwrap() as usize;
        file.json["bufferViews"][view]["byteStride"] = (if wide { 8 } else { 4 }).into();
        file.json["accessors"][positions]["normalized"] = normalized.into();
        file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let indices = file.indices(&list);
        let mesh = file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}));
        let scale = if normalized { 1.0 } else { 1.0 / one as f32 };
        file.shown(json!({"mesh": mesh, "scale": [scale, scale, scale]}));
        check(&file, what);
    }
    // Zeros with some elements replaced.
    let mut file = File::empty();
    let numbers: Vec<u8> = [1_u16, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
    let numbers = file.view(&numbers);
    let values: Vec<u8> = flat[3..].iter().flat_map(|v| v.to_le_bytes()).collect();
    let values = file.view(&values);
    let positions = file.push(
        "accessors",
        json!({"componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
            "count": 3,
            "indices": {"bufferView": numbers, "componentType": 5123},
            "values": {"bufferView": values},
        }}),
    );
    let indices = file.indices(&list);
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}));
    file.shown(json!({"mesh": mesh}));
    check(&file, "sparse");
}

#[test]
fn hierarchies_cameras_and_lights_stand_where_their_nodes_do() {
    let mut file = File::triangle();
    file.json["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "aspectRatio": 2.0}},
        {"type": "orthographic", "name": "plan", "orthographic": {"xmag": 4.0, "ymag": 2.0, "znear": 0.0, "zfar": 9.0}},
    ]);
    file.json["extensionsUsed"] = json!(["KHR_lights_punctual", "VENDOR_unheard_of"]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 3.0, "color": [1.0, 0.5, 0.25], "range": 5.0},
        {"type": "spot", "intensity": 2.0, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}},
        {"type": "directional"},
    ]}});
    // A quarter turn about y takes -z to -x and x to -z.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let camera = file.push("nodes", json!({"name": "eye", "camera": 0, "translation": [0.0, 0.0, 2.0]}));
    let lights: Vec<usize> =
        (0..3).map(|l| file.push("nodes", json!({"extensions": {"KHR_lights_punctual": {"light": l}}}))).collect();
    let plan = file.push("nodes", json!({"camera": 1}));
    file.shown(json!({
        "rotation": [0.0, half, 0.0, half], "translation": [1.0, 2.0, 3.0], "scale": [2.0, 2.0, 2.0],
        "children": [camera, lights[0], lights[1], lights[2], plan],
    }));
    let loaded = file.load();
    let size = Size::new(32, 18);
    let eye = loaded.scene.cameras[0].at(0.0, size).unwrap();
    assert!(Vec3::from(eye.position).abs_diff_eq(Vec3::new(5.0, 2.0, 3.0), 1e-5), "{eye:?}");
    let projection = eye.projection(size).unwrap();
    assert!(Vec3::from(projection.forward()).abs_diff_eq(Vec3::NEG_X, 1e-6));
    assert!((projection.focal_px - 9.0 / 0.4_f32.tan()).abs() < 1e-3);
    let plan = loaded.scene.cameras[1].at(0.0, size).unwrap().projection(size).unwrap();
    assert!(!plan.perspective && (plan.focal_px - 18.0 / 4.0).abs() < 1e-4);
    let names: Vec<_> = loaded.report.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["eye", "plan"]);
    assert_eq!(loaded.report.cameras[0].aspect, Some(2.0));

    let PointlikeLight::Point { position, intensity } = loaded.scene.lights[0].at(0.0) else { panic!() };
    assert!(position.abs_diff_eq(Vec3::new(1.0, 2.0, 3.0), 1e-6));
    assert_eq!(intensity, Vec3::new(3.0, 1.5, 0.75));
    let PointlikeLight::Spot { direction, inner, outer, .. } = loaded.scene.lights[1].at(0.0) else { panic!() };
    assert!(direction.abs_diff_eq(Vec3::NEG_X, 1e-6));
    assert_eq!((inner, outer), (0.1, 0.4));
    let PointlikeLight::Directional { irradiance, .. } = loaded.scene.lights[2].at(0.0) else { panic!() };
    assert_eq!(irradiance, Vec3::ONE);
    assert!(warnings(&loaded).contains("extensionsUsed: VENDOR_unheard_of is not read"));
    assert!(loaded.report.ignored[0].to_string().contains("lights[0].range"), "{:?}", loaded.report.ignored);
    // Something shines: no sky.
    assert_eq!(loaded.scene.environment.mean_radiance(), Vec3::ZERO);
}

#[test]
fn matrices_and_scenes_are_chosen_and_shared_meshes_stay_one() {
    let mut file = File::triangle();
    let matrix = [0.0, 0.0, -2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 7.0, 8.0, 9.0, 1.0];
    let node = file.push("nodes", json!({"mesh": 0, "matrix": matrix}));
    file.push("scenes", json!({"name": "other", "nodes": [node, 0]}));
    let choose = |scene: Option<&str>| {
        let options = quell_trace::gltf::Options { scene: scene.map(str::to_owned), ..Default::default() };
        file.try_load_with(&options)
    };
    assert_eq!(choose(None).unwrap().scene.instances.len(), 1);
    for name in ["other", "2"] {
        let loaded = choose(Some(name)).unwrap();
        assert_eq!((loaded.scene.instances.len(), loaded.scene.meshes.len()), (2, 1));
        // Column 0 of the matrix is where x goes.
        assert!(world(&loaded.scene, 0, 0.0)[1].abs_diff_eq(Vec3::new(7.0, 8.0, 7.0), 1e-6));
        assert_ne!(loaded.scene.identity, choose(None).unwrap().scene.identity);
    }
    let error = choose(Some("third")).unwrap_err().to_string();
    assert_eq!(error, "test.glb: there is no scene `third`; there are: 1, other");
    assert!(choose(Some("0")).is_err() && choose(Some("3")).is_err());
}

/// A red, half clear image of 2 x 1 texels.
fn png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let image = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([255, 0, 0, if x == 0 { 255 } else { 0 }]));
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

#[test]
fn materials_textures_and_vertex_colours_arrive() {
    let mut file = File::triangle();
    let uv = file.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let normals = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let colors = file.accessor("VEC3", 5121, 3, &[255, 0, 0, 0, 255, 0, 0, 0, 255]);
    file.json["accessors"][colors]["normalized"] = true.into();
    let attributes = &mut file.json["meshes"][0]["primitives"][0];
    attributes["attributes"]["TEXCOORD_0"] = uv.into();
    attributes["attributes"]["TEXCOORD_1"] = uv.into();
    attributes["attributes"]["NORMAL"] = normals.into();
    attributes["attributes"]["COLOR_0"] = colors.into();
    attributes["material"] = 0.into();
    let view = file.view(&png());
    file.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    file.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "minFilter": 9984, "magFilter": 9729}]);
    file.json["textures"] = json!([{"source": 0, "sampler": 0}, {"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    file.json["materials"] = json!([{
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1.0, 0.75], "metallicFactor": 0.25, "roughnessFactor": 0.5,
            "baseColorTexture": {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {
                "offset": [0.5, 0.25], "rotation": 1.5, "scale": [2.0, 3.0], "texCoord": 0}}},
            "metallicRoughnessTexture": {"index": 1},
        },
        "normalTexture": {"index": 0, "scale": 0.5, "texCoord": 1},
        "occlusionTexture": {"index": 0},
        "emissiveFactor": [1.0, 0.5, 0.0],
        "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": true,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 4.0},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_transmission": {"transmissionFactor": 0.5},
            "KHR_materials_volume": {"thicknessFactor": 1.0, "attenuationDistance": 2.0, "attenuationColor": [1.0, 0.5, 0.5]},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1.0, 0.0, 1.0]},
        },
    }]);
    let loaded = file.load();
    assert!(warnings(&loaded).is_empty(), "{}", warnings(&loaded));
    let scene = &loaded.scene;
    let surface = &scene.surfaces[0];
    let m = &surface.material;
    assert_eq!(m.base_color, Vec3::new(0.5, 0.25, 1.0));
    assert_eq!((m.metallic, m.roughness, m.ior, m.transmission), (0.25, 0.5, 1.33, 0.5));
    assert_eq!((m.emission, m.two_sided_emission, surface.double_sided), (Vec3::new(4.0, 2.0, 0.0), true, true));
    assert_eq!((m.thin_walled, m.attenuation_distance), (false, 2.0));
    assert_eq!((m.specular, m.specular_color), (0.5, Vec3::new(1.0, 0.0, 1.0)));
    assert_eq!((surface.alpha, surface.alpha_factor), (Alpha::Mask { cutoff: 0.4 }, 0.75));
    let textures = surface.textures.as_ref().unwrap();
    let base = textures.base_color.unwrap();
    assert_eq!((base.image, base.uv_set), (0, 0));
    assert_eq!((base.sampler.wrap_s, base.sampler.wrap_t), (Wrap::Clamp, Wrap::Mirror));
    assert_eq!((base.sampler.min, base.sampler.mag), (Filter::Nearest, Filter::Linear));
    assert_eq!((base.transform.offset, base.transform.rotation), (Vec2::new(0.5, 0.25), 1.5));
    assert_eq!(base.transform.scale, Vec2::new(2.0, 3.0));
    assert_eq!(textures.metallic_roughness.unwrap().image, 0);
    assert_eq!(textures.normal.unwrap().texture.uv_set, 1);
    assert_eq!(textures.normal.unwrap().scale, 0.5);
    assert_eq!(scene.images.len(), 1);
    assert_eq!((scene.images[0].width(), scene.images[0].height(), scene.images[0].is_opaque()), (2, 1, false));
    let mesh = &scene.meshes[0];
    assert_eq!(
        mesh.colors,
        [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 1.0, 1.0)]
    );
    assert_eq!((mesh.uvs.len(), mesh.uvs1.len(), mesh.normals.len()), (3, 3, 3));
    // Generated: along u, with v running down.
    assert!(mesh.tangents.iter().all(|t| t.abs_diff_eq(Vec4::new(1.0, 0.0, 0.0, -1.0), 1e-5)), "{:?}", mesh.tangents);
    let ignored: String = loaded.report.ignored.iter().map(ToString::to_string).collect();
    assert!(ignored.contains("materials[0].occlusionTexture: not used: what it fakes is traced"), "{ignored}");
    // Primitives without material have glTF's default: white, metallic 1, rough.
    let default = &scene.surfaces[1].material;
    assert_eq!((default.base_color, default.metallic, default.roughness), (Vec3::ONE, 1.0, 1.0));
}

#[test]
fn embedded_and_external_data_are_read() {
    use base64::Engine;
    let file = File::triangle();
    let expected = world(&file.load().scene, 0, 0.0);
    let folder = std::env::temp_dir().join(format!("quell-gltf-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("da ta")).unwrap();
    std::fs::write(folder.join("da ta/buffer.bin"), &file.bytes).unwrap();
    let embedded = base64::engine::general_purpose::STANDARD.encode(&file.bytes);
    for uri in [format!("data:application/octet-stream;base64,{embedded}"), "da%20ta/buffer.bin".to_owned()] {
        let path = folder.join("scene.gltf");
        std::fs::write(&path, serde_json::to_vec(&file.text(Some(&uri))).unwrap()).unwrap();
        let loaded = quell_trace::gltf::load(&path, &Default::default()).unwrap();
        assert_eq!(world(&loaded.scene, 0, 0.0), expected);
        assert_eq!(loaded.scene.name, "scene");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn loading_tells_how_far_it_is() {
    use quell_trace::gltf::{Stage, load_watched};
    let path = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf/rich.glb");
    let told = std::sync::Mutex::new(Vec::new());
    let watcher = |stage: Stage, done: usize, total: usize| told.lock().unwrap().push((stage, done, total));
    let loaded = load_watched(&path, &quell_trace::gltf::Options::default(), &watcher).unwrap();
    let told = told.into_inner().unwrap();
    for (stage, total) in [(Stage::Images, loaded.report.images), (Stage::Meshes, loaded.report.meshes)] {
        assert!(total > 0);
        let mut of: Vec<usize> = told.iter().filter(|t| t.0 == stage && t.2 == total).map(|t| t.1).collect();
        of.sort_unstable();
        assert_eq!(of, (0..=total).collect::<Vec<_>>(), "{stage:?}: {told:?}");
    }
}
