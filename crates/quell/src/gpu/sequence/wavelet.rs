//! The wavelet of the sequence filter, a light at a time.
//!
//! Planes are storage buffers of four 32-bit floats a pixel, as [`crate::sequence::WaveletJob`] gives and takes them:
//! seven bindings, the largest 16 bytes a pixel, so that bands of rows are needed only beyond 8 million pixels on
//! WebGPU's default limits.

use super::kernels::kernel;
use super::uniforms::LightUniforms;
use crate::gpu::error::Error;
use crate::gpu::kernel::{Bindable, Kernel};
use crate::gpu::pass::Pass;
use crate::gpu::small::filled;
use crate::gpu::timing::Timings;
use crate::gpu::uniform::Value;
use crate::plane::Size;
use crate::sequence::{WaveletJob, WaveletLight};
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Bytes of a pixel of a colour or a guide.
const COLOUR: u64 = 16;
const PASS: &str = Pass::WAVELET.name;
/// The most levels whose taps lie within 16 bits.
const MOST_LEVELS: u32 = 15;

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
    /// Of the filter itself, 16 bytes a pixel.
    pub compared: &'a wgpu::Buffer,
    /// For each colour plane of the light: that plane ([`WaveletJob::colours`]), and another of its size. Both are
    /// overwritten. The first is the light itself; it decides the weights of all.
    pub planes: &'a [[&'a wgpu::Buffer; 2]],
}

/// The wavelet, compiled for a device.
#[derive(Clone, Debug)]
pub struct SequenceWavelet {
    compare: Kernel,
    filter: Kernel,
}

impl SequenceWavelet {
    /// Compiles it on the caller's device.
    pub fn new(device: &wgpu::Device) -> Self {
        let [compare, filter] = [Pass::WAVELET_COMPARE, Pass::WAVELET].map(|pass| kernel(device, pass, None));
        Self { compare, filter }
    }

    pub(super) fn timed(self, timings: Option<&Arc<Mutex<Timings>>>) -> Self {
        Self { compare: self.compare.timed(timings), filter: self.filter.timed(timings) }
    }

    /// The same with [`Pass::WAVELET_COMPARE`] or [`Pass::WAVELET`] from changed WGSL, with the same bindings and entry point:
    /// for tests that plant a difference. Another pass changes nothing.
    #[must_use]
    pub fn with_source(&self, device: &wgpu::Device, pass: Pass, source: &str) -> Self {
        let mut changed = self.clone();
        let place = [&mut changed.compare, &mut changed.filter];
        if let Some(place) = place.into_iter().find(|kernel| kernel.pass().name == pass.name) {
            *place = kernel(device, pass, Some(source));
        }
        changed
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

    /// [`SequenceWavelet::bands`] of at most so many pixels each.
    ///
    /// # Errors
    /// [`Error::Size`] where not even one row fits with its margin.
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
    /// A buffer too small or without its usage; none or too many planes; a size beyond the device's limits. Nothing is
    /// encoded then.
    pub fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        light: &WaveletLight,
        buffers: &WaveletBuffers<'_>,
        size: Size,
    ) -> Result<usize, Error> {
        if buffers.planes.len() != light.planes || light.planes == 0 || !(1..=MOST_LEVELS).contains(&light.levels) {
            return Err(Error::Count { pass: PASS, expected: light.planes.max(1), found: buffers.planes.len() });
        }
        let mut ready = Vec::new();
        let mut at = 0;
        for level in 0..light.levels {
            let mut bytes = Vec::new();
            LightUniforms::new(light, size, 1 << level).write(&mut bytes);
            let uniforms = filled(device, "quell wavelet settings", &bytes, wgpu::BufferUsages::UNIFORM);
            let features = [buffers.geometry, buffers.normals, buffers.guide_colours, buffers.seen_normals];
            for (k, [a, b]) in buffers.planes.iter().enumerate() {
                let (from, to) = if at == 0 { (a, b) } else { (b, a) };
                let bound: Vec<_> = std::iter::once(Bindable::Uniform(&uniforms))
                    .chain(features.into_iter().chain([*from, buffers.compared, *to]).map(Bindable::Buffer))
                    .collect();
                if k == 0 {
                    // All but what the level writes.
                    let compared = bound.get(..bound.len() - 1).unwrap_or_default();
                    ready.push(self.compare.ready(device, None, compared, size)?);
                }
                ready.push(self.filter.ready(device, None, &bound, size)?);
            }
            at = 1 - at;
        }
        ready.iter().for_each(|dispatch| dispatch.encode(encoder));
        Ok(at)
    }
}
