//! One frame of a scene in a device's memory, and the bands of rows in which it is traced.

use super::error::GpuError;
use super::jobs::{Step, frame_steps, halves_of};
use super::kernels::{self, JOB_STRIDE, Kernels, Pipelines};
use super::live::Unread;
use super::pack::Packed;
use super::pack::images::Images;
use super::results::FrameResult;
use super::shader::Variant;
use super::upload::Upload;
use super::{Run, layout, view};
use crate::primary::{PrimaryReplacement, Views};
use crate::tracer::{Control, Estimator, RenderOptions, Rendered, TraceError, Tracer};
use bytemuck::{bytes_of, cast_slice};
use quell::Size;
use std::hash::{DefaultHasher, Hasher};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Pixels of a band, at most: half a million threads fill any GPU.
const MOST_BAND_PIXELS: usize = 1 << 19;

/// Paths and shadow rays that a band may take for each sample of the frame, so that no dispatch runs for seconds.
const MOST_BAND_WORK: usize = 1 << 25;

/// Jobs of one submission, at most.
pub(super) const JOBS_AT_ONCE: usize = 64;

/// What a scene's buffers hold, in the order of their bindings, from 1.
const PARTS: [&str; 6] =
    ["triangle hierarchy", "triangles", "attributes of vertices", "instances", "materials", "lights and environment"];

/// One frame of a scene in a device's memory.
pub(super) struct Scenery {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    kernels: Arc<Kernels>,
    variant: Variant,
    buffers: [wgpu::Buffer; 6],
    /// Of what the buffers hold.
    hashes: [u64; 6],
    images: Images,
    texels: wgpu::TextureView,
    pub(super) frame: wgpu::Buffer,
    pub(super) jobs: wgpu::Buffer,
    pub(super) light_parts: layout::Lights,
    triangle_count: u32,
    units: [f32; 2],
    pub(super) band_pixels: usize,
}

/// A picture's pipelines and what lies between its passes, for one band of its rows.
pub(super) struct Bands {
    pub(super) pipelines: Arc<Pipelines>,
    scene: wgpu::BindGroup,
    band: wgpu::BindGroup,
    pub(super) size: Size,
    pub(super) rows: usize,
    pub(super) planes: wgpu::Buffer,
    plane_count: u32,
    pub(super) variant: Variant,
}

impl Bands {
    /// The rows of each band, from the top.
    pub(super) fn each(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (rows, height) = (self.rows, self.size.height);
        (0..height).step_by(rows).map(move |begin| begin..(begin + rows).min(height))
    }
}

/// The uniform of a band of these rows.
pub(super) fn uniform_of(frame: &layout::Frame, size: Size, rows: &Range<usize>) -> layout::Frame {
    layout::Frame {
        first_row: rows.start as u32,
        rows: rows.len() as u32,
        pixels: (rows.len() * size.width) as u32,
        ..*frame
    }
}

/// Jobs as their uniform buffer holds them.
pub(super) fn job_bytes(steps: &[Step]) -> Vec<u8> {
    let mut jobs = vec![0_u8; steps.len() * JOB_STRIDE];
    for (place, (_, job)) in jobs.chunks_exact_mut(JOB_STRIDE).zip(steps) {
        place[..size_of::<layout::Job>()].copy_from_slice(bytes_of(job));
    }
    jobs
}

impl Scenery {
    /// Uploads what `tracer` has prepared.
    pub(super) fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        kernels: Arc<Kernels>,
        tracer: &Tracer<'_>,
    ) -> Result<Self, GpuError> {
        let mut images = Images::new(tracer.world.scene);
        let packed = Packed::new(tracer, &images);
        let upload = Upload { device, queue };
        // All is measured before anything is made.
        for (what, bytes) in PARTS.into_iter().zip(packed.parts()) {
            upload.check(what, bytes)?;
        }
        let texels = upload.texels(&std::mem::take(&mut images.texels), images.layers)?;
        let mut number = 0;
        let buffers = packed.parts().map(|bytes| {
            number += 1;
            upload.storage(PARTS[number - 1], bytes)
        });
        Ok(Self {
            hashes: packed.parts().map(hash),
            buffers,
            images,
            texels,
            frame: upload.uniform("quell frame", size_of::<layout::Frame>()),
            jobs: upload.uniform("quell jobs", JOBS_AT_ONCE * JOB_STRIDE),
            device: device.clone(),
            queue: queue.clone(),
            kernels,
            variant: packed.variant,
            light_parts: packed.light_parts,
            triangle_count: packed.triangle_count,
            units: packed.units,
            band_pixels: MOST_BAND_PIXELS,
        })
    }

    /// Takes another frame of the same scene: uploads the parts that changed. True where a part needed a larger buffer:
    /// what was made of the old one is of no use.
    pub(super) fn update(&mut self, tracer: &Tracer<'_>) -> Result<bool, GpuError> {
        let packed = Packed::new(tracer, &self.images);
        let upload = Upload { device: &self.device, queue: &self.queue };
        for (what, bytes) in PARTS.into_iter().zip(packed.parts()) {
            upload.check(what, bytes)?;
        }
        let mut is_new = false;
        for (number, bytes) in packed.parts().into_iter().enumerate() {
            let hash = hash(bytes);
            if self.hashes[number] == hash {
                continue;
            }
            self.hashes[number] = hash;
            if self.buffers[number].size() < bytes.len() as u64 {
                self.buffers[number] = upload.storage(PARTS[number], bytes);
                is_new = true;
            } else {
                self.queue.write_buffer(&self.buffers[number], 0, bytes);
            }
        }
        let planted = self.light_parts.planted;
        self.variant = packed.variant;
        self.light_parts = layout::Lights { planted, ..packed.light_parts };
        self.triangle_count = packed.triangle_count;
        self.units = packed.units;
        Ok(is_new)
    }

    /// Bytes of each part in the device's memory, textures last.
    pub(super) fn memory(&self) -> Vec<(&'static str, u64)> {
        let texels = self.texels.texture();
        let (size, layers) = (texels.size(), u64::from(texels.depth_or_array_layers()));
        let parts = PARTS.into_iter().zip(self.buffers.iter().map(wgpu::Buffer::size));
        parts.chain([("textures", u64::from(size.width) * u64::from(size.height) * layers * 4)]).collect()
    }

    pub(super) fn variant_of(&self, options: &RenderOptions) -> Variant {
        let looks_through = self.variant.transmissive && options.primary_replacement != PrimaryReplacement::Off;
        let mirrors = self.variant.mirrors && options.primary_replacement == PrimaryReplacement::GlassAndMirrors;
        Variant { looks_through, mirrors, ..self.variant }
    }

    /// Planes of a frame and work for each of its pixels.
    pub(super) fn shape_of(options: &RenderOptions) -> (u32, usize) {
        let planes = if options.separate_halves() { layout::HALVES_PLANES } else { layout::FRAME_PLANES };
        (planes, (options.samples + options.direct_samples) as usize)
    }

    /// Traces a frame and reads it back.
    pub(super) fn render<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        views: &Views,
        number: i64,
        notes: Vec<String>,
        control: &Control<'_>,
        run: impl Run<E>,
    ) -> Result<Rendered, E> {
        let mut result = FrameResult::new(options, views, number, notes);
        self.trace_frame(options, views, number, control, run, |rows, bytes| result.take(rows, bytes))?;
        Ok(result.finish())
    }

    /// Traces a frame; what `run` copies is read later.
    pub(super) fn render_later<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        views: &Views,
        number: i64,
        notes: Vec<String>,
        run: impl Run<E>,
    ) -> Result<Unread, E> {
        let result = FrameResult::new(options, views, number, notes);
        let mut bands = Vec::new();
        self.trace_frame(options, views, number, &Control::default(), run, |rows, _| bands.push(rows.clone()))?;
        Ok(Unread { result, rows: bands })
    }

    fn trace_frame<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        views: &Views,
        number: i64,
        control: &Control<'_>,
        run: impl Run<E>,
        take: impl FnMut(&Range<usize>, &[u8]),
    ) -> Result<(), E> {
        let variant = self.variant_of(options);
        let (planes, work) = Self::shape_of(options);
        let bands = self.bands(options.size, variant, planes, work)?;
        let steps = frame_steps(options, variant);
        let uniform = self.uniform(options, views, number);
        self.trace(&bands, &uniform, &steps, control, run, take)
    }

    /// Band by band, part by part.
    pub(super) fn trace<E: From<GpuError>>(
        &self,
        bands: &Bands,
        uniform: &layout::Frame,
        steps: &[Step],
        control: &Control<'_>,
        mut run: impl Run<E>,
        mut take: impl FnMut(&Range<usize>, &[u8]),
    ) -> Result<(), E> {
        for rows in bands.each() {
            let bytes = u64::from(bands.plane_count) * (rows.len() * bands.size.width) as u64 * 4;
            let parts = steps.chunks(JOBS_AT_ONCE);
            let count = parts.len();
            for (part, steps) in parts.enumerate() {
                if control.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
                    return Err(GpuError::from(TraceError::Cancelled).into());
                }
                // The uniforms are written at once: this is submitted before the next.
                self.queue.write_buffer(&self.frame, 0, bytes_of(&uniform_of(uniform, bands.size, &rows)));
                self.queue.write_buffer(&self.jobs, 0, &job_bytes(steps));
                let label = Some("quell tracer");
                let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
                let pass = wgpu::ComputePassDescriptor { label, ..Default::default() };
                bands.record(&mut encoder.begin_compute_pass(&pass), rows.len(), steps.iter().enumerate());
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

    /// The frame's uniform, but for the rows of a band. `number` chooses the samples.
    pub(super) fn uniform(&self, options: &RenderOptions, views: &Views, number: i64) -> layout::Frame {
        layout::Frame {
            number: halves_of(number as u64),
            bounces: options.bounces,
            exact: u32::from(options.estimator == Estimator::Exact),
            fresnel_rough_damping: u32::from(options.model.fresnel_rough_damping),
            fresnel_strength: options.model.fresnel_strength,
            indirect_clamp: options.indirect_clamp,
            inner_from_world: self.units[0],
            world_from_inner: self.units[1],
            triangle_count: self.triangle_count,
            lights: self.light_parts,
            ..view::frame(views, options.size)
        }
    }

    /// Rows of a band.
    pub(super) fn rows(&self, size: Size, variant: Variant, plane_count: u32, work: usize) -> usize {
        let slot_bytes = u64::from(variant.slots()) * layout::SLOT_BYTES;
        let pixel_bytes = slot_bytes.max(u64::from(plane_count) * 4);
        let by_binding = (self.device.limits().max_storage_buffer_binding_size / pixel_bytes) as usize;
        let pixels = by_binding.min(self.band_pixels).min(MOST_BAND_WORK / work.max(1));
        (pixels / size.width.max(1)).clamp(1, size.height.max(1))
    }

    pub(super) fn bands(&self, size: Size, variant: Variant, plane_count: u32, work: usize) -> Result<Bands, GpuError> {
        let rows = self.rows(size, variant, plane_count, work);
        let pixels = (rows * size.width) as u64;
        let slot_bytes = u64::from(variant.slots()) * layout::SLOT_BYTES;
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
        Ok(Bands { pipelines, scene, band, size, rows, planes, plane_count, variant })
    }
}

impl Bands {
    /// Dispatches steps, each with its place among the jobs, for so many rows.
    pub(super) fn record<'a>(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        rows: usize,
        steps: impl Iterator<Item = (usize, &'a Step)>,
    ) {
        pass.set_bind_group(0, &self.scene, &[]);
        for (index, (kernel, _)) in steps {
            pass.set_pipeline(self.pipelines.of(*kernel));
            pass.set_bind_group(1, &self.band, &[(index * JOB_STRIDE) as u32]);
            let groups = |n: usize| (n as u32).div_ceil(kernels::GROUP);
            pass.dispatch_workgroups(groups(self.size.width), groups(rows), 1);
        }
    }
}

/// A buffer, or its first bytes.
fn bound(binding: u32, buffer: &wgpu::Buffer, bytes: Option<usize>) -> wgpu::BindGroupEntry<'_> {
    let size = bytes.and_then(|bytes| wgpu::BufferSize::new(bytes as u64));
    let resource = wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size });
    wgpu::BindGroupEntry { binding, resource }
}

fn hash(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    hasher.finish()
}

impl Packed {
    /// What the buffers hold, in the order of [`PARTS`].
    fn parts(&self) -> [&[u8]; 6] {
        [
            cast_slice(&self.nodes),
            cast_slice(&self.triangles),
            cast_slice(&self.attributes),
            cast_slice(&self.instances),
            cast_slice(&self.surfaces),
            cast_slice(&self.lights),
        ]
    }
}
