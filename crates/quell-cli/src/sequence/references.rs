//! Converged frames: traced in two halves and kept in the cache, or given.

use super::files::composite_of;
use crate::failure::Failure;
use quell::{Plane, Rgb};
use quell_lab::cache::Cache;
use quell_lab::references::{ReferenceOf, ReferencePair, ReferenceTarget, converge_on};
use quell_lab::tracer::TraceOn;
use quell_trace::{Control, Reference, RenderOptions, Scene, TraceError};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Where references come from.
pub enum ReferenceSource {
    /// There are none.
    None,
    /// They are traced.
    Trace {
        target: ReferenceTarget,
        /// Of these frames only; `None`: of all.
        frames: Option<Vec<i64>>,
        /// Where what is gathered stays.
        cache: Option<Cache>,
    },
    /// They lie in files, by frame.
    Given(BTreeMap<i64, PathBuf>),
}

/// A reference of one frame.
pub enum ReferencePicture {
    Traced(Box<Halves>),
    Given(Plane<Rgb>),
}

/// Two independent estimates and their mean.
pub struct Halves {
    pub pair: ReferencePair,
    pub mean: Reference,
}

impl ReferenceSource {
    /// Samples a pixel that will be traced for a frame at most, both halves together.
    pub fn samples_of(&self, frame: i64) -> u32 {
        match self {
            Self::Trace { target, frames, .. } if frames.as_ref().is_none_or(|f| f.contains(&frame)) => {
                target.samples.saturating_mul(2)
            }
            _ => 0,
        }
    }

    /// Whether a frame will have a reference.
    pub fn has(&self, frame: i64) -> bool {
        match self {
            Self::Given(files) => files.contains_key(&frame),
            _ => self.samples_of(frame) > 0,
        }
    }

    /// The reference of a frame; `None` where there shall be none. `notify` hears the share done, 0..1.
    pub fn of(
        &self,
        on: &TraceOn,
        scene: &Scene,
        options: &RenderOptions,
        camera: usize,
        frame: i64,
        notify: &dyn Fn(f32),
    ) -> Result<Option<ReferencePicture>, Failure> {
        match self {
            Self::Given(files) => match files.get(&frame) {
                Some(path) => Ok(Some(ReferencePicture::Given(composite_of(path)?))),
                None => Ok(None),
            },
            Self::Trace { target, cache, .. } if self.has(frame) => {
                let what = ReferenceOf { scene, camera, frame, options };
                let control = Control { cancel: Some(crate::interrupt::flag()), progress: None };
                let pair = converge_on(on, cache.as_ref(), &what, target, &control, |progress| {
                    notify(progress.samples as f32 / progress.of.max(1) as f32);
                });
                let pair = pair.map_err(|e| match e {
                    quell_lab::Error::Trace(TraceError::Cancelled) if cache.is_some() => {
                        Failure::Interrupted("the samples gathered so far are kept in the cache".to_owned())
                    }
                    quell_lab::Error::Trace(error) => error.into(),
                    error => error.into(),
                })?;
                let mean = pair.mean()?;
                Ok(Some(ReferencePicture::Traced(Box::new(Halves { pair, mean }))))
            }
            _ => Ok(None),
        }
    }
}

impl ReferencePicture {
    /// The whole picture.
    pub fn into_beauty(self) -> Plane<Rgb> {
        match self {
            Self::Traced(halves) => halves.mean.beauty,
            Self::Given(plane) => plane,
        }
    }

    /// The reference's own error, as trimmed relMSE; `None` where there are no halves.
    pub fn own_error(&self) -> Option<f64> {
        match self {
            Self::Traced(halves) => Some(halves.pair.rel_mse()),
            Self::Given(_) => None,
        }
    }
}
