//! The window driven by a script: pointer and keys, aimed at controls by their names. Events enter where those of mouse and
//! keyboard do; what comes of them is read from reports and pictures of the window.
//!
//! One command a line; `#` begins a comment. Words with blanks stand in quotes.
//!
//! ```text
//! open SCENE               as if it were dropped on the window; waits until it is shown or refused
//! opened                   until no scene is being opened any more
//! written                  until a camera's path is written
//! frames N                 until N more frames of the picture were encoded
//! click NAME               a click on a control
//! drag NAME X0 Y0 X1 Y1    a drag across a control, places as shares of its extent
//! wheel NAME STEPS         the wheel above a control
//! key KEY FRAMES           a key held down for so many frames
//! resize WIDTH HEIGHT      the window, in points
//! screen SCALE             the window moves to a screen with so many pixels a point
//! lose                     the device is lost; what follows is done in the window that is opened anew
//! window FILE              a picture of the window, PNG
//! report FILE              what is shown and where controls are, JSON
//! close
//! ```

use super::app::App;
use super::opening::Source;
use eframe::egui::{self, Event, Key, Modifiers, PointerButton, Pos2, Rect, Vec2};
use quell::gpu::wgpu;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Commands that are still to come; a window that is opened anew goes on with them.
#[derive(Clone, Debug)]
pub(super) struct Script(Arc<Mutex<VecDeque<Vec<String>>>>);

impl Script {
    pub(super) fn new(text: &str) -> Self {
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
        Self(Arc::new(Mutex::new(lines.map(words).filter(|words| !words.is_empty()).collect())))
    }

    fn commands(&self) -> MutexGuard<'_, VecDeque<Vec<String>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What is still to be done.
pub(super) struct Drive {
    commands: Script,
    /// Events of the frames to come.
    events: VecDeque<Vec<Event>>,
    /// Wait for this frame's number; since when, seconds.
    until: Option<(i64, f64)>,
    opens: bool,
    writes: bool,
    aim: Option<Aim>,
    /// A picture of the window that is on its way.
    picture: Option<Arc<Mutex<Option<Arc<egui::ColorImage>>>>>,
    to: String,
}

/// A control that is aimed at.
struct Aim {
    command: Vec<String>,
    /// Frames for which it has been sought.
    sought: u32,
    /// Where it was seen last, and since when it stands there, seconds.
    place: Option<Rect>,
    since: f64,
}

/// Seconds for which a control must have stood still: sections open and lists scroll in their own time.
const AT_REST: f64 = 0.5;

/// Seconds until frames that are waited for must have come.
const LONGEST: f64 = 120.0;

/// Frames until a control must have shown up.
const PATIENCE: u32 = 120;

fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (index, part) in line.split('"').enumerate() {
        if index % 2 == 1 {
            words.push(part.to_owned());
        } else {
            words.extend(part.split_whitespace().map(str::to_owned));
        }
    }
    words
}

fn button(pos: Pos2, pressed: bool) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}

fn key(key: Key, pressed: bool) -> Event {
    Event::Key { key, physical_key: Some(key), pressed, repeat: false, modifiers: Modifiers::NONE }
}

impl Drive {
    pub(super) fn new(commands: Script) -> Self {
        Self {
            commands,
            events: VecDeque::new(),
            until: None,
            opens: true,
            writes: false,
            aim: None,
            picture: None,
            to: String::new(),
        }
    }

    /// Hands the frame its events. A real pointer takes no part.
    pub(super) fn before_frame(&mut self, _: &App, input: &mut egui::RawInput) {
        input
            .events
            .retain(|e| !matches!(e, Event::PointerMoved(_) | Event::PointerGone | Event::PointerButton { .. }));
        input.focused = true;
        if let Some(events) = self.events.pop_front() {
            input.events.extend(events);
        }
    }

    /// Goes on, once what was begun has come to its end.
    pub(super) fn after_frame(&mut self, app: &mut App, ctx: &egui::Context) {
        if let Some(arrived) = &self.picture {
            let Some(picture) = arrived.lock().unwrap_or_else(PoisonError::into_inner).take() else { return };
            self.picture = None;
            let to = std::path::PathBuf::from(&self.to);
            let [width, height] = picture.size;
            let rgb: Vec<u8> = picture.pixels.iter().flat_map(|c| [c.r(), c.g(), c.b()]).collect();
            let image = image::RgbImage::from_raw(width as u32, height as u32, rgb);
            match image.map(|image| image.save(&to)) {
                Some(Ok(())) => println!("wrote {}", to.display()),
                _ => self.fail(app, ctx, "the window's picture could not be written"),
            }
        }
        let is_waiting = (self.opens && app.opening.is_some()) || (self.writes && app.film.is_writing());
        if !self.events.is_empty() || is_waiting {
            return;
        }
        (self.opens, self.writes) = (false, false);
        let number = app.last.map_or(-1, |made| made.number);
        let now = ctx.input(|i| i.time);
        if let Some((until, since)) = self.until.filter(|(until, _)| number < *until) {
            if now - since > LONGEST {
                self.fail(app, ctx, &format!("frame {until} did not come within {LONGEST} seconds"));
            }
            return;
        }
        self.until = None;
        if let Some(aim) = self.aim.take() {
            self.aim_at(app, ctx, aim);
            return;
        }
        let Some(command) = self.commands.commands().pop_front() else { return };
        println!("{}", command.join(" "));
        let word = |n: usize| command.get(n).cloned().unwrap_or_default();
        match command.first().map(String::as_str) {
            Some("open") => {
                app.open(Source::Named(word(1)));
                self.opens = true;
            }
            Some("opened") => self.opens = true,
            Some("written") => self.writes = true,
            Some("frames") => self.until = Some((number + word(1).parse().unwrap_or(1), now)),
            Some("click" | "drag" | "wheel") => self.aim = Some(Aim { command, sought: 0, place: None, since: now }),
            Some("key") => {
                let Some(held) = Key::from_name(&word(1)) else {
                    self.fail(app, ctx, &format!("there is no key {}", word(1)));
                    return;
                };
                self.events.push_back(vec![key(held, true)]);
                let frames = word(2).parse().unwrap_or(1);
                self.events.extend((1..frames).map(|_| Vec::new()));
                self.events.push_back(vec![key(held, false)]);
            }
            Some("resize") => {
                let side = |n| word(n).parse().unwrap_or(0.0);
                ctx.send_viewport_cmd(egui::ViewportCommand::InnerSize(Vec2::new(side(1), side(2))));
                self.events.extend((0..5).map(|_| Vec::new()));
            }
            Some("screen") => {
                ctx.set_pixels_per_point(word(1).parse().unwrap_or(1.0));
                self.events.extend((0..5).map(|_| Vec::new()));
            }
            Some("lose") => {
                // Its callback is called once nothing runs on it any more.
                app.device.destroy();
                let _ = app.device.poll(wgpu::PollType::wait_indefinitely());
            }
            Some("window") => {
                let arrives = Arc::new(Mutex::new(None));
                let to = Arc::clone(&arrives);
                self.to = word(1);
                ctx.request_screenshot(move |picture| {
                    *to.lock().unwrap_or_else(PoisonError::into_inner) = Some(picture);
                });
                self.picture = Some(arrives);
            }
            Some("report") => {
                let text = serde_json::to_string_pretty(&app.report()).unwrap_or_default();
                if std::fs::write(word(1), text).is_err() {
                    self.fail(app, ctx, &format!("{} could not be written", word(1)));
                }
            }
            Some("close") => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            _ => self.fail(app, ctx, &format!("unknown command: {}", command.join(" "))),
        }
    }

    /// Ends the program with an error.
    fn fail(&mut self, app: &App, ctx: &egui::Context, words: &str) {
        self.commands.commands().clear();
        *app.trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("script: {words}"));
        fail(words);
        ctx.send_viewport_cmd(egui::ViewportCommand::Close);
    }

    /// Brings the control into view, and once it stands still there sends the events.
    fn aim_at(&mut self, app: &mut App, ctx: &egui::Context, aim: Aim) {
        let name = aim.command.get(1).cloned().unwrap_or_default();
        let now = ctx.input(|i| i.time);
        let place = app.marks.place(&name);
        if place.is_none() && aim.sought > PATIENCE {
            self.fail(app, ctx, &format!("there is no control `{name}`"));
            return;
        }
        app.marks.seek(Some(name));
        let stands = place == aim.place && place.is_some();
        let (Some(place), true) = (place, stands && now - aim.since > AT_REST && aim.sought > 3) else {
            let since = if stands { aim.since } else { now };
            self.aim = Some(Aim { sought: aim.sought + 1, place, since, ..aim });
            return;
        };
        let command = aim.command;
        app.marks.seek(None);
        let number = |n: usize| command.get(n).and_then(|w| w.parse::<f32>().ok()).unwrap_or(0.5);
        let at = |x: f32, y: f32| place.min + place.size() * Vec2::new(x, y);
        match command.first().map(String::as_str) {
            Some("click") => {
                // The box of a checkbox and the rail of a slider lie to the left.
                let at = if command.len() > 2 {
                    at(number(2), 0.5)
                } else {
                    at(0.5, 0.5).min(place.min + place.size() - Vec2::splat(1.0))
                };
                // At once: on a slow machine a button that is held from frame to frame makes no click.
                self.events.extend([vec![Event::PointerMoved(at)], vec![button(at, true), button(at, false)]]);
            }
            Some("drag") => {
                let (from, to) = (at(number(2), number(3)), at(number(4), number(5)));
                self.events.extend([vec![Event::PointerMoved(from)], vec![button(from, true)]]);
                for step in 1..=4 {
                    let way = from + (to - from) * (step as f32 / 4.0);
                    self.events.push_back(vec![Event::PointerMoved(way)]);
                }
                self.events.push_back(vec![button(to, false)]);
            }
            _ => {
                let at = at(0.5, 0.5);
                let wheel = Event::MouseWheel {
                    unit: egui::MouseWheelUnit::Point,
                    source: egui::MouseWheelSource::Wheel,
                    delta: Vec2::new(0.0, 50.0 * number(2)),
                    phase: egui::TouchPhase::Move,
                    modifiers: Modifiers::NONE,
                };
                self.events.extend([vec![Event::PointerMoved(at)], vec![wheel]]);
                // Scrolling is smoothed over some frames.
                self.events.extend((0..12).map(|_| Vec::new()));
            }
        }
        self.events.extend([Vec::new(), Vec::new()]);
    }
}

/// Set by what ends the program with an error.
static FAILED: AtomicBool = AtomicBool::new(false);

/// Remembers that the program fails, and says why.
fn fail(words: &str) {
    eprintln!("error: {words}");
    FAILED.store(true, Ordering::Release);
}

pub(super) fn has_failed() -> bool {
    FAILED.load(Ordering::Acquire)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_words_keep_their_blanks() {
        assert_eq!(words(r#"click "save PNG" 0.5"#), ["click", "save PNG", "0.5"]);
        assert_eq!(*Script::new("# nothing\n\nclick a # b\n").commands(), [vec!["click".to_owned(), "a".to_owned()]]);
    }
}
