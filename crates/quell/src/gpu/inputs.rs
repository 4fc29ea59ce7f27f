//! The guides of a frame as a host's textures, checked before anything is encoded.

use super::convention::Convention;
use super::error::Error;
use super::kernel::check_texture;
use super::pass::Sample;
use crate::plane::Size;

/// A channel of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "the channels' names")]
pub enum Channel {
    #[default]
    R,
    G,
    B,
    A,
}

/// A scalar plane: one channel of a texture. `(&orm).into()` is the first; roughness in glTF's texture of occlusion,
/// roughness and metalness is `Scalar { view: &orm, channel: Channel::G }`.
#[derive(Clone, Copy, Debug)]
pub struct Scalar<'a> {
    /// The texture.
    pub view: &'a wgpu::TextureView,
    /// Where in a texel the value is.
    pub channel: Channel,
}

impl<'a> From<&'a wgpu::TextureView> for Scalar<'a> {
    fn from(view: &'a wgpu::TextureView) -> Self {
        Self { view, channel: Channel::R }
    }
}

/// The guides of a frame as the host has them. What is `None` is absent and has the meaning that [`crate::Frame`] gives
/// it; planes may come and go from frame to frame, and several may lie in one texture.
///
/// Each is a two-dimensional texture with one sample a texel and the usage `TEXTURE_BINDING`, at least as large as the
/// frame, whose pixel (0, 0) is texel (0, 0); a view of its first mip level. Bad values are repaired and counted as on the
/// CPU ([`crate::border`]).
#[derive(Clone, Copy, Debug, Default)]
pub struct GuideTextures<'a> {
    /// What the values mean.
    pub convention: Convention,
    /// Any depth format (a view of the depth aspect alone), or R32Float, R16Float ...: [`super::DepthKind`].
    pub view_depth: Option<&'a wgpu::TextureView>,
    /// Rgba16Float, Rgba32Float, Rgb10a2Unorm, Rgba8Unorm; octahedral Rg16Float ...: [`super::NormalEncoding`].
    pub normal: Option<&'a wgpu::TextureView>,
    /// Rg16Float, Rg32Float, Rgba16Float ...: the first two channels, see [`Convention::motion_scale`]. NaN: unknown.
    pub motion: Option<&'a wgpu::TextureView>,
    /// 0..1: [`super::RoughnessKind`].
    pub roughness: Option<Scalar<'a>>,
    /// World-space distance from the surface to what the glossy ray hit; +inf: it left the scene.
    pub glossy_hit_distance: Option<Scalar<'a>>,
    /// R32Uint, R16Uint, R8Uint ...: the first channel.
    pub surface_id: Option<&'a wgpu::TextureView>,
    /// The host's trust in history, 0..1; 0 resets that pixel.
    pub confidence_in: Option<Scalar<'a>>,
}

/// A texture of [`GuideTextures`] as the border's pass binds it: depths have a place for each of their two kinds of format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GuidePlane {
    /// [`GuideTextures::view_depth`] in a depth format.
    DepthBuffer,
    /// [`GuideTextures::view_depth`] in any other format.
    ViewDepth,
    /// [`GuideTextures::normal`].
    Normal,
    /// [`GuideTextures::motion`].
    Motion,
    /// [`GuideTextures::roughness`].
    Roughness,
    /// [`GuideTextures::glossy_hit_distance`].
    GlossyHit,
    /// [`GuideTextures::surface_id`].
    SurfaceId,
    /// [`GuideTextures::confidence_in`].
    ConfidenceIn,
}

impl GuidePlane {
    /// In the order of the pass's bindings.
    pub const ALL: [Self; 8] = [
        Self::DepthBuffer,
        Self::ViewDepth,
        Self::Normal,
        Self::Motion,
        Self::Roughness,
        Self::GlossyHit,
        Self::SurfaceId,
        Self::ConfidenceIn,
    ];

    /// For listings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DepthBuffer => "depth buffer",
            Self::ViewDepth => "view depth",
            Self::Normal => "normal",
            Self::Motion => "motion",
            Self::Roughness => "roughness",
            Self::GlossyHit => "glossy hit distance",
            Self::SurfaceId => "surface id",
            Self::ConfidenceIn => "confidence in",
        }
    }

    /// How the pass reads it.
    pub const fn sample(self) -> Sample {
        match self {
            Self::DepthBuffer => Sample::Depth,
            Self::SurfaceId => Sample::Uint,
            _ => Sample::Float,
        }
    }

    /// What it adds to `Prepare.there` where the host has it: `HAS_*` of `passes/prepare.wgsl`.
    pub const fn there(self) -> u32 {
        match self {
            Self::DepthBuffer => 1 | Self::ViewDepth.there(),
            Self::ViewDepth => 2,
            Self::Normal => 4,
            Self::Motion => 8,
            Self::Roughness => 16,
            Self::GlossyHit => 32,
            Self::SurfaceId => 64,
            Self::ConfidenceIn => 128,
        }
    }

    /// Bytes of a texel in the formats that byte counts take for the host's: rgba16float normals, rg16float motion, a
    /// material texture of four bytes for roughness, half floats for hit distances, one byte of trust. Depth counts once.
    pub const fn usual_bytes(self) -> u32 {
        match self {
            Self::DepthBuffer => 0,
            Self::Normal => 8,
            Self::ViewDepth | Self::Motion | Self::Roughness | Self::SurfaceId => 4,
            Self::GlossyHit => 2,
            Self::ConfidenceIn => 1,
        }
    }
}

/// What a plane asks of its texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Asks {
    /// Floats or normalised numbers in so many channels.
    Channels(u8),
    /// Those, or a depth format.
    Depth,
    /// Unsigned integers.
    Id,
}

impl Asks {
    fn expected(self) -> &'static str {
        match self {
            Self::Channels(0 | 1) => "a format of floats or normalised numbers that has the channel",
            Self::Channels(2) => "a format of floats or normalised numbers with two channels or more",
            Self::Channels(_) => "a format of floats or normalised numbers with three channels or more",
            Self::Depth => "a depth format, or one of floats or normalised numbers",
            Self::Id => "a format of unsigned integers",
        }
    }

    fn takes(self, format: wgpu::TextureFormat) -> bool {
        use wgpu::TextureSampleType as T;
        if is_depth(format) {
            return self == Self::Depth;
        }
        match (self, format.sample_type(None, None)) {
            (Self::Channels(n), Some(T::Float { .. })) => format.components() >= n,
            (Self::Depth, Some(T::Float { .. })) | (Self::Id, Some(T::Uint)) => true,
            _ => false,
        }
    }
}

/// Whether a shader declares it as `texture_depth_2d`.
pub(super) fn is_depth(format: wgpu::TextureFormat) -> bool {
    format.has_depth_aspect()
}

/// Checks a plane of the host's: format, usage, extent, samples, dimension.
///
/// # Errors
/// Whichever is wrong, with the plane's name and what was expected.
pub(super) fn check(plane: &'static str, view: &wgpu::TextureView, asks: Asks, size: Size) -> Result<(), Error> {
    let (pass, binding) = ("prepare", plane);
    let found = view.texture().format();
    if !asks.takes(found) {
        return Err(Error::Format { pass, binding, expected: asks.expected(), found });
    }
    check_texture(pass, binding, view.texture(), size)
}

impl<'a> GuideTextures<'a> {
    /// What the host has for a place.
    pub(super) fn given(&self, plane: GuidePlane) -> Option<&'a wgpu::TextureView> {
        let depth = |wanted| self.view_depth.filter(|view| is_depth(view.texture().format()) == wanted);
        let scalar = |scalar: Option<Scalar<'a>>| scalar.map(|s| s.view);
        match plane {
            GuidePlane::DepthBuffer => depth(true),
            GuidePlane::ViewDepth => depth(false),
            GuidePlane::Normal => self.normal,
            GuidePlane::Motion => self.motion,
            GuidePlane::Roughness => scalar(self.roughness),
            GuidePlane::GlossyHit => scalar(self.glossy_hit_distance),
            GuidePlane::SurfaceId => self.surface_id,
            GuidePlane::ConfidenceIn => scalar(self.confidence_in),
        }
    }

    pub(super) fn check(&self, size: Size) -> Result<(), Error> {
        let normal = match self.convention.normal {
            super::NormalEncoding::Octahedral | super::NormalEncoding::UnormOctahedral => 2,
            _ => 3,
        };
        let scalar = |s: Option<Scalar<'a>>| (s.map(|s| s.view), Asks::Channels(s.map_or(0, |s| s.channel as u8 + 1)));
        for (name, (view, asks)) in [
            ("view_depth", (self.view_depth, Asks::Depth)),
            ("normal", (self.normal, Asks::Channels(normal))),
            ("motion", (self.motion, Asks::Channels(2))),
            ("roughness", scalar(self.roughness)),
            ("glossy_hit_distance", scalar(self.glossy_hit_distance)),
            ("surface_id", (self.surface_id, Asks::Id)),
            ("confidence_in", scalar(self.confidence_in)),
        ] {
            view.map_or(Ok(()), |view| check(name, view, asks, size))?;
        }
        Ok(())
    }
}

/// Rounding alone takes the squared length of normals of a format as far from 1.
pub(super) fn unit_tolerance(format: wgpu::TextureFormat) -> f32 {
    use wgpu::TextureFormat as F;
    match format {
        // Half a step of 2/1023 in each component, the worst direction; 1/255 below.
        F::Rgb10a2Unorm => 1e-2,
        F::Rgba8Unorm | F::Rgba8Snorm | F::Bgra8Unorm | F::Rg8Unorm | F::Rg8Snorm => 4e-2,
        // Mantissas of five bits.
        F::Rg11b10Ufloat | F::Rgb9e5Ufloat => 0.2,
        _ => crate::border::UNIT_TOLERANCE,
    }
}
