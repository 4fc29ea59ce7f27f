//! Frames on their way from files through the filter to files: what each step keeps of them.

use super::job::{Job, layout, outputs, settings_text};
use super::layers::{self, Before, Taken};
use super::output::{Existing, JOB_ATTRIBUTE};
use super::pipeline::{Files, Window};
use crate::adapt::{FrameNoise, NOISE_PASS};
use crate::error::Error;
use crate::image::{ExrImage, ImageWriteOptions, read_channels};
use quell::Backend;
use quell::sequence::{Accelerator, Filtered, PreparedFrame, SequenceDenoiser, SequenceFrame, SequenceSettings};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Where frames come from and go to.
pub(super) struct Disk<'j> {
    job: &'j Job,
    /// Of each layer and view. Frames are read one after the other.
    before: Mutex<Vec<Before>>,
    /// Of the frames that were written.
    noise: Mutex<BTreeMap<i64, FrameNoise>>,
}

/// A frame as read.
pub(super) struct Loaded {
    /// Its files without their samples; empty where it is not wanted.
    pub images: Vec<ExrImage>,
    /// What each layer and view became, with a description of its lights.
    pub frames: Vec<(PreparedFrame, SequenceFrame)>,
    /// It shows something else than the frame before.
    pub cut: bool,
}

/// A frame as filtered.
pub(super) struct Done {
    pub images: Vec<ExrImage>,
    /// Of each layer and view: its lights described, and what the filter made of them.
    pub filtered: Vec<(SequenceFrame, Filtered)>,
}

impl<'j> Disk<'j> {
    pub(super) fn new(job: &'j Job) -> Self {
        let before = Mutex::new(job.adapters.iter().map(|_| Before::default()).collect());
        Self { job, before, noise: Mutex::default() }
    }

    /// How much noise the frames that were written had and have, ascending.
    pub(super) fn noise(&self) -> Vec<(i64, FrameNoise)> {
        self.noise
            .lock()
            .map(|noise| noise.iter().map(|(number, found)| (*number, *found)).collect())
            .unwrap_or_default()
    }
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
        let mut before = self.before.lock().map_err(|_| Error::invalid(path(), "reading failed before"))?;
        let find_cuts = job.options.cuts.is_none();
        let Taken { frames, cut, notes } =
            layers::take(&job.adapters, &mut before, &job.options.settings, find_cuts, number, &images)?;
        if wanted {
            // Frames wait long to be written: what is not replaced is read again then.
            images.iter_mut().for_each(ExrImage::forget);
        } else {
            images.clear();
        }
        Ok((Loaded { images, frames, cut }, notes))
    }

    fn write(&self, number: i64, done: Done) -> Result<Vec<String>, Error> {
        let job = self.job;
        let sources = job.sources(number)?;
        let mut images = done.images;
        let put = layers::put(&job.adapters, job.options.measure_noise, number, &mut images, done.filtered)?;
        let mut notes = put.notes;
        if let (Some(measured), Ok(mut noise)) = (put.measured, self.noise.lock()) {
            noise.entry(number).or_insert(measured);
        }
        // Places of channels change with those that are added: after all else.
        for (adapter, noise) in job.adapters.iter().zip(put.errors).filter(|_| job.options.adapt.noise_pass) {
            match noise {
                Some(noise) => adapter.write_noise(&mut images, &noise)?,
                None => notes.push(format!(
                    "there is no pass `{NOISE_PASS}`: the stage that estimates it (`blend`) is switched off"
                )),
            }
        }
        if let Some(adapter) = job.adapters.first() {
            adapter.sign(&mut images, &settings_text(&job.options.settings))?;
        }
        let options = ImageWriteOptions { overwrite: job.options.existing == Existing::Overwrite };
        for (image, path) in images.iter_mut().zip(outputs(&job.options.destination, sources)?) {
            image.set_text("quell.mapping", &job.mapping)?;
            image.set_text(JOB_ATTRIBUTE, &job.key)?;
            image.set_text("quell.backend", &job.options.back_end())?;
            notes.extend(image.write(&path, &options)?.notes);
        }
        Ok(notes)
    }
}

/// A filter for each layer and view, which go through the frames side by side.
pub(super) struct Denoisers {
    each: Vec<SequenceDenoiser>,
    /// Wanted frames that are inside.
    inside: BTreeMap<i64, Inside>,
}

struct Inside {
    images: Vec<ExrImage>,
    described: Vec<SequenceFrame>,
    filtered: Vec<Option<Filtered>>,
}

impl Denoisers {
    pub(super) fn new(job: &Job) -> Result<Self, Error> {
        let path: PathBuf = job.options.inputs.first().cloned().unwrap_or_default();
        let options = &job.options;
        Self::of(job.adapters.len(), &path, &options.settings, options.backend, options.accelerator.as_ref())
    }

    /// So many filters; `path` stands in messages.
    pub(super) fn of(
        count: usize,
        path: &Path,
        settings: &SequenceSettings,
        backend: Backend,
        accelerator: Option<&Arc<dyn Accelerator>>,
    ) -> Result<Self, Error> {
        let new = |_| match accelerator {
            None => SequenceDenoiser::with_backend(settings.clone(), backend),
            Some(accelerator) => SequenceDenoiser::with_accelerator(settings.clone(), Arc::clone(accelerator)),
        };
        let each = (0..count).map(new).collect::<Result<Vec<_>, _>>();
        let each = each.map_err(|source| Error::Frame { path: path.to_owned(), source })?;
        Ok(Self { each, inside: BTreeMap::new() })
    }
}

/// Takes what one filter made of a frame, and gives the frame out when all have done so.
fn collect(
    inside: &mut BTreeMap<i64, Inside>,
    which: usize,
    filtered: Filtered,
    out: &mut dyn FnMut(i64, Done) -> bool,
) -> bool {
    let number = filtered.number;
    if let Some(place) = inside.get_mut(&number).and_then(|inside| inside.filtered.get_mut(which)) {
        *place = Some(filtered);
    }
    if inside.get(&number).is_none_or(|inside| inside.filtered.iter().any(Option::is_none)) {
        return true;
    }
    let Some(complete) = inside.remove(&number) else { return true };
    let filtered = complete.described.into_iter().zip(complete.filtered.into_iter().flatten()).collect();
    out(number, Done { images: complete.images, filtered })
}

impl Window for Denoisers {
    type Loaded = Loaded;
    type Done = Done;

    fn push(
        &mut self,
        number: i64,
        loaded: Loaded,
        wanted: bool,
        out: &mut dyn FnMut(i64, Done) -> bool,
    ) -> Result<(), Error> {
        let (frames, described): (Vec<_>, Vec<_>) = loaded.frames.into_iter().unzip();
        let Self { each, inside } = self;
        if wanted {
            let filtered = frames.iter().map(|_| None).collect();
            inside.insert(number, Inside { images: loaded.images, described, filtered });
        }
        for (which, (denoiser, frame)) in each.iter_mut().zip(frames).enumerate() {
            let taken = denoiser.push_to(frame, wanted, &mut |filtered| collect(inside, which, filtered, out));
            taken.map_err(Error::Filter)?;
        }
        Ok(())
    }

    fn finish(&mut self, out: &mut dyn FnMut(i64, Done) -> bool) -> Result<(), Error> {
        let Self { each, inside } = self;
        for (which, denoiser) in each.iter_mut().enumerate() {
            let taken = denoiser.finish_to(&mut |filtered| collect(inside, which, filtered, out));
            taken.map_err(Error::Filter)?;
        }
        inside.clear();
        Ok(())
    }

    fn is_cut(&self, loaded: &Loaded) -> bool {
        loaded.cut
    }
}
