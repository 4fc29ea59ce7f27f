//! What a frame cost and what was repaired in it.

use crate::border::Sanitised;
use crate::pipeline::Stage;
use std::time::{Duration, Instant};

/// Time of each stage of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    times: [Option<Duration>; Stage::ALL.len()],
    /// Reading, cleaning and converting the frame's planes.
    pub border: Duration,
}

impl StageTimes {
    /// Wall time of a stage; `None`: it did not run.
    pub fn get(&self, stage: Stage) -> Option<Duration> {
        self.times[stage as usize]
    }

    /// Every stage that ran.
    pub fn iter(&self) -> impl Iterator<Item = (Stage, Duration)> + '_ {
        Stage::ALL.into_iter().filter_map(|s| self.get(s).map(|t| (s, t)))
    }

    /// Notes a time that was measured by a device.
    pub fn set(&mut self, stage: Stage, time: Duration) {
        self.times[stage as usize] = Some(time);
    }

    /// Runs `f` and adds its time to the stage's.
    pub(crate) fn measure<R>(&mut self, stage: Stage, f: impl FnOnce() -> R) -> R {
        let begin = clock();
        let result = f();
        let time = begin.map_or(Duration::ZERO, |t| t.elapsed());
        *self.times[stage as usize].get_or_insert(Duration::ZERO) += time;
        result
    }
}

/// The clock; `None` where the platform has none (wasm32 without an environment), where times are 0.
pub(crate) fn clock() -> Option<Instant> {
    if cfg!(all(target_arch = "wasm32", target_os = "unknown")) { None } else { Some(Instant::now()) }
}

/// What is said of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Values that were repaired or merely counted, by plane and kind.
    pub sanitised: Sanitised,
    /// Surface pixels that had no matte history (glossy, where there is no matte signal). All of them at a cut.
    pub reset_pixels: u64,
    /// The frame continued from the one before.
    pub had_history: bool,
    /// Wall time by stage.
    pub times: StageTimes,
}
