//! Frames of the CPU for the buffers of [`super::Frame`], and what [`super::Output`]'s buffers hold: for hosts whose planes
//! do not lie on the GPU.

use super::guides::pack_guides;
use crate::border::{Guides, PlaneName, Sanitised, copy_colour};
use crate::error::Error;
use crate::frame::{Frame, Rgb, Signal};
use crate::par;
use crate::plane::{Plane, PlaneRef, Size};

/// Bytes of a colour and of confidence and history length.
const COLOUR: usize = 16;
const STATE: usize = 8;

/// The planes of one frame as bytes for storage buffers, repaired as on the CPU.
#[derive(Clone, Debug)]
pub struct PackedFrame {
    /// [`super::Frame::guides`].
    pub guides: Vec<u8>,
    /// [`super::Frame::has_roughness`].
    pub has_roughness: bool,
    /// [`super::Frame::has_glossy_hit`].
    pub has_glossy_hit: bool,
    /// [`super::Frame::direct`].
    pub direct: Vec<u8>,
    /// [`super::Frame::matte`].
    pub matte: Option<PackedSignal>,
    /// [`super::Frame::glossy`].
    pub glossy: Option<PackedSignal>,
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
    /// Reads a frame. Its joint passes are left out: nothing on the GPU takes them.
    ///
    /// # Errors
    /// What [`Frame::check`] finds.
    pub fn new(frame: &Frame<'_>) -> Result<Self, Error> {
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
        Ok(Self {
            guides: pack_guides(&guides),
            has_roughness: guides.has_roughness,
            has_glossy_hit: guides.has_glossy_hit,
            direct,
            matte,
            glossy,
            sanitised,
        })
    }
}

/// Colours for a storage buffer, row by row.
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

/// A colour plane out of the bytes of a buffer of [`super::Output`]; `None` where these are too few.
pub fn unpack_colours(bytes: &[u8], size: Size) -> Option<Plane<Rgb>> {
    let colour = |b: &[u8]| [float(b, 0), float(b, 4), float(b, 8)];
    Plane::from_vec(size, bytes.chunks_exact(COLOUR).take(size.pixels()).map(colour).collect()).ok()
}

/// Confidence and history length out of the bytes of [`super::Output::state`]; `None` where these are too few.
pub fn unpack_state(bytes: &[u8], size: Size) -> Option<[Plane<f32>; 2]> {
    let plane = |offset| {
        let values = bytes.chunks_exact(STATE).take(size.pixels()).map(|b| float(b, offset)).collect();
        Plane::from_vec(size, values).ok()
    };
    Some([plane(0)?, plane(4)?])
}

fn float(bytes: &[u8], offset: usize) -> f32 {
    bytes.get(offset..).and_then(|b| b.first_chunk()).map_or(0.0, |b| f32::from_le_bytes(*b))
}
