//! Controls. Those of parameters are made from their table, with its explanations.

use super::app::App;
use super::opening::{Sky, Source};
use super::views::{self, Saved};
use crate::baselines::{AtrousConstants, BASELINE_CONSTANTS, SvgfConstants};
use crate::choice::{Choice, DEBUG_VIEWS, Pane};
use crate::pilot::{Mode, Pilot};
use eframe::egui::{self, ComboBox, RichText, Slider, Ui};
use quell::settings::{ABLATIONS, Kind, PARAMETERS, Parameter, Preset, Settings};
use std::sync::Arc;

/// What the times of the paper are.
const PAPER: &str =
    "The talk's table of 2017: its own GPU, at 1280x720. It times no tracer, and other extents take other times.";

/// Ranges wider than this share get a slider by logarithm.
const WIDE: f32 = 100.0;

impl App {
    pub(super) fn panel(&mut self, ui: &mut Ui) {
        let width = ui.available_width();
        let panel = egui::Panel::left("controls").default_size((width * 0.5).min(310.0)).max_size(width * 0.6);
        panel.show(ui, |ui| {
            // Narrow windows scroll to both sides; the picture keeps its share.
            egui::ScrollArea::both().auto_shrink([false; 2]).show(ui, |ui| {
                ui.spacing_mut().slider_width = (width * 0.1).clamp(40.0, 120.0);
                self.scene_controls(ui);
                self.panes_controls(ui);
                self.tracing_controls(ui);
                self.camera_controls(ui);
                self.lamp_controls(ui);
                self.sky_controls(ui);
                self.denoiser_controls(ui);
                self.baseline_controls(ui);
                self.files_controls(ui);
                self.time_controls(ui);
            });
        });
    }

    /// Remembers where a control is.
    fn mark(&mut self, name: &str, response: &egui::Response) {
        self.marks.add(name, response.rect);
        if self.marks.seeks(name) {
            response.scroll_to_me(Some(egui::Align::Center));
        }
    }

    /// A part that can be closed.
    fn part(&mut self, ui: &mut Ui, name: &str, is_open: bool, inside: impl FnOnce(&mut Self, &mut Ui)) {
        let shown = egui::CollapsingHeader::new(RichText::new(name).strong()).default_open(is_open).show(ui, |ui| {
            inside(self, ui);
        });
        self.mark(name, &shown.header_response);
    }

    pub(super) fn button(&mut self, ui: &mut Ui, name: &str, hint: &str) -> bool {
        let response = ui.button(name).on_hover_text(hint);
        self.mark(name, &response);
        response.clicked()
    }

    fn scene_controls(&mut self, ui: &mut Ui) {
        let mut wanted = None;
        let shown = ComboBox::from_id_salt("scene").selected_text(self.name.clone()).show_ui(ui, |ui| {
            for info in quell_trace::builtin_scenes() {
                let response = ui.selectable_label(self.name == info.name, info.name).on_hover_text(info.stresses);
                self.mark(&format!("scene {}", info.name), &response);
                if response.clicked() {
                    wanted = Some(info.name);
                }
            }
        });
        let hint =
            "Built-in scenes. Files (.gltf, .glb; .hdr, .exr around them) are opened by dropping them on the window.";
        self.mark("scene", &shown.response);
        shown.response.on_hover_text(hint);
        if let Some(name) = wanted {
            self.open(Source::Named(name.to_owned()));
        }
        ui.horizontal_wrapped(|ui| {
            let name = if self.is_playing { "pause" } else { "play" };
            if self.button(ui, name, "Things and cameras that move by themselves (space).") {
                self.is_playing = !self.is_playing;
            }
            let name = if self.is_stopped { "go on" } else { "freeze" };
            if self.button(ui, name, "Makes no further frames.") {
                self.is_stopped = !self.is_stopped;
            }
            if self.button(ui, "cut", "Forgets history: as after a cut.") {
                self.engine.reset();
            }
            if self.button(ui, "hide", "Hides the controls (Tab).") {
                self.shows_panel = false;
            }
        });
        let response = ui.add(Slider::new(&mut self.speed, 0.0..=4.0).text("speed"));
        self.mark("speed", &response);
        for note in &self.notes {
            ui.label(RichText::new(note).small().weak());
        }
    }

    fn panes_controls(&mut self, ui: &mut Ui) {
        self.part(ui, "pictures", true, |app, ui| {
            ui.horizontal_wrapped(|ui| {
                for pane in Pane::ALL {
                    let mut on = app.choice.panes.contains(&pane);
                    let response = ui.checkbox(&mut on, pane.name());
                    app.mark(pane.name(), &response);
                    if response.changed() {
                        let wanted = |p: &Pane| if *p == pane { on } else { app.choice.panes.contains(p) };
                        let panes: Vec<Pane> = Pane::ALL.into_iter().filter(wanted).collect();
                        app.choice.panes = panes;
                        app.choice.tidy();
                    }
                }
            });
            let mut debug = app.choice.debug;
            let name = DEBUG_VIEWS.get(debug).map_or("", |(name, _)| name);
            let shown = ComboBox::from_id_salt("debug view").selected_text(name).show_ui(ui, |ui| {
                for (number, (name, _)) in DEBUG_VIEWS.iter().enumerate() {
                    let response = ui.selectable_value(&mut debug, number, *name);
                    app.mark(&format!("debug {name}"), &response);
                }
            });
            app.mark("debug view", &shown.response);
            app.choice.debug = debug;
            let mut scale = app.choice.debug_scale;
            let response = ui.add(Slider::new(&mut scale, 0.01..=100.0).logarithmic(true).text("debug scale"));
            app.mark("debug scale", &response);
            app.choice.debug_scale = scale;
            let mut stops = app.choice.stops;
            let response = ui.add(Slider::new(&mut stops, -8.0..=8.0).text("exposure"));
            app.mark("exposure", &response.on_hover_text("Stops beside the scene's own exposure."));
            app.choice.stops = stops;
            let mut pixels = app.scale;
            let hint = "Pixels of the picture for each of the window's, along both axes.";
            let response = ui.add(Slider::new(&mut pixels, 0.05..=2.0).text("scale")).on_hover_text(hint);
            app.mark("scale", &response);
            // A drag that goes on would make pictures anew at every frame.
            if !response.dragged() {
                app.scale = pixels;
            } else {
                app.scale = (pixels * 20.0).round() / 20.0;
            }
        });
    }

    fn tracing_controls(&mut self, ui: &mut Ui) {
        self.part(ui, "paths", true, |app, ui| {
            let mut tracing = app.choice.tracing;
            let rows: [(&str, &mut u32, u32, u32, &str); 3] = [
                ("paths a pixel", &mut tracing.paths, 1, 16, "Matte and glossy paths a pixel, of each."),
                ("bounces", &mut tracing.bounces, 0, 8, "Scatterings after the surface that is seen."),
                ("shadow rays", &mut tracing.direct_samples, 1, 64, "Of direct light, a pixel: no filter reads it."),
            ];
            for (name, value, least, most, hint) in rows {
                let response = ui.add(Slider::new(value, least..=most).text(name)).on_hover_text(hint);
                app.mark(name, &response);
            }
            let hint = "Moves the samples of each frame within pixels: temporal anti-aliasing smooths edges with them.";
            let response = ui.checkbox(&mut tracing.jitter, "jitter").on_hover_text(hint);
            app.mark("jitter", &response);
            app.choice.tracing = tracing.held();
        });
    }

    fn camera_controls(&mut self, ui: &mut Ui) {
        self.part(ui, "camera", true, |app, ui| {
            let Some(scene) = app.engine.stage().map(|stage| Arc::clone(stage.scene())) else { return };
            let Some(mut pilot) = app.pilot else { return };
            ui.horizontal_wrapped(|ui| {
                let modes = [
                    (Mode::Path, "The scene's own camera."),
                    (Mode::Orbit, "Drag: about the point that is looked at. Right button: across. Wheel: nearer."),
                    (Mode::Fly, "W, A, S, D, Q, E move, shift is faster; drag looks around."),
                ];
                for (mode, hint) in modes {
                    let response = ui.selectable_value(&mut pilot.mode, mode, mode.name()).on_hover_text(hint);
                    app.mark(mode.name(), &response);
                }
            });
            ui.horizontal_wrapped(|ui| {
                for number in 1..=scene.cameras.len().min(16) {
                    let response = ui.selectable_label(pilot.camera == number, number.to_string());
                    app.mark(&format!("camera {number}"), &response);
                    let there = Pilot::at(&scene, number, app.time, pilot.mode);
                    if let (true, Ok(there)) = (response.clicked(), there) {
                        pilot = there;
                    }
                }
            });
            app.pilot = Some(pilot);
            ui.horizontal_wrapped(|ui| {
                let hint = "Keeps where the camera is, and the time; also for the next time that this scene is opened.";
                if app.saved.len() < views::MOST && app.button(ui, "save view", hint) {
                    app.saved.push(Saved { pilot, time: app.time });
                    app.keep_views();
                }
                for number in 0..app.saved.len() {
                    let name = format!("view {}", number + 1);
                    if app.button(ui, &name, "Goes back to it.")
                        && let Some(saved) = app.saved.get(number)
                    {
                        app.time = saved.time;
                        app.pilot = Some(saved.pilot);
                    }
                }
                if !app.saved.is_empty() && app.button(ui, "forget views", "Those of this scene.") {
                    app.saved.clear();
                    app.keep_views();
                }
                let hint = "The view in words, as the option --view and a page's address take it.";
                if app.button(ui, "view as text", hint) {
                    app.tell_view(pilot);
                }
            });
            #[cfg(not(target_arch = "wasm32"))]
            app.film_controls(ui);
        });
    }

    fn lamp_controls(&mut self, ui: &mut Ui) {
        let lamps = self.engine.stage().map(|stage| stage.lamps().to_vec()).unwrap_or_default();
        if lamps.is_empty() {
            return;
        }
        self.part(ui, "lamps", false, |app, ui| {
            for (number, lamp) in lamps.iter().enumerate() {
                let mut on = lamp.on;
                let response = ui.checkbox(&mut on, &lamp.name);
                app.mark(&lamp.name, &response);
                if let (true, Some(stage)) = (response.changed(), app.engine.stage_mut()) {
                    stage.switch(number, on);
                }
            }
        });
    }

    fn sky_controls(&mut self, ui: &mut Ui) {
        self.part(ui, "environment", false, |app, ui| {
            let Some(sky) = app.sky.clone() else {
                ui.label(
                    RichText::new("The scene's own. A .hdr or .exr file that is dropped takes its place.").small(),
                );
                return;
            };
            ui.label(RichText::new(sky.source.name()).small());
            let mut turn = app.turn;
            let degrees = ui.add(Slider::new(&mut turn.degrees, -180.0..=180.0).text("rotation"));
            app.mark("environment rotation", &degrees);
            let strength = ui.add(Slider::new(&mut turn.strength, 0.01..=100.0).logarithmic(true).text("strength"));
            app.mark("environment strength", &strength);
            app.turn = turn;
            let degrees = degrees.on_hover_text("Degrees about the vertical, clockwise seen from above.");
            let strength = strength.on_hover_text("Multiplies the picture.");
            // The scene is made ready anew: once, at the end of a drag.
            let is_held = degrees.dragged() || strength.dragged();
            if !is_held && app.opening.is_none() && turn != sky.turn {
                app.surround(Some(Sky { turn, ..sky }));
            }
            if app.button(ui, "scene's own", "The scene's own environment again.") {
                app.surround(None);
            }
        });
    }

    fn denoiser_controls(&mut self, ui: &mut Ui) {
        ui.separator();
        ui.horizontal_wrapped(|ui| {
            ui.label("preset");
            for preset in Preset::ALL {
                if self.button(ui, preset.name(), "All parameters as the preset has them; no ablation.") {
                    let settings = Settings::preset(preset);
                    self.choice = Choice { settings, ablations: Vec::new(), ..self.choice.clone() };
                    self.choice.tidy();
                }
            }
        });
        self.part(ui, "ablations", false, |app, ui| {
            for (number, ablation) in ABLATIONS.iter().enumerate() {
                let mut on = app.choice.ablations.get(number).copied().unwrap_or(false);
                let response = ui.checkbox(&mut on, ablation.title).on_hover_text(ablation.name);
                app.mark(ablation.name, &response);
                if let Some(slot) = app.choice.ablations.get_mut(number) {
                    *slot = on;
                }
            }
        });
        for group in PARAMETERS.chunk_by(|a, b| a.group == b.group) {
            let name = group.first().map_or("", |p| p.group);
            self.part(ui, name, false, |app, ui| {
                for parameter in group {
                    app.parameter(ui, parameter);
                }
            });
        }
    }

    /// One parameter, by what its table says of it.
    fn parameter(&mut self, ui: &mut Ui, parameter: &'static Parameter) {
        let Ok(text) = self.choice.settings.get(parameter.name) else { return };
        let short = parameter.name.rsplit('.').next().unwrap_or(parameter.name).replace('_', " ");
        let mut wanted = text.clone();
        let response = match parameter.kind() {
            Kind::Number(least, most) => {
                let mut value: f32 = text.parse().unwrap_or(least);
                let response = number(ui, &mut value, [least, most], &short);
                if response.changed() {
                    wanted = value.clamp(least, most).to_string();
                }
                response
            }
            Kind::Whole(least, most) => {
                let mut value: u32 = text.parse().unwrap_or(least);
                let response = ui.add(Slider::new(&mut value, least..=most).text(short));
                if response.changed() {
                    wanted = value.to_string();
                }
                response
            }
            Kind::Switch => {
                let mut on = text == "on";
                let response = ui.checkbox(&mut on, short);
                wanted = if on { "on" } else { "off" }.to_owned();
                response
            }
            Kind::Choice(names) => {
                let shown = ComboBox::new(parameter.name, short).selected_text(&text).show_ui(ui, |ui| {
                    for name in names {
                        let response = ui.selectable_label(*name == text, *name);
                        self.mark(&format!("{} {name}", parameter.name), &response);
                        if response.clicked() {
                            (*name).clone_into(&mut wanted);
                        }
                    }
                });
                shown.response
            }
        };
        let response = response.on_hover_ui(|ui| {
            ui.strong(parameter.name);
            let unit = if parameter.unit.is_empty() { String::new() } else { format!(", {}", parameter.unit) };
            ui.label(format!("{}\n{}{unit}.", parameter.doc, parameter.range()));
            ui.label(format!("Higher, or on: {}\nLower, or off: {}", parameter.higher, parameter.lower));
            ui.label(RichText::new(parameter.source).weak());
        });
        self.mark(parameter.name, &response);
        if wanted != text {
            // Its own range made the control: a value outside of it stays as it was.
            let _ = self.choice.settings.set(parameter.name, &wanted);
        }
    }

    /// Constants of a-trous and SVGF.
    fn baseline_controls(&mut self, ui: &mut Ui) {
        self.part(ui, "baselines", false, |app, ui| {
            let mut constants = app.choice.baselines;
            ui.horizontal_wrapped(|ui| {
                ui.label("constants");
                if app.button(ui, "atrous", "Those of a-trous, as they were fitted.") {
                    constants.atrous = AtrousConstants::default();
                }
                let hints = ["Those of SVGF's paper.", "The defaults of the code that SVGF's authors published later."];
                for ((name, preset), hint) in SvgfConstants::PRESETS.into_iter().zip(hints) {
                    if app.button(ui, name, hint) {
                        constants.svgf = preset;
                    }
                }
            });
            for constant in BASELINE_CONSTANTS {
                let mut value = constant.get(&constants);
                let name = constant.name.replace(['.', '_'], " ");
                let response = if constant.is_whole {
                    let [least, most] = constant.range.map(|v| v as u32);
                    let mut whole = value as u32;
                    let response = ui.add(Slider::new(&mut whole, least..=most).text(name));
                    value = whole as f32;
                    response
                } else {
                    number(ui, &mut value, constant.range, &name)
                };
                if response.changed() {
                    constant.set(&mut constants, value);
                }
                let response = response.on_hover_ui(|ui| {
                    ui.strong(constant.name);
                    ui.label(constant.doc);
                    ui.label(RichText::new(constant.source).weak());
                });
                app.mark(constant.name, &response);
            }
            app.choice.baselines = constants.held();
        });
    }

    fn files_controls(&mut self, ui: &mut Ui) {
        ui.separator();
        ui.horizontal_wrapped(|ui| {
            if self.button(ui, "save PNG", "The picture as it is shown (P).") {
                self.save_picture();
            }
            if self.button(ui, "save EXR", "The running frame's planes, as `quell render` writes them.") {
                self.save_planes();
            }
        });
        if let Some(said) = &self.said {
            ui.label(RichText::new(said).small());
        }
    }

    fn time_controls(&mut self, ui: &mut Ui) {
        self.part(ui, "times", true, |app, ui| {
            ui.label(RichText::new(&app.adapter).small());
            let size = app.engine.size();
            let mean = app.history.iter().sum::<f32>() / app.history.len().max(1) as f32;
            ui.label(format!("{size}, {:.1} ms a frame", mean * 1e3));
            curve(ui, app.history.iter().copied());
            if app.times.0.is_empty() {
                ui.label(RichText::new("this device has no timestamps").small().weak());
            }
            egui::Grid::new("passes").num_columns(3).striped(true).show(ui, |ui| {
                if !app.times.0.is_empty() {
                    let head = |text| RichText::new(text).small().weak();
                    ui.label(head("pass"));
                    ui.label(head("here"));
                    let response = ui.label(head("paper")).on_hover_text(PAPER);
                    app.mark("times of the paper", &response);
                    ui.end_row();
                }
                for pass in &app.times.0 {
                    ui.label(RichText::new(pass.name).small());
                    ui.label(RichText::new(format!("{:.3} ms", pass.milliseconds)).small());
                    if let Some(ms) = pass.paper_milliseconds() {
                        ui.label(RichText::new(format!("{ms:.2} ms")).small()).on_hover_text(PAPER);
                    }
                    ui.end_row();
                }
                if let Some([here, paper]) = app.times.beside_paper() {
                    ui.label("stages of the paper");
                    ui.label(format!("{here:.2} ms"));
                    ui.label(format!("{paper:.2} ms")).on_hover_text(PAPER);
                    ui.end_row();
                }
                if !app.times.0.is_empty() {
                    ui.label("sum");
                    ui.label(format!("{:.2} ms", app.times.sum()));
                    ui.end_row();
                }
                for (name, bytes) in app.engine.memory() {
                    ui.label(RichText::new(format!("memory: {name}")).small());
                    ui.label(RichText::new(format!("{:.1} MB", bytes as f64 / 1e6)).small());
                    ui.end_row();
                }
            });
        });
    }
}

/// A slider, by logarithm where its range is wide.
fn number(ui: &mut Ui, value: &mut f32, [least, most]: [f32; 2], name: &str) -> egui::Response {
    let wide = least >= 0.0 && most / least.max(most / 1e6) > WIDE && most > 1.0;
    let slider = Slider::new(value, least..=most).logarithmic(wide).text(name);
    ui.add(slider.smallest_positive(f64::from(most) / 1e4))
}

/// Frame times, newest to the right.
fn curve(ui: &mut Ui, seconds: impl Iterator<Item = f32> + Clone) {
    let size = egui::Vec2::new(ui.available_width(), 36.0);
    let (rect, _) = ui.allocate_exact_size(size, egui::Sense::hover());
    let most = seconds.clone().fold(1e-3_f32, f32::max);
    ui.painter().rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let step = rect.width() / super::app::HISTORY as f32;
    let points: Vec<egui::Pos2> = seconds
        .enumerate()
        .map(|(i, s)| egui::Pos2::new(rect.left() + i as f32 * step, rect.bottom() - s / most * rect.height()))
        .collect();
    ui.painter().line(points, egui::Stroke::new(1.0, ui.visuals().hyperlink_color));
}
