//! Converged references: two independent halves, traced in batches, kept in the cache, continued where they stopped.

use crate::cache::{Accumulation, Cache, ReferenceKey};
use crate::error::Error;
use crate::metrics::error::{EPSILON_PART, TRIMMED_PART};
use crate::tone::luminance;
use crate::tracer::TraceOn;
use quell::{Plane, Rgb};
use quell_trace::{Control, Half, RayCounts, Reference, ReferenceKind, RenderOptions, Scene, scene_hash};

/// When a reference is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceTarget {
    /// Samples a pixel of each half, at most. Higher: cleaner and slower. Default 256.
    pub samples: u32,
    /// The reference's own relMSE (trimmed of its worst 0.1 % of pixels) at which tracing stops early; 0: never.
    pub rel_mse: f64,
    /// Samples a pixel between looks at the error and writes to the cache. Default 16.
    pub batch: u32,
    /// How it is estimated.
    pub kind: ReferenceKind,
}

impl Default for ReferenceTarget {
    fn default() -> Self {
        Self { samples: 256, rel_mse: 0.0, batch: 16, kind: ReferenceKind::Factored }
    }
}

/// Which picture.
#[derive(Clone, Copy)]
pub struct ReferenceOf<'s> {
    /// The scene.
    pub scene: &'s Scene,
    /// Camera, from 1.
    pub camera: usize,
    /// Frame number.
    pub frame: i64,
    /// Size, bounces, seed; the number of samples of a frame and its clamp are ignored.
    pub options: &'s RenderOptions,
}

/// Two independent estimates of the same frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferencePair {
    /// The first half of the samples.
    pub a: Reference,
    /// The second half.
    pub b: Reference,
}

impl ReferencePair {
    /// Both halves together.
    ///
    /// # Errors
    /// [`Error::Trace`] where the halves do not belong together.
    pub fn mean(&self) -> Result<Reference, Error> {
        let mut mean = self.a.clone();
        mean.merge(&self.b)?;
        Ok(mean)
    }

    /// The relMSE of [`ReferencePair::mean`] against the truth, from the difference of the halves: the mean of
    /// ((A - B) / 2)^2 / (R^2 + eps), trimmed of the worst 0.1 % of pixels. eps as in [`crate::metrics::rel_mse`].
    pub fn rel_mse(&self) -> f64 {
        halves_rel_mse(&self.a.beauty, &self.b.beauty)
    }
}

/// As [`ReferencePair::rel_mse`], of two pictures.
pub fn halves_rel_mse(a: &Plane<Rgb>, b: &Plane<Rgb>) -> f64 {
    let (a, b) = (a.data(), b.data());
    let pixels = a.len().max(1);
    let mean = |p: &Rgb, q: &Rgb| -> Rgb { std::array::from_fn(|c| 0.5 * (p[c] + q[c])) };
    let total: f64 = a.iter().zip(b).map(|(p, q)| f64::from(luminance(mean(p, q)))).sum();
    let epsilon = (EPSILON_PART * (total / pixels as f64).powi(2)).max(f64::MIN_POSITIVE);
    let mut errors: Vec<f64> = a
        .iter()
        .zip(b)
        .map(|(p, q)| {
            let r = mean(p, q);
            let term = |c: usize| {
                let half = 0.5 * f64::from(p[c] - q[c]);
                half * half / (f64::from(r[c]).powi(2) + epsilon)
            };
            (term(0) + term(1) + term(2)) / 3.0
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let kept = errors.len() - ((errors.len() as f64 * TRIMMED_PART).ceil() as usize).min(pixels - 1);
    errors[..kept].iter().sum::<f64>() / kept.max(1) as f64
}

/// How far a reference has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceProgress {
    /// Samples a pixel of each half so far.
    pub samples: u32,
    /// The largest number that may be traced.
    pub of: u32,
    /// Its own relMSE so far; `None` before the first batch of both halves.
    pub rel_mse: Option<f64>,
    /// Samples a pixel that came from the cache.
    pub cached: u32,
}

/// Traces the reference of one frame, or continues it from the cache, until the target is reached. After each batch
/// both halves are stored and `progress` is called; a stop through `control` keeps every whole batch.
///
/// # Errors
/// [`Error::Trace`] ([`quell_trace::TraceError::Cancelled`] after a stop), [`Error::Cache`], I/O errors of the cache.
pub fn converge(
    cache: Option<&Cache>,
    what: &ReferenceOf<'_>,
    target: &ReferenceTarget,
    control: &Control<'_>,
    progress: impl FnMut(&ReferenceProgress),
) -> Result<ReferencePair, Error> {
    converge_on(&TraceOn::Cpu, cache, what, target, control, progress)
}

/// The same on any tracer. Each has references of its own in the cache.
///
/// # Errors
/// Those of [`converge`]; what a device reports.
pub fn converge_on(
    on: &TraceOn,
    cache: Option<&Cache>,
    what: &ReferenceOf<'_>,
    target: &ReferenceTarget,
    control: &Control<'_>,
    mut progress: impl FnMut(&ReferenceProgress),
) -> Result<ReferencePair, Error> {
    let &ReferenceOf { scene, camera, frame, options } = what;
    let scene_hash = scene_hash(scene, options);
    let suffix = match target.kind {
        ReferenceKind::Factored => "",
        ReferenceKind::FullIntegral => "-full",
    };
    let keys = ["a", "b"].map(|half| ReferenceKey {
        scene_hash: scene_hash.clone(),
        camera,
        frame,
        part: format!("{half}{suffix}{}", on.key_suffix()),
    });
    let mut halves: [Option<Reference>; 2] = [None, None];
    if let Some(cache) = cache {
        for (half, key) in halves.iter_mut().zip(&keys) {
            *half = cache.load(key)?.and_then(|found| reference_from(found, target.kind));
        }
    }
    let samples = |half: &Option<Reference>| half.as_ref().map_or(0, |r| u32::try_from(r.samples).unwrap_or(u32::MAX));
    let cached = halves.iter().map(samples).min().unwrap_or(0);
    let limit = target.samples.max(1);
    let batch = target.batch.max(1);
    let mut tracer = None;
    loop {
        let done = halves.iter().map(samples).min().unwrap_or(0);
        if let [Some(a), Some(b)] = &halves {
            let pair = ReferencePair { a: a.clone(), b: b.clone() };
            let rel_mse = pair.rel_mse();
            progress(&ReferenceProgress { samples: done, of: limit, rel_mse: Some(rel_mse), cached });
            if done >= limit || (target.rel_mse > 0.0 && rel_mse <= target.rel_mse) {
                return Ok(pair);
            }
        } else {
            progress(&ReferenceProgress { samples: done, of: limit, rel_mse: None, cached });
        }
        let until = done.saturating_add(batch).min(limit);
        for ((half, key), name) in halves.iter_mut().zip(&keys).zip([Half::A, Half::B]) {
            let from = samples(half);
            // After an interrupt one half may be a batch ahead.
            if from >= until {
                continue;
            }
            let tracer = match &mut tracer {
                Some(tracer) => tracer,
                none => none.insert(on.tracer(scene, frame, camera)?),
            };
            let more = tracer.reference(options, target.kind, name, from..until, control)?;
            match half {
                Some(reference) => reference.merge(&more)?,
                None => *half = Some(more),
            }
            if let (Some(cache), Some(reference)) = (cache, &half) {
                cache.store(key, &accumulation_of(reference))?;
            }
        }
    }
}

const PLANES: [&str; 5] = ["beauty", "direct", "matte", "glossy", "variance"];

fn accumulation_of(reference: &Reference) -> Accumulation {
    let planes = [&reference.beauty, &reference.direct, &reference.matte, &reference.glossy, &reference.variance]
        .map(Clone::clone);
    Accumulation {
        size: reference.size,
        samples: reference.samples,
        counts: [("rays.closest", reference.rays.closest), ("rays.shadow", reference.rays.shadow)]
            .map(|(name, count)| (name.to_owned(), count))
            .into(),
        planes: PLANES.map(str::to_owned).into_iter().zip(planes).collect(),
    }
}

/// `None` where a plane is missing: then it is traced anew.
fn reference_from(mut found: Accumulation, kind: ReferenceKind) -> Option<Reference> {
    let mut plane = |name: &str| -> Option<Plane<Rgb>> { found.planes.remove(name) };
    let [beauty, direct, matte, glossy, variance] = PLANES.map(&mut plane);
    let count = |name: &str| found.counts.get(name).copied().unwrap_or(0);
    Some(Reference {
        size: found.size,
        kind,
        samples: found.samples,
        beauty: beauty?,
        direct: direct?,
        matte: matte?,
        glossy: glossy?,
        variance: variance?,
        rays: RayCounts { closest: count("rays.closest"), shadow: count("rays.shadow") },
    })
}
