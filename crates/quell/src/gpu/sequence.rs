//! Stage 3 of the sequence filter on the GPU: [`crate::sequence`]'s wavelet, a light at a time.
//!
//! Planes are storage buffers of four 32-bit floats a pixel, as [`crate::sequence::WaveletJob`] gives and takes them:
//! seven bindings, the largest 16 bytes a pixel, so that bands of rows are needed only beyond 8 million pixels on
//! WebGPU's default limits. Like the rest of this module a good guest.

use super::compute::compiled;
use super::error::Error;
use super::uniform::{Uniform, Value, uniforms};
use crate::plane::Size;
use crate::sequence::{WaveletJob, WaveletLight};
use glam::UVec2;
use std::num::NonZeroU64;
use std::ops::Range;

uniforms! {
    pub(super) Level as "Level" {
        pub(super) size: UVec2,
        pub(super) step: i32,
        pub(super) guided: u32,
        pub(super) depth: f32,
        pub(super) guide_noise: f32,
        pub(super) normal: f32,
        pub(super) colour: f32,
        pub(super) seen_normal: f32,
        pub(super) tolerance: f32,
        pub(super) mirror_tolerance: f32,
        pub(super) radius: i32,
        pub(super) trusted_samples: f32,
        pub(super) place: u32,
        pub(super) given: u32,
    }
}

impl Level {
    /// What stage 3 is told; stage 2 adds to it.
    pub(super) fn new(light: &WaveletLight, size: Size, step: i32) -> Self {
        Self {
            size: extent(size),
            step,
            guided: u32::from(light.guided),
            depth: light.depth,
            guide_noise: light.guide_noise,
            normal: light.normal,
            colour: light.colour,
            seen_normal: light.seen_normal,
            tolerance: light.tolerance,
            mirror_tolerance: light.mirror_tolerance,
            radius: 0,
            trusted_samples: 0.0,
            place: 0,
            given: 0,
        }
    }
}

/// Of an image that was checked.
pub(super) fn extent(size: Size) -> UVec2 {
    UVec2::new(size.width as u32, size.height as u32)
}

/// Bytes of a pixel of a colour or a guide, and of a mean with its variance.
const COLOUR: u64 = 16;
const COMPARED: u64 = 8;
/// Pixels along each side that one workgroup covers.
const WORKGROUP: u32 = 8;
const PASS: &str = "sequence_wavelet";

/// Storage buffers of the shader, from binding 1 on, and whether it only reads them.
const BINDINGS: [(&str, bool); 7] = [
    ("geometry", true),
    ("normals", true),
    ("guide_colours", true),
    ("seen_normals", true),
    ("light", true),
    ("compared", false),
    ("filtered", false),
];

/// What stages 2 and 3 share: bindings 0 to 4, and how unlike two pixels are.
pub(super) const GUIDED: &str = concat!(
    include_str!("../sequence/weight.wgsl"),
    include_str!("../sequence/planes.wgsl"),
    include_str!("../sequence/energy.wgsl"),
);

/// Rows of a picture, and these with the rows around them that decide them.
pub type Band = (Range<usize>, Range<usize>);

/// Buffers of one image size: the caller's, with usage `STORAGE`.
#[derive(Clone, Copy, Debug)]
pub struct WaveletBuffers<'a> {
    /// [`crate::sequence::Guide::Geometry`], 16 bytes a pixel.
    pub geometry: &'a wgpu::Buffer,
    /// [`crate::sequence::Guide::Normal`].
    pub normals: &'a wgpu::Buffer,
    /// [`WaveletLight::colour_of`].
    pub guide_colours: &'a wgpu::Buffer,
    /// [`crate::sequence::Guide::SeenNormal`].
    pub seen_normals: &'a wgpu::Buffer,
    /// Of the pass itself, 8 bytes a pixel.
    pub compared: &'a wgpu::Buffer,
    /// For each colour plane of the light: that plane ([`WaveletJob::colours`]), and another of its size. Both are
    /// overwritten. The first is the light itself; it decides the weights of all.
    pub planes: &'a [[&'a wgpu::Buffer; 2]],
}

/// The wavelet, compiled for a device.
#[derive(Clone, Debug)]
pub struct SequenceWavelet {
    layout: wgpu::BindGroupLayout,
    compare: wgpu::ComputePipeline,
    filter: wgpu::ComputePipeline,
}

impl SequenceWavelet {
    /// Compiles it on the caller's device.
    pub fn new(device: &wgpu::Device) -> Self {
        Self::with_source(device, &Self::source())
    }

    /// The shader.
    pub fn source() -> String {
        [GUIDED, include_str!("../sequence/wavelet.wgsl")].join("\n")
    }

    /// [`SequenceWavelet::new`] from changed WGSL with the same bindings and entry points: for tests that plant a
    /// difference.
    pub fn with_source(device: &wgpu::Device, source: &str) -> Self {
        let entry = |binding, ty, has_dynamic_offset| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
            count: None,
        };
        let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform, true)];
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        entries.extend((1..).zip(BINDINGS).map(|(i, (_, read_only))| entry(i, storage(read_only), false)));
        let points = ["compare", "filter_level"];
        let (layout, [compare, filter]) = compiled(device, "quell sequence_wavelet", points, source, &entries);
        Self { compare, filter, layout }
    }

    /// Layout of the struct that the shader reads, and its storage buffers from binding 1 on with whether they are only
    /// read: for tests.
    pub fn interface() -> (Uniform, [(&'static str, bool); 7]) {
        (Level::layout(), BINDINGS)
    }

    /// Bands of rows, each with the rows around it that decide it, that fit in a binding of the device. One that holds
    /// the whole picture where it fits.
    ///
    /// # Errors
    /// [`Error::Size`] where not even one row fits with its margin.
    pub fn bands(device: &wgpu::Device, size: Size, levels: u32) -> Result<Vec<Band>, Error> {
        let limits = device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / COLOUR;
        Self::bands_of(most, size, levels)
    }

    /// Likewise of at most so many pixels each.
    ///
    /// # Errors
    /// Likewise.
    pub fn bands_of(most_pixels: u64, size: Size, levels: u32) -> Result<Vec<Band>, Error> {
        let beyond = Error::Size { pass: PASS, size, limit: "max_storage_buffer_binding_size" };
        let fits = usize::try_from(most_pixels / (size.width as u64).max(1)).unwrap_or(usize::MAX);
        if fits >= size.height {
            return Ok(vec![(0..size.height, 0..size.height)]);
        }
        let margin = WaveletJob::margin(levels);
        let rows = fits.checked_sub(2 * margin).filter(|rows| *rows > 0).ok_or(beyond)?;
        let band = |start: usize| {
            let end = (start + rows).min(size.height);
            (start..end, start.saturating_sub(margin)..(end + margin).min(size.height))
        };
        Ok((0..size.height).step_by(rows).map(band).collect())
    }

    /// Appends all levels of one light over images of `size` to the caller's encoder; submits nothing. Which of each
    /// pair of [`WaveletBuffers::planes`] holds the result comes back.
    ///
    /// # Errors
    /// A buffer too small or without its usage; none or too many planes; a size beyond the device's limits.
    pub fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        light: &WaveletLight,
        buffers: &WaveletBuffers<'_>,
        size: Size,
    ) -> Result<usize, Error> {
        let groups = check(device, light, buffers, size)?;
        let label = Some("quell sequence_wavelet");
        let stride = u64::from(device.limits().min_uniform_buffer_offset_alignment).max(Level::SIZE as u64);
        let uniforms = levels(device, light, size, stride);
        let pixels = size.pixels() as u64;
        // Of each plane, from the first of its buffers to the second, and back.
        let group = |from: &wgpu::Buffer, to: &wgpu::Buffer| {
            let planes = [buffers.geometry, buffers.normals, buffers.guide_colours, buffers.seen_normals, from];
            let resources = std::iter::once(bound(&uniforms, Level::SIZE as u64))
                .chain(planes.into_iter().map(|plane| bound(plane, COLOUR * pixels)))
                .chain([bound(buffers.compared, COMPARED * pixels), bound(to, COLOUR * pixels)]);
            let entries: Vec<_> =
                resources.zip(0..).map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource }).collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout: &self.layout, entries: &entries })
        };
        let ways: Vec<[wgpu::BindGroup; 2]> = buffers.planes.iter().map(|[a, b]| [group(a, b), group(b, a)]).collect();
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
        let mut at = 0;
        for level in 0..light.levels {
            // The offsets fit: levels are few, see `check`.
            let offset = (u64::from(level) * stride) as u32;
            for (k, ways) in ways.iter().enumerate() {
                pass.set_bind_group(0, &ways[at], &[offset]);
                if k == 0 {
                    pass.set_pipeline(&self.compare);
                    pass.dispatch_workgroups(groups[0], groups[1], 1);
                    pass.set_pipeline(&self.filter);
                }
                pass.dispatch_workgroups(groups[0], groups[1], 1);
            }
            at = 1 - at;
        }
        Ok(at)
    }
}

fn bound(buffer: &wgpu::Buffer, bytes: u64) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size: NonZeroU64::new(bytes) })
}

/// What every level is told, one after the other.
fn levels(device: &wgpu::Device, light: &WaveletLight, size: Size, stride: u64) -> wgpu::Buffer {
    let mut bytes = Vec::new();
    for level in 0..light.levels {
        let start = bytes.len();
        Level::new(light, size, 1 << level).write(&mut bytes);
        bytes.resize(start + stride as usize, 0);
    }
    filled(device, "quell sequence_wavelet levels", &bytes, wgpu::BufferUsages::UNIFORM)
}

/// A buffer that holds `bytes`, filled up to a multiple of four.
pub(super) fn filled(device: &wgpu::Device, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (bytes.len() as u64).next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT).max(wgpu::COPY_BUFFER_ALIGNMENT),
        usage,
        mapped_at_creation: true,
    });
    // Where the device is lost nothing is mapped, and nothing will run.
    if let Ok(mut mapped) = buffer.get_mapped_range_mut(..bytes.len() as u64) {
        mapped.copy_from_slice(bytes);
        drop(mapped);
        buffer.unmap();
    }
    buffer
}

/// The most levels whose taps lie within 16 bits.
const MOST_LEVELS: u32 = 15;

/// Everything that can be known before the device sees it; the number of workgroups.
fn check(
    device: &wgpu::Device,
    light: &WaveletLight,
    buffers: &WaveletBuffers<'_>,
    size: Size,
) -> Result<[u32; 2], Error> {
    let limits = device.limits();
    let beyond = |limit| Error::Size { pass: PASS, size, limit };
    let groups = |extent: usize| {
        u32::try_from(extent)
            .ok()
            .map(|n| n.div_ceil(WORKGROUP))
            .filter(|n| (1..=limits.max_compute_workgroups_per_dimension).contains(n))
            .ok_or_else(|| beyond("max_compute_workgroups_per_dimension"))
    };
    let groups = [groups(size.width)?, groups(size.height)?];
    let pixels = size.pixels() as u64;
    if COLOUR * pixels > limits.max_storage_buffer_binding_size {
        return Err(beyond("max_storage_buffer_binding_size"));
    }
    if buffers.planes.len() != light.planes || light.planes == 0 || !(1..=MOST_LEVELS).contains(&light.levels) {
        return Err(Error::Count { pass: PASS, expected: light.planes.max(1), found: buffers.planes.len() });
    }
    let shared = [
        ("geometry", buffers.geometry, COLOUR),
        ("normals", buffers.normals, COLOUR),
        ("guide_colours", buffers.guide_colours, COLOUR),
        ("seen_normals", buffers.seen_normals, COLOUR),
        ("compared", buffers.compared, COMPARED),
    ];
    let planes = buffers.planes.iter().flat_map(|[a, b]| [("light", *a, COLOUR), ("filtered", *b, COLOUR)]);
    for (binding, buffer, bytes) in shared.into_iter().chain(planes) {
        if !buffer.usage().contains(wgpu::BufferUsages::STORAGE) {
            return Err(Error::Usage { pass: PASS, binding, usage: "STORAGE" });
        }
        let (needed, found) = (bytes * pixels, buffer.size());
        if found < needed {
            return Err(Error::BufferSize { pass: PASS, binding, size, needed, found });
        }
    }
    Ok(groups)
}
