//! Formats of the planes: what a texel holds, in how many bytes, how precisely.
//!
//! | plane | `Half` | `Float` |
//! |---|---|---|
//! | colour | rgba16float, 8 bytes; red, green, blue, held to +-65504; relative error 2^-11, under 6e-5 absolute 3e-8 | rgba32float, 16 |
//! | geometry | rg32uint, 8: view depth as f32; octahedral normal, the upper 16 of 19 bits an axis | rgba32uint, 16: normal, depth |
//! | surface | r32uint, 4: id in 16 bits, roughness in 10 (error 5e-4), the lower 3 bits of the normal's axes (error of the normal under 1e-5) | rg32uint, 8 |
//! | moving | rg32uint, 8: motion in 20 bits an axis (relative error 2^-15, under 1.2e-4 px it is 0, at most 131072 px), glossy hit distance over view depth as half, `confidence_in` in steps of 1/240 | rgba32uint, 16 |
//! | number | r32float, 4 | r32float, 4 |
//!
//! The fourth value of a colour is the confidence in what stages 3 and 8 write (negative for background) and 0 in all other planes.
//! Colours of the host are textures of any float format.

/// How planes are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Storage {
    /// Half precision and packed guides: at most 8 bytes a plane.
    #[default]
    Half,
    /// 32-bit floats: for tests of exactness.
    Float,
}

impl Storage {
    /// The piece of WGSL that packs and unpacks.
    pub(super) const fn wgsl(self) -> &'static str {
        match self {
            Self::Half => include_str!("storage/half.wgsl"),
            Self::Float => include_str!("storage/float.wgsl"),
        }
    }
}

/// What a plane's texel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Texel {
    /// Red, green, blue, and a number.
    Colour,
    /// View depth and normal.
    Geometry,
    /// Id and roughness.
    Surface,
    /// Motion, glossy hit distance, confidence of the host.
    Moving,
    /// One number.
    Number,
}

impl Texel {
    /// The texture's format.
    pub const fn format(self, storage: Storage) -> wgpu::TextureFormat {
        use wgpu::TextureFormat as F;
        match (self, storage) {
            (Self::Colour, Storage::Half) => F::Rgba16Float,
            (Self::Colour, Storage::Float) => F::Rgba32Float,
            (Self::Geometry | Self::Moving, Storage::Half) => F::Rg32Uint,
            (Self::Geometry | Self::Moving, Storage::Float) => F::Rgba32Uint,
            (Self::Surface, Storage::Half) => F::R32Uint,
            (Self::Surface, Storage::Float) => F::Rg32Uint,
            (Self::Number, _) => F::R32Float,
        }
    }

    /// The format's name in WGSL and WebGPU.
    pub const fn format_name(self, storage: Storage) -> &'static str {
        match (self, storage) {
            (Self::Colour, Storage::Half) => "rgba16float",
            (Self::Colour, Storage::Float) => "rgba32float",
            (Self::Geometry | Self::Moving, Storage::Half) => "rg32uint",
            (Self::Geometry | Self::Moving, Storage::Float) => "rgba32uint",
            (Self::Surface, Storage::Half) => "r32uint",
            (Self::Surface, Storage::Float) => "rg32uint",
            (Self::Number, _) => "r32float",
        }
    }

    /// Bytes of a texel.
    pub const fn bytes(self, storage: Storage) -> u32 {
        match (self, storage) {
            (Self::Number, _) | (Self::Surface, Storage::Half) => 4,
            (Self::Surface, Storage::Float) | (_, Storage::Half) => 8,
            (_, Storage::Float) => 16,
        }
    }

    /// What a shader loads: `u32` for packed bits, else `f32`.
    pub const fn component(self) -> &'static str {
        match self {
            Self::Geometry | Self::Surface | Self::Moving => "u32",
            Self::Colour | Self::Number => "f32",
        }
    }

    pub(super) const fn sample_type(self) -> wgpu::TextureSampleType {
        match self {
            Self::Geometry | Self::Surface | Self::Moving => wgpu::TextureSampleType::Uint,
            Self::Colour | Self::Number => wgpu::TextureSampleType::Float { filterable: false },
        }
    }
}
