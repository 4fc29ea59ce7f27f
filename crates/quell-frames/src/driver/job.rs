//! A job as a user gives it: which files, which frames, what becomes of them.

use super::cuts::CutGuides;
use super::output::{Destination, Existing, JOB_ATTRIBUTE, is_done, job_key};
use super::pipeline::{self, Event, Files, Outcome, RunOptions, Window};
use super::plan::{Plan, ranges};
use crate::adapt::{AdaptOptions, Adapter, Links, reads};
use crate::error::Error;
use crate::image::{ExrImage, ImageWriteOptions, Window as ImageWindow, read_channels, read_headers};
use crate::roles::{MapOptions, map_roles};
use crate::sequence::{FrameSources, Sequence, find_sequence};
use quell::Plane;
use quell::sequence::{Filtered, SEQUENCE_PARAMETERS, SequenceDenoiser, SequenceFrame, SequenceSettings};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

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
}

/// A job that is ready to run: files found, passes mapped, frames chosen.
#[derive(Debug)]
pub struct Job {
    options: JobOptions,
    sequence: Sequence,
    layout: Vec<Vec<String>>,
    adapters: Vec<Adapter>,
    mapping: String,
    plan: Plan,
    done_before: Vec<i64>,
    notes: Vec<String>,
    key: String,
    reach: usize,
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
        let key = job_key([env!("CARGO_PKG_VERSION"), &settings, &mapping, &cuts, &adapt]);

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
        Ok(Self { options, sequence, layout, adapters, mapping, plan, done_before, notes, key, reach })
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
            "would write   {} frames: {}\nwould read    {} more for their sake: {}\nthere already {}\nto            {}\nwindow        \
             {} frames before and after\n",
            writes.len(),
            or_none(&writes),
            reads.len(),
            or_none(&reads),
            or_none(&self.done_before),
            self.folder().display(),
            self.reach
        );
        text + &self.mapping
    }

    /// Runs it: see [`pipeline::run`].
    ///
    /// # Errors
    /// As there.
    pub fn run(&self, stop: &AtomicBool, told: &(dyn Fn(Event) + Sync)) -> Result<Outcome, Error> {
        let mut window = Denoisers::new(self)?;
        let options = RunOptions {
            reach: self.reach,
            find_cuts: self.options.cuts.is_none(),
            whole_windows: self.options.shot.is_some(),
        };
        let links = self.adapters.iter().map(|_| Links::default()).collect();
        let disk = Disk { job: self, links: Mutex::new(links) };
        pipeline::run(&self.plan, &disk, &mut window, options, stop, told)
    }

    fn sources(&self, number: i64) -> Result<&FrameSources, Error> {
        let missing = || Error::invalid(Path::new(&number.to_string()), "there is no such frame");
        self.sequence.frame(number).ok_or_else(missing)
    }
}

/// Every parameter by name.
fn settings_text(settings: &SequenceSettings) -> String {
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
fn layout(images: &[ExrImage]) -> Vec<Vec<String>> {
    let of = |image: &ExrImage| -> Vec<String> {
        let parts = image.parts().iter().enumerate();
        parts.flat_map(|(i, part)| part.channels().iter().map(move |c| format!("{i} {}", c.name()))).collect()
    };
    images.iter().map(of).collect()
}

fn outputs(destination: &Destination, frame: &FrameSources) -> Result<Vec<PathBuf>, Error> {
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

/// Where frames come from and go to.
struct Disk<'j> {
    job: &'j Job,
    /// Of each layer and view: what a frame needs to know of its predecessor.
    links: Mutex<Vec<Links>>,
}

/// A frame as read.
struct Loaded {
    /// Its files; empty where it is not wanted.
    images: Vec<ExrImage>,
    /// What each layer and view became.
    frames: Vec<SequenceFrame>,
}

/// A frame as filtered.
struct Done {
    images: Vec<ExrImage>,
    /// Of each layer and view: what it was, without its light; and what the filter made of it.
    filtered: Vec<(SequenceFrame, Filtered)>,
}

impl Files for Disk<'_> {
    type Loaded = Loaded;
    type Done = Done;

    fn read(&self, number: i64, wanted: bool) -> Result<(Loaded, Vec<String>), Error> {
        let job = self.job;
        let sources = job.sources(number)?;
        let path = || sources.files.first().map_or(Path::new(""), |file| file.path.as_path());
        let files = sources.files.iter().enumerate();
        let read = files.map(|(i, file)| {
            let needed: Vec<_> = job.adapters.iter().map(|adapter| adapter.reads(i)).collect();
            read_channels(&file.path, |part, channel| needed.iter().any(|needed| needed(part, channel)))
        });
        let mut images = read.collect::<Result<Vec<_>, _>>()?;
        if layout(&images) != job.layout {
            let reason = "its parts or channels are not those of the first frame; filter it as a job of its own";
            return Err(Error::invalid(path(), reason));
        }
        let mut notes = Vec::new();
        let mut frames = Vec::with_capacity(job.adapters.len());
        let mut links = self.links.lock().map_err(|_| Error::invalid(path(), "reading failed before"))?;
        for (adapter, links) in job.adapters.iter().zip(links.iter_mut()) {
            if images.iter().any(|image| image.full_window().union(adapter.canvas()) != adapter.canvas()) {
                let reason = format!("it has pixels outside of {}, which holds the other frames", adapter.canvas());
                return Err(Error::invalid(path(), reason));
            }
            let adapted = adapter.frame(number, &images, links)?;
            notes.extend(adapted.notes);
            frames.push(adapted.frame);
        }
        if !wanted {
            images.clear();
        }
        Ok((Loaded { images, frames }, notes))
    }

    fn write(&self, number: i64, done: Done) -> Result<Vec<String>, Error> {
        let job = self.job;
        let sources = job.sources(number)?;
        let mut images = done.images;
        let mut notes = Vec::new();
        let mut repaired = 0;
        for (adapter, (frame, filtered)) in job.adapters.iter().zip(done.filtered) {
            let lights: Vec<_> =
                filtered.lights.into_iter().filter_map(|light| light.planes.into_iter().next()).collect();
            adapter.write_back(&mut images, &frame, &lights, filtered.alpha.as_ref())?;
            repaired += filtered.repaired;
        }
        if repaired > 0 {
            notes.push(format!(
                "frame {number}: {repaired} pixels held colours that are no numbers, and count as black"
            ));
        }
        if let Some(adapter) = job.adapters.first() {
            adapter.sign(&mut images, &settings_text(&job.options.settings))?;
        }
        let options = ImageWriteOptions { overwrite: job.options.existing == Existing::Overwrite };
        for (image, path) in images.iter_mut().zip(outputs(&job.options.destination, sources)?) {
            image.set_text("quell.mapping", &job.mapping)?;
            image.set_text(JOB_ATTRIBUTE, &job.key)?;
            notes.extend(image.write(&path, &options)?.notes);
        }
        Ok(notes)
    }
}

/// What writing back needs of a frame: lights without their light. The filter has the rest.
fn without_light(frame: &SequenceFrame) -> SequenceFrame {
    let mut kept = SequenceFrame::new(frame.number, frame.size);
    kept.lights = (frame.lights.iter())
        .map(|light| quell::sequence::Light {
            name: light.name.clone(),
            kind: light.kind,
            light: Plane::filled(quell::Size::new(1, 1), [0.0; 3]),
            weight: light.weight.clone(),
            in_beauty: light.in_beauty,
            joint: Vec::new(),
        })
        .collect();
    kept
}

/// A filter for each layer and view, which go through the frames side by side.
struct Denoisers {
    each: Vec<SequenceDenoiser>,
    path: PathBuf,
    before: Vec<CutGuides>,
    /// Wanted frames that are inside.
    inside: BTreeMap<i64, Inside>,
}

struct Inside {
    images: Vec<ExrImage>,
    kept: Vec<SequenceFrame>,
    filtered: Vec<Option<Filtered>>,
}

impl Denoisers {
    fn new(job: &Job) -> Result<Self, Error> {
        let path = job.options.inputs.first().cloned().unwrap_or_default();
        let new = |_| SequenceDenoiser::new(job.options.settings.clone());
        let each = job.adapters.iter().map(new).collect::<Result<Vec<_>, _>>();
        let each = each.map_err(|source| Error::Frame { path: path.clone(), source })?;
        Ok(Self { each, path, before: Vec::new(), inside: BTreeMap::new() })
    }

    fn failed(&self, source: quell::Error) -> Error {
        Error::Frame { path: self.path.clone(), source }
    }

    fn take(&mut self, which: usize, out: Vec<Filtered>) {
        for filtered in out {
            if let Some(inside) = self.inside.get_mut(&filtered.number)
                && let Some(place) = inside.filtered.get_mut(which)
            {
                *place = Some(filtered);
            }
        }
    }

    /// Frames of which every layer and view is there.
    fn complete(&mut self) -> Vec<(i64, Done)> {
        let ready: Vec<i64> = (self.inside.iter())
            .filter(|(_, inside)| inside.filtered.iter().all(Option::is_some))
            .map(|(number, _)| *number)
            .collect();
        let done = ready.into_iter().filter_map(|number| {
            let inside = self.inside.remove(&number)?;
            let filtered = inside.kept.into_iter().zip(inside.filtered.into_iter().flatten()).collect();
            Some((number, Done { images: inside.images, filtered }))
        });
        done.collect()
    }
}

impl Window for Denoisers {
    type Loaded = Loaded;
    type Done = Done;

    fn push(&mut self, number: i64, loaded: Loaded, wanted: bool) -> Result<Vec<(i64, Done)>, Error> {
        self.before = loaded.frames.iter().map(CutGuides::of).collect();
        if wanted {
            let filtered = loaded.frames.iter().map(|_| None).collect();
            let kept = loaded.frames.iter().map(without_light).collect();
            self.inside.insert(number, Inside { images: loaded.images, kept, filtered });
        }
        for (which, frame) in loaded.frames.into_iter().enumerate() {
            let Some(denoiser) = self.each.get_mut(which) else { continue };
            match denoiser.push(frame, wanted) {
                Ok(out) => self.take(which, out),
                Err(source) => {
                    self.inside.remove(&number);
                    return Err(self.failed(source));
                }
            }
        }
        Ok(self.complete())
    }

    fn finish(&mut self) -> Result<Vec<(i64, Done)>, Error> {
        self.before.clear();
        for which in 0..self.each.len() {
            let Some(denoiser) = self.each.get_mut(which) else { continue };
            match denoiser.finish() {
                Ok(out) => self.take(which, out),
                Err(source) => {
                    self.inside.clear();
                    return Err(self.failed(source));
                }
            }
        }
        let done = self.complete();
        self.inside.clear();
        Ok(done)
    }

    fn is_cut(&self, loaded: &Loaded) -> bool {
        self.before.iter().zip(&loaded.frames).any(|(before, frame)| before.cut_before(frame))
    }
}
