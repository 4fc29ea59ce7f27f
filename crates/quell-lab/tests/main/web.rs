//! quell in a browser: `examples/web` runs the package `quell-denoise` in headless Chromium, whose compiler (Tint) and
//! device (SwiftShader, in software) are others than wgpu's and Mesa's. Its results, with the package's own shaders and with the files of
//! `quell shaders`, are compared with the reference and, where there is an adapter, with [`quell::gpu::Denoiser`].
//!
//! Without Chromium the tests print why they did nothing; with `QUELL_REQUIRE_CHROMIUM=1` they fail.

pub(super) mod server;

use super::browser::Browser;
use base64::Engine;
use quell::gpu::{Contents, Convention, Pass, Storage, wgpu};
use quell::{Preset, Settings, Size};
use quell_host::manifest::{Choice, File, MANIFEST, files};
use quell_host::{Denoiser, Gpu, Wanted};
use quell_lab::trial;
use quell_trace::{Control, RenderOptions, Tracer, builtin};
use serde_json::{Value, json};
use server::Server;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

const SIZE: Size = Size::new(96, 54);
const FRAMES: u32 = 4;
const SCENE: &str = "glossy-room";
/// The page, and where it looks for the files.
const PAGE: &str = "examples/web/index.html?preset=paper";
const FOLDER: &str = "examples/web/quell-shaders";
/// Address of the page that takes shaders and settings from the files in place of the package's.
const GIVEN: &str = "examples/web/index.html?program";

/// How far values may lie apart, relative to the larger one plus the plane's mean, and the share of values beyond it: half
/// storage against the reference on curved mirrors, `CURVED` in `crates/quell/tests/suite/gpu/half.rs`.
const RELATIVE: f64 = 5e-3;
const FLIPS: f64 = 2e-2;

/// A browser whose WebGPU runs in software, on any machine alike.
pub(super) fn browser() -> Option<Browser> {
    Browser::start_with(1000, 800, &["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"])
}

/// The files of folders of the repository, by their paths in it; those of folders within are not among them.
pub(super) fn served(folders: &[&str]) -> Vec<(String, Vec<u8>)> {
    served_from(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."), folders)
}

/// The same of folders within another.
pub(super) fn served_from(root: &Path, folders: &[&str]) -> Vec<(String, Vec<u8>)> {
    let in_folder = |folder: &&str| {
        let entries = std::fs::read_dir(root.join(folder)).expect("a folder");
        let paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
        let name = |path: &Path| path.file_name().and_then(|n| n.to_str()).map(|n| format!("{folder}/{n}"));
        let read = |path: &PathBuf| (name(path).expect("a name"), std::fs::read(path).expect("a file"));
        paths.iter().filter(|path| path.is_file()).map(read).collect::<Vec<_>>()
    };
    folders.iter().flat_map(in_folder).collect()
}

/// What the package consists of when a program imports it.
pub(super) const PACKAGE: [&str; 2] = ["packages/quell-denoise/src", "packages/quell-denoise/made"];

fn told<'a>(settings: &'a Settings) -> Choice<'a> {
    let contents = Contents { textures: true, ..Contents::USUAL };
    let convention = Convention::QUELL;
    Choice { settings, size: SIZE, contents, convention, storage: Storage::Half, fuse: true }
}

/// What `quell shaders DIR --frames N` writes.
fn written(choice: &Choice<'_>) -> Vec<File> {
    let mut all = files(choice).expect("files");
    let scene = builtin(SCENE).expect("a scene");
    let give = |file: File| {
        all.push(file);
        Ok::<(), quell_lab::Error>(())
    };
    trial::frames(choice, &scene, FRAMES, &Control::default(), give).expect("frames");
    all
}

/// Runs the page at this address with these files; what it says at the end.
fn run(browser: &Browser, page: &str, files: &[File]) -> Value {
    let in_folder = files.iter().map(|f| (format!("{FOLDER}/{}", f.name), f.bytes.clone()));
    let page_and_package = served(&["examples/web", PACKAGE[0], PACKAGE[1]]);
    let server = Server::start(page_and_package.into_iter().chain(in_folder).collect());
    browser.visit(&server.address(page));
    await_end(browser);
    browser.value("window.state")
}

/// Waits until a page says that it is done. A device in software compiles a stage in half a second, on a busy machine in many.
pub(super) fn await_end(browser: &Browser) {
    let start = Instant::now();
    while browser.value("window.state?.done") != Value::Bool(true) {
        assert!(start.elapsed() < Duration::from_secs(300), "the page does not end: {}", browser.value("window.state"));
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The share of values that lie apart, and the largest difference of the others.
fn apart(a: &[f32], b: &[f32]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let mean = b.iter().map(|v| f64::from(v.abs())).sum::<f64>() / b.len() as f64;
    let differences = a.iter().zip(b).map(|(p, q)| f64::from((p - q).abs()) / (f64::from(p.abs().max(q.abs())) + mean));
    let (near, far): (Vec<f64>, Vec<f64>) = differences.partition(|d| *d <= RELATIVE);
    (far.len() as f64 / b.len() as f64, near.into_iter().fold(0.0, f64::max))
}

/// Red, green and blue of an output of the page.
fn output(browser: &Browser, name: &str) -> Vec<f32> {
    let value = browser.awaited(&format!("window.output('{name}')"));
    assert_eq!(value["format"], "rgba16float", "{value}");
    let text = value["base64"].as_str().expect("base64");
    let bytes = base64::engine::general_purpose::STANDARD.decode(text).expect("base64");
    let plane = quell::gpu::unpack_colours(&bytes, SIZE, wgpu::TextureFormat::Rgba16Float).expect("texels");
    plane.data().iter().flatten().copied().collect()
}

/// The composite of the last frame by wgpu, on whatever adapter there is.
fn native(settings: &Settings) -> Option<(String, Vec<f32>)> {
    let gpu = match Gpu::open(Wanted::Named("")) {
        Ok(gpu) => Arc::new(gpu),
        Err(why) => {
            println!("not compared with wgpu: {why}");
            return None;
        }
    };
    let scene = builtin(SCENE).expect("a scene");
    let options = RenderOptions { jitter: true, direct_samples: trial::DIRECT_SAMPLES, ..RenderOptions::new(SIZE) };
    let mut denoiser = Denoiser::new(Arc::clone(&gpu), SIZE, settings).expect("a denoiser");
    let mut last = Vec::new();
    for n in 0..i64::from(FRAMES) {
        let tracer = Tracer::new(&scene, n, 1).expect("a camera");
        let frame = tracer.render(&options, &Control::default()).expect("a frame").frame;
        let output = denoiser.denoise(&frame.frame(&[])).expect("it runs");
        last = output.composite.data().iter().flatten().copied().collect();
    }
    Some((gpu.adapter().to_string(), last))
}

/// The composite with the preset `quality`: the package's own bits are those of the files.
fn of_quality(browser: &Browser) -> Vec<f32> {
    let settings = Settings::preset(Preset::Quality);
    let files = written(&told(&settings));
    let [from_files, found] = [GIVEN, "examples/web/index.html"].map(|page| {
        let state = run(browser, page, &files);
        assert_eq!(state["failed"], Value::Null, "{state}");
        let last = &state["frames"][FRAMES as usize - 1]["outputs"]["composite"]["most"];
        assert!(last.as_f64().is_some_and(|most| most <= RELATIVE), "quality: {last}");
        output(browser, "composite")
    });
    assert_eq!(from_files, found);
    found
}

#[test]
fn frames_in_a_browser_agree_with_the_reference() {
    let Some(browser) = browser() else { return };
    let settings = Settings::default();
    let files = written(&told(&settings));
    let agreeing = |page| {
        let state = run(&browser, page, &files);
        assert_eq!(state["failed"], Value::Null, "{state}");
        let frames = state["frames"].as_array().expect("frames");
        assert_eq!(frames.len(), FRAMES as usize, "{state}");
        for frame in frames {
            let most = frame["outputs"]["composite"]["most"].as_f64().expect("a difference");
            println!("{}: {frame}", state["adapter"]);
            // What all but a share of `FLIPS` keep.
            assert!(most <= RELATIVE, "{frame}");
        }
        output(&browser, "composite")
    };
    let from_files = agreeing(GIVEN);
    let found = agreeing(PAGE);
    // The package's shaders, settings and tables of taps are those of the files, to the bit.
    assert_eq!(from_files, found);
    assert!(found.iter().all(|v| v.is_finite()) && found.iter().any(|v| *v > 0.1));
    let of_quality = of_quality(&browser);
    assert_ne!(found, of_quality);
    let native = native(&settings);
    if let Some((adapter, expected)) = &native {
        let (share, largest) = apart(&found, expected);
        println!("against {adapter}: {share:.1e} of the values beyond {RELATIVE:.0e}, the others within {largest:.1e}");
        assert!(share <= FLIPS, "{share} of the values beyond {RELATIVE}");
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());
    if let Some(folder) = std::env::var_os("QUELL_PICTURES") {
        browser.screenshot(&Path::new(&folder).join("web.png"));
    }

    // What the comparisons must see: a remembered texture that nobody wrote, taps that stand still.
    for (from, to) in [("\"copies\": 2", "\"copies\": 3"), ("\"period\": 16", "\"period\": 1")] {
        let state = run(&browser, GIVEN, &changed(&files, MANIFEST, from, to));
        assert_eq!(state["failed"], Value::Null, "{state}");
        let last = &state["frames"][FRAMES as usize - 1]["outputs"]["composite"]["most"];
        assert!(last.as_f64().is_some_and(|most| most > RELATIVE), "`{to}` for `{from}` went unseen: {last}");
        if let Some((_, expected)) = &native {
            let (share, _) = apart(&output(&browser, "composite"), expected);
            assert!(share > FLIPS, "`{to}` for `{from}` went unseen: {share}");
        }
    }
    // What the browser's compiler finds is the page's error.
    let composite = &files.iter().find(|f| f.name.ends_with("composite.wgsl")).expect("the last pass").name;
    let wrong = "fn nobody() -> u32 { return nothing; }\n@compute";
    let state = run(&browser, GIVEN, &changed(&files, composite, "@compute", wrong));
    assert!(state["failed"].as_str().is_some_and(|e| e.contains("nothing")), "{state}");
}

fn changed(files: &[File], name: &str, from: &str, to: &str) -> Vec<File> {
    let mut changed = files.to_vec();
    let file = changed.iter_mut().find(|f| f.name == name).expect("a file");
    let text = String::from_utf8(file.bytes.clone()).expect("UTF-8");
    assert!(text.contains(from), "`{from}` is not in {name}");
    file.bytes = text.replacen(from, to, usize::MAX).into_bytes();
    changed
}

/// Every shader of the GPU back end: its name, its text, and whether a pipeline is to be made of it, which takes a device in
/// software half a second: of those that no frame of the other test runs.
fn shaders() -> Vec<Value> {
    let mut all = Vec::new();
    let mut add = |name: String, code: String, is_built| {
        all.push(json!({ "name": name, "code": code, "is_built": is_built }));
    };
    // What `examples/web` does not build, once; the pages of the frames build the others.
    let of_denoiser = |pass: &Pass| pass.per_frame && !Pass::DEBUG.iter().any(|debug| debug.name == pass.name);
    let other =
        |pass: &Pass| !of_denoiser(pass) || pass.name.ends_with("_joint") || pass.name == Pass::COUNT_REPAIRS.name;
    for storage in [Storage::Half, Storage::Float] {
        for pass in Pass::all() {
            for host in [false, true] {
                let is_built = storage == Storage::Half && host && other(&pass);
                add(format!("{}, {storage:?}, {host}", pass.name), pass.source(storage, host), is_built);
            }
        }
    }
    all
}

/// What the browser's compiler says of each.
fn said(browser: &Browser, shaders: &[Value]) -> Vec<String> {
    let list = serde_json::to_vec(shaders).expect("JSON");
    let server = Server::start(vec![
        ("shaders.json".to_owned(), list),
        ("empty.html".to_owned(), b"<!doctype html><title>compile</title>".to_vec()),
    ]);
    browser.visit(&server.address("empty.html"));
    let said = browser.awaited(
        "{
            const adapter = await navigator.gpu.requestAdapter();
            const device = await adapter.requestDevice();
            const all = await (await fetch('shaders.json')).json();
            const each = all.map(async ({ name, code, is_built }) => {
                device.pushErrorScope('validation');
                const module = device.createShaderModule({ label: name, code });
                const caught = device.popErrorScope();
                const { messages } = await module.getCompilationInfo();
                const said = messages.map((m) => `${name}:${m.lineNum}: ${m.type}: ${m.message}`);
                const error = await caught;
                if (error && said.length == 0) said.push(`${name}: ${error.message}`);
                if (said.length > 0) return said;
                const points = [...code.matchAll(/@compute[^{]*fn (\\w+)/g)].map((found) => found[1]);
                if (points.length == 0) said.push(`${name}: no entry point`);
                for (const entryPoint of is_built ? points : []) {
                    const compute = { module, entryPoint };
                    await device.createComputePipelineAsync({ layout: 'auto', compute })
                        .catch((e) => said.push(`${name}: ${e.message}`));
                }
                return said;
            });
            return (await Promise.all(each)).flat();
        }",
    );
    let said = said.as_array().unwrap_or_else(|| panic!("{said}"));
    said.iter().map(|s| s.as_str().expect("text").to_owned()).collect()
}

#[test]
fn every_shader_passes_a_browsers_compiler() {
    let Some(browser) = browser() else { return };
    let shaders = shaders();
    assert_eq!(said(&browser, &shaders), Vec::<String>::new());
    println!("{} shaders, no message", shaders.len());

    // What wgpu's compiler lets through: a barrier that not every invocation reaches; code behind a return, a warning.
    let refused = [
        (
            "barrier",
            "@compute @workgroup_size(8, 8) fn f(@builtin(local_invocation_index) i: u32) { if i > 3u { workgroupBarrier(); } }",
        ),
        ("unreachable", "fn g() -> u32 { return 1u; return 2u; } @compute @workgroup_size(8, 8) fn f() { _ = g(); }"),
    ];
    for (name, code) in refused {
        let said = said(&browser, &[json!({ "name": name, "code": code })]);
        println!("{said:?}");
        assert!(!said.is_empty(), "{name} went unseen");
    }
}
