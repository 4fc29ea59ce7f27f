//! The real-time filter, frame by frame.

use crate::buffers::{Numbers, PyPass, colour_bytes, numbers, scalar_bytes};
use crate::failure::Failure;
use crate::listen::{detached, pool};
use crate::sequence::backend;
use crate::tables::realtime_settings;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict};
use quell::{Camera, FrameBuf, Plane, Size};
use quell_frames::arrays::set_plane;
use std::sync::{Mutex, MutexGuard};

/// Clip from world (column-major), position, jitter in pixels.
type PyCamera = ([f32; 16], [f32; 3], [f32; 2]);

/// A denoiser with its history.
#[pyclass(frozen)]
pub struct Realtime {
    inner: Mutex<quell_lab::backend::Denoiser>,
    size: Size,
    pool: rayon::ThreadPool,
}

/// What a frame becomes.
struct Done {
    composite: Plane<[f32; 3]>,
    matte: Option<Plane<[f32; 3]>>,
    glossy: Option<Plane<[f32; 3]>>,
    confidence: Plane<f32>,
    had_history: bool,
}

#[pymethods]
impl Realtime {
    #[new]
    #[pyo3(signature = (height, width, preset, settings, backend_name, device, threads))]
    #[expect(clippy::too_many_arguments, reason = "one caller, which names them")]
    fn new(
        py: Python<'_>,
        height: usize,
        width: usize,
        preset: &str,
        settings: Vec<(String, String)>,
        backend_name: &str,
        device: Option<&str>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let size = Size::new(width, height);
        let settings = realtime_settings(preset, &settings)?;
        let pool = pool(threads)?;
        let made =
            py.detach(|| -> Result<_, Failure> { Ok(backend(backend_name, device)?.denoiser(size, &settings)?) })?;
        Ok(Self { inner: Mutex::new(made), size, pool })
    }

    /// Filters the next frame: planes by name.
    #[pyo3(signature = (index, camera, previous, planes))]
    fn denoise<'py>(
        &self,
        py: Python<'py>,
        index: i64,
        camera: PyCamera,
        previous: Option<PyCamera>,
        planes: Vec<PyPass<'_>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut frame = FrameBuf::new(self.size, of(camera));
        frame.previous_camera = of(previous.unwrap_or(camera));
        frame.index = index;
        for (name, _, buffer, halves) in &planes {
            let (Numbers::Float(values), channels) = numbers(name, buffer, *halves, self.size)? else {
                return Err(Failure::input(format!("{name}: float32 is needed")).into());
            };
            set_plane(&mut frame, name, values, channels).map_err(Failure::from)?;
        }
        let mut inner = self.lock()?;
        let denoiser = &mut *inner;
        let done = detached(py, || {
            self.pool.install(|| -> Result<Done, Failure> {
                let output = denoiser.denoise(&frame.frame(&[]))?;
                Ok(Done {
                    composite: output.composite.clone(),
                    matte: output.matte.cloned(),
                    glossy: output.glossy.cloned(),
                    confidence: output.confidence.clone(),
                    had_history: output.report.had_history,
                })
            })
        })??;
        let result = PyDict::new(py);
        let colour = |plane: Option<&Plane<[f32; 3]>>| -> PyResult<Option<Bound<'py, PyByteArray>>> {
            plane.map(|plane| colour_bytes(py, plane)).transpose()
        };
        result.set_item("color", colour(Some(&done.composite))?)?;
        result.set_item("matte", colour(done.matte.as_ref())?)?;
        result.set_item("glossy", colour(done.glossy.as_ref())?)?;
        result.set_item("confidence", scalar_bytes(py, &done.confidence)?)?;
        result.set_item("had_history", done.had_history)?;
        Ok(result)
    }

    /// Forgets history.
    fn reset(&self) -> PyResult<()> {
        self.lock()?.reset();
        Ok(())
    }
}

impl Realtime {
    fn lock(&self) -> Result<MutexGuard<'_, quell_lab::backend::Denoiser>, Failure> {
        match self.inner.try_lock() {
            Ok(inner) => Ok(inner),
            Err(std::sync::TryLockError::Poisoned(poisoned)) => {
                self.inner.clear_poison();
                let mut inner = poisoned.into_inner();
                inner.reset();
                Ok(inner)
            }
            Err(std::sync::TryLockError::WouldBlock) => Err(Failure::busy("denoiser")),
        }
    }
}

fn of((clip_from_world, position, jitter): PyCamera) -> Camera {
    Camera { clip_from_world, position, jitter }
}

/// A perspective camera's matrix: see `quell.Camera.perspective`.
#[pyfunction]
pub fn perspective(position: [f32; 3], forward: [f32; 3], up: [f32; 3], vertical_fov: f32, aspect: f32) -> [f32; 16] {
    Camera::perspective(position, forward, up, vertical_fov, aspect).clip_from_world
}
