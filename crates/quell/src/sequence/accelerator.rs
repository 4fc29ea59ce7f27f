//! Stages that a host may run on a device, such as a GPU: plain numbers in and out.
//!
//! The filter itself opens no device and waits for none. It hands a stage to whoever was given to
//! [`super::SequenceDenoiser::with_accelerator`], and takes what comes back.

use super::estimate::EstimateJob;
use super::finish::FinishJob;
use super::settings::Wavelet;
use crate::error::Error;
use crate::frame::Rgb;
use crate::par;
use crate::plane::Size;
use crate::stages::wavelet::{levels, reach_of, tolerance};
use crate::window::{Class, Features, LightSlot, LocalFeatures, PreparedFrame, Rows};
use std::ops::Range;

/// Runs stages of the filter in the place of this processor. Shared by all filters of a job.
pub trait Accelerator: std::fmt::Debug + Send + Sync {
    /// What computes, as files and messages name it: results of two that differ in name may differ in bits.
    fn name(&self) -> String;

    /// Stage 3 ([`crate::sequence`], `stages/wavelet`): filters every light of `WaveletJob::lights` and hands each back
    /// with `WaveletJob::store`.
    ///
    /// # Errors
    /// A sentence for the user. The filter gives up what it holds: no other back end takes over.
    fn wavelet(&self, job: &mut WaveletJob<'_>) -> Result<(), String>;

    /// Begins a run of frames that follow each other, which stay there while the filter's window holds them. `None`:
    /// only [`Accelerator::wavelet`] runs there.
    fn window(&self) -> Option<Box<dyn AcceleratedWindow>> {
        None
    }

    /// What passes on the device took since the last call, where it was made to time them: name, milliseconds of the device, and how
    /// often it ran.
    fn take_times(&self) -> Vec<(&'static str, f64, usize)> {
        Vec::new()
    }

    /// What the user should know of how it went; `all`: also where everything went well, such as memory that it
    /// took.
    fn notes(&self, all: bool) -> Vec<String> {
        let _ = all;
        Vec::new()
    }
}

/// Frames of one filter that are kept by an [`Accelerator`], until a cut or the end.
pub trait AcceleratedWindow: std::fmt::Debug + Send {
    /// Stages `gather` to `residual`: what [`EstimateJob`] asks for is handed back with its `store` functions. False: this frame is not
    /// for it ([`EstimateJob::unfit`], or want of memory), and nothing was stored; the filter runs the others
    /// itself and asks for [`Accelerator::wavelet`].
    ///
    /// # Errors
    /// A sentence for the user. The filter gives up what it holds.
    fn estimate(&mut self, job: &mut EstimateJob<'_>) -> Result<bool, String>;

    /// Stages `stabilise` to `blend`, of a frame whose window was estimated there: the result is handed back with
    /// [`FinishJob::store`]. False: this frame is not for it, and nothing was stored; the filter runs these stages itself.
    ///
    /// # Errors
    /// A sentence for the user. The filter gives up what it holds.
    fn finish(&mut self, job: &mut FinishJob<'_>) -> Result<bool, String> {
        let _ = job;
        Ok(false)
    }
}

/// What is asked of the wavelet for one light: a twin of `stages/wavelet` needs no more, besides [`WaveletJob`]'s planes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WaveletLight {
    /// Its place in the job.
    pub light: usize,
    /// The light itself and its joint planes: colour planes that one set of weights filters.
    pub planes: usize,
    /// Levels, at least 1; level i has taps 2^i pixels apart.
    pub levels: u32,
    /// Guides stop it. Media have none.
    pub guided: bool,
    /// Tolerance of depth, relative.
    pub depth: f32,
    /// Of that tolerance, the part at the centre, and that of every pixel further.
    pub depth_reach: [f32; 2],
    /// Part of the slope's own prediction by which it may be wrong.
    pub slope_error: f32,
    /// Luminances that differ by less than this share do not differ.
    pub least_contrast: f32,
    /// How far noise of the guides loosens them.
    pub guide_noise: f32,
    /// Fall of the weight per 1 - cosine of normals.
    pub normal: f32,
    /// What multiplies the squared difference of the colours of [`Guide::Colour`]; 0: they do not count.
    pub colour: f32,
    /// Which colours these are.
    pub colour_of: Guide,
    /// Fall of the weight per 1 - cosine of the normals of [`Guide::SeenNormal`]; 0: they do not count.
    pub seen_normal: f32,
    /// Standard deviations, squared, of the luminance stop.
    pub tolerance: f32,
    /// The same where [`Guide::SeenColour`] is marked as a mirror.
    pub mirror_tolerance: f32,
    /// The same where there is little noise.
    pub low_tolerance: f32,
    /// Deviation of a compared mean, relative, at which the stop lies half between (in squares).
    pub low_noise: f32,
    /// Deviations, squared, from which a neighbour is left out of a compared mean.
    pub mean_step: f32,
    /// The most that a neighbour's variance counts, times a pixel's own.
    pub variance_ratio: f32,
}

impl WaveletLight {
    /// What `frame`'s light at that place among the lights of a job asks for.
    pub(super) fn new(light: usize, slot: &LightSlot, frame: &PreparedFrame, s: &Wavelet) -> Self {
        let squared = |colours: bool, tolerance: f32| if colours { 0.5 / (tolerance * tolerance) } else { 0.0 };
        let class = Class::of(slot.kind);
        let (seen, coloured) = (class == Class::Seen, class == Class::Coloured);
        let k = tolerance(s, slot.kind);
        // The only kinds that a mirror shows.
        let mirror = if Features::can_reflect(slot.kind) { s.mirror } else { k };
        let [has_seen_colour, has_seen_normal] = frame.features.has_seen;
        Self {
            light,
            planes: slot.planes,
            levels: levels(s, slot.kind),
            guided: class != Class::Free,
            depth: s.depth,
            depth_reach: [s.depth_near, s.depth_far],
            slope_error: s.slope_error,
            least_contrast: s.least_contrast,
            guide_noise: s.guide_noise,
            normal: s.normal,
            colour: if coloured {
                squared(frame.features.albedo.is_some(), s.albedo)
            } else {
                squared(seen && has_seen_colour, s.seen_albedo)
            },
            colour_of: if coloured { Guide::Colour } else { Guide::SeenColour },
            seen_normal: if seen && has_seen_normal { s.seen_normal } else { 0.0 },
            tolerance: k * k,
            mirror_tolerance: mirror * mirror,
            low_tolerance: s.low * s.low,
            low_noise: s.low_noise,
            mean_step: s.step * s.step,
            variance_ratio: s.variance_ratio,
        }
    }
}

/// A plane of four numbers a pixel that stops the wavelet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guide {
    /// Slope of 1/depth to the right and down, 1/depth (0: background), noise of the depth relative to it.
    Geometry,
    /// Unit normal, or zeros, and its noise.
    Normal,
    /// Colour of the surface, tone-mapped, for light that could not be divided by it; the fourth is 0.
    Colour,
    /// Colour that is seen in mirrors and through glass, tone-mapped; the fourth is 1 in a mirror, else 0.
    SeenColour,
    /// Unit normal seen there; the fourth is 0.
    SeenNormal,
}

/// Colours and variances beyond it cannot be squared and divided in 32 bits without infinities, which shaders need not
/// have.
pub(super) const MOST_COLOUR: f32 = 1e15;

/// Stage 3 of one frame, or of a band of its rows.
pub struct WaveletJob<'a> {
    frame: &'a PreparedFrame,
    local: &'a LocalFeatures,
    slots: &'a [LightSlot],
    colours: &'a Rows,
    variance: &'a Rows,
    settings: &'a Wavelet,
    filtered: Rows,
}

impl std::fmt::Debug for WaveletJob<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let size = self.size();
        f.debug_struct("WaveletJob").field("size", &size).field("lights", &self.slots.len()).finish_non_exhaustive()
    }
}

impl<'a> WaveletJob<'a> {
    /// Arguments as `stages::wavelet` takes them. Colours that shaders cannot be trusted with are an error.
    pub(super) fn new(
        frame: &'a PreparedFrame,
        local: &'a LocalFeatures,
        slots: &'a [LightSlot],
        colours: &'a Rows,
        variance: &'a Rows,
        settings: &'a Wavelet,
    ) -> Result<Self, String> {
        // NaN is within nothing.
        let within = |most: f32| move |v: &f32| v.abs() <= most;
        let (fits, fits_squared) = (within(MOST_COLOUR), within(MOST_COLOUR * MOST_COLOUR));
        if !colours.data().iter().all(fits) || !variance.data().iter().all(fits_squared) {
            return Err(format!("frame {} holds colours beyond {MOST_COLOUR:e}; take --backend cpu", frame.number));
        }
        let planes = [&local.slope[0], &local.slope[1], &local.inverse_depth, &local.depth_noise];
        if !planes.iter().all(|plane| plane.iter().all(fits)) {
            return Err(format!(
                "frame {} holds depths below {:e}; take --backend cpu",
                frame.number,
                1.0 / MOST_COLOUR
            ));
        }
        Ok(Self { frame, local, slots, colours, variance, settings, filtered: colours.clone() })
    }

    /// Extent of every plane.
    pub fn size(&self) -> Size {
        self.frame.features.size
    }

    /// The lights that are to be filtered; the others stay as they are.
    pub fn lights(&self) -> Vec<WaveletLight> {
        let asked = |(light, slot): (usize, &LightSlot)| WaveletLight::new(light, slot, self.frame, self.settings);
        self.slots.iter().enumerate().map(asked).filter(|light| light.levels > 0).collect()
    }

    /// Rows above and below a band that decide what `levels` levels make of it.
    pub fn margin(levels: u32) -> usize {
        reach_of(levels).pixels[1]
    }

    /// Some rows of a guide: for each pixel four f32, little-endian. Zeros where the frame has none.
    pub fn guide(&self, guide: Guide, rows: Range<usize>) -> Vec<u8> {
        let local = self.local;
        let three = |plane: &[Vec<f32>; 3], i: usize| plane.each_ref().map(|c| c.get(i).copied().unwrap_or(0.0));
        let four = |[x, y, z]: Rgb, w: f32| [x, y, z, w];
        self.bytes(rows, |i| match guide {
            Guide::Geometry => [local.slope[0][i], local.slope[1][i], local.inverse_depth[i], local.depth_noise[i]],
            Guide::Normal => four(three(&local.normal, i), local.normal_noise[i]),
            Guide::Colour => four(three(&local.albedo, i), 0.0),
            Guide::SeenColour => four(three(&local.seen_albedo, i), if self.local.is_mirror(i) { 1.0 } else { 0.0 }),
            Guide::SeenNormal => four(three(&local.seen_normal, i), 0.0),
        })
    }

    /// Some rows of a colour plane of a light before the wavelet, with the variance of the light's luminance as the
    /// fourth number; as [`WaveletJob::guide`]. Empty where there is no such plane.
    pub fn colours(&self, light: usize, plane: usize, rows: Range<usize>) -> Vec<u8> {
        let Some(slot) = self.slots.get(light).filter(|slot| plane < slot.planes) else { return Vec::new() };
        let w = self.size().width;
        self.bytes(rows, |i| {
            let (x, y) = (i % w, i / w);
            let [r, g, b] = [0, 1, 2].map(|c| self.colours.row(y, 3 * (slot.first + plane) + c)[x]);
            [r, g, b, self.variance.row(y, light)[x]]
        })
    }

    /// Takes rows of a filtered plane, in the form of [`WaveletJob::colours`].
    ///
    /// # Errors
    /// The rows are not the job's, or `bytes` holds not as many pixels.
    pub fn store(&mut self, light: usize, plane: usize, rows: Range<usize>, bytes: &[u8]) -> Result<(), String> {
        let (w, h) = (self.size().width, self.size().height);
        let slot = self.slots.get(light).filter(|slot| plane < slot.planes);
        let wrong = || format!("{} bytes for rows {rows:?} of plane {plane} of light {light}", bytes.len());
        let slot = slot.filter(|_| rows.start <= rows.end && rows.end <= h && bytes.len() == rows.len() * w * 16);
        let first = slot.ok_or_else(wrong)?.first;
        let channels = self.filtered.channels();
        let out = self.filtered.data_mut().get_mut(rows.start * channels * w..rows.end * channels * w);
        par::rows(out.unwrap_or_default(), (channels * w).max(1), |y, row| {
            for (x, pixel) in bytes.as_chunks::<16>().0[y * w..][..w].iter().enumerate() {
                for c in 0..3 {
                    let number = pixel.as_chunks::<4>().0[c];
                    row[(3 * (first + plane) + c) * w + x] = f32::from_le_bytes(number);
                }
            }
        });
        Ok(())
    }

    pub(super) fn filtered(self) -> Rows {
        self.filtered
    }

    fn bytes(&self, rows: Range<usize>, value: impl Fn(usize) -> [f32; 4] + Sync) -> Vec<u8> {
        let size = self.size();
        let rows = rows.start.min(size.height)..rows.end.min(size.height);
        let mut bytes = vec![0u8; rows.len() * size.width * 16];
        par::rows(&mut bytes, size.width * 16, |y, row| {
            let first = (rows.start + y) * size.width;
            for (x, pixel) in row.as_chunks_mut::<16>().0.iter_mut().enumerate() {
                for (number, v) in pixel.as_chunks_mut::<4>().0.iter_mut().zip(value(first + x)) {
                    *number = v.to_le_bytes();
                }
            }
        });
        bytes
    }
}

/// An accelerator's sentence as the filter's error.
pub(super) fn failed(accelerator: &dyn Accelerator, reason: String) -> Error {
    Error::Accelerator { name: accelerator.name(), reason }
}
