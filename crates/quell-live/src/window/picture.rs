//! The picture, its splits, and what mouse, keyboard and touch do in it.

use super::app::App;
use crate::pilot::Mode;
use eframe::egui::{self, Color32, Key, Pos2, Rect, Sense, Stroke, Vec2};

/// How far from a split it can be taken, points.
const GRIP: f32 = 6.0;

impl App {
    /// Keys: flight, and what has a letter.
    pub(super) fn keys(&mut self, ctx: &egui::Context) {
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        let (along, seconds) = ctx.input(|i| {
            let axis = |plus, minus| f32::from(i.key_down(plus)) - f32::from(i.key_down(minus));
            let fast = if i.modifiers.shift { 2.0 } else { 1.0 };
            let along = [axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S)];
            (along.map(|v| v * fast), i.stable_dt)
        });
        if along != [0.0; 3]
            && let Some(pilot) = &mut self.pilot
        {
            if pilot.mode == Mode::Path {
                pilot.mode = Mode::Fly;
            }
            pilot.fly(along, seconds);
        }
        let (tab, space, shot) =
            ctx.input(|i| (i.key_pressed(Key::Tab), i.key_pressed(Key::Space), i.key_pressed(Key::P)));
        if tab {
            self.shows_panel = !self.shows_panel;
        }
        if space {
            self.is_playing = !self.is_playing;
        }
        if shot {
            self.save_picture();
        }
    }

    /// What is left of the window.
    pub(super) fn picture(&mut self, ui: &mut egui::Ui, now: f64) {
        let frame = egui::Frame::NONE.fill(Color32::from_gray(12));
        egui::CentralPanel::default().frame(frame).show(ui, |ui| {
            let space = ui.available_rect_before_wrap();
            let points = ui.ctx().pixels_per_point();
            // A window that is minimised or too narrow has no room for a picture: the last one stays.
            if space.width() >= 1.0 && space.height() >= 1.0 {
                self.fit([space.width() * points, space.height() * points], now);
            }
            let size = self.engine.size();
            let rect = fitted(space, size.width as f32 / size.height as f32);
            let response = ui.interact(rect, ui.scope_id().with("picture"), Sense::click_and_drag());
            self.marks.add("picture", rect);
            if response.clicked() {
                self.error = None;
            }
            if self.last.is_some() {
                let uv = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
                ui.painter().image(self.texture, rect, uv, Color32::WHITE);
            }
            self.steer(ui, &response, rect);
            self.splits(ui, rect);
            self.words(ui, space);
            self.opener(ui, space);
        });
    }

    fn steer(&mut self, ui: &egui::Ui, response: &egui::Response, rect: Rect) {
        if let Some(at) = response.hover_pos() {
            let size = self.engine.size();
            let at = (at - rect.min) / rect.size();
            self.pointer = [(at.x * size.width as f32) as u32, (at.y * size.height as f32) as u32];
        }
        let Some(pilot) = &mut self.pilot else { return };
        let drag = response.drag_delta() / rect.height().max(1.0);
        let fingers = ui.input(|i| i.multi_touch()).filter(|_| response.dragged() || response.hovered());
        if let Some(fingers) = fingers {
            // Two fingers move across; that they come together or part is below. The first alone would turn.
            pilot.pan((fingers.translation_delta / rect.height().max(1.0)).into());
        } else if drag != Vec2::ZERO {
            if response.dragged_by(egui::PointerButton::Primary) {
                pilot.drag(drag.into());
            } else {
                pilot.pan(drag.into());
            }
        }
        // Also above the lines between panes, which hear of drags alone.
        if ui.rect_contains_pointer(rect) || fingers.is_some() {
            // The wheel, or two fingers.
            let (wheel, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
            pilot.zoom(wheel / 50.0 + 5.0 * pinch.max(1e-3).ln());
        }
    }

    fn splits(&mut self, ui: &mut egui::Ui, rect: Rect) {
        let x = |share: f32| rect.left() + share * rect.width();
        let mut moved = None;
        for (index, share) in self.choice.splits.iter().enumerate() {
            let line = Rect::from_x_y_ranges(x(*share) - GRIP..=x(*share) + GRIP, rect.y_range());
            let response = ui.interact(line, ui.scope_id().with(("split", index)), Sense::drag());
            self.marks.add(&format!("split {}", index + 1), line);
            let strong = response.hovered() || response.dragged();
            let stroke = Stroke::new(if strong { 3.0 } else { 1.0 }, Color32::from_white_alpha(220));
            ui.painter().vline(x(*share), rect.y_range(), stroke);
            if response.hovered() || response.dragged() {
                ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
            }
            if let Some(at) = response.interact_pointer_pos().filter(|_| response.dragged()) {
                moved = Some((index, ((at.x - rect.left()) / rect.width().max(1.0)).clamp(0.0, 1.0)));
            }
        }
        if let Some((index, share)) = moved {
            let low = index.checked_sub(1).and_then(|i| self.choice.splits.get(i)).copied().unwrap_or(0.0);
            let high = self.choice.splits.get(index + 1).copied().unwrap_or(1.0);
            if let Some(split) = self.choice.splits.get_mut(index) {
                *split = share.clamp(low, high.max(low));
            }
        }
        let ends = self.choice.splits.iter().copied().chain([1.0]);
        let begins = [0.0].into_iter().chain(self.choice.splits.iter().copied());
        for ((pane, begin), end) in self.choice.panes.iter().zip(begins).zip(ends) {
            if x(end) - x(begin) < 40.0 {
                continue;
            }
            let text = match (pane, self.last) {
                (crate::choice::Pane::Converged, Some(made)) => format!("converged: {} frames", made.converged),
                (crate::choice::Pane::Debug, _) => {
                    crate::choice::DEBUG_VIEWS.get(self.choice.debug).map_or("debug", |(name, _)| name).to_owned()
                }
                (pane, _) => pane.name().to_owned(),
            };
            let at = Pos2::new(x(begin) + 6.0, rect.top() + 4.0);
            let font = egui::FontId::proportional(12.0);
            let clip = Rect::from_x_y_ranges(x(begin)..=x(end), rect.y_range());
            let painter = ui.painter().with_clip_rect(clip);
            painter.text(at + Vec2::splat(1.0), egui::Align2::LEFT_TOP, &text, font.clone(), Color32::BLACK);
            painter.text(at, egui::Align2::LEFT_TOP, &text, font, Color32::WHITE);
        }
    }

    /// Brings hidden controls back where there is no keyboard.
    fn opener(&mut self, ui: &mut egui::Ui, space: Rect) {
        if self.shows_panel {
            return;
        }
        let size = Vec2::new(64.0, 20.0);
        let rect = Rect::from_min_size(Pos2::new(space.right() - size.x - 6.0, space.top() + 6.0), size);
        let response = ui.put(rect, egui::Button::new("controls").small()).on_hover_text("Tab hides them again.");
        self.marks.add("controls", rect);
        self.shows_panel = response.clicked();
    }

    /// What is to be said about what is, or is not, shown.
    fn words(&self, ui: &egui::Ui, space: Rect) {
        let (text, colour) = match (&self.error, &self.opening, self.last) {
            (Some(error), ..) => (format!("{error}\n(a click closes this)"), Color32::from_rgb(255, 190, 170)),
            (None, Some(opening), _) => {
                let name = &opening.name;
                (format!("{name}: reading, uploading, compiling kernels ..."), Color32::WHITE)
            }
            (None, None, None) => ("drop a .gltf or .glb file here".to_owned(), Color32::WHITE),
            _ => return,
        };
        let font = egui::FontId::proportional(13.0);
        let galley = ui.painter().layout(text, font, colour, (space.width() - 24.0).max(40.0));
        let at = Pos2::new(space.left() + 12.0, space.bottom() - galley.size().y - 10.0);
        let box_ = Rect::from_min_size(at, galley.size()).expand(6.0);
        ui.painter().rect_filled(box_, 3.0, Color32::from_black_alpha(200));
        ui.painter().galley(at, galley, colour);
    }
}

/// The largest rectangle of an aspect within a space, in its middle.
fn fitted(space: Rect, aspect: f32) -> Rect {
    let (width, height) = (space.width().max(1.0), space.height().max(1.0));
    let size =
        if width / height > aspect { Vec2::new(height * aspect, height) } else { Vec2::new(width, width / aspect) };
    Rect::from_center_size(space.center(), size)
}
