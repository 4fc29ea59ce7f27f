//! A job run: the whole picture at once, or in bands of rows where memory asks for it.

use super::frames::{Denoisers, Disk};
use super::job::Job;
use super::pipeline::{self, Event, Outcome};
use crate::error::Error;
use std::sync::atomic::AtomicBool;

impl Job {
    /// Runs it: see [`pipeline::run`].
    ///
    /// # Errors
    /// As there.
    pub fn run(&self, stop: &AtomicBool, notify: &(dyn Fn(Event) + Sync)) -> Result<Outcome, Error> {
        let mut outcome = if self.memory()?.bands > 1 {
            let limit = self.limit();
            let bands = |moved: f32| self.bands(moved, limit);
            super::bands::run(self, &bands, stop, notify)?
        } else {
            let mut window = Denoisers::new(self)?;
            let disk = Disk::new(self);
            let outcome = pipeline::run(self.plan(), &disk, &mut window, self.run_options(), stop, notify)?;
            Outcome { noise: disk.noise(), ..outcome }
        };
        outcome.times.elsewhere = self.options.accelerator.is_some();
        Ok(outcome)
    }
}
