//! What goes in and what comes out, as textures on the caller's device.

use super::error::Error;
use super::inputs::GuideTextures;
use super::kernel::check_sampled;
use super::program::{Contents, SignalContents};
use super::repairs::Repairs;
use super::slot::Slot;
use super::storage::{Storage, Texel};
use super::tile::Tile;
use crate::camera::Camera;
use crate::frame::Signal as Lobe;
use crate::history::passes_key;
use crate::pipeline::{Image, is_jittered};
use crate::plane::Size;

/// One signal of a frame: colour textures of the caller's.
#[derive(Clone, Copy, Debug)]
pub struct Signal<'a> {
    /// Indirect light of the lobe, without its weight.
    pub light: &'a wgpu::TextureView,
    /// What multiplies it back. Absent: 1.
    pub weight: Option<&'a wgpu::TextureView>,
    /// Noisy direct light of the lobe, passed through unfiltered. Absent: none.
    pub direct: Option<&'a wgpu::TextureView>,
}

impl Signal<'_> {
    fn contents(&self) -> SignalContents {
        SignalContents { weight: self.weight.is_some(), direct: self.direct.is_some() }
    }
}

/// Guides as [`super::pack_guides`] packs them, in the formats of the denoiser's storage. They are copied into the
/// denoiser's own planes: usage `COPY_SRC`.
#[derive(Clone, Copy, Debug)]
pub struct PackedGuides<'a> {
    /// View depth and normal ([`Texel::Geometry`]).
    pub geometry: &'a wgpu::TextureView,
    /// Id and roughness ([`Texel::Surface`]).
    pub surface: &'a wgpu::TextureView,
    /// Motion, hit distance, confidence of the host ([`Texel::Moving`]).
    pub moving: &'a wgpu::TextureView,
    /// The roughness counts.
    pub has_roughness: bool,
    /// The hit distance counts.
    pub has_glossy_hit: bool,
}

/// What the pixels show.
#[derive(Clone, Copy, Debug)]
pub enum Guides<'a> {
    /// Packed on the CPU.
    Packed(PackedGuides<'a>),
    /// The host's own textures, in the host's convention.
    Textures(GuideTextures<'a>),
}

impl<'a> From<PackedGuides<'a>> for Guides<'a> {
    fn from(guides: PackedGuides<'a>) -> Self {
        Self::Packed(guides)
    }
}

impl<'a> From<GuideTextures<'a>> for Guides<'a> {
    fn from(guides: GuideTextures<'a>) -> Self {
        Self::Textures(guides)
    }
}

impl Guides<'_> {
    pub(super) const fn has_roughness(&self) -> bool {
        match self {
            Self::Packed(guides) => guides.has_roughness,
            Self::Textures(guides) => guides.roughness.is_some(),
        }
    }

    pub(super) const fn has_glossy_hit(&self) -> bool {
        match self {
            Self::Packed(guides) => guides.has_glossy_hit,
            Self::Textures(guides) => guides.glossy_hit_distance.is_some(),
        }
    }
}

/// A further colour plane that is filtered with the very weights and choices of one signal, so that planes that added up
/// before still add up. Each costs the signal's dispatches once more, which work out lookups, weights and choices anew: in
/// half storage 196 bytes a pixel for a matte one (5 dispatches), 148 for a glossy one (3); stages 5 and 6 are not fused
/// while there is a matte one.
#[derive(Clone, Copy, Debug)]
pub struct JointPlane<'a> {
    /// What history is known by: another list of names is a cut for the signal.
    pub name: &'a str,
    /// The signal, which the frame must have.
    pub signal: Lobe,
    /// Scene-linear light without the signal's weight, as [`Signal::light`].
    pub light: &'a wgpu::TextureView,
}

/// Textures of the caller's that results are written to, so that it needs no copy of its own. Format: that of the
/// denoiser's colours ([`Texel::Colour`]: rgba16float, or rgba32float); usages `STORAGE_BINDING`, `TEXTURE_BINDING` and
/// `COPY_DST`; at least of the frame's extent.
#[derive(Clone, Copy, Debug, Default)]
pub struct Targets<'a> {
    /// The sum.
    pub composite: Option<&'a wgpu::TextureView>,
    /// The matte signal, filtered.
    pub matte: Option<&'a wgpu::TextureView>,
    /// The glossy signal, filtered.
    pub glossy: Option<&'a wgpu::TextureView>,
}

impl<'a> PackedGuides<'a> {
    pub(super) const fn planes(&self) -> [(Slot, Texel, &'a wgpu::TextureView); 3] {
        [
            (Slot::Geometry, Texel::Geometry, self.geometry),
            (Slot::Surface, Texel::Surface, self.surface),
            (Slot::Moving, Texel::Moving, self.moving),
        ]
    }
}

/// A frame on the GPU: 2D textures of the caller's with one sample, at least of the frame's extent, read from texel (0, 0)
/// on. Colours: any format that a shader reads as floats (rgba16float, rgba32float, rg11b10ufloat, ..), usage
/// `TEXTURE_BINDING`. What they hold means what it means in [`crate::Frame`], and must keep its contract.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Its extent, at most the denoiser's: it may change from frame to frame (dynamic resolution), and history is kept.
    /// Textures may be larger: texels beyond it are neither read nor written.
    pub size: Size,
    /// The camera that took this frame.
    pub camera: Camera,
    /// The camera of the frame before.
    pub previous_camera: Camera,
    /// Number of the frame; one that does not differ from its predecessor by 1, up or down, is a cut.
    pub index: i64,
    /// What the pixels show.
    pub guides: Guides<'a>,
    /// Radiance that needs no filter. Absent: none.
    pub direct: Option<&'a wgpu::TextureView>,
    /// The matte signal.
    pub matte: Option<Signal<'a>>,
    /// The glossy signal.
    pub glossy: Option<Signal<'a>>,
    /// Further planes, each tied to a signal.
    pub joint: &'a [JointPlane<'a>],
    /// Where results go; what is `None` lies in a texture of the denoiser's.
    pub targets: Targets<'a>,
    /// The frame is a part of a larger picture, and `camera` and `previous_camera` are that picture's. Another part than
    /// the frame before was is a cut.
    pub tile: Option<Tile>,
}

impl<'a> Frame<'a> {
    /// A frame with guides and without light: fill in what you have.
    pub fn new(size: Size, camera: Camera, previous_camera: Camera, index: i64, guides: impl Into<Guides<'a>>) -> Self {
        Self {
            size,
            camera,
            previous_camera,
            index,
            guides: guides.into(),
            direct: None,
            matte: None,
            glossy: None,
            joint: &[],
            targets: Targets::default(),
            tile: None,
        }
    }

    /// The planes tied to a signal.
    fn joint_of(&self, signal: Lobe) -> impl Iterator<Item = &'a JointPlane<'a>> {
        self.joint.iter().filter(move |p| p.signal == signal)
    }

    /// What history of each signal is known by.
    pub(super) fn keys(&self) -> [u64; 2] {
        Lobe::ALL.map(|signal| passes_key(self.joint_of(signal).map(|p| p.name)))
    }

    /// Which planes there are. Whether repairs are counted is the denoiser's to say.
    pub fn contents(&self) -> Contents {
        Contents {
            matte: self.matte.map(|s| s.contents()),
            glossy: self.glossy.map(|s| s.contents()),
            direct: self.direct.is_some(),
            jitter: is_jittered(&self.camera, &self.previous_camera),
            joint: Lobe::ALL.map(|signal| self.joint_of(signal).count() as u16),
            textures: matches!(self.guides, Guides::Textures(_)),
            counts: false,
        }
    }

    /// The texture behind a resource whose role is [`super::Role::Input`].
    pub(super) fn input(&self, slot: Slot) -> Option<&'a wgpu::TextureView> {
        match slot {
            Slot::Image(Image::MatteInput) => self.matte.map(|s| s.light),
            Slot::Image(Image::GlossyInput) => self.glossy.map(|s| s.light),
            Slot::Image(Image::DirectInput) => self.direct,
            Slot::Joint { signal, index, image: Image::MatteInput | Image::GlossyInput } => {
                self.joint_of(signal).nth(usize::from(index)).map(|p| p.light)
            }
            Slot::MatteWeight => self.matte?.weight,
            Slot::GlossyWeight => self.glossy?.weight,
            Slot::DirectMatte => self.matte?.direct,
            Slot::DirectGlossy => self.glossy?.direct,
            Slot::Guide(plane) => match &self.guides {
                Guides::Textures(textures) => textures.given(plane),
                Guides::Packed(_) => None,
            },
            _ => None,
        }
    }

    /// Everything that can be known of the textures before the device sees them.
    ///
    /// `most`: the denoiser's extent.
    pub(super) fn check(&self, most: Size, storage: Storage) -> Result<(), Error> {
        let (pass, size) = ("denoiser", self.size);
        if size.width == 0 || size.height == 0 {
            return Err(crate::Error::EmptySize { size }.into());
        }
        if size.width > most.width || size.height > most.height {
            return Err(crate::Error::PlaneSize { plane: "frame".to_owned(), expected: most, found: size }.into());
        }
        if let Some(tile) = self.tile {
            tile.check(size)?;
        }
        let packed = match &self.guides {
            Guides::Packed(guides) => Some(guides.planes()),
            Guides::Textures(guides) => {
                guides.check(size)?;
                None
            }
        };
        for (slot, texel, view) in packed.into_iter().flatten() {
            let (binding, format) = (slot.name(), texel.format(storage));
            check_sampled(pass, binding, view, texel.sample_type(), size)?;
            if view.texture().format() != format {
                let (expected, found) = (texel.format_name(storage), view.texture().format());
                return Err(Error::Format { pass, binding, expected, found });
            }
            if !view.texture().usage().contains(wgpu::TextureUsages::COPY_SRC) {
                return Err(Error::Usage { pass, binding, usage: "COPY_SRC" });
            }
        }
        let colour = |binding, view: Option<&wgpu::TextureView>| {
            view.map_or(Ok(()), |v| check_sampled(pass, binding, v, Texel::Colour.sample_type(), size))
        };
        colour("direct", self.direct)?;
        for (signal, names) in [
            (self.matte, ["matte", "matte_weight", "direct_matte"]),
            (self.glossy, ["glossy", "glossy_weight", "direct_glossy"]),
        ] {
            let Some(signal) = signal else { continue };
            for (name, view) in names.into_iter().zip([Some(signal.light), signal.weight, signal.direct]) {
                colour(name, view)?;
            }
        }
        for plane in self.joint {
            colour("joint", Some(plane.light))?;
            let there = match plane.signal {
                Lobe::Matte => self.matte.is_some(),
                Lobe::Glossy => self.glossy.is_some(),
            };
            if !there {
                let (pass, signal) = (plane.name.to_owned(), plane.signal.name());
                return Err(crate::Error::PassWithoutSignal { pass, signal }.into());
            }
        }
        let targets =
            [("composite", self.targets.composite), ("matte", self.targets.matte), ("glossy", self.targets.glossy)];
        for (binding, target) in targets {
            target.map_or(Ok(()), |view| check_target(binding, view, storage, size))?;
        }
        Ok(())
    }
}

fn check_target(binding: &'static str, view: &wgpu::TextureView, storage: Storage, size: Size) -> Result<(), Error> {
    let pass = "target";
    check_sampled(pass, binding, view, Texel::Colour.sample_type(), size)?;
    let (found, usage) = (view.texture().format(), view.texture().usage());
    if found != Texel::Colour.format(storage) {
        return Err(Error::Format { pass, binding, expected: Texel::Colour.format_name(storage), found });
    }
    for (wanted, name) in
        [(wgpu::TextureUsages::STORAGE_BINDING, "STORAGE_BINDING"), (wgpu::TextureUsages::COPY_DST, "COPY_DST")]
    {
        if !usage.contains(wanted) {
            return Err(Error::Usage { pass, binding, usage: name });
        }
    }
    Ok(())
}

/// What was encoded: views of colour textures, in the denoiser's storage. They hold the frame once the caller's encoder
/// has run, until the next frame's has. The composite is the same texture at every frame until `resize`; the others may
/// alternate between two, and a signal that no stage filters is the caller's own.
#[derive(Clone, Debug)]
pub struct Output {
    /// The sum, anti-aliased where the frame has jitter and `antialiasing` is on; `None` unless [`super::Options::composite`] is on and
    /// the frame has any light.
    pub composite: Option<wgpu::TextureView>,
    /// Direct light, anti-aliased where stage 11 ran: the frame has jitter, [`super::Options::composite`] is on, `antialiasing` off.
    pub direct: Option<wgpu::TextureView>,
    /// The matte signal, filtered.
    pub matte: Option<wgpu::TextureView>,
    /// The glossy signal, filtered.
    pub glossy: Option<wgpu::TextureView>,
    /// An image whose fourth value is the confidence of the matte signal, or of the glossy one where there is no matte:
    /// its magnitude, 0..1; negative: background.
    pub confidence: Option<wgpu::TextureView>,
    /// History length of the same signal in frames, r32float. Where `changed_light` is on for that signal, the lower 11 bits of each
    /// number hold the fast history: read as a float, it is at most 2^-12 of itself too long.
    pub history_length: Option<wgpu::TextureView>,
    /// The planes of [`Frame::joint`], in that order.
    pub joint: Vec<wgpu::TextureView>,
    /// What was repaired, where anything was looked at: guides that came as textures, colours with
    /// [`super::Options::count_repairs`].
    pub repairs: Option<Repairs>,
    /// The frame continued from the one before.
    pub had_history: bool,
}
