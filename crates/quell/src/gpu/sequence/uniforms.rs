//! What the sequence filter's passes read besides planes, and what its bits mean.

use crate::gpu::uniform::{Uniform, uniforms};
use crate::plane::Size;
use crate::sequence::WaveletLight;
use glam::{UVec2, UVec4, Vec2, Vec4};

uniforms! {
    pub(super) FeatureUniforms as "FeatureSettings" {
        pub(super) size: UVec2,
        /// Of the frame in the arrays.
        pub(super) layer: i32,
        /// [`SEEN_COLOURS`] and [`SEEN_NORMALS`] where there are such.
        pub(super) seen: u32,
    }
    pub(super) GatherUniforms as "GatherSettings" {
        pub(super) size: UVec2,
        /// Row of the picture at which this begins, and rows of the picture.
        pub(super) first_row: i32,
        pub(super) picture_height: i32,
        /// Frames in the window, the place among them of the one that is estimated, and the most frames that a motion
        /// trajectory leads through.
        pub(super) count: i32,
        pub(super) centre: i32,
        pub(super) steps: i32,
        pub(super) future: u32,
        /// Rows up or down that a motion trajectory may lead.
        pub(super) farthest: f32,
        pub(super) plane_distance: f32,
        pub(super) round_trip: f32,
        pub(super) round_trip_share: f32,
        pub(super) standing_normal: f32,
        pub(super) standing_reach: f32,
        pub(super) plane_normal: f32,
        pub(super) moving_normal: f32,
        pub(super) moving_depth: f32,
        pub(super) moving_weight: f32,
        pub(super) least_share: f32,
        pub(super) same_noise: f32,
        pub(super) seen_albedo: f32,
        pub(super) seen_normal: f32,
        /// Likeness from which a pixel goes before a nearer one.
        pub(super) seen_alike: f32,
        /// How far the light around may differ in another frame.
        pub(super) light_deviations: f32,
        pub(super) light_deviations_high: f32,
        pub(super) light_noise: f32,
        pub(super) light_contrast: f32,
        /// The planes' bits: of light that is seen in mirrors and through glass, and of what moves by its own motion there.
        pub(super) seen: u32,
        pub(super) reflected: u32,
        /// Planes, and whether these are the frame's first.
        pub(super) planes: u32,
        pub(super) begins: u32,
        /// Weight of each plane one frame further away.
        pub(super) decay: Vec4,
    }
    /// A frame of the window.
    pub(super) FrameOfWindow as "WindowFrame" {
        pub(super) layer: i32,
        /// What it has: `HAS_*`.
        pub(super) has: u32,
        /// World-space size of a pixel per unit of depth; 0 where positions are unknown.
        pub(super) pixel_angle: f32,
        /// Its layer among the pictures.
        pub(super) picture: i32,
        /// Where it has each of four colour planes: `PLANE_*`.
        pub(super) places: UVec4,
    }
    pub(super) GuideStops as "GuideStops" {
        guided: u32,
        depth: f32,
        reach: Vec2,
        slope_error: f32,
        noise: f32,
        normal: f32,
        colour: f32,
        seen_normal: f32,
    }
    /// Of stages 2 and 3.
    pub(super) LightUniforms as "LightSettings" {
        /// First: shader compilers put no gap before a struct.
        pub(super) stops: GuideStops,
        pub(super) size: UVec2,
        /// Pixels between taps of the level.
        pub(super) step: i32,
        /// Squared, of the luminance stop.
        pub(super) tolerance: f32,
        pub(super) mirror_tolerance: f32,
        /// The same where there is little noise; deviation of a mean, relative, at which it lies half between.
        pub(super) low_tolerance: f32,
        pub(super) low_noise: f32,
        /// Deviations, squared, from which a neighbour is left out of a compared mean.
        pub(super) mean_step: f32,
        /// The most that a neighbour's variance counts, times a pixel's own.
        pub(super) variance_ratio: f32,
        /// Of the level: variance of a mean over 3x3 pixels, over that of independent ones.
        pub(super) correlation: f32,
        pub(super) least_contrast: f32,
        /// Of the variance: pixels around that are pooled, samples that are trusted, the light's place among the counts, and
        /// whether the renderer gave a variance.
        pub(super) radius: i32,
        pub(super) trusted_samples: f32,
        /// Weight of the pixels around below which the spread of 3x3 pixels counts too.
        pub(super) least_window: f32,
        pub(super) place: u32,
        pub(super) given: u32,
    }
}

impl LightUniforms {
    /// What stage 3 reads; stage 2 adds to it.
    pub(super) fn new(light: &WaveletLight, size: Size, step: i32) -> Self {
        Self {
            size: extent(size),
            step,
            tolerance: light.tolerance,
            mirror_tolerance: light.mirror_tolerance,
            low_tolerance: light.low_tolerance,
            low_noise: light.low_noise,
            mean_step: light.mean_step,
            variance_ratio: light.variance_ratio,
            correlation: crate::stages::wavelet::correlation(step.trailing_zeros()),
            least_contrast: light.least_contrast,
            radius: 0,
            trusted_samples: 0.0,
            least_window: 0.0,
            place: 0,
            given: 0,
            stops: GuideStops {
                guided: u32::from(light.guided),
                depth: light.depth,
                reach: Vec2::from(light.depth_reach),
                slope_error: light.slope_error,
                noise: light.guide_noise,
                normal: light.normal,
                colour: light.colour,
                seen_normal: light.seen_normal,
            },
        }
    }
}

/// Layouts of these structs.
pub(in crate::gpu) fn layouts() -> [Uniform; 8] {
    [
        FeatureUniforms::layout(),
        GatherUniforms::layout(),
        FrameOfWindow::layout(),
        GuideStops::layout(),
        LightUniforms::layout(),
        super::debug::layout(),
        super::residual::layout(),
        super::finish::layout(),
    ]
}

/// Bits of `WindowFrame::has`: motion of the surfaces, motion of what mirrors show, what is seen in mirrors and through glass,
/// noise that is the same in all frames.
pub(in crate::gpu) const HAS_TO_PREVIOUS: u32 = 1;
pub(in crate::gpu) const HAS_TO_NEXT: u32 = 2;
pub(in crate::gpu) const HAS_REFLECTION_TO_PREVIOUS: u32 = 4;
pub(in crate::gpu) const HAS_REFLECTION_TO_NEXT: u32 = 8;
pub(in crate::gpu) const HAS_SEEN: u32 = 16;
pub(in crate::gpu) const HAS_REPEATED_NOISE: u32 = 32;

/// The colours and the normals that are seen there are known; it has planes of the surface's colour.
pub(in crate::gpu) const HAS_SEEN_COLOUR: u32 = 64;
pub(in crate::gpu) const HAS_SEEN_NORMAL: u32 = 128;
pub(in crate::gpu) const HAS_SURFACE_COLOUR: u32 = 256;

/// A colour plane of a frame is black, among its samples, or was free of noise there and is not kept.
pub(in crate::gpu) const PLANE_BLACK: u32 = 0;
pub(in crate::gpu) const PLANE_THERE: u32 = 1;
pub(in crate::gpu) const PLANE_UNKNOWN: u32 = 2;

/// Bits of `FeatureSettings::seen`.
pub(in crate::gpu) const SEEN_COLOURS: u32 = 1;
pub(in crate::gpu) const SEEN_NORMALS: u32 = 2;

/// Of an image that was checked.
pub(in crate::gpu) fn extent(size: Size) -> UVec2 {
    UVec2::new(size.width as u32, size.height as u32)
}
