//! What is open, what is shown, and the frame that is asked of the engine.

#[cfg(not(target_arch = "wasm32"))]
use super::drive::{Drive, Script};
#[cfg(not(target_arch = "wasm32"))]
use super::film::Film;
use super::marks::Marks;
use super::opening::{Opening, Place, Sky, Source};
use super::views::{self, Saved};
use crate::choice::Choice;
use crate::clock::Times;
use crate::engine::{Engine, Made, Sight};
use crate::error::LiveError;
use crate::pilot::{Mode, Pilot, View};
use crate::shot::{PlanesShot, Shot};
use crate::stage::{Turn, is_environment};
use eframe::egui;
use eframe::egui_wgpu::RenderState;
use quell::Size;
use quell::gpu::wgpu;
use quell_frames::{Content, FrameToWrite, Metadata};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Frames whose times are kept.
pub(super) const HISTORY: usize = 120;
/// Frames a second of what moves.
pub(super) const SCENE_RATE: f64 = 24.0;
/// The window has had a size for so long before pictures take it, seconds.
const SETTLED: f64 = 0.15;

/// How a program is begun.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// A built-in scene, or a file's path.
    pub(super) source: String,
    /// What surrounds it, in place of its own environment.
    pub(super) sky: Option<Sky>,
    /// Pixels of the picture for each of the window's, along both axes.
    pub(super) scale: Option<f32>,
    /// The same where it is not said and the device is not one in software.
    pub(super) usual_scale: f32,
    /// The picture's own extent, whatever the window's is.
    pub(super) size: Option<Size>,
    /// Where files are written; a page's go where the browser keeps what it downloads.
    pub(super) folder: PathBuf,
    /// Where the first scene's camera stands ([`Pilot::words`]).
    pub(super) view: Option<View>,
    /// Whether controls are shown.
    pub(super) shows_panel: bool,
    /// What was chosen before the device was lost.
    pub(super) choice: Option<Choice>,
    #[cfg(not(target_arch = "wasm32"))]
    pub(super) script: Option<Script>,
    #[cfg(not(target_arch = "wasm32"))]
    pub(super) lost: Lost,
}

/// Whether the device was lost, and what a window that is opened anew goes on with. A page is loaded anew by its user.
#[cfg(not(target_arch = "wasm32"))]
#[derive(Clone, Debug, Default)]
pub(super) struct Lost {
    pub(super) is_lost: Arc<AtomicBool>,
    pub(super) kept: Arc<Mutex<Option<Box<Start>>>>,
}

/// What a device said by itself.
pub(super) type Trouble = Arc<Mutex<Option<String>>>;

/// The program.
pub(super) struct App {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    renderer: Arc<eframe::egui::mutex::RwLock<eframe::egui_wgpu::Renderer>>,
    pub(super) adapter: String,
    pub(super) engine: Engine,
    pub(super) texture: egui::TextureId,
    pub(super) choice: Choice,
    pub(super) pilot: Option<Pilot>,
    pub(super) saved: Vec<Saved>,
    pub(super) name: String,
    /// Of the scene that is shown.
    source: Option<Source>,
    /// What surrounds it, in place of its own environment.
    pub(super) sky: Option<Sky>,
    /// How the controls have turned it.
    pub(super) turn: Turn,
    pub(super) opening: Option<Opening>,
    /// What a user should know of the scene.
    pub(super) notes: Vec<String>,
    /// What went wrong last.
    pub(super) error: Option<String>,
    /// What was done last.
    pub(super) said: Option<String>,
    pub(super) time: f64,
    pub(super) is_playing: bool,
    pub(super) speed: f32,
    pub(super) is_stopped: bool,
    pub(super) scale: f32,
    size: Option<Size>,
    folder: PathBuf,
    /// The extent that the window asks for, and since when.
    asked: (Size, f64),
    pub(super) pointer: [u32; 2],
    pub(super) last: Option<Made>,
    pub(super) times: Times,
    /// Seconds from frame to frame.
    pub(super) history: VecDeque<f32>,
    shown_at: Option<f64>,
    is_busy: Arc<AtomicBool>,
    shot: Option<(Shot, PathBuf)>,
    planes: Option<(PlanesShot, Metadata, PathBuf)>,
    pub(super) trouble: Trouble,
    pub(super) marks: Marks,
    /// A page has no folder for hundreds of pictures.
    #[cfg(not(target_arch = "wasm32"))]
    pub(super) film: Film,
    #[cfg(not(target_arch = "wasm32"))]
    pub(super) drive: Option<Drive>,
    /// How it was begun.
    #[cfg(not(target_arch = "wasm32"))]
    start: Start,
    pub(super) shows_panel: bool,
    view: Option<View>,
    started: bool,
}

impl App {
    pub(super) fn new(state: &RenderState, start: Start, trouble: Trouble) -> Result<Self, LiveError> {
        let (device, queue) = (state.device.clone(), state.queue.clone());
        let info = state.adapter.get_info();
        let is_software = info.device_type == wgpu::DeviceType::Cpu;
        let noted = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let words = match error {
                wgpu::Error::OutOfMemory { .. } => {
                    "the device's memory ran out: choose a smaller scale or another scene".to_owned()
                }
                wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
                    format!("the device refused a command, which is a fault of quell or of the driver: {description}")
                }
            };
            noted.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(words);
        }));
        let size = start.size.unwrap_or(Size::new(64, 36));
        let engine = Engine::new(&device, &queue, size)?;
        let texture =
            state.renderer.write().register_native_texture(&device, engine.picture(), wgpu::FilterMode::Nearest);
        let given = start.choice.clone();
        let mut app = Self {
            #[cfg(not(target_arch = "wasm32"))]
            start: start.clone(),
            adapter: if is_software { format!("{} (software: slow)", info.name) } else { info.name },
            renderer: Arc::clone(&state.renderer),
            engine,
            texture,
            choice: given.clone().unwrap_or_default(),
            pilot: None,
            saved: Vec::new(),
            name: String::new(),
            source: None,
            sky: None,
            turn: Turn::default(),
            opening: None,
            notes: Vec::new(),
            error: None,
            said: None,
            time: 0.0,
            is_playing: true,
            speed: 1.0,
            is_stopped: false,
            // A device in software traces a sixteenth of the pixels.
            scale: start.scale.unwrap_or(if is_software { 0.25 } else { start.usual_scale }),
            size: start.size,
            folder: start.folder,
            asked: (size, 0.0),
            pointer: [0; 2],
            last: None,
            times: Times::default(),
            history: VecDeque::new(),
            shown_at: None,
            is_busy: Arc::default(),
            shot: None,
            planes: None,
            trouble,
            marks: Marks::default(),
            #[cfg(not(target_arch = "wasm32"))]
            film: Film::default(),
            #[cfg(not(target_arch = "wasm32"))]
            drive: start.script.map(Drive::new),
            shows_panel: start.shows_panel,
            view: start.view,
            started: false,
            device,
            queue,
        };
        if is_software && given.is_none() {
            app.choice.tracing.direct_samples = 4;
        }
        app.begin(Source::Named(start.source), start.sky, false);
        Ok(app)
    }

    /// Opens a scene, or a picture that surrounds the one that is shown. The last scene stays until that is ready, or for good
    /// where it is refused.
    pub(super) fn open(&mut self, source: Source) {
        if is_environment(&source.name()) {
            self.surround(Some(Sky { source, turn: Turn::default() }));
            return;
        }
        let sky = self.opening.as_ref().map_or(&self.sky, |opening| &opening.sky).clone();
        self.begin(source, sky, false);
    }

    /// Puts a picture around the scene; none: its own environment.
    pub(super) fn surround(&mut self, sky: Option<Sky>) {
        let (source, is_same_scene) = match &self.opening {
            Some(opening) => (Some(opening.source.clone()), opening.is_same_scene),
            None => (self.source.clone(), true),
        };
        if let Some(source) = source {
            self.begin(source, sky, is_same_scene);
        }
    }

    fn begin(&mut self, source: Source, sky: Option<Sky>, is_same_scene: bool) {
        self.error = None;
        let place = Place {
            device: self.device.clone(),
            queue: self.queue.clone(),
            kernels: Arc::clone(self.engine.kernels()),
            options: self.engine.options(self.choice.tracing),
        };
        self.opening = Some(Opening::begin(source, sky, is_same_scene, place));
    }

    /// Takes a scene that has arrived.
    fn arrive(&mut self) {
        let Some(opened) = self.opening.as_ref().and_then(Opening::arrived) else { return };
        let Some(Opening { name, source, sky, is_same_scene, .. }) = self.opening.take() else { return };
        let kept = self.pilot.filter(|_| is_same_scene).map(|pilot| (pilot, self.time));
        let pilot = opened.and_then(|(stage, notes)| {
            if let Some((pilot, time)) = kept {
                return Ok((stage, notes, pilot, time));
            }
            let mut pilot = Pilot::at(stage.scene(), 1, 0.0, Mode::Path)?;
            let view = self.view.take();
            if let Some(view) = view {
                pilot.place(&view)?;
            }
            Ok((stage, notes, pilot, view.map_or(0.0, |view| view.time)))
        });
        match pilot {
            Ok((stage, mut notes, pilot, time)) => {
                notes.extend(stage.notes().iter().cloned());
                self.engine.set_stage(stage);
                self.pilot = Some(pilot);
                (self.name, self.notes, self.time) = (name, notes, time);
                self.turn = sky.as_ref().map_or_else(Turn::default, |sky| sky.turn);
                (self.source, self.sky) = (Some(source), sky);
                self.last = None;
                if !is_same_scene {
                    self.find_views();
                    #[cfg(not(target_arch = "wasm32"))]
                    self.film.forget();
                }
            }
            Err(error) => {
                let words = error.to_string();
                let is_of_sky = matches!(error, LiveError::Environment(_) | LiveError::Surround(..));
                let sky = sky.map(|sky| sky.source.name());
                // Errors of files begin with their names, those of surroundings have theirs.
                let is_named = words.starts_with(&name) || sky.is_some_and(|sky| words.starts_with(&sky));
                self.error = Some(if is_of_sky || is_named { words } else { format!("{name}: {words}") });
                self.turn = self.sky.as_ref().map_or_else(Turn::default, |sky| sky.turn);
            }
        }
    }

    /// Where time stands, after a frame that took so long.
    fn go_on(&mut self, seconds: f64) {
        #[cfg(not(target_arch = "wasm32"))]
        if self.film.is_writing() {
            return;
        }
        if self.is_playing && !self.is_driven() {
            self.time += seconds.min(0.25) * SCENE_RATE * f64::from(self.speed);
        } else if self.is_playing {
            // The same frames in every run of a script.
            self.time += f64::from(self.speed);
        }
        // Then from the start: a cut.
        let frames = self.engine.stage().map_or(0, |stage| stage.scene().frames) as f64;
        if frames > 0.0 && self.time >= frames {
            self.time = 0.0;
            self.engine.reset();
        }
    }

    /// The device is lost: nothing may be drawn any more (egui ends the program at the first buffer that it cannot make),
    /// and the window closes. Another one goes on with this scene, view and choice.
    #[cfg(not(target_arch = "wasm32"))]
    fn leave(&self, ctx: &egui::Context) {
        let mut start = self.start.clone();
        if let (Some(source), Some(pilot)) = (&self.source, &self.pilot) {
            start.source = source.name();
            let is_users = pilot.mode != Mode::Path;
            start.view = is_users.then(|| pilot.words(self.time).parse().ok()).flatten();
            start.sky = self.sky.clone();
        }
        start.scale = Some(self.scale);
        start.shows_panel = self.shows_panel;
        start.choice = Some(self.choice.clone());
        *self.start.lost.kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(start));
        ctx.graphics_mut(|graphics| *graphics = egui::layers::GraphicLayers::default());
        ctx.send_viewport_cmd(egui::ViewportCommand::Close);
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn is_lost(&self) -> bool {
        self.start.lost.is_lost.load(Ordering::Acquire)
    }

    /// A script stands in for the user.
    fn is_driven(&self) -> bool {
        #[cfg(not(target_arch = "wasm32"))]
        return self.drive.is_some();
        #[cfg(target_arch = "wasm32")]
        false
    }

    /// Pictures of the extent that the window asks for, once it has settled. `asked` in pixels of the screen.
    pub(super) fn fit(&mut self, asked: [f32; 2], now: f64) {
        let side = |v: f32| ((v * self.scale).round() as usize).max(1);
        let most = self.device.limits().max_texture_dimension_2d as usize;
        let size = self.size.unwrap_or(Size::new(side(asked[0]).min(most), side(asked[1]).min(most)));
        if size != self.asked.0 {
            self.asked = (size, now);
        }
        let has_settled = now - self.asked.1 >= SETTLED || !self.started || self.is_driven();
        if size == self.engine.size() || !has_settled || self.is_held() {
            return;
        }
        match self.engine.resize(size) {
            Ok(()) => {
                let mut renderer = self.renderer.write();
                let (view, filter) = (self.engine.picture(), wgpu::FilterMode::Nearest);
                renderer.update_egui_texture_from_wgpu_texture(&self.device, view, filter, self.texture);
                self.last = None;
            }
            Err(error) => self.error = Some(error.to_string()),
        }
        self.started = true;
    }

    /// A frame, if the last one is done.
    pub(super) fn make(&mut self, now: f64) {
        self.arrive();
        self.times = self.engine.times();
        if self.is_stopped || self.is_busy.load(Ordering::Acquire) {
            return;
        }
        #[cfg(not(target_arch = "wasm32"))]
        if !self.next_step() {
            return;
        }
        let (Some(stage), Some(pilot)) = (self.engine.stage(), &mut self.pilot) else { return };
        let scene = Arc::clone(stage.scene());
        pilot.follow(&scene, self.time);
        let camera = match pilot.view(&scene, self.time, self.engine.size()) {
            Ok(camera) => camera,
            Err(error) => {
                self.error = Some(error.to_string());
                return;
            }
        };
        let sight = Sight { camera, time: self.time, pointer: self.pointer };
        self.choice.tidy();
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("live") });
        match self.engine.encode(&mut encoder, &sight, &self.choice) {
            Ok(made) => self.last = Some(made),
            Err(error) => {
                self.error = Some(error.to_string());
                return;
            }
        }
        self.queue.submit([encoder.finish()]);
        self.is_busy.store(true, Ordering::Release);
        let is_busy = Arc::clone(&self.is_busy);
        self.queue.on_submitted_work_done(move || is_busy.store(false, Ordering::Release));
        #[cfg(not(target_arch = "wasm32"))]
        self.step_done();
        if let Some(before) = self.shown_at {
            self.history.push_back((now - before) as f32);
            if self.history.len() > HISTORY {
                self.history.pop_front();
            }
            self.go_on(now - before);
        }
        self.shown_at = Some(now);
    }

    /// Begins a picture's way to a file.
    pub(super) fn save_picture(&mut self) {
        let number = self.last.map_or(0, |made| made.number);
        self.shoot(self.file(&format!("{number:05}"), "png"));
    }

    /// A picture is on its way to a file.
    pub(super) fn is_saving(&self) -> bool {
        self.shot.is_some()
    }

    /// Pictures keep their extent: one is on its way, or many of one path are.
    fn is_held(&self) -> bool {
        #[cfg(not(target_arch = "wasm32"))]
        if self.film.is_writing() {
            return true;
        }
        self.is_saving()
    }

    pub(super) fn shoot(&mut self, path: PathBuf) {
        if self.shot.is_some() || self.last.is_none() {
            return;
        }
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("shot") });
        let shot = Shot::new(&self.device, &mut encoder, self.engine.picture().texture());
        self.queue.submit([encoder.finish()]);
        self.shot = Some((shot, path));
    }

    /// Views of this scene that were saved earlier.
    fn find_views(&mut self) {
        self.saved.clear();
        let Some(stage) = self.engine.stage() else { return };
        match read_views(&self.folder).and_then(|text| views::of(&text, &self.name, stage.scene())) {
            Ok(saved) => self.saved = saved,
            Err(words) => self.error = Some(words),
        }
    }

    /// Keeps the saved views for other times.
    pub(super) fn keep_views(&mut self) {
        let text = read_views(&self.folder).and_then(|text| views::with(&text, &self.name, &self.saved));
        if let Err(words) = text.and_then(|text| write_views(&self.folder, &text)) {
            self.error = Some(words);
        }
    }

    /// The view in words: in a page its address becomes that of the view.
    pub(super) fn tell_view(&mut self, pilot: Pilot) {
        let words = pilot.words(self.time);
        #[cfg(not(target_arch = "wasm32"))]
        let said = format!("--view {words}");
        #[cfg(target_arch = "wasm32")]
        let said = super::page::address(&self.name, self.sky.as_ref(), &words);
        self.said = Some(said);
    }

    /// A name that says what is shown.
    pub(super) fn file(&self, part: &str, extension: &str) -> PathBuf {
        let stem: String = std::path::Path::new(&self.name).file_stem().map_or_else(String::new, |stem| {
            stem.to_string_lossy().chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect()
        });
        self.folder.join(format!("{stem}-{part}.{extension}"))
    }

    /// Ends it, once the pixels are there.
    fn finish_shot(&mut self) {
        let Some(pixels) = self.shot.as_ref().and_then(|(shot, _)| shot.take()) else { return };
        let Some((shot, path)) = self.shot.take() else { return };
        let size = shot.size();
        let written = png(size, &pixels).and_then(|bytes| write(&path, &bytes));
        match written {
            Ok(()) => self.said = Some(format!("wrote {}", path.display())),
            Err(error) => {
                self.error = Some(error.to_string());
                #[cfg(not(target_arch = "wasm32"))]
                self.end_film();
            }
        }
    }

    /// Begins the last frame's way to a file of its planes.
    pub(super) fn save_planes(&mut self) {
        if self.planes.is_some() {
            return;
        }
        let number = self.last.map_or(0, |made| made.number);
        let path = self.file(&format!("{number:05}"), "exr");
        match self.engine.planes_of_last() {
            Ok(shot) => self.planes = Some((shot, self.metadata(), path)),
            Err(error) => self.error = Some(error.to_string()),
        }
    }

    /// What stands in the header of a frame's planes.
    fn metadata(&self) -> Metadata {
        let tracing = self.choice.tracing;
        Metadata {
            content: Content::Noisy,
            scene: self.name.clone(),
            sampling: format!(
                "exact, {} samples, {} bounces, {} shadow rays, traced on a GPU",
                tracing.paths, tracing.bounces, tracing.direct_samples
            ),
            exposure: self.engine.stage().map_or(1.0, |stage| stage.scene().exposure),
            ..Metadata::default()
        }
    }

    /// Ends it, once all bands are there.
    fn finish_planes(&mut self) {
        let Some(taken) = self.planes.as_mut().and_then(|(shot, ..)| shot.take()) else { return };
        let Some((_, metadata, path)) = self.planes.take() else { return };
        let written = taken.and_then(|rendered| {
            let frame = FrameToWrite { metadata, ..FrameToWrite::new(rendered.frame.frame(&[])) };
            write_planes(&path, &frame)
        });
        match written {
            Ok(()) => self.said = Some(format!("wrote {}", path.display())),
            Err(error) => self.error = Some(error.to_string()),
        }
    }

    /// What a test asks for.
    pub(super) fn report(&self) -> serde_json::Value {
        let size = self.engine.size();
        #[cfg(not(target_arch = "wasm32"))]
        let film = self.film.frames();
        #[cfg(target_arch = "wasm32")]
        let film = 0;
        let pilot = self.pilot.as_ref();
        serde_json::json!({
            "scene": self.name,
            "opening": self.opening.as_ref().map(|o| o.name.clone()),
            "environment": self.sky.as_ref().map(|sky| sky.source.name()),
            "error": self.error,
            "said": self.said,
            "frame": self.last.map(|made| made.number),
            "converged": self.last.map(|made| made.converged),
            "size": [size.width, size.height],
            "panes": self.choice.panes.iter().map(|p| p.name()).collect::<Vec<_>>(),
            "splits": self.choice.splits,
            "paths": self.choice.tracing.paths,
            "ablations": self.choice.ablations,
            "camera": pilot.map(|p| format!("{:?}", p.mode)),
            "eye": pilot.map(|p| p.eye().to_array()),
            "forward": pilot.map(|p| p.forward().to_array()),
            "film": film,
            "time": self.time,
            "views": self.saved.len(),
            "view": pilot.map(|p| p.words(self.time)),
            "settings": quell::settings::PARAMETERS.iter().map(|p| {
                (p.name.to_owned(), self.choice.settings.get(p.name).unwrap_or_default().into())
            }).collect::<serde_json::Map<String, serde_json::Value>>(),
            "baselines": crate::BASELINE_CONSTANTS.iter().map(|c| {
                (c.name.to_owned(), c.get(&self.choice.baselines).into())
            }).collect::<serde_json::Map<String, serde_json::Value>>(),
            "milliseconds": self.times.sum(),
            "beside paper": self.times.beside_paper(),
            "marks": self.marks.report(),
        })
    }
}

/// A picture of four bytes a pixel as a PNG file, alpha left out.
fn png(size: Size, pixels: &[u8]) -> Result<Vec<u8>, LiveError> {
    use image::ImageEncoder;
    if pixels.len() != 4 * size.pixels() {
        return Err(LiveError::Device("the device did not hand over the picture".to_owned()));
    }
    let rgb: Vec<u8> = pixels.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let kind = image::ExtendedColorType::Rgb8;
    encoder
        .write_image(&rgb, size.width as u32, size.height as u32, kind)
        .map_err(|error| LiveError::Write(error.to_string()))?;
    Ok(bytes)
}

impl eframe::App for App {
    #[cfg(target_arch = "wasm32")]
    fn as_any_mut(&mut self) -> Option<&mut dyn std::any::Any> {
        Some(self)
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn raw_input_hook(&mut self, _: &egui::Context, input: &mut egui::RawInput) {
        if let Some(mut drive) = self.drive.take() {
            drive.before_frame(self, input);
            self.drive = Some(drive);
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        let now = ctx.input(|i| i.time);
        // Callbacks are heard; nothing is waited for. A device that is lost says so by its own callback.
        let _ = self.device.poll(wgpu::PollType::Poll);
        #[cfg(not(target_arch = "wasm32"))]
        if self.is_lost() {
            self.leave(&ctx);
            return;
        }
        let dropped = ctx.input(|i| i.raw.dropped_files.clone());
        for file in dropped {
            self.open(Source::Dropped(file));
        }
        if let Some(words) = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).take() {
            self.error = Some(words);
        }
        self.marks.begin();
        self.keys(&ctx);
        if self.shows_panel {
            self.panel(ui);
        }
        self.picture(ui, now);
        self.make(now);
        self.finish_shot();
        self.finish_planes();
        #[cfg(not(target_arch = "wasm32"))]
        if let Some(mut drive) = self.drive.take() {
            drive.after_frame(self, &ctx);
            self.drive = Some(drive);
        }
        #[cfg(not(target_arch = "wasm32"))]
        if self.is_lost() {
            self.leave(&ctx);
        }
        // Frames follow each other.
        ctx.request_repaint();
    }
}

#[cfg(not(target_arch = "wasm32"))]
fn write(path: &std::path::Path, bytes: &[u8]) -> Result<(), LiveError> {
    quell_frames::files::write_bytes(path, bytes).map_err(|error| LiveError::Write(error.to_string()))
}

#[cfg(not(target_arch = "wasm32"))]
fn write_planes(path: &std::path::Path, frame: &FrameToWrite<'_>) -> Result<(), LiveError> {
    let options = quell_frames::WriteOptions::default();
    quell_frames::write_frame(path, frame, &options).map_err(|error| LiveError::Write(error.to_string()))?;
    Ok(())
}

/// The text of saved views; empty: there is none yet.
#[cfg(not(target_arch = "wasm32"))]
fn read_views(folder: &std::path::Path) -> Result<String, String> {
    match std::fs::read_to_string(folder.join(views::NAME)) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        read => read.map_err(|error| format!("{}: {error}", folder.join(views::NAME).display())),
    }
}

#[cfg(not(target_arch = "wasm32"))]
fn write_views(folder: &std::path::Path, text: &str) -> Result<(), String> {
    write(&folder.join(views::NAME), text.as_bytes()).map_err(|error| error.to_string())
}

#[cfg(target_arch = "wasm32")]
use super::page::{read_views, write, write_planes, write_views};
