//! What a frame of the sequence filter dispatches, in order, and what each dispatch binds.

use super::kernels::SequenceKernels;
use super::passes::TOGETHER;
use super::residual::Corrected;
use super::uniforms::*;
use super::wavelet::WaveletBuffers;
use super::window::{Array, COLOUR, PASS, SequenceWindow, Work, layer, lights};
use crate::gpu::error::Error;
use crate::gpu::kernel::Bindable;
use crate::gpu::small::filled;
use crate::gpu::uniform::Value;
use crate::plane::Size;
use crate::sequence::settings::Residual;
use crate::sequence::{EstimateJob, FramePlane, GatheredLight, Guide, LightPlace};
use crate::stages::residual::{LEVELS, Trust};
use glam::{UVec4, Vec4};
use std::collections::BTreeMap;

/// How far [`SequenceWindow::encode`] goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SequenceStage {
    /// Means, with the variance of one sample's luminance as the fourth number.
    Gather,
    /// Means, with the variance of their luminance.
    Variance,
    /// Filtered light.
    Wavelet,
    /// All: filtered light, corrected, where the job asks for that.
    Residual,
}

impl SequenceStage {
    /// All, in order.
    pub const ALL: [Self; 4] = [Self::Gather, Self::Variance, Self::Wavelet, Self::Residual];
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

/// What was encoded last, for debug views.
#[derive(Clone, Debug)]
pub(super) struct Shown {
    /// Of each light that has noise: its place in the job, the first of its planes among the means, how many planes.
    pub(super) lights: Vec<(usize, usize, usize)>,
}

impl SequenceWindow {
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
        let Self { kernels, size, layers, arrays, work, absent, shown, .. } = self;
        let work = work.as_ref().ok_or(Error::Missing { pass: PASS })?;
        let stages = Stages { kernels, device, job, size: *size, layers: *layers, arrays, work, absent };
        let lights = lights(job);
        *shown = None;
        stages.features(encoder)?;
        stages.gather(encoder, &lights)?;
        let mut first = 0;
        let mut planes = Vec::new();
        for light in &lights {
            let count = light.wavelet.planes;
            planes.extend((0..count).filter_map(|k| Some((light.wavelet.light, k, work.means.get(first + k)?))));
            if until > SequenceStage::Gather && light.wavelet.levels > 0 {
                stages.filter(encoder, light, first, until)?;
            }
            if until == SequenceStage::Residual
                && let Some(residual) = job.residual()
            {
                stages.correct(encoder, (light, first), residual)?;
            }
            first += count;
        }
        let places = lights.iter().scan(0, |first, light| {
            let place = *first;
            *first += light.wavelet.planes;
            Some((light.wavelet.light, place, light.wavelet.planes))
        });
        *shown = Some(Shown { lights: places.collect() });
        let [geometry, normals, colours, seen] = &work.features;
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
    kernels: &'w SequenceKernels,
    device: &'w wgpu::Device,
    job: &'w EstimateJob<'w>,
    size: Size,
    layers: u32,
    arrays: &'w BTreeMap<FramePlane, Array>,
    work: &'w Work,
    absent: &'w Array,
}

impl<'w> Stages<'w> {
    fn frames(&self, plane: FramePlane) -> Bindable<'w> {
        Bindable::Plane(&self.arrays.get(&plane).unwrap_or(self.absent).view)
    }

    fn uniform(&self, value: &impl Value) -> wgpu::Buffer {
        let mut bytes = Vec::new();
        value.write(&mut bytes);
        filled(self.device, "quell sequence settings", &bytes, wgpu::BufferUsages::UNIFORM)
    }

    fn features(&self, encoder: &mut wgpu::CommandEncoder) -> Result<(), Error> {
        let [seen_colours, seen_normals] = self.job.has_seen();
        let bit = |is: bool, bit: u32| if is { bit } else { 0 };
        let settings = self.uniform(&FeatureUniforms {
            size: extent(self.size),
            layer: layer(self.job.frame(self.job.centre()).number, self.layers) as i32,
            seen: bit(seen_colours, SEEN_COLOURS) | bit(seen_normals, SEEN_NORMALS),
        });
        let planes = [FramePlane::Surface, FramePlane::Normal, FramePlane::SeenColour, FramePlane::SeenNormal];
        let bound: Vec<_> = std::iter::once(Bindable::Uniform(&settings))
            .chain(planes.map(|plane| self.frames(plane)))
            .chain(self.work.features.iter().map(Bindable::Buffer))
            .collect();
        self.kernels.feature_noise.encode(self.device, encoder, None, &bound, self.size)
    }

    /// Four planes at a time.
    fn gather(&self, encoder: &mut wgpu::CommandEncoder, lights: &[GatheredLight]) -> Result<(), Error> {
        let planes: Vec<(&GatheredLight, usize)> =
            lights.iter().flat_map(|light| (0..light.wavelet.planes).map(move |k| (light, k))).collect();
        let lists = planes.chunks(TOGETHER).zip(self.work.means.chunks_exact(TOGETHER)).zip(&self.work.counts);
        for (at, ((planes, means), counts)) in lists.enumerate() {
            let settings = self.uniform(&self.gather_settings(planes, at == 0));
            let members = self.members(planes);
            let samples = |k: usize| {
                self.frames(planes.get(k).map_or(FramePlane::Surface, |(l, k)| FramePlane::Samples(l.first + k)))
            };
            let light = |k: usize| {
                self.frames(planes.get(k).map_or(FramePlane::Surface, |(light, _)| FramePlane::Light(light.first)))
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
            let bound: Vec<_> = std::iter::once(Bindable::Uniform(&settings))
                .chain(frames.map(|plane| self.frames(plane)))
                .chain((0..TOGETHER).map(samples))
                .chain((0..TOGETHER).map(light))
                .chain([Bindable::Buffer(&members)])
                .chain(means.iter().map(Bindable::Buffer))
                .chain([counts, &self.work.most].map(Bindable::Buffer))
                .collect();
            self.kernels.gather.encode(self.device, encoder, None, &bound, self.size)?;
        }
        Ok(())
    }

    fn gather_settings(&self, planes: &[(&GatheredLight, usize)], begins: bool) -> GatherUniforms {
        let (job, s) = (self.job, self.job.gather());
        let bits = |is: fn(&GatheredLight) -> bool| {
            planes.iter().enumerate().map(|(k, (light, _))| u32::from(is(light)) << k).sum::<u32>()
        };
        let (first_row, picture_height) = job.rows();
        // As the CPU does.
        let farthest = s.travel * picture_height as f32;
        let decay = |k: usize| planes.get(k).map_or(0.0, |(light, _)| light.decay);
        GatherUniforms {
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
            round_trip_share: s.round_trip_share,
            standing_normal: s.standing_normal,
            standing_reach: s.standing_reach,
            plane_normal: s.plane_normal,
            moving_normal: s.moving_normal,
            moving_depth: s.moving_depth,
            moving_weight: s.moving_weight,
            least_share: s.least_share,
            same_noise: s.same_noise,
            seen_albedo: s.seen_albedo,
            seen_normal: s.seen_normal,
            seen_alike: s.seen_alike,
            light_deviations: s.light_deviations,
            light_deviations_high: s.light_deviations_high,
            light_noise: s.light_noise,
            light_contrast: s.light_contrast,
            seen: bits(|light| light.seen),
            reflected: bits(|light| light.reflected),
            planes: planes.len() as u32,
            begins: u32::from(begins),
            decay: Vec4::new(decay(0), decay(1), decay(2), decay(3)),
        }
    }

    /// The shader's `WindowFrame` of every frame.
    fn members(&self, planes: &[(&GatheredLight, usize)]) -> wgpu::Buffer {
        let mut bytes = Vec::new();
        for place in 0..self.job.len() {
            let frame = self.job.frame(place);
            let [to_previous, to_next, reflection_to_previous, reflection_to_next] = frame.has_motion;
            let has = [
                (to_previous, HAS_TO_PREVIOUS),
                (to_next, HAS_TO_NEXT),
                (reflection_to_previous, HAS_REFLECTION_TO_PREVIOUS),
                (reflection_to_next, HAS_REFLECTION_TO_NEXT),
                (frame.has_seen, HAS_SEEN),
                (frame.repeats_noise, HAS_REPEATED_NOISE),
            ];
            let at = |k: usize| match planes.get(k).and_then(|(light, _)| light.places.get(place)) {
                Some(LightPlace::Black) => PLANE_BLACK,
                Some(LightPlace::At) => PLANE_THERE,
                Some(LightPlace::Unknown) | None => PLANE_UNKNOWN,
            };
            let member = FrameOfWindow {
                layer: layer(frame.number, self.layers) as i32,
                has: has.iter().filter(|(has, _)| *has).map(|(_, bit)| bit).sum(),
                pixel_angle: frame.pixel_angle,
                picture: 0,
                places: UVec4::new(at(0), at(1), at(2), at(3)),
            };
            member.write(&mut bytes);
        }
        filled(self.device, "quell sequence frames", &bytes, wgpu::BufferUsages::STORAGE)
    }

    /// Stage `residual` of a light whose filtered planes begin at `first`.
    fn correct(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (light, first): (&GatheredLight, usize),
        s: &Residual,
    ) -> Result<(), Error> {
        let missing = || Error::Missing { pass: PASS };
        let place = light.places.get(self.job.centre()).copied().unwrap_or(LightPlace::Unknown);
        if place == LightPlace::Unknown {
            return Ok(());
        }
        let corrected = Corrected {
            size: self.size,
            first_row: self.job.rows().0,
            own: self.frames(FramePlane::Samples(light.first)),
            layer: layer(self.job.frame(self.job.centre()).number, self.layers),
            is_black: place == LightPlace::Black,
            planes: self.work.means.get(first..first + light.wavelet.planes).ok_or_else(missing)?,
            buffers: &self.work.cells,
        };
        self.kernels.residual.encode(self.device, encoder, &corrected, (LEVELS.as_slice(), Trust::of_lights(s)))
    }

    /// Stages 2 and 3 of a light whose means begin at `first`. The result is where the means were.
    fn filter(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        light: &GatheredLight,
        first: usize,
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
        let [geometry, normals, seen_colours, seen_normals] = &work.features;
        let guide_colours = albedo.as_ref().unwrap_or(seen_colours);
        let s = self.job.variance();
        let settings = self.uniform(&LightUniforms {
            radius: s.radius as i32,
            trusted_samples: s.trusted_samples,
            least_window: s.least_window,
            place: (first % TOGETHER) as u32,
            given: u32::from(light.given),
            ..LightUniforms::new(wavelet, self.size, 1)
        });
        let given = given.as_ref().unwrap_or(&work.most);
        let buffers = [geometry, normals, guide_colours, seen_normals, mean, counts, given, other];
        let bound: Vec<_> =
            std::iter::once(Bindable::Uniform(&settings)).chain(buffers.map(Bindable::Buffer)).collect();
        self.kernels.variance.encode(device, encoder, None, &bound, self.size)?;
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
        let at = self.kernels.wavelet.encode(device, encoder, wavelet, &buffers, self.size)?;
        for (pair, mean) in pairs.iter().zip(means) {
            if let Some(result) = pair.get(at).filter(|result| **result != mean) {
                encoder.copy_buffer_to_buffer(result, 0, mean, 0, COLOUR * self.size.pixels() as u64);
            }
        }
        Ok(())
    }
}
