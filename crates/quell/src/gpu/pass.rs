//! What a pass is, and how its shader is put together from its bindings and its pieces of WGSL.

use super::constants;
use super::storage::{Storage, Texel};
use super::uniform::Uniform;
use super::uniforms::layouts;
use crate::pipeline::Stage;

/// What a binding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A texture that is read by `textureLoad`.
    Sampled(Texel),
    /// A storage texture that is written, every pixel once.
    Stored(Texel),
    /// A texture of the host's that is read as it is; something else may be bound where the host has none.
    Host(Sample),
    /// A read-only storage buffer of taps, 16 bytes each.
    Taps,
    /// A storage buffer of so many 32-bit counts, which are added to.
    Counts(u32),
    /// A uniform buffer that holds the struct of this name ([`super::layouts`]).
    Uniform(&'static str),
    /// An array of textures of floats, a layer for each frame of a window. Something else may be bound where a pass does not
    /// read it.
    Frames,
    /// A storage buffer that is read.
    Read(Element),
    /// A storage buffer that is written, and read where the pass adds to it.
    Write(Element),
    /// A storage texture of this format that is written: a picture to look at.
    Picture(wgpu::TextureFormat),
    /// An array of storage textures of this format that is written.
    Layers(wgpu::TextureFormat),
}

/// What a storage buffer is an array of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Four 32-bit floats a pixel: a colour or a guide.
    Four,
    /// Two 32-bit floats a pixel.
    Two,
    /// A 32-bit float a pixel.
    One,
    /// Four 32-bit floats each, as many as the caller has: weights of a net, sums of cells.
    Fours,
    /// Structs of this name ([`super::layouts`]), as many as the caller has.
    Struct(&'static str),
}

impl Element {
    /// Bytes of a pixel; `None`: its number is not the picture's.
    pub const fn bytes(self) -> Option<u64> {
        match self {
            Self::Four => Some(16),
            Self::Two => Some(8),
            Self::One => Some(4),
            Self::Fours | Self::Struct(_) => None,
        }
    }

    const fn declared(self) -> &'static str {
        match self {
            Self::Four | Self::Fours => "vec4f",
            Self::Two => "vec2f",
            Self::One => "f32",
            Self::Struct(name) => name,
        }
    }
}

/// How a shader reads a texture of the host's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sample {
    /// Floats or normalised numbers, by `textureLoad` only.
    Float,
    /// Unsigned integers.
    Uint,
    /// A depth format.
    Depth,
}

impl Sample {
    pub(super) const fn sample_type(self) -> wgpu::TextureSampleType {
        match self {
            Self::Float => wgpu::TextureSampleType::Float { filterable: false },
            Self::Uint => wgpu::TextureSampleType::Uint,
            Self::Depth => wgpu::TextureSampleType::Depth,
        }
    }

    /// The WebGPU format of what stands in for a texture that the host has not: one texel of zeros.
    pub const fn absent_format(self) -> wgpu::TextureFormat {
        match self {
            Self::Float => wgpu::TextureFormat::R8Unorm,
            Self::Uint => wgpu::TextureFormat::R8Uint,
            Self::Depth => wgpu::TextureFormat::Depth32Float,
        }
    }

    const fn declared(self) -> &'static str {
        match self {
            Self::Float => "texture_2d<f32>",
            Self::Uint => "texture_2d<u32>",
            Self::Depth => "texture_depth_2d",
        }
    }
}

/// A resource of a pass. Its binding number is its place in the pass's list plus [`Pass::first_binding`]. All lie in group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Its name in WGSL.
    pub name: &'static str,
    /// What it is.
    pub kind: BindingKind,
}

/// A pass: one dispatch over the whole image that runs a stage of either filter, several fused, the border, or debug views.
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// The stage's name; of fused ones joined by `+`.
    pub name: &'static str,
    /// Which stages of the real-time filter it runs, in order.
    pub stages: &'static [Stage],
    /// Whether bindings 0 and 1 are the per-frame uniforms `frame` and `settings` of the real-time filter.
    pub per_frame: bool,
    /// Its entry point.
    pub entry: &'static str,
    /// What it binds, from [`Pass::first_binding`] on.
    pub bindings: &'static [Binding],
    pub(super) pieces: &'static [&'static str],
}

/// Pixels along each side that one workgroup covers, but for stages 3 and 8 ([`Pass::workgroup`]).
pub const WORKGROUP: u32 = 8;
/// The same of stages 3 and 8: where light has changed, a workgroup sums all cells around it, and a larger one fewer for
/// each of its pixels.
const WORKGROUP_TEMPORAL: u32 = 16;
/// Binding of the first resource after the per-frame uniforms.
pub const FIRST_BINDING: u32 = 2;

const FRAME: &str = include_str!("frame.wgsl");
const SETTINGS: &str = include_str!("settings.wgsl");
const INPUT_COLOUR: &str = include_str!("input_colour.wgsl");
const GUIDES_TYPES: &str = include_str!("guides/types.wgsl");

impl Pass {
    /// The shader: declarations of its bindings, then its pieces one after another. `host_input`: the image that it
    /// filters comes from the host as it is, so that its colours are repaired when they are loaded; it matters to stages
    /// that can come first, 4, 6, 7, 9 and 10 (3, 8, 11 and the sum always repair).
    pub fn source(&self, storage: Storage, host_input: bool) -> String {
        let mut body = String::new();
        let shared = [FRAME, SETTINGS, INPUT_COLOUR, GUIDES_TYPES, storage.wgsl()];
        for piece in shared.iter().filter(|_| self.per_frame).chain(self.pieces) {
            body.push('\n');
            body += piece;
        }
        let mut source = self.declarations(storage);
        if !self.stages.is_empty() {
            source += &first_colour(host_input);
        }
        let constants = constants::declared(&body);
        if !constants.is_empty() {
            source += "\n// Constants of the Rust side.\n";
            source += &constants;
        }
        source + &body
    }

    /// Pixels along each side that one workgroup covers.
    pub const fn workgroup(&self) -> u32 {
        match self.stages.first() {
            Some(Stage::MatteTemporal | Stage::GlossyTemporal) => WORKGROUP_TEMPORAL,
            _ => WORKGROUP,
        }
    }

    /// Binding of the first of [`Pass::bindings`].
    pub const fn first_binding(&self) -> u32 {
        if self.per_frame { FIRST_BINDING } else { 0 }
    }

    /// Of its bindings, and of the structs that no piece declares.
    fn declarations(&self, storage: Storage) -> String {
        let mut source = String::new();
        if self.per_frame {
            source += "// Per-frame uniforms.\n@group(0) @binding(0) var<uniform> frame: Frame;\n\
                       @group(0) @binding(1) var<uniform> settings: Settings;\n";
        } else {
            let structs = self.bindings.iter().filter_map(|binding| match binding.kind {
                BindingKind::Uniform(name) | BindingKind::Read(Element::Struct(name)) => Some(name),
                _ => None,
            });
            for name in structs {
                source.extend(layouts().iter().filter(|layout| layout.name == name).map(Uniform::declared));
            }
        }
        for (number, binding) in (self.first_binding()..).zip(self.bindings) {
            let name = binding.name;
            let (space, ty) = match binding.kind {
                BindingKind::Sampled(texel) => ("", format!("texture_2d<{}>", texel.component())),
                BindingKind::Stored(texel) => {
                    ("", format!("texture_storage_2d<{}, write>", texel.format_name(storage)))
                }
                BindingKind::Host(sample) => ("", sample.declared().to_owned()),
                BindingKind::Taps => ("<storage, read>", "array<SpiralTap>".to_owned()),
                BindingKind::Counts(count) => ("<storage, read_write>", format!("array<atomic<u32>, {count}>")),
                BindingKind::Uniform(name) => ("<uniform>", name.to_owned()),
                BindingKind::Frames => ("", "texture_2d_array<f32>".to_owned()),
                BindingKind::Read(element) => ("<storage, read>", format!("array<{}>", element.declared())),
                BindingKind::Write(element) => ("<storage, read_write>", format!("array<{}>", element.declared())),
                BindingKind::Picture(format) => {
                    ("", format!("texture_storage_2d<{}, write>", format!("{format:?}").to_lowercase()))
                }
                BindingKind::Layers(format) => {
                    ("", format!("texture_storage_2d_array<{}, write>", format!("{format:?}").to_lowercase()))
                }
            };
            source += &format!("@group(0) @binding({number}) var{space} {name}: {ty};\n");
        }
        source
    }
}

fn first_colour(host_input: bool) -> String {
    let taken = if host_input { "input_colour(texel)" } else { "texel.xyz" };
    format!(
        "\n// A colour of the image that the pass filters.\nfn first_colour(texel: vec4f) -> vec3f {{\n    return {taken};\n}}\n"
    )
}
