//! Feature buffers as filters within one frame read them, and which of them a kind of light believes.

use crate::plane::Size;
use crate::sequence::LightKind;
#[cfg(feature = "cpu")]
use crate::window::LightSlot;

/// Feature buffers that filters within one frame read; one number a pixel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalFeatures {
    /// Extent.
    pub size: Size,
    /// Change of inverse depth over one pixel to the right, and one down.
    pub slope: [Vec<f32>; 2],
    /// 1 / depth; 0: background, or no depth.
    pub inverse_depth: Vec<f32>,
    /// Noise of depth, relative.
    pub depth_noise: Vec<f32>,
    /// Unit normals, component by component; zeros where there is none.
    pub normal: [Vec<f32>; 3],
    /// Noise of the normal, about 1 - cosine: how far it lies from its neighbours' mean in the direction in which that is least.
    pub normal_noise: Vec<f32>,
    /// Tone-mapped albedo seen in mirrors and through glass. Empty: absent.
    pub seen_albedo: [Vec<f32>; 3],
    /// Unit normal seen there. Empty: absent.
    pub seen_normal: [Vec<f32>; 3],
    /// Tone-mapped colour of the surface, for light that could not be divided by it. Empty: absent.
    pub albedo: [Vec<f32>; 3],
    /// True in mirrors and clear glass. Empty: nowhere.
    pub mirror: Vec<bool>,
}

impl LocalFeatures {
    /// True where pixel `p` is a mirror or clear glass.
    #[inline(always)]
    pub fn is_mirror(&self, p: usize) -> bool {
        self.mirror.get(p).copied().unwrap_or(false)
    }
}

/// Which feature buffers a light's filter reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Depth and normal.
    Surface,
    /// These, and what is seen in mirrors and through glass.
    Seen,
    /// These, and the surface's colour: the light could not be divided by it.
    Coloured,
    /// None: media have no surface.
    Free,
}

impl Class {
    #[cfg(feature = "cpu")]
    pub(crate) const ALL: [Self; 4] = [Self::Surface, Self::Seen, Self::Coloured, Self::Free];

    /// The classes of the lights that take part; nothing where none does.
    #[cfg(feature = "cpu")]
    #[inline(always)]
    pub(crate) fn wanted(slots: &[LightSlot], takes_part: impl Fn(usize) -> bool) -> Option<[bool; Self::ALL.len()]> {
        let mut wanted = [false; Self::ALL.len()];
        for (l, slot) in slots.iter().enumerate() {
            wanted[Self::of(slot.kind) as usize] |= takes_part(l);
        }
        wanted.contains(&true).then_some(wanted)
    }

    /// The class of a kind of light.
    pub fn of(kind: LightKind) -> Self {
        match kind {
            LightKind::GlossyDirect | LightKind::GlossyIndirect | LightKind::Transmission => Self::Seen,
            LightKind::Beauty => Self::Coloured,
            LightKind::Volume => Self::Free,
            LightKind::MatteDirect | LightKind::MatteIndirect | LightKind::NoiseFree => Self::Surface,
        }
    }
}
