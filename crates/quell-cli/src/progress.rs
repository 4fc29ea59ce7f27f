//! Progress on standard error: a bar with the time left on a terminal, plain lines `[ 45%] frame 12 of 27` elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
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
        let done = (index as u64 + 1) * TICKS;
        match &self.shown {
            Shown::Nothing => {}
            Shown::Bar(bar) => bar.set_position(done),
            Shown::Lines(last) => {
                if let Ok(mut last) = last.lock() {
                    *last = Instant::now();
                }
                eprintln!("{}", self.line(done, index));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_line_tells_share_and_step() {
        let progress = Progress::new("frame", 27, true);
        assert_eq!(progress.line(12 * TICKS, 11), "[ 44%] frame 12 of 27");
        assert_eq!(progress.line(27 * TICKS, 26), "[100%] frame 27 of 27");
    }
}
