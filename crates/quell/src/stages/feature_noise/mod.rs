//! Sequence filter: slopes of depth, and how noisy the feature buffers are themselves.
//!
//! | | |
//! |---|---|
//! | reads | feature buffers of the frame ([`Features`](crate::sequence::Features)) |
//! | writes | [`LocalFeatures`] |
//! | reach | 2 rows: neighbours in 3x3, and theirs where a band ends |
//! | equation | slope: of the two one-sided differences of 1/z the smaller; noise: over four directions the least \|a - 2 p + b\|, relative to p (depth), as 1 - cosine (normal) |
//! | source | ours: `docs/sequence.md` |
//!
//! Along an edge a clean feature buffer is smooth; where it is smooth in no direction it is noisy (depth of field, motion blur,
//! hair), and its edge-stopping function is loosened by that much.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::pipeline::Reach;
use crate::plane::Size;

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
    /// Noise of the normal: 1 - cosine that neighbours differ by whatever the direction.
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

/// Added to the albedo seen in mirrors and clear glass, beyond what tone-mapped colours (0..2) and any tolerance bridge:
/// light that was divided by what it shows never mixes with light that was not.
pub(crate) const APART: f32 = 8.0;

/// How far the stage looks.
pub fn reach() -> Reach {
    Reach::around(2)
}
