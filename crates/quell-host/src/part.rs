//! One tile of a frame on the device: a guest of its own, its textures, what comes back.

use crate::device::Gpu;
use crate::error::Error;
use crate::readback::Readback;
use crate::tiles::Piece;
use quell::gpu::{
    Frame, JointPlane, Output, PackedFrame, PackedGuides, PackedSignal, Storage, Texel, Tile, parted, unpack_colours,
    unpack_fourth, unpack_numbers, wgpu,
};
use quell::{Camera, Plane, Rgb, Signal, Size};
use std::collections::HashMap;

/// How a frame's colours come onto the device.
const COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
/// Names of a signal's planes: light, weight, noisy direct light.
const NAMES: [[&str; 3]; 2] = [["matte", "matte_weight", "direct_matte"], ["glossy", "glossy_weight", "direct_glossy"]];

/// A plane that is uploaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Name {
    Plane(&'static str),
    /// The joint pass of this number.
    Joint(usize),
}

impl std::fmt::Display for Name {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Plane(name) => f.write_str(name),
            Self::Joint(index) => write!(f, "joint pass {index}"),
        }
    }
}

/// What a frame has besides textures.
#[derive(Clone, Debug)]
pub(super) struct FrameInfo {
    pub(super) camera: Camera,
    pub(super) previous_camera: Camera,
    pub(super) index: i64,
    pub(super) has_roughness: bool,
    pub(super) has_glossy_hit: bool,
    /// Whether there is a signal, its weight, its noisy direct light.
    pub(super) signals: [Option<[bool; 2]>; 2],
    /// Name and signal of each joint pass.
    pub(super) joint: Vec<(String, Signal)>,
    pub(super) sanitised: quell::border::Sanitised,
}

impl FrameInfo {
    pub(super) fn new(frame: &quell::Frame<'_>, packed: &PackedFrame) -> Self {
        let terms = |signal: &Option<PackedSignal>| signal.as_ref().map(|s| [s.weight.is_some(), s.direct.is_some()]);
        Self {
            camera: frame.camera,
            previous_camera: frame.previous_camera,
            index: frame.index,
            has_roughness: packed.has_roughness,
            has_glossy_hit: packed.has_glossy_hit,
            signals: [terms(&packed.matte), terms(&packed.glossy)],
            joint: frame.passes.iter().map(|pass| (pass.name.to_owned(), pass.signal)).collect(),
            sanitised: packed.sanitised,
        }
    }
}

/// Planes that came back.
pub(super) struct Shown {
    pub(super) composite: Plane<Rgb>,
    pub(super) direct: Plane<Rgb>,
    /// The matte and the glossy signal, each with its passes behind it.
    pub(super) signals: [Vec<Plane<Rgb>>; 2],
    pub(super) confidence: Plane<f32>,
    pub(super) history_length: Plane<f32>,
}

/// A tile.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) guest: quell::gpu::Denoiser,
    pub(super) piece: Piece,
    tile: Option<Tile>,
    planes: HashMap<Name, wgpu::TextureView>,
}

impl Part {
    pub(super) fn new(guest: quell::gpu::Denoiser, piece: Piece, whole: Size) -> Self {
        Self { guest, piece, tile: piece.tile(whole), planes: HashMap::new() }
    }

    /// Its part of the planes of a picture `whole` columns wide.
    pub(super) fn upload(&mut self, gpu: &Gpu, packed: &PackedFrame, whole: Size, storage: Storage) {
        for (name, texel, texels) in [
            ("geometry", Texel::Geometry, &packed.guides.geometry),
            ("surface", Texel::Surface, &packed.guides.surface),
            ("moving", Texel::Moving, &packed.guides.moving),
        ] {
            self.write(gpu, Name::Plane(name), texel.format(storage), texels, whole);
        }
        self.write(gpu, Name::Plane("direct"), COLOUR, &packed.direct, whole);
        for (signal, names) in [&packed.matte, &packed.glossy].into_iter().zip(NAMES) {
            let Some(PackedSignal { light, weight, direct }) = signal else { continue };
            for (bytes, name) in [Some(light), weight.as_ref(), direct.as_ref()].into_iter().zip(names) {
                if let Some(bytes) = bytes {
                    self.write(gpu, Name::Plane(name), COLOUR, bytes, whole);
                }
            }
        }
        for (index, light) in packed.joint.iter().enumerate() {
            self.write(gpu, Name::Joint(index), COLOUR, light, whole);
        }
    }

    /// Fills the texture of a plane; it is made where there is none.
    fn write(&mut self, gpu: &Gpu, name: Name, format: wgpu::TextureFormat, texels: &[u8], whole: Size) {
        let size = self.piece.size();
        let view =
            self.planes.entry(name).or_insert_with(|| gpu.empty_texture(&format!("quell host {name}"), size, format));
        gpu.write_texture(view.texture(), texels, self.piece.origin(), whole);
    }

    /// Bytes of the textures that hold what was uploaded.
    pub(super) fn uploaded_bytes(&self) -> u64 {
        let bytes = |view: &wgpu::TextureView| {
            let texture = view.texture();
            let texel = texture.format().block_copy_size(None).unwrap_or(0);
            u64::from(texel) * u64::from(texture.width()) * u64::from(texture.height())
        };
        self.planes.values().map(bytes).sum()
    }

    /// Encodes the frame that was uploaded.
    pub(super) fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        info: &FrameInfo,
    ) -> Result<Output, Error> {
        let plane = |name| self.planes.get(&Name::Plane(name));
        let (Some(geometry), Some(surface), Some(moving), Some(direct)) =
            (plane("geometry"), plane("surface"), plane("moving"), plane("direct"))
        else {
            return Err(Error::NoFrame);
        };
        let signal = |k: usize| {
            let ([weight, noisy], names) = (info.signals[k]?, NAMES[k]);
            Some(quell::gpu::Signal {
                light: plane(names[0])?,
                weight: plane(names[1]).filter(|_| weight),
                direct: plane(names[2]).filter(|_| noisy),
            })
        };
        let joint = info.joint.iter().enumerate().filter_map(|(index, (name, signal))| {
            let light = self.planes.get(&Name::Joint(index))?;
            Some(JointPlane { name, signal: *signal, light })
        });
        let joint: Vec<_> = joint.collect();
        let FrameInfo { camera, previous_camera, index, has_roughness, has_glossy_hit, .. } = *info;
        let guides = PackedGuides { geometry, surface, moving, has_roughness, has_glossy_hit };
        let frame = Frame {
            direct: Some(direct),
            matte: signal(0),
            glossy: signal(1),
            joint: &joint,
            tile: self.tile,
            ..Frame::new(self.piece.size(), camera, previous_camera, index, guides)
        };
        let output = self.guest.encode(gpu.device(), encoder, &frame)?;
        self.guest.resolve_timings(gpu.device(), encoder);
        Ok(output)
    }

    /// Appends copies of what it encoded, in the order in which [`Part::unpack`] takes them.
    pub(super) fn copy_back(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        encoded: &Output,
        readback: &mut Readback,
    ) {
        textures(encoded).for_each(|texture| readback.texture(gpu, encoder, texture));
    }

    /// What it encoded, from the contents of its copies; takes as many as [`Part::copy_back`] made.
    pub(super) fn unpack(
        &self,
        gpu: &Gpu,
        encoded: &Output,
        info: &FrameInfo,
        contents: &mut impl Iterator<Item = Vec<u8>>,
    ) -> Result<Shown, Error> {
        let (what, size) = ("reading a frame back", self.piece.size());
        let mut contents = textures(encoded).map(|t| t.format()).zip(contents);
        let short = || Error::Refused {
            adapter: gpu.adapter().name.clone(),
            what: what.to_owned(),
            reason: "a texture holds no whole plane".to_owned(),
        };
        let mut colour = || contents.next().and_then(|(f, texels)| unpack_colours(&texels, size, f)).ok_or_else(short);
        let (composite, direct) = (colour()?, colour()?);
        let matte: Vec<_> = encoded.matte.iter().map(|_| colour()).collect::<Result<_, _>>()?;
        let mut signals = [matte, encoded.glossy.iter().map(|_| colour()).collect::<Result<_, _>>()?];
        let mut numbers = |there: bool, absent: f32, unpack: Unpack| {
            if !there {
                return Ok(Plane::filled(size, absent));
            }
            contents.next().and_then(|(format, texels)| unpack(&texels, size, format)).ok_or_else(short)
        };
        // Without a stage that remembers there are neither.
        let confidence = numbers(encoded.confidence.is_some(), 0.0, unpack_fourth)?;
        let mut history_length = numbers(encoded.history_length.is_some(), 1.0, lengths)?;
        let changed_light = &self.guest.settings().changed_light;
        let is_shared = if encoded.matte.is_some() { changed_light.matte } else { changed_light.glossy };
        if is_shared {
            history_length.data_mut().iter_mut().for_each(|texel| *texel = parted(*texel).0);
        }
        for (_, signal) in &info.joint {
            let (format, texels) = contents.next().ok_or_else(short)?;
            signals[*signal as usize].push(unpack_colours(&texels, size, format).ok_or_else(short)?);
        }
        Ok(Shown { composite, direct, signals, confidence, history_length })
    }
}

/// What comes back of a frame: the sum and direct light, which are always there, then the others that are.
fn textures(encoded: &Output) -> impl Iterator<Item = &wgpu::Texture> {
    let named = [&encoded.composite, &encoded.direct, &encoded.matte, &encoded.glossy].map(Option::as_ref);
    let state = encoded.confidence.iter().chain(&encoded.history_length);
    named.into_iter().flatten().chain(state).chain(&encoded.joint).map(|view| view.texture())
}

type Unpack = fn(&[u8], Size, wgpu::TextureFormat) -> Option<Plane<f32>>;

fn lengths(bytes: &[u8], size: Size, _: wgpu::TextureFormat) -> Option<Plane<f32>> {
    unpack_numbers(bytes, size)
}

impl Shown {
    /// The planes of a picture that is put together from tiles.
    pub(super) fn empty(size: Size, like: &Self) -> Self {
        let colour = || Plane::filled(size, [0.0; 3]);
        Self {
            composite: colour(),
            direct: colour(),
            signals: [0, 1].map(|k| like.signals[k].iter().map(|_| colour()).collect()),
            confidence: Plane::filled(size, 0.0),
            history_length: Plane::filled(size, 1.0),
        }
    }

    /// Takes over the core of a tile.
    pub(super) fn paste(&mut self, part: &Self, piece: &Piece) {
        paste(&mut self.composite, &part.composite, piece);
        paste(&mut self.direct, &part.direct, piece);
        for (own, other) in self.signals.iter_mut().flatten().zip(part.signals.iter().flatten()) {
            paste(own, other, piece);
        }
        paste(&mut self.confidence, &part.confidence, piece);
        paste(&mut self.history_length, &part.history_length, piece);
    }
}

fn paste<T: Copy>(whole: &mut Plane<T>, part: &Plane<T>, piece: &Piece) {
    let (([x, y], core), [left, top]) = (piece.core(), piece.origin());
    for row in y..y + core.height {
        let to = whole.row_mut(row).get_mut(x..x + core.width);
        let from = part.row(row - top).get(x - left..x - left + core.width);
        if let (Some(to), Some(from)) = (to, from) {
            to.copy_from_slice(from);
        }
    }
}
