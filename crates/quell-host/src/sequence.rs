//! Frames of sequences: stages of [`quell::sequence`]'s filter on the GPU, for a program whose frames lie in memory.

use crate::device::{Gpu, now};
use crate::error::Error;
use crate::readback::Readback;
use crate::views::{ShowSequence, Views};
use quell::Size;
use quell::gpu::wgpu::{Buffer, BufferUsages, Device, ErrorFilter};
use quell::gpu::{self, SequenceKernels, SequenceStage, SequenceWavelet, SequenceWindow, Timing, WaveletBuffers};
use quell::sequence::{AcceleratedWindow, Accelerator, EstimateJob, FinishJob, Guide, WaveletJob, WaveletLight};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// Runs stages of the sequence filter on a device of this program, with the frames of the window and their pictures kept
/// there: `gather` to `residual`, and `stabilise` to `blend`. Where pictures do not fit there, the latter run on the CPU; where
/// frames do not, all but the wavelet.
///
/// On a device in software, which has no other processor than the CPU, only `gather` to `residual` run: shaders take many times as long
/// there as the CPU's code ([`SequenceAccelerator::with_all_stages`]).
#[derive(Debug)]
pub struct SequenceAccelerator {
    gpu: Arc<Gpu>,
    kernels: Arc<SequenceKernels>,
    notes: Arc<Mutex<Notes>>,
    views: Option<Arc<Views>>,
    all_stages: bool,
}

/// What became of it, over all windows.
#[derive(Debug, Default)]
struct Notes {
    /// Bytes on the device at most, and how they come about.
    bytes: u64,
    memory: Option<String>,
    /// Why stages ran on the CPU; each sentence once.
    refused: Vec<String>,
    /// Of passes on the device, in the order in which they ran first: name, milliseconds, dispatches.
    times: Vec<(&'static str, f64, usize)>,
}

impl SequenceAccelerator {
    /// Compiles what it runs; the stages after the filtered light, where they are first asked for.
    ///
    /// # Errors
    /// What the device reports.
    pub fn new(gpu: Arc<Gpu>) -> Result<Self, Error> {
        let kernels = Arc::new(SequenceKernels::new(gpu.device()));
        gpu.check("compiling the sequence filter")?;
        let all_stages = !gpu.adapter().is_software();
        Ok(Self { gpu, kernels, notes: Arc::default(), views: None, all_stages })
    }

    /// On a device in software, too, every stage that has a shader runs there: for tests.
    #[must_use]
    pub fn with_all_stages(self) -> Self {
        Self { all_stages: true, ..self }
    }

    /// Times every pass on the device, where that has timestamps: [`Accelerator::take_times`]. For one filter at a time.
    #[must_use]
    pub fn with_timings(self) -> Self {
        let kernels = Arc::new((*self.kernels).clone().with_timings(self.gpu.device()));
        Self { kernels, ..self }
    }

    /// Shows what every stage up to `residual` of every frame makes on the device: to look at, not for every day, since each frame runs again
    /// for its pictures. Results are the same.
    ///
    /// # Errors
    /// What the device reports.
    pub fn with_views(mut self, show: Arc<ShowSequence>) -> Result<Self, Error> {
        self.views = Some(Arc::new(Views::new(&self.gpu, show)?));
        Ok(self)
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

    /// Waits for each light: this runs where memory is short, and lights share their buffers.
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
        let at = self.kernels.wavelet().encode(gpu.device(), &mut encoder, light, &buffers, band.size)?;
        let bytes = band.size.pixels() as u64 * COLOUR;
        let mut readback = Readback::default();
        planes.iter().for_each(|pair| readback.buffer(gpu, &mut encoder, pair[at], bytes));
        let row = band.size.width * COLOUR as usize;
        let kept = (core.start - band.rows.start) * row..(core.end - band.rows.start) * row;
        for (plane, bytes) in readback.read(gpu, encoder, WHAT)?.iter().enumerate() {
            let kept = bytes.get(kept.clone()).unwrap_or_default();
            job.store(light.light, plane, core.clone(), kept).map_err(|reason| refused(gpu, WHAT, reason))?;
        }
        Ok(())
    }
}

fn refused(gpu: &Gpu, what: &str, reason: String) -> Error {
    Error::Refused { adapter: gpu.adapter().name.clone(), what: what.to_owned(), reason }
}

impl Accelerator for SequenceAccelerator {
    fn name(&self) -> String {
        format!("gpu: {}", self.gpu.adapter())
    }

    fn wavelet(&self, job: &mut WaveletJob<'_>) -> Result<(), String> {
        self.filter(job).map_err(|error| error.to_string())
    }

    fn window(&self) -> Option<Box<dyn AcceleratedWindow>> {
        let window = SequenceWindow::new(self.gpu.device(), Arc::clone(&self.kernels));
        let (gpu, notes) = (Arc::clone(&self.gpu), Arc::clone(&self.notes));
        let (kernels, views) = (Arc::clone(&self.kernels), self.views.clone());
        let refuses_finish = !self.all_stages;
        Some(Box::new(Window { gpu, kernels, window, refuses: false, refuses_finish, notes, views }))
    }

    fn take_times(&self) -> Vec<(&'static str, f64, usize)> {
        std::mem::take(&mut self.notes.lock().unwrap_or_else(PoisonError::into_inner).times)
    }

    fn notes(&self, all: bool) -> Vec<String> {
        let notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        notes.memory.iter().filter(|_| all).chain(&notes.refused).cloned().collect()
    }
}

/// Frames of one run on the device.
#[derive(Debug)]
struct Window {
    gpu: Arc<Gpu>,
    kernels: Arc<SequenceKernels>,
    window: SequenceWindow,
    /// It does not fit on the device.
    refuses: bool,
    /// Stages after the filtered light are not for the device, or what they keep does not fit there besides.
    refuses_finish: bool,
    notes: Arc<Mutex<Notes>>,
    views: Option<Arc<Views>>,
}

impl Window {
    fn run(&mut self, job: &mut EstimateJob<'_>) -> Result<bool, Error> {
        if self.refuses {
            return Ok(false);
        }
        if let Some(why) = job.unfit() {
            self.refused(format!("frames with {why} around them were gathered on the CPU"));
            return Ok(false);
        }
        let mut why_not = self.reserve(job.size(), |window, device| window.reserve(device, job))?;
        if let Some(why) = why_not.take_if(|_| self.window.holds_pictures()) {
            // Pictures give way first.
            self.refused(format!("{ON_CPU}: {why}"));
            self.refuses_finish = true;
            self.start_again();
            why_not = self.reserve(job.size(), |window, device| window.reserve(device, job))?;
        }
        if let Some(why) = why_not {
            self.refused(format!("samples were gathered on the CPU: {why}"));
            self.refuses = true;
            self.start_again();
            return Ok(false);
        }
        let gpu = &self.gpu;
        // A frame at a time: copies take memory, too. The last is submitted with the stages.
        let mut last = None;
        for place in 0..job.len() {
            let mut encoder = gpu.encoder("quell host window");
            let any = self.window.upload(gpu.device(), &mut encoder, job, place)?;
            if any && let Some(before) = last.replace(encoder) {
                gpu.run(before, WINDOW)?;
            }
        }
        let mut encoder = last.unwrap_or_else(|| gpu.encoder("quell host window"));
        if let Some(views) = &self.views {
            gpu.run(std::mem::replace(&mut encoder, gpu.encoder("quell host window")), WINDOW)?;
            views.draw(gpu, &mut self.window, job)?;
        }
        let estimated = self.window.encode(gpu.device(), &mut encoder, job, SequenceStage::Residual)?;
        let pixels = job.size().pixels() as u64;
        let mut readback = Readback::default();
        for (.., buffer) in &estimated.planes {
            readback.buffer(gpu, &mut encoder, buffer, COLOUR * pixels);
        }
        if let Some(samples) = estimated.samples {
            readback.buffer(gpu, &mut encoder, samples, NUMBER * pixels);
        }
        self.kernels.resolve_timings(gpu.device(), &mut encoder);
        let places: Vec<_> = estimated.planes.iter().map(|(light, plane, _)| (*light, *plane)).collect();
        readback.lend(gpu, encoder, WINDOW, |contents| {
            let (planes, samples) = contents.split_at(places.len().min(contents.len()));
            for ((light, plane), bytes) in places.iter().zip(planes) {
                job.store(*light, *plane, bytes).map_err(|reason| refused(gpu, WINDOW, reason))?;
            }
            samples.iter().try_for_each(|s| job.store_samples(s).map_err(|reason| refused(gpu, WINDOW, reason)))
        })?;
        self.note_times();
        Ok(true)
    }

    /// Stages `stabilise` to `blend`, where the device has room for the pictures around, too.
    fn run_finish(&mut self, job: &mut FinishJob<'_>) -> Result<bool, Error> {
        if self.refuses || self.refuses_finish {
            return Ok(false);
        }
        if let Some(why) = self.reserve(job.size(), |window, device| window.reserve_finish(device, job))? {
            self.refused(format!("{ON_CPU}: {why}"));
            self.refuses_finish = true;
            self.start_again();
            return Ok(false);
        }
        let gpu = &self.gpu;
        // A frame at a time, as above.
        let mut last = None;
        for place in 0..job.len() {
            let mut encoder = gpu.encoder("quell host pictures");
            let any = self.window.upload_finish(gpu.device(), &mut encoder, job, place)?;
            if any && let Some(before) = last.replace(encoder) {
                gpu.run(before, FINISH)?;
            }
        }
        let mut encoder = last.unwrap_or_else(|| gpu.encoder("quell host pictures"));
        let made = self.window.encode_finish(gpu.device(), &mut encoder, job)?;
        let bytes = COLOUR * job.size().pixels() as u64;
        let mut readback = Readback::default();
        for buffer in [made.steady, made.shares, made.gain] {
            readback.buffer(gpu, &mut encoder, buffer, bytes);
        }
        self.kernels.resolve_timings(gpu.device(), &mut encoder);
        readback.lend(gpu, encoder, FINISH, |contents| {
            let [steady, shares, gain] = [0, 1, 2].map(|k| contents.get(k).copied().unwrap_or_default());
            job.store(steady, shares, gain).map_err(|reason| refused(gpu, FINISH, reason))
        })?;
        self.note_times();
        Ok(true)
    }

    /// Adds up what passes took that have run.
    fn note_times(&self) {
        while let Some(timings) = self.kernels.take_timings(self.gpu.queue()) {
            let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
            for Timing { pass, milliseconds, .. } in timings {
                match notes.times.iter_mut().find(|(name, ..)| *name == pass) {
                    Some((_, sum, count)) => (*sum, *count) = (*sum + milliseconds, *count + 1),
                    None => notes.times.push((pass, milliseconds, 1)),
                }
            }
        }
    }

    /// What was allocated goes back.
    fn start_again(&mut self) {
        self.window = SequenceWindow::new(self.gpu.device(), Arc::clone(&self.kernels));
    }

    /// Why the device cannot hold what `reserve` asks it for.
    fn reserve(
        &mut self,
        size: Size,
        reserve: impl FnOnce(&mut SequenceWindow, &Device) -> Result<(), gpu::Error>,
    ) -> Result<Option<String>, Error> {
        let scope = self.gpu.device().push_error_scope(ErrorFilter::OutOfMemory);
        let reserved = reserve(&mut self.window, self.gpu.device());
        let trouble = now(scope.pop());
        match (reserved, trouble) {
            (Ok(()), None) => {
                self.note_memory(size);
                Ok(None)
            }
            (Ok(()), Some(_)) => {
                let needs = mebibytes(self.window.bytes());
                Ok(Some(format!("the device has not the {needs} MiB that the frames of a window take")))
            }
            (Err(why @ gpu::Error::Size { .. }), _) => Ok(Some(why.to_string())),
            (Err(other), _) => Err(other.into()),
        }
    }

    fn refused(&self, why: String) {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        if !notes.refused.contains(&why) {
            notes.refused.push(why);
        }
    }

    fn note_memory(&self, size: Size) {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = self.window.bytes();
        if bytes <= notes.bytes {
            return;
        }
        let (pixels, layers, frame) =
            (size.pixels() as u64, u64::from(self.window.layers()), self.window.frame_bytes());
        notes.bytes = bytes;
        notes.memory = Some(format!(
            "memory on the device: {} MiB ({layers} frames of {} bytes a pixel, {} besides)",
            mebibytes(bytes),
            frame / pixels.max(1),
            (bytes - layers * frame) / pixels.max(1),
        ));
    }
}

impl AcceleratedWindow for Window {
    fn estimate(&mut self, job: &mut EstimateJob<'_>) -> Result<bool, String> {
        self.run(job).map_err(|error| error.to_string())
    }

    fn finish(&mut self, job: &mut FinishJob<'_>) -> Result<bool, String> {
        self.run_finish(job).map_err(|error| error.to_string())
    }
}

fn mebibytes(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

const WINDOW: &str = "the frames of a window";

const FINISH: &str = "the pictures of a window";
const ON_CPU: &str = "pictures were stabilised and blended on the CPU";

const WHAT: &str = "the wavelet of a frame";
/// Bytes of a pixel of a colour, of one number, and of what the wavelet compares.
const COLOUR: u64 = 16;
const NUMBER: u64 = 4;
const COMPARED: u64 = 16;

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
