//! A job as a user gives it: which files, which frames, what becomes of them. `run.rs` runs it.

use super::memory::{Estimate, Memory};
use super::output::{Destination, Existing, is_done, job_key};
use super::pipeline::RunOptions;
use super::plan::{Plan, ranges};
use crate::adapt::{AdaptOptions, Adapter, Footprint, reads};
use crate::error::Error;
use crate::image::{ExrImage, Window as ImageWindow, read_channels, read_headers};
use crate::roles::{MapOptions, map_roles};
use crate::sequence::{FrameSources, Sequence, find_sequence};
use quell::Backend;
use quell::sequence::{Accelerator, SEQUENCE_PARAMETERS, SequenceDenoiser, SequenceSettings};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

/// What the user asked for.
#[derive(Clone, Debug)]
pub struct JobOptions {
    /// Files, folders, patterns.
    pub inputs: Vec<PathBuf>,
    /// Where frames go.
    pub destination: Destination,
    /// What to do about files that exist.
    pub existing: Existing,
    /// Frames to be written; absent: all.
    pub frames: Option<Vec<i64>>,
    /// The whole shot: each of its frames must be there.
    pub shot: Option<Vec<i64>>,
    /// First frames of shots; absent: found.
    pub cuts: Option<Vec<i64>>,
    /// Which passes are what.
    pub map: MapOptions,
    /// How passes become planes.
    pub adapt: AdaptOptions,
    /// Of the filter.
    pub settings: SequenceSettings,
    /// Bytes of memory that the job must not exceed; absent: what the system has free.
    pub max_memory: Option<u64>,
    /// Bands of rows that the picture is filtered in; absent: as many as memory asks for.
    pub bands: Option<usize>,
    /// Which implementation of the stages runs on this processor. `Reference` is slow.
    pub backend: Backend,
    /// Runs stages of the filter on another device, such as a GPU, with `backend` [`Backend::Cpu`]; absent: this processor
    /// does all.
    pub accelerator: Option<Arc<dyn Accelerator>>,
    /// How much noise each frame had and has is measured: [`super::Outcome::noise`]. Reads the picture once more.
    pub measure_noise: bool,
}

impl JobOptions {
    /// What filters, as files name it: two that differ may differ in bits.
    pub fn back_end(&self) -> String {
        match (&self.accelerator, self.backend) {
            (Some(accelerator), _) => accelerator.name(),
            (None, Backend::Cpu) => "cpu".to_owned(),
            (None, Backend::Reference) => "reference".to_owned(),
        }
    }
}

/// A job that is ready to run: files found, passes mapped, frames chosen.
#[derive(Debug)]
pub struct Job {
    pub(super) options: JobOptions,
    sequence: Sequence,
    pub(super) layout: Vec<Vec<String>>,
    pub(super) adapters: Vec<Adapter>,
    pub(super) mapping: String,
    plan: Plan,
    done_before: Vec<i64>,
    notes: Vec<String>,
    pub(super) key: String,
    reach: usize,
    footprints: Vec<Footprint>,
    /// Rows that things move up or down in a frame, at most: known when the frames were read.
    moved: OnceLock<f32>,
}

impl Job {
    /// Finds the frames, maps the passes of the first one, and decides what is to be done. Writes nothing.
    ///
    /// # Errors
    /// What finding and mapping return; [`Error::Invalid`] where a frame of the shot is missing, or where an output would
    /// replace an input; [`Error::Foreign`] where another program's file is in the way.
    pub fn open(options: JobOptions) -> Result<Self, Error> {
        let sequence = find_sequence(&options.inputs)?;
        let input = options.inputs.first().cloned().unwrap_or_default();
        let available: Vec<i64> = sequence.frames.iter().map(|frame| frame.number).collect();
        let mut notes: Vec<String> = (sequence.incomplete.iter())
            .map(|(number, pass)| format!("frame {number} is left out: its file of the pass `{pass}` is missing"))
            .collect();
        if let Some(shot) = &options.shot {
            let missing: Vec<i64> = shot.iter().copied().filter(|n| sequence.frame(*n).is_none()).collect();
            if !missing.is_empty() {
                let reason = format!("frames of the shot are missing: {}", ranges(&missing));
                return Err(Error::invalid(&input, reason));
            }
        }
        let mut wanted = options.frames.clone().unwrap_or_else(|| available.clone());
        if !sequence.frames.iter().any(|frame| wanted.contains(&frame.number)) {
            return Err(Error::invalid(&input, format!("there is no file of frames {}", ranges(&wanted))));
        }
        // What is decided from pixels is decided on the sequence's own first frames, whichever are wanted: every part of a
        // split job decides alike.
        let (first, second) = first_two(&sequence);
        let images = headers(first)?;
        let mappings = map_roles(&named(first, &images), &options.map)?;
        let layout = layout(&images);
        let canvas = canvas(&sequence, &images);
        let mut adapters = Vec::with_capacity(mappings.len());
        for mapping in mappings {
            let load = |frame: &FrameSources| -> Result<Vec<ExrImage>, Error> {
                let files = frame.files.iter().enumerate();
                files.map(|(i, file)| read_channels(&file.path, reads(&mapping, i))).collect()
            };
            let (one, two) = (load(first)?, second.map(load).transpose()?);
            adapters.push(Adapter::new(mapping.clone(), canvas, &one, two.as_deref(), &options.adapt)?);
        }
        let mapping: String = adapters.iter().map(Adapter::describe).collect::<Vec<_>>().join("\n");
        for adapter in &adapters {
            notes.extend(adapter.warnings().iter().cloned());
        }
        let settings = settings_text(&options.settings);
        let cuts = options.cuts.as_ref().map_or_else(|| "found".to_owned(), |cuts| ranges(cuts));
        let adapt = format!("{:?}", options.adapt);
        let back_end = options.back_end();
        let key = job_key([env!("CARGO_PKG_VERSION"), &settings, &mapping, &cuts, &adapt, &back_end]);

        let mut done_before = Vec::new();
        let mut in_the_way = None;
        wanted.retain(|number| {
            let Some(frame) = sequence.frame(*number) else { return true };
            let paths: Vec<PathBuf> = outputs(&options.destination, frame).unwrap_or_default();
            if !paths.is_empty() && paths.iter().all(|path| is_done(path, options.existing, &key)) {
                done_before.push(*number);
                return false;
            }
            if in_the_way.is_none() {
                in_the_way = obstacle(&paths, frame, options.existing);
            }
            true
        });
        if let Some(error) = in_the_way {
            return Err(error);
        }
        let reach = SequenceDenoiser::new(options.settings.clone())
            .map_err(|source| Error::Frame { path: input.clone(), source })?
            .reach();
        // One more: whether a frame's noise repeats its predecessor's is known only beside that.
        let plan = Plan::new(&available, &wanted, reach + 1, options.cuts.as_deref().unwrap_or_default());
        for (first, last) in &plan.gaps {
            let what =
                if first == last { format!("frame {first} is") } else { format!("frames {first} to {last} are") };
            notes.push(format!("{what} missing; the filter starts afresh behind the gap"));
        }
        if !plan.missing.is_empty() {
            notes.push(format!("there is no file of frames {}", ranges(&plan.missing)));
        }
        let footprints = adapters.iter().map(|adapter| adapter.footprint(&images)).collect();
        let job = Self {
            options,
            sequence,
            layout,
            adapters,
            mapping,
            plan,
            done_before,
            notes,
            key,
            reach,
            footprints,
            moved: OnceLock::new(),
        };
        job.memory()?;
        Ok(job)
    }

    /// How much memory it takes, and in how many bands. Before [`Job::measure`]: as if nothing moved up or down, the least
    /// that a run may take in bands.
    ///
    /// # Errors
    /// [`Error::Memory`] where it does not fit in any number of bands.
    pub fn memory(&self) -> Result<Memory, Error> {
        let moved = self.moved.get().copied().unwrap_or(0.0);
        let limit = self.limit();
        let bands = self.bands(moved, limit)?;
        let (estimate, margin) = (self.estimate(), self.margin(moved)?);
        Ok(Memory { whole: estimate.bytes(1, 0), bytes: estimate.bytes(bands, margin), bands, limit })
    }

    /// How many bands keep the limit where things move by so many rows a frame: what a dry run says and a run does.
    pub(super) fn bands(&self, moved: f32, limit: Option<(u64, bool)>) -> Result<usize, Error> {
        if let Some(bands) = self.options.bands {
            return Ok(bands);
        }
        let estimate = self.estimate();
        let fits = limit.is_none_or(|(limit, _)| estimate.bytes(1, 0) <= limit);
        // What does not fit at once waits in files before it is known how far things move.
        if fits { Ok(1) } else { Ok(estimate.bands(limit, self.margin(moved)?)?.max(2)) }
    }

    /// Reads the frames for how far things move up and down where the picture does not fit in memory at once, so that
    /// [`Job::memory`] says what the run will take. A frame that cannot be read fails in the run.
    ///
    /// # Errors
    /// [`Error::Memory`] as [`Job::memory`].
    pub fn measure(&self, stop: &AtomicBool) -> Result<(), Error> {
        if self.memory()?.bands > 1 && self.moved.get().is_none() {
            let moved = super::measure::rows_moved(self, stop);
            let _ = self.moved.set(moved);
        }
        self.memory().map(|_| ())
    }

    pub(super) fn limit(&self) -> Option<(u64, bool)> {
        self.options.max_memory.map(|limit| (limit, true)).or_else(|| Some((super::memory::system()?, false)))
    }

    pub(super) fn estimate(&self) -> Estimate {
        // The longest run of frames without a break.
        let (mut longest, mut run) = (0, 0);
        for step in &self.plan.steps {
            run = if step.fresh { 1 } else { run + 1 };
            longest = run.max(longest);
        }
        let settings = &self.options.settings;
        Estimate {
            footprints: self.footprints.clone(),
            canvas: self.canvas(),
            window: longest.min(2 * self.reach + 2),
            steady: settings.stabilise.frames as usize,
        }
    }

    /// The extent of every frame.
    pub(super) fn canvas(&self) -> ImageWindow {
        // A file has at least one layer.
        self.adapters.first().map_or(ImageWindow::new(0, 0, quell::Size::new(0, 0)), Adapter::canvas)
    }

    /// Rows around a band that decide it, where things move up or down by at most `moved` rows a frame.
    pub(super) fn margin(&self, moved: f32) -> Result<usize, Error> {
        let denoiser = SequenceDenoiser::new(self.options.settings.clone());
        let path = self.options.inputs.first().cloned().unwrap_or_default();
        let denoiser = denoiser.map_err(|source| Error::Frame { path, source })?;
        Ok(denoiser.margin(moved, self.canvas().size.height))
    }

    /// A plan for some of the frames.
    pub(super) fn plan_of(&self, wanted: &[i64]) -> Plan {
        let available: Vec<i64> = self.sequence.frames.iter().map(|frame| frame.number).collect();
        Plan::new(&available, wanted, self.reach + 1, self.options.cuts.as_deref().unwrap_or_default())
    }

    pub(super) fn run_options(&self) -> RunOptions {
        RunOptions {
            reach: self.reach,
            find_cuts: self.options.cuts.is_none(),
            whole_windows: self.options.shot.is_some(),
        }
    }

    /// What is read and written.
    pub const fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Frames that need not be made again.
    pub fn done_before(&self) -> &[i64] {
        &self.done_before
    }

    /// What each pass was taken for, and why.
    pub fn mapping(&self) -> &str {
        &self.mapping
    }

    /// Sentences that the user should read before the job runs.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The folder that files go to.
    pub fn folder(&self) -> &Path {
        self.options.destination.folder()
    }

    /// How many frames a frame sees on each side.
    pub const fn reach(&self) -> usize {
        self.reach
    }

    /// Of the filter.
    pub const fn settings(&self) -> &SequenceSettings {
        &self.options.settings
    }

    /// What would be done, for a person.
    pub fn describe(&self) -> String {
        let numbers = |wanted: bool| -> Vec<i64> {
            self.plan.steps.iter().filter(|s| s.wanted == wanted).map(|s| s.number).collect()
        };
        let (writes, reads) = (numbers(true), numbers(false));
        let or_none = |numbers: &[i64]| if numbers.is_empty() { "none".to_owned() } else { ranges(numbers) };
        let text = format!(
            "would write   {} frames: {}\nwould read    {} more around them: {}\nthere already {}\nto            {}\nwindow        \
             {} frames before and after\nmemory        {}\ntime          unknown: nothing was measured before the first frame \
             is written\n",
            writes.len(),
            or_none(&writes),
            reads.len(),
            or_none(&reads),
            or_none(&self.done_before),
            self.folder().display(),
            self.reach,
            self.memory().map_or_else(|error| error.to_string(), |memory| memory.describe())
        );
        text + &self.mapping
    }

    pub(super) fn sources(&self, number: i64) -> Result<&FrameSources, Error> {
        let missing = || Error::invalid(Path::new(&number.to_string()), "there is no such frame");
        self.sequence.frame(number).ok_or_else(missing)
    }
}

/// Every parameter by name.
pub(super) fn settings_text(settings: &SequenceSettings) -> String {
    let lines =
        SEQUENCE_PARAMETERS.iter().filter_map(|p| Some(format!("{} = {}\n", p.name, settings.get(p.name).ok()?)));
    lines.collect()
}

fn headers(frame: &FrameSources) -> Result<Vec<ExrImage>, Error> {
    frame.files.iter().map(|file| read_headers(&file.path)).collect()
}

fn named<'i>(frame: &FrameSources, images: &'i [ExrImage]) -> Vec<(String, &'i ExrImage)> {
    frame.files.iter().map(|file| file.pass.clone()).zip(images).collect()
}

/// The channels of each file, by part: frames of one layout have one mapping.
pub(super) fn layout(images: &[ExrImage]) -> Vec<Vec<String>> {
    let of = |image: &ExrImage| -> Vec<String> {
        let parts = image.parts().iter().enumerate();
        parts.flat_map(|(i, part)| part.channels().iter().map(move |c| format!("{i} {}", c.name()))).collect()
    };
    images.iter().map(of).collect()
}

pub(super) fn outputs(destination: &Destination, frame: &FrameSources) -> Result<Vec<PathBuf>, Error> {
    frame.files.iter().map(|file| destination.path(frame.number, &file.path)).collect()
}

/// Why these files may not be written, where they may not.
fn obstacle(paths: &[PathBuf], frame: &FrameSources, existing: Existing) -> Option<Error> {
    for (i, path) in paths.iter().enumerate() {
        if paths.iter().skip(i + 1).any(|other| other == path) {
            let reason = "several passes of a frame would be written to this file; name a folder instead of a pattern";
            return Some(Error::invalid(path, reason));
        }
        let Ok(absolute) = path.canonicalize() else { continue };
        if frame.files.iter().any(|file| file.path.canonicalize().is_ok_and(|input| input == absolute)) {
            return Some(Error::invalid(path, "this is an input; inputs are never replaced: choose another folder"));
        }
        if existing != Existing::Overwrite && !crate::frame_file::is_quells(path) {
            return Some(Error::Foreign { path: path.clone() });
        }
    }
    None
}

/// The first frame, and the one after it; of a sequence with gaps the first two that follow each other.
fn first_two(sequence: &Sequence) -> (&FrameSources, Option<&FrameSources>) {
    let pairs = sequence.frames.windows(2);
    for pair in pairs {
        if let [first, second] = pair
            && first.number.checked_add(1) == Some(second.number)
        {
            return (first, Some(second));
        }
    }
    // `find_sequence` returns at least one.
    (&sequence.frames[0], None)
}

/// The extent that holds every frame. Frames whose headers cannot be read say so when it is their turn.
fn canvas(sequence: &Sequence, first: &[ExrImage]) -> ImageWindow {
    let windows = |images: &[ExrImage]| images.iter().map(ExrImage::full_window).reduce(ImageWindow::union);
    let own = windows(first).unwrap_or(ImageWindow::new(0, 0, quell::Size::new(0, 0)));
    let display = first.first().map(ExrImage::display_window);
    let all = sequence.frames.iter().filter_map(|frame| headers(frame).ok());
    // A frame of another display window is another shot, and fails for itself.
    let same = all.filter(|images| images.first().map(ExrImage::display_window) == display);
    same.filter_map(|images| windows(&images)).fold(own, ImageWindow::union)
}
