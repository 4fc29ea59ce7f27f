//! Frames that stay on the device: traced into the caller's encoder, their planes as textures for a denoiser.

use super::error::GpuError;
use super::jobs::{Kernel, Step, bytes_per_pixel, frame_steps, texture_bytes_per_pixel};
use super::kernels::{JOB_STRIDE, Kernels};
use super::layout;
use super::results::FrameResult;
use super::scenery::{Bands, JOBS_AT_ONCE, Scenery, job_bytes, uniform_of};
use crate::primary::Views;
use crate::scene::SceneError;
use crate::tracer::{RenderOptions, Rendered, SIZE_LIMIT, TraceError, Tracer};
use bytemuck::{Pod, Zeroable, bytes_of};
use quell::{Camera, Size};
use std::ops::Range;
use std::sync::Arc;

/// Who looks, and with which samples.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The camera of this frame.
    pub camera: Camera,
    /// The one of the frame before.
    pub previous_camera: Camera,
    /// Chooses the samples: another number is other noise.
    pub number: i64,
}

impl View {
    fn views(&self, size: Size) -> Result<Views, GpuError> {
        let Self { camera, previous_camera, number } = *self;
        if size.width == 0 || size.height == 0 || size.width > SIZE_LIMIT || size.height > SIZE_LIMIT {
            return Err(GpuError::from(TraceError::from(SceneError::Size { size, limit: SIZE_LIMIT })));
        }
        let unusable = || {
            let scene = "that is shown".to_owned();
            GpuError::from(TraceError::from(SceneError::Camera { scene, number: 1, frame: number }))
        };
        let now = camera.projection(size).ok_or_else(unusable)?;
        let before = previous_camera.projection(size).ok_or_else(unusable)?;
        Ok(Views { camera, previous_camera, now, before })
    }
}

/// A frame's planes as textures of one extent, which a denoiser reads: 76 bytes a pixel. Colours are held to what half
/// precision can hold.
#[derive(Clone, Debug)]
pub struct Planes {
    /// Light that needs no filter; rgba16float.
    pub direct: wgpu::TextureView,
    /// Matte light without its weight; rgba16float.
    pub matte: wgpu::TextureView,
    /// Glossy light without its weight; rgba16float.
    pub glossy: wgpu::TextureView,
    /// World-space unit normal, and perceptual roughness in alpha; rgba32float. Background: 0.
    pub normal_roughness: wgpu::TextureView,
    /// What multiplies the matte light back; rgba16float.
    pub matte_weight: wgpu::TextureView,
    /// What multiplies the glossy light back; rgba16float.
    pub glossy_weight: wgpu::TextureView,
    /// View depth and glossy hit distance, the scene's unit; rg32float. Infinity is 3e38.
    pub depth_hit: wgpu::TextureView,
    /// Motion in pixels, previous = current + motion, y down; rg32float. In mirrors that of the image. Unknown: 1e30.
    pub motion: wgpu::TextureView,
    /// Number of the instance + 1; the upper 16 bits are those of the mirrors and lenses it is seen through; r32uint.
    pub surface_id: wgpu::TextureView,
    size: Size,
}

impl Planes {
    /// Bytes a pixel of all of them.
    pub const BYTES: u32 = 5 * 8 + 16 + 2 * 8 + 4;

    /// Textures of an extent that the device has.
    pub fn new(device: &wgpu::Device, size: Size) -> Self {
        use wgpu::TextureFormat::{R32Uint, Rg32Float, Rgba16Float, Rgba32Float};
        let make = |label, format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size.width as u32, height: size.height as u32, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        Self {
            direct: make("traced direct", Rgba16Float),
            matte: make("traced matte", Rgba16Float),
            glossy: make("traced glossy", Rgba16Float),
            normal_roughness: make("traced normal, roughness", Rgba32Float),
            matte_weight: make("traced matte weight", Rgba16Float),
            glossy_weight: make("traced glossy weight", Rgba16Float),
            depth_hit: make("traced depth, hit distance", Rg32Float),
            motion: make("traced motion", Rg32Float),
            surface_id: make("traced surface id", R32Uint),
            size,
        }
    }

    /// Their extent.
    pub fn size(&self) -> Size {
        self.size
    }

    /// By entry point of `planes.wgsl`, with their bindings.
    fn written(&self) -> [(&'static str, Vec<(u32, &wgpu::TextureView)>); 3] {
        [
            ("light", vec![(2, &self.direct), (3, &self.matte), (4, &self.glossy), (5, &self.normal_roughness)]),
            (
                "weights",
                vec![(6, &self.matte_weight), (7, &self.glossy_weight), (8, &self.depth_hit), (9, &self.motion)],
            ),
            ("ids", vec![(10, &self.surface_id)]),
        ]
    }
}

/// Twin of `Band` in `planes.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Band {
    width: u32,
    rows: u32,
    first_row: u32,
    pixels: u32,
}

/// What the picture is traced with, kept between frames.
struct Kept {
    bands: Bands,
    plane_count: u32,
    /// Of `planes.wgsl`, for the textures that it wrote lately: those of two eyes, for example.
    written: Vec<(Planes, Vec<(wgpu::ComputePipeline, wgpu::BindGroup)>)>,
    band: wgpu::Buffer,
}

/// A scene in a device's memory that is traced frame after frame, into textures: nothing is submitted, waited for or read
/// back. It keeps no scene: [`LiveTracer::update`] brings what moves.
pub struct LiveTracer {
    scenery: Scenery,
    module: wgpu::ShaderModule,
    kept: Option<Kept>,
    notes: Vec<String>,
}

/// Sets of textures whose bindings are kept.
const MOST_WRITTEN: usize = 4;

/// Passes of a frame that a caller may time, in their order.
pub const TIMED: [&str; 4] = ["trace primary", "trace signals", "trace direct", "planes"];

fn timed_as(kernel: Kernel, job: &layout::Job) -> &'static str {
    match kernel {
        Kernel::Primary => TIMED[0],
        Kernel::Paths if job.flags & layout::IS_SIGNAL != 0 => TIMED[1],
        _ => TIMED[2],
    }
}

impl LiveTracer {
    /// Uploads what `tracer` has prepared. `kernels` are those of the device.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`]: a scene that is larger than the device's buffers; nothing was uploaded.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        kernels: Arc<Kernels>,
        tracer: &Tracer<'_>,
    ) -> Result<Self, GpuError> {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("quell traced planes"),
            source: wgpu::ShaderSource::Wgsl(super::shader::planes_source().into()),
        });
        let notes = tracer.notes(crate::PrimaryReplacement::default());
        Ok(Self { scenery: Scenery::new(device, queue, kernels, tracer)?, module, kept: None, notes })
    }

    /// Takes another frame of the same scene, or the scene with other lamps: uploads the parts that changed. Textures stay
    /// as they are.
    ///
    /// # Errors
    /// As [`LiveTracer::new`]; the scene stays as it was.
    pub fn update(&mut self, tracer: &Tracer<'_>) -> Result<(), GpuError> {
        if self.scenery.update(tracer)? {
            self.kept = None;
        }
        Ok(())
    }

    /// Bytes of the scene in the device's memory, by part.
    pub fn memory(&self) -> Vec<(&'static str, u64)> {
        self.scenery.memory()
    }

    /// Bytes a pixel that each of [`TIMED`] reads and writes between the passes, at the least: each plane once for every dispatch, without
    /// what the scene's buffers and textures give.
    ///
    /// # Errors
    /// As [`LiveTracer::encode`].
    pub fn bytes_per_pixel(&self, options: &RenderOptions) -> Result<[(&'static str, u32); 4], GpuError> {
        let variant = self.scenery.variant_of(options);
        let mut bytes = TIMED.map(|name| (name, 0));
        for step in frame_steps(options, variant) {
            let name = timed_as(step.0, &step.1);
            bytes.iter_mut().filter(|(n, _)| *n == name).for_each(|(_, b)| *b += bytes_per_pixel(&step, variant));
        }
        bytes[3].1 = texture_bytes_per_pixel(Planes::BYTES);
        Ok(bytes)
    }

    /// What the pictures do not model, in sentences.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Compiles what a frame with these options needs; without, the first frame does.
    ///
    /// # Errors
    /// As [`LiveTracer::encode`].
    pub fn prepare(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        let kept = self.keep(options)?;
        self.kept = Some(kept);
        Ok(())
    }

    /// What was kept, where it still fits.
    fn keep(&mut self, options: &RenderOptions) -> Result<Kept, GpuError> {
        let variant = self.scenery.variant_of(options);
        let (plane_count, work) = Scenery::shape_of(options);
        let rows = self.scenery.rows(options.size, variant, plane_count, work);
        if let Some(kept) = self.kept.take() {
            let b = &kept.bands;
            if (b.size, b.variant, b.rows, kept.plane_count) == (options.size, variant, rows, plane_count) {
                return Ok(kept);
            }
        }
        let bands = self.scenery.bands(options.size, variant, plane_count, work)?;
        let upload = super::upload::Upload { device: &self.scenery.device, queue: &self.scenery.queue };
        Ok(Kept { bands, plane_count, written: Vec::new(), band: upload.uniform("quell band", size_of::<Band>()) })
    }

    /// Appends a frame to the caller's encoder: the planes of what `view` sees, as [`super::GpuTracer::render`] would trace them.
    /// `options.size` is the extent of `planes`; its jitter is not used, the camera has its own.
    ///
    /// `times` is asked before each pass, by its name among [`TIMED`], where to write its timestamps.
    ///
    /// # Errors
    /// A size or camera that cannot be used. Nothing was encoded then.
    pub fn encode<'q>(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        options: &RenderOptions,
        view: &View,
        planes: &Planes,
        mut times: impl FnMut(&'static str) -> Option<wgpu::ComputePassTimestampWrites<'q>>,
    ) -> Result<(), GpuError> {
        let size = planes.size;
        let options = RenderOptions { size, ..*options };
        let views = view.views(size)?;
        let mut kept = self.keep(&options)?;
        if !kept.written.iter().any(|(p, _)| p.direct == planes.direct) {
            if kept.written.len() >= MOST_WRITTEN {
                kept.written.remove(0);
            }
            let writers = self.writers(&kept, planes);
            kept.written.push((planes.clone(), writers));
        }
        let kept = &*self.kept.insert(kept);
        let scenery = &self.scenery;
        let steps = frame_steps(&options, kept.bands.variant);
        let uniform = scenery.uniform(&options, &views, view.number);
        let bands: Vec<_> = kept.bands.each().collect();
        let staging = Staging::new(&scenery.device, &steps, &uniform, &kept.bands);
        for (number, rows) in bands.into_iter().enumerate() {
            staging.copy_band(encoder, number, [&scenery.frame, &kept.band]);
            for (part, steps) in steps.chunks(JOBS_AT_ONCE).enumerate() {
                staging.copy_jobs(encoder, part, steps.len(), &scenery.jobs);
                // A pass for each thing that is timed.
                let all: Vec<(usize, &Step)> = steps.iter().enumerate().collect();
                for group in all.chunk_by(|(_, a), (_, b)| timed_as(a.0, &a.1) == timed_as(b.0, &b.1)) {
                    let Some((_, (kernel, job))) = group.first() else { continue };
                    let name = timed_as(*kernel, job);
                    let timestamp_writes = times(name);
                    let pass = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes };
                    let mut pass = encoder.begin_compute_pass(&pass);
                    kept.bands.record(&mut pass, rows.len(), group.iter().copied());
                }
            }
            let timestamp_writes = times(TIMED[3]);
            let pass = wgpu::ComputePassDescriptor { label: Some(TIMED[3]), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&pass);
            let written = kept.written.iter().filter(|(p, _)| p.direct == planes.direct);
            for (pipeline, group) in written.flat_map(|(_, all)| all) {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.dispatch_workgroups((size.width as u32).div_ceil(8), (rows.len() as u32).div_ceil(8), 1);
            }
        }
        Ok(())
    }

    /// The passes from the band's buffer to the textures.
    fn writers(&self, kept: &Kept, planes: &Planes) -> Vec<(wgpu::ComputePipeline, wgpu::BindGroup)> {
        let device = &self.scenery.device;
        let made = planes.written().map(|(entry, textures)| {
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &self.module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            });
            let mut entries = vec![
                wgpu::BindGroupEntry { binding: 0, resource: kept.band.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: kept.bands.planes.as_entire_binding() },
            ];
            entries.extend(textures.into_iter().map(|(binding, view)| wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::TextureView(view),
            }));
            let layout = pipeline.get_bind_group_layout(0);
            let descriptor = wgpu::BindGroupDescriptor { label: Some(entry), layout: &layout, entries: &entries };
            let group = device.create_bind_group(&descriptor);
            (pipeline, group)
        });
        made.into()
    }

    /// Traces the same frame into buffers that are read back: what `quell render` would write. Nothing is waited for.
    ///
    /// `submit` submits each encoder at once, in order; where a buffer comes with it, it first appends a copy of the buffer's first
    /// bytes: one for each band, which [`Unread::finish`] takes in that order.
    ///
    /// # Errors
    /// As [`LiveTracer::encode`]; what `submit` fails with.
    pub fn read_back<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        view: &View,
        mut submit: impl FnMut(wgpu::CommandEncoder, Option<(&wgpu::Buffer, u64)>) -> Result<(), E>,
    ) -> Result<Unread, E> {
        let views = view.views(options.size)?;
        let run = |encoder, read: Option<(&wgpu::Buffer, u64)>| submit(encoder, read).map(|()| Vec::new());
        self.scenery.render_later(options, &views, view.number, self.notes.clone(), run)
    }
}

/// A frame whose bands are on their way from the device.
#[derive(Debug)]
pub struct Unread {
    pub(super) result: FrameResult,
    pub(super) rows: Vec<Range<usize>>,
}

impl Unread {
    /// The frame, of what each band's copy held, in order. A band that is missing is black.
    pub fn finish(mut self, bands: impl IntoIterator<Item = Vec<u8>>) -> Rendered {
        for (rows, bytes) in self.rows.iter().zip(bands) {
            self.result.take(rows, &bytes);
        }
        self.result.finish()
    }
}

/// A frame's uniforms, copied by the encoder itself: in the order of its commands, so that several frames may be encoded before
/// one is submitted.
struct Staging {
    buffer: wgpu::Buffer,
    bands: usize,
}

impl Staging {
    const FRAME: usize = size_of::<layout::Frame>();
    const BAND: usize = size_of::<Band>();

    fn new(device: &wgpu::Device, steps: &[Step], uniform: &layout::Frame, bands: &Bands) -> Self {
        let mut bytes = Vec::new();
        let mut count = 0;
        for rows in bands.each() {
            let frame = uniform_of(uniform, bands.size, &rows);
            bytes.extend(bytes_of(&frame));
            let layout::Frame { width, rows, first_row, pixels, .. } = frame;
            bytes.extend(bytes_of(&Band { width, rows, first_row, pixels }));
            count += 1;
        }
        bytes.extend(job_bytes(steps));
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("quell staging"),
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: true,
        });
        // A lost device maps nothing; what follows does nothing then, too.
        if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
            mapped.copy_from_slice(&bytes);
        }
        buffer.unmap();
        Self { buffer, bands: count }
    }

    fn copy_band(&self, encoder: &mut wgpu::CommandEncoder, number: usize, to: [&wgpu::Buffer; 2]) {
        let at = number * (Self::FRAME + Self::BAND);
        encoder.copy_buffer_to_buffer(&self.buffer, at as u64, to[0], 0, Self::FRAME as u64);
        encoder.copy_buffer_to_buffer(&self.buffer, (at + Self::FRAME) as u64, to[1], 0, Self::BAND as u64);
    }

    fn copy_jobs(&self, encoder: &mut wgpu::CommandEncoder, part: usize, count: usize, to: &wgpu::Buffer) {
        let at = self.bands * (Self::FRAME + Self::BAND) + part * JOBS_AT_ONCE * JOB_STRIDE;
        encoder.copy_buffer_to_buffer(&self.buffer, at as u64, to, 0, (count * JOB_STRIDE) as u64);
    }
}
