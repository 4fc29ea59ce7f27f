//! The frames of a window on a device.
//!
//! Each kind of plane is an array of textures with a layer for every frame that a window holds, so that all frames are
//! within reach of one dispatch on WebGPU's default limits, whatever they take. A frame is copied in once; the next
//! frame that needs its layer overwrites it. What stage 1 finds stays in buffers for stages 2 and 3. Nothing is submitted
//! here, and copies go through the caller's encoder.

use super::finish::Pictures;
use super::kernels::SequenceKernels;
use super::passes::TOGETHER;
use super::residual;
use super::schedule::Shown;
use super::uniforms::extent;
use crate::gpu::error::Error;
use crate::gpu::kernel::workgroups_of;
use crate::gpu::pass::WORKGROUP;
use crate::gpu::small::filled;
use crate::plane::Size;
use crate::sequence::{EstimateJob, FramePlane, GatheredLight, LightPlace};
use std::collections::BTreeMap;
use std::sync::Arc;

pub(super) const PASS: &str = "sequence_window";
/// Bytes of a pixel of a colour or a guide, of one number, and of a mean with its variance.
pub(super) const COLOUR: u64 = 16;
const NUMBER: u64 = 4;
const COMPARED: u64 = 16;

/// Textures of one kind of plane.
#[derive(Debug)]
pub(super) struct Array {
    texture: wgpu::Texture,
    pub(super) view: wgpu::TextureView,
    /// Which frame each layer holds.
    holds: Vec<Option<i64>>,
}

impl Array {
    /// Read by shaders, and written as `usage` says.
    pub(super) fn new(
        device: &wgpu::Device,
        format: wgpu::TextureFormat,
        size: Size,
        layers: u32,
        usage: wgpu::TextureUsages,
    ) -> Self {
        let label = Some("quell sequence frames");
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label,
            size: wgpu::Extent3d { width: extent(size).x, height: extent(size).y, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | usage,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            label,
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        Self { texture, view, holds: vec![None; layers as usize] }
    }

    pub(super) fn bytes_of_layer(&self) -> u64 {
        let texel = self.texture.format().block_copy_size(None).unwrap_or(0);
        u64::from(self.texture.width()) * u64::from(self.texture.height()) * u64::from(texel)
    }

    pub(super) fn bytes(&self) -> u64 {
        self.bytes_of_layer() * self.holds.len() as u64
    }

    fn layer(&self, number: i64) -> u32 {
        layer(number, self.holds.len() as u32)
    }

    /// True where the layer of frame `number` holds that frame.
    pub(super) fn holds(&self, number: i64) -> bool {
        self.holds.get(self.layer(number) as usize) == Some(&Some(number))
    }

    /// From now on it does.
    pub(super) fn hold(&mut self, number: i64) {
        let layer = self.layer(number) as usize;
        if let Some(held) = self.holds.get_mut(layer) {
            *held = Some(number);
        }
    }

    /// Copies a plane of frame `number` to its layer, unless it is there; whether it was not. `bytes`: the plane, with rows
    /// filled up to a multiple of its argument.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        number: i64,
        plane: FramePlane,
        bytes: impl FnOnce(usize) -> Vec<u8>,
    ) -> Result<bool, Error> {
        if self.holds(number) {
            return Ok(false);
        }
        self.hold(number);
        let layer = self.layer(number);
        let texture = &self.texture;
        let align = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
        let row = (texture.width() * plane.bytes() as u32).next_multiple_of(align);
        let from = filled(device, "quell sequence upload", &bytes(align as usize), wgpu::BufferUsages::COPY_SRC);
        encoder.copy_buffer_to_texture(
            wgpu::TexelCopyBufferInfo {
                buffer: &from,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                aspect: wgpu::TextureAspect::All,
            },
            wgpu::Extent3d { depth_or_array_layers: 1, ..texture.size() },
        );
        Ok(true)
    }
}

pub(super) fn format(plane: FramePlane) -> wgpu::TextureFormat {
    match plane {
        FramePlane::Surface | FramePlane::Normal | FramePlane::Picture | FramePlane::Input => {
            wgpu::TextureFormat::Rgba32Float
        }
        FramePlane::ToPrevious
        | FramePlane::ToNext
        | FramePlane::ReflectionToPrevious
        | FramePlane::ReflectionToNext => wgpu::TextureFormat::Rg32Float,
        FramePlane::Light(_) => wgpu::TextureFormat::Rg16Float,
        FramePlane::SeenColour | FramePlane::SeenNormal | FramePlane::SurfaceColour | FramePlane::Samples(_) => {
            wgpu::TextureFormat::Rgba16Float
        }
    }
}

/// Buffers of the frame at work.
#[derive(Debug)]
pub(super) struct Work {
    /// Slope and depth, normal, seen colour, seen normal; see [`crate::sequence::Guide`].
    pub(super) features: [wgpu::Buffer; 4],
    pub(super) compared: wgpu::Buffer,
    /// The largest count of all planes of the frame.
    pub(super) most: wgpu::Buffer,
    /// Of each dispatch of stage 1.
    pub(super) counts: Vec<wgpu::Buffer>,
    /// Of each plane.
    pub(super) means: Vec<wgpu::Buffer>,
    /// To which stages 2 and 3 write, and back; of each plane of a light.
    pub(super) others: Vec<wgpu::Buffer>,
    /// Of stage `residual`: sums and changes of cells.
    pub(super) cells: [wgpu::Buffer; residual::BUFFERS],
    /// More of them, where the stages after the filtered light need more than these are.
    spare: Vec<wgpu::Buffer>,
}

impl Work {
    fn buffers(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        std::iter::once(&self.most).chain(&self.cells).chain(self.pool())
    }

    /// All that hold four numbers a pixel: free once the light is filtered.
    pub(super) fn pool(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        let single = self.features.iter().chain([&self.compared]);
        single.chain(&self.counts).chain(&self.means).chain(&self.others).chain(&self.spare)
    }
}

/// The frames of a window on a device: of one run of frames that follow each other, and of one band of rows. What it encodes must be
/// submitted, in that order: it remembers which frames lie where.
#[derive(Debug)]
pub struct SequenceWindow {
    pub(super) kernels: Arc<SequenceKernels>,
    pub(super) size: Size,
    pub(super) layers: u32,
    pub(super) arrays: BTreeMap<FramePlane, Array>,
    pub(super) work: Option<Work>,
    /// What the stages after the filtered light keep.
    pub(super) pictures: Option<Pictures>,
    /// Stands in for what a frame has not.
    pub(super) absent: Array,
    /// What was encoded last.
    pub(super) shown: Option<Shown>,
}

impl SequenceWindow {
    /// Nothing is allocated for frames before [`SequenceWindow::reserve`].
    pub fn new(device: &wgpu::Device, kernels: Arc<SequenceKernels>) -> Self {
        Self {
            kernels,
            size: Size::new(0, 0),
            layers: 0,
            arrays: BTreeMap::new(),
            work: None,
            pictures: None,
            absent: Array::new(device, format(FramePlane::Surface), Size::new(1, 1), 1, wgpu::TextureUsages::empty()),
            shown: None,
        }
    }

    /// Bytes of textures and buffers on the device. Copies of a frame that is uploaded come on top.
    pub fn bytes(&self) -> u64 {
        let buffers = self.work.iter().flat_map(Work::buffers).map(wgpu::Buffer::size).sum::<u64>();
        let pictures = self.pictures.as_ref().map_or(0, Pictures::bytes);
        self.frame_bytes() * u64::from(self.layers) + buffers + pictures
    }

    /// Bytes of one frame that waits; [`SequenceWindow::layers`] of them are held.
    pub fn frame_bytes(&self) -> u64 {
        self.arrays.keys().map(|plane| plane.bytes() as u64).sum::<u64>() * self.size.pixels() as u64
    }

    /// Frames that are held.
    pub fn layers(&self) -> u32 {
        self.layers
    }

    /// Allocates what the job needs and what is not there yet. Memory that runs out is for the host to notice (an error
    /// scope).
    ///
    /// # Errors
    /// [`Error::Size`] for a limit of the device that the job is beyond: nothing was allocated.
    pub fn reserve(&mut self, device: &wgpu::Device, job: &EstimateJob<'_>) -> Result<(), Error> {
        self.reserve_frames(device, job.size(), job.most_frames().max(job.len()))?;
        for plane in (0..job.len()).flat_map(|place| needed(job, place)) {
            self.array(device, plane);
        }
        let (planes, most) = counts(&lights(job));
        let pixels = self.size.pixels() as u64;
        let work = self.work(device);
        let fill = |list: &mut Vec<wgpu::Buffer>, count: usize, label: &str| {
            while list.len() < count {
                list.push(buffer(device, label, COLOUR * pixels));
            }
        };
        // A dispatch of stage 1 binds as many means as it can take.
        fill(&mut work.means, planes.next_multiple_of(TOGETHER), "quell sequence means");
        fill(&mut work.counts, planes.div_ceil(TOGETHER), "quell sequence counts");
        fill(&mut work.others, most, "quell sequence others");
        Ok(())
    }

    /// True where pictures of the stages after the filtered light are kept.
    pub fn holds_pictures(&self) -> bool {
        self.pictures.is_some()
    }

    /// Forgets all that has another extent, or too few layers, after it has looked at the device's limits.
    pub(super) fn reserve_frames(&mut self, device: &wgpu::Device, size: Size, frames: usize) -> Result<(), Error> {
        let limits = device.limits();
        let beyond = |limit| Error::Size { pass: PASS, size, limit };
        workgroups_of(device, PASS, WORKGROUP, size)?;
        if size.width.max(size.height) > limits.max_texture_dimension_2d as usize {
            return Err(beyond("max_texture_dimension_2d"));
        }
        let layers = u32::try_from(frames).ok().filter(|n| *n <= limits.max_texture_array_layers);
        let layers = layers.ok_or_else(|| beyond("max_texture_array_layers"))?;
        if COLOUR * size.pixels() as u64 > limits.max_storage_buffer_binding_size {
            return Err(beyond("max_storage_buffer_binding_size"));
        }
        // A plane that is uploaded, with its rows filled up.
        let row = (size.width as u64 * COLOUR).next_multiple_of(u64::from(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT));
        if row * size.height as u64 > limits.max_buffer_size {
            return Err(beyond("max_buffer_size"));
        }
        if (size, layers) != (self.size, self.layers) {
            (self.size, self.layers) = (size, layers);
            self.arrays.clear();
            (self.work, self.pictures, self.shown) = (None, None, None);
        }
        Ok(())
    }

    /// The array of a plane, which is made where there is none.
    pub(super) fn array(&mut self, device: &wgpu::Device, plane: FramePlane) {
        let copied = wgpu::TextureUsages::COPY_DST;
        let (size, layers) = (self.size, self.layers);
        self.arrays.entry(plane).or_insert_with(|| Array::new(device, format(plane), size, layers, copied));
    }

    /// Buffers of the frame at work, at least those that every frame needs.
    pub(super) fn work(&mut self, device: &wgpu::Device) -> &mut Work {
        let (pixels, cells) = (self.size.pixels() as u64, residual::most_cells(self.size));
        self.work.get_or_insert_with(|| Work {
            features: std::array::from_fn(|_| buffer(device, "quell sequence features", COLOUR * pixels)),
            compared: buffer(device, "quell sequence compared", COMPARED * pixels),
            most: buffer(device, "quell sequence most", NUMBER * pixels),
            counts: Vec::new(),
            means: Vec::new(),
            others: Vec::new(),
            cells: std::array::from_fn(|_| buffer(device, "quell sequence cells", COLOUR * cells)),
            spare: Vec::new(),
        })
    }

    /// More buffers of four numbers a pixel.
    pub(super) fn add_spare(&mut self, device: &wgpu::Device, count: usize) {
        let pixels = self.size.pixels() as u64;
        let spare = &mut self.work(device).spare;
        spare.extend((0..count).map(|_| buffer(device, "quell sequence spare", COLOUR * pixels)));
    }

    /// Copies what is not there yet of the window's frame at `place`; whether there was any. Frames of a window may
    /// come in several submits.
    ///
    /// # Errors
    /// [`Error::Missing`] without [`SequenceWindow::reserve`] for this job.
    pub fn upload(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        job: &EstimateJob<'_>,
        place: usize,
    ) -> Result<bool, Error> {
        let number = job.frame(place).number;
        let mut any = false;
        for plane in needed(job, place) {
            let array = self.arrays.get_mut(&plane).ok_or(Error::Missing { pass: PASS })?;
            any |= array.upload(device, encoder, number, plane, |align| job.plane(place, plane, align))?;
        }
        Ok(any)
    }
}

fn buffer(device: &wgpu::Device, label: &str, bytes: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Where a frame lies.
pub(super) fn layer(number: i64, layers: u32) -> u32 {
    // Frames of a window follow each other, and there are as many layers as frames. The remainder fits.
    number.rem_euclid(i64::from(layers.max(1))) as u32
}

/// Those that what mirrors and glass show matters to come last: the others' dispatches need not look at it.
pub(super) fn lights(job: &EstimateJob<'_>) -> Vec<GatheredLight> {
    let mut lights = job.lights();
    lights.sort_by_key(|light| light.seen);
    lights
}

/// Planes of all lights, and the most of one.
fn counts(lights: &[GatheredLight]) -> (usize, usize) {
    let planes = || lights.iter().map(|light| light.wavelet.planes);
    (planes().sum(), planes().max().unwrap_or(0))
}

/// Planes of a frame of the window that the stages read.
fn needed(job: &EstimateJob<'_>, place: usize) -> Vec<FramePlane> {
    let frame = job.frame(place);
    let motions =
        [FramePlane::ToPrevious, FramePlane::ToNext, FramePlane::ReflectionToPrevious, FramePlane::ReflectionToNext];
    let mut planes = vec![FramePlane::Surface, FramePlane::Normal];
    planes.extend(motions.into_iter().zip(frame.has_motion).filter_map(|(plane, has)| has.then_some(plane)));
    if frame.has_seen {
        planes.extend([FramePlane::SeenColour, FramePlane::SeenNormal]);
    }
    for light in job.lights().iter().filter(|light| light.places.get(place) == Some(&LightPlace::At)) {
        planes.push(FramePlane::Light(light.first));
        planes.extend((light.first..light.first + light.wavelet.planes).map(FramePlane::Samples));
    }
    planes
}
