//! Frames of sequences: stages of [`quell::sequence`]'s filter on the GPU, for a program whose frames lie in memory.

use super::device::Gpu;
use super::error::Error;
use quell::Size;
use quell::gpu::wgpu::{Buffer, BufferUsages};
use quell::gpu::{SequenceWavelet, WaveletBuffers};
use quell::sequence::{Accelerator, Guide, WaveletJob, WaveletLight};
use std::ops::Range;
use std::sync::Arc;

/// Runs the wavelet of the sequence filter on a device of this program; the rest stays on the CPU.
#[derive(Debug)]
pub struct SequenceAccelerator {
    gpu: Arc<Gpu>,
    wavelet: SequenceWavelet,
}

impl SequenceAccelerator {
    /// Compiles what it runs.
    ///
    /// # Errors
    /// What the device reports.
    pub fn new(gpu: Arc<Gpu>) -> Result<Self, Error> {
        let wavelet = SequenceWavelet::new(gpu.device());
        gpu.check("compiling the sequence filter")?;
        Ok(Self { gpu, wavelet })
    }

    fn filter(&self, job: &mut WaveletJob<'_>) -> Result<(), Error> {
        let lights = job.lights();
        let Some(levels) = lights.iter().map(|light| light.levels).max() else { return Ok(()) };
        for (core, rows) in SequenceWavelet::bands(self.gpu.device(), job.size(), levels)? {
            let band = Band::new(&self.gpu, job, &lights, rows);
            for light in &lights {
                self.filter_light(job, light, &band, &core)?;
            }
        }
        Ok(())
    }

    fn filter_light(
        &self,
        job: &mut WaveletJob<'_>,
        light: &WaveletLight,
        band: &Band,
        core: &Range<usize>,
    ) -> Result<(), Error> {
        let gpu = &self.gpu;
        for (plane, [buffer, _]) in band.planes.iter().enumerate().take(light.planes) {
            gpu.queue().write_buffer(buffer, 0, &job.colours(light.light, plane, band.rows.clone()));
        }
        let planes: Vec<[&Buffer; 2]> = band.planes.iter().take(light.planes).map(|pair| pair.each_ref()).collect();
        let buffers = WaveletBuffers {
            geometry: &band.geometry,
            normals: &band.normals,
            guide_colours: if light.colour_of == Guide::Colour { &band.colours } else { &band.seen_colours },
            seen_normals: &band.seen_normals,
            compared: &band.compared,
            planes: &planes,
        };
        let mut encoder = gpu.encoder("quell host wavelet");
        let at = self.wavelet.encode(gpu.device(), &mut encoder, light, &buffers, band.size)?;
        gpu.queue().submit([encoder.finish()]);
        let bytes = band.size.pixels() as u64 * COLOUR;
        let filtered: Vec<(&Buffer, u64)> = planes.iter().map(|pair| (pair[at], bytes)).collect();
        let row = band.size.width * COLOUR as usize;
        let kept = (core.start - band.rows.start) * row..(core.end - band.rows.start) * row;
        for (plane, bytes) in gpu.read(&filtered, WHAT)?.iter().enumerate() {
            let kept = bytes.get(kept.clone()).unwrap_or_default();
            job.store(light.light, plane, core.clone(), kept).map_err(|reason| Error::Refused {
                adapter: gpu.adapter().name.clone(),
                what: WHAT.to_owned(),
                reason,
            })?;
        }
        Ok(())
    }
}

impl Accelerator for SequenceAccelerator {
    fn name(&self) -> String {
        format!("gpu: {}", self.gpu.adapter())
    }

    fn wavelet(&self, job: &mut WaveletJob<'_>) -> Result<(), String> {
        self.filter(job).map_err(|error| error.to_string())
    }
}

const WHAT: &str = "the wavelet of a frame";
/// Bytes of a pixel of a colour, and of a mean with its variance.
const COLOUR: u64 = 16;
const COMPARED: u64 = 8;

/// Some rows of a frame on the device.
struct Band {
    rows: Range<usize>,
    size: Size,
    geometry: Buffer,
    normals: Buffer,
    colours: Buffer,
    seen_colours: Buffer,
    seen_normals: Buffer,
    compared: Buffer,
    planes: Vec<[Buffer; 2]>,
}

impl Band {
    fn new(gpu: &Gpu, job: &WaveletJob<'_>, lights: &[WaveletLight], rows: Range<usize>) -> Self {
        let size = Size::new(job.size().width, rows.len());
        let buffer = |name: &str, bytes_per_pixel: u64| {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
            gpu.buffer(&format!("quell host {name}"), size.pixels() as u64 * bytes_per_pixel, usage)
        };
        let guide = |name, guide, counts: bool| {
            let buffer = buffer(name, COLOUR);
            // A new buffer holds zeros.
            if counts {
                gpu.queue().write_buffer(&buffer, 0, &job.guide(guide, rows.clone()));
            }
            buffer
        };
        let any = |counts: &dyn Fn(&WaveletLight) -> bool| lights.iter().any(counts);
        let coloured = |by: Guide| any(&|light| light.colour_of == by && light.colour > 0.0);
        let planes = lights.iter().map(|light| light.planes).max().unwrap_or(0);
        Self {
            geometry: guide("geometry", Guide::Geometry, true),
            normals: guide("normals", Guide::Normal, true),
            colours: guide("colours", Guide::Colour, coloured(Guide::Colour)),
            seen_colours: guide("seen colours", Guide::SeenColour, coloured(Guide::SeenColour)),
            seen_normals: guide("seen normals", Guide::SeenNormal, any(&|light| light.seen_normal > 0.0)),
            compared: buffer("compared", COMPARED),
            planes: (0..planes).map(|_| [buffer("light", COLOUR), buffer("filtered", COLOUR)]).collect(),
            rows,
            size,
        }
    }
}
