//! Converged pictures.

use super::frame::signals;
use super::moments::Moments64;
use super::pixels::for_each_pixel;
use super::{Control, RenderOptions, TraceError, Tracer};
use crate::integrator::{Domain, Integrator, RayCounts};
use crate::primary::{Guides, Views};
use crate::sampler::Sampler;
use glam::{Vec2, Vec3};
use quell::{Plane, Rgb, Size};
use std::ops::Range;

/// Shadow rays of the direct term for each sample of a reference.
pub(crate) const REFERENCE_DIRECT_SAMPLES: u32 = 2;

/// Which of the two independent halves of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// The first.
    A,
    /// The second.
    B,
}

impl Half {
    /// What is mixed into the caller's seed: neither half may share a sample with the noisy frame, whose seed it is.
    pub(crate) fn seed(self) -> u64 {
        match self {
            Self::A => 0xa5a5_5a5a_1357_9bdf,
            Self::B => 0x5a5a_a5a5_fdb9_7531,
        }
    }
}

/// How a reference is estimated. Both converge to the same picture where the estimator is exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceKind {
    /// The estimators of the frame itself, many times: delivers `direct`, M and G, and the least noise for its time.
    Factored,
    /// Ordinary path tracing of the full integral, which shares no split with the frame: `beauty` only.
    FullIntegral,
}

/// A converged picture, or a part of the samples of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Extent.
    pub size: Size,
    /// How it was estimated.
    pub kind: ReferenceKind,
    /// Samples a pixel so far.
    pub samples: u64,
    /// Mean of the whole picture, linear RGB.
    pub beauty: Plane<Rgb>,
    /// Mean of the direct term; zeros for the full integral.
    pub direct: Plane<Rgb>,
    /// Mean of M; zeros for the full integral. With jitter, as of `glossy`, over all that a pixel shows: times the weights of a frame they do
    /// not make `beauty`.
    pub matte: Plane<Rgb>,
    /// Mean of G; zeros for the full integral.
    pub glossy: Plane<Rgb>,
    /// Variance of the mean of `beauty`, per channel, estimated as if samples were independent; 0 below 2 samples.
    pub variance: Plane<Rgb>,
    /// Rays shot.
    pub rays: RayCounts,
}

impl Reference {
    /// Adds further samples of the same frame: other sample ranges, or the other half.
    ///
    /// # Errors
    /// [`TraceError::Merge`] where extents or kinds differ.
    pub fn merge(&mut self, other: &Self) -> Result<(), TraceError> {
        if self.size != other.size || self.kind != other.kind {
            return Err(TraceError::Merge { a: self.size, b: other.size });
        }
        let (n, m) = (self.samples as f64, other.samples as f64);
        let total = n + m;
        if total == 0.0 {
            return Ok(());
        }
        // Chan et al.: sums of squared deviations add up with a term for the distance of the means.
        for (i, variance) in self.variance.data_mut().iter_mut().enumerate() {
            for c in 0..3 {
                let delta = f64::from(other.beauty.data()[i][c]) - f64::from(self.beauty.data()[i][c]);
                let own = f64::from(variance[c]) * n * (n - 1.0).max(0.0);
                let others = f64::from(other.variance.data()[i][c]) * m * (m - 1.0).max(0.0);
                let squares = own + others + delta * delta * n * m / total;
                variance[c] = if total > 1.0 { (squares / (total * (total - 1.0))) as f32 } else { 0.0 };
            }
        }
        for (own, others) in [
            (&mut self.beauty, &other.beauty),
            (&mut self.direct, &other.direct),
            (&mut self.matte, &other.matte),
            (&mut self.glossy, &other.glossy),
        ] {
            for (a, b) in own.data_mut().iter_mut().zip(others.data()) {
                for c in 0..3 {
                    a[c] = ((f64::from(a[c]) * n + f64::from(b[c]) * m) / total) as f32;
                }
            }
        }
        self.samples += other.samples;
        self.rays.add(other.rays);
        Ok(())
    }
}

impl Tracer<'_> {
    /// Traces samples `samples` (a range, so that a reference can be continued) of one half of a reference, from the
    /// same positions as [`Tracer::render`]; with `options.jitter` from all over each pixel, so that the picture is the mean over its area, which
    /// anti-aliasing over time tends to. `options.samples` and `options.indirect_clamp` are ignored.
    ///
    /// # Errors
    /// A size or camera that cannot be used; [`TraceError::Cancelled`].
    pub fn reference(
        &self,
        options: &RenderOptions,
        kind: ReferenceKind,
        half: Half,
        samples: Range<u32>,
        control: &Control<'_>,
    ) -> Result<Reference, TraceError> {
        let views = self.views(options.size, options.jitter)?;
        let integrator = self.integrator(options);
        let size = options.size;
        let black = Plane::filled(size, [0.0; 3]);
        let mut reference = Reference {
            size,
            kind,
            samples: u64::from(samples.end.saturating_sub(samples.start)),
            beauty: black.clone(),
            direct: black.clone(),
            matte: black.clone(),
            glossy: black.clone(),
            variance: black,
            rays: RayCounts::default(),
        };
        let seed = options.seed ^ half.seed();
        let rays = for_each_pixel(
            size,
            control,
            |x, y, rays| self.reference_pixel(&integrator, &views, options, kind, seed, samples.clone(), x, y, rays),
            |x, y, (beauty, direct, matte, glossy, variance): (Vec3, Vec3, Vec3, Vec3, Vec3)| {
                reference.beauty.set(x, y, beauty.to_array());
                reference.direct.set(x, y, direct.to_array());
                reference.matte.set(x, y, matte.to_array());
                reference.glossy.set(x, y, glossy.to_array());
                reference.variance.set(x, y, variance.to_array());
            },
        )?;
        reference.rays = rays;
        Ok(reference)
    }

    /// Where a sample lies in the picture, anywhere in its pixel.
    fn area_position((x, y): (usize, usize), sampler: &Sampler) -> Vec2 {
        Vec2::new(x as f32, y as f32) + sampler.fork(Domain::Pixel as u32).next_2d()
    }

    #[expect(clippy::too_many_arguments, reason = "called from one place")]
    fn reference_pixel(
        &self,
        integrator: &Integrator<'_, '_>,
        views: &Views,
        options: &RenderOptions,
        kind: ReferenceKind,
        seed: u64,
        samples: Range<u32>,
        x: usize,
        y: usize,
        rays: &mut RayCounts,
    ) -> (Vec3, Vec3, Vec3, Vec3, Vec3) {
        let pixel = (x as u32, y as u32);
        let mut beauty = Moments64::default();
        let mut parts = [Moments64::default(); 3];
        match kind {
            ReferenceKind::FullIntegral => {
                for sample in samples {
                    let sampler = Sampler::new(pixel, self.frame, sample, seed);
                    let position = if options.jitter {
                        Self::area_position((x, y), &sampler)
                    } else {
                        Self::sample_position(views, x, y)
                    };
                    let (origin, direction, cone) = integrator.eye_ray(views, position);
                    let mut sampler = sampler.fork(Domain::Full as u32);
                    beauty.push(integrator.full(origin, direction, cone, &mut sampler, rays));
                }
            }
            ReferenceKind::Factored => {
                // Without jitter all samples see the same surface.
                let shared =
                    (!options.jitter).then(|| integrator.primary(views, Self::sample_position(views, x, y), rays));
                // One pass of the direct term serves several paths: it has less noise.
                let direct_samples = options.direct_samples.min(REFERENCE_DIRECT_SAMPLES);
                for sample in samples {
                    let sampler = Sampler::new(pixel, self.frame, sample, seed);
                    let own;
                    let primary = match &shared {
                        Some(primary) => primary,
                        None => {
                            own = integrator.primary(views, Self::area_position((x, y), &sampler), rays);
                            &own
                        }
                    };
                    let direct = self.unfiltered(integrator, primary, direct_samples, sample, &sampler, rays);
                    let (m, g) = match &primary.surface {
                        None => (Vec3::ZERO, Vec3::ZERO),
                        Some(surface) => {
                            let (m, g) = signals(integrator, primary, surface, &sampler, rays);
                            (m.radiance, g.radiance)
                        }
                    };
                    let Guides { matte_weight, glossy_weight, .. } = primary.guides;
                    beauty.push(direct + matte_weight * m + glossy_weight * g);
                    for (moments, value) in parts.iter_mut().zip([direct, m, g]) {
                        moments.push(value);
                    }
                }
            }
        }
        let [direct, matte, glossy] = parts.map(|p| p.mean());
        (beauty.mean(), direct, matte, glossy, beauty.variance_of_mean())
    }
}
