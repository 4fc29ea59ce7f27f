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
//! Where `changed_light` is on for a signal, its history length shares a number with the fast history ([`beside`]).
//!
//! The fourth value of a colour is the confidence in what stages 3 and 8 write (negative for background) and 0 in all other planes.
//! Colours of the host are textures of any float format.

use crate::kernels::change::{DARKEST, rounded_length, rounded_light};

/// Bits of a number that hold a history length, where the fast history lies beside it.
const LENGTH_BITS: u32 = 0xffff_f800;
/// Bits of a float below those that a code of the fast history counts.
const CODE_SHIFT: u32 = 18;

/// A history length, at least 1, and the fast history's luminance, 0..65504, each rounded as it is kept (`kernels/change.rs`), in one
/// number: the upper 21 bits of the length's float and, in the lower 11, the upper 14 bits of the luminance's counted from the darkest
/// (1: black, 0: there is none). It is a float near to the length: at most 2^-12 larger.
pub fn beside(length: f32, fast: f32) -> f32 {
    let code = (rounded_light(fast).to_bits() >> CODE_SHIFT).max(DARKEST) - (DARKEST - 1);
    f32::from_bits(rounded_length(length).to_bits() | code)
}

/// Both again; the second is `None` where there is no fast history.
pub fn parted(texel: f32) -> (f32, Option<f32>) {
    let bits = texel.to_bits();
    let fast = match bits & !LENGTH_BITS {
        0 => None,
        1 => Some(0.0),
        code => Some(f32::from_bits((code + (DARKEST - 1)) << CODE_SHIFT)),
    };
    (f32::from_bits(bits & LENGTH_BITS), fast)
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_numbers_lie_side_by_side() {
        for length in (1..=4096).map(|n| n as f32) {
            for fast in [0.0, 1e-15, 1e-14, 6e-8, 0.1, 1.0, 65504.0] {
                let texel = beside(length, fast);
                assert!(texel >= length && texel <= length * (1.0 + 1.0 / 4096.0));
                let (kept, light) = parted(texel);
                assert_eq!(kept, length);
                let light = light.unwrap();
                assert_eq!(light, rounded_light(fast));
                assert!((light - fast).abs() <= fast / 64.0 || (light == 0.0 && fast < 8e-15), "{fast}");
            }
            assert_eq!(parted(length), (length, None));
        }
        let (kept, _) = parted(beside(100.3, 1.0));
        assert!((kept - 100.3).abs() <= 100.3 / 8192.0, "{kept}");
    }
}
