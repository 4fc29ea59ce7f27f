//! Stages `gather` to `wavelet` of one frame as a host may run them on a device that keeps the frames of the window: which planes
//! of which frames are needed, what is asked of each light, and where the result goes.
//!
//! A frame's planes change once after it has come: motion to the next frame is known when that has come, too. Nobody
//! asks for it before.

use super::accelerator::{Guide, MOST_COLOUR, WaveletJob, WaveletLight};
use super::frame::LightKind;
use super::run::stages_of;
use super::settings::{Gather, SequenceSettings, Variance};
use crate::denoiser::Backend;
use crate::par;
use crate::plane::{Plane, Size};
use crate::stages::gather::{self, Gathered, decay, lit};
use crate::window::{Class, Features, LightSlot, Motion, Packed, PreparedFrame, Rows, Samples};

/// A plane of a frame of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FramePlane {
    /// 1/depth (0: background) and the position: four f32.
    Surface,
    /// Unit normal, or zeros, and 1 in a mirror or glass, else 0: four f32.
    Normal,
    /// Motion to the frame before, in pixels: two f32. Unknown motion leads [`FramePlane::FAR`] away.
    ToPrevious,
    /// Motion to the next frame. Not of the window's last: it may not be known yet.
    ToNext,
    /// Motion of what mirrors and glass show; at other pixels the surface's.
    ReflectionToPrevious,
    /// The same to the next frame.
    ReflectionToNext,
    /// Colour that mirrors and glass show, tone-mapped: four halves, the last 0.
    SeenColour,
    /// Unit normal seen there, or zeros: four halves, the last 0.
    SeenNormal,
    /// Samples of a colour plane: four halves, the last 0. Its number among all of a frame's, the same in every frame.
    Samples(usize),
    /// Mean of a light around the pixel and its deviation, below 0 where it has no noise: two halves. The number of the
    /// light's first plane.
    Light(usize),
}

impl FramePlane {
    /// Pixels to where no picture reaches.
    pub const FAR: f32 = 1e9;

    /// Bytes of a pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Surface | Self::Normal => 16,
            Self::Light(_) => 4,
            _ => 8,
        }
    }
}

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

/// Stages `gather` to `wavelet` of one frame, or of a band of its rows.
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

    /// The most frames that a window holds.
    pub fn most_frames(&self) -> usize {
        let frames = self.settings.gather.frames as usize;
        if self.settings.gather.future { 2 * frames + 1 } else { frames + 1 }
    }

    /// Settings of `gather` of this frame.
    pub fn gather(&self) -> Gather {
        gather::settings_of(&self.settings.gather, &self.here().features)
    }

    /// Settings of `variance`.
    pub fn variance(&self) -> &Variance {
        &self.settings.variance
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
        let bytes = plane.bytes();
        match plane {
            FramePlane::Surface => {
                // Squares of distances stay finite.
                let near = |v: f32| v.clamp(-MOST_COLOUR, MOST_COLOUR);
                self.texels(align, bytes, |i, texel| {
                    let s = &member.features.surface[i];
                    let [x, y, z] = s.position.map(near);
                    numbers(texel, [s.inverse_depth, x, y, z]);
                })
            }
            FramePlane::Normal => self.texels(align, bytes, |i, texel| {
                let [x, y, z] = member.features.surface[i].normal;
                numbers(texel, [x, y, z, if member.features.is_mirror(i) { 1.0 } else { 0.0 }]);
            }),
            FramePlane::ToPrevious => self.motion(align, member.features.motion.get(false, false)),
            FramePlane::ToNext => self.motion(align, member.features.motion.get(true, false)),
            FramePlane::ReflectionToPrevious => self.motion(align, member.features.motion.get(false, true)),
            FramePlane::ReflectionToNext => self.motion(align, member.features.motion.get(true, true)),
            FramePlane::SeenColour => self.packed(align, member.features.seen.as_ref().map(|seen| (seen, 0))),
            FramePlane::SeenNormal => self.packed(align, member.features.seen.as_ref().map(|seen| (seen, 1))),
            FramePlane::Light(number) => {
                let light = member.slots.iter().find(|slot| slot.first == number).map(|slot| slot.light);
                let means = light.and_then(|light| member.means.places.get(light).copied().flatten());
                self.texels(align, bytes, |i, texel| {
                    let values = means.map_or([half::f16::ZERO; 2], |m| member.means.halves(m, i));
                    for (bytes, value) in texel.as_chunks_mut::<2>().0.iter_mut().zip(values) {
                        *bytes = value.to_le_bytes();
                    }
                })
            }
            FramePlane::Samples(number) => {
                let owner = member.slots.iter().find(|slot| (slot.first..slot.first + slot.planes).contains(&number));
                self.packed(
                    align,
                    owner.and_then(|slot| match member.stored[slot.light] {
                        Samples::Packed(first) => Some((&member.samples, first + number - slot.first)),
                        _ => None,
                    }),
                )
            }
        }
    }

    fn motion(&self, align: usize, motion: Option<Motion<'_>>) -> Vec<u8> {
        let known = |m: [f32; 2]| m.iter().all(|c| c.abs() <= FramePlane::FAR);
        self.texels(align, 8, |i, texel| {
            let m = motion.map_or([0.0; 2], |motion| motion.at(i));
            numbers(texel, if known(m) { m } else { [FramePlane::FAR; 2] });
        })
    }

    fn packed(&self, align: usize, plane: Option<(&Packed, usize)>) -> Vec<u8> {
        self.texels(align, 8, |i, texel| {
            let [r, g, b] = plane.map_or([half::f16::ZERO; 3], |(packed, k)| packed.halves(k, i));
            for (bytes, value) in texel.as_chunks_mut::<2>().0.iter_mut().zip([r, g, b]) {
                *bytes = value.to_le_bytes();
            }
        })
    }

    fn texels(&self, align: usize, bytes: usize, fill: impl Fn(usize, &mut [u8]) + Sync) -> Vec<u8> {
        let size = self.size();
        let stride = (size.width * bytes).next_multiple_of(align.max(1));
        let mut out = vec![0u8; stride * size.height];
        par::rows(&mut out, stride.max(1), |y, row| {
            for (x, texel) in row.chunks_exact_mut(bytes).take(size.width).enumerate() {
                fill(y * size.width + x, texel);
            }
        });
        out
    }

    /// Colour of the surface, tone-mapped, which stops undivided light ([`Guide::Colour`]): four f32 a pixel, the last
    /// 0.
    pub fn albedo(&self) -> Vec<u8> {
        let albedo = self.here().features.albedo.as_ref();
        self.texels(1, 16, |i, texel| {
            let [r, g, b] = albedo.map_or([0.0; 3], |albedo| albedo.at(0, i));
            numbers(texel, [r, g, b, 0.0]);
        })
    }

    /// Variance that the renderer gave of a light, in the light's units; -1 where it is unknown: one f32 a pixel.
    pub fn given(&self, light: usize) -> Vec<u8> {
        let given = self.slots.get(light).and_then(|slot| self.here().given_variance(slot));
        self.texels(1, 4, |i, texel| {
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

fn numbers<const N: usize>(texel: &mut [u8], values: [f32; N]) {
    for (number, value) in texel.as_chunks_mut::<4>().0.iter_mut().zip(values) {
        *number = value.to_le_bytes();
    }
}
