//! Writes a `.glb` of a million triangles with a colour and a normal map, for measuring how large files load:
//! hills in 16 meshes under a lamp, normals given, tangents not.
//!
//! `cargo run --release -p quell-trace --example large_scene -- OUT.glb`, then
//! `quell bench --scene OUT.glb --size 320x180 --count 1`.

use image::{ImageFormat, Rgb, RgbImage};
use serde_json::{Value, json};
use std::f32::consts::TAU;
use std::io::Cursor;

/// Tiles a side, and squares of two triangles along a tile.
const TILES: usize = 4;
const SQUARES: usize = 177;
/// Texels along an image.
const TEXELS: u32 = 1024;

fn height(x: f32, z: f32) -> f32 {
    0.3 * (x * TAU).sin() * (z * TAU * 0.7).cos() + 0.02 * (x * 90.0).sin() * (z * 80.0).sin()
}

/// Bytes and the lists that name parts of them.
#[derive(Default)]
struct Data {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Data {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    fn floats(&mut self, kind: &str, lanes: usize, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let mut accessor =
            json!({"bufferView": view, "componentType": 5126, "count": values.len() / lanes, "type": kind});
        if kind == "VEC3" {
            let bound = |pick: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
                (0..3).map(|c| values.iter().skip(c).step_by(3).fold(start, |a, &b| pick(a, b))).collect()
            };
            accessor["min"] = json!(bound(f32::min, f32::INFINITY));
            accessor["max"] = json!(bound(f32::max, f32::NEG_INFINITY));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessors
            .push(json!({"bufferView": view, "componentType": 5125, "count": values.len(), "type": "SCALAR"}));
        self.accessors.len() - 1
    }

    fn image(&mut self, texel: impl Fn(u32, u32) -> [u8; 3]) -> Result<usize, image::ImageError> {
        let image = RgbImage::from_fn(TEXELS, TEXELS, |x, y| Rgb(texel(x, y)));
        let mut png = Cursor::new(Vec::new());
        image.write_to(&mut png, ImageFormat::Png)?;
        Ok(self.view(&png.into_inner()))
    }
}

/// One tile of hills: a mesh primitive.
fn tile(data: &mut Data, column: usize, row: usize) -> Value {
    let (mut positions, mut normals, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let side = SQUARES + 1;
    for j in 0..side {
        for i in 0..side {
            let at = |n: usize, tile: usize| (tile as f32 + n as f32 / SQUARES as f32) / TILES as f32;
            let (u, v) = (at(i, column), at(j, row));
            let (x, z) = (4.0 * u - 2.0, 4.0 * v - 2.0);
            let e = 1e-3;
            let slope = |dx: f32, dz: f32| (height(x + dx, z + dz) - height(x - dx, z - dz)) / (2.0 * e);
            let (a, b) = (slope(e, 0.0), slope(0.0, e));
            let length = (a * a + b * b + 1.0).sqrt();
            positions.extend([x, height(x, z), z]);
            normals.extend([-a / length, 1.0 / length, -b / length]);
            uvs.extend([8.0 * u, 8.0 * v]);
            if i < SQUARES && j < SQUARES {
                let n = (j * side + i) as u32;
                let below = n + side as u32;
                indices.extend([n, below, n + 1, n + 1, below, below + 1]);
            }
        }
    }
    let position = data.floats("VEC3", 3, &positions);
    let normal = data.floats("VEC3", 3, &normals);
    let uv = data.floats("VEC2", 2, &uvs);
    let indices = data.indices(&indices);
    json!({"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv}, "indices": indices, "material": 0})
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = std::env::args().nth(1).ok_or("usage: large_scene OUT.glb")?;
    let mut data = Data::default();
    let mut meshes: Vec<Value> =
        (0..TILES * TILES).map(|n| json!({"primitives": [tile(&mut data, n % TILES, n / TILES)]})).collect();
    let corners = data.floats("VEC3", 3, &[-1.0, 3.0, -1.0, 1.0, 3.0, -1.0, 1.0, 3.0, 1.0, -1.0, 3.0, 1.0]);
    let lamp = data.indices(&[0, 1, 2, 0, 2, 3]);
    meshes.push(json!({"primitives": [{"attributes": {"POSITION": corners}, "indices": lamp, "material": 1}]}));
    let wave = |v: u32| (v as f32 * TAU / 64.0).sin();
    let colour = data.image(|x, y| [(128.0 + 90.0 * wave(x)) as u8, (128.0 + 60.0 * wave(y)) as u8, 90])?;
    let bumps = data.image(|x, y| [(128.0 + 40.0 * wave(x)) as u8, (128.0 + 40.0 * wave(y)) as u8, 240])?;
    let mut nodes: Vec<Value> = (0..meshes.len()).map(|mesh| json!({"mesh": mesh})).collect();
    // Looks down at the hills: a turn of -35 degrees about x.
    let half = (-17.5_f32).to_radians();
    nodes.push(json!({"camera": 0, "translation": [0.0, 1.8, 2.6], "rotation": [half.sin(), 0.0, 0.0, half.cos()]}));
    let json = json!({
        "asset": {"version": "2.0", "generator": "quell large_scene"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
        "nodes": nodes,
        "meshes": meshes,
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.01}}],
        "materials": [
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 0.6},
             "normalTexture": {"index": 1}},
            {"emissiveFactor": [1.0, 1.0, 1.0], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}}},
        ],
        "textures": [{"source": 0}, {"source": 1}],
        "images": [{"bufferView": colour, "mimeType": "image/png"}, {"bufferView": bumps, "mimeType": "image/png"}],
        "buffers": [{"byteLength": data.bytes.len()}],
        "bufferViews": data.views,
        "accessors": data.accessors,
    });
    let mut text = serde_json::to_vec(&json)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = Vec::new();
    let total = 12 + 8 + text.len() + 8 + data.bytes.len();
    file.extend(b"glTF");
    for word in [2, u32::try_from(total)?, u32::try_from(text.len())?] {
        file.extend(word.to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(&text);
    file.extend(u32::try_from(data.bytes.len())?.to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(&data.bytes);
    std::fs::write(out, file)?;
    Ok(())
}
