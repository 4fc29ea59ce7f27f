//! The path tracer on a GPU: the twin in WGSL of what [`Tracer`] does, file beside file, on WebGPU's default limits. It
//! encodes only: the caller submits, waits and reads back ([`Run`]).
//!
//! ```text
//! mod.rs      GpuTracer: a scene's buffers, bands of rows, what is encoded for them
//! kernels.rs  compute pipelines, one set for each kind of scene
//! shader.rs   the program: WGSL files and constants
//! scene.wgsl  buffers of the scene; layout.rs: the same in Rust
//! pack/       a scene as bytes
//! view.rs     cameras
//! jobs.rs     the list of dispatches
//! results.rs  planes read back, into frames and references
//! ```
//!
//! A picture is traced in bands of rows, so that what lies between the passes fits in one binding. For each band the
//! eye's ray is followed first, and every vertex on its way is kept (*slots*); then each *job* traces paths of one kind
//! from one slot of all pixels. The same jobs in the same order serve frames and references.
//!
//! Paths are those of the CPU: the sampler's 64-bit hashes are emulated, so nearly every pixel has the same samples. What
//! differs is rounding, and that light is sampled in single precision.

mod error;
mod jobs;
mod kernels;
mod layout;
mod pack;
mod results;
mod shader;
mod view;

pub use error::GpuError;
pub use kernels::Kernels;
pub use wgpu;

use crate::primary::PrimaryReplacement;
use crate::tracer::{Control, Estimator, Half, Reference, ReferenceKind, RenderOptions, Rendered, TraceError, Tracer};
use bytemuck::{bytes_of, cast_slice};
use jobs::{Step, frame_steps, halves_of, reference_steps};
use kernels::{JOB_STRIDE, Pipelines};
use pack::Packed;
use pack::images::HEAP_WIDTH;
use quell::Size;
use results::{FrameResult, ReferenceResult};
use shader::Variant;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Pixels of a band, at most: half a million threads fill any GPU.
const MOST_BAND_PIXELS: usize = 1 << 19;

/// Paths and shadow rays that a band may take for each sample of the frame, so that no dispatch runs for seconds.
const MOST_BAND_WORK: usize = 1 << 25;

/// Paths and shadow rays of one sample of a reference, about.
const REFERENCE_WORK: usize = 8;

/// Jobs of one submission, at most.
const JOBS_AT_ONCE: usize = 64;

/// One frame of a scene seen by one camera, in a device's memory. Made of a [`Tracer`].
pub struct GpuTracer<'s> {
    tracer: Tracer<'s>,
    device: wgpu::Device,
    queue: wgpu::Queue,
    kernels: Arc<Kernels>,
    variant: Variant,
    /// In the order of their bindings, from 1.
    buffers: [wgpu::Buffer; 6],
    texels: wgpu::TextureView,
    frame: wgpu::Buffer,
    jobs: wgpu::Buffer,
    light_parts: layout::Lights,
    triangle_count: u32,
    units: [f32; 2],
    band_pixels: usize,
}

/// Submits an encoder's commands and waits for them; then reads the first bytes of a buffer, where one is given.
pub trait Run<E>: FnMut(wgpu::CommandEncoder, Option<(&wgpu::Buffer, u64)>) -> Result<Vec<u8>, E> {}

impl<E, F: FnMut(wgpu::CommandEncoder, Option<(&wgpu::Buffer, u64)>) -> Result<Vec<u8>, E>> Run<E> for F {}

/// A picture's pipelines and what lies between its passes, for one band of its rows.
struct Bands {
    pipelines: Arc<Pipelines>,
    scene: wgpu::BindGroup,
    band: wgpu::BindGroup,
    uniform: layout::Frame,
    size: Size,
    rows: usize,
    planes: wgpu::Buffer,
    plane_count: u32,
}

impl<'s> GpuTracer<'s> {
    /// Uploads what `tracer` has prepared. `kernels` are those of the device.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`]: a scene that is larger than the device's buffers.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        kernels: Arc<Kernels>,
        tracer: Tracer<'s>,
    ) -> Result<Self, GpuError> {
        let packed = Packed::new(&tracer);
        let uploaded = Uploaded { device, queue };
        let buffers = [
            uploaded.storage("triangle hierarchy", cast_slice(&packed.nodes))?,
            uploaded.storage("triangles", cast_slice(&packed.triangles))?,
            uploaded.storage("attributes of vertices", cast_slice(&packed.attributes))?,
            uploaded.storage("instances", cast_slice(&packed.instances))?,
            uploaded.storage("materials", cast_slice(&packed.surfaces))?,
            uploaded.storage("lights and environment", cast_slice(&packed.lights))?,
        ];
        Ok(Self {
            buffers,
            texels: uploaded.texels(&packed.texels, packed.layers)?,
            frame: uploaded.uniform("quell frame", size_of::<layout::Frame>()),
            jobs: uploaded.uniform("quell jobs", JOBS_AT_ONCE * JOB_STRIDE),
            device: device.clone(),
            queue: queue.clone(),
            kernels,
            variant: packed.variant,
            light_parts: packed.light_parts,
            triangle_count: packed.triangle_count,
            units: packed.units,
            band_pixels: MOST_BAND_PIXELS,
            tracer,
        })
    }

    /// For tests: bands of so many pixels at most.
    #[doc(hidden)]
    pub fn limit_bands(&mut self, pixels: usize) {
        self.band_pixels = pixels;
    }

    /// For tests: shows one of the differences that are planted in the program ([`Kernels::planted`]); 0: none.
    #[doc(hidden)]
    pub fn show_planted(&mut self, number: u32) {
        self.light_parts.planted = number;
    }

    /// The CPU's tracer of the same frame.
    pub fn tracer(&self) -> &Tracer<'s> {
        &self.tracer
    }

    /// Traces the frame, as [`Tracer::render`] does.
    ///
    /// # Errors
    /// A size or camera that cannot be used; [`GpuError::Mirrors`]; [`TraceError::Cancelled`]; what `run` fails with.
    pub fn render<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        control: &Control<'_>,
        run: impl Run<E>,
    ) -> Result<Rendered, E> {
        let variant = self.variant_of(options)?;
        let mut result = FrameResult::new(&self.tracer, options).map_err(GpuError::from)?;
        let planes = if options.separate_halves() { layout::HALVES_PLANES } else { layout::FRAME_PLANES };
        let work = options.samples + options.direct_samples;
        let bands = self.bands(options, variant, planes, work as usize)?;
        let steps = frame_steps(options, variant);
        self.trace(&bands, &steps, control, run, |rows, bytes| result.take(rows, bytes))?;
        Ok(result.finish())
    }

    /// Traces samples of one half of a reference, as [`Tracer::reference`] does.
    ///
    /// # Errors
    /// As [`GpuTracer::render`].
    pub fn reference<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        kind: ReferenceKind,
        half: Half,
        samples: Range<u32>,
        control: &Control<'_>,
        run: impl Run<E>,
    ) -> Result<Reference, E> {
        let variant = self.variant_of(options)?;
        let mut result = ReferenceResult::new(options.size, kind, &samples);
        let bands = self.bands(options, variant, layout::REFERENCE_PLANES, REFERENCE_WORK)?;
        let steps = reference_steps(options, variant, kind, half, samples);
        self.trace(&bands, &steps, control, run, |rows, bytes| result.take(rows, bytes))?;
        Ok(result.finish())
    }

    fn variant_of(&self, options: &RenderOptions) -> Result<Variant, GpuError> {
        if options.primary_replacement == PrimaryReplacement::GlassAndMirrors {
            return Err(GpuError::Mirrors);
        }
        let looks_through = self.variant.transmissive && options.primary_replacement != PrimaryReplacement::Off;
        Ok(Variant { looks_through, ..self.variant })
    }

    /// Band by band, part by part.
    fn trace<E: From<GpuError>>(
        &self,
        bands: &Bands,
        steps: &[Step],
        control: &Control<'_>,
        mut run: impl Run<E>,
        mut take: impl FnMut(&Range<usize>, &[u8]),
    ) -> Result<(), E> {
        for begin in (0..bands.size.height).step_by(bands.rows) {
            let rows = begin..(begin + bands.rows).min(bands.size.height);
            let bytes = u64::from(bands.plane_count) * (rows.len() * bands.size.width) as u64 * 4;
            let parts = steps.chunks(JOBS_AT_ONCE);
            let count = parts.len();
            for (part, steps) in parts.enumerate() {
                if control.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
                    return Err(GpuError::from(TraceError::Cancelled).into());
                }
                let encoder = self.encode(bands, &rows, steps);
                let last = part + 1 == count;
                let read = run(encoder, last.then_some((&bands.planes, bytes)))?;
                if last {
                    take(&rows, &read);
                }
                if let Some(progress) = control.progress {
                    let of_band = (part + 1) as f32 / count as f32;
                    progress((rows.start as f32 + of_band * rows.len() as f32) / bands.size.height as f32);
                }
            }
        }
        Ok(())
    }

    fn bands(
        &self,
        options: &RenderOptions,
        variant: Variant,
        plane_count: u32,
        work: usize,
    ) -> Result<Bands, GpuError> {
        let size = options.size;
        let views = self.tracer.views(size, options.jitter).map_err(TraceError::from)?;
        let uniform = layout::Frame {
            number: halves_of(self.tracer.frame() as u64),
            bounces: options.bounces,
            exact: u32::from(options.estimator == Estimator::Exact),
            fresnel_rough_damping: u32::from(options.model.fresnel_rough_damping),
            fresnel_strength: options.model.fresnel_strength,
            indirect_clamp: options.indirect_clamp,
            inner_from_world: self.units[0],
            world_from_inner: self.units[1],
            triangle_count: self.triangle_count,
            lights: self.light_parts,
            ..view::frame(&views, size)
        };
        let slot_bytes = u64::from(variant.slots()) * layout::SLOT_BYTES;
        let pixel_bytes = slot_bytes.max(u64::from(plane_count) * 4);
        let by_binding = (self.device.limits().max_storage_buffer_binding_size / pixel_bytes) as usize;
        let pixels = by_binding.min(self.band_pixels).min(MOST_BAND_WORK / work.max(1));
        let rows = (pixels / size.width).clamp(1, size.height);
        let pixels = (rows * size.width) as u64;
        let buffer = |label, bytes, usage| {
            let usage = wgpu::BufferUsages::STORAGE | usage;
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size: bytes, usage, mapped_at_creation: false };
            self.device.create_buffer(&descriptor)
        };
        let slots = buffer("quell slots", slot_bytes * pixels, wgpu::BufferUsages::empty());
        let planes = buffer("quell planes", u64::from(plane_count) * 4 * pixels, wgpu::BufferUsages::COPY_SRC);
        let pipelines = self.kernels.of(&self.device, variant);
        let group = |label, layout, entries: &[wgpu::BindGroupEntry<'_>]| {
            self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
        };
        let mut entries = vec![bound(0, &self.frame, None)];
        entries.extend((1..).zip(&self.buffers).map(|(binding, buffer)| bound(binding, buffer, None)));
        let texels = wgpu::BindingResource::TextureView(&self.texels);
        entries.push(wgpu::BindGroupEntry { binding: 7, resource: texels });
        let scene = group("quell scene", &pipelines.scene_layout, &entries);
        let job = bound(2, &self.jobs, Some(size_of::<layout::Job>()));
        let entries = [bound(0, &slots, None), bound(1, &planes, None), job];
        let band = group("quell band", &pipelines.band_layout, &entries);
        Ok(Bands { pipelines, scene, band, uniform, size, rows, planes, plane_count })
    }

    /// Encodes steps for the rows of a band. The uniforms are written at once: it is submitted before the next.
    fn encode(&self, bands: &Bands, rows: &Range<usize>, steps: &[Step]) -> wgpu::CommandEncoder {
        let frame = layout::Frame {
            first_row: rows.start as u32,
            rows: rows.len() as u32,
            pixels: (rows.len() * bands.size.width) as u32,
            ..bands.uniform
        };
        self.queue.write_buffer(&self.frame, 0, bytes_of(&frame));
        let mut jobs = vec![0_u8; steps.len() * JOB_STRIDE];
        for (place, (_, job)) in jobs.chunks_exact_mut(JOB_STRIDE).zip(steps) {
            place[..size_of::<layout::Job>()].copy_from_slice(bytes_of(job));
        }
        self.queue.write_buffer(&self.jobs, 0, &jobs);
        let label = Some("quell tracer");
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, ..Default::default() });
        pass.set_bind_group(0, &bands.scene, &[]);
        for (index, (kernel, _)) in steps.iter().enumerate() {
            pass.set_pipeline(bands.pipelines.of(*kernel));
            pass.set_bind_group(1, &bands.band, &[(index * JOB_STRIDE) as u32]);
            let groups = |n: usize| (n as u32).div_ceil(kernels::GROUP);
            pass.dispatch_workgroups(groups(bands.size.width), groups(rows.len()), 1);
        }
        drop(pass);
        encoder
    }
}

/// A buffer, or its first bytes.
fn bound(binding: u32, buffer: &wgpu::Buffer, bytes: Option<usize>) -> wgpu::BindGroupEntry<'_> {
    let size = bytes.and_then(|bytes| wgpu::BufferSize::new(bytes as u64));
    let resource = wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size });
    wgpu::BindGroupEntry { binding, resource }
}

/// Makes buffers and textures that hold something.
struct Uploaded<'a> {
    device: &'a wgpu::Device,
    queue: &'a wgpu::Queue,
}

impl Uploaded<'_> {
    fn uniform(&self, label: &str, bytes: usize) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    fn storage(&self, what: &'static str, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
        let limits = self.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let needed = bytes.len() as u64;
        if needed > limit {
            return Err(GpuError::TooLarge { what, needed, limit });
        }
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: needed,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    fn texels(&self, texels: &[[u8; 4]], layers: u32) -> Result<wgpu::TextureView, GpuError> {
        let layer_texels = (HEAP_WIDTH * HEAP_WIDTH) as usize;
        let most = self.device.limits().max_texture_array_layers;
        if layers > most {
            let bytes = |layers: u32| u64::from(layers) * layer_texels as u64 * 4;
            return Err(GpuError::TooLarge { what: "textures", needed: bytes(layers), limit: bytes(most) });
        }
        // A scene without textures has one texel.
        let height = if texels.is_empty() { 1 } else { HEAP_WIDTH };
        let width = if texels.is_empty() { 1 } else { HEAP_WIDTH };
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("quell texels"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        for (layer, texels) in (0..).zip(texels.chunks(layer_texels)) {
            let mut texels = texels.to_vec();
            let rows = texels.len().div_ceil(HEAP_WIDTH as usize);
            texels.resize(rows * HEAP_WIDTH as usize, [0; 4]);
            let to = wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                ..texture.as_image_copy()
            };
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(HEAP_WIDTH * 4), rows_per_image: None };
            let extent = wgpu::Extent3d { width: HEAP_WIDTH, height: rows as u32, depth_or_array_layers: 1 };
            self.queue.write_texture(to, cast_slice(&texels), layout, extent);
        }
        let dimension = Some(wgpu::TextureViewDimension::D2Array);
        Ok(texture.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() }))
    }
}
