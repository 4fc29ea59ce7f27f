//! Reading, filtering and writing at the same time, each in a thread of its own, with short queues between them.

use super::clock::{Busy, StageTime, Times, pool_seconds};
use super::plan::{Plan, Step};
use crate::Error;
use crate::adapt::FrameNoise;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Frames that wait between two steps, without the one that each step holds: none, frames are large.
const QUEUE: usize = 0;

/// How frames come and go. Called from two threads at once.
pub trait Files: Sync {
    /// A frame as read.
    type Loaded: Send;
    /// A frame as filtered.
    type Done: Send;

    /// Reads a frame; sentences that the user should see come with it.
    ///
    /// # Errors
    /// The frame fails, and counts as a gap for its neighbours.
    fn read(&self, number: i64, wanted: bool) -> Result<(Self::Loaded, Vec<String>), Error>;

    /// Writes a frame whole or not at all; sentences that the user should see come back.
    ///
    /// # Errors
    /// The frame fails; the run ends where no other could be written either ([`Error::is_lasting`]).
    fn write(&self, number: i64, done: Self::Done) -> Result<Vec<String>, Error>;
}

/// A filter over a window of frames.
pub trait Window {
    /// A frame as read.
    type Loaded;
    /// A frame as filtered.
    type Done;

    /// Takes the next frame; frames whose window is complete are given to `out`, in order, each as soon as it is there.
    /// Where `out` returns false nobody wants more.
    ///
    /// # Errors
    /// This frame cannot be taken.
    fn push(
        &mut self,
        number: i64,
        loaded: Self::Loaded,
        wanted: bool,
        out: &mut dyn FnMut(i64, Self::Done) -> bool,
    ) -> Result<(), Error>;

    /// Whatever is still inside comes out; what comes next is another shot.
    ///
    /// # Errors
    /// The frames inside cannot be filtered.
    fn finish(&mut self, out: &mut dyn FnMut(i64, Self::Done) -> bool) -> Result<(), Error>;

    /// True where a frame shows something else than the one before, by its content: then [`Self::finish`] is called
    /// between them.
    fn is_cut(&self, loaded: &Self::Loaded) -> bool;
}

/// What became of a frame that was wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It is written.
    Written,
    /// It is not, for this reason, which names the file.
    Failed(String),
    /// The run ended before.
    Skipped,
}

/// What happens, reported while it happens, from any thread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame has come in.
    Read(i64),
    /// A wanted frame is on the disk.
    Written(i64),
    /// Content shows that a new shot begins with this frame.
    Cut(i64),
    /// A frame failed.
    Failed(i64, String),
    /// Something that the user should know.
    Note(String),
    /// A band of rows begins, counted from 0, of so many.
    Band(usize, usize),
}

/// How a run went.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// What became of each wanted frame, ascending.
    pub frames: Vec<(i64, Fate)>,
    /// First frames of shots, found by content.
    pub cuts: Vec<i64>,
    /// Why the run ended before its last frame, if it did; empty where it was asked to.
    pub ended: Option<String>,
    /// What it cost.
    pub times: Times,
    /// How much noise written frames had and have, where that was asked for and the filter's last stage ran.
    pub noise: Vec<(i64, FrameNoise)>,
}

impl Outcome {
    /// How many frames are written.
    pub fn written(&self) -> usize {
        self.frames.iter().filter(|(_, fate)| *fate == Fate::Written).count()
    }
}

/// How a run behaves.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunOptions {
    /// How many frames a frame sees on each side.
    pub reach: usize,
    /// Look for cuts in the content.
    pub find_cuts: bool,
    /// A frame that cannot be read spoils those that would have seen it: they fail too, instead of being filtered
    /// without it.
    pub whole_windows: bool,
}

/// Runs a plan. The filter works in the caller's thread pool, reading and writing in pools of the same size beside it.
///
/// `stop` ends it early: frames that are not being written are given up. `notify` hears what happens.
///
/// # Errors
/// [`Error::Io`] where the system gives no threads.
pub fn run<F, W>(
    plan: &Plan,
    files: &F,
    window: &mut W,
    options: RunOptions,
    stop: &AtomicBool,
    notify: &(dyn Fn(Event) + Sync),
) -> Result<Outcome, Error>
where
    F: Files,
    W: Window<Loaded = F::Loaded, Done = F::Done>,
{
    let begin = Instant::now();
    let (readers, writers) = (pool("reading")?, pool("writing")?);
    let end_early = AtomicBool::new(false);
    let stopped = || stop.load(Ordering::SeqCst) || end_early.load(Ordering::SeqCst);
    let before = pool_seconds();
    let mut middle = Middle {
        fates: plan.steps.iter().filter(|s| s.wanted).map(|s| (s.number, Fate::Skipped)).collect(),
        spoiled: BTreeMap::new(),
        inside: BTreeSet::new(),
        cuts: Vec::new(),
        busy: Busy::default(),
        ended: None,
        options,
        notify,
    };
    let (reading, writing, ended) = std::thread::scope(|scope| {
        let (loaded_to, loaded) = sync_channel(QUEUE);
        let (done_to, done) = sync_channel(QUEUE);
        let stopped = &stopped;
        let reader = scope.spawn(move || readers.install(move || read_all(plan, files, &loaded_to, stopped, notify)));
        let end_early = &end_early;
        let writer = scope.spawn(move || writers.install(move || write_all(files, &done, stopped, end_early, notify)));
        middle.filter_all(window, &loaded, &done_to, stopped);
        // Both ends hang up: the others notice and end.
        drop((loaded, done_to));
        let reading = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        let (writing, written, ended) = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        middle.fates.extend(written);
        (reading, writing, ended)
    });
    let cpu = before.zip(pool_seconds()).map(|(before, after)| after - before);
    let filtering = StageTime { cpu, busy: middle.busy.seconds() };
    let stopped_by_user = stop.load(Ordering::SeqCst) && middle.fates.values().any(|f| *f == Fate::Skipped);
    Ok(Outcome {
        frames: middle.fates.into_iter().collect(),
        cuts: middle.cuts,
        ended: ended.or(middle.ended).or_else(|| stopped_by_user.then(String::new)),
        times: Times { reading, filtering, writing, wall: begin.elapsed().as_secs_f64(), elsewhere: false },
        noise: Vec::new(),
    })
}

fn pool(name: &'static str) -> Result<rayon::ThreadPool, Error> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(rayon::current_num_threads())
        .thread_name(move |i| format!("{name} {i}"))
        .build()
        .map_err(|e| Error::io(std::path::Path::new(name), "start the threads for", std::io::Error::other(e)))
}

fn read_all<F: Files>(
    plan: &Plan,
    files: &F,
    to: &SyncSender<(Step, Result<F::Loaded, Error>)>,
    stopped: &(dyn Fn() -> bool + Sync),
    notify: &(dyn Fn(Event) + Sync),
) -> StageTime {
    let before = pool_seconds();
    let mut busy = Busy::default();
    for &step in &plan.steps {
        if stopped() {
            break;
        }
        let loaded = busy.during(|| files.read(step.number, step.wanted));
        let loaded = loaded.map(|(loaded, notes)| {
            notify(Event::Read(step.number));
            notes.into_iter().for_each(|note| notify(Event::Note(note)));
            loaded
        });
        if to.send((step, loaded)).is_err() {
            break;
        }
    }
    let cpu = before.zip(pool_seconds()).map(|(before, after)| after - before);
    StageTime { cpu, busy: busy.seconds() }
}

type Written = (StageTime, BTreeMap<i64, Fate>, Option<String>);

fn write_all<F: Files>(
    files: &F,
    from: &Receiver<(i64, F::Done)>,
    stopped: &(dyn Fn() -> bool + Sync),
    end_early: &AtomicBool,
    notify: &(dyn Fn(Event) + Sync),
) -> Written {
    let before = pool_seconds();
    let mut busy = Busy::default();
    let mut fates = BTreeMap::new();
    let mut ended = None;
    while let Ok((number, done)) = from.recv() {
        if stopped() {
            // Taken out of the queue, so that the filter does not wait for room.
            continue;
        }
        match busy.during(|| files.write(number, done)) {
            Ok(notes) => {
                notes.into_iter().for_each(|note| notify(Event::Note(note)));
                notify(Event::Written(number));
                fates.insert(number, Fate::Written);
            }
            Err(error) => {
                let reason = error.to_string();
                notify(Event::Failed(number, reason.clone()));
                fates.insert(number, Fate::Failed(reason.clone()));
                if error.is_lasting() {
                    ended = Some(reason);
                    end_early.store(true, Ordering::SeqCst);
                }
            }
        }
    }
    let cpu = before.zip(pool_seconds()).map(|(before, after)| after - before);
    (StageTime { cpu, busy: busy.seconds() }, fates, ended)
}

/// The step in the middle, and what it keeps in mind.
struct Middle<'t> {
    fates: BTreeMap<i64, Fate>,
    /// Frames that would have seen one that cannot be read, with the reason.
    spoiled: BTreeMap<i64, String>,
    /// Wanted frames that are inside the filter.
    inside: BTreeSet<i64>,
    cuts: Vec<i64>,
    busy: Busy,
    /// Why the filter can do no more.
    ended: Option<String>,
    options: RunOptions,
    notify: &'t (dyn Fn(Event) + Sync),
}

impl Middle<'_> {
    fn filter_all<L, D, W: Window<Loaded = L, Done = D>>(
        &mut self,
        window: &mut W,
        from: &Receiver<(Step, Result<L, Error>)>,
        to: &SyncSender<(i64, D)>,
        stopped: &(dyn Fn() -> bool + Sync),
    ) {
        let to = |number, done| !stopped() && to.send((number, done)).is_ok();
        while let Ok((step, loaded)) = from.recv() {
            if stopped() {
                return;
            }
            let loaded = match loaded {
                Ok(loaded) => loaded,
                Err(error) => {
                    self.unreadable(step, &error.to_string());
                    self.finish(window, &to);
                    continue;
                }
            };
            let cut = !step.fresh && self.options.find_cuts && window.is_cut(&loaded);
            if cut {
                self.cuts.push(step.number);
                (self.notify)(Event::Cut(step.number));
            }
            if step.fresh || cut {
                self.finish(window, &to);
            }
            if self.ended.is_some() {
                return;
            }
            if step.wanted {
                self.inside.insert(step.number);
            }
            if let Err(error) = self.during(&to, |out| window.push(step.number, loaded, step.wanted, out)) {
                if error.is_lasting() {
                    return self.give_up(&error);
                }
                self.inside.remove(&step.number);
                self.unreadable(step, &error.to_string());
                self.finish(window, &to);
            }
        }
        if !stopped() {
            self.finish(window, &to);
        }
    }

    /// Runs a part of the filter; what comes out of it is sent on.
    fn during<D>(
        &mut self,
        to: &dyn Fn(i64, D) -> bool,
        work: impl FnOnce(&mut dyn FnMut(i64, D) -> bool) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Self { fates, spoiled, inside, notify, busy, .. } = self;
        let mut waited = Duration::ZERO;
        let mut out = |number: i64, done: D| {
            inside.remove(&number);
            if let Some(reason) = spoiled.remove(&number) {
                notify(Event::Failed(number, reason.clone()));
                fates.insert(number, Fate::Failed(reason));
                return true;
            }
            let begin = Instant::now();
            let taken = to(number, done);
            waited += begin.elapsed();
            taken
        };
        let begin = Instant::now();
        let result = work(&mut out);
        busy.add(begin.elapsed().saturating_sub(waited));
        result
    }

    /// A frame that cannot be had.
    fn unreadable(&mut self, step: Step, reason: &str) {
        if step.wanted {
            self.fail(step.number, reason.to_owned());
        } else if !self.options.whole_windows {
            let note = format!("{reason}; its neighbours are filtered without it");
            (self.notify)(Event::Note(note));
        }
        if self.options.whole_windows {
            let reach = i64::try_from(self.options.reach).unwrap_or(i64::MAX);
            for number in step.number.saturating_sub(reach)..=step.number.saturating_add(reach) {
                let why = || format!("frame {} is needed and cannot be read: {reason}", step.number);
                self.spoiled.entry(number).or_insert_with(why);
            }
        }
    }

    fn fail(&mut self, number: i64, reason: String) {
        (self.notify)(Event::Failed(number, reason.clone()));
        self.fates.insert(number, Fate::Failed(reason));
    }

    fn finish<L, D, W: Window<Loaded = L, Done = D>>(&mut self, window: &mut W, to: &dyn Fn(i64, D) -> bool) {
        if let Err(error) = self.during(to, |out| window.finish(out)) {
            self.give_up(&error);
        }
        self.inside.clear();
    }

    /// Frames inside the filter fail; where every other would fail too the run ends.
    fn give_up(&mut self, error: &Error) {
        for number in std::mem::take(&mut self.inside) {
            self.fail(number, error.to_string());
        }
        if error.is_lasting() {
            self.ended.get_or_insert_with(|| error.to_string());
        }
    }
}

#[cfg(test)]
mod tests;
