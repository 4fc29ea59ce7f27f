//! The program on a desktop: options, adapter, files.

use super::adapter::{device_descriptor, size};
use super::app::{App, Lost, Start, Trouble};
use super::drive::Script;
use super::opening::Sky;
use crate::stage::{is_environment, is_file};
use eframe::egui;
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use quell::Size;
use quell::gpu::wgpu;
use quell_trace::environment::file::EnvironmentFileError;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

const USAGE: &str = "\
quell-live glossy-room                 a built-in scene, walked through
quell-live room.glb                    a glTF file; others are dropped on the window

Usage: quell-live [OPTIONS] [SCENE]

SCENE           a built-in scene (quell scenes) or a .gltf or .glb file [default: glossy-room]
--device NAME   the adapter whose name holds this; one in software as well [default: the best]
--scale SHARE   pixels of the picture for each of the window's, 0.05 to 2 [default: 1; 0.25 in software]
--size WxH      the picture's own extent, whatever the window's is
--window WxH    the window's extent in points [default: 1280x720]
--environment FILE           latitude-longitude picture (.hdr, .exr) around the scene, in place of its own environment
--environment-rotation DEG   turns it about the vertical, clockwise seen from above
--environment-strength X     multiplies it
--view VIEW     where the camera stands: EX,EY,EZ,TX,TY,TZ[,TIME], as the control \"view as text\" says it
--out DIR       where pictures and planes are saved [default: .]
--script FILE   drives the window, for tests (crates/quell-live/src/window/drive.rs)
--help

Mouse: drag turns, right button moves across, wheel nears. W A S D Q E fly. Space pauses, Tab hides the panel, P saves a PNG.
";

/// What the command line asks for.
#[derive(Clone, Debug)]
struct Options {
    start: Start,
    device: Option<String>,
    window: Size,
}

enum Asked {
    Help,
    Run(Box<Options>),
}

fn parsed(arguments: impl Iterator<Item = OsString>) -> Result<Asked, String> {
    let mut options = Options {
        start: Start {
            source: "glossy-room".to_owned(),
            scale: None,
            usual_scale: 1.0,
            size: None,
            folder: PathBuf::from("."),
            view: None,
            sky: None,
            shows_panel: true,
            choice: None,
            script: None,
            lost: Lost::default(),
        },
        device: None,
        window: Size::new(1280, 720),
    };
    let mut is_named = false;
    let (mut environment, mut degrees, mut strength) = (None, None, None);
    let mut arguments = arguments.map(|a| a.to_string_lossy().into_owned());
    while let Some(argument) = arguments.next() {
        let (name, inline) = match argument.split_once('=') {
            Some((name, value)) if name.starts_with("--") => (name.to_owned(), Some(value.to_owned())),
            _ => (argument.clone(), None),
        };
        if matches!(name.as_str(), "--help" | "-h") {
            return Ok(Asked::Help);
        }
        if !name.starts_with('-') {
            if is_named {
                return Err(format!("one scene at a time: `{argument}` is the second"));
            }
            is_named = true;
            options.start.source = argument;
            continue;
        }
        let known = [
            "--device",
            "--environment",
            "--environment-rotation",
            "--environment-strength",
            "--scale",
            "--size",
            "--window",
            "--view",
            "--out",
            "--script",
        ];
        if !known.contains(&name.as_str()) {
            return Err(format!("unknown option {name}; --help lists them"));
        }
        let value = inline.or_else(|| arguments.next()).ok_or_else(|| format!("{name} needs a value"))?;
        let wrong = |wanted: &str| format!("{name} takes {wanted}, not `{value}`");
        let of = |words: String| format!("{name}: {words}");
        match name.as_str() {
            "--device" => options.device = Some(value),
            "--environment" => environment = Some(value),
            "--environment-rotation" => degrees = Some(super::adapter::degrees(&value).map_err(of)?),
            "--environment-strength" => strength = Some(super::adapter::strength(&value).map_err(of)?),
            "--scale" => {
                let scale = value.parse().ok().filter(|v: &f32| (0.05..=2.0).contains(v));
                options.start.scale = Some(scale.ok_or_else(|| wrong("a number from 0.05 to 2"))?);
            }
            "--size" => options.start.size = Some(size(&value).ok_or_else(|| wrong("an extent such as 640x360"))?),
            "--window" => options.window = size(&value).ok_or_else(|| wrong("an extent such as 1280x720"))?,
            "--view" => options.start.view = Some(value.parse().map_err(wrong)?),
            "--out" => options.start.folder = PathBuf::from(value),
            _ => {
                let text = std::fs::read_to_string(&value).map_err(|error| format!("{value}: {error}"))?;
                options.start.script = Some(Script::new(&text));
            }
        }
    }
    // A name that cannot be opened is said before a window is.
    options.start.sky = Sky::of(environment, degrees, strength, "--")?;
    if let Some(sky) = &options.start.sky {
        let path = PathBuf::from(sky.source.name());
        if !is_environment(&sky.source.name()) {
            return Err(EnvironmentFileError::Format { path }.to_string());
        }
        if let Err(source) = std::fs::metadata(&path) {
            return Err(EnvironmentFileError::Io { path, source }.to_string());
        }
    }
    {
        let name = &options.start.source;
        let unknown = if is_file(name) {
            std::fs::metadata(name).err().map(|error| format!("{name}: {error}"))
        } else {
            quell_trace::builtin(name).err().map(|error| error.to_string())
        };
        if let Some(error) = unknown {
            return Err(error);
        }
    }
    Ok(Asked::Run(Box::new(options)))
}

/// The smaller, the sooner it is taken unnamed.
const fn rank(kind: wgpu::DeviceType) -> u8 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// The adapter that is meant, among those that can show on the window.
fn chosen(
    adapters: &[wgpu::Adapter],
    surface: Option<&wgpu::Surface<'_>>,
    wanted: Option<&str>,
) -> Result<wgpu::Adapter, String> {
    let names = || match adapters {
        [] => {
            "wgpu finds no adapter: a driver for Vulkan, Metal or DX12 must be installed (Debian: mesa-vulkan-drivers)"
                .to_owned()
        }
        all => format!("there are {}", all.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ")),
    };
    let shows = |a: &&wgpu::Adapter| surface.is_none_or(|surface| a.is_surface_supported(surface));
    let named = |a: &&wgpu::Adapter| {
        wanted.is_none_or(|wanted| a.get_info().name.to_lowercase().contains(&wanted.to_lowercase()))
    };
    let found = adapters.iter().filter(named).filter(shows).min_by_key(|a| rank(a.get_info().device_type));
    found.cloned().ok_or_else(|| match wanted {
        Some(wanted) => format!("no adapter that can show a window is called `{wanted}`; {}", names()),
        None => format!("no adapter can show a window; {}", names()),
    })
}

fn setup(wanted: Option<String>) -> WgpuSetup {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
    setup.native_adapter_selector =
        Some(Arc::new(move |adapters, surface| chosen(adapters, surface, wanted.as_deref())));
    setup.device_descriptor = Arc::new(device_descriptor);
    WgpuSetup::CreateNew(setup)
}

/// Windows that are opened anew one after the other, each since the one before lost its device soon.
const MOST_LOSSES: u32 = 2;
/// A window that has stood for so long was no failure.
const STOOD: Duration = Duration::from_secs(60);

/// Runs the program; `arguments` without its own name. Returns its exit code: 0, 1 for what failed, 2 for a wrong command line.
pub fn run(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    let mut options = match parsed(arguments) {
        Ok(Asked::Help) => {
            print!("{USAGE}");
            return ExitCode::SUCCESS;
        }
        Ok(Asked::Run(options)) => options,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::from(2);
        }
    };
    let mut losses = 0;
    loop {
        let begun = Instant::now();
        options.start.lost = Lost::default();
        if let Err(error) = window(&options) {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
        if super::drive::has_failed() {
            return ExitCode::FAILURE;
        }
        if !options.start.lost.is_lost.load(Ordering::Acquire) {
            return ExitCode::SUCCESS;
        }
        losses = if begun.elapsed() < STOOD { losses + 1 } else { 1 };
        if losses > MOST_LOSSES {
            eprintln!("error: the device was lost again and again");
            return ExitCode::FAILURE;
        }
        eprintln!("opening the window anew");
        let kept = options.start.lost.kept.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(kept) = kept {
            options.start = *kept;
        }
    }
}

fn window(options: &Options) -> Result<(), String> {
    let size = [options.window.width as f32, options.window.height as f32];
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("quell live")
            .with_inner_size(size)
            .with_drag_and_drop(true),
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: WgpuConfiguration { wgpu_setup: setup(options.device.clone()), ..WgpuConfiguration::default() },
        persist_window: false,
        ..Default::default()
    };
    let start = options.start.clone();
    let made = eframe::run_native(
        "quell live",
        native,
        Box::new(move |creation| {
            let state = creation.wgpu_render_state.as_ref().ok_or("the window has no wgpu device")?;
            let trouble: Trouble = Arc::new(Mutex::new(None));
            let (ctx, lost) = (creation.egui_ctx.clone(), start.lost.clone());
            state.device.set_device_lost_callback(move |reason, words| {
                eprintln!("the device was lost: {}", if words.is_empty() { format!("{reason:?}") } else { words });
                lost.is_lost.store(true, Ordering::Release);
                // The next frame closes the window.
                ctx.request_repaint();
            });
            Ok(Box::new(App::new(state, start, trouble)?))
        }),
    );
    made.map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(line: &str) -> Result<Asked, String> {
        parsed(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn wrong_command_lines_are_answered_in_words() {
        for (line, words) in [
            ("cornel-box", "did you mean cornell-box"),
            ("/nonexistent/a.glb", "/nonexistent/a.glb"),
            ("cornell-box furnace", "one scene at a time"),
            ("--scale 9", "0.05 to 2"),
            ("--size 0x4", "640x360"),
            ("--size=12", "640x360"),
            ("--device", "needs a value"),
            ("--view 1,2", "three numbers"),
            ("--frob", "unknown option"),
            ("--script /nonexistent", "/nonexistent"),
            ("--environment /nonexistent/sky.hdr", "cannot read /nonexistent/sky.hdr"),
            ("--environment sky.png", "sky.png is no environment map"),
            ("--environment-rotation 20", "--environment-rotation needs --environment"),
            ("--environment a.hdr --environment-rotation inf", "is no angle in degrees"),
            ("--environment a.hdr --environment-strength 0", "is no positive number"),
        ] {
            let Err(error) = asked(line) else { panic!("{line} was taken") };
            assert!(error.contains(words), "{line}: {error}");
        }
        let Ok(Asked::Run(options)) = asked("cornell-box --scale=0.5 --window 320x180") else { panic!("refused") };
        assert_eq!((options.start.scale, options.window), (Some(0.5), Size::new(320, 180)));
        assert!(matches!(asked("--help"), Ok(Asked::Help)));
    }
}
