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
    Plane::from_vec(size, texels(bytes, size, format)?.map(|[r, g, b, _]| [r, g, b]).collect()).ok()
}

/// The magnitudes of the fourth values: of [`super::Output::confidence`].
pub fn unpack_fourth(bytes: &[u8], size: Size, format: wgpu::TextureFormat) -> Option<Plane<f32>> {
    Plane::from_vec(size, texels(bytes, size, format)?.map(|[.., a]| a.abs()).collect()).ok()
}

/// A plane of numbers: [`super::Output::history_length`].
pub fn unpack_numbers(bytes: &[u8], size: Size) -> Option<Plane<f32>> {
    let numbers = bytes.as_chunks().0.iter().take(size.pixels());
    Plane::from_vec(size, numbers.map(|b| f32::from_le_bytes(*b)).collect()).ok()
}

/// Red, green, blue and a number.
fn texels(bytes: &[u8], size: Size, format: wgpu::TextureFormat) -> Option<impl Iterator<Item = [f32; 4]>> {
    type Read = fn(&[u8], usize) -> f32;
    let (stride, read): (usize, Read) = match format {
        wgpu::TextureFormat::Rgba32Float => (16, |texel, c| float(texel, 4 * c)),
        wgpu::TextureFormat::Rgba16Float => (8, |texel, c| half(texel, 2 * c)),
        _ => return None,
    };
    let texels = bytes.chunks_exact(stride).take(size.pixels());
    Some(texels.map(move |texel| std::array::from_fn(|c| read(texel, c))))
}

fn float(bytes: &[u8], offset: usize) -> f32 {
    bytes.get(offset..).and_then(|b| b.first_chunk()).map_or(0.0, |b| f32::from_le_bytes(*b))
}

fn half(bytes: &[u8], offset: usize) -> f32 {
    bytes.get(offset..).and_then(|b| b.first_chunk()).map_or(0.0, |b| half::f16::from_le_bytes(*b).to_f32())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_read() {
        let read = |bits: u16| half(&bits.to_le_bytes(), 0);
        assert_eq!(
            [0x3c00, 0xc000, 0x7bff, 1, 0x8000, 0x3555].map(read),
            [1.0, -2.0, 65504.0, 5.960_464_5e-8, 0.0, 0.333_251_95]
        );
    }
}
