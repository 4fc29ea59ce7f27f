//! [`Tracer`]: one frame of a scene, rendered to the planes that the denoiser reads, or to a reference.

use crate::hash::Hash;
use crate::integrator::{Domain, Incoming, Integrator, RayCounts};
use crate::material::{MIRROR_ROUGHNESS, MaterialModel};
use crate::primary::{Guides, Primary, PrimaryReplacement, Vertex, Views};
use crate::sampler::Sampler;
use crate::scene::{Scene, SceneError};
use crate::sources::Sources;
use crate::world::World;
use glam::{Vec2, Vec3};
use quell::{Camera, FrameBuf, Plane, Rgb, Size};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// Changes whenever the tracer's pictures change: part of the key of every cached reference.
pub const TRACER_VERSION: u32 = 4;

/// Largest extent of an image.
pub const SIZE_LIMIT: usize = 32768;

/// Makes the seed of a frame's half B differ from that of its half A.
const SECOND_HALF_SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// Rows that are traced before the cancel flag is looked at and progress is reported.
const BAND_ROWS: usize = 16;

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
    /// Moves the sample positions of whole frames within the pixel, for temporal anti-aliasing.
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
    fn separate_halves(&self) -> bool {
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

/// Which of the two independent halves of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// The first.
    A,
    /// The second.
    B,
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
    /// Mean of M; zeros for the full integral.
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
    hash.number(u64::from(options.jitter));
    hash.number(u64::from(options.direct_samples));
    hash.number(u64::from(options.indirect_clamp.to_bits()));
    hash.number(u64::from(options.model.fresnel_strength.to_bits()));
    hash.number(u64::from(options.model.fresnel_rough_damping));
    hash.number(options.primary_replacement as u64);
    format!("{:016x}", hash.finish())
}

/// One frame of a scene seen by one camera, ready to be traced.
pub struct Tracer<'s> {
    scene: &'s Scene,
    world: World<'s>,
    sources: Sources,
    frame: i64,
    camera: usize,
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

/// Mean and variance of the mean of a stream of colours.
#[derive(Clone, Copy, Default)]
struct Moments {
    count: f32,
    mean: Vec3,
    squares: Vec3,
}

impl Moments {
    fn push(&mut self, value: Vec3) {
        self.count += 1.0;
        let delta = value - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (value - self.mean);
    }

    fn variance_of_mean(&self) -> Vec3 {
        if self.count > 1.0 { self.squares / (self.count * (self.count - 1.0)) } else { Vec3::ZERO }
    }
}

impl<'s> Tracer<'s> {
    /// Prepares frame `frame` of a scene seen by camera number `camera` (from 1): evaluates the animation at this
    /// frame and at the one before, builds the BVH and the lists of lights.
    ///
    /// # Errors
    /// A camera that does not exist or cannot be used; indices that name nothing; values that are not finite.
    pub fn new(scene: &'s Scene, frame: i64, camera: usize) -> Result<Self, SceneError> {
        let world = World::new(scene, frame)?;
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

    fn views(&self, size: Size, jitter: bool) -> Result<Views, SceneError> {
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

    /// Traces samples `samples` (a range, so that a reference can be continued) of one half of a reference, from the
    /// same positions as [`Tracer::render`]. `options.samples` and `options.indirect_clamp` are ignored.
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
        // Neither half may share a sample with the noisy frame, whose seed is the caller's own.
        let seed = options.seed ^ if half == Half::A { 0xa5a5_5a5a_1357_9bdf } else { 0x5a5a_a5a5_fdb9_7531 };
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

    /// What the frame does not model.
    fn notes(&self, replacement: PrimaryReplacement) -> Vec<String> {
        let mut notes = Vec::new();
        if self.world.degenerate_triangles > 0 {
            notes.push(format!("{} triangles without area were left out", self.world.degenerate_triangles));
        }
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

    /// What needs no filter: background, emission, direct light, light through a surface that is not looked through;
    /// and behind glass, what the two signals do not carry.
    fn unfiltered(
        &self,
        integrator: &Integrator<'_, '_>,
        primary: &Primary,
        direct_samples: u32,
        pass: u32,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let count = direct_samples.div_ceil(4).max(1);
        let stream = |i: u32| sampler.with_index(pass.wrapping_mul(count).wrapping_add(i));
        let mut light = Vec3::ZERO;
        match &primary.surface {
            None => {
                let (direction, throughput) = primary.escape;
                light += throughput * self.sources.environment(direction);
            }
            Some(Vertex { point, bsdf, throughput }) => {
                let mut own = point.material.emitted(point.front);
                own += integrator.direct(point, bsdf, direct_samples, pass, sampler, rays);
                let mut through = Vec3::ZERO;
                for i in 0..count {
                    if bsdf.is_transmissive() {
                        through += integrator.transmission_path(point, bsdf, &stream(i), rays);
                    }
                    if !primary.glass.is_empty() {
                        // The glossy signal is taken by the glass: this surface's own lobe is traced unfiltered.
                        let sampler = stream(i).fork(Domain::BehindGlass as u32);
                        let path = integrator.glossy_path(point, bsdf, true, &sampler, rays);
                        through += bsdf.glossy_weight() * path.radiance;
                    }
                }
                light += *throughput * (own + through / count as f32);
            }
        }
        for (number, veil) in primary.veils.iter().enumerate() {
            let sampler = sampler.fork(Domain::Veil as u32 + number as u32);
            light += veil.throughput * Self::unsplit(integrator, veil, direct_samples, pass, &sampler, rays);
        }
        for (number, ray) in primary.behind.iter().enumerate() {
            let mut sum = Vec3::ZERO;
            for i in 0..count {
                let mut sampler = stream(i).fork(Domain::BehindVeil as u32 + number as u32);
                sum += integrator.full(ray.origin, ray.direction, ray.cone, &mut sampler, rays);
            }
            light += ray.throughput * sum / count as f32;
        }
        // Reflections of glass that no signal carries: all but the first, or all before a background.
        let carried = usize::from(primary.surface.is_some());
        for (number, vertex) in primary.glass.iter().enumerate().skip(carried) {
            let mut sum = Vec3::ZERO;
            for i in 0..count {
                let sampler = stream(i).fork(Domain::BehindGlass as u32 + 1 + number as u32);
                let path = integrator.glossy_path(&vertex.point, &vertex.bsdf, true, &sampler, rays);
                sum += vertex.bsdf.glossy_weight() * path.radiance;
            }
            light += vertex.throughput * sum / count as f32;
        }
        light
    }

    /// All light that leaves a surface towards the eye, with no signal left for the denoiser.
    fn unsplit(
        integrator: &Integrator<'_, '_>,
        vertex: &Vertex,
        direct_samples: u32,
        pass: u32,
        sampler: &Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let Vertex { point, bsdf, .. } = vertex;
        let count = direct_samples.div_ceil(4).max(1);
        let mut scattered = Vec3::ZERO;
        for i in 0..count {
            let sampler = sampler.with_index(pass.wrapping_mul(count).wrapping_add(i));
            scattered += integrator.transmission_path(point, bsdf, &sampler, rays);
            scattered += integrator.matte_weight(bsdf) * integrator.matte_path(point, bsdf, &sampler, rays).radiance;
            scattered += bsdf.glossy_weight() * integrator.glossy_path(point, bsdf, true, &sampler, rays).radiance;
        }
        point.material.emitted(point.front)
            + integrator.direct(point, bsdf, direct_samples, pass, sampler, rays)
            + scattered / count as f32
    }

    /// One matte and one glossy path of a primary surface.
    fn signals(
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
                let (m, g) = Self::signals(integrator, &primary, surface, &sampler, rays);
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
                let position = Self::sample_position(views, x, y);
                let (origin, direction, cone) = integrator.eye_ray(views, position);
                for sample in samples {
                    let mut sampler = Sampler::new(pixel, self.frame, sample, seed).fork(Domain::Full as u32);
                    beauty.push(integrator.full(origin, direction, cone, &mut sampler, rays));
                }
            }
            ReferenceKind::Factored => {
                let primary = integrator.primary(views, Self::sample_position(views, x, y), rays);
                // One pass of the direct term serves several paths: it has less noise.
                let direct_samples = options.direct_samples.min(REFERENCE_DIRECT_SAMPLES);
                for sample in samples {
                    let sampler = Sampler::new(pixel, self.frame, sample, seed);
                    let direct = self.unfiltered(integrator, &primary, direct_samples, sample, &sampler, rays);
                    let (m, g) = match &primary.surface {
                        None => (Vec3::ZERO, Vec3::ZERO),
                        Some(surface) => {
                            let (m, g) = Self::signals(integrator, &primary, surface, &sampler, rays);
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

/// Shadow rays of the direct term for each sample of a reference.
const REFERENCE_DIRECT_SAMPLES: u32 = 2;

/// [`Moments`] in double precision, for many samples.
#[derive(Clone, Copy, Default)]
struct Moments64 {
    count: f64,
    mean: glam::DVec3,
    squares: glam::DVec3,
}

impl Moments64 {
    fn push(&mut self, value: Vec3) {
        let value = value.as_dvec3();
        self.count += 1.0;
        let delta = value - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (value - self.mean);
    }

    fn mean(&self) -> Vec3 {
        self.mean.as_vec3()
    }

    fn variance_of_mean(&self) -> Vec3 {
        if self.count > 1.0 { (self.squares / (self.count * (self.count - 1.0))).as_vec3() } else { Vec3::ZERO }
    }
}

/// Where the samples of a frame lie within their pixels: Halton's sequence in bases 2 and 3 around the centre.
fn jitter_of(frame: i64) -> [f32; 2] {
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

/// Computes all pixels on rayon's current threads, band by band, and stores them in order. Each pixel depends on
/// nothing but itself: the result has the same bits with any number of threads.
fn for_each_pixel<T: Send>(
    size: Size,
    control: &Control<'_>,
    compute: impl Fn(usize, usize, &mut RayCounts) -> T + Sync,
    mut store: impl FnMut(usize, usize, T),
) -> Result<RayCounts, TraceError> {
    /// Pixels of a task: short enough to balance, long enough to be worth handing out.
    const TASK_PIXELS: usize = 64;
    let mut rays = RayCounts::default();
    let mut y0 = 0;
    while y0 < size.height {
        if control.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            return Err(TraceError::Cancelled);
        }
        let rows = BAND_ROWS.min(size.height - y0);
        let pixels = rows * size.width;
        let tasks: Vec<(Vec<T>, RayCounts)> = (0..pixels.div_ceil(TASK_PIXELS))
            .into_par_iter()
            .map(|task| {
                let mut rays = RayCounts::default();
                let range = task * TASK_PIXELS..((task + 1) * TASK_PIXELS).min(pixels);
                let values = range.map(|i| compute(i % size.width, y0 + i / size.width, &mut rays)).collect::<Vec<T>>();
                (values, rays)
            })
            .collect();
        let mut i = 0;
        for (values, task_rays) in tasks {
            rays.add(task_rays);
            for value in values {
                store(i % size.width, y0 + i / size.width, value);
                i += 1;
            }
        }
        y0 += rows;
        if let Some(progress) = control.progress {
            progress(y0 as f32 / size.height as f32);
        }
    }
    Ok(rays)
}
