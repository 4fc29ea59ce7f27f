//! What a frame of a rendered sequence brings: any number of light passes, and guides that may be noisy themselves.
//!
//! The real-time contract ([`crate::Frame`]) knows two signals and trusts its guides. Files of other renderers hold
//! more (transmission, volume, noisy direct light), and their guides are means over a pixel's samples. All planes have
//! the frame's extent, row-major, origin top left, x right, y down.

use crate::error::Error;
use crate::frame::Rgb;
use crate::plane::{Plane, Size};
use std::sync::Arc;

/// What made the light of a pass: it decides which feature buffers (AOVs) its filter believes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LightKind {
    /// Matte (diffuse and subsurface) light that comes straight from a source: shadow edges are kept.
    MatteDirect,
    /// Matte light that comes over another surface: smooth.
    MatteIndirect,
    /// Glossy light that comes straight from a source: highlights.
    GlossyDirect,
    /// Reflections: they do not move with the surface.
    GlossyIndirect,
    /// Light through a surface, direct or indirect: what it shows lies behind that surface.
    Transmission,
    /// Light scattered in a medium: has no surface, depth does not stop it.
    Volume,
    /// Everything at once: a beauty from which nothing could be told apart.
    Beauty,
    /// Noise-free light (emission, environment): all its noise is that of edges. Never filtered across pixels.
    NoiseFree,
}

/// One light pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// For messages and for whoever writes it back.
    pub name: String,
    /// What made it.
    pub kind: LightKind,
    /// Scene-linear light *without* its colour: the pass's contribution to the picture is `light * weight`.
    pub light: Plane<Rgb>,
    /// The colour that multiplies it back, >= 0. Absent: 1. Lights of one surface may share it.
    pub weight: Option<Arc<Plane<Rgb>>>,
    /// False for a pass that is filtered but is no term of the beauty (it is part of another pass already).
    pub in_beauty: bool,
    /// Further colour planes filtered with this light's very weights (a decomposition of it: they add up after as they
    /// did before).
    pub joint: Vec<Plane<Rgb>>,
}

impl Light {
    /// A term of the beauty without colour, without joint planes.
    pub fn new(name: impl Into<String>, kind: LightKind, light: Plane<Rgb>) -> Self {
        Self { name: name.into(), kind, light, weight: None, in_beauty: true, joint: Vec::new() }
    }
}

/// One frame of a sequence. Preset `sequence` reads every plane but those whose comment says that no preset reads them.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceFrame {
    /// Frame number. One that does not follow its predecessor by one is a cut.
    pub number: i64,
    /// Extent of every plane.
    pub size: Size,
    /// Every pass that is filtered. The beauty is the sum of light * weight over those with `in_beauty`.
    pub lights: Vec<Light>,
    /// Distance along the camera's axis, > 0; +inf: background. Absent: unknown.
    pub depth: Option<Plane<f32>>,
    /// Shading normal, world space, on the viewer's side; shorter than 1 where a pixel mixes surfaces; (0, 0, 0):
    /// background. Absent: unknown.
    pub normal: Option<Plane<[f32; 3]>>,
    /// World position of the surface. Absent: unknown.
    pub position: Option<Plane<[f32; 3]>>,
    /// The surface in the frame before lies at pixel + motion, pixels, y down. NaN: unknown. Absent: history is off.
    pub motion_to_previous: Option<Plane<[f32; 2]>>,
    /// The surface in the next frame lies at pixel + motion, pixels, y down. NaN or absent: found from the next frame's
    /// `motion_to_previous`.
    pub motion_to_next: Option<Plane<[f32; 2]>>,
    /// True where motion is the camera's alone, found from positions: things that move by themselves are not in it.
    pub camera_motion: bool,
    /// Colour of the surface, >= 0. Absent: unknown.
    pub albedo: Option<Plane<Rgb>>,
    /// What is seen *through* mirrors and glass: albedo and normal at the first rough surface (Cycles' `Denoising
    /// Albedo`, `Denoising Normal`). Guides of glossy and transmitted light.
    pub seen_albedo: Option<Plane<Rgb>>,
    /// See `seen_albedo`.
    pub seen_normal: Option<Plane<[f32; 3]>>,
    /// Perceptual roughness, 0..1. Absent: unknown. No preset reads it yet.
    pub roughness: Option<Plane<f32>>,
    /// Coverage, 0..1, filtered with the beauty's weights. Absent: 1.
    pub alpha: Option<Plane<f32>>,
    /// Variance of the pixel's mean (luminance of the beauty). Absent: estimated.
    pub variance: Option<Plane<f32>>,
    /// True where this frame's noise repeats its predecessor's (one seed for all frames): it brings no new samples.
    pub repeats_noise: bool,
}

impl SequenceFrame {
    /// A frame without any plane.
    pub fn new(number: i64, size: Size) -> Self {
        Self {
            number,
            size,
            lights: Vec::new(),
            depth: None,
            normal: None,
            position: None,
            motion_to_previous: None,
            motion_to_next: None,
            camera_motion: false,
            albedo: None,
            seen_albedo: None,
            seen_normal: None,
            roughness: None,
            alpha: None,
            variance: None,
            repeats_noise: false,
        }
    }

    /// The sum of light * weight over the passes that make the beauty.
    pub fn beauty(&self) -> Plane<Rgb> {
        let mut sum = Plane::filled(self.size, [0.0; 3]);
        for light in self.lights.iter().filter(|l| l.in_beauty) {
            for (i, (sum, value)) in sum.data_mut().iter_mut().zip(light.light.data()).enumerate() {
                let weight = light.weight.as_ref().and_then(|w| w.data().get(i).copied()).unwrap_or([1.0; 3]);
                for c in 0..3 {
                    sum[c] += value[c] * weight[c];
                }
            }
        }
        sum
    }

    /// Every plane has the frame's extent, which is not empty.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let expected = self.size;
        if expected.width == 0 || expected.height == 0 {
            return Err(Error::EmptySize { size: expected });
        }
        let same = |plane: &str, found: Option<Size>| match found {
            Some(found) if found != expected => Err(Error::PlaneSize { plane: plane.to_owned(), expected, found }),
            _ => Ok(()),
        };
        for light in &self.lights {
            same(&light.name, Some(light.light.size()))?;
            same(&format!("weight of {}", light.name), light.weight.as_deref().map(Plane::size))?;
            for joint in &light.joint {
                same(&format!("joint plane of {}", light.name), Some(joint.size()))?;
            }
        }
        same("depth", self.depth.as_ref().map(Plane::size))?;
        same("normal", self.normal.as_ref().map(Plane::size))?;
        same("position", self.position.as_ref().map(Plane::size))?;
        same("motion to previous", self.motion_to_previous.as_ref().map(Plane::size))?;
        same("motion to next", self.motion_to_next.as_ref().map(Plane::size))?;
        same("albedo", self.albedo.as_ref().map(Plane::size))?;
        same("seen albedo", self.seen_albedo.as_ref().map(Plane::size))?;
        same("seen normal", self.seen_normal.as_ref().map(Plane::size))?;
        same("roughness", self.roughness.as_ref().map(Plane::size))?;
        same("alpha", self.alpha.as_ref().map(Plane::size))?;
        same("variance", self.variance.as_ref().map(Plane::size))
    }
}

/// A filtered light: the light itself, then its joint planes, all without weight.
#[derive(Clone, Debug, PartialEq)]
pub struct FilteredLight {
    /// As many planes as the light and its joint planes.
    pub planes: Vec<Plane<Rgb>>,
    /// [`Light::weight`] as it came.
    pub weight: Option<Arc<Plane<Rgb>>>,
}

/// A filtered frame. Planes have the frame's extent.
#[derive(Clone, Debug, PartialEq)]
pub struct Filtered {
    /// Frame number.
    pub number: i64,
    /// In the order of [`SequenceFrame::lights`].
    pub lights: Vec<FilteredLight>,
    /// Coverage, where the frame has it.
    pub alpha: Option<Plane<f32>>,
    /// Trust in the result, 0..1: 1 where many samples met.
    pub confidence: Plane<f32>,
    /// Samples (pixels of some frame) that the steadiest light's mean is worth before the filter over the image.
    pub samples: Plane<f32>,
    /// Expected error of the picture at `blend.strength` 1: root mean square over the channels, in units of the picture. Absent
    /// where the stage `blend` does not run.
    pub noise: Option<Plane<f32>>,
    /// Colour samples of the input that were not finite and counted as 0.
    pub repaired: usize,
}
