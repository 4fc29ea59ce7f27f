//! The frame contract: which planes a renderer hands over, in which space, unit, sign, and what a special value means.
//!
//! Row-major planes, origin top left, x right, y down, pixel centres at +0.5; scene-linear light. World space is
//! right-handed, in the scene's own unit: nothing assumes metres.

use crate::camera::Camera;
use crate::error::Error;
use crate::plane::{Plane, PlaneRef, Size};

/// Scene-linear red, green, blue.
pub type Rgb = [f32; 3];

/// One of the signals that the denoiser filters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Signal {
    /// Indirect light of the matte lobe.
    Matte,
    /// Indirect light of the glossy lobe.
    Glossy,
}

impl Signal {
    /// Both signals, in the order of the pipeline.
    pub const ALL: [Self; 2] = [Self::Matte, Self::Glossy];

    /// The plane's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Matte => "matte",
            Self::Glossy => "glossy",
        }
    }
}

/// A further colour plane that is filtered with the very weights and choices of one signal, so that passes that added
/// up before still add up.
#[derive(Clone, Copy, Debug)]
pub struct Pass<'a> {
    /// For messages and for the output.
    pub name: &'a str,
    /// The signal whose weights and choices it shares.
    pub signal: Signal,
    /// Scene-linear light, without the signal's weight.
    pub plane: PlaneRef<'a, Rgb>,
}

/// What a renderer hands over of one frame; it borrows and never copies without need.
///
/// An absent plane has the meaning that its comment gives. All planes present have the extent `size`. The presets read
/// every plane but those whose comment says that no preset reads them: files keep them for a preset to come.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Extent of every plane.
    pub size: Size,
    /// The camera that took this frame.
    pub camera: Camera,
    /// The camera of the frame before; equal to `camera` where there is none.
    pub previous_camera: Camera,
    /// Number of the frame. A frame that does not follow its predecessor by one (in either direction) is a cut.
    pub index: i64,
    /// Radiance that needs no filter: noise-free direct light, emission, background. Absent: zeros.
    pub direct: Option<PlaneRef<'a, Rgb>>,
    /// Indirect light of the matte (diffuse) lobe, mean over its paths, without its weight. Absent: costs nothing.
    pub matte: Option<PlaneRef<'a, Rgb>>,
    /// Indirect light of the glossy (specular) lobe, mean over its paths, without its weight. Absent: costs nothing.
    pub glossy: Option<PlaneRef<'a, Rgb>>,
    /// Noisy direct light of the matte lobe, without its weight. Absent: zeros. It is added to the picture
    /// unfiltered.
    pub direct_matte: Option<PlaneRef<'a, Rgb>>,
    /// Noisy direct light of the glossy lobe, without its weight. Absent: zeros. It is added to the picture
    /// unfiltered.
    pub direct_glossy: Option<PlaneRef<'a, Rgb>>,
    /// What multiplies the matte signals back; may exceed 1. Absent: 1.
    pub matte_weight: Option<PlaneRef<'a, Rgb>>,
    /// What multiplies the glossy signals back. Absent: 1.
    pub glossy_weight: Option<PlaneRef<'a, Rgb>>,
    /// Distance along the camera's axis, > 0; +inf: background. Absent: everything at the same depth of 1.
    pub view_depth: Option<PlaneRef<'a, f32>>,
    /// Shading normal on the viewer's side, world space, unit; (0, 0, 0): background. Absent: facing the camera.
    pub normal: Option<PlaneRef<'a, [f32; 3]>>,
    /// Perceptual roughness of glTF, 0..1 (GGX alpha is its square). Absent: kernels keep their constant radius.
    pub roughness: Option<PlaneRef<'a, f32>>,
    /// Previous = current + motion, in pixels (x right, y down), without jitter; camera, object and skin motion
    /// together. NaN: unknown, counts as disoccluded. Absent: from depth and both cameras.
    pub motion: Option<PlaneRef<'a, [f32; 2]>>,
    /// World-space distance from the surface to what the glossy ray hit; +inf: it left the scene. Absent: no virtual
    /// reprojection.
    pub glossy_hit_distance: Option<PlaneRef<'a, f32>>,
    /// World-space distance from the surface to what the matte (diffuse) ray hit; +inf: it left the scene. No preset reads it
    /// yet.
    pub matte_hit_distance: Option<PlaneRef<'a, f32>>,
    /// Object or material; differing ids never share light. Absent: all equal.
    pub surface_id: Option<PlaneRef<'a, u32>>,
    /// Coverage 0..1. Absent: 1. No preset reads it yet.
    pub alpha: Option<PlaneRef<'a, f32>>,
    /// Variance of the matte signal's pixel mean, luminance squared. No preset reads it yet.
    pub matte_variance: Option<PlaneRef<'a, f32>>,
    /// Variance of the glossy signal's pixel mean, luminance squared. No preset reads it yet.
    pub glossy_variance: Option<PlaneRef<'a, f32>>,
    /// The host's trust in history, 0..1; 0 resets that pixel. Absent: 1.
    pub confidence_in: Option<PlaneRef<'a, f32>>,
    /// Further colour planes, each tied to one signal.
    pub passes: &'a [Pass<'a>],
}

impl<'a> Frame<'a> {
    /// A frame without any plane: fill in what you have.
    pub fn new(size: Size, camera: Camera) -> Self {
        Self {
            size,
            camera,
            previous_camera: camera,
            index: 0,
            direct: None,
            matte: None,
            glossy: None,
            direct_matte: None,
            direct_glossy: None,
            matte_weight: None,
            glossy_weight: None,
            view_depth: None,
            normal: None,
            roughness: None,
            motion: None,
            glossy_hit_distance: None,
            matte_hit_distance: None,
            surface_id: None,
            alpha: None,
            matte_variance: None,
            glossy_variance: None,
            confidence_in: None,
            passes: &[],
        }
    }

    /// The plane of a signal.
    pub fn signal(&self, signal: Signal) -> Option<PlaneRef<'a, Rgb>> {
        match signal {
            Signal::Matte => self.matte,
            Signal::Glossy => self.glossy,
        }
    }

    /// Direct light plus every signal times its weight: the picture before any filter, linear RGB, of the frame's extent.
    /// L = direct + matte_weight (M + direct_matte) + glossy_weight (G + direct_glossy); what is absent counts as the
    /// field says.
    pub fn composite(&self) -> Plane<Rgb> {
        let terms = [
            (self.matte, self.matte_weight),
            (self.glossy, self.glossy_weight),
            (self.direct_matte, self.matte_weight),
            (self.direct_glossy, self.glossy_weight),
        ];
        Plane::from_fn(self.size, |x, y| {
            let mut sum = self.direct.map_or([0.0; 3], |p| p.at(x, y));
            for (light, weight) in terms {
                let Some(light) = light else { continue };
                let weight = weight.map_or([1.0; 3], |p| p.at(x, y));
                let light = light.at(x, y);
                for c in 0..3 {
                    sum[c] += weight[c] * light[c];
                }
            }
            sum
        })
    }

    /// Checks extents and cameras; pixel values are repaired and counted where the denoiser reads them.
    ///
    /// # Errors
    /// The first plane of another extent, a pass without its signal, a camera that cannot be used.
    pub fn check(&self, expected: Size) -> Result<(), Error> {
        if expected.width == 0 || expected.height == 0 {
            return Err(Error::EmptySize { size: expected });
        }
        let same = |plane: &str, found: Option<Size>| match found {
            Some(found) if found != expected => Err(Error::PlaneSize { plane: plane.to_owned(), expected, found }),
            _ => Ok(()),
        };
        same("frame", Some(self.size))?;
        same("direct", self.direct.map(|p| p.size()))?;
        same("matte", self.matte.map(|p| p.size()))?;
        same("glossy", self.glossy.map(|p| p.size()))?;
        same("direct_matte", self.direct_matte.map(|p| p.size()))?;
        same("direct_glossy", self.direct_glossy.map(|p| p.size()))?;
        same("matte_weight", self.matte_weight.map(|p| p.size()))?;
        same("glossy_weight", self.glossy_weight.map(|p| p.size()))?;
        same("view_depth", self.view_depth.map(|p| p.size()))?;
        same("normal", self.normal.map(|p| p.size()))?;
        same("roughness", self.roughness.map(|p| p.size()))?;
        same("motion", self.motion.map(|p| p.size()))?;
        same("glossy_hit_distance", self.glossy_hit_distance.map(|p| p.size()))?;
        same("matte_hit_distance", self.matte_hit_distance.map(|p| p.size()))?;
        same("surface_id", self.surface_id.map(|p| p.size()))?;
        same("alpha", self.alpha.map(|p| p.size()))?;
        same("matte_variance", self.matte_variance.map(|p| p.size()))?;
        same("glossy_variance", self.glossy_variance.map(|p| p.size()))?;
        same("confidence_in", self.confidence_in.map(|p| p.size()))?;
        for pass in self.passes {
            same(pass.name, Some(pass.plane.size()))?;
            if self.signal(pass.signal).is_none() {
                return Err(Error::PassWithoutSignal { pass: pass.name.to_owned(), signal: pass.signal.name() });
            }
        }
        for (which, camera) in [("camera", &self.camera), ("previous_camera", &self.previous_camera)] {
            if camera.projection(expected).is_none() {
                return Err(Error::Camera { which });
            }
        }
        Ok(())
    }
}

/// An owned [`Pass`].
#[derive(Clone, Debug, PartialEq)]
pub struct PassBuf {
    /// For messages and for the output.
    pub name: String,
    /// The signal whose weights and choices it shares.
    pub signal: Signal,
    /// Scene-linear light, without the signal's weight.
    pub plane: Plane<Rgb>,
}

/// A frame that owns its planes: what the path tracer makes and what files are read into. The fields mean what
/// they mean in [`Frame`].
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "the fields of `Frame`, owned")]
pub struct FrameBuf {
    pub size: Size,
    pub camera: Camera,
    pub previous_camera: Camera,
    pub index: i64,
    pub direct: Option<Plane<Rgb>>,
    pub matte: Option<Plane<Rgb>>,
    pub glossy: Option<Plane<Rgb>>,
    pub direct_matte: Option<Plane<Rgb>>,
    pub direct_glossy: Option<Plane<Rgb>>,
    pub matte_weight: Option<Plane<Rgb>>,
    pub glossy_weight: Option<Plane<Rgb>>,
    pub view_depth: Option<Plane<f32>>,
    pub normal: Option<Plane<[f32; 3]>>,
    pub roughness: Option<Plane<f32>>,
    pub motion: Option<Plane<[f32; 2]>>,
    pub glossy_hit_distance: Option<Plane<f32>>,
    pub matte_hit_distance: Option<Plane<f32>>,
    pub surface_id: Option<Plane<u32>>,
    pub alpha: Option<Plane<f32>>,
    pub matte_variance: Option<Plane<f32>>,
    pub glossy_variance: Option<Plane<f32>>,
    pub confidence_in: Option<Plane<f32>>,
    pub passes: Vec<PassBuf>,
}

impl FrameBuf {
    /// A frame without any plane.
    pub fn new(size: Size, camera: Camera) -> Self {
        Self {
            size,
            camera,
            previous_camera: camera,
            index: 0,
            direct: None,
            matte: None,
            glossy: None,
            direct_matte: None,
            direct_glossy: None,
            matte_weight: None,
            glossy_weight: None,
            view_depth: None,
            normal: None,
            roughness: None,
            motion: None,
            glossy_hit_distance: None,
            matte_hit_distance: None,
            surface_id: None,
            alpha: None,
            matte_variance: None,
            glossy_variance: None,
            confidence_in: None,
            passes: Vec::new(),
        }
    }

    /// Borrows the passes, for [`FrameBuf::frame`].
    pub fn pass_views(&self) -> Vec<Pass<'_>> {
        self.passes.iter().map(|p| Pass { name: &p.name, signal: p.signal, plane: p.plane.view() }).collect()
    }

    /// Borrows everything; `passes` are those of [`FrameBuf::pass_views`] (or `&[]` to leave them out).
    pub fn frame<'a>(&'a self, passes: &'a [Pass<'a>]) -> Frame<'a> {
        fn view<T: Copy>(plane: &Option<Plane<T>>) -> Option<PlaneRef<'_, T>> {
            plane.as_ref().map(Plane::view)
        }
        Frame {
            size: self.size,
            camera: self.camera,
            previous_camera: self.previous_camera,
            index: self.index,
            direct: view(&self.direct),
            matte: view(&self.matte),
            glossy: view(&self.glossy),
            direct_matte: view(&self.direct_matte),
            direct_glossy: view(&self.direct_glossy),
            matte_weight: view(&self.matte_weight),
            glossy_weight: view(&self.glossy_weight),
            view_depth: view(&self.view_depth),
            normal: view(&self.normal),
            roughness: view(&self.roughness),
            motion: view(&self.motion),
            glossy_hit_distance: view(&self.glossy_hit_distance),
            matte_hit_distance: view(&self.matte_hit_distance),
            surface_id: view(&self.surface_id),
            alpha: view(&self.alpha),
            matte_variance: view(&self.matte_variance),
            glossy_variance: view(&self.glossy_variance),
            confidence_in: view(&self.confidence_in),
            passes,
        }
    }

    /// [`Frame::composite`] of this frame.
    pub fn composite(&self) -> Plane<Rgb> {
        self.frame(&[]).composite()
    }
}
