//! The program in a page: WebGPU, one thread. Nothing waits: files are fetched, kernels are compiled by the browser's own
//! processes, and a scene is made ready in steps between which frames are shown.

use super::adapter::device_descriptor;
use super::app::{App, Start, Trouble};
use super::opening::{Opened, Place, Sky, Source};
use super::views;
use crate::error::LiveError;
use crate::stage::{Surroundings, loaded, parsed};
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use quell::gpu::wgpu;
use quell_frames::{FrameToWrite, Precision, frame_bytes};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{Blob, HtmlAnchorElement, HtmlCanvasElement, Response, Url, UrlSearchParams};

thread_local! {
    /// Shows words in the page, where the canvas cannot; no words: nothing is to be said any more.
    static SAY: RefCell<Option<js_sys::Function>> = const { RefCell::new(None) };
    static RUNNER: RefCell<Option<eframe::WebRunner>> = const { RefCell::new(None) };
}

/// After a lost device no frame may be asked for: wgpu would end the program at the first buffer that it cannot make.
fn lost(words: &str) {
    if let Some(runner) = RUNNER.take() {
        runner.destroy();
    }
    say(&format!("The graphics device was lost ({words}). Reload the page to begin anew."));
}

fn say(words: &str) {
    SAY.with_borrow(|say| {
        if let Some(say) = say {
            // An error in the page's own function is the page's.
            let _ = say.call1(&JsValue::NULL, &words.into());
        }
    });
}

/// quell live in a canvas.
#[wasm_bindgen]
pub struct QuellLive {
    runner: eframe::WebRunner,
}

#[wasm_bindgen]
impl QuellLive {
    /// Opens a built-in scene by its name, or a .glb or .gltf file by its address; the picture at the address of a .hdr or .exr
    /// file surrounds the scene that is shown. The last scene stays until it is there, and
    /// for good where it is refused.
    pub fn open(&self, source: String) {
        if let Some(mut app) = self.runner.app_mut::<App>() {
            app.open(Source::Named(source));
        }
    }

    /// What is shown, and where controls are (points of the canvas): JSON. Empty after a failure.
    pub fn report(&self) -> String {
        self.runner.app_mut::<App>().map(|app| app.report().to_string()).unwrap_or_default()
    }

    /// Makes no further frames, as for a canvas out of sight; or goes on.
    pub fn freeze(&self, is_stopped: bool) {
        if let Some(mut app) = self.runner.app_mut::<App>() {
            app.is_stopped = is_stopped;
        }
    }

    /// Ends it and lets go of the device.
    pub fn stop(&self) {
        self.runner.destroy();
    }
}

/// Begins in a canvas. `search`: parameters as in the page's address (docs/live.md). `say(words)` is called with what cannot be
/// drawn, and with no words once there is nothing to say.
///
/// # Errors
/// Parameters that cannot be read; no WebGPU; words as a string.
#[wasm_bindgen]
pub async fn start(canvas: HtmlCanvasElement, search: &str, say: js_sys::Function) -> Result<QuellLive, JsValue> {
    SAY.set(Some(say));
    let start = parameters(search)?;
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = wgpu::Backends::BROWSER_WEBGPU;
    setup.device_descriptor = Arc::new(device_descriptor);
    let wgpu_options = WgpuConfiguration { wgpu_setup: WgpuSetup::CreateNew(setup), ..WgpuConfiguration::default() };
    let options = eframe::WebOptions { renderer: eframe::Renderer::Wgpu, wgpu_options, ..Default::default() };
    let runner = eframe::WebRunner::new();
    RUNNER.set(Some(runner.clone()));
    let creator = move |creation: &eframe::CreationContext<'_>| {
        let state = creation.wgpu_render_state.as_ref().ok_or("there is no WebGPU device")?;
        state.device.set_device_lost_callback(|reason, words| {
            // The page itself lets go of it at its end.
            if reason != wgpu::DeviceLostReason::Destroyed {
                lost(&words);
            }
        });
        creation.egui_ctx.set_theme(eframe::egui::Theme::Dark);
        let trouble: Trouble = Arc::new(Mutex::new(None));
        let app = App::new(state, start, trouble)?;
        // After the denoiser's kernels are compiled: only then is something drawn.
        state.queue.on_submitted_work_done(|| self::say(""));
        Ok(Box::new(app) as Box<dyn eframe::App>)
    };
    runner.start(canvas, options, Box::new(creator)).await?;
    Ok(QuellLive { runner })
}

/// The share of the canvas' pixels along both axes that is traced unless the address says: any GPU may look at a page.
const USUAL_SCALE: f32 = 0.5;

fn parameters(search: &str) -> Result<Start, JsValue> {
    let given = UrlSearchParams::new_with_str(search)?;
    let wrong = |name: &str, wanted: &str, value: &str| {
        JsValue::from_str(&format!("the address' parameter {name} takes {wanted}, not `{value}`"))
    };
    let mut start = Start {
        source: given.get("scene").filter(|s| !s.is_empty()).unwrap_or_else(|| "glossy-room".to_owned()),
        scale: None,
        usual_scale: USUAL_SCALE,
        size: None,
        folder: PathBuf::new(),
        view: None,
        sky: None,
        shows_panel: true,
        choice: None,
    };
    if let Some(text) = given.get("view") {
        start.view = Some(text.parse().map_err(|wanted| wrong("view", wanted, &text))?);
    }
    if let Some(text) = given.get("scale") {
        let scale = text.parse().ok().filter(|v: &f32| (0.05..=2.0).contains(v));
        start.scale = Some(scale.ok_or_else(|| wrong("scale", "a number from 0.05 to 2", &text))?);
    }
    if let Some(text) = given.get("size") {
        start.size =
            Some(super::adapter::size(&text).ok_or_else(|| wrong("size", "an extent such as 640x360", &text))?);
    }
    let number = |name: &str, read: fn(&str) -> Result<f32, String>| {
        let of = |words: String| JsValue::from_str(&format!("the address' parameter {name}: {words}"));
        given.get(name).map(|text| read(&text)).transpose().map_err(of)
    };
    let degrees = number("environment-rotation", super::adapter::degrees)?;
    let strength = number("environment-strength", super::adapter::strength)?;
    let file = given.get("environment").filter(|s| !s.is_empty());
    start.sky = Sky::of(file, degrees, strength, "the address' parameter ")?;
    if let Some(text) = given.get("panel") {
        start.shows_panel = match text.as_str() {
            "on" => true,
            "off" => false,
            _ => return Err(wrong("panel", "on or off", &text)),
        };
    }
    Ok(start)
}

/// Makes the page's address that of a view; returns it.
pub(super) fn address(scene: &str, sky: Option<&Sky>, view: &str) -> String {
    let changed = || -> Result<String, JsValue> {
        let window = web_sys::window().ok_or("there is no window")?;
        let url = Url::new(&window.location().href()?)?;
        url.search_params().set("scene", scene);
        url.search_params().set("view", view);
        // A file that was dropped has no address.
        let sky = sky.filter(|sky| matches!(sky.source, Source::Named(_)));
        for (name, value) in [
            ("environment", sky.map(|sky| sky.source.name())),
            ("environment-rotation", sky.map(|sky| sky.turn.degrees.to_string())),
            ("environment-strength", sky.map(|sky| sky.turn.strength.to_string())),
        ] {
            match value {
                Some(value) => url.search_params().set(name, &value),
                None => url.search_params().delete(name),
            }
        }
        window.history()?.replace_state_with_url(&JsValue::NULL, "", Some(&url.href()))?;
        Ok(url.href())
    };
    // A page within another may not change its address: the view is said all the same.
    changed().unwrap_or_else(|_| format!("view={view}"))
}

/// The browser's own memory for this page's site.
fn memory() -> Result<web_sys::Storage, String> {
    let storage = web_sys::window().and_then(|window| window.local_storage().ok().flatten());
    storage.ok_or_else(|| "this browser keeps nothing for this page: saved views last until it is closed".to_owned())
}

/// The text of saved views; empty: there is none yet, or the browser keeps nothing. `_`: windows have a folder.
pub(super) fn read_views(_: &Path) -> Result<String, String> {
    Ok(memory().ok().and_then(|memory| memory.get_item(views::NAME).ok().flatten()).unwrap_or_default())
}

pub(super) fn write_views(_: &Path, text: &str) -> Result<(), String> {
    let full = |_| "the browser's memory for this page is full: saved views last until it is closed".to_owned();
    memory()?.set_item(views::NAME, text).map_err(full)
}

/// How long the browser is given between steps to draw and to hear its user, milliseconds.
const PAUSE: i32 = 20;

/// Lets the browser draw.
async fn breathe() {
    let wait = js_sys::Promise::new(&mut |resolve, _| {
        if let Some(window) = web_sys::window() {
            // What cannot be set resolves never; a window always sets it.
            let _ = window.set_timeout_with_callback_and_timeout_and_arguments_0(&resolve, PAUSE);
        }
    });
    let _ = JsFuture::from(wait).await;
}

/// Reads a scene, makes it ready and uploads it, in steps.
pub(super) async fn opened(source: Source, sky: Option<Sky>, place: Place) -> Opened {
    breathe().await;
    let around = match sky {
        Some(Sky { source, turn }) => {
            let bytes = bytes(&source).await?;
            breathe().await;
            Some(Surroundings::from_bytes(&source.name(), &bytes, turn)?)
        }
        None => None,
    };
    breathe().await;
    let (scene, notes) = match source {
        // Names of built-in scenes have neither; misspelt ones are answered with the right ones.
        Source::Named(name) if !name.contains(['.', '/', ':']) => crate::open(&name, around)?,
        source => {
            let bytes = bytes(&source).await?;
            breathe().await;
            let file = parsed(&source.name(), bytes)?;
            breathe().await;
            loaded(file, around)?
        }
    };
    breathe().await;
    Ok((place.stage(scene)?, notes))
}

/// What a file holds.
async fn bytes(source: &Source) -> Result<Vec<u8>, LiveError> {
    match source {
        Source::Named(address) => fetched(address).await.map_err(LiveError::Read),
        Source::Dropped(file) => {
            file.bytes_async().await.map_err(|error| LiveError::Read(format!("{}: {error}", source.name())))
        }
    }
}

/// A file's bytes; or why there are none, in words.
async fn fetched(address: &str) -> Result<Vec<u8>, String> {
    let refused = |error: &JsValue| {
        let why = error.dyn_ref::<js_sys::Error>().map_or_else(String::new, |e| String::from(e.message()));
        format!("{address}: cannot be fetched ({why}); a file of another site needs that site's permission (CORS)")
    };
    let window = web_sys::window().ok_or("there is no window")?;
    let answer = JsFuture::from(window.fetch_with_str(address)).await.map_err(|e| refused(&e))?;
    let answer: Response = answer.dyn_into().map_err(|e| refused(&e))?;
    if !answer.ok() {
        return Err(format!("{address}: the server says {} {}", answer.status(), answer.status_text()));
    }
    let bytes = JsFuture::from(answer.array_buffer().map_err(|e| refused(&e))?).await.map_err(|e| refused(&e))?;
    Ok(js_sys::Uint8Array::new(&bytes).to_vec())
}

/// Hands a file to the browser, which downloads it.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), LiveError> {
    let name = path.to_string_lossy();
    download(&name, bytes).map_err(|error| LiveError::Write(format!("{name}: the browser refuses it: {error:?}")))
}

/// The same of a frame's planes, as EXR.
pub(super) fn write_planes(path: &Path, frame: &FrameToWrite<'_>) -> Result<(), LiveError> {
    let bytes = frame_bytes(path, frame, Precision::Float).map_err(|error| LiveError::Write(error.to_string()))?;
    write(path, &bytes)
}

fn download(name: &str, bytes: &[u8]) -> Result<(), JsValue> {
    let document = web_sys::window().and_then(|w| w.document()).ok_or("there is no document")?;
    let parts = js_sys::Array::of1(&js_sys::Uint8Array::from(bytes));
    let address = Url::create_object_url_with_blob(&Blob::new_with_u8_array_sequence(&parts)?)?;
    let anchor: HtmlAnchorElement = document.create_element("a")?.dyn_into()?;
    anchor.set_href(&address);
    anchor.set_download(name);
    anchor.click();
    Url::revoke_object_url(&address)
}
