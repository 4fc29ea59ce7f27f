//! A frame's planes: what one pixel holds, and one matte and one glossy path a sample.

use super::moments::Moments;
use super::pixels::for_each_pixel;
use super::{Control, RenderOptions, TraceError, Tracer};
use crate::integrator::{Incoming, Integrator, RayCounts};
use crate::primary::{Guides, Primary, Vertex, Views};
use crate::sampler::Sampler;
use glam::Vec3;
use quell::{FrameBuf, Plane, Rgb};

/// Makes the seed of a frame's half B differ from that of its half A.
pub(crate) const SECOND_HALF_SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// A traced frame and what happened on the way.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// What the denoiser reads.
    pub frame: FrameBuf,
    /// Rays shot.
    pub rays: RayCounts,
    /// Two independent halves of the signals, where [`RenderOptions::halves`] asked for them: A, then B. The frame's
    /// own signals are their mean, weighted by their numbers of samples.
    pub halves: Option<[HalfSignals; 2]>,
    /// What the picture does not model or does not hand to the denoiser, in sentences.
    pub notes: Vec<String>,
}

/// Both signals from one half of a frame's samples, without their weights.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfSignals {
    /// Indirect light of the matte lobe.
    pub matte: Plane<Rgb>,
    /// Indirect light of the glossy lobe.
    pub glossy: Plane<Rgb>,
}

/// What one pixel of a frame holds.
#[derive(Clone, Copy)]
struct PixelValue {
    direct: Vec3,
    matte: Vec3,
    glossy: Vec3,
    guides: Guides,
    matte_distance: f32,
    glossy_distance: f32,
    matte_variance: f32,
    glossy_variance: f32,
    /// Matte and glossy of halves A and B.
    halves: [(Vec3, Vec3); 2],
}

fn luminance(c: Vec3) -> f32 {
    quell::luminance(c.to_array())
}

/// Scales a sample down to the largest luminance allowed.
fn capped(radiance: Vec3, limit: f32) -> Vec3 {
    let l = luminance(radiance);
    if limit > 0.0 && l > limit { radiance * (limit / l) } else { radiance }
}

impl Tracer<'_> {
    /// Traces the frame.
    ///
    /// # Errors
    /// A size or camera that cannot be used; [`TraceError::Cancelled`].
    pub fn render(&self, options: &RenderOptions, control: &Control<'_>) -> Result<Rendered, TraceError> {
        let views = self.views(options.size, options.jitter)?;
        let integrator = self.integrator(options);
        let size = options.size;
        let mut frame = FrameBuf::new(size, views.camera);
        frame.previous_camera = views.previous_camera;
        frame.index = self.frame;
        let variances = options.variances && options.samples > 1;

        let mut direct = Plane::filled(size, [0.0; 3]);
        let mut matte = direct.clone();
        let mut glossy = direct.clone();
        let mut matte_weight = direct.clone();
        let mut glossy_weight = direct.clone();
        let mut normal = direct.clone();
        let mut view_depth = Plane::filled(size, 0.0);
        let mut roughness = view_depth.clone();
        let mut glossy_hit_distance = view_depth.clone();
        let mut matte_hit_distance = view_depth.clone();
        let mut matte_variance = view_depth.clone();
        let mut glossy_variance = view_depth.clone();
        let mut motion = Plane::filled(size, [0.0; 2]);
        let mut surface_id = Plane::filled(size, 0);
        let mut halves = options.separate_halves().then(|| {
            [0, 1].map(|_| HalfSignals { matte: Plane::filled(size, [0.0; 3]), glossy: Plane::filled(size, [0.0; 3]) })
        });
        let rays = for_each_pixel(
            size,
            control,
            |x, y, rays| self.pixel(&integrator, &views, options, x, y, rays),
            |x, y, v: PixelValue| {
                let g = &v.guides;
                direct.set(x, y, v.direct.to_array());
                matte.set(x, y, v.matte.to_array());
                glossy.set(x, y, v.glossy.to_array());
                matte_weight.set(x, y, g.matte_weight.to_array());
                glossy_weight.set(x, y, g.glossy_weight.to_array());
                normal.set(x, y, g.normal.to_array());
                view_depth.set(x, y, g.view_depth);
                roughness.set(x, y, g.roughness);
                motion.set(x, y, g.motion.to_array());
                surface_id.set(x, y, g.surface_id);
                matte_hit_distance.set(x, y, v.matte_distance);
                glossy_hit_distance.set(x, y, v.glossy_distance);
                matte_variance.set(x, y, v.matte_variance);
                glossy_variance.set(x, y, v.glossy_variance);
                if let Some(halves) = &mut halves {
                    for (half, (m, g)) in halves.iter_mut().zip(v.halves) {
                        half.matte.set(x, y, m.to_array());
                        half.glossy.set(x, y, g.to_array());
                    }
                }
            },
        )?;
        frame.direct = Some(direct);
        frame.matte = Some(matte);
        frame.glossy = Some(glossy);
        frame.matte_weight = Some(matte_weight);
        frame.glossy_weight = Some(glossy_weight);
        frame.normal = Some(normal);
        frame.view_depth = Some(view_depth);
        frame.roughness = Some(roughness);
        frame.motion = Some(motion);
        frame.surface_id = Some(surface_id);
        frame.matte_hit_distance = Some(matte_hit_distance);
        frame.glossy_hit_distance = Some(glossy_hit_distance);
        if variances {
            frame.matte_variance = Some(matte_variance);
            frame.glossy_variance = Some(glossy_variance);
        }
        Ok(Rendered { frame, rays, halves, notes: self.notes(options.primary_replacement) })
    }

    fn pixel(
        &self,
        integrator: &Integrator<'_, '_>,
        views: &Views,
        options: &RenderOptions,
        x: usize,
        y: usize,
        rays: &mut RayCounts,
    ) -> PixelValue {
        let primary = integrator.primary(views, Self::sample_position(views, x, y), rays);
        let pixel = (x as u32, y as u32);
        let mut matte = Moments::default();
        let mut glossy = Moments::default();
        let (mut matte_luminance, mut glossy_luminance) = (Moments::default(), Moments::default());
        let mut distances = (f32::INFINITY, f32::INFINITY);
        let separate = options.separate_halves();
        let mut halves = [(Moments::default(), Moments::default()); 2];
        if let Some(surface) = &primary.surface {
            for sample in 0..options.samples.max(1) {
                // Halves of one low-discrepancy sequence would complement each other, not be independent.
                let (half, index) = if separate { (sample % 2, sample / 2) } else { (0, sample) };
                let seed = if half == 1 { options.seed ^ SECOND_HALF_SEED } else { options.seed };
                let sampler = Sampler::new(pixel, self.frame, index, seed);
                let (m, g) = signals(integrator, &primary, surface, &sampler, rays);
                if sample == 0 {
                    distances = (m.distance, g.distance);
                }
                let (m, g) = (capped(m.radiance, options.indirect_clamp), capped(g.radiance, options.indirect_clamp));
                matte.push(m);
                glossy.push(g);
                matte_luminance.push(Vec3::splat(luminance(m)));
                glossy_luminance.push(Vec3::splat(luminance(g)));
                if separate {
                    let moments = &mut halves[half as usize];
                    moments.0.push(m);
                    moments.1.push(g);
                }
            }
        }
        let sampler = Sampler::new(pixel, self.frame, 0, options.seed);
        PixelValue {
            direct: self.unfiltered(integrator, &primary, options.direct_samples, 0, &sampler, rays),
            matte: matte.mean,
            glossy: glossy.mean,
            guides: primary.guides,
            matte_distance: distances.0,
            glossy_distance: distances.1,
            matte_variance: matte_luminance.variance_of_mean().x,
            glossy_variance: glossy_luminance.variance_of_mean().x,
            halves: halves.map(|(m, g)| (m.mean, g.mean)),
        }
    }
}

/// One matte and one glossy path of a primary surface.
pub(super) fn signals(
    integrator: &Integrator<'_, '_>,
    primary: &Primary,
    surface: &Vertex,
    sampler: &Sampler,
    rays: &mut RayCounts,
) -> (Incoming, Incoming) {
    let matte = integrator.matte_path(&surface.point, &surface.bsdf, sampler, rays);
    let reflecting = primary.glass.first().unwrap_or(surface);
    let glossy = integrator.glossy_path(&reflecting.point, &reflecting.bsdf, integrator.exact, sampler, rays);
    (matte, glossy)
}
