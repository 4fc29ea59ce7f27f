//! One method after the other over all frames: pictures, time a frame, peak memory; kept, so that a comparison that
//! was interrupted goes on where it stopped.

use super::memory::{Memory, Meter};
use super::sequence::{START_FRAMES, Sequence};
use crate::backend::Backend;
use crate::error::Error;
use crate::methods::external::{Competitor, numbered_files, run_command};
use crate::methods::{FinishedPicture, Method, parse_on};
use crate::report::Spread;
use quell::{Frame, Plane, Rgb};
use quell_frames::{Content, FrameToWrite, Metadata, Precision, WriteOptions, frame_path, read_picture, write_frame};
use quell_trace::TraceError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Says that a method is finished; written last.
const DONE: &str = "done.json";
/// Subfolder of finished pictures.
const METHODS: &str = "methods";

/// What all runs share.
#[derive(Clone, Copy)]
pub struct Runner<'a> {
    /// Where finished pictures are kept.
    pub folder: &'a Path,
    /// Stands for the program's version: pictures of another one are made anew.
    pub program: &'a str,
    /// What quell's own methods run on; those of others run on the CPU.
    pub backend: &'a Backend,
    /// Measures memory.
    pub memory: &'a dyn Memory,
    /// Work ends soon after this turns true.
    pub cancel: Option<&'a AtomicBool>,
}

/// What a method delivered.
#[derive(Clone, Debug)]
pub struct Finished {
    /// As it is listed.
    pub name: String,
    /// A frame's time over steady frames (all but the first where there are none); `None`: frames that were there.
    pub milliseconds: Option<Spread>,
    /// Largest memory that it held at once, without its input; `None` where it cannot be known.
    pub peak_bytes: Option<u64>,
    /// What a reader must know.
    pub notes: Vec<String>,
    /// The back end that it ran on, where that is not this processor.
    pub backend: Option<String>,
    /// An earlier run made it.
    pub resumed: bool,
    files: Vec<PathBuf>,
}

/// What stands in the file that is written last.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Done {
    key: String,
    /// Of each frame; whole numbers, which JSON keeps to the bit.
    nanoseconds: Vec<u64>,
    peak_bytes: Option<u64>,
    notes: Vec<String>,
    #[serde(default)]
    backend: Option<String>,
}

impl Finished {
    /// The finished picture of frame `index` of the sequence, as it was kept.
    ///
    /// # Errors
    /// A file that cannot be read any more; [`Error::Empty`] where there is no such frame.
    pub fn picture(&self, index: usize) -> Result<Plane<Rgb>, Error> {
        let path = self.files.get(index).ok_or_else(|| Error::Empty { what: format!("there is no frame {index}") })?;
        Ok(read_picture(path)?)
    }
}

impl Runner<'_> {
    /// Runs a competitor over all frames, or finds what an earlier run left. `notify` hears the number of frames done.
    ///
    /// # Errors
    /// [`Error::Trace`] with [`TraceError::Cancelled`] after a stop; anything else is this method's own misfortune and
    /// need not keep others from running.
    pub fn run(&self, sequence: &Sequence, what: &Competitor, notify: &dyn Fn(usize)) -> Result<Finished, Error> {
        let folder = self.folder.join(METHODS).join(folder_name(what.name()));
        match what {
            Competitor::Frames { name, folder } => finished_frames(sequence, name, folder, None),
            Competitor::Method { name } => {
                // On another back end quell's own methods give other bits and times.
                let here = matches!(self.backend, Backend::Cpu(quell::Backend::Cpu)) || !name.starts_with("quell:");
                let on = || format!("{name} on {} {}", self.backend.name(), self.backend.adapter().unwrap_or_default());
                let key = self.key(sequence, &if here { name.clone() } else { on() });
                if let Some(found) = self.kept(sequence, name, &folder, &key) {
                    return Ok(found);
                }
                let mut method = parse_on(name, self.backend)?;
                self.measured(sequence, method.as_mut(), &folder, key, notify)
            }
            Competitor::Command { name, command } => {
                let key = self.key(sequence, &format!("{name}={command}"));
                if let Some(done) = done_with(&folder, &key)
                    && let Ok(found) = finished_frames(sequence, name, &folder.join("out"), Some(done))
                {
                    return Ok(Finished { resumed: true, ..found });
                }
                self.command(sequence, name, command, &folder, key)
            }
        }
    }

    fn key(&self, sequence: &Sequence, what: &str) -> String {
        let frames: Vec<String> = sequence.numbers.iter().map(i64::to_string).collect();
        format!("{} | {what} | {} | {} | {}", self.program, sequence.identity, sequence.size, frames.join(" "))
    }

    fn kept(&self, sequence: &Sequence, name: &str, folder: &Path, key: &str) -> Option<Finished> {
        let done = done_with(folder, key)?;
        let files: Vec<PathBuf> = sequence.numbers.iter().map(|&n| picture_path(folder, n)).collect();
        if done.nanoseconds.len() != files.len() || files.iter().any(|f| !f.is_file()) {
            return None;
        }
        Some(Finished {
            name: name.to_owned(),
            milliseconds: steady(&done.nanoseconds),
            peak_bytes: done.peak_bytes,
            notes: done.notes,
            backend: done.backend,
            resumed: true,
            files,
        })
    }

    fn stop_if_asked(&self) -> Result<(), Error> {
        let asked = self.cancel.is_some_and(|c| c.load(Ordering::SeqCst));
        if asked { Err(TraceError::Cancelled.into()) } else { Ok(()) }
    }

    fn measured(
        &self,
        sequence: &Sequence,
        method: &mut dyn Method,
        folder: &Path,
        key: String,
        notify: &dyn Fn(usize),
    ) -> Result<Finished, Error> {
        let name = method.name();
        if method.needs_halves() && sequence.frame(0)?.halves.is_none() {
            let reason = "it needs two independent halves of a frame's samples; give --spp 2 or more".to_owned();
            return Err(Error::Method { method: name, reason });
        }
        forget(folder)?;
        let mut meter = Meter::new(self.memory);
        let mut nanoseconds = Vec::with_capacity(sequence.numbers.len());
        let mut files = Vec::with_capacity(sequence.numbers.len());
        let mut clamped = 0;
        let mut keep = |finished: Vec<FinishedPicture>, meter: &mut Meter| -> Result<(), Error> {
            for FinishedPicture { number, picture } in finished {
                Error::same_size("finished picture", picture.size(), sequence.size)?;
                meter.released(std::mem::size_of_val(picture.data()));
                let path = picture_path(folder, number);
                let of = sequence.frame(sequence.index_of(number).unwrap_or_default())?;
                clamped += write_picture(&path, &picture, &of.frame, (&name, sequence.tone.exposure))?;
                files.push(path);
                notify(files.len());
            }
            Ok(())
        };
        for index in 0..sequence.numbers.len() {
            self.stop_if_asked()?;
            let noisy = sequence.frame(index)?;
            let (finished, time) = noisy.with_input(|input| timed(&mut meter, || method.push(input)));
            nanoseconds.push(whole_nanoseconds(time));
            keep(finished?, &mut meter)?;
        }
        self.stop_if_asked()?;
        let (finished, time) = timed(&mut meter, || method.finish());
        keep(finished?, &mut meter)?;
        if method.looks_ahead() {
            // Frames wait inside: what one costs is known of all together.
            let all = nanoseconds.iter().sum::<u64>() + whole_nanoseconds(time);
            let each = all / nanoseconds.len().max(1) as u64;
            nanoseconds.fill(each);
        }
        let mut notes = Vec::new();
        if clamped > 0 {
            notes.push(format!("{name}: {clamped} values were beyond 65504 and count as that."));
        }
        let ran_on = method.ran_on();
        let backend = ran_on.as_ref().map(|(backend, _)| (*backend).to_owned());
        notes.extend(ran_on.map(|(_, note)| note));
        let done = Done { key, nanoseconds, peak_bytes: meter.peak(), notes, backend };
        write_done(folder, &done)?;
        Ok(Finished {
            name,
            milliseconds: steady(&done.nanoseconds),
            peak_bytes: done.peak_bytes,
            notes: done.notes,
            backend: done.backend,
            resumed: false,
            files,
        })
    }

    fn command(
        &self,
        sequence: &Sequence,
        name: &str,
        command: &str,
        folder: &Path,
        key: String,
    ) -> Result<Finished, Error> {
        self.stop_if_asked()?;
        forget(folder)?;
        let out = folder.join("out");
        std::fs::create_dir_all(&out).map_err(|e| quell_frames::Error::io(&out, "create folder", e))?;
        let given = given_frames(sequence, &folder.join("noisy"))?;
        let time = run_command(name, command, &given, &out, &folder.join("log.txt"), self.cancel)?;
        let each = whole_nanoseconds(time) / sequence.numbers.len().max(1) as u64;
        let notes = vec![format!(
            "{name}: a command; its time is wall time over frames, starting, reading and writing included, and its \
             memory is not known."
        )];
        let done = Done { key, nanoseconds: vec![each], peak_bytes: None, notes, backend: None };
        let finished = finished_frames(sequence, name, &out, Some(done.clone()))?;
        write_done(folder, &done)?;
        Ok(finished)
    }
}

/// What `work` gives, and how long it took; its memory counts.
fn timed<T>(meter: &mut Meter, work: impl FnOnce() -> T) -> (T, Duration) {
    meter.begin();
    let begin = Instant::now();
    let found = work();
    let time = begin.elapsed();
    meter.end();
    (found, time)
}

fn whole_nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// The folder that a command reads: the sequence's own, where all its frames and no others lie in one; else `place`,
/// where they are written.
fn given_frames(sequence: &Sequence, place: &Path) -> Result<PathBuf, Error> {
    for (index, &number) in sequence.numbers.iter().enumerate() {
        let path = frame_path(place, super::scene::NOISY, number);
        match sequence.file(index) {
            // The same file system: a link costs nothing. On another one it is copied.
            Some(file) => {
                std::fs::create_dir_all(place).map_err(|e| quell_frames::Error::io(place, "create folder", e))?;
                if std::fs::hard_link(file, &path).is_err() {
                    std::fs::copy(file, &path).map_err(|e| quell_frames::Error::io(&path, "write", e))?;
                }
            }
            None => {
                let noisy = sequence.frame(index)?;
                let exposure = sequence.tone.exposure;
                let metadata = Metadata { scene: sequence.name.clone(), exposure, ..Metadata::default() };
                super::scene::write_noisy(&path, &noisy, metadata)?;
            }
        }
    }
    Ok(place.to_owned())
}

fn finished_frames(sequence: &Sequence, name: &str, folder: &Path, done: Option<Done>) -> Result<Finished, Error> {
    let found: BTreeMap<i64, PathBuf> = numbered_files(name, folder)?;
    let failed = |reason: String| Error::Method { method: name.to_owned(), reason };
    let mut files = Vec::new();
    for number in &sequence.numbers {
        let path = found
            .get(number)
            .ok_or_else(|| failed(format!("{} holds no frame {number} ({} files)", folder.display(), found.len())))?;
        files.push(path.clone());
    }
    if let Some(path) = files.first() {
        let size = read_picture(path)?.size();
        if size != sequence.size {
            return Err(failed(format!("{} is {size}, but the sequence is {}", path.display(), sequence.size)));
        }
    }
    let (milliseconds, notes) = match done {
        Some(done) => (steady(&done.nanoseconds), done.notes),
        None => {
            (None, vec![format!("{name}: finished frames in {}; time and memory are not known.", folder.display())])
        }
    };
    Ok(Finished { name: name.to_owned(), milliseconds, peak_bytes: None, notes, backend: None, resumed: false, files })
}

/// Times of the steady state; of all frames but the first where none is steady.
fn steady(nanoseconds: &[u64]) -> Option<Spread> {
    let from = if nanoseconds.len() > START_FRAMES { START_FRAMES } else { usize::from(nanoseconds.len() > 1) };
    Spread::of(nanoseconds.iter().skip(from).map(|&n| n as f64 / 1e6))
}

/// `quell:paper` becomes `quell_paper`; names that hold more than a file name may get a hash to stay apart.
fn folder_name(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "+-_.=".contains(c);
    let safe: String = name.chars().map(|c| if plain(c) { c } else { '_' }).collect();
    let few = name.chars().all(|c| plain(c) || c == ':') && safe.len() < 100 && !safe.starts_with('.');
    if few { safe } else { format!("{}-{:016x}", safe.chars().take(60).collect::<String>(), hash(name)) }
}

/// FNV-1a.
fn hash(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}

fn picture_path(folder: &Path, number: i64) -> PathBuf {
    frame_path(folder, "picture", number)
}

fn write_picture(
    path: &Path,
    picture: &Plane<Rgb>,
    of: &quell::FrameBuf,
    (method, exposure): (&str, f32),
) -> Result<usize, Error> {
    let frame = Frame { index: of.index, previous_camera: of.previous_camera, ..Frame::new(of.size, of.camera) };
    let metadata =
        Metadata { content: Content::Denoised, settings: method.to_owned(), exposure, ..Metadata::default() };
    let file = FrameToWrite { composite: Some(picture.view()), metadata, ..FrameToWrite::new(frame) };
    let options = WriteOptions { colours: Precision::Half, overwrite: false };
    Ok(write_frame(path, &file, &options)?.clamped_to_half)
}

fn done_with(folder: &Path, key: &str) -> Option<Done> {
    let bytes = std::fs::read(folder.join(DONE)).ok()?;
    serde_json::from_slice::<Done>(&bytes).ok().filter(|done| done.key == key)
}

fn write_done(folder: &Path, done: &Done) -> Result<(), Error> {
    let json = serde_json::to_vec_pretty(done)?;
    Ok(quell_frames::files::write_bytes(&folder.join(DONE), &json)?)
}

/// What an unfinished or older run left of a method: its word that it is finished first, then quell's own pictures.
fn forget(folder: &Path) -> Result<(), Error> {
    let failed = |path: &Path, e: std::io::Error| -> Result<(), Error> {
        if e.kind() == std::io::ErrorKind::NotFound {
            return Ok(());
        }
        Err(quell_frames::Error::io(path, "remove", e).into())
    };
    let done = folder.join(DONE);
    std::fs::remove_file(&done).or_else(|e| failed(&done, e))?;
    for below in ["out", "noisy"] {
        let path = folder.join(below);
        std::fs::remove_dir_all(&path).or_else(|e| failed(&path, e))?;
    }
    for (_, path) in quell_frames::find_frames(folder, "picture").unwrap_or_default() {
        std::fs::remove_file(&path).or_else(|e| failed(&path, e))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_methods_stay_apart() {
        assert_eq!(folder_name("quell:paper+glossy_temporal.alpha=0.8"), "quell_paper+glossy_temporal.alpha=0.8");
        let names = ["mine", "a/b", "a\\b", "a_b", "..", "ä", "ö"];
        let folders: std::collections::BTreeSet<String> = names.iter().map(|n| folder_name(n)).collect();
        assert_eq!(folders.len(), names.len());
        assert!(folders.iter().all(|f| !f.contains(['/', '\\']) && !f.starts_with('.') || f.starts_with("..-")));
    }

    #[test]
    fn times_leave_the_start_out() {
        let times: Vec<u64> = (0..24).map(|i| if i < 16 { 100_000_000 } else { 2_000_000 }).collect();
        assert_eq!(steady(&times).map(|s| (s.median, s.max)), Some((2.0, 2.0)));
        assert_eq!(steady(&[50_000_000, 1_000_000, 3_000_000]).map(|s| s.median), Some(2.0));
        assert_eq!(steady(&[50_000_000]).map(|s| s.median), Some(50.0));
    }
}
