//! Names of a program's resources.

use super::inputs::GuidePlane;
use super::pass::Sample;
use crate::frame::Signal;
use crate::pipeline::Image;

/// Which resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "internals", expect(missing_docs, reason = "the name says it"))]
pub enum Slot {
    /// An image of the pipeline. What is remembered lies in `MatteHistory`, `GlossyHistory`, `DirectHistory`, `PictureHistory`,
    /// whichever stage writes it.
    Image(Image),
    /// What a plane that is tied to a signal has in an image's place; counted from 0 for each signal.
    Joint {
        signal: Signal,
        index: u16,
        image: Image,
    },
    Geometry,
    Surface,
    Moving,
    MatteLength,
    GlossyLength,
    MatteWeight,
    GlossyWeight,
    DirectMatte,
    DirectGlossy,
    PrefilterTaps,
    BilateralTaps,
    /// A guide of the host's, as it is.
    Guide(GuidePlane),
    /// The uniform of the pass that prepares the host's guides.
    Prepare,
    Repairs,
    /// What is bound in the place of a texture that the host has not: one texel of zeros.
    Absent(Sample),
}

impl Slot {
    /// For listings and labels.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Image(image) | Self::Joint { image, .. } => image.name(),
            Self::Geometry => "guides geometry",
            Self::Surface => "guides surface",
            Self::Moving => "guides moving",
            Self::MatteLength => "matte length",
            Self::GlossyLength => "glossy length",
            Self::MatteWeight => "matte weight",
            Self::GlossyWeight => "glossy weight",
            Self::DirectMatte => "direct matte",
            Self::DirectGlossy => "direct glossy",
            Self::PrefilterTaps => "matte prefilter taps",
            Self::BilateralTaps => "matte bilateral taps",
            Self::Guide(plane) => plane.name(),
            Self::Prepare => "prepare",
            Self::Repairs => "repairs",
            Self::Absent(Sample::Float) => "absent float",
            Self::Absent(Sample::Uint) => "absent id",
            Self::Absent(Sample::Depth) => "absent depth",
        }
    }

    pub(super) const fn alternates(self) -> bool {
        matches!(
            self,
            Self::Geometry
                | Self::Surface
                | Self::MatteLength
                | Self::GlossyLength
                | Self::Image(
                    Image::MatteHistory | Image::GlossyHistory | Image::DirectHistory | Image::PictureHistory,
                )
                | Self::Joint { image: Image::MatteHistory | Image::GlossyHistory, .. }
        )
    }

    pub(super) const fn is_input(self) -> bool {
        matches!(
            self,
            Self::Image(Image::MatteInput | Image::GlossyInput | Image::DirectInput)
                | Self::Joint { image: Image::MatteInput | Image::GlossyInput, .. }
                | Self::MatteWeight
                | Self::GlossyWeight
                | Self::DirectMatte
                | Self::DirectGlossy
                | Self::Guide(_)
        )
    }
}
