//! How far things move up and down, which decides how much bands of rows take: read before a run.

use super::frames::{Disk, Loaded};
use super::job::Job;
use super::pipeline::{Event, Files};
use super::plan::Plan;
use crate::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};

/// The most rows that motion leads up or down in a frame of a job, as a run finds it. Frames that cannot be read fail in
/// the run.
pub(super) fn rows_moved(job: &Job, stop: &AtomicBool) -> f32 {
    let mut moved = 0.0f32;
    let asked = || stop.load(Ordering::SeqCst);
    let mut keep = |_: i64, frame: Result<Loaded, Error>| -> Result<(), Error> {
        let frames = frame.into_iter().flat_map(|loaded| loaded.frames);
        moved = frames.flat_map(|(frame, _)| frame.rows_moved()).fold(moved, f32::max);
        Ok(())
    };
    // It fails where `keep` does.
    let _ = read_linked(job, job.plan(), &Disk::new(job), false, &asked, &|_| {}, &mut keep);
    moved
}

/// Reads the frames of a plan in order, each with what the next one says of the motion to it. `wanted`: those that are
/// to be written keep their files' headers.
pub(super) fn read_linked(
    job: &Job,
    plan: &Plan,
    disk: &Disk<'_>,
    wanted: bool,
    asked: &dyn Fn() -> bool,
    notify: &(dyn Fn(Event) + Sync),
    keep: &mut dyn FnMut(i64, Result<Loaded, Error>) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut waiting: Option<(i64, Loaded)> = None;
    for &step in &plan.steps {
        if asked() {
            break;
        }
        let read = disk.read(step.number, step.wanted && wanted);
        let mut next = read.map(|(loaded, notes)| {
            notify(Event::Read(step.number));
            notes.into_iter().for_each(|note| notify(Event::Note(note)));
            loaded
        });
        if let Some((number, mut last)) = waiting.take() {
            if let Ok(next) = &mut next
                && !step.fresh
                && !next.cut
            {
                // What the next frame says of the motion to it is scattered all over the picture.
                last.frames
                    .iter_mut()
                    .zip(&mut next.frames)
                    .for_each(|(last, next)| last.0.followed_by(&mut next.0, job.settings(), job.options.backend));
            }
            keep(number, Ok(last))?;
        }
        match next {
            Ok(next) => waiting = Some((step.number, next)),
            Err(error) => keep(step.number, Err(error))?,
        }
    }
    waiting.map_or(Ok(()), |(number, last)| keep(number, Ok(last)))
}
