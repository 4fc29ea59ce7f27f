//! Files that are broken: each is answered with its own message, or loads with its own warning. Nothing panics.

use crate::gltf::file::{File, warnings};
use proptest::prelude::*;
use quell_trace::gltf::{self, Limits, Options};
use quell_trace::{Control, RenderOptions, Tracer};
use serde_json::{Value, json};
use std::path::Path;

fn load_bytes(bytes: Vec<u8>) -> Result<gltf::Loaded, String> {
    gltf::load_bytes(bytes, Path::new("."), "test.glb", &small()).map_err(|e| e.to_string())
}

/// Limits that keep what a broken number may ask for small.
pub fn small() -> Options {
    let limits = Limits { file_bytes: 1 << 20, json_bytes: 1 << 20, decoded_bytes: 16 << 20, triangles: 100_000 };
    Options { limits, ..Options::default() }
}

/// A file with one of everything that is read.
pub fn rich() -> File {
    let mut file = File::triangle();
    let uv = file.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let normals = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let offsets = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let indices = file.indices(&[0, 1, 2]);
    let joints = file.accessor("VEC4", 5121, 3, &[0; 12]);
    let weights = file.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let mut bytes = Vec::new();
    let image = image::RgbaImage::from_pixel(2, 2, image::Rgba([200, 100, 50, 255]));
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    let view = file.view(&bytes);
    let index = file.view(&[1, 0]);
    let value = file.view(&1.5_f32.to_le_bytes().repeat(3));
    file.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": index, "componentType": 5123}, "values": {"bufferView": value},
    });
    file.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    file.json["samplers"] = json!([{"wrapS": 33071}]);
    file.json["textures"] = json!([{"source": 0, "sampler": 0}]);
    file.json["materials"] = json!([{
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "normalTexture": {"index": 0}, "emissiveFactor": [1.0, 1.0, 1.0], "alphaMode": "BLEND",
    }]);
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    file.json["meshes"][0]["primitives"][0] = json!({
        "attributes": {"POSITION": 0, "NORMAL": normals, "TEXCOORD_0": uv, "JOINTS_0": joints, "WEIGHTS_0": weights},
        "indices": indices, "material": 0, "targets": [{"POSITION": offsets}],
    });
    file.shown(
        json!({"camera": 0, "translation": [0.3, 0.3, 3.0], "extensions": {"KHR_lights_punctual": {"light": 0}}}),
    );
    let joint = file.shown(json!({"translation": [0.0, 0.0, 0.0]}));
    file.json["nodes"][0]["skin"] = 0.into();
    file.json["skins"] = json!([{"joints": [joint]}]);
    file.clip("move", joint, "rotation", "LINEAR", &[0.0, 0.5], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.6, 0.8]);
    file.clip("morph", 0, "weights", "CUBICSPLINE", &[0.0, 0.5], &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    file
}

/// Loads a file, and if it loads, traces a little of it: what gets through must do no harm later. Whether it loaded.
pub fn try_all(bytes: &[u8]) -> bool {
    let Ok(loaded) = gltf::load_bytes(bytes.to_vec(), Path::new("no such folder"), "test.glb", &small()) else {
        return false;
    };
    if let Ok(tracer) = Tracer::new(&loaded.scene, 3, 1) {
        let options = RenderOptions { direct_samples: 1, bounces: 1, ..RenderOptions::new(quell::Size::new(4, 3)) };
        let _ = tracer.render(&options, &Control::default());
    }
    true
}

#[test]
fn the_rich_file_is_sound() {
    let loaded = rich().load();
    assert!(warnings(&loaded).is_empty(), "{}", warnings(&loaded));
    assert_eq!((loaded.report.deforming_meshes, loaded.report.images, loaded.report.lights), (1, 1, 1));
    assert_eq!(loaded.report.clips.len(), 2);
    Tracer::new(&loaded.scene, 3, 1).unwrap();
}

#[test]
fn a_container_cut_at_any_byte_is_an_error() {
    for file in [File::triangle().glb(), rich().glb()] {
        for length in 0..file.len() {
            let error = load_bytes(file[..length].to_vec()).map(|_| ()).unwrap_err();
            let expected = if length == 0 { "it is empty" } else { "is cut off" };
            assert!(error.contains(expected), "{length}: {error}");
        }
        load_bytes(file).unwrap();
    }
}

#[test]
fn json_cut_at_any_byte_is_an_error_or_the_same_file() {
    let text = serde_json::to_vec(&rich().text(None)).unwrap();
    for length in 0..text.len() {
        assert!(load_bytes(text[..length].to_vec()).is_err(), "{length}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn flipped_bytes_do_no_harm(flips in prop::collection::vec((0_usize..100_000, any::<u8>()), 1..8)) {
        let mut bytes = rich().glb();
        for (at, value) in flips {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        try_all(&bytes);
    }

    #[test]
    fn replaced_numbers_do_no_harm(
        which in 0_usize..10_000,
        value in prop::sample::select(vec![
            json!(0), json!(1), json!(-1), json!(255), json!(5126), json!(u64::MAX), json!(i64::MIN), json!(1e308), json!(1e-300),
            json!(0.5), json!(4_294_967_295_u64), json!("x"), json!(null), json!([]), json!({}), json!(true),
        ]),
    ) {
        let mut file = rich();
        let mut leaves = Vec::new();
        collect(&file.json, &mut String::new(), &mut leaves);
        let path = &leaves[which % leaves.len()];
        *file.json.pointer_mut(path).unwrap() = value;
        try_all(&file.glb());
    }
}

/// Paths of all numbers and texts.
fn collect(value: &Value, path: &mut String, out: &mut Vec<String>) {
    let length = path.len();
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                path.push('/');
                path.push_str(name);
                collect(value, path, out);
                path.truncate(length);
            }
        }
        Value::Array(items) => {
            for (index, value) in items.iter().enumerate() {
                path.push_str(&format!("/{index}"));
                collect(value, path, out);
                path.truncate(length);
            }
        }
        _ => out.push(path.clone()),
    }
}

#[test]
fn files_that_are_no_gltf_say_so() {
    let missing = gltf::load(Path::new("no/such/file.glb"), &Options::default()).unwrap_err().to_string();
    assert!(missing.starts_with("no/such/file.glb: cannot be read: "), "{missing}");
    let folder = gltf::load(Path::new("."), &Options::default()).unwrap_err().to_string();
    assert!(folder.contains("it is a folder or a device"), "{folder}");
    for (bytes, expected) in [
        (
            &b"\x89PNG\r\n"[..],
            "test.glb: is no glTF file: it begins neither with `glTF` nor with JSON; export the scene",
        ),
        (b"{", "test.glb: the JSON is not what glTF prescribes: EOF while parsing an object"),
        (b"{}", "asset.version: is no glTF file: its JSON has no `asset.version`"),
        (br#"{"asset": {"version": "1.0"}}"#, "is no glTF file: it is written in version 1.0, not 2.0"),
        (br#"{"asset": {"version": "2.0"}}"#, "test.glb: holds no triangle that can be shown"),
        (br#"{"asset": {"version": "2.0"}} x"#, "trailing characters"),
        (b"glTF\x01\0\0\0\x14\0\0\0\0\0\0\0\0\0\0\0", "its container has version 1, not 2"),
        (b"glTF\x02\0\0\0\x14\0\0\0\0\0\0\0BIN\0", "its first chunk is not JSON"),
    ] {
        let error = load_bytes(bytes.to_vec()).map(|_| ()).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
    let nested = [b"{\"asset\":".to_vec(), b"[".repeat(100_000)].concat();
    assert!(load_bytes(nested).unwrap_err().contains("the JSON is not"));
}

/// A change of the triangle's file, and what the loader says: an error, or a warning where the file loads.
type Case = (&'static str, fn(&mut File), &'static str);

const REFUSED: &[Case] = &[
    (
        "a type",
        |f| f.json["nodes"][0]["mesh"] = json!("x"),
        "nodes[0].mesh: the JSON is not what glTF prescribes: invalid type: string \"x\"",
    ),
    (
        "a count of 2^64",
        |f| f.json["accessors"][0]["count"] = json!(1.8446744073709552e19),
        "accessors[0].count: the JSON is not",
    ),
    (
        "a count of 2^64 - 1",
        |f| f.json["accessors"][0]["count"] = json!(u64::MAX),
        "meshes[0].primitives[0].attributes.POSITION -> accessors[0]: 18446744073709551615 elements of 12 bytes, 12 apart from byteOffset 0 on, reach beyond the 36 bytes of the buffer view; export the file again",
    ),
    (
        "as many without bytes",
        |f| {
            f.json["accessors"][0]["count"] = json!(u64::MAX);
            f.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        },
        "bytes of data: 18446744073709551615 exceed the limit",
    ),
    ("one too many", |f| f.json["accessors"][0]["count"] = json!(4), "4 elements of 12 bytes"),
    (
        "an offset",
        |f| f.json["accessors"][0]["byteOffset"] = json!(u64::MAX),
        "from byteOffset 18446744073709551615 on, reach beyond the 36 bytes",
    ),
    (
        "a view's offset",
        |f| f.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX),
        "bufferViews[0]: byteOffset 18446744073709551615 and byteLength 36 reach beyond buffer 0, which has 36 bytes",
    ),
    (
        "a view's length",
        |f| f.json["bufferViews"][0]["byteLength"] = json!(37),
        "bufferViews[0]: byteOffset 0 and byteLength 37 reach beyond",
    ),
    (
        "a short stride",
        |f| f.json["bufferViews"][0]["byteStride"] = json!(8),
        "accessors[0]: the byteStride of 8 is shorter than an element, which has 12 bytes",
    ),
    (
        "a long stride",
        |f| f.json["bufferViews"][0]["byteStride"] = json!(u64::MAX),
        "accessors[0]: 3 elements of 12 bytes, 18446744073709551615 apart",
    ),
    ("a stride of 0", |f| f.json["bufferViews"][0]["byteStride"] = json!(0), "the byteStride of 0 is shorter"),
    (
        "a component type",
        |f| f.json["accessors"][0]["componentType"] = json!(5124),
        "accessors[0].componentType: componentType 5124 does not exist",
    ),
    (
        "a type of element",
        |f| f.json["accessors"][0]["type"] = json!("VEC2"),
        "accessors[0].type: is of type VEC2, where VEC3 is needed",
    ),
    ("an unknown type", |f| f.json["accessors"][0]["type"] = json!("VEC5"), "accessors[0].type: `VEC5` is no type"),
    (
        "an accessor",
        |f| f.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(7),
        "attributes.POSITION: names accessor 7, but there are 1 (counted from 0)",
    ),
    ("a view", |f| f.json["accessors"][0]["bufferView"] = json!(7), "accessors[0].bufferView: names buffer view 7"),
    ("a buffer", |f| f.json["bufferViews"][0]["buffer"] = json!(7), "bufferViews[0].buffer: names buffer 7"),
    (
        "a longer buffer",
        |f| f.json["buffers"] = json!([{"byteLength": 999}]),
        "buffers[0]: is cut off: byteLength needs 999 bytes, 36 are there",
    ),
    ("a mesh", |f| f.json["nodes"][0]["mesh"] = json!(9), "nodes[0].mesh: names mesh 9, but there are 1"),
    (
        "a material",
        |f| f.json["meshes"][0]["primitives"][0]["material"] = json!(9),
        "meshes[0].primitives[0].material: names material 9",
    ),
    ("a camera", |f| f.json["nodes"][0]["camera"] = json!(9), "nodes[0].camera: names camera 9, but there are 0"),
    ("a skin", |f| f.json["nodes"][0]["skin"] = json!(9), "nodes[0].skin: names skin 9"),
    ("a scene", |f| f.json["scene"] = json!(9), "scene: names scene 9"),
    ("a node", |f| f.json["scenes"][0]["nodes"] = json!([9]), "scenes[0].nodes[0]: names node 9"),
    ("a child", |f| f.json["nodes"][0]["children"] = json!([9]), "nodes[0].children[0]: names node 9"),
    (
        "a light",
        |f| f.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 4}}),
        "nodes[0].extensions.KHR_lights_punctual.light: names light 4",
    ),
    (
        "its own child",
        |f| f.json["nodes"][0]["children"] = json!([0]),
        "nodes[0].children[0]: the node is its own child; nodes must form a tree",
    ),
    (
        "two parents",
        |f| {
            f.push("nodes", json!({"children": [0]}));
            f.push("nodes", json!({"children": [0]}));
        },
        "nodes[2].children[0]: node 0 is a child of node 1 already",
    ),
    (
        "a ring",
        |f| {
            f.json["nodes"][0]["children"] = json!([1]);
            f.push("nodes", json!({"children": [0]}));
        },
        "nodes[0]: the node is its own ancestor",
    ),
    (
        "an index beyond",
        |f| {
            let i = f.indices(&[0, 1, 3]);
            f.json["meshes"][0]["primitives"][0]["indices"] = json!(i);
        },
        "meshes[0].primitives[0].indices: names vertex 3, but there are 3",
    ),
    (
        "fractional indices",
        |f| f.json["meshes"][0]["primitives"][0]["indices"] = json!(0),
        "accessors[0].type: is of type VEC3, where SCALAR is needed",
    ),
    (
        "fewer normals",
        |f| {
            let n = f.floats("VEC3", &[0.0, 0.0, 1.0]);
            f.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(n);
        },
        "attributes.NORMAL: has 1 elements for 3 positions",
    ),
    (
        "a required extension",
        |f| f.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
        "extensionsRequired: requires KHR_draco_mesh_compression, which quell does not read; export the scene without",
    ),
    (
        "a sparse element beyond",
        |f| {
            let i = f.view(&[3]);
            let v = f.view(&[0; 12]);
            f.json["accessors"][0]["sparse"] =
                json!({"count": 1, "indices": {"bufferView": i, "componentType": 5121}, "values": {"bufferView": v}});
        },
        "accessors[0].sparse.indices: names element 3, but there are 3",
    ),
    (
        "too many sparse elements",
        |f| f.json["accessors"][0]["sparse"] = json!({"count": u64::MAX, "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 0}}),
        "accessors[0].sparse.count: 18446744073709551615 replaced elements are more than the accessor's 3",
    ),
    (
        "a buffer without data",
        |f| f.json["buffers"] = json!([{"byteLength": 36}, {"byteLength": 4}]),
        "buffers[1]: has no `uri`, and the file has no binary chunk for it",
    ),
    (
        "an absolute path",
        |f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "/etc/passwd"}]),
        "buffers[0].uri: the external file `/etc/passwd` lies outside the scene's folder and is not read",
    ),
    (
        "a path upwards",
        |f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "a/../../secret"}]),
        "lies outside the scene's folder",
    ),
    (
        "a hidden path upwards",
        |f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "%2e%2e/secret"}]),
        "lies outside the scene's folder",
    ),
    (
        "an address",
        |f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "https://example.com/a.bin"}]),
        "is an address, not a file beside the scene; download it",
    ),
    (
        "a missing file",
        |f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "no-such.bin"}]),
        "buffers[0].uri: the external file `no-such.bin` cannot be read",
    ),
    (
        "broken base64",
        |f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "data:;base64,!!"}]),
        "buffers[0].uri: is no valid base64",
    ),
    (
        "other embedding",
        |f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "data:text/plain,hello"}]),
        "is embedded data, but not as base64",
    ),
    ("nothing to see", |f| f.json["scenes"][0]["nodes"] = json!([]), "holds no triangle that can be shown"),
    (
        "a texture",
        |f| {
            f.json["materials"] = json!([{"emissiveTexture": {"index": 3}}]);
            f.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        },
        "names texture 3, but there are 0",
    ),
    (
        "an image",
        |f| {
            f.json["materials"] = json!([{"emissiveTexture": {"index": 0}}]);
            f.json["textures"] = json!([{"source": 5}]);
            f.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        },
        "textures[0].source: names image 5, but there are 0",
    ),
];

/// Adds a sound triangle, so that the file loads whatever becomes of the first.
fn beside(file: &mut File) {
    let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions}}));
    file.shown(json!({"mesh": mesh}));
}

fn textured(file: &mut File, image: Value) {
    file.json["images"] = json!([image]);
    file.json["textures"] = json!([{"source": 0}]);
    file.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
}

const WARNED: &[Case] = &[
    (
        "a count of 0",
        |f| f.json["accessors"][0]["count"] = json!(0),
        "attributes.POSITION -> accessors[0].count: has a count of 0, where glTF demands at least 1; export the file again: the primitive is left out",
    ),
    (
        "points",
        |f| f.json["meshes"][0]["primitives"][0]["mode"] = json!(0),
        "meshes[0].primitives[0].mode: points and lines have no surface: the primitive is left out",
    ),
    ("an unknown mode", |f| f.json["meshes"][0]["primitives"][0]["mode"] = json!(99), "mode: this mode does not exist"),
    ("no positions", |f| f.json["meshes"][0]["primitives"][0]["attributes"] = json!({}), "attributes: has no POSITION"),
    (
        "NaN",
        |f| f.bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes()),
        "attributes.POSITION: 1 vertices are not finite or farther than 1e15: 1 triangles are left out",
    ),
    (
        "far away",
        |f| f.bytes[..4].copy_from_slice(&1e30_f32.to_le_bytes()),
        "1 vertices are not finite or farther than",
    ),
    (
        "a singular matrix",
        |f| f.json["nodes"][0]["scale"] = json!([1.0, 1.0, 0.0]),
        "nodes[0]: the transform is singular",
    ),
    (
        "an infinite transform",
        |f| f.json["nodes"][0]["translation"] = json!([1e39, 0.0, 0.0]),
        "nodes[0]: the transform is not finite: the node and all below it are left out",
    ),
    (
        "an infinite matrix",
        |f| f.json["nodes"][0]["matrix"] = json!([1e39, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "nodes[0]: the transform is not finite",
    ),
    (
        "a rotation of length 0",
        |f| f.json["nodes"][0]["rotation"] = json!([0.0, 0.0, 0.0, 0.0]),
        "nodes[0].rotation: is no rotation (its length is 0)",
    ),
    (
        "a place beyond single precision",
        |f| {
            f.json["nodes"][0]["scale"] = json!([1e30, 1e30, 1e30]);
            let n = f.push("nodes", json!({"children": [0], "scale": [1e30, 1e30, 1e30]}));
            f.json["scenes"][0]["nodes"] = json!([n, 1]);
        },
        "nodes[0]: stands where arithmetic in single precision ends",
    ),
    (
        "a lamp without area",
        |f| {
            f.bytes[12..24].fill(0);
            f.json["materials"] = json!([{"emissiveFactor": [1.0, 1.0, 1.0]}]);
            f.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        },
        "nodes[0]: emits, but has no area: it lights nothing",
    ),
    (
        "a picture that is none",
        |f| {
            let view = f.view(b"no picture");
            textured(f, json!({"bufferView": view}));
        },
        "images[0]: the image is neither PNG nor JPEG nor WebP",
    ),
    (
        "a picture that is missing",
        |f| textured(f, json!({"uri": "no-such.png"})),
        "images[0]: the external file `no-such.png` cannot be read",
    ),
    (
        "a picture outside",
        |f| textured(f, json!({"uri": "../x.png"})),
        "lies outside the scene's folder and is not read",
    ),
    (
        "an absurd picture",
        |f| {
            let view = f.view(&absurd_png());
            textured(f, json!({"bufferView": view}));
        },
        "images[0]: the image is 60000 x 60000, over the limit",
    ),
    (
        "texture coordinates 2",
        |f| {
            let view = f.view(b"x");
            textured(f, json!({"bufferView": view}));
            f.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(2);
            let png = small_png();
            let v = f.view(&png);
            f.json["images"][0]["bufferView"] = json!(v);
        },
        "uses texture coordinates 2; quell reads 0 and 1",
    ),
    ("a light of no kind", |f| light(f, json!({"type": "area"})), "lights[0].type: is unknown: the light is left out"),
    ("a black light", |f| light(f, json!({"type": "point", "intensity": 0.0})), "lights[0]: is black"),
    (
        "a light that is not finite",
        |f| light(f, json!({"type": "point", "intensity": 1e39})),
        "lights[0]: colour and intensity must be finite",
    ),
    (
        "a cone inside out",
        |f| light(f, json!({"type": "spot", "spot": {"innerConeAngle": 1.0, "outerConeAngle": 0.5}})),
        "lights[0].spot: needs 0 <= inner <= outer",
    ),
    (
        "a camera without lens",
        |f| {
            f.json["cameras"] = json!([{"type": "perspective"}]);
            f.json["nodes"][0]["camera"] = json!(0);
        },
        "cameras[0]: has no lens that fits its type",
    ),
    (
        "a camera with an angle of 200 degrees",
        |f| {
            f.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 3.5}}]);
            f.json["nodes"][0]["camera"] = json!(0);
        },
        "cameras[0]: its angle or height is out of range",
    ),
    (
        "an alpha mode",
        |f| f.json["materials"] = json!([{"alphaMode": "GLOW"}]),
        "materials[0].alphaMode: is unknown: the surface is opaque",
    ),
    (
        "an index of refraction of 0.5",
        |f| f.json["materials"] = json!([{"extensions": {"KHR_materials_ior": {"ior": 0.5}}}]),
        "materials[0].extensions.KHR_materials_ior.ior: an index of refraction below 1 is not modelled: 1.5 is used",
    ),
    (
        "emission beyond",
        |f| f.json["materials"] = json!([{"emissiveFactor": [1.0, 1.0, 1.0], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1e38}}}, {"emissiveFactor": [1e39, 1.0, 1.0]}, {"emissiveFactor": [1e30, 1.0, 1.0], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1e30}}}]),
        "materials[2]: the emission is not finite",
    ),
    (
        "an extension",
        |f| f.json["extensionsUsed"] = json!(["KHR_materials_clearcoat"]),
        "extensionsUsed: KHR_materials_clearcoat is not read: what it adds is left out",
    ),
];

fn light(file: &mut File, light: Value) {
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    file.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
}

fn small_png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let image = image::RgbaImage::from_pixel(1, 1, image::Rgba([1, 2, 3, 255]));
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

/// A PNG whose header claims 60000 x 60000 pixels.
fn absurd_png() -> Vec<u8> {
    let mut bytes = small_png();
    for at in [16, 20] {
        bytes[at..at + 4].copy_from_slice(&60_000_u32.to_be_bytes());
    }
    // The header's checksum (CRC-32 of its type and data).
    let mut crc = u32::MAX;
    for byte in &bytes[12..29] {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    bytes
}

#[test]
fn what_contradicts_itself_is_refused_by_name() {
    for (what, break_it, expected) in REFUSED {
        let mut file = File::triangle();
        break_it(&mut file);
        let error = load_bytes(file.glb()).map(|_| ()).err().unwrap_or_else(|| panic!("{what} was not noticed"));
        assert!(error.starts_with("test.glb: ") && error.contains(expected), "{what}: {error}");
    }
}

#[test]
fn what_can_be_left_out_is_left_out_with_a_warning() {
    for (what, break_it, expected) in WARNED {
        let mut file = File::triangle();
        beside(&mut file);
        break_it(&mut file);
        let loaded = load_bytes(file.glb()).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert!(warnings(&loaded).contains(expected), "{what}: {}", warnings(&loaded));
        Tracer::new(&loaded.scene, 0, 1).unwrap_or_else(|e| panic!("{what}: {e}"));
    }
}

#[test]
fn small_files_cannot_ask_for_much() {
    // A mesh of one triangle at a node each, ever more of them.
    let mut file = File::triangle();
    let nodes: Vec<Value> = (0..2000).map(|_| json!({"mesh": 0})).collect();
    file.json["scenes"][0]["nodes"] = (0..2000).collect::<Vec<usize>>().into();
    file.json["nodes"] = nodes.into();
    let limits = Limits { triangles: 1000, ..small().limits };
    let error = file.try_load_with(&Options { limits, ..small() }).unwrap_err().to_string();
    assert!(error.contains("nodes[1000]: triangles in the world: 1001 exceed the limit of 1000; simplify"), "{error}");
    // The same bytes read again and again.
    let mut file = File::triangle();
    let primitive = file.json["meshes"][0]["primitives"][0].clone();
    file.json["meshes"][0]["primitives"] = vec![primitive; 100].into();
    let limits = Limits { decoded_bytes: 1000, ..small().limits };
    let error = file.try_load_with(&Options { limits, ..small() }).unwrap_err().to_string();
    assert!(error.contains("bytes of data: ") && error.contains("exceed the limit of 1000"), "{error}");
    // Warnings are counted, not collected without end.
    let mut file = File::triangle();
    file.json["materials"] = vec![json!({"alphaMode": "x"}); 1000].into();
    let report = file.load().report;
    assert_eq!((report.warnings.len(), report.further_warnings), (gltf::WARNING_LIMIT, 1000 - gltf::WARNING_LIMIT));
    // A chain of many nodes is walked without recursion.
    let mut file = File::triangle();
    let count = 20_000;
    let mut nodes: Vec<Value> = (0..count).map(|n| json!({"children": [n + 1]})).collect();
    nodes.push(json!({"mesh": 0}));
    file.json["nodes"] = nodes.into();
    assert_eq!(file.load().report.nodes, count + 1);
}
