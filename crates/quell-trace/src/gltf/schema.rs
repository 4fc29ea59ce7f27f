//! The JSON of glTF 2.0, as far as it is read. Unknown fields are passed over.
//!
//! Written out here rather than taken from the crate `gltf-json`, which refuses legal files: a scene without nodes, an
//! animation channel without a node, a texture whose image stands in an extension.

use serde::Deserialize;

/// An object all of whose fields may be missing.
macro_rules! json {
    ($(#[$meta:meta])* $name:ident { $($(#[$attr:meta])* $field:ident: $type:ty),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, Default, Deserialize)]
        #[serde(default, rename_all = "camelCase")]
        pub(super) struct $name {
            $($(#[$attr])* pub(super) $field: $type,)*
        }
    };
}

/// An object whose fields must be there unless they are options or have a default.
macro_rules! object {
    ($(#[$meta:meta])* $name:ident { $($(#[$attr:meta])* $field:ident: $type:ty),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, Deserialize)]
        #[serde(rename_all = "camelCase")]
        pub(super) struct $name {
            $($(#[$attr])* pub(super) $field: $type,)*
        }
    };
}

json!(
    /// The whole.
    Root {
        asset: Asset,
        scene: Option<usize>,
        scenes: Vec<Scene>,
        nodes: Vec<Node>,
        meshes: Vec<Mesh>,
        accessors: Vec<Accessor>,
        buffer_views: Vec<View>,
        buffers: Vec<Buffer>,
        materials: Vec<Material>,
        textures: Vec<Texture>,
        images: Vec<Image>,
        samplers: Vec<Sampler>,
        cameras: Vec<Camera>,
        animations: Vec<Animation>,
        skins: Vec<Skin>,
        extensions_used: Vec<String>,
        extensions_required: Vec<String>,
        extensions: RootExtensions,
    }
);
json!(Asset { version: String, generator: Option<String>, copyright: Option<String>, });
json!(RootExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    lights: Option<Lights>,
});
json!(Scene { name: Option<String>, nodes: Vec<usize>, });
json!(Node {
    name: Option<String>,
    children: Vec<usize>,
    matrix: Option<[f32; 16]>,
    translation: Option<[f32; 3]>,
    rotation: Option<[f32; 4]>,
    scale: Option<[f32; 3]>,
    mesh: Option<usize>,
    skin: Option<usize>,
    camera: Option<usize>,
    weights: Option<Vec<f32>>,
    extensions: NodeExtensions,
});
json!(NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    light: Option<LightUse>,
});
/// Which light shines at a node.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct LightUse {
    pub(super) light: usize,
}
json!(Mesh { name: Option<String>, primitives: Vec<Primitive>, weights: Option<Vec<f32>>, });
json!(Primitive {
    attributes: std::collections::BTreeMap<String, usize>,
    indices: Option<usize>,
    material: Option<usize>,
    mode: Option<u64>,
    targets: Vec<std::collections::BTreeMap<String, usize>>,
});
object!(Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u64,
    #[serde(default)]
    normalized: bool,
    count: u64,
    #[serde(rename = "type")]
    kind: String,
    sparse: Option<Sparse>,
});
object!(Sparse { count: u64, indices: SparseIndices, values: SparseValues });
object!(SparseIndices {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: u64,
    component_type: u64
});
object!(SparseValues {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: u64
});
object!(View { buffer: usize, #[serde(default)] byte_offset: u64, byte_length: u64, byte_stride: Option<u64>, });
object!(Buffer { uri: Option<String>, byte_length: u64, });
json!(Image { uri: Option<String>, buffer_view: Option<usize>, });
json!(Sampler {
    mag_filter: Option<u64>,
    min_filter: Option<u64>,
    wrap_s: Option<u64>,
    wrap_t: Option<u64>,
});
json!(Texture { source: Option<usize>, sampler: Option<usize>, extensions: TextureExtensions, });
json!(TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    webp: Option<TextureSource>,
});
json!(TextureSource { source: Option<usize>, });
json!(Camera {
    name: Option<String>,
    #[serde(rename = "type")]
    kind: String,
    perspective: Option<Perspective>,
    orthographic: Option<Orthographic>,
});
object!(Perspective { yfov: f32, aspect_ratio: Option<f32>, });
object!(Orthographic { xmag: f32, ymag: f32 });
json!(Animation { name: Option<String>, channels: Vec<Channel>, samplers: Vec<AnimationSampler>, });
object!(Channel { sampler: usize, target: Target });
object!(Target { node: Option<usize>, path: String, });
object!(AnimationSampler { input: usize, output: usize, interpolation: Option<String>, });
object!(Skin { joints: Vec<usize>, inverse_bind_matrices: Option<usize>, });
json!(Lights { lights: Vec<Light>, });
json!(Light {
    name: Option<String>,
    #[serde(rename = "type")]
    kind: String,
    color: Option<[f32; 3]>,
    intensity: Option<f32>,
    range: Option<f32>,
    spot: Spot,
});
json!(Spot { inner_cone_angle: Option<f32>, outer_cone_angle: Option<f32>, });
json!(Material {
    name: Option<String>,
    pbr_metallic_roughness: Pbr,
    normal_texture: Option<TextureInfo>,
    occlusion_texture: Option<TextureInfo>,
    emissive_texture: Option<TextureInfo>,
    emissive_factor: Option<[f32; 3]>,
    alpha_mode: Option<String>,
    alpha_cutoff: Option<f32>,
    double_sided: bool,
    extensions: MaterialExtensions,
});
json!(Pbr {
    base_color_factor: Option<[f32; 4]>,
    base_color_texture: Option<TextureInfo>,
    metallic_factor: Option<f32>,
    roughness_factor: Option<f32>,
    metallic_roughness_texture: Option<TextureInfo>,
});
object!(TextureInfo {
    index: usize,
    #[serde(default)]
    tex_coord: usize,
    /// Of normal textures.
    scale: Option<f32>,
    #[serde(default)]
    extensions: TextureInfoExtensions,
});
json!(TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    transform: Option<TextureTransform>,
});
json!(TextureTransform {
    offset: Option<[f32; 2]>,
    rotation: Option<f32>,
    scale: Option<[f32; 2]>,
    tex_coord: Option<usize>,
});
json!(MaterialExtensions {
    #[serde(rename = "KHR_materials_emissive_strength")]
    emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_ior")]
    ior: Option<Ior>,
    #[serde(rename = "KHR_materials_transmission")]
    transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_volume")]
    volume: Option<Volume>,
    #[serde(rename = "KHR_materials_specular")]
    specular: Option<Specular>,
    #[serde(rename = "KHR_materials_unlit")]
    unlit: Option<Unlit>,
});
json!(EmissiveStrength { emissive_strength: Option<f32>, });
json!(Ior { ior: Option<f32>, });
json!(Transmission { transmission_factor: f32, transmission_texture: Option<TextureInfo>, });
json!(Volume {
    thickness_factor: f32,
    thickness_texture: Option<TextureInfo>,
    attenuation_distance: Option<f32>,
    attenuation_color: Option<[f32; 3]>,
});
json!(Specular {
    specular_factor: Option<f32>,
    specular_texture: Option<TextureInfo>,
    specular_color_factor: Option<[f32; 3]>,
    specular_color_texture: Option<TextureInfo>,
});
json!(Unlit {});

/// What is read of the extensions that a file may name.
pub(super) const SUPPORTED: [&str; 10] = [
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];
