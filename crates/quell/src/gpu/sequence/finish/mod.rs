//! Stages `stabilise`, `residual` of the picture, and `blend` on the device, for a frame whose window is there.
//!
//! ```text
//! passes.rs     what each pass binds
//! uniforms.rs   what it reads besides planes
//! weights.rs    the nets' weights as shaders read them
//! mod.rs        what is kept of pictures, and the order of a frame's dispatches
//! ```
//!
//! Feature buffers and motion are those that stage 1 gathers along. Of every frame that takes part its picture is kept, the same of
//! the light as it came, and by what its pixels are compared. Statistics never lie in memory: each workgroup pools its own.

mod passes;
mod uniforms;
mod weights;

use super::kernels::kernel;
use super::residual::{self, Corrected};
use super::uniforms::*;
use super::window::{Array, PASS, SequenceWindow, layer};
use crate::gpu::error::Error;
use crate::gpu::kernel::{Bindable, Kernel};
use crate::gpu::pass::Pass;
use crate::gpu::small::filled;
use crate::gpu::timing::Timings;
use crate::gpu::uniform::{Uniform, Value};
use crate::kernels::conv::GRID;
use crate::plane::Size;
use crate::sequence::{FinishJob, FramePlane};
use crate::stages::residual::{PICTURE_LEVELS, Trust};
use crate::stages::{blend, stabilise};
use glam::UVec4;
use passes::{ACTIVATIONS, SIGNATURES};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use uniforms::FinishUniforms;

pub(in crate::gpu) use weights::{LAST_LAYER, SHARE_NET};

/// The most places in other frames where a pixel is averaged: `stabilise.frames` of the largest, on both sides.
pub(in crate::gpu) const MOST_VISITS: u32 = 16;

pub(super) fn layout() -> Uniform {
    uniforms::layout()
}

/// These passes, compiled, and weights of the nets.
#[derive(Clone, Debug)]
pub(super) struct FinishKernels {
    kernels: Vec<Kernel>,
    stabilise: wgpu::Buffer,
    /// Of each layer; the last two are one.
    blend: Vec<wgpu::Buffer>,
}

impl FinishKernels {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let buffer = |values: &[f32]| {
            filled(device, "quell sequence nets", &weights::bytes(values), wgpu::BufferUsages::STORAGE)
        };
        let (bandwidths, share) = stabilise::nets();
        let mut both = Vec::new();
        weights::net(bandwidths, &mut both);
        weights::net(share, &mut both);
        let net = blend::net();
        let [_, layers @ .., last] = &net.layers;
        let mut all = vec![Vec::new()];
        weights::first(net, &mut all[0]);
        for layer in layers {
            let mut values = Vec::new();
            weights::layer(layer, &mut values);
            all.push(values);
        }
        if let Some(values) = all.last_mut() {
            weights::layer(last, values);
        }
        let kernels = Pass::FINISH.iter().map(|pass| kernel(device, *pass, None)).collect();
        Self { kernels, stabilise: buffer(&both), blend: all.iter().map(|values| buffer(values)).collect() }
    }

    pub(super) fn timed(self, timings: Option<&Arc<Mutex<Timings>>>) -> Self {
        Self { kernels: self.kernels.into_iter().map(|kernel| kernel.timed(timings)).collect(), ..self }
    }

    /// With one of them from changed WGSL.
    pub(super) fn with_source(&mut self, device: &wgpu::Device, pass: Pass, source: &str) {
        if let Some(place) = self.kernels.iter_mut().find(|kernel| kernel.pass().name == pass.name) {
            *place = kernel(device, pass, Some(source));
        }
    }

    fn of(&self, pass: &Pass) -> Result<&Kernel, Error> {
        self.kernels.iter().find(|kernel| kernel.pass().name == pass.name).ok_or(Error::Missing { pass: PASS })
    }
}

/// What is kept for them on the device, besides feature buffers and buffers of the frame at work.
#[derive(Debug)]
pub(super) struct Pictures {
    /// Frames that are kept.
    layers: u32,
    /// [`FramePlane::Picture`], `Input` and, where frames have it, `SurfaceColour`.
    arrays: BTreeMap<FramePlane, Array>,
    /// By what pixels are compared, in four parts.
    signatures: [Array; 4],
    /// Activations of the net: at full size what the first layer and the last give, and the second; two at half the size; two at a
    /// quarter.
    hidden: [Array; 6],
    /// Row of the picture at which the images begin: their grid is the picture's.
    first_row: usize,
}

impl Pictures {
    fn bytes_of_frame(&self) -> u64 {
        self.arrays.values().chain(&self.signatures).map(Array::bytes_of_layer).sum()
    }

    pub(super) fn bytes(&self) -> u64 {
        self.bytes_of_frame() * u64::from(self.layers) + self.hidden.iter().map(Array::bytes).sum::<u64>()
    }
}

/// What an encoder makes once it has run: buffers of four 32-bit floats a pixel, valid until the window encodes again.
#[derive(Debug)]
pub struct Finished<'w> {
    /// The stabilised picture, corrected, and its coverage.
    pub steady: &'w wgpu::Buffer,
    /// Shares of input, wavelet's picture and stabilised one; the expected error.
    pub shares: &'w wgpu::Buffer,
    /// What the kernel multiplies the mixture by; the coverage.
    pub gain: &'w wgpu::Buffer,
}

/// Extents of the net's images for a picture of that extent: at full size, half and a quarter.
fn extents(size: Size, first_row: usize) -> [Size; 3] {
    let above = first_row % GRID;
    let whole = Size::new(size.width.next_multiple_of(GRID), (above + size.height).next_multiple_of(GRID));
    [whole, Size::new(whole.width / 2, whole.height / 2), Size::new(whole.width / 4, whole.height / 4)]
}

/// Buffers of the frame at work that these stages take.
const BUFFERS: usize = 8;

impl SequenceWindow {
    /// Allocates what the job needs and what is not there yet, as [`SequenceWindow::reserve`].
    ///
    /// # Errors
    /// [`Error::Size`] for a limit of the device that the job is beyond: nothing was allocated.
    pub fn reserve_finish(&mut self, device: &wgpu::Device, job: &FinishJob<'_>) -> Result<(), Error> {
        let size = job.size();
        let [padded, ..] = extents(size, job.rows().0);
        if padded.width.max(padded.height) > device.limits().max_texture_dimension_2d as usize {
            return Err(Error::Size { pass: PASS, size, limit: "max_texture_dimension_2d" });
        }
        self.reserve_frames(device, size, job.most_frames().max(job.len()))?;
        // No more than there are frames of feature buffers, whose number fits.
        let layers = job.most_pictures().max(job.len()) as u32;
        for plane in (0..job.len()).flat_map(|place| features(job, place)) {
            self.array(device, plane);
        }
        let work = self.work(device);
        let spare = BUFFERS.saturating_sub(work.pool().count());
        self.add_spare(device, spare);
        let first_row = job.rows().0;
        if self.pictures.as_ref().is_some_and(|p| p.layers != layers || p.first_row != first_row) {
            self.pictures = None;
        }
        let stored = wgpu::TextureUsages::STORAGE_BINDING;
        let pictures = self.pictures.get_or_insert_with(|| {
            let [whole, half, quarter] = extents(size, first_row);
            let hidden = [(whole, 4), (whole, 4), (half, 8), (half, 8), (quarter, 8), (quarter, 8)];
            Pictures {
                layers,
                arrays: BTreeMap::new(),
                signatures: std::array::from_fn(|_| Array::new(device, SIGNATURES, size, layers, stored)),
                hidden: hidden.map(|(size, layers)| Array::new(device, ACTIVATIONS, size, layers, stored)),
                first_row,
            }
        });
        for plane in (0..job.len()).flat_map(|place| picture_planes(job, place)) {
            let copied = wgpu::TextureUsages::COPY_DST;
            let new = || Array::new(device, super::window::format(plane), size, layers, copied);
            pictures.arrays.entry(plane).or_insert_with(new);
        }
        self.kernels.finish(device);
        Ok(())
    }

    /// Copies what is not there yet of the job's frame at `place`; whether there was any.
    ///
    /// # Errors
    /// [`Error::Missing`] without [`SequenceWindow::reserve_finish`] for this job.
    pub fn upload_finish(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        job: &FinishJob<'_>,
        place: usize,
    ) -> Result<bool, Error> {
        let missing = || Error::Missing { pass: PASS };
        let number = job.frame(place).number;
        let pictures = self.pictures.as_mut().ok_or_else(missing)?;
        let mut any = false;
        let kept = features(job, place).into_iter().map(|plane| (plane, false));
        for (plane, is_picture) in kept.chain(picture_planes(job, place).into_iter().map(|plane| (plane, true))) {
            let arrays = if is_picture { &mut pictures.arrays } else { &mut self.arrays };
            let array = arrays.get_mut(&plane).ok_or_else(missing)?;
            any |= array.upload(device, encoder, number, plane, |align| job.plane(place, plane, align))?;
        }
        Ok(any)
    }

    /// Appends the stages of the job to the caller's encoder, after the copies that are still missing.
    ///
    /// # Errors
    /// As [`SequenceWindow::upload_finish`].
    pub fn encode_finish(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        job: &FinishJob<'_>,
    ) -> Result<Finished<'_>, Error> {
        for place in 0..job.len() {
            self.upload_finish(device, encoder, job, place)?;
        }
        self.shown = None;
        for place in 0..job.len() {
            let number = job.frame(place).number;
            if self.signatures()?.holds(number) {
                continue;
            }
            self.stages(device, job)?.signature(encoder, place)?;
            self.signatures()?.hold(number);
        }
        self.stages(device, job)?.run(encoder)
    }

    /// The first of four arrays, which stands for all.
    fn signatures(&mut self) -> Result<&mut Array, Error> {
        let pictures = self.pictures.as_mut().ok_or(Error::Missing { pass: PASS })?;
        Ok(&mut pictures.signatures[0])
    }

    fn stages<'w, 'j>(&'w self, device: &'j wgpu::Device, job: &'j FinishJob<'j>) -> Result<Stages<'w, 'j>, Error> {
        let missing = || Error::Missing { pass: PASS };
        let (Some(work), Some(pictures)) = (&self.work, &self.pictures) else { return Err(missing()) };
        let pool: Vec<&wgpu::Buffer> = work.pool().take(BUFFERS).collect();
        Ok(Stages {
            window: self,
            pictures,
            kernels: self.kernels.finish(device),
            device,
            job,
            frames: members(device, job, self.layers, pictures.layers),
            settings: FinishUniforms::new(job),
            brightness: &work.most,
            cells: &work.cells,
            buffers: pool.try_into().map_err(|_| missing())?,
        })
    }
}

/// What is encoded for one frame.
struct Stages<'w, 'j> {
    window: &'w SequenceWindow,
    pictures: &'w Pictures,
    kernels: &'w FinishKernels,
    device: &'j wgpu::Device,
    job: &'j FinishJob<'j>,
    frames: wgpu::Buffer,
    settings: FinishUniforms,
    brightness: &'w wgpu::Buffer,
    cells: &'w [wgpu::Buffer; residual::BUFFERS],
    buffers: [&'w wgpu::Buffer; BUFFERS],
}

impl<'w> Stages<'w, '_> {
    fn array(&self, plane: FramePlane) -> Bindable<'w> {
        let found = self.window.arrays.get(&plane).or(self.pictures.arrays.get(&plane));
        Bindable::Plane(&found.unwrap_or(&self.window.absent).view)
    }

    fn uniform(&self, value: &impl Value) -> wgpu::Buffer {
        let mut bytes = Vec::new();
        value.write(&mut bytes);
        filled(self.device, "quell sequence settings", &bytes, wgpu::BufferUsages::UNIFORM)
    }

    fn pass(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (pass, size): (&Pass, Size),
        settings: &impl Value,
        bound: &[Bindable<'_>],
    ) -> Result<(), Error> {
        let settings = self.uniform(settings);
        let bound: Vec<_> = std::iter::once(Bindable::Uniform(&settings)).chain(bound.iter().copied()).collect();
        self.kernels.of(pass)?.encode(self.device, encoder, None, &bound, size)
    }

    fn signature(&self, encoder: &mut wgpu::CommandEncoder, place: usize) -> Result<(), Error> {
        let planes = [FramePlane::Normal, FramePlane::SeenColour, FramePlane::SeenNormal, FramePlane::SurfaceColour];
        let bound: Vec<_> = std::iter::once(Bindable::Buffer(&self.frames))
            .chain(planes.map(|plane| self.array(plane)))
            .chain([self.array(FramePlane::Picture)])
            .chain(self.pictures.signatures.each_ref().map(|array| Bindable::Plane(&array.view)))
            .collect();
        let settings = FinishUniforms { centre: place as i32, ..self.settings };
        self.pass(encoder, (&Pass::SIGNATURE, self.job.size()), &settings, &bound)
    }

    fn run(self, encoder: &mut wgpu::CommandEncoder) -> Result<Finished<'w>, Error> {
        use FramePlane::{
            Input, Normal, Picture, ReflectionToNext, ReflectionToPrevious, SeenColour, SeenNormal, Surface,
            SurfaceColour, ToNext, ToPrevious,
        };
        let size = self.job.size();
        let [steady, differences, known, judged, shares, mixture, changed, gain] = self.buffers;
        let buffer = Bindable::Buffer;
        let window = buffer(&self.frames);
        let planes = |planes: &[FramePlane]| planes.iter().map(|plane| self.array(*plane)).collect::<Vec<_>>();
        let followed =
            planes(&[Surface, Normal, ToPrevious, ToNext, ReflectionToPrevious, ReflectionToNext, Picture, Input]);
        let [picture, input] = [self.array(Picture), self.array(Input)];
        let brightness = buffer(self.brightness);
        let s = &self.settings;

        let bound = [&[window], followed.as_slice(), &[buffer(differences), buffer(known)]].concat();
        self.pass(encoder, (&Pass::FOLLOW, size), s, &bound)?;
        self.pass(encoder, (&Pass::BRIGHTNESS, size), s, &[window, picture, buffer(steady), brightness])?;
        let signatures = self.pictures.signatures.each_ref().map(|array| Bindable::Plane(&array.view));
        let statistics = [buffer(differences), buffer(known)];
        let net = buffer(&self.kernels.stabilise);
        let bound =
            [&[window], followed.as_slice(), &signatures, &[net], &statistics, &[brightness, buffer(steady)]].concat();
        self.pass(encoder, (&Pass::STABILISE, size), s, &bound)?;

        if let Some(residual) = self.job.residual() {
            let corrected = Corrected {
                size,
                first_row: self.job.rows().0,
                own: input,
                layer: layer(self.job.frame(self.job.centre()).number, self.pictures.layers),
                is_black: false,
                planes: std::slice::from_ref(steady),
                buffers: self.cells,
            };
            let levels = (PICTURE_LEVELS.as_slice(), Trust::of_picture(residual));
            self.window.kernels.residual.encode(self.device, encoder, &corrected, levels)?;
        }

        let stabilised = FinishUniforms { stabilised: 1, ..*s };
        let s = &stabilised;
        self.pass(encoder, (&Pass::BRIGHTNESS, size), s, &[window, picture, buffer(steady), brightness])?;
        let [outputs, full, half, up, quarter, deep] =
            self.pictures.hidden.each_ref().map(|a| Bindable::Plane(&a.view));
        let [first, second, third, fourth, fifth, sixth, last] = self.weights()?;
        let guides = planes(&[Surface, Normal, SeenColour, SeenNormal, SurfaceColour, Picture, Input]);
        let after = [buffer(steady), brightness, buffer(judged), outputs];
        let bound = [&[window], guides.as_slice(), &[first], &statistics, &after].concat();
        self.pass(encoder, (&Pass::BLEND_READ, size), s, &bound)?;

        let above = self.pictures.first_row % GRID;
        let sizes = extents(size, self.pictures.first_row);
        let of = |image: Size, inside: Size, above: usize| FinishUniforms {
            size: extent(image),
            inside: extent(inside),
            above: above as i32,
            ..stabilised
        };
        let [whole, halved, quartered] = sizes;
        let s = of(whole, size, above);
        self.pass(encoder, (&Pass::BLEND_NET_FULL, whole), &s, &[outputs, second, full])?;
        let s = of(halved, halved, 0);
        self.pass(encoder, (&Pass::BLEND_NET_HALF, halved), &s, &[full, third, half])?;
        let s = of(quartered, quartered, 0);
        self.pass(encoder, (&Pass::BLEND_NET_QUARTER, quartered), &s, &[half, fourth, quarter])?;
        self.pass(encoder, (&Pass::BLEND_NET_DEEP, quartered), &s, &[quarter, fifth, deep])?;
        let s = of(halved, halved, 0);
        self.pass(encoder, (&Pass::BLEND_NET_UP, halved), &s, &[half, deep, sixth, up])?;
        let s = of(whole, size, above);
        self.pass(encoder, (&Pass::BLEND_OUTPUTS, size), &s, &[full, up, last, outputs])?;

        let s = &stabilised;
        let bound = [window, picture, input, outputs, buffer(steady), buffer(judged), buffer(shares), buffer(mixture)];
        self.pass(encoder, (&Pass::BLEND_MIX, size), s, &bound)?;
        self.pass(encoder, (&Pass::BLEND_CHANGE, size), s, &[outputs, buffer(mixture), buffer(changed)])?;
        let bound = [mixture, changed, judged, gain].map(buffer);
        self.pass(encoder, (&Pass::BLEND_GAIN, size), s, &bound)?;
        Ok(Finished { steady, shares, gain })
    }

    /// Of each layer of `blend`'s net; the last two are one.
    fn weights(&self) -> Result<[Bindable<'w>; 7], Error> {
        let all: Vec<_> = self.kernels.blend.iter().map(Bindable::Buffer).collect();
        <[Bindable<'w>; 7]>::try_from(all).map_err(|_| Error::Missing { pass: PASS })
    }
}

/// The shader's `WindowFrame` of every frame.
fn members(device: &wgpu::Device, job: &FinishJob<'_>, layers: u32, pictures: u32) -> wgpu::Buffer {
    let mut bytes = Vec::new();
    for place in 0..job.len() {
        let frame = job.frame(place);
        let [to_previous, to_next, reflection_to_previous, reflection_to_next] = frame.has_motion;
        let [seen_colour, seen_normal] = frame.seen.unwrap_or_default();
        let has = [
            (to_previous, HAS_TO_PREVIOUS),
            (to_next, HAS_TO_NEXT),
            (reflection_to_previous, HAS_REFLECTION_TO_PREVIOUS),
            (reflection_to_next, HAS_REFLECTION_TO_NEXT),
            (frame.seen.is_some(), HAS_SEEN),
            (seen_colour, HAS_SEEN_COLOUR),
            (seen_normal, HAS_SEEN_NORMAL),
            (frame.has_surface_colour, HAS_SURFACE_COLOUR),
        ];
        let member = FrameOfWindow {
            layer: layer(frame.number, layers) as i32,
            has: has.iter().filter(|(has, _)| *has).map(|(_, bit)| bit).sum(),
            pixel_angle: 0.0,
            picture: layer(frame.number, pictures) as i32,
            places: UVec4::ZERO,
        };
        member.write(&mut bytes);
    }
    filled(device, "quell sequence frames", &bytes, wgpu::BufferUsages::STORAGE)
}

/// Feature buffers of a frame that these stages read: some of those that stage 1 reads.
fn features(job: &FinishJob<'_>, place: usize) -> Vec<FramePlane> {
    let frame = job.frame(place);
    let motions =
        [FramePlane::ToPrevious, FramePlane::ToNext, FramePlane::ReflectionToPrevious, FramePlane::ReflectionToNext];
    let mut planes = vec![FramePlane::Surface, FramePlane::Normal];
    planes.extend(motions.into_iter().zip(frame.has_motion).filter_map(|(plane, has)| has.then_some(plane)));
    if frame.seen.is_some() {
        planes.extend([FramePlane::SeenColour, FramePlane::SeenNormal]);
    }
    planes
}

/// Planes of a frame that no other stage reads.
fn picture_planes(job: &FinishJob<'_>, place: usize) -> Vec<FramePlane> {
    let colour = job.frame(place).has_surface_colour.then_some(FramePlane::SurfaceColour);
    [FramePlane::Picture, FramePlane::Input].into_iter().chain(colour).collect()
}
