//! Frames of the CPU for the textures of [`super::Frame`], and what [`super::Output`]'s hold: for hosts whose planes
//! do not lie on the GPU.

use super::guides::{GuideTexels, pack_guides};
use super::storage::Storage;
use crate::border::{Guides, PlaneName, Sanitised, copy_colour};
use crate::error::Error;
use crate::frame::{Frame, Rgb, Signal};
use crate::par;
use crate::plane::{Plane, PlaneRef, Size};

/// Bytes of a colour, rgba32float.
const COLOUR: usize = 16;

/// The planes of one frame as texels, row by row without padding, repaired as on the CPU. Colours are for rgba32float.
#[derive(Clone, Debug)]
pub struct PackedFrame {
    /// [`super::Frame::guides`].
    pub guides: GuideTexels,
    /// [`super::PackedGuides::has_roughness`].
    pub has_roughness: bool,
    /// [`super::PackedGuides::has_glossy_hit`].
    pub has_glossy_hit: bool,
    /// [`super::Frame::direct`].
    pub direct: Vec<u8>,
    /// [`super::Frame::matte`].
    pub matte: Option<PackedSignal>,
    /// [`super::Frame::glossy`].
    pub glossy: Option<PackedSignal>,
    /// [`super::Frame::joint`]'s light, in the order of [`Frame::passes`].
    pub joint: Vec<Vec<u8>>,
    /// What was repaired.
    pub sanitised: Sanitised,
}

/// Colour planes of [`super::Signal`].
#[derive(Clone, Debug)]
pub struct PackedSignal {
    /// Without its weight.
    pub light: Vec<u8>,
    /// What multiplies it back.
    pub weight: Option<Vec<u8>>,
    /// Noisy direct light of the lobe.
    pub direct: Option<Vec<u8>>,
}

impl PackedFrame {
    /// Reads a frame, guides for textures of this storage.
    ///
    /// # Errors
    /// What [`Frame::check`] finds.
    pub fn new(frame: &Frame<'_>, storage: Storage) -> Result<Self, Error> {
        let mut sanitised = Sanitised::default();
        let guides = Guides::of(frame, &mut sanitised)?;
        let mut plane = Plane::filled(frame.size, [0.0; 3]);
        let mut colour = |source: Option<PlaneRef<'_, Rgb>>, name| {
            copy_colour(source, 0.0, &mut plane, name, &mut sanitised);
            pack_colours(&plane)
        };
        let direct = colour(frame.direct, PlaneName::Direct);
        let mut signal = |signal: Signal| {
            let (weight, noisy, names) = match signal {
                Signal::Matte => (
                    frame.matte_weight,
                    frame.direct_matte,
                    [PlaneName::Matte, PlaneName::MatteWeight, PlaneName::DirectMatte],
                ),
                Signal::Glossy => (
                    frame.glossy_weight,
                    frame.direct_glossy,
                    [PlaneName::Glossy, PlaneName::GlossyWeight, PlaneName::DirectGlossy],
                ),
            };
            frame.signal(signal).map(|light| PackedSignal {
                light: colour(Some(light), names[0]),
                weight: weight.map(|p| colour(Some(p), names[1])),
                direct: noisy.map(|p| colour(Some(p), names[2])),
            })
        };
        let (matte, glossy) = (signal(Signal::Matte), signal(Signal::Glossy));
        let joint = frame.passes.iter().map(|pass| colour(Some(pass.plane), PlaneName::Passes)).collect();
        Ok(Self {
            guides: pack_guides(&guides, storage),
            has_roughness: guides.has_roughness,
            has_glossy_hit: guides.has_glossy_hit,
            direct,
            matte,
            glossy,
            joint,
            sanitised,
        })
    }
}

/// Colours as texels, row by row.
fn pack_colours(plane: &Plane<Rgb>) -> Vec<u8> {
    let size = plane.size();
    let mut out = vec![0; size.pixels() * COLOUR];
    par::rows(&mut out, size.width * COLOUR, |y, row| {
        for (bytes, colour) in row.chunks_exact_mut(COLOUR).zip(plane.row(y)) {
            for (bytes, value) in bytes.chunks_exact_mut(4).zip(colour) {
                bytes.copy_from_slice(&value.to_le_bytes());
            }
        }
    });
    out
}

/// A colour plane out of the texels of a texture of [`super::Output`], rgba16float or rgba32float; `None`: another format,
/// or too few.
pub fn unpack_colours(bytes: &[u8], size: Size, format: wgpu::TextureFormat) -> Option<Plane<Rgb>> {
    unpack(bytes, size, format, |[r, g, b, _]| [r, g, b])
}

/// The magnitudes of the fourth values: of [`super::Output::confidence`].
pub fn unpack_fourth(bytes: &[u8], size: Size, format: wgpu::TextureFormat) -> Option<Plane<f32>> {
    unpack(bytes, size, format, |[.., a]| a.abs())
}

/// A plane of numbers: [`super::Output::history_length`].
pub fn unpack_numbers(bytes: &[u8], size: Size) -> Option<Plane<f32>> {
    let numbers = bytes.as_chunks().0.iter().take(size.pixels());
    Plane::from_vec(size, numbers.map(|b| f32::from_le_bytes(*b)).collect()).ok()
}

/// What `keep` keeps of each texel of four values.
fn unpack<T: Copy + Default + Send>(
    bytes: &[u8],
    size: Size,
    format: wgpu::TextureFormat,
    keep: impl Fn([f32; 4]) -> T + Sync + Send,
) -> Option<Plane<T>> {
    match format {
        wgpu::TextureFormat::Rgba32Float => by_rows(bytes.as_chunks().0, size, |texel| keep(floats(texel))),
        wgpu::TextureFormat::Rgba16Float => by_rows(bytes.as_chunks().0, size, |texel| keep(halves(texel))),
        _ => None,
    }
}

fn by_rows<T: Copy + Default + Send, const STRIDE: usize>(
    texels: &[[u8; STRIDE]],
    size: Size,
    read: impl Fn(&[u8; STRIDE]) -> T + Sync + Send,
) -> Option<Plane<T>> {
    let texels = texels.get(..size.pixels())?;
    let mut plane = Plane::filled(size, T::default());
    par::rows(plane.data_mut(), size.width, |y, row| {
        for (value, texel) in row.iter_mut().zip(texels.iter().skip(y * size.width)) {
            *value = read(texel);
        }
    });
    Some(plane)
}

fn floats(texel: &[u8; 16]) -> [f32; 4] {
    let mut values = [0.0; 4];
    for (value, bytes) in values.iter_mut().zip(texel.as_chunks().0) {
        *value = f32::from_le_bytes(*bytes);
    }
    values
}

fn halves(texel: &[u8; 8]) -> [f32; 4] {
    let mut values = [0.0; 4];
    for (value, bytes) in values.iter_mut().zip(texel.as_chunks().0) {
        *value = half::f16::from_le_bytes(*bytes).to_f32();
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_read() {
        let bytes = [0x3c00, 0xc000, 0x7bff, 1, 0x8000, 0x3555, 0, 0xfc00u16].map(u16::to_le_bytes);
        let size = Size::new(2, 1);
        let read = |size| unpack_colours(bytes.as_flattened(), size, wgpu::TextureFormat::Rgba16Float);
        assert_eq!(read(size).unwrap().data(), [[1.0, -2.0, 65504.0], [0.0, 0.333_251_95, 0.0]]);
        let fourth = unpack_fourth(bytes.as_flattened(), size, wgpu::TextureFormat::Rgba16Float);
        assert_eq!(fourth.unwrap().data(), [5.960_464_5e-8, f32::INFINITY]);
        assert!(read(Size::new(3, 1)).is_none(), "too few");
        assert!(unpack_colours(&[0; 64], size, wgpu::TextureFormat::R32Float).is_none());
    }
}
