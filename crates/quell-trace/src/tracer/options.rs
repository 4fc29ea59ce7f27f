//! How a frame is traced, how a caller watches it, and why there may be none.

use crate::material::MaterialModel;
use crate::primary::PrimaryReplacement;
use crate::scene::SceneError;
use quell::Size;
use std::sync::atomic::AtomicBool;

/// What the composite of one frame converges to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Each sample carries the ratio of its own factor to the weight's, so the composite converges to the reference.
    #[default]
    Exact,
    /// As published: factors are taken at the mirror direction, samples carry none.
    Paper,
}

/// How a frame is traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Extent of the image.
    pub size: Size,
    /// Samples a pixel; each is one matte and one glossy path. At least 1.
    pub samples: u32,
    /// Scatterings of a path after the primary surface: light that is scattered at most `bounces` + 1 times in all.
    pub bounces: u32,
    /// Frames with different seeds have independent noise.
    pub seed: u64,
    /// What the composite converges to.
    pub estimator: Estimator,
    /// Stratified shadow rays a pixel of the direct term.
    pub direct_samples: u32,
    /// Moves the sample positions of whole frames within the pixel, for temporal anti-aliasing. References are then means over the pixel's
    /// area.
    pub jitter: bool,
    /// Largest luminance of a matte or glossy sample; more is scaled down, which loses energy. 0: off.
    pub indirect_clamp: f32,
    /// Switches of the material model.
    pub model: MaterialModel,
    /// Which surfaces the eye looks through before guides are taken.
    pub primary_replacement: PrimaryReplacement,
    /// Whether the variance of the pixel's mean is estimated for both signals (needs `samples` >= 2).
    pub variances: bool,
    /// Whether the samples are taken as two independent halves, delivered beside the frame (needs `samples` >= 2):
    /// even samples make A, odd ones B. Stratification then holds within each half only.
    pub halves: bool,
}

impl RenderOptions {
    /// Defaults for an image of `size`: one sample, 3 bounces, exact, no clamp.
    pub fn new(size: Size) -> Self {
        Self {
            size,
            samples: 1,
            bounces: 3,
            seed: 0,
            estimator: Estimator::Exact,
            direct_samples: 64,
            jitter: false,
            indirect_clamp: 0.0,
            model: MaterialModel::default(),
            primary_replacement: PrimaryReplacement::default(),
            variances: false,
            halves: false,
        }
    }
}

impl RenderOptions {
    /// Whether two halves are delivered.
    pub(crate) fn separate_halves(&self) -> bool {
        self.halves && self.samples > 1
    }
}

/// How a caller watches and stops a rendering.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Rendering stops soon after this turns true.
    pub cancel: Option<&'a AtomicBool>,
    /// Called with the share done, 0..1, from time to time.
    pub progress: Option<&'a (dyn Fn(f32) + Sync)>,
}

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TraceError {
    /// The scene, the camera or the size cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The caller asked to stop.
    #[error("rendering was cancelled")]
    Cancelled,
    /// References that cannot be added up.
    #[error("references of {a} and {b} cannot be merged")]
    Merge {
        /// Extent of one.
        a: Size,
        /// Extent of the other.
        b: Size,
    },
}
