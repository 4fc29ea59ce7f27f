//! Files to files, what is wrong with files, and the command.

use crate::failure::Failure;
use crate::listen::{listen, pool};
use crate::sequence::{backend, motion_choice};
use crate::tables::sequence_settings;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quell_frames::doctor::{DoctorOptions, examine};
use quell_frames::driver::{Destination, Event, Existing, Fate, Job, JobOptions};
use quell_frames::{AdaptOptions, MapOptions};
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// What a run tells.
enum Told {
    Warning(String),
    /// The number of frames is known.
    Begun(usize),
    Done(i64),
    Failed(i64, String),
}

/// `hear(kind, number, text)` is called while it runs: `warning`, `begun` (how many frames), `done`, `failed`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one caller, which names them")]
#[pyo3(signature = (inputs, output, preset, settings, frames, shot, cuts, existing, motion, renderer, passes, beauty_only, layer,
    view, map_to, noise_pass, max_memory, backend_name, device, threads, hear))]
pub fn denoise_files<'py>(
    py: Python<'py>,
    inputs: Vec<PathBuf>,
    output: PathBuf,
    preset: &str,
    settings: Vec<(String, String)>,
    frames: Option<Vec<i64>>,
    shot: Option<Vec<i64>>,
    cuts: Option<Vec<i64>>,
    existing: &str,
    motion: Option<&str>,
    renderer: Option<String>,
    passes: Option<Vec<String>>,
    beauty_only: bool,
    layer: Option<String>,
    view: Option<String>,
    map_to: Vec<String>,
    noise_pass: bool,
    max_memory: Option<u64>,
    backend_name: &str,
    device: Option<&str>,
    threads: Option<usize>,
    hear: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let existing = match existing {
        "ours" => Existing::Ours,
        "skip" => Existing::Skip,
        "resume" => Existing::Resume,
        "overwrite" => Existing::Overwrite,
        other => {
            let there = "there are ours, skip, resume, overwrite";
            return Err(Failure::input(format!("existing: `{other}`; {there}")).into());
        }
    };
    let sorted = |numbers: Option<Vec<i64>>| {
        numbers.map(|mut numbers| {
            numbers.sort_unstable();
            numbers.dedup();
            numbers
        })
    };
    let backend = py.detach(|| backend(backend_name, device))?;
    let options = JobOptions {
        inputs,
        destination: Destination::parse(&output).map_err(Failure::input)?,
        existing,
        frames: sorted(frames),
        shot: sorted(shot),
        cuts,
        map: MapOptions { layer, view, map: map_to, aliases: None, renderer },
        adapt: AdaptOptions { motion: motion_choice(motion), beauty_only, passes, noise_pass },
        settings: sequence_settings(preset, &settings)?,
        max_memory,
        bands: None,
        backend: backend.on_this_processor(),
        accelerator: backend.accelerator().map_err(Failure::from)?,
        measure_noise: true,
    };
    let pool = pool(threads)?;
    let work = |tell: crate::listen::Tell<'_, Told>, stop: &AtomicBool| {
        let job = Job::open(options)?;
        for note in job.notes() {
            tell(Told::Warning(note.clone()));
        }
        tell(Told::Begun(job.plan().wanted()));
        let notify = |event| {
            let _ = match event {
                Event::Written(number) => tell(Told::Done(number)),
                Event::Failed(number, reason) => tell(Told::Failed(number, reason)),
                Event::Note(note) => tell(Told::Warning(note)),
                Event::Read(_) | Event::Cut(_) | Event::Band(..) => true,
            };
        };
        let outcome = job.run(stop, &notify)?;
        Ok((outcome, job.plan().missing.clone(), job.done_before().to_vec(), job.mapping().to_owned()))
    };
    let heard = hear.clone().unbind();
    let result: Result<_, quell_frames::Error> = listen(py, &pool, work, |py, told| {
        let (kind, number, text) = match told {
            Told::Warning(text) => ("warning", 0, text),
            Told::Begun(count) => ("begun", count as i64, String::new()),
            Told::Done(number) => ("done", number, String::new()),
            Told::Failed(number, reason) => ("failed", number, reason),
        };
        heard.call1(py, (kind, number, text)).map(|_| ())
    })?;
    let (outcome, missing, before, mapping) = result.map_err(Failure::from)?;
    let report = PyDict::new(py);
    let written: Vec<i64> = outcome.frames.iter().filter(|(_, f)| *f == Fate::Written).map(|(n, _)| *n).collect();
    let failed = PyDict::new(py);
    for (number, fate) in &outcome.frames {
        match fate {
            Fate::Written => {}
            Fate::Failed(reason) => failed.set_item(number, reason)?,
            Fate::Skipped => failed.set_item(number, outcome.ended.as_deref().unwrap_or("the run ended before"))?,
        }
    }
    for number in missing {
        failed.set_item(number, "there is no file of it")?;
    }
    let noise = PyDict::new(py);
    for (number, measured) in &outcome.noise {
        noise.set_item(number, (measured.found, measured.left))?;
    }
    report.set_item("written", written)?;
    report.set_item("failed", failed)?;
    report.set_item("there_already", before)?;
    report.set_item("cuts", outcome.cuts)?;
    report.set_item("noise", noise)?;
    report.set_item("seconds", outcome.times.wall)?;
    report.set_item("mapping", mapping)?;
    Ok(report)
}

/// What `quell doctor --json` says, as JSON. `hear(done, of)` is called while it looks.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one caller, which names them")]
#[pyo3(signature = (inputs, frames, layer, view, map_to, motion, renderer, threads, hear))]
pub fn doctor(
    py: Python<'_>,
    inputs: Vec<PathBuf>,
    frames: Option<Vec<i64>>,
    layer: Option<String>,
    view: Option<String>,
    map_to: Vec<String>,
    motion: Option<&str>,
    renderer: Option<String>,
    threads: Option<usize>,
    hear: &Bound<'_, PyAny>,
) -> PyResult<String> {
    let options = DoctorOptions {
        inputs,
        frames,
        map: MapOptions { layer, view, map: map_to, aliases: None, renderer },
        motion: motion_choice(motion),
        exhibits: 0,
    };
    let heard = hear.clone().unbind();
    let found = listen(
        py,
        &pool(threads)?,
        |tell, stop| {
            let notify = |done: usize, of: usize| {
                tell((done, of));
            };
            examine(&options, &notify, stop)
        },
        |py, (done, of)| heard.call1(py, (done, of)).map(|_| ()),
    )?;
    Ok(quell_cli::diagnosis_as_json(&found.map_err(Failure::from)?))
}

/// The command `quell`; returns its exit status. `program`: the file of this module.
#[pyfunction]
pub fn run_command(py: Python<'_>, arguments: Vec<OsString>, program: PathBuf) -> u8 {
    py.detach(|| quell_cli::run(arguments, program))
}
