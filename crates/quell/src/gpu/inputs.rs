//! The guides of a frame as a host's textures, checked before anything is encoded.

use super::convention::Convention;
use super::error::Error;
use super::kernel::check_texture;
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
