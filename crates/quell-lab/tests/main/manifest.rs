//! Frames from the files of `quell shaders` alone, by a runner that knows JSON and wgpu and nothing of quell, against
//! [`quell::gpu::Denoiser`] on the same device: the same bits.
//!
//! Without an adapter the test prints why it did nothing; with `QUELL_REQUIRE_GPU=1` it fails.

mod camera;
mod runner;

use quell::gpu::{Contents, PackedFrame, PackedSignal, Storage, wgpu};
use quell::{FrameBuf, Settings, Size};
use quell_lab::gpu::manifest::{Choice, File, MANIFEST, files};
use quell_lab::gpu::{Denoiser, Gpu, Wanted};
use quell_trace::{Control, RenderOptions, Tracer, builtin};
use runner::{Input, Runner};
use std::collections::HashMap;
use std::sync::Arc;

const SIZE: Size = Size::new(70, 41);

fn gpu() -> Option<Arc<Gpu>> {
    match Gpu::open(Wanted::Named("")) {
        Ok(gpu) => Some(Arc::new(gpu)),
        Err(why) => {
            let required = std::env::var_os("QUELL_REQUIRE_GPU").is_some_and(|v| v == "1");
            assert!(!required, "QUELL_REQUIRE_GPU is set, but {why}");
            println!("SKIPPED: {why}");
            None
        }
    }
}

/// The first frames of a scene with a moving camera.
fn traced(count: i64) -> Vec<FrameBuf> {
    let scene = builtin("glossy-room").expect("a scene");
    let options = RenderOptions { jitter: true, direct_samples: 1, ..RenderOptions::new(SIZE) };
    let render = |n| Tracer::new(&scene, n, 1).expect("a camera").render(&options, &Control::default());
    (0..count).map(|n| render(n).expect("a frame").frame).collect()
}

fn in_files(settings: &Settings, storage: Storage, fuse: bool) -> Vec<File> {
    let contents = Contents::USUAL;
    files(&Choice { settings, size: SIZE, contents, storage, fuse }).expect("files")
}

/// What the manifest calls the textures of a frame, and what they hold.
fn inputs(frame: &FrameBuf, storage: Storage) -> HashMap<&'static str, Input> {
    let packed = PackedFrame::new(&frame.frame(&[]), storage).expect("a frame");
    let colour = |bytes: &[u8]| Input { format: wgpu::TextureFormat::Rgba32Float, bytes: bytes.to_vec() };
    let of = |signal: &Option<PackedSignal>| {
        let signal = signal.as_ref().expect("a signal");
        [colour(&signal.light), colour(signal.weight.as_ref().expect("a weight"))]
    };
    let ([matte, matte_weight], [glossy, glossy_weight]) = (of(&packed.matte), of(&packed.glossy));
    HashMap::from([
        ("matte input", matte),
        ("glossy input", glossy),
        ("direct input", colour(&packed.direct)),
        ("matte weight", matte_weight),
        ("glossy weight", glossy_weight),
        ("guides geometry", Input { format: runner::OWN, bytes: packed.guides.geometry }),
        ("guides surface", Input { format: runner::OWN, bytes: packed.guides.surface }),
        ("guides moving", Input { format: runner::OWN, bytes: packed.guides.moving }),
    ])
}

/// What the denoiser writes at each frame, by the manifest's names of outputs.
fn by_the_denoiser(gpu: &Arc<Gpu>, settings: &Settings, frames: &[FrameBuf]) -> Vec<HashMap<&'static str, Vec<u8>>> {
    let mut denoiser = Denoiser::new(Arc::clone(gpu), SIZE, settings).expect("a denoiser");
    let mut frame = |frame: &FrameBuf| {
        denoiser.upload(&frame.frame(&[])).expect("uploaded");
        let output = denoiser.run().expect("ran").output;
        let named = [
            ("composite", output.composite),
            ("direct", output.direct),
            ("matte", output.matte),
            ("glossy", output.glossy),
            ("confidence", output.confidence),
            ("history_length", output.history_length),
        ];
        let read = |view: wgpu::TextureView| gpu.read_textures(&[view.texture()], "a test").expect("read").remove(0);
        named.map(|(name, view)| (name, read(view.expect("an output")))).into_iter().collect()
    };
    frames.iter().map(&mut frame).collect()
}

/// The same from the files.
fn by_the_manifest(gpu: &Gpu, files: &[File], frames: &[FrameBuf]) -> Vec<HashMap<String, Vec<u8>>> {
    let storage = Storage::default();
    let files: HashMap<&str, &[u8]> = files.iter().map(|f| (f.name.as_str(), f.bytes.as_slice())).collect();
    let extent = [SIZE.width as u32, SIZE.height as u32];
    let mut runner = Runner::new(gpu.device(), gpu.queue(), &files, MANIFEST, extent);
    let mut run = |k: usize| {
        let (frame, before) = (&frames[k], k.checked_sub(1).map(|k| &frames[k]));
        let told = camera::told(frame, before, extent);
        runner.frame(frame.index, &told, &inputs(frame, storage));
        runner.outputs()
    };
    (0..frames.len()).map(&mut run).collect()
}

#[test]
fn frames_from_the_manifest_alone_are_the_denoisers_bits() {
    let Some(gpu) = gpu() else { return };
    let (settings, frames) = (Settings::default(), traced(3));
    let files = in_files(&settings, Storage::default(), true);
    let expected = by_the_denoiser(&gpu, &settings, &frames);
    let found = by_the_manifest(&gpu, &files, &frames);
    for (index, (expected, found)) in expected.iter().zip(&found).enumerate() {
        assert_eq!(expected.len(), found.len());
        for (name, bytes) in expected {
            let off = bytes.iter().zip(&found[*name]).filter(|(a, b)| a != b).count();
            assert!(bytes == &found[*name], "frame {index}, {name}: {off} of {} bytes differ", bytes.len());
            assert!(bytes.iter().any(|b| *b != 0), "frame {index}, {name}: nothing was written");
        }
    }
    assert_ne!(expected[1]["composite"], expected[2]["composite"]);

    gpu.check("the tests").expect("no error of validation");

    // What the comparison must see: history out of a texture that nobody wrote, a table of taps that stands still, another
    // value of a setting.
    let changed = |from: &str, to: &str| {
        let change = |file: &File| {
            let bytes = match file.name.as_str() {
                MANIFEST => String::from_utf8(file.bytes.clone()).expect("UTF-8").replace(from, to).into_bytes(),
                _ => file.bytes.clone(),
            };
            File { name: file.name.clone(), bytes }
        };
        let changed: Vec<File> = files.iter().map(change).collect();
        assert_ne!(changed, files, "`{from}` is not in the manifest");
        by_the_manifest(&gpu, &changed, &frames)
    };
    for (from, to) in
        [("\"copies\": 2", "\"copies\": 3"), ("\"period\": 16", "\"period\": 1"), ("\"plain\": 0", "\"plain\": 1")]
    {
        let other = changed(from, to);
        assert!(other[2]["composite"] != found[2]["composite"], "`{to}` for `{from}` went unseen");
    }
}

#[test]
fn what_the_manifest_says_is_there() {
    for (storage, fuse) in [(Storage::Half, true), (Storage::Float, false)] {
        let files = in_files(&Settings::default(), storage, fuse);
        let manifest = files.last().expect("the manifest");
        assert_eq!(manifest.name, MANIFEST);
        let value: serde_json::Value = serde_json::from_slice(&manifest.bytes).expect("JSON");
        let names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
        let resources = value["resources"].as_array().expect("a list");
        let known = |name: &serde_json::Value| resources.iter().any(|r| r["name"] == *name);
        let dispatches = value["dispatches"].as_array().expect("a list");
        assert_eq!(dispatches.len(), if fuse { 8 } else { 10 });
        for dispatch in dispatches {
            assert!(names.contains(&dispatch["file"].as_str().expect("a file")), "{dispatch}");
            for binding in dispatch["bindings"].as_array().expect("a list") {
                assert!(binding["kind"] == "uniform" || known(&binding["resource"]), "{binding}");
            }
        }
        for output in value["outputs"].as_object().expect("names").values() {
            assert!(known(output), "{output}");
        }
        for taps in resources.iter().filter(|r| r["kind"] == "buffer") {
            let table = files.iter().find(|f| taps["file"] == *f.name).expect("the table");
            let (bytes, period) = (taps["bytes"].as_u64().expect("bytes"), taps["period"].as_u64().expect("frames"));
            assert_eq!(table.bytes.len() as u64, bytes * period);
        }
        let files_named = 1 + dispatches.len() + resources.iter().filter(|r| r["kind"] == "buffer").count();
        assert_eq!(files.len(), files_named, "{names:?}");
    }
}
