//! The sequence filter, frame by frame.

use crate::buffers::{PyPass, channels, interleaved, numbers, scalar_bytes};
use crate::failure::Failure;
use crate::listen::{Tell, listen, pool};
use crate::tables::sequence_settings;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyList};
use quell::Size;
use quell_frames::arrays::{ArrayPass, filtered, image_of};
use quell_frames::driver::{Cleaned, Stream, StreamOptions};
use quell_frames::{AdaptOptions, Error, ExrImage, MapOptions, MotionChoice, Role, Samples};
use std::path::Path;
use std::sync::{Mutex, MutexGuard};

/// A back end by name: `cpu`, `reference`, `gpu` (`device`: part of its name), or `auto`, a GPU where there is one.
pub fn backend(name: &str, device: Option<&str>) -> Result<quell_lab::backend::Backend, Failure> {
    use quell_lab::backend::Backend;
    let on_gpu = matches!(name, "gpu" | "auto");
    if device.is_some() && !on_gpu {
        return Err(Failure::input(format!("device: it names a GPU, and backend is `{name}`")));
    }
    match name {
        "cpu" => Ok(Backend::Cpu(quell::Backend::Cpu)),
        "reference" => Ok(Backend::Cpu(quell::Backend::Reference)),
        #[cfg(feature = "gpu")]
        "gpu" | "auto" => {
            let wanted = device.map_or(quell_host::Wanted::Any, quell_host::Wanted::Named);
            match quell_host::Gpu::open(wanted) {
                Ok(gpu) => Ok(Backend::Gpu(std::sync::Arc::new(gpu))),
                Err(_) if name == "auto" && device.is_none() => Ok(Backend::Cpu(quell::Backend::Cpu)),
                Err(error) => Err(Failure::input(format!("backend: {error}"))),
            }
        }
        #[cfg(not(feature = "gpu"))]
        "gpu" | "auto" => Err(Failure::input("backend: this build has no GPU; there are cpu, reference")),
        other => Err(Failure::input(format!("backend: `{other}`; there are cpu, gpu, auto, reference"))),
    }
}

/// From the package's word to what vectors mean; absent: the renderer's where it is known, else found out.
pub fn motion_choice(word: Option<&str>) -> MotionChoice {
    match word {
        None => MotionChoice::Renderer,
        Some("auto") => MotionChoice::Auto,
        Some("none") => MotionChoice::None,
        Some(name) => MotionChoice::Preset(name.to_owned()),
    }
}

/// Frames of one sequence, pushed in order.
#[pyclass(frozen)]
pub struct Frames {
    inner: Mutex<Inner>,
    pool: rayon::ThreadPool,
    lookahead: usize,
}

struct Inner {
    options: StreamOptions,
    stream: Option<Stream>,
    /// Passes of the frames and how many channels each has.
    passes: Vec<(String, usize)>,
    told: bool,
}

/// What comes of a call: sentences on how passes are taken, once a sequence: mapping, warnings, passes taken for nothing.
type Decided = Option<(String, Vec<String>, Vec<String>)>;

impl Inner {
    fn decided(&mut self) -> Decided {
        let stream = self.stream.as_ref().filter(|_| !self.told)?;
        let mapping = stream.mapping();
        if mapping.is_empty() {
            return None;
        }
        self.told = true;
        Some((mapping, stream.warnings(), stream.others()))
    }

    fn reset(&mut self) {
        (self.stream, self.told) = (None, false);
    }

    fn push(&mut self, number: i64, frame: Given, tell: Tell<'_, Cleaned>) -> Result<Decided, Error> {
        let label = format!("frame {number}");
        let passes = frame.passes.into_iter().map(|(name, role, numbers, count)| ArrayPass {
            name,
            role,
            components: channels(&numbers, count),
        });
        let (image, wishes) = image_of(Path::new(&label), frame.size, passes.collect(), frame.camera)?;
        if self.stream.is_none() {
            self.options.map.map = wishes;
            self.stream = Some(Stream::new(self.options.clone())?);
            self.passes = frame.names;
        }
        let result = self.with_stream(|stream, out| stream.push(number, image, out), tell);
        if self.stream.as_ref().is_some_and(Stream::is_empty) {
            self.reset();
        }
        result.map(|()| self.decided())
    }

    fn flush(&mut self, tell: Tell<'_, Cleaned>) -> Result<Decided, Error> {
        let begun = self.with_stream(Stream::decide, tell);
        let decided = self.decided();
        let result = begun.and_then(|()| self.with_stream(Stream::flush, tell));
        self.reset();
        result.map(|()| decided)
    }

    fn with_stream(
        &mut self,
        call: impl FnOnce(&mut Stream, &mut dyn FnMut(Cleaned) -> bool) -> Result<(), Error>,
        tell: Tell<'_, Cleaned>,
    ) -> Result<(), Error> {
        self.stream.as_mut().map_or(Ok(()), |stream| call(stream, &mut |cleaned| tell(cleaned)))
    }
}

/// A frame as it was given.
struct Given {
    size: Size,
    passes: Vec<(String, Option<Role>, crate::buffers::Numbers, usize)>,
    names: Vec<(String, usize)>,
    camera: Option<[f32; 16]>,
}

#[pymethods]
impl Frames {
    #[new]
    #[pyo3(signature = (preset, settings, motion, renderer, cuts, backend_name, device, threads))]
    #[expect(clippy::too_many_arguments, reason = "one caller, which names them")]
    fn new(
        py: Python<'_>,
        preset: &str,
        settings: Vec<(String, String)>,
        motion: Option<&str>,
        renderer: Option<String>,
        cuts: Option<Vec<i64>>,
        backend_name: &str,
        device: Option<&str>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let settings = sequence_settings(preset, &settings)?;
        // Opening a device takes seconds.
        let backend = py.detach(|| backend(backend_name, device))?;
        let options = StreamOptions {
            map: MapOptions { renderer, ..MapOptions::default() },
            adapt: AdaptOptions { motion: motion_choice(motion), ..AdaptOptions::default() },
            settings,
            cuts,
            backend: backend.on_this_processor(),
            accelerator: backend.accelerator().map_err(Failure::from)?,
        };
        let reach = Stream::new(options.clone()).map_err(Failure::from)?.reach();
        let lookahead = if options.settings.gather.future { reach } else { 0 };
        let inner = Inner { options, stream: None, passes: Vec::new(), told: false };
        Ok(Self { inner: Mutex::new(inner), pool: pool(threads)?, lookahead })
    }

    /// How many frames must follow one before it comes out.
    fn lookahead(&self) -> usize {
        self.lookahead
    }

    /// Takes the next frame; `emit` is called with each that comes out.
    #[pyo3(signature = (number, height, width, passes, camera, emit))]
    #[expect(clippy::too_many_arguments, reason = "one caller, which names them")]
    fn push(
        &self,
        py: Python<'_>,
        number: i64,
        height: usize,
        width: usize,
        passes: Vec<PyPass<'_>>,
        camera: Option<[f32; 16]>,
        emit: &Bound<'_, PyAny>,
    ) -> PyResult<Decided> {
        let size = Size::new(width, height);
        let mut given = Given { size, passes: Vec::with_capacity(passes.len()), names: Vec::new(), camera };
        for (name, role, buffer, halves) in passes {
            let role = match &role {
                Some(word) => {
                    Some(Role::from_name(word).ok_or_else(|| Failure::input(format!("{name}: `{word}` is no role")))?)
                }
                None => None,
            };
            let (numbers, count) = numbers(&name, &buffer, halves, size)?;
            given.names.push((name.clone(), count));
            given.passes.push((name, role, numbers, count));
        }
        self.run(py, emit, |inner, tell| inner.push(number, given, tell))
    }

    /// The end of the sequence: the rest comes out.
    fn flush(&self, py: Python<'_>, emit: &Bound<'_, PyAny>) -> PyResult<Decided> {
        self.run(py, emit, Inner::flush)
    }

    /// Gives up what is inside.
    fn reset(&self) -> PyResult<()> {
        self.lock().map(|mut inner| inner.reset()).map_err(PyErr::from)
    }
}

impl Frames {
    fn lock(&self) -> Result<MutexGuard<'_, Inner>, Failure> {
        match self.inner.try_lock() {
            Ok(inner) => Ok(inner),
            // A panic inside was reported; what it left is given up.
            Err(std::sync::TryLockError::Poisoned(poisoned)) => {
                self.inner.clear_poison();
                let mut inner = poisoned.into_inner();
                inner.reset();
                Ok(inner)
            }
            Err(std::sync::TryLockError::WouldBlock) => Err(Failure::busy("sequence")),
        }
    }

    /// What comes out is handed to `emit` while the filter works on.
    fn run(
        &self,
        py: Python<'_>,
        emit: &Bound<'_, PyAny>,
        work: impl FnOnce(&mut Inner, Tell<'_, Cleaned>) -> Result<Decided, Error> + Send,
    ) -> PyResult<Decided> {
        let mut inner = self.lock()?;
        // The first frame never comes out at once, so they are known by then.
        let names = inner.passes.clone();
        let emit = emit.clone().unbind();
        let at_work = &mut *inner;
        let heard = |py: Python<'_>, cleaned: Cleaned| give(py, &emit, &names, &cleaned);
        let result = listen(py, &self.pool, |tell, _| work(at_work, tell), heard);
        // What was on its way out is lost, and later frames would follow on nothing.
        let done = result.inspect_err(|_| inner.reset())?;
        done.map_err(|error| Failure::from(error).into())
    }
}

/// Calls `emit(number, height, width, passes, noise, notes)`.
fn give(py: Python<'_>, emit: &Py<PyAny>, names: &[(String, usize)], cleaned: &Cleaned) -> PyResult<()> {
    let size: Size = image_size(&cleaned.image);
    let passes = PyList::empty(py);
    for (name, count) in names {
        let Some(planes) = filtered(&cleaned.image, name, *count) else { continue };
        let planes: Vec<&Samples> = planes;
        let (bytes, halves): (Bound<'_, PyByteArray>, bool) = interleaved(py, &planes)?;
        passes.append((name, planes.len(), halves, bytes))?;
    }
    let noise = cleaned.noise.as_ref().map(|noise| scalar_bytes(py, noise)).transpose()?;
    emit.call1(py, (cleaned.number, size.height, size.width, passes, noise, cleaned.notes.clone()))?;
    Ok(())
}

fn image_size(image: &ExrImage) -> Size {
    image.display_window().size
}
