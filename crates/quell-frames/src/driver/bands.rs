//! Jobs that do not fit in memory: the picture in bands of rows, one after the other, with what waits in files beside
//! the output.
//!
//! Frames are read once, made ready whole, and put aside ([`quell::sequence::SpooledFrame`]). Each band goes through all
//! frames with the rows around it that decide it, so its bits are those of the whole picture. What the filter made of the
//! bands waits too, until the last one is done and the frames are written.

use super::clock::{Busy, pool_seconds};
use super::frames::{Denoisers, Disk, Done, Loaded};
use super::job::Job;
use super::measure::read_linked;
use super::pipeline::{self, Event, Fate, Files, Outcome};
use super::plan::Plan;
use crate::error::Error;
use crate::image::ExrImage;
use quell::sequence::{Filtered, FilteredLight, SequenceFrame, SpooledFrame};
use quell::{Plane, Rgb, Size};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Frames that are written together: what waits for the last band takes room on the disk.
const FRAMES_AT_ONCE: usize = 24;

/// Runs a job in bands. `count` says how many for rows of motion a frame.
pub(super) fn run(
    job: &Job,
    count: &dyn Fn(f32) -> Result<usize, Error>,
    stop: &AtomicBool,
    notify: &(dyn Fn(Event) + Sync),
) -> Result<Outcome, Error> {
    let mut all = Outcome {
        frames: Vec::new(),
        cuts: Vec::new(),
        ended: None,
        times: super::Times::default(),
        noise: Vec::new(),
    };
    let begin = std::time::Instant::now();
    let wanted: Vec<i64> = job.plan().steps.iter().filter(|s| s.wanted).map(|s| s.number).collect();
    for some in wanted.chunks(FRAMES_AT_ONCE) {
        if all.ended.is_some() {
            all.frames.extend(some.iter().map(|number| (*number, Fate::Skipped)));
            continue;
        }
        let scratch = Scratch::new(job.folder())?;
        let part = Part { job, plan: job.plan_of(some), disk: Disk::new(job), scratch: &scratch };
        part.run(count, stop, notify, &mut all)?;
        all.noise.extend(part.disk.noise());
    }
    all.cuts.sort_unstable();
    all.cuts.dedup();
    all.times.wall = begin.elapsed().as_secs_f64();
    Ok(all)
}

/// A folder for files that wait, removed at the end whatever happens.
struct Scratch {
    folder: PathBuf,
}

impl Scratch {
    fn new(beside: &Path) -> Result<Self, Error> {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let name = format!(".quell.{}-{}.part", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed));
        let folder = beside.join(name);
        fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, "create folder", e))?;
        Ok(Self { folder })
    }

    fn file(&self, name: &str, number: i64, which: usize) -> PathBuf {
        self.folder.join(format!("{number}.{which}.{name}"))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Nothing more can be done where even this fails.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// A frame that was read.
enum Entry {
    Kept(Kept),
    /// It was not, for this reason.
    Failed(String),
}

struct Kept {
    /// Its files without samples.
    images: Vec<ExrImage>,
    layers: Vec<(SpooledFrame, SequenceFrame)>,
    cut: bool,
}

/// Some frames of a job.
struct Part<'j> {
    job: &'j Job,
    plan: Plan,
    disk: Disk<'j>,
    scratch: &'j Scratch,
}

impl Part<'_> {
    fn run(
        &self,
        count: &dyn Fn(f32) -> Result<usize, Error>,
        stop: &AtomicBool,
        notify: &(dyn Fn(Event) + Sync),
        all: &mut Outcome,
    ) -> Result<(), Error> {
        let asked = || stop.load(Ordering::SeqCst);
        let (before, mut busy) = (pool_seconds(), Busy::default());
        let (entries, moved) = busy.during(|| self.spool(&asked, notify))?;
        add(&mut all.times.reading.cpu, since(before));
        all.times.reading.busy += busy.seconds();

        let size = self.job.canvas().size;
        let bands = count(moved)?.clamp(1, size.height.max(1));
        let margin = self.job.margin(moved)?;
        let mut fates: BTreeMap<i64, Fate> = BTreeMap::new();
        let layouts = Mutex::new(BTreeMap::new());
        for band in 0..bands {
            if asked() {
                break;
            }
            notify(Event::Band(band, bands));
            let core = band * size.height / bands..(band + 1) * size.height / bands;
            let rows = core.start.saturating_sub(margin)..(core.end + margin).min(size.height);
            let files = Band { part: self, entries: &entries, rows, core, band, layouts: &layouts };
            // What is wrong with a frame is wrong in every band.
            let once = |event: Event| match event {
                Event::Written(_) | Event::Read(_) => {}
                event if band == 0 => notify(event),
                _ => {}
            };
            let mut window = Denoisers::new(self.job)?;
            let outcome = pipeline::run(&self.plan, &files, &mut window, self.job.run_options(), stop, &once)?;
            for (number, fate) in outcome.frames {
                let worse = fate != Fate::Written || !fates.contains_key(&number);
                if worse && !matches!(fates.get(&number), Some(Fate::Failed(_))) {
                    fates.insert(number, fate);
                }
            }
            if band == 0 {
                all.cuts.extend(outcome.cuts);
            }
            for (sum, time) in [
                (&mut all.times.reading, outcome.times.reading),
                (&mut all.times.filtering, outcome.times.filtering),
                (&mut all.times.writing, outcome.times.writing),
            ] {
                add(&mut sum.cpu, time.cpu);
                sum.busy += time.busy;
            }
            if outcome.ended.is_some() {
                all.ended = outcome.ended;
                break;
            }
        }
        if asked() {
            all.ended = Some(String::new());
        }
        let (before, mut busy) = (pool_seconds(), Busy::default());
        let layouts = layouts.into_inner().unwrap_or_default();
        for (number, fate) in fates {
            let fate = if fate != Fate::Written {
                fate
            } else if all.ended.is_some() || asked() {
                all.ended.get_or_insert_default();
                Fate::Skipped
            } else {
                busy.during(|| self.write(number, &entries, &layouts, bands, notify, &mut all.ended))
            };
            all.frames.push((number, fate));
        }
        // Frames that no band came to.
        for step in self.plan.steps.iter().filter(|s| s.wanted) {
            if !all.frames.iter().any(|(number, _)| *number == step.number) {
                all.frames.push((step.number, Fate::Skipped));
            }
        }
        add(&mut all.times.writing.cpu, since(before));
        all.times.writing.busy += busy.seconds();
        Ok(())
    }

    /// Reads every frame and puts it aside; the most rows that motion leads up or down in a frame.
    fn spool(
        &self,
        asked: &dyn Fn() -> bool,
        notify: &(dyn Fn(Event) + Sync),
    ) -> Result<(BTreeMap<i64, Entry>, f32), Error> {
        let mut entries = BTreeMap::new();
        let mut moved = 0.0f32;
        let mut keep = |number: i64, frame: Result<Loaded, Error>| {
            let entry = match frame {
                Ok(loaded) => Entry::Kept(self.keep(number, loaded, &mut moved)?),
                Err(error) => Entry::Failed(error.to_string()),
            };
            entries.insert(number, entry);
            Ok(())
        };
        read_linked(self.job, &self.plan, &self.disk, true, asked, notify, &mut keep)?;
        Ok((entries, moved))
    }

    fn keep(&self, number: i64, loaded: Loaded, moved: &mut f32) -> Result<Kept, Error> {
        let mut layers = Vec::with_capacity(loaded.frames.len());
        for (which, (frame, described)) in loaded.frames.into_iter().enumerate() {
            *moved = frame.rows_moved().into_iter().fold(*moved, f32::max);
            let path = self.scratch.file("frame", number, which);
            let failed = |e| Error::io(&path, "write", e);
            let mut writer = BufWriter::new(File::create(&path).map_err(failed)?);
            let spooled = frame.spool(&mut writer).map_err(failed)?;
            writer.flush().map_err(failed)?;
            layers.push((spooled, described));
        }
        Ok(Kept { images: loaded.images, layers, cut: loaded.cut })
    }

    /// Puts the bands of a frame together and writes it.
    fn write(
        &self,
        number: i64,
        entries: &BTreeMap<i64, Entry>,
        layouts: &BTreeMap<(i64, usize), Layout>,
        bands: usize,
        notify: &(dyn Fn(Event) + Sync),
        ended: &mut Option<String>,
    ) -> Fate {
        let written = self.assemble(number, entries, layouts, bands).and_then(|done| self.disk.write(number, done));
        match written {
            Ok(notes) => {
                notes.into_iter().for_each(|note| notify(Event::Note(note)));
                notify(Event::Written(number));
                Fate::Written
            }
            Err(error) => {
                let reason = error.to_string();
                notify(Event::Failed(number, reason.clone()));
                if error.is_lasting() {
                    *ended = Some(reason.clone());
                }
                Fate::Failed(reason)
            }
        }
    }

    fn assemble(
        &self,
        number: i64,
        entries: &BTreeMap<i64, Entry>,
        layouts: &BTreeMap<(i64, usize), Layout>,
        bands: usize,
    ) -> Result<Done, Error> {
        let missing = || Error::invalid(Path::new(&number.to_string()), "the frame was not kept");
        let Some(Entry::Kept(kept)) = entries.get(&number) else { return Err(missing()) };
        let size = self.job.canvas().size;
        let mut filtered = Vec::with_capacity(kept.layers.len());
        for (which, (_, described)) in kept.layers.iter().enumerate() {
            let layout = layouts.get(&(number, which)).ok_or_else(missing)?;
            let mut whole = layout.empty(number, size);
            for band in 0..bands {
                let rows = band * size.height / bands..(band + 1) * size.height / bands;
                let path = self.scratch.file(&format!("band{band}"), number, which);
                let failed = |e| Error::io(&path, "read", e);
                let mut reader = BufReader::with_capacity(1 << 18, File::open(&path).map_err(failed)?);
                layout.read(&mut reader, rows, &mut whole).map_err(failed)?;
                // Its room is wanted for the frame itself.
                let _ = fs::remove_file(&path);
            }
            filtered.push((described.clone(), layout.finished(whole)));
        }
        Ok(Done { images: kept.images.clone(), filtered })
    }
}

/// Processor seconds since `before`.
fn since(before: Option<f64>) -> Option<f64> {
    before.zip(pool_seconds()).map(|(before, after)| after - before)
}

/// The first part begins with none; where the system does not report it, nothing is added.
fn add(sum: &mut Option<f64>, spent: Option<f64>) {
    *sum = spent.map(|spent| sum.unwrap_or(0.0) + spent).or(*sum);
}

/// Frames of one band: out of the files that wait, into files that wait.
struct Band<'p> {
    part: &'p Part<'p>,
    entries: &'p BTreeMap<i64, Entry>,
    /// What is filtered, and what of it is kept.
    rows: Range<usize>,
    core: Range<usize>,
    band: usize,
    layouts: &'p Mutex<BTreeMap<(i64, usize), Layout>>,
}

impl Files for Band<'_> {
    type Loaded = Loaded;
    type Done = Done;

    fn read(&self, number: i64, _wanted: bool) -> Result<(Loaded, Vec<String>), Error> {
        let kept = match self.entries.get(&number) {
            Some(Entry::Kept(kept)) => kept,
            Some(Entry::Failed(reason)) => return Err(Error::Told(reason.clone())),
            None => return Err(Error::Told(format!("frame {number} was not read"))),
        };
        let mut frames = Vec::with_capacity(kept.layers.len());
        for (which, (spooled, described)) in kept.layers.iter().enumerate() {
            let path = self.part.scratch.file("frame", number, which);
            let failed = |e| Error::io(&path, "read", e);
            let mut file = File::open(&path).map_err(failed)?;
            frames.push((spooled.rows(&mut file, self.rows.clone()).map_err(failed)?, described.clone()));
        }
        Ok((Loaded { images: Vec::new(), frames, cut: kept.cut }, Vec::new()))
    }

    fn write(&self, number: i64, done: Done) -> Result<Vec<String>, Error> {
        for (which, (_, filtered)) in done.filtered.into_iter().enumerate() {
            let path = self.part.scratch.file(&format!("band{}", self.band), number, which);
            let failed = |e| Error::io(&path, "write", e);
            let layout = Layout::of(&filtered);
            let mut writer = BufWriter::with_capacity(1 << 18, File::create(&path).map_err(failed)?);
            let first = self.rows.start;
            layout.write(&mut writer, &filtered, self.core.start - first..self.core.end - first).map_err(failed)?;
            writer.flush().map_err(failed)?;
            if let Ok(mut layouts) = self.layouts.lock() {
                layouts.insert((number, which), layout);
            }
        }
        Ok(Vec::new())
    }
}

/// What a filtered frame holds: the same in every band.
struct Layout {
    /// Of each light: its planes, and which of the weights is its own.
    lights: Vec<(usize, Option<usize>)>,
    weights: usize,
    alpha: bool,
    noise: bool,
    repaired: usize,
}

/// A filtered frame while its bands are put together.
struct Whole {
    number: i64,
    planes: Vec<Vec<Plane<Rgb>>>,
    weights: Vec<Plane<Rgb>>,
    alpha: Option<Plane<f32>>,
    noise: Option<Plane<f32>>,
}

impl Layout {
    fn of(filtered: &Filtered) -> Self {
        let unique = unique(filtered);
        let place = |w: &Arc<Plane<Rgb>>| unique.iter().position(|u| Arc::ptr_eq(u, w));
        let lights = filtered.lights.iter().map(|l| (l.planes.len(), l.weight.as_ref().and_then(place))).collect();
        let (alpha, noise) = (filtered.alpha.is_some(), filtered.noise.is_some());
        Self { lights, weights: unique.len(), alpha, noise, repaired: filtered.repaired }
    }

    fn write(&self, to: &mut impl Write, filtered: &Filtered, rows: Range<usize>) -> io::Result<()> {
        for light in &filtered.lights {
            for plane in &light.planes {
                let black = plane.data().iter().all(|c| *c == [0.0; 3]);
                to.write_all(&[u8::from(black)])?;
                if !black {
                    put(to, plane, rows.clone())?;
                }
            }
        }
        for weight in unique(filtered) {
            put(to, weight, rows.clone())?;
        }
        for plane in [&filtered.alpha, &filtered.noise].into_iter().flatten() {
            for y in rows.clone() {
                to.write_all(bytemuck::cast_slice(plane.row(y)))?;
            }
        }
        Ok(())
    }

    fn empty(&self, number: i64, size: Size) -> Whole {
        let black = || Plane::filled(size, [0.0; 3]);
        Whole {
            number,
            planes: self.lights.iter().map(|(planes, _)| (0..*planes).map(|_| black()).collect()).collect(),
            weights: (0..self.weights).map(|_| black()).collect(),
            alpha: self.alpha.then(|| Plane::filled(size, 0.0)),
            noise: self.noise.then(|| Plane::filled(size, 0.0)),
        }
    }

    fn read(&self, from: &mut impl Read, rows: Range<usize>, whole: &mut Whole) -> io::Result<()> {
        for plane in whole.planes.iter_mut().flatten() {
            let mut black = [0];
            from.read_exact(&mut black)?;
            if black == [0] {
                get(from, plane, rows.clone())?;
            }
        }
        for weight in &mut whole.weights {
            get(from, weight, rows.clone())?;
        }
        for plane in [&mut whole.alpha, &mut whole.noise].into_iter().flatten() {
            for y in rows.clone() {
                from.read_exact(bytemuck::cast_slice_mut(plane.row_mut(y)))?;
            }
        }
        Ok(())
    }

    fn finished(&self, whole: Whole) -> Filtered {
        let weights: Vec<Arc<Plane<Rgb>>> = whole.weights.into_iter().map(Arc::new).collect();
        let lights = self.lights.iter().zip(whole.planes).map(|((_, weight), planes)| FilteredLight {
            planes,
            weight: weight.and_then(|at| weights.get(at).cloned()),
        });
        let none = || Plane::filled(Size::new(0, 0), 0.0);
        Filtered {
            number: whole.number,
            lights: lights.collect(),
            alpha: whole.alpha,
            // Nobody writes these two.
            confidence: none(),
            noise: whole.noise,
            samples: none(),
            repaired: self.repaired,
        }
    }
}

fn unique(filtered: &Filtered) -> Vec<&Arc<Plane<Rgb>>> {
    let mut unique: Vec<&Arc<Plane<Rgb>>> = Vec::new();
    for weight in filtered.lights.iter().filter_map(|l| l.weight.as_ref()) {
        if !unique.iter().any(|u| Arc::ptr_eq(u, weight)) {
            unique.push(weight);
        }
    }
    unique
}

fn put(to: &mut impl Write, plane: &Plane<Rgb>, rows: Range<usize>) -> io::Result<()> {
    rows.into_iter().try_for_each(|y| to.write_all(bytemuck::cast_slice(plane.row(y))))
}

fn get(from: &mut impl Read, plane: &mut Plane<Rgb>, rows: Range<usize>) -> io::Result<()> {
    rows.into_iter().try_for_each(|y| from.read_exact(bytemuck::cast_slice_mut(plane.row_mut(y))))
}
