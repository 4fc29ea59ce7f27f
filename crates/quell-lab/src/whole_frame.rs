//! A whole frame on a GPU, traced and denoised in one encoder as `quell-live` does, to see what each pass takes.

use crate::error::Error;
use quell::gpu::{self, Channel, GuideTextures, Scalar, Signal, wgpu};
use quell::{Camera, Settings, Size};
use quell_host::{Gpu, Readback};
use quell_trace::gpu::{Kernels, LiveTracer, Planes, View};
use quell_trace::{RenderOptions, Scene, SceneError, TraceError, Tracer, jitter_of};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Timestamps of the tracer in a frame, at most; what comes after is not timed.
const MOST_QUERIES: u32 = 4096;

/// Distance between two eyes, in the scene's unit (glTF: metres).
const BETWEEN_EYES: f32 = 0.064;

/// What a frame consists of.
#[derive(Clone, Debug)]
pub struct FramePlan {
    /// Extent of each view.
    pub size: Size,
    /// Views of a frame: 1, or 2 for two eyes.
    pub views: usize,
    /// Paths, bounces, shadow rays; the size in it is not used.
    pub options: RenderOptions,
}

/// Time and bytes of a pass, of all views of a frame together.
#[derive(Clone, Debug, PartialEq)]
pub struct PassCost {
    /// Its name.
    pub name: &'static str,
    /// Of the tracer; else of the denoiser.
    pub is_tracing: bool,
    /// The stages of the denoiser that it runs.
    pub stages: &'static [quell::pipeline::Stage],
    /// Milliseconds by timestamps; `None`: the adapter has none that could be used.
    pub milliseconds: Option<f64>,
    /// Bytes a pixel that it reads and writes between the passes, at the least; the scene's own data are not in it.
    pub bytes_per_pixel: u32,
}

/// A frame that has run.
#[derive(Clone, Debug)]
pub struct WholeFrameCost {
    /// In the order in which they ran.
    pub passes: Vec<PassCost>,
    /// From encoding to the end.
    pub wall: Duration,
    /// The same of the tracer alone and of the denoiser alone, submitted apart; where the adapter is one in software, whose timestamps
    /// do not wait for its own threads.
    pub parts: Option<[Duration; 2]>,
}

struct Eye {
    planes: Planes,
    denoiser: gpu::Denoiser,
    camera: Camera,
    previous_camera: Camera,
}

/// Tracer and denoiser on one device.
pub struct WholeFrame {
    gpu: Arc<Gpu>,
    tracer: LiveTracer,
    eyes: Vec<Eye>,
    options: RenderOptions,
    queries: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    number: i64,
}

/// The camera moved to its right.
fn moved(camera: &Camera, by: f32) -> Camera {
    let mut moved = *camera;
    let m = &mut moved.clip_from_world;
    let row = [m[0], m[4], m[8]];
    let length = row.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length > 0.0 {
        let offset = row.map(|v| v / length * by);
        for r in 0..4 {
            m[12 + r] -= (0..3).map(|c| m[4 * c + r] * offset[c]).sum::<f32>();
        }
        for (position, offset) in moved.position.iter_mut().zip(offset) {
            *position += offset;
        }
    }
    moved
}

impl WholeFrame {
    /// Uploads a scene at one frame, as camera number `camera` (from 1) sees it, and makes what `plan` needs.
    ///
    /// # Errors
    /// A scene that cannot be traced or is beyond the device's buffers; a size or settings that the denoiser refuses; memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        kernels: &Arc<Kernels>,
        scene: &Scene,
        frame: i64,
        camera: usize,
        settings: &Settings,
        plan: &FramePlan,
    ) -> Result<Self, Error> {
        let scene_error = |e: SceneError| Error::Trace(TraceError::Scene(e));
        let device = gpu.device();
        let tracer = Tracer::new(scene, frame, camera).map_err(scene_error)?;
        let (camera, previous_camera) = tracer.cameras(plan.size, false).map_err(scene_error)?;
        let options = RenderOptions { size: plan.size, ..plan.options };
        let mut live = LiveTracer::new(device, gpu.queue(), Arc::clone(kernels), &tracer)?;
        live.prepare(&options)?;
        let mut of_denoiser = gpu::Options::new(settings);
        of_denoiser.composite = true;
        of_denoiser.timings = !gpu.adapter().is_software();
        let views = plan.views.max(1);
        let eyes = (0..views).map(|eye| {
            let side = (eye as f32 - 0.5 * (views - 1) as f32) * BETWEEN_EYES;
            Ok(Eye {
                planes: Planes::new(device, plan.size),
                denoiser: gpu::Denoiser::new(device, plan.size, &of_denoiser)
                    .map_err(|e| Error::from(quell_host::Error::from(e)))?,
                camera: moved(&camera, side),
                previous_camera: moved(&previous_camera, side),
            })
        });
        let eyes = eyes.collect::<Result<Vec<_>, Error>>()?;
        gpu.check("a whole frame")?;
        let has_timestamps =
            device.features().contains(wgpu::Features::TIMESTAMP_QUERY) && !gpu.adapter().is_software();
        let queries = has_timestamps.then(|| {
            let label = Some("quell tracer's times");
            let ty = wgpu::QueryType::Timestamp;
            let set = device.create_query_set(&wgpu::QuerySetDescriptor { label, ty, count: MOST_QUERIES });
            let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
            (set, gpu.buffer("quell tracer's times", u64::from(MOST_QUERIES * wgpu::QUERY_SIZE), usage))
        });
        Ok(Self { gpu: Arc::clone(gpu), tracer: live, eyes, options, queries, number: frame })
    }

    /// Traces and denoises the next frame; returns when it has run. The camera stands still, the samples change.
    ///
    /// # Errors
    /// What tracer, denoiser and device report.
    pub fn run(&mut self) -> Result<WholeFrameCost, Error> {
        let gpu = Arc::clone(&self.gpu);
        let options = self.options;
        let begin = Instant::now();
        let mut encoder = gpu.encoder("quell whole frame");
        let mut names: Vec<&'static str> = Vec::new();
        let views = self.eyes.iter().map(|eye| {
            let jitter = if options.jitter { jitter_of(self.number) } else { [0.0; 2] };
            let camera = Camera { jitter, ..eye.camera };
            View { camera, previous_camera: eye.previous_camera, number: self.number }
        });
        let views: Vec<View> = views.collect();
        for (eye, view) in self.eyes.iter().zip(&views) {
            let queries = self.queries.as_ref();
            let times = |name| {
                let first = 2 * names.len() as u32;
                let (query_set, _) = queries.filter(|_| first + 1 < MOST_QUERIES)?;
                names.push(name);
                Some(wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(first),
                    end_of_pass_write_index: Some(first + 1),
                })
            };
            self.tracer.encode(&mut encoder, &options, view, &eye.planes, times)?;
        }
        let mut traced = None;
        if gpu.adapter().is_software() {
            gpu.run(std::mem::replace(&mut encoder, gpu.encoder("quell denoiser")), "tracing")?;
            traced = Some(begin.elapsed());
        }
        for (eye, view) in self.eyes.iter_mut().zip(&views) {
            let frame = frame_of(&eye.planes, view, options.size);
            let made = eye.denoiser.encode(gpu.device(), &mut encoder, &frame);
            made.map_err(|e| Error::from(quell_host::Error::from(e)))?;
            eye.denoiser.resolve_timings(gpu.device(), &mut encoder);
            // The next frame's history is this one's view, jitter included.
            eye.previous_camera = view.camera;
        }
        self.number += 1;
        let mut readback = Readback::default();
        if let Some((set, buffer)) = self.queries.as_ref().filter(|_| !names.is_empty()) {
            let count = 2 * names.len() as u32;
            encoder.resolve_query_set(set, 0..count, buffer, 0);
            readback.buffer(&gpu, &mut encoder, buffer, u64::from(count * wgpu::QUERY_SIZE));
        }
        let read = readback.read(&gpu, encoder, "a whole frame")?;
        let wall = begin.elapsed();
        let parts = traced.map(|traced| [traced, wall - traced]);
        let ticks: Vec<u64> =
            read.iter().take(1).flat_map(|bytes| bytes.as_chunks().0).map(|b| u64::from_le_bytes(*b)).collect();
        let period = f64::from(gpu.queue().get_timestamp_period());
        let time_of = |name: &str| {
            let spans = names.iter().zip(ticks.as_chunks::<2>().0).filter(|(n, _)| **n == name);
            let sum: f64 = spans.map(|(_, [a, b])| b.saturating_sub(*a) as f64 * period * 1e-6).sum();
            Some(sum).filter(|_| !ticks.is_empty())
        };
        let mut passes: Vec<PassCost> = Vec::new();
        for (name, bytes_per_pixel) in self.tracer.bytes_per_pixel(&options)? {
            passes.push(PassCost { name, is_tracing: true, stages: &[], milliseconds: time_of(name), bytes_per_pixel });
        }
        for (number, eye) in self.eyes.iter_mut().enumerate() {
            if number == 0 {
                let program = eye.denoiser.program();
                passes.extend(program.dispatches.iter().map(|dispatch| PassCost {
                    name: dispatch.pass.name,
                    is_tracing: false,
                    stages: dispatch.pass.stages,
                    milliseconds: None,
                    bytes_per_pixel: program.bytes_of(dispatch),
                }));
            }
            for timing in eye.denoiser.take_timings(gpu.queue()).unwrap_or_default() {
                if let Some(pass) = passes.iter_mut().find(|pass| !pass.is_tracing && pass.name == timing.pass) {
                    *pass.milliseconds.get_or_insert(0.0) += timing.milliseconds;
                }
            }
        }
        Ok(WholeFrameCost { passes, wall, parts })
    }

    /// Rays a pixel of a frame, those that look for the nearest surface and shadow rays together: traced once more and read back.
    ///
    /// # Errors
    /// As [`WholeFrame::run`].
    pub fn rays_per_pixel(&self) -> Result<f64, Error> {
        let Some(eye) = self.eyes.first() else { return Ok(0.0) };
        let view = View { camera: eye.camera, previous_camera: eye.previous_camera, number: self.number };
        let mut bands = Vec::new();
        let unread = self.tracer.read_back(&self.options, &view, |mut encoder, read| -> Result<(), Error> {
            let mut readback = Readback::default();
            if let Some((buffer, bytes)) = read {
                readback.buffer(&self.gpu, &mut encoder, buffer, bytes);
            }
            bands.extend(readback.read(&self.gpu, encoder, "counting rays")?);
            Ok(())
        })?;
        Ok(unread.finish(bands).rays.total() as f64 / self.options.size.pixels().max(1) as f64)
    }

    /// Device memory in bytes: of the scene, of planes and of denoisers.
    pub fn memory(&self) -> [(&'static str, u64); 3] {
        let scene = self.tracer.memory().iter().map(|(_, bytes)| bytes).sum();
        let planes = (self.eyes.len() * self.options.size.pixels()) as u64 * u64::from(Planes::BYTES);
        let denoisers = self.eyes.iter().map(|eye| eye.denoiser.memory());
        [("scene", scene), ("planes", planes), ("denoiser", denoisers.map(|m| m.persistent + m.transient).sum())]
    }
}

/// What the denoiser reads of a frame.
fn frame_of<'a>(planes: &'a Planes, view: &View, size: Size) -> gpu::Frame<'a> {
    let guides = GuideTextures {
        view_depth: Some(&planes.depth_hit),
        normal: Some(&planes.normal_roughness),
        motion: Some(&planes.motion),
        roughness: Some(Scalar { view: &planes.normal_roughness, channel: Channel::A }),
        glossy_hit_distance: Some(Scalar { view: &planes.depth_hit, channel: Channel::G }),
        surface_id: Some(&planes.surface_id),
        ..GuideTextures::default()
    };
    let mut frame = gpu::Frame::new(size, view.camera, view.previous_camera, view.number, guides);
    frame.direct = Some(&planes.direct);
    frame.matte = Some(Signal { light: &planes.matte, weight: Some(&planes.matte_weight), direct: None });
    frame.glossy = Some(Signal { light: &planes.glossy, weight: Some(&planes.glossy_weight), direct: None });
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_eye_to_the_right_sees_things_farther_left() {
        let size = Size::new(160, 90);
        let camera = Camera::perspective([1.0, 2.0, 3.0], [0.3, -0.2, -1.0], [0.0, 1.0, 0.0], 0.8, 16.0 / 9.0);
        let right = moved(&camera, 0.5);
        let [a, b] = [camera, right].map(|c| c.projection(size).unwrap());
        assert!((a.eye().iter().zip(b.eye()).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt() - 0.5).abs() < 1e-4);
        let world = a.world(glam::Vec2::new(80.0, 45.0), 5.0);
        let [x, y] = b.pixel(world).unwrap().to_array();
        assert!(x < 75.0 && (y - 45.0).abs() < 1e-2, "{x} {y}");
    }
}
