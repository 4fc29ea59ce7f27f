//! Stages `gather` to `residual` of one frame as a host may run them on a device that keeps the frames of the window: which planes
//! of which frames are needed, what is asked of each light, and where the result goes.
//!
//! A frame's planes change once after it has come: motion to the next frame is known when that has come, too. Nobody
//! asks for it before.

use super::accelerator::{Guide, MOST_COLOUR, WaveletJob, WaveletLight};
use super::frame::LightKind;
use super::pipeline::SequenceStage;
use super::planes::{self, FramePlane, numbers, texels};
use super::run::{most_samples, stages_of};
use super::settings::{Gather, Residual, SequenceSettings, Variance};
use crate::denoiser::Backend;
use crate::par;
use crate::plane::{Plane, Size};
use crate::stages::gather::{self, Gathered, decay, lit};
use crate::window::{Class, Features, LightSlot, PreparedFrame, Rows, Samples};

/// A frame of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WindowFrame {
    /// Its number: frames of a window follow each other.
    pub number: i64,
    /// World-space size of a pixel per unit of depth; 0 where positions are unknown.
    pub pixel_angle: f32,
    /// Whether it has [`FramePlane::ToPrevious`], `ToNext`, `ReflectionToPrevious`, `ReflectionToNext`.
    pub has_motion: [bool; 4],
    /// Whether it has what mirrors and glass show.
    pub has_seen: bool,
    /// Its noise may be the same as in another frame.
    pub repeats_noise: bool,
}

/// Where a frame of the window has a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightPlace {
    /// It is black there.
    Black,
    /// Its planes are [`FramePlane::Samples`].
    At,
    /// It was clean there and is not kept.
    Unknown,
}

impl From<gather::Place> for LightPlace {
    fn from(place: gather::Place) -> Self {
        match place {
            gather::Place::Black => Self::Black,
            gather::Place::At(_) => Self::At,
            gather::Place::Unknown => Self::Unknown,
        }
    }
}

/// What is asked of one light.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct GatheredLight {
    /// What `wavelet` is asked for, and the light's place in the job. No levels: `variance` and `wavelet` leave it as it is.
    pub wavelet: WaveletLight,
    /// Number of its first plane ([`FramePlane::Samples`]); its others follow.
    pub first: usize,
    /// Weight of a sample one frame further away.
    pub decay: f32,
    /// It is seen in mirrors and through glass, so that what is seen there counts.
    pub seen: bool,
    /// In mirrors and glass it moves by its own motion.
    pub reflected: bool,
    /// Of each frame of the window.
    pub places: Vec<LightPlace>,
    /// The renderer gave its variance: [`EstimateJob::given`].
    pub given: bool,
}

/// What this processor makes of a light, for tests of agreement.
#[derive(Clone, Debug, PartialEq)]
pub struct OnCpu {
    /// Of each plane: three channels, pixel by pixel, after `gather`.
    pub means: Vec<Vec<[f32; 3]>>,
    /// Variance of one sample's luminance.
    pub spread: Vec<f32>,
    /// Samples that the mean is worth.
    pub count: Vec<f32>,
    /// Variance of the mean's luminance, after `variance`.
    pub variance: Vec<f32>,
}

/// Stages `gather` to `residual` of one frame, or of a band of its rows.
pub struct EstimateJob<'a> {
    window: &'a [&'a PreparedFrame],
    centre: usize,
    settings: &'a SequenceSettings,
    slots: Vec<LightSlot>,
    estimated: Rows,
    samples: Plane<f32>,
}

impl std::fmt::Debug for EstimateJob<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EstimateJob").field("size", &self.size()).field("frames", &self.len()).finish_non_exhaustive()
    }
}

impl<'a> EstimateJob<'a> {
    pub(super) fn new(window: &'a [&'a PreparedFrame], centre: usize, settings: &'a SequenceSettings) -> Self {
        let here = window[centre];
        let slots = lit(window, centre);
        let mut estimated = Rows::new(here.features.size, 3 * slots.iter().map(|s| s.planes).sum::<usize>());
        // What has no noise comes out as it went in.
        let (channels, w) = (estimated.channels(), here.features.size.width);
        par::rows(estimated.data_mut(), (channels * w).max(1), |y, row| {
            for slot in &slots {
                let Samples::Own(own) = &here.stored[slot.light] else { continue };
                for (k, plane) in own.iter().enumerate() {
                    for x in 0..w {
                        let value = plane.at(y * w + x);
                        for c in 0..3 {
                            row[(3 * (slot.first + k) + c) * w + x] = value[c];
                        }
                    }
                }
            }
        });
        let samples = Plane::filled(here.features.size, 1.0);
        Self { window, centre, settings, slots, estimated, samples }
    }

    /// What shaders cannot be trusted with in this window: such a frame is not for an
    /// [`AcceleratedWindow`](super::AcceleratedWindow).
    pub fn unfit(&self) -> Option<&'static str> {
        self.window.iter().find_map(|member| member.unfit)
    }

    fn here(&self) -> &'a PreparedFrame {
        self.window[self.centre]
    }

    /// Extent of every plane.
    pub fn size(&self) -> Size {
        self.here().features.size
    }

    /// Row of the picture at which the planes begin, and rows of the picture.
    pub fn rows(&self) -> (usize, usize) {
        (self.here().features.first_row, self.here().features.picture_height)
    }

    /// Frames in the window; at least 1.
    pub fn len(&self) -> usize {
        self.window.len()
    }

    /// Never: the frame itself is there.
    pub fn is_empty(&self) -> bool {
        self.window.is_empty()
    }

    /// The place of the frame itself in the window.
    pub fn centre(&self) -> usize {
        self.centre
    }

    /// The most frames whose feature buffers a window holds.
    pub fn most_frames(&self) -> usize {
        frames_held(self.settings)
    }

    /// Settings of `gather` of this frame.
    pub fn gather(&self) -> Gather {
        gather::settings_of(&self.settings.gather, &self.here().features)
    }

    /// Settings of `variance`.
    pub fn variance(&self) -> &Variance {
        &self.settings.variance
    }

    /// Settings of `residual`; `None`: filtered light is not corrected.
    pub fn residual(&self) -> Option<&Residual> {
        SequenceStage::Residual.runs(self.settings).then_some(&self.settings.residual)
    }

    /// Which of [`FramePlane::SeenColour`] and [`FramePlane::SeenNormal`] stop the wavelet.
    pub fn has_seen(&self) -> [bool; 2] {
        self.here().features.has_seen
    }

    /// A frame of the window; the frame itself where there is no such place.
    pub fn frame(&self, place: usize) -> WindowFrame {
        let member = self.member(place);
        let last = place + 1 == self.len();
        WindowFrame {
            number: member.number,
            pixel_angle: member.features.pixel_angle,
            has_motion: [
                member.features.motion.to_previous.is_some(),
                member.features.motion.to_next.is_some() && !last,
                member.features.motion.reflection_to_previous.is_some(),
                member.features.motion.reflection_to_next.is_some() && !last,
            ],
            has_seen: member.features.seen.is_some(),
            repeats_noise: member.repeats_noise,
        }
    }

    fn member(&self, place: usize) -> &'a PreparedFrame {
        self.window.get(place).copied().unwrap_or(self.here())
    }

    /// What is asked of each light that has noise.
    pub fn lights(&self) -> Vec<GatheredLight> {
        let asked = |(light, slot): (usize, &LightSlot)| {
            let place = |m: &&PreparedFrame| LightPlace::from(gather::Place::of(m, slot.light));
            GatheredLight {
                wavelet: WaveletLight::new(light, slot, self.here(), &self.settings.wavelet),
                first: self.here().slots[slot.light].first,
                decay: decay(&self.settings.gather, slot.kind),
                seen: Class::of(slot.kind) == Class::Seen,
                reflected: Features::can_reflect(slot.kind),
                places: self.window.iter().map(place).collect(),
                given: slot.kind == LightKind::Beauty && self.here().variance.is_some(),
            }
        };
        self.slots.iter().enumerate().filter(|(_, slot)| slot.kind != LightKind::NoiseFree).map(asked).collect()
    }

    /// A plane of a frame, row by row, each row filled up to a multiple of `align` bytes. Zeros where the frame has
    /// none.
    pub fn plane(&self, place: usize, plane: FramePlane, align: usize) -> Vec<u8> {
        let member = self.member(place);
        match plane {
            FramePlane::Light(number) => {
                let light = member.slots.iter().find(|slot| slot.first == number).map(|slot| slot.light);
                let means = light.and_then(|light| member.means.places.get(light).copied().flatten());
                texels(self.size(), align, plane.bytes(), |i, texel| {
                    let values = means.map_or([half::f16::ZERO; 2], |m| member.means.halves(m, i));
                    for (bytes, value) in texel.as_chunks_mut::<2>().0.iter_mut().zip(values) {
                        *bytes = value.to_le_bytes();
                    }
                })
            }
            FramePlane::Samples(number) => {
                let owner = member.slots.iter().find(|slot| (slot.first..slot.first + slot.planes).contains(&number));
                let found = owner.and_then(|slot| match member.stored[slot.light] {
                    Samples::Packed(first) => Some((&member.samples, first + number - slot.first)),
                    _ => None,
                });
                planes::packed(self.size(), align, found)
            }
            _ => planes::of_features(&member.features, plane, align),
        }
    }

    /// Colour of the surface, tone-mapped, which stops undivided light ([`Guide::Colour`]): four f32 a pixel, the last
    /// 0.
    pub fn albedo(&self) -> Vec<u8> {
        let albedo = self.here().features.albedo.as_ref();
        texels(self.size(), 1, 16, |i, texel| {
            let [r, g, b] = albedo.map_or([0.0; 3], |albedo| albedo.at(0, i));
            numbers(texel, [r, g, b, 0.0]);
        })
    }

    /// Variance that the renderer gave of a light, in the light's units; -1 where it is unknown: one f32 a pixel.
    pub fn given(&self, light: usize) -> Vec<u8> {
        let given = self.slots.get(light).and_then(|slot| self.here().given_variance(slot));
        texels(self.size(), 1, 4, |i, texel| {
            let given = given.as_ref().map_or(f32::NAN, |given| given.data()[i]);
            numbers(texel, [if given.is_nan() { -1.0 } else { given.min(MOST_COLOUR * MOST_COLOUR) }]);
        })
    }

    /// Takes a filtered plane: for each pixel four f32, little-endian, of which three count.
    ///
    /// # Errors
    /// The plane is not the job's, or `bytes` holds not as many pixels.
    pub fn store(&mut self, light: usize, plane: usize, bytes: &[u8]) -> Result<(), String> {
        let (w, pixels) = (self.size().width, self.size().pixels());
        let slot = self.slots.get(light).filter(|slot| plane < slot.planes && bytes.len() == 16 * pixels);
        let first = slot.ok_or_else(|| format!("{} bytes for plane {plane} of light {light}", bytes.len()))?.first;
        let channels = self.estimated.channels();
        par::rows(self.estimated.data_mut(), (channels * w).max(1), |y, row| {
            for (x, pixel) in bytes.as_chunks::<16>().0[y * w..][..w].iter().enumerate() {
                for c in 0..3 {
                    row[(3 * (first + plane) + c) * w + x] = f32::from_le_bytes(pixel.as_chunks::<4>().0[c]);
                }
            }
        });
        Ok(())
    }

    /// Takes the largest number of samples that a light's mean is worth, at least 1: one f32 a pixel.
    ///
    /// # Errors
    /// `bytes` holds not as many pixels.
    pub fn store_samples(&mut self, bytes: &[u8]) -> Result<(), String> {
        if bytes.len() != 4 * self.size().pixels() {
            return Err(format!("{} bytes for counts of {}", bytes.len(), self.size()));
        }
        for (count, bytes) in self.samples.data_mut().iter_mut().zip(bytes.as_chunks::<4>().0) {
            *count = f32::from_le_bytes(*bytes);
        }
        Ok(())
    }

    pub(super) fn estimated(self) -> (Vec<LightSlot>, Rows, Plane<f32>) {
        (self.slots, self.estimated, self.samples)
    }

    /// Fills the job with what this processor makes of it: for tests of the stages after it.
    pub fn estimate_on_cpu(&mut self) {
        let (here, s, stages) = (self.here(), self.settings, stages_of(Backend::default()));
        let gathered = (stages.gather)(self.window, self.centre, &self.gather());
        let local = (stages.feature_noise)(&here.features);
        let given: Vec<_> = gathered.slots.iter().map(|slot| here.given_variance(slot)).collect();
        let pooled = (stages.variance)(&local, &gathered, &given, &s.variance, &s.wavelet);
        self.samples = most_samples(here.features.size, &gathered.moments);
        self.estimated = (stages.wavelet)(&local, &gathered.slots, gathered.colours, pooled, &s.wavelet);
        self.slots = gathered.slots;
        if self.residual().is_some() {
            let estimated = std::mem::replace(&mut self.estimated, Rows::empty());
            self.estimated = (stages.residual)(here, &self.slots, estimated, &s.residual);
        }
    }

    /// What this processor makes of the lights of [`EstimateJob::lights`] before stage 3, and of the guides (four f32 a
    /// pixel): for tests of agreement.
    pub fn on_cpu(&self) -> (Vec<OnCpu>, Vec<(Guide, Vec<u8>)>) {
        self.on_backend(Backend::Cpu)
    }

    /// The same on a chosen back end.
    pub fn on_backend(&self, backend: Backend) -> (Vec<OnCpu>, Vec<(Guide, Vec<u8>)>) {
        let (here, s, stages) = (self.here(), self.settings, stages_of(backend));
        let gathered = (stages.gather)(self.window, self.centre, &self.gather());
        let local = (stages.feature_noise)(&here.features);
        let given: Vec<_> = gathered.slots.iter().map(|slot| here.given_variance(slot)).collect();
        let pooled = (stages.variance)(&local, &gathered, &given, &s.variance, &s.wavelet);
        let Gathered { slots, colours, moments } = gathered;
        let (w, pixels) = (here.features.size.width, here.features.size.pixels());
        let channel = |rows: &Rows, c: usize| (0..pixels).map(|i| rows.row(i / w, c)[i % w]).collect::<Vec<f32>>();
        let of = |light: &GatheredLight| {
            let l = light.wavelet.light;
            let plane = |k: usize| {
                let [r, g, b] = [0, 1, 2].map(|c| channel(&colours, 3 * (slots[l].first + k) + c));
                r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect()
            };
            OnCpu {
                means: (0..slots[l].planes).map(plane).collect(),
                spread: channel(&moments, 2 * l),
                count: channel(&moments, 2 * l + 1),
                variance: channel(&pooled, l),
            }
        };
        let lights = self.lights().iter().map(of).collect();
        let guides = [Guide::Geometry, Guide::Normal, Guide::SeenColour, Guide::SeenNormal];
        let guides = match WaveletJob::new(here, &local, &slots, &colours, &pooled, &s.wavelet) {
            Ok(job) => guides.map(|guide| (guide, job.guide(guide, 0..here.features.size.height))).into(),
            Err(_) => Vec::new(),
        };
        (lights, guides)
    }
}

/// The most frames that a device holds the feature buffers of: as many as the stage that looks at most.
pub(super) fn frames_held(s: &SequenceSettings) -> usize {
    let frames = s.gather.frames.max(s.stabilise.frames) as usize;
    if s.gather.future { 2 * frames + 1 } else { frames + 1 }
}
