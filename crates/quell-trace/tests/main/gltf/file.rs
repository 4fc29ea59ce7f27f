//! Small glTF files made in memory.

use quell_trace::gltf::{self, GltfError, Loaded, Options};
use serde_json::{Value, json};
use std::path::Path;

/// A file under construction: JSON, and the bytes of its only buffer.
#[derive(Clone)]
pub struct File {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl File {
    /// A scene with nothing in it.
    pub fn empty() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "materials": [], "cameras": [], "animations": [], "skins": [],
        });
        Self { json, bytes: Vec::new() }
    }

    /// One triangle of side 1 in the plane z = 0, facing +z, at node 0.
    pub fn triangle() -> Self {
        let mut file = Self::empty();
        let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let mesh = file.mesh(json!({"attributes": {"POSITION": positions}}));
        file.shown(json!({"mesh": mesh}));
        file
    }

    /// Adds to a list of the file and returns the place.
    pub fn push(&mut self, list: &str, item: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(item);
        list.len() - 1
    }

    /// A view of new bytes.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    /// An accessor of any kind over new bytes.
    pub fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "count": count, "type": kind}))
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let lanes = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(kind, 5126, values.len() / lanes, &bytes)
    }

    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor("SCALAR", 5123, values.len(), &bytes)
    }

    /// A mesh of one primitive.
    pub fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({"primitives": [primitive]}))
    }

    /// A node that the scene shows.
    pub fn shown(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(node.into());
        node
    }

    /// A clip of one channel.
    pub fn clip(&mut self, name: &str, node: usize, path: &str, interpolation: &str, times: &[f32], values: &[f32]) {
        let kind = match path {
            "rotation" => "VEC4",
            "weights" => "SCALAR",
            _ => "VEC3",
        };
        let input = self.floats("SCALAR", times);
        let output = self.floats(kind, values);
        self.push(
            "animations",
            json!({
                "name": name,
                "channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
                "samplers": [{"input": input, "output": output, "interpolation": interpolation}],
            }),
        );
    }

    /// The JSON with its buffer.
    pub fn text(&self, uri: Option<&str>) -> Value {
        let mut json = self.json.clone();
        let mut buffer = json!({"byteLength": self.bytes.len()});
        if let Some(uri) = uri {
            buffer["uri"] = uri.into();
        }
        if json.get("buffers").is_none() {
            json["buffers"] = json!([buffer]);
        }
        json
    }

    /// As a binary container.
    pub fn glb(&self) -> Vec<u8> {
        let mut text = serde_json::to_vec(&self.text(None)).unwrap();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut out = b"glTF".to_vec();
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        for word in [2, length as u32, text.len() as u32] {
            out.extend(word.to_le_bytes());
        }
        out.extend(b"JSON");
        out.extend(text);
        out.extend((self.bytes.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(&self.bytes);
        out
    }

    pub fn try_load_with(&self, options: &Options) -> Result<Loaded, GltfError> {
        gltf::load_bytes(self.glb(), Path::new("."), "test.glb", options)
    }

    pub fn try_load(&self) -> Result<Loaded, GltfError> {
        self.try_load_with(&Options::default())
    }

    pub fn load(&self) -> Loaded {
        self.try_load().unwrap_or_else(|e| panic!("{e}"))
    }

    /// What the loader says against the file.
    pub fn refusal(&self) -> String {
        self.try_load().map(|_| ()).unwrap_err().to_string()
    }
}

/// The warnings of a file that loads, one a line.
pub fn warnings(loaded: &Loaded) -> String {
    loaded.report.warnings.iter().map(|w| format!("{w}\n")).collect()
}
