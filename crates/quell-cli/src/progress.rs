//! Progress on standard error: a bar with the time left on a terminal, plain lines `[ 45%] frame 12 of 27` without one.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::VecDeque;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Ticks of the bar a step: fine enough for parts of a frame.
const TICKS: u64 = 1000;
/// Parts of a step make a plain line no more often than this.
const LINE_PAUSE: Duration = Duration::from_secs(10);

/// Steps that are done one after the other.
pub struct Progress {
    what: &'static str,
    steps: u64,
    shown: Shown,
}

enum Shown {
    Nothing,
    Bar(ProgressBar),
    Lines(Mutex<Instant>),
}

impl Progress {
    /// For `steps` things called `what`; shows nothing where `quiet`.
    pub fn new(what: &'static str, steps: usize, quiet: bool) -> Self {
        let steps = steps as u64;
        let shown = if quiet {
            Shown::Nothing
        } else if std::io::stderr().is_terminal() {
            let bar = ProgressBar::with_draw_target(Some(steps * TICKS), ProgressDrawTarget::stderr());
            // A template that cannot be read would leave indicatif's own style: still a bar.
            if let Ok(style) = ProgressStyle::with_template("{percent:>3}% [{bar:32}] {msg}, {eta} left") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.enable_steady_tick(Duration::from_millis(500));
            Shown::Bar(bar)
        } else {
            Shown::Lines(Mutex::new(Instant::now()))
        };
        Self { what, steps, shown }
    }

    /// Step `index` (from 0) has come as far as `share`, 0..1; `note` says what is being done.
    pub fn within(&self, index: usize, share: f32, note: &str) {
        let done = index as u64 * TICKS + (share.clamp(0.0, 1.0) * TICKS as f32) as u64;
        match &self.shown {
            Shown::Nothing => {}
            Shown::Bar(bar) => {
                bar.set_message(format!("{} {} of {}: {note}", self.what, index + 1, self.steps));
                bar.set_position(done);
            }
            Shown::Lines(last) => {
                let Ok(mut last) = last.lock() else { return };
                if last.elapsed() >= LINE_PAUSE {
                    *last = Instant::now();
                    eprintln!("{} {note}", self.line(done, index));
                }
            }
        }
    }

    /// Step `index` (from 0) is done.
    pub fn done(&self, index: usize) {
        self.done_with(index, "");
    }

    /// The same with something said of it.
    pub fn done_with(&self, index: usize, note: &str) {
        let done = (index as u64 + 1) * TICKS;
        match &self.shown {
            Shown::Nothing => {}
            Shown::Bar(bar) => {
                if !note.is_empty() {
                    bar.set_message(format!("{} {} of {}: {note}", self.what, index + 1, self.steps));
                }
                bar.set_position(done);
            }
            Shown::Lines(last) => {
                if let Ok(mut last) = last.lock() {
                    *last = Instant::now();
                }
                eprintln!("{}", format!("{} {note}", self.line(done, index)).trim_end());
            }
        }
    }

    /// A message above the bar.
    pub fn say(&self, message: &str) {
        match &self.shown {
            Shown::Nothing => {}
            Shown::Bar(bar) => bar.suspend(|| eprintln!("{message}")),
            Shown::Lines(_) => eprintln!("{message}"),
        }
    }

    fn line(&self, done: u64, index: usize) -> String {
        let percent = 100 * done / (self.steps * TICKS).max(1);
        format!("[{percent:>3}%] {} {} of {}", self.what, index + 1, self.steps)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

/// One long piece of work of which only the share done is known: a bar, or plain lines with the time left.
pub struct Work {
    quiet: bool,
    bar: Option<ProgressBar>,
    state: Mutex<WorkState>,
}

struct WorkState {
    line: Instant,
    /// Moments of the last minute with the shares then, from which the speed is taken: what came from a cache went by
    /// faster than what is left.
    seen: VecDeque<(Instant, f32)>,
}

/// The speed is taken from so much of the past.
const SPEED_WINDOW: Duration = Duration::from_secs(60);

impl Work {
    /// Shows nothing where `quiet`.
    pub fn new(quiet: bool) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::with_draw_target(Some(TICKS), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{percent:>3}% [{bar:32}] {msg}") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.enable_steady_tick(Duration::from_millis(500));
            bar
        });
        // The first plain line comes soon, so that nobody waits before a still screen.
        let line = Instant::now().checked_sub(LINE_PAUSE).unwrap_or_else(Instant::now);
        Self { quiet, bar, state: Mutex::new(WorkState { line, seen: VecDeque::new() }) }
    }

    /// For work that is mostly over before anybody waits: the first plain line comes after a second.
    pub fn unless_quick(quiet: bool) -> Self {
        let work = Self::new(quiet);
        if let Ok(mut state) = work.state.lock() {
            state.line += Duration::from_secs(1);
        }
        work
    }

    /// The work has come as far as `share`, 0..1; `note` says what is being done.
    pub fn to(&self, share: f32, note: &str) {
        if self.quiet {
            return;
        }
        let Ok(mut state) = self.state.lock() else { return };
        let share = share.clamp(0.0, 1.0);
        let now = Instant::now();
        while state.seen.len() > 1 && state.seen.front().is_some_and(|(t, _)| now - *t > SPEED_WINDOW) {
            state.seen.pop_front();
        }
        let left = state.seen.front().and_then(|&(t, before)| time_left(now - t, before, share));
        if state.seen.back().is_none_or(|(t, _)| now - *t > Duration::from_millis(200)) {
            state.seen.push_back((now, share));
        }
        let left = left.map_or(String::new(), |left| format!(", {left} left"));
        match &self.bar {
            Some(bar) => {
                bar.set_message(format!("{note}{left}"));
                bar.set_position((share * TICKS as f32) as u64);
            }
            None if state.line.elapsed() >= LINE_PAUSE => {
                state.line = now;
                eprintln!("[{:>3}%] {note}{left}", (share * 100.0) as u32);
            }
            None => {}
        }
    }

    /// A message above the bar.
    pub fn say(&self, message: &str) {
        match &self.bar {
            _ if self.quiet => {}
            Some(bar) => bar.suspend(|| eprintln!("{message}")),
            None => eprintln!("{message}"),
        }
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// In words; `None` where the past is too short to know.
fn time_left(past: Duration, before: f32, now: f32) -> Option<String> {
    let done = now - before;
    if past < Duration::from_secs(2) || done <= 0.0 {
        return None;
    }
    let seconds = f64::from((1.0 - now) / done) * past.as_secs_f64();
    Some(match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_the_speed() {
        let minute = Duration::from_secs(60);
        assert_eq!(time_left(minute, 0.25, 0.5).as_deref(), Some("2 min"));
        assert_eq!(time_left(minute, 0.0, 0.9).as_deref(), Some("7 s"));
        assert_eq!(time_left(minute, 0.0, 0.001).as_deref(), Some("16.6 h"));
        assert_eq!(time_left(Duration::from_secs(1), 0.0, 0.5), None);
        assert_eq!(time_left(minute, 0.5, 0.5), None);
    }

    #[test]
    fn a_plain_line_tells_share_and_step() {
        let progress = Progress::new("frame", 27, true);
        assert_eq!(progress.line(12 * TICKS, 11), "[ 44%] frame 12 of 27");
        assert_eq!(progress.line(27 * TICKS, 26), "[100%] frame 27 of 27");
    }
}
