//! A camera's path: recorded while the picture is walked through, then written as frames, each as good as if its
//! predecessors had taken no time.

use super::app::App;
use super::views::Saved;
use eframe::egui::Ui;

/// Frames of a path, at most: ten minutes of 24 a second.
const LONGEST: usize = 14_400;

/// A recorded path.
#[derive(Default)]
pub(super) struct Film {
    steps: Vec<Saved>,
    state: State,
}

#[derive(Clone, Copy, Default)]
enum State {
    #[default]
    Idle,
    Recording,
    /// Which step is next, and where the camera was before.
    Writing(usize, Saved),
}

impl Film {
    pub(super) fn is_writing(&self) -> bool {
        matches!(self.state, State::Writing(..))
    }

    /// Frames that were recorded.
    pub(super) fn frames(&self) -> usize {
        self.steps.len()
    }

    /// Another scene has other places.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl App {
    pub(super) fn film_controls(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| match self.film.state {
            State::Idle => {
                if self.button(ui, "record path", "Keeps where the camera is at every frame from now on.") {
                    self.film.forget();
                    self.film.state = State::Recording;
                }
                let hint = "Goes along the recorded path once more and saves each frame's picture as a PNG.";
                if self.film.frames() > 0
                    && self.button(ui, "write path", hint)
                    && let Some(pilot) = self.pilot
                {
                    self.engine.reset();
                    self.film.state = State::Writing(0, Saved { pilot, time: self.time });
                }
            }
            State::Recording => {
                let hint = "Ends the path; it can be written then.";
                if self.button(ui, "end path", hint) || self.film.frames() >= LONGEST {
                    self.film.state = State::Idle;
                }
                ui.label(format!("{} frames", self.film.frames()));
            }
            State::Writing(next, _) => {
                if self.button(ui, "stop writing", "What is written stays.") {
                    self.end_film();
                }
                ui.label(format!("{next} of {}", self.film.frames()));
            }
        });
    }

    /// While a path is written: goes to its next step. False: the last picture is still on its way.
    pub(super) fn next_step(&mut self) -> bool {
        let State::Writing(next, _) = self.film.state else { return true };
        if self.is_saving() {
            return false;
        }
        let Some(step) = self.film.steps.get(next).copied() else {
            self.end_film();
            return true;
        };
        // Time runs backwards where the scene began anew: a cut.
        if step.time < self.time && next > 0 {
            self.engine.reset();
        }
        self.pilot = Some(step.pilot);
        self.time = step.time;
        true
    }

    /// After a frame: keeps its place, or begins its way to a file.
    pub(super) fn step_done(&mut self) {
        match self.film.state {
            State::Recording => {
                if let Some(pilot) = self.pilot {
                    self.film.steps.push(Saved { pilot, time: self.time });
                }
            }
            State::Writing(next, before) => {
                self.shoot(self.file(&format!("path-{:05}", next + 1), "png"));
                self.film.state = State::Writing(next + 1, before);
            }
            State::Idle => {}
        }
    }

    /// Ends writing, at its end or before; the camera goes back to where it was.
    pub(super) fn end_film(&mut self) {
        if let State::Writing(_, before) = self.film.state {
            self.pilot = Some(before.pilot);
            self.time = before.time;
            self.engine.reset();
            self.film.state = State::Idle;
        }
    }
}
