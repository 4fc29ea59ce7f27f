//! What a pass is, and how its shader is put together from its bindings and its pieces of WGSL.

use super::storage::{Storage, Texel};
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

/// A resource of a pass. Its binding number is its place in the pass's list plus 2: 0 and 1 are the uniforms `frame` and
/// `settings`. All lie in group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Its name in WGSL.
    pub name: &'static str,
    /// What it is.
    pub kind: BindingKind,
}

/// A pass: one dispatch over the whole image that runs one stage, several fused, or the border.
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// The stage's name; of fused ones joined by `+`.
    pub name: &'static str,
    /// Which stages it runs, in order; the border's passes run none.
    pub stages: &'static [Stage],
    /// Its entry point.
    pub entry: &'static str,
    /// What it binds, from binding 2 on.
    pub bindings: &'static [Binding],
    pub(super) pieces: &'static [&'static str],
}

/// Pixels along each side that one workgroup covers.
pub const WORKGROUP: u32 = 8;
/// Binding of the first resource after the uniforms.
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
        let mut source = String::from(
            "// What every pass is told.\n@group(0) @binding(0) var<uniform> frame: Frame;\n\
             @group(0) @binding(1) var<uniform> settings: Settings;\n",
        );
        for (number, binding) in (FIRST_BINDING..).zip(self.bindings) {
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
            };
            source += &format!("@group(0) @binding({number}) var{space} {name}: {ty};\n");
        }
        if !self.stages.is_empty() {
            source += &first_colour(host_input);
        }
        let shared = [FRAME, SETTINGS, INPUT_COLOUR, GUIDES_TYPES, storage.wgsl()];
        for piece in shared.iter().chain(self.pieces) {
            source.push('\n');
            source += piece;
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
