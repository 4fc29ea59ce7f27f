//! Stages 1 to 3 of the sequence filter on the GPU, with the frames of the window kept there.
//!
//! Each kind of plane is an array of textures with a layer for every frame that a window holds, so that all frames are
//! within reach of one dispatch on WebGPU's default limits, whatever they take. A frame is copied in once; the next
//! frame that needs its layer overwrites it. What stage 1 finds stays in buffers for stages 2 and 3. Like the rest of
//! this module a good guest: nothing is submitted here, and copies go through the caller's encoder.

use super::error::Error;
use super::kernel::workgroups;
use super::sequence::{Level, WaveletBuffers, extent, filled};
use super::sequence_shaders::{Gather, Local, SequenceShader, SequenceShaders, TOGETHER};
use super::uniform::Value;
use crate::plane::Size;
use crate::sequence::{EstimateJob, FramePlane, GatheredLight, Guide, Place};
use glam::Vec4;
use std::collections::BTreeMap;
use std::sync::Arc;

const PASS: &str = "sequence_window";
/// Bytes of a pixel of a colour or a guide, of counts, of one number, and of a mean with its variance.
const COLOUR: u64 = 16;
const NUMBER: u64 = 4;
const COMPARED: u64 = 8;

/// How far [`SequenceWindow::encode`] goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SequenceStage {
    /// Means, with the variance of one sample's luminance as the fourth number.
    Gather,
    /// Means, with the variance of their luminance.
    Variance,
    /// All.
    Wavelet,
}

/// What an encoder makes once it has run: buffers of 32-bit floats, valid until the window encodes again.
#[derive(Debug)]
pub struct Estimated<'w> {
    /// Light of the job, its plane, and the result: four numbers a pixel.
    pub planes: Vec<(usize, usize, &'w wgpu::Buffer)>,
    /// The largest number of samples that a mean is worth, one a pixel. `None`: no light has noise.
    pub samples: Option<&'w wgpu::Buffer>,
    /// [`Guide::Geometry`], [`Guide::Normal`], [`Guide::SeenColour`], [`Guide::SeenNormal`]: four numbers a pixel.
    pub guides: [(Guide, &'w wgpu::Buffer); 4],
}

/// Textures of one kind of plane.
#[derive(Debug)]
struct Array {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    /// Which frame each layer holds.
    holds: Vec<Option<i64>>,
}

impl Array {
    fn new(device: &wgpu::Device, plane: FramePlane, size: Size, layers: u32) -> Self {
        let label = Some("quell sequence frames");
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label,
            size: wgpu::Extent3d { width: extent(size).x, height: extent(size).y, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: format(plane),
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            label,
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        Self { texture, view, holds: vec![None; layers as usize] }
    }
}

fn format(plane: FramePlane) -> wgpu::TextureFormat {
    match plane {
        FramePlane::Surface | FramePlane::Normal => wgpu::TextureFormat::Rgba32Float,
        FramePlane::ToPrevious
        | FramePlane::ToNext
        | FramePlane::ReflectionToPrevious
        | FramePlane::ReflectionToNext => wgpu::TextureFormat::Rg32Float,
        FramePlane::SeenColour | FramePlane::SeenNormal | FramePlane::Samples(_) => wgpu::TextureFormat::Rgba16Float,
    }
}

/// Buffers of the frame at work.
#[derive(Debug)]
struct Work {
    guides: [wgpu::Buffer; 4],
    compared: wgpu::Buffer,
    most: wgpu::Buffer,
    /// Of each dispatch of stage 1.
    counts: Vec<wgpu::Buffer>,
    /// Of each plane.
    means: Vec<wgpu::Buffer>,
    /// To which stages 2 and 3 write, and back; of each plane of a light.
    others: Vec<wgpu::Buffer>,
}

/// The frames of a window on a device.
#[derive(Debug)]
pub struct SequenceWindow {
    shaders: Arc<SequenceShaders>,
    size: Size,
    layers: u32,
    arrays: BTreeMap<FramePlane, Array>,
    work: Option<Work>,
    absent: Array,
}

impl SequenceWindow {
    /// Nothing is allocated for frames before [`SequenceWindow::reserve`].
    pub fn new(device: &wgpu::Device, shaders: Arc<SequenceShaders>) -> Self {
        Self {
            shaders,
            size: Size::new(0, 0),
            layers: 0,
            arrays: BTreeMap::new(),
            work: None,
            absent: Array::new(device, FramePlane::Surface, Size::new(1, 1), 1),
        }
    }

    /// Bytes of textures and buffers on the device. Copies on their way there, a frame's worth, come on top.
    pub fn bytes(&self) -> u64 {
        let buffers = self.work.iter().flat_map(|work| {
            let single = work.guides.iter().chain([&work.compared, &work.most]);
            single.chain(&work.counts).chain(&work.means).chain(&work.others)
        });
        self.frame_bytes() * u64::from(self.layers) + buffers.map(wgpu::Buffer::size).sum::<u64>()
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
        let size = job.size();
        let (layers, pixels) = (job.most_frames(), size.pixels() as u64);
        let limits = device.limits();
        let beyond = |limit| Error::Size { pass: PASS, size, limit };
        workgroups(device, PASS, size)?;
        if size.width.max(size.height) > limits.max_texture_dimension_2d as usize {
            return Err(beyond("max_texture_dimension_2d"));
        }
        let layers = u32::try_from(layers).ok().filter(|n| *n <= limits.max_texture_array_layers);
        let layers = layers.ok_or_else(|| beyond("max_texture_array_layers"))?;
        if COLOUR * pixels > limits.max_storage_buffer_binding_size {
            return Err(beyond("max_storage_buffer_binding_size"));
        }
        // A plane on its way there, with its rows filled up.
        let row = (size.width as u64 * COLOUR).next_multiple_of(u64::from(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT));
        if row * size.height as u64 > limits.max_buffer_size {
            return Err(beyond("max_buffer_size"));
        }
        if (size, layers) != (self.size, self.layers) {
            (self.size, self.layers) = (size, layers);
            self.arrays.clear();
            self.work = None;
        }
        for plane in (0..job.len()).flat_map(|place| needed(job, place)) {
            self.arrays.entry(plane).or_insert_with(|| Array::new(device, plane, size, layers));
        }
        let lights = lights(job);
        let (planes, most) = counts(&lights);
        let buffer = |label: &str, bytes: u64| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: (bytes * pixels).next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let work = self.work.get_or_insert_with(|| Work {
            guides: std::array::from_fn(|_| buffer("quell sequence guides", COLOUR)),
            compared: buffer("quell sequence compared", COMPARED),
            most: buffer("quell sequence most", NUMBER),
            counts: Vec::new(),
            means: Vec::new(),
            others: Vec::new(),
        });
        let fill = |list: &mut Vec<wgpu::Buffer>, count: usize, label: &str| {
            while list.len() < count {
                list.push(buffer(label, COLOUR));
            }
        };
        // A dispatch of stage 1 binds as many means as it can take.
        fill(&mut work.means, planes.next_multiple_of(TOGETHER), "quell sequence means");
        fill(&mut work.counts, planes.div_ceil(TOGETHER), "quell sequence counts");
        fill(&mut work.others, most, "quell sequence others");
        Ok(())
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
        let layer = layer(number, self.layers);
        let mut any = false;
        for plane in needed(job, place) {
            let array = self.arrays.get_mut(&plane).ok_or(Error::Missing { pass: PASS })?;
            let texture = &array.texture;
            let holds = array.holds.get_mut(layer as usize).ok_or(Error::Missing { pass: PASS })?;
            if *holds == Some(number) {
                continue;
            }
            *holds = Some(number);
            any = true;
            let align = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
            let bytes = job.plane(place, plane, align as usize);
            let row = (extent(self.size).x * plane.bytes() as u32).next_multiple_of(align);
            let from = filled(device, "quell sequence upload", &bytes, wgpu::BufferUsages::COPY_SRC);
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
        }
        Ok(any)
    }

    /// Appends the stages of the job up to `until` to the caller's encoder, after the copies that are still missing.
    ///
    /// # Errors
    /// As [`SequenceWindow::upload`].
    pub fn encode(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        job: &EstimateJob<'_>,
        until: SequenceStage,
    ) -> Result<Estimated<'_>, Error> {
        for place in 0..job.len() {
            self.upload(device, encoder, job, place)?;
        }
        let Self { shaders, size, layers, arrays, work, absent } = self;
        let work = work.as_ref().ok_or(Error::Missing { pass: PASS })?;
        let stages = Stages { shaders, device, job, size: *size, layers: *layers, arrays, work, absent };
        let lights = lights(job);
        let groups = workgroups(device, PASS, *size)?;
        stages.guides(encoder, groups);
        stages.gather(encoder, &lights, groups);
        let mut first = 0;
        let mut planes = Vec::new();
        for light in &lights {
            let count = light.wavelet.planes;
            planes.extend((0..count).filter_map(|k| Some((light.wavelet.light, k, work.means.get(first + k)?))));
            if until > SequenceStage::Gather && light.wavelet.levels > 0 {
                stages.filter(encoder, light, first, groups, until)?;
            }
            first += count;
        }
        let [geometry, normals, colours, seen] = &work.guides;
        let guides = [
            (Guide::Geometry, geometry),
            (Guide::Normal, normals),
            (Guide::SeenColour, colours),
            (Guide::SeenNormal, seen),
        ];
        let samples = (!planes.is_empty()).then_some(&work.most);
        Ok(Estimated { planes, samples, guides })
    }
}

/// What is encoded for one frame.
struct Stages<'w> {
    shaders: &'w SequenceShaders,
    device: &'w wgpu::Device,
    job: &'w EstimateJob<'w>,
    size: Size,
    layers: u32,
    arrays: &'w BTreeMap<FramePlane, Array>,
    work: &'w Work,
    absent: &'w Array,
}

impl<'w> Stages<'w> {
    fn frames(&self, plane: FramePlane) -> wgpu::BindingResource<'w> {
        wgpu::BindingResource::TextureView(&self.arrays.get(&plane).unwrap_or(self.absent).view)
    }

    fn told(&self, value: &impl Value) -> wgpu::Buffer {
        let mut bytes = Vec::new();
        value.write(&mut bytes);
        filled(self.device, "quell sequence told", &bytes, wgpu::BufferUsages::UNIFORM)
    }

    fn guides(&self, encoder: &mut wgpu::CommandEncoder, groups: [u32; 2]) {
        let [seen_colours, seen_normals] = self.job.has_seen();
        let told = self.told(&Local {
            size: extent(self.size),
            layer: layer(self.job.frame(self.job.centre()).number, self.layers) as i32,
            seen: u32::from(seen_colours) | u32::from(seen_normals) << 1,
        });
        let planes = [FramePlane::Surface, FramePlane::Normal, FramePlane::SeenColour, FramePlane::SeenNormal];
        let resources = std::iter::once(told.as_entire_binding())
            .chain(planes.map(|plane| self.frames(plane)))
            .chain(self.work.guides.iter().map(wgpu::Buffer::as_entire_binding));
        self.shaders.get(SequenceShader::Guides).encode(self.device, encoder, resources, groups);
    }

    /// Four planes at a time.
    fn gather(&self, encoder: &mut wgpu::CommandEncoder, lights: &[GatheredLight], groups: [u32; 2]) {
        let planes: Vec<(&GatheredLight, usize)> =
            lights.iter().flat_map(|light| (0..light.wavelet.planes).map(move |k| (light, k))).collect();
        let lists = planes.chunks(TOGETHER).zip(self.work.means.chunks_exact(TOGETHER)).zip(&self.work.counts);
        for (at, ((planes, means), counts)) in lists.enumerate() {
            let told = self.told(&self.gather_told(planes, at == 0));
            let members = self.members(planes);
            let samples = |k: usize| {
                self.frames(planes.get(k).map_or(FramePlane::Surface, |(l, k)| FramePlane::Samples(l.first + k)))
            };
            let frames = [
                FramePlane::Surface,
                FramePlane::Normal,
                FramePlane::SeenColour,
                FramePlane::SeenNormal,
                FramePlane::ToPrevious,
                FramePlane::ToNext,
                FramePlane::ReflectionToPrevious,
                FramePlane::ReflectionToNext,
            ];
            let resources = std::iter::once(told.as_entire_binding())
                .chain(frames.map(|plane| self.frames(plane)))
                .chain((0..TOGETHER).map(samples))
                .chain([members.as_entire_binding()])
                .chain(means.iter().map(wgpu::Buffer::as_entire_binding))
                .chain([counts.as_entire_binding(), self.work.most.as_entire_binding()]);
            self.shaders.get(SequenceShader::Gather).encode(self.device, encoder, resources, groups);
        }
    }

    fn gather_told(&self, planes: &[(&GatheredLight, usize)], begins: bool) -> Gather {
        let (job, s) = (self.job, self.job.gather());
        let bits = |is: fn(&GatheredLight) -> bool| {
            planes.iter().enumerate().map(|(k, (light, _))| u32::from(is(light)) << k).sum::<u32>()
        };
        let (first_row, picture_height) = job.rows();
        // As the CPU does.
        let farthest = s.travel * picture_height as f32;
        let decay = |k: usize| planes.get(k).map_or(0.0, |(light, _)| light.decay);
        Gather {
            size: extent(self.size),
            first_row: first_row as i32,
            picture_height: picture_height as i32,
            count: job.len() as i32,
            centre: job.centre() as i32,
            steps: s.frames as i32,
            future: u32::from(s.future),
            farthest,
            plane_distance: s.plane_distance,
            round_trip: s.round_trip,
            seen_albedo: s.seen_albedo,
            seen_normal: s.seen_normal,
            seen: bits(|light| light.seen),
            reflected: bits(|light| light.reflected),
            planes: planes.len() as u32,
            begins: u32::from(begins),
            decay: Vec4::new(decay(0), decay(1), decay(2), decay(3)),
        }
    }

    /// The shader's `Member` of every frame.
    fn members(&self, planes: &[(&GatheredLight, usize)]) -> wgpu::Buffer {
        let mut bytes = Vec::new();
        for place in 0..self.job.len() {
            let frame = self.job.frame(place);
            let has = frame.has_motion.into_iter().chain([frame.has_seen, frame.repeats_noise]);
            let has = has.enumerate().map(|(bit, has)| u32::from(has) << bit).sum::<u32>();
            (layer(frame.number, self.layers) as i32).write(&mut bytes);
            has.write(&mut bytes);
            frame.pixel_angle.write(&mut bytes);
            0.0f32.write(&mut bytes);
            for k in 0..TOGETHER {
                let place = planes.get(k).and_then(|(light, _)| light.places.get(place));
                let place: u32 = match place {
                    Some(Place::Black) => 0,
                    Some(Place::At) => 1,
                    Some(Place::Unknown) | None => 2,
                };
                place.write(&mut bytes);
            }
        }
        filled(self.device, "quell sequence members", &bytes, wgpu::BufferUsages::STORAGE)
    }

    /// Stages 2 and 3 of a light whose means begin at `first`. The result is where the means were.
    fn filter(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        light: &GatheredLight,
        first: usize,
        groups: [u32; 2],
        until: SequenceStage,
    ) -> Result<(), Error> {
        let (device, work) = (self.device, self.work);
        let missing = || Error::Missing { pass: PASS };
        let wavelet = &light.wavelet;
        let means = work.means.get(first..first + wavelet.planes).ok_or_else(missing)?;
        let (Some(mean), Some(other)) = (means.first(), work.others.first()) else { return Err(missing()) };
        let counts = work.counts.get(first / TOGETHER).ok_or_else(missing)?;
        let storage = wgpu::BufferUsages::STORAGE;
        let albedo = (wavelet.colour_of == Guide::Colour)
            .then(|| filled(device, "quell sequence albedo", &self.job.albedo(), storage));
        let given =
            light.given.then(|| filled(device, "quell sequence given", &self.job.given(wavelet.light), storage));
        let [geometry, normals, seen_colours, seen_normals] = &work.guides;
        let guide_colours = albedo.as_ref().unwrap_or(seen_colours);
        let s = self.job.variance();
        let told = self.told(&Level {
            radius: s.radius as i32,
            trusted_samples: s.trusted_samples,
            place: (first % TOGETHER) as u32,
            given: u32::from(light.given),
            ..Level::new(wavelet, self.size, 1)
        });
        let resources = [
            &told,
            geometry,
            normals,
            guide_colours,
            seen_normals,
            mean,
            counts,
            given.as_ref().unwrap_or(&work.most),
            other,
        ];
        let resources = resources.map(wgpu::Buffer::as_entire_binding);
        self.shaders.get(SequenceShader::Variance).encode(device, encoder, resources, groups);
        let mut copy = |from: &wgpu::Buffer, to: &wgpu::Buffer| {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, COLOUR * self.size.pixels() as u64);
        };
        if until == SequenceStage::Variance {
            copy(other, mean);
            return Ok(());
        }
        // Stage 2 has written the light itself to the other buffer, and left its joint planes.
        let pair = |(k, (mean, other))| if k == 0 { [other, mean] } else { [mean, other] };
        let pairs: Vec<[&wgpu::Buffer; 2]> = means.iter().zip(&work.others).enumerate().map(pair).collect();
        let buffers =
            WaveletBuffers { geometry, normals, guide_colours, seen_normals, compared: &work.compared, planes: &pairs };
        let at = self.shaders.wavelet.encode(device, encoder, wavelet, &buffers, self.size)?;
        for (pair, mean) in pairs.iter().zip(means) {
            if let Some(result) = pair.get(at).filter(|result| **result != mean) {
                encoder.copy_buffer_to_buffer(result, 0, mean, 0, COLOUR * self.size.pixels() as u64);
            }
        }
        Ok(())
    }
}

/// Where a frame lies.
fn layer(number: i64, layers: u32) -> u32 {
    // Frames of a window follow each other, and there are as many layers as frames. The remainder fits.
    number.rem_euclid(i64::from(layers.max(1))) as u32
}

/// Those that what mirrors and glass show matters to come last: the others' dispatches need not look at it.
fn lights(job: &EstimateJob<'_>) -> Vec<GatheredLight> {
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
    for light in job.lights().iter().filter(|light| light.places.get(place) == Some(&Place::At)) {
        planes.extend((light.first..light.first + light.wavelet.planes).map(FramePlane::Samples));
    }
    planes
}
