//! [`Tracer`]: one frame of a scene, rendered to the planes that the denoiser reads, or to a reference.
//!
//! ```text
//! options.rs     how a frame is traced
//! frame.rs       its planes
//! unfiltered.rs  the direct term
//! reference.rs   converged pictures
//! moments.rs     means and variances
//! pixels.rs      the loop over pixels
//! ```

mod frame;
mod moments;
mod options;
mod pixels;
mod reference;
mod unfiltered;

pub use frame::{HalfSignals, Rendered};
pub use options::{Control, Estimator, RenderOptions, TraceError};
pub use reference::{Half, Reference, ReferenceKind};
#[cfg(feature = "gpu")]
pub(crate) use {frame::SECOND_HALF_SEED, reference::REFERENCE_DIRECT_SAMPLES};

use crate::hash::Hash;
use crate::integrator::Integrator;
use crate::material::MIRROR_ROUGHNESS;
use crate::primary::{PrimaryReplacement, Views, may_mirror};
use crate::scene::{Scene, SceneError};
use crate::sources::Sources;
use crate::world::World;
use glam::Vec2;
use quell::{Camera, Size};

/// Changes whenever the tracer's pictures change: part of the key of every cached reference.
pub const TRACER_VERSION: u32 = 4;

/// Largest extent of an image.
pub const SIZE_LIMIT: usize = 32768;

/// Hash of everything that a reference depends on, but for frame, camera, half and number of samples: the scene's
/// content, the tracer and the options. In hexadecimal.
pub fn scene_hash(scene: &Scene, options: &RenderOptions) -> String {
    let mut hash = Hash::new();
    hash.text(&scene.name);
    hash.number(scene.identity);
    hash.number(u64::from(TRACER_VERSION));
    hash.number(options.size.width as u64);
    hash.number(options.size.height as u64);
    hash.number(u64::from(options.bounces));
    hash.number(options.seed);
    hash.number(u64::from(options.estimator == Estimator::Paper));
    // 1 were references from the place of their frame's samples alone.
    hash.number(2 * u64::from(options.jitter));
    hash.number(u64::from(options.direct_samples));
    hash.number(u64::from(options.indirect_clamp.to_bits()));
    hash.number(u64::from(options.model.fresnel_strength.to_bits()));
    hash.number(u64::from(options.model.fresnel_rough_damping));
    let replacement = match options.primary_replacement {
        PrimaryReplacement::GlassAndMirrors if !may_mirror(scene) => PrimaryReplacement::Glass,
        replacement => replacement,
    };
    hash.number(replacement as u64);
    format!("{:016x}", hash.finish())
}

/// One frame of a scene seen by one camera, ready to be traced.
pub struct Tracer<'s> {
    scene: &'s Scene,
    pub(crate) world: World<'s>,
    pub(crate) sources: Sources,
    frame: i64,
    camera: usize,
}

impl<'s> Tracer<'s> {
    /// Prepares frame `frame` of a scene seen by camera number `camera` (from 1): evaluates the animation at this
    /// frame and at the one before, builds the BVH and the lists of lights.
    ///
    /// # Errors
    /// A camera that does not exist or cannot be used; indices that name nothing; values that are not finite.
    pub fn new(scene: &'s Scene, frame: i64, camera: usize) -> Result<Self, SceneError> {
        Self::of_world(scene, World::new(scene, frame)?, frame, camera)
    }

    /// The same for any times: the scene as it is at `now`, counted in frames, which stood at `before` in the frame that was
    /// shown before. Equal times: nothing moves. For hosts that play, stop and slow down time themselves.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn between(scene: &'s Scene, before: f64, now: f64, camera: usize) -> Result<Self, SceneError> {
        Self::of_world(scene, World::between(scene, before, now)?, now.floor() as i64, camera)
    }

    fn of_world(scene: &'s Scene, world: World<'s>, frame: i64, camera: usize) -> Result<Self, SceneError> {
        let sources = Sources::new(&world, scene);
        let tracer = Self { scene, world, sources, frame, camera };
        tracer.views(Size::new(1, 1), false)?;
        Ok(tracer)
    }

    /// The frame's number.
    pub fn frame(&self) -> i64 {
        self.frame
    }

    /// Number of triangles in the world.
    pub fn triangles(&self) -> usize {
        self.world.geometry.len()
    }

    /// Number of triangles that emit, and of lights without extent.
    pub fn lights(&self) -> usize {
        self.world.emissive.len() + self.world.lights.len()
    }

    pub(crate) fn views(&self, size: Size, jitter: bool) -> Result<Views, SceneError> {
        if size.width == 0 || size.height == 0 || size.width > SIZE_LIMIT || size.height > SIZE_LIMIT {
            return Err(SceneError::Size { size, limit: SIZE_LIMIT });
        }
        let Some(path) = self.camera.checked_sub(1).and_then(|i| self.scene.cameras.get(i)) else {
            return Err(SceneError::UnknownCamera {
                scene: self.scene.name.clone(),
                number: self.camera,
                count: self.scene.cameras.len(),
            });
        };
        let at = |frame: i64| {
            let unusable = || SceneError::Camera { scene: self.scene.name.clone(), number: self.camera, frame };
            let mut camera = path.at(frame as f64, size).ok_or_else(unusable)?;
            if jitter {
                camera.jitter = jitter_of(frame);
            }
            let projection = camera.projection(size).ok_or_else(unusable)?;
            Ok((camera, projection))
        };
        let (camera, now) = at(self.frame)?;
        let (previous_camera, before) = at(self.frame - 1)?;
        Ok(Views { camera, previous_camera, now, before })
    }

    /// The frame's camera and the one of the frame before, for an image of `size`.
    ///
    /// # Errors
    /// A size or a camera that cannot be used.
    pub fn cameras(&self, size: Size, jitter: bool) -> Result<(Camera, Camera), SceneError> {
        self.views(size, jitter).map(|v| (v.camera, v.previous_camera))
    }

    fn integrator(&self, options: &RenderOptions) -> Integrator<'_, 's> {
        Integrator {
            exact: options.estimator == Estimator::Exact,
            world: &self.world,
            sources: &self.sources,
            model: options.model,
            bounces: options.bounces,
            replacement: options.primary_replacement,
        }
    }

    /// Triangles without area, which are left out. No picture shows them: loaders tell of those in files.
    pub fn degenerate_triangles(&self) -> usize {
        self.world.degenerate_triangles
    }

    /// What the frame does not model.
    pub(crate) fn notes(&self, replacement: PrimaryReplacement) -> Vec<String> {
        let mut notes = Vec::new();
        if self.sources.is_empty() {
            notes.push("the scene has no light: the picture is black".to_owned());
        }
        let transmits = |smooth: bool| {
            self.scene.surfaces.iter().any(|s| {
                let m = &s.material;
                let looked_through = m.roughness < MIRROR_ROUGHNESS && m.transmission >= 1.0;
                m.is_transmissive() && smooth == (looked_through && replacement != PrimaryReplacement::Off)
            })
        };
        if transmits(true) {
            notes.push(
                "behind smooth glass the guides are those of the surface seen through it: the glossy signal carries the \
                 glass's own reflection, and the far surface's glossy lobe is traced into the direct term, not denoised"
                    .to_owned(),
            );
        }
        if transmits(false) {
            notes.push(
                "light through rough or partly transmitting surfaces is traced into the direct term and not denoised"
                    .to_owned(),
            );
        }
        notes
    }

    /// Where a pixel's sample lies in this frame.
    fn sample_position(views: &Views, x: usize, y: usize) -> Vec2 {
        Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + Vec2::from(views.camera.jitter)
    }
}

/// Where the samples of a frame lie within their pixels: Halton's sequence in bases 2 and 3 around the centre, in pixels.
pub fn jitter_of(frame: i64) -> [f32; 2] {
    /// Frames after which the positions repeat.
    const PERIOD: i64 = 16;
    let index = frame.rem_euclid(PERIOD) as u32 + 1;
    let radical_inverse = |base: u32| {
        let (mut n, mut value, mut digit) = (index, 0.0, 1.0 / base as f32);
        while n > 0 {
            value += (n % base) as f32 * digit;
            n /= base;
            digit /= base as f32;
        }
        value
    };
    [radical_inverse(2) - 0.5, radical_inverse(3) - 0.5]
}
