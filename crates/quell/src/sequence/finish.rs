//! Stages `stabilise` to `blend` of one frame as a host may run them on a device that keeps the frames of the window: which
//! planes of which frames are needed, and where the result goes.

use super::estimate::frames_held;
use super::pipeline::{SequencePlan, SequenceStage};
use super::planes::{self, FramePlane, numbers, texels};
use super::run::{Estimate, stabilise_window, stages_of};
use super::settings::{Blend as BlendSettings, Gather, Residual, SequenceSettings, Stabilise};
use crate::denoiser::Backend;
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::stages::blend::{Blend, BlendFrame};
use crate::stages::{gather, stabilise};
use crate::window::PreparedFrame;

/// A frame around the one that is finished.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PictureFrame {
    /// Its number: frames of a window follow each other.
    pub number: i64,
    /// Whether it has [`FramePlane::ToPrevious`], `ToNext`, `ReflectionToPrevious`, `ReflectionToNext`.
    pub has_motion: [bool; 4],
    /// Whether it has planes of what mirrors and glass show, and which of colours and normals are known there.
    pub seen: Option<[bool; 2]>,
    /// Whether it has [`FramePlane::SurfaceColour`].
    pub has_surface_colour: bool,
    /// Whether it has a coverage.
    pub has_alpha: bool,
    /// Motion is the camera's alone.
    pub camera_motion: bool,
}

/// What this processor makes of the stages, for tests of agreement.
#[derive(Clone, Debug)]
pub struct FinishedOnCpu {
    /// The stabilised picture, corrected.
    pub steady: Plane<Rgb>,
    /// What stage `blend` makes of it.
    pub blend: Blend,
}

/// What the stages made.
#[derive(Debug)]
pub(super) struct Finish {
    /// The stabilised picture, corrected.
    pub steady: Plane<Rgb>,
    pub blend: Blend,
}

/// Stages `stabilise` to `blend` of one frame, or of a band of its rows.
pub struct FinishJob<'a> {
    frames: &'a [(&'a PreparedFrame, &'a Estimate)],
    centre: usize,
    settings: &'a SequenceSettings,
    corrects: bool,
    made: Option<Finish>,
}

impl std::fmt::Debug for FinishJob<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FinishJob").field("size", &self.size()).field("frames", &self.len()).finish_non_exhaustive()
    }
}

impl<'a> FinishJob<'a> {
    /// `None`: the plan lacks one of these stages, or one of the two nets is off, and there is no shader for what runs then; or a frame
    /// was not estimated on the device, or holds colours that shaders cannot be trusted with.
    pub(super) fn new(
        frames: &'a [(&'a PreparedFrame, &'a Estimate)],
        centre: usize,
        plan: &SequencePlan,
        settings: &'a SequenceSettings,
    ) -> Option<Self> {
        let both = plan.runs(SequenceStage::Stabilise) && plan.runs(SequenceStage::Blend);
        let corrects = plan.runs(SequenceStage::PictureResidual);
        let nets = settings.stabilise.net && settings.blend.net;
        let fits = frames.iter().all(|(_, estimate)| estimate.fits_device);
        (both && nets && fits && centre < frames.len()).then_some(Self {
            frames,
            centre,
            settings,
            corrects,
            made: None,
        })
    }

    fn here(&self) -> &'a PreparedFrame {
        self.frames[self.centre].0
    }

    fn member(&self, place: usize) -> (&'a PreparedFrame, &'a Estimate) {
        self.frames.get(place).copied().unwrap_or(self.frames[self.centre])
    }

    /// Extent of every plane.
    pub fn size(&self) -> Size {
        self.here().features.size
    }

    /// Row of the picture at which the planes begin, and rows of the picture.
    pub fn rows(&self) -> (usize, usize) {
        (self.here().features.first_row, self.here().features.picture_height)
    }

    /// Frames in the window; at least 1.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Never: the frame itself is there.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// The place of the frame itself in the window.
    pub fn centre(&self) -> usize {
        self.centre
    }

    /// The most frames whose pictures a window holds.
    pub fn most_pictures(&self) -> usize {
        let frames = self.settings.stabilise.frames as usize;
        if self.settings.gather.future { 2 * frames + 1 } else { frames + 1 }
    }

    /// The most frames whose feature buffers it holds: [`EstimateJob::most_frames`](super::EstimateJob).
    pub fn most_frames(&self) -> usize {
        frames_held(self.settings)
    }

    /// Settings of `gather` of this frame.
    pub fn gather(&self) -> Gather {
        gather::settings_of(&self.settings.gather, &self.here().features)
    }

    /// Settings of `stabilise`.
    pub fn stabilise(&self) -> &Stabilise {
        &self.settings.stabilise
    }

    /// Settings of `residual`; `None`: the stabilised picture is not corrected.
    pub fn residual(&self) -> Option<&Residual> {
        self.corrects.then_some(&self.settings.residual)
    }

    /// Settings of `blend`.
    pub fn blend(&self) -> &BlendSettings {
        &self.settings.blend
    }

    /// A frame of the window; the frame itself where there is no such place.
    pub fn frame(&self, place: usize) -> PictureFrame {
        let (member, last) = (self.member(place).0, place + 1 == self.len());
        let (features, motion) = (&member.features, &member.features.motion);
        PictureFrame {
            number: member.number,
            has_motion: [
                motion.to_previous.is_some(),
                motion.to_next.is_some() && !last,
                motion.reflection_to_previous.is_some(),
                motion.reflection_to_next.is_some() && !last,
            ],
            seen: features.seen.is_some().then_some(features.has_seen),
            has_surface_colour: features.surface_albedo.is_some(),
            has_alpha: member.alpha.is_some(),
            camera_motion: features.camera_motion,
        }
    }

    /// A plane of a frame, row by row, each row filled up to a multiple of `align` bytes. Zeros where the frame has
    /// none.
    pub fn plane(&self, place: usize, plane: FramePlane, align: usize) -> Vec<u8> {
        let (member, estimate) = self.member(place);
        match plane {
            FramePlane::Picture => texels(self.size(), align, plane.bytes(), |i, texel| {
                let [r, g, b] = estimate.picture.data()[i];
                numbers(texel, [r, g, b, member.alpha.as_ref().map_or(1.0, |alpha| alpha.data()[i])]);
            }),
            FramePlane::Input => texels(self.size(), align, plane.bytes(), |i, texel| {
                let [r, g, b] = estimate.input.data()[i];
                numbers(texel, [r, g, b, 0.0]);
            }),
            _ => planes::of_features(&member.features, plane, align),
        }
    }

    /// Takes what the stages made: for each pixel four f32, little-endian. `steady`: the stabilised picture, corrected; the fourth
    /// does not count. `shares`: of input, wavelet's picture and stabilised one; expected error. `gain`: what the kernel
    /// multiplies the mixture by; the coverage, which counts where the frame has one.
    ///
    /// # Errors
    /// One of them holds not as many pixels.
    pub fn store(&mut self, steady: &[u8], shares: &[u8], gain: &[u8]) -> Result<(), String> {
        let size = self.size();
        let (w, pixels) = (size.width, size.pixels());
        if let Some(wrong) = [steady, shares, gain].iter().find(|bytes| bytes.len() != 16 * pixels) {
            return Err(format!("{} bytes for a picture of {size}", wrong.len()));
        }
        let at = |bytes: &[u8], x: usize, y: usize| -> [f32; 4] {
            let pixel = bytes.as_chunks::<16>().0[y * w + x];
            std::array::from_fn(|c| f32::from_le_bytes(pixel.as_chunks::<4>().0[c]))
        };
        let three = |bytes: &[u8]| {
            par::plane(size, |x, y| {
                let [r, g, b, _] = at(bytes, x, y);
                [r, g, b]
            })
        };
        let fourth = |bytes: &[u8]| par::plane(size, |x, y| at(bytes, x, y)[3]);
        let alpha = self.here().alpha.is_some().then(|| fourth(gain));
        let blend = Blend { shares: three(shares), gain: Some(three(gain)), alpha, noise: fourth(shares) };
        self.made = Some(Finish { steady: three(steady), blend });
        Ok(())
    }

    /// What this processor makes of the frame, on a chosen back end: for tests of agreement.
    pub fn on_backend(&self, backend: Backend) -> FinishedOnCpu {
        let (stages, s, here) = (stages_of(backend), self.settings, self.here());
        let signature = |(frame, estimate): &(&PreparedFrame, &Estimate)| {
            stabilise::kept((stages.signature)(&frame.features, &estimate.picture))
        };
        let signatures: Vec<_> = self.frames.iter().map(signature).collect();
        let mut window = stabilise_window(self.frames, None);
        window.iter_mut().zip(&signatures).for_each(|(frame, signature)| frame.signature = Some(signature));
        let gather = self.gather();
        let (mut steady, alpha) = (stages.stabilise)(&window, self.centre, &gather, &s.stabilise);
        if let Some(residual) = self.residual() {
            let input = window[self.centre].input;
            steady = (stages.picture_residual)(here.features.first_row, input, steady, residual);
        }
        let frames: Vec<_> = window.iter().map(BlendFrame::from).collect();
        let blend = (stages.blend)(&frames, self.centre, (&steady, alpha.as_ref()), (&gather, &s.stabilise), &s.blend);
        FinishedOnCpu { steady, blend }
    }

    pub(super) fn made(self) -> Option<Finish> {
        self.made
    }
}
