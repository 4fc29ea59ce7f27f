//! Frames from the files of `quell shaders` alone, by a runner that knows JSON and wgpu and nothing of quell, against
//! [`quell::gpu::Denoiser`] on the same device: the same bits.
//!
//! Without an adapter the test prints why it did nothing; with `QUELL_REQUIRE_GPU=1` it fails.

mod camera;
mod runner;
mod textures;

use crate::gpu;
use quell::gpu::{Contents, PackedFrame, PackedSignal, Storage, wgpu};
use quell::{FrameBuf, Settings, Size};
use quell_host::manifest::{Choice, File, MANIFEST, files};
use quell_host::{Denoiser, Gpu};
use quell_trace::{Control, RenderOptions, Tracer, builtin};
use runner::{Input, Runner};
use serde_json::json;
use std::collections::HashMap;
use std::sync::Arc;

const SIZE: Size = Size::new(70, 41);

/// The first frames of a scene with a moving camera.
fn traced(count: i64) -> Vec<FrameBuf> {
    let scene = builtin("glossy-room").expect("a scene");
    let options = RenderOptions { jitter: true, direct_samples: 1, ..RenderOptions::new(SIZE) };
    let render = |n| Tracer::new(&scene, n, 1).expect("a camera").render(&options, &Control::default());
    (0..count).map(|n| render(n).expect("a frame").frame).collect()
}

fn in_files(settings: &Settings, contents: Contents, storage: Storage, fuse: bool) -> Vec<File> {
    let convention = textures::CONVENTION;
    files(&Choice { settings, size: SIZE, contents, convention, storage, fuse }).expect("files")
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

/// What textures hold, by the manifest's names of outputs.
fn outputs(gpu: &Gpu, output: quell::gpu::Output) -> HashMap<&'static str, Vec<u8>> {
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
}

/// What the denoiser writes at each frame.
fn by_the_denoiser(gpu: &Arc<Gpu>, settings: &Settings, frames: &[FrameBuf]) -> Vec<HashMap<&'static str, Vec<u8>>> {
    let mut denoiser = Denoiser::new(Arc::clone(gpu), SIZE, settings).expect("a denoiser");
    let mut frame = |frame: &FrameBuf| {
        denoiser.upload(&frame.frame(&[])).expect("uploaded");
        let output = denoiser.run().expect("ran").outputs.remove(0);
        outputs(gpu, output)
    };
    frames.iter().map(&mut frame).collect()
}

/// The same from the files.
fn by_the_manifest(gpu: &Gpu, files: &[File], frames: &[FrameBuf]) -> Vec<HashMap<String, Vec<u8>>> {
    by_the_manifest_with(gpu, files, frames, &|frame| inputs(frame, Storage::default())).0
}

/// The same from these textures of the host's; and what was repaired of the last frame.
fn by_the_manifest_with(
    gpu: &Gpu,
    files: &[File],
    frames: &[FrameBuf],
    inputs: &dyn Fn(&FrameBuf) -> HashMap<&'static str, Input>,
) -> (Vec<HashMap<String, Vec<u8>>>, Vec<u8>) {
    let counts = files.iter().any(|f| f.name == "01_prepare.wgsl");
    let files: HashMap<&str, &[u8]> = files.iter().map(|f| (f.name.as_str(), f.bytes.as_slice())).collect();
    let extent = [SIZE.width as u32, SIZE.height as u32];
    let mut runner = Runner::new(gpu.device(), gpu.queue(), &files, MANIFEST, extent);
    let mut run = |k: usize| {
        let (frame, before) = (&frames[k], k.checked_sub(1).map(|k| &frames[k]));
        let uniforms =
            json!({ "frame": camera::uniforms(frame, before, extent), "prepare": camera::prepare(frame, extent) });
        runner.frame(frame.index, &uniforms, &inputs(frame));
        runner.outputs()
    };
    let outputs = (0..frames.len()).map(&mut run).collect();
    (outputs, if counts { runner.counts("repairs") } else { Vec::new() })
}

/// The same bits, and every plane was written.
fn assert_same(expected: &[HashMap<&'static str, Vec<u8>>], found: &[HashMap<String, Vec<u8>>]) {
    for (index, (expected, found)) in expected.iter().zip(found).enumerate() {
        assert_eq!(expected.len(), found.len());
        for (name, bytes) in expected {
            let off = bytes.iter().zip(&found[*name]).filter(|(a, b)| a != b).count();
            assert!(bytes == &found[*name], "frame {index}, {name}: {off} of {} bytes differ", bytes.len());
            assert!(bytes.iter().any(|b| *b != 0), "frame {index}, {name}: nothing was written");
        }
    }
}

/// The files with another text in the manifest.
fn changed(files: &[File], from: &str, to: &str) -> Vec<File> {
    let change = |file: &File| {
        let bytes = match file.name.as_str() {
            MANIFEST => String::from_utf8(file.bytes.clone()).expect("UTF-8").replace(from, to).into_bytes(),
            _ => file.bytes.clone(),
        };
        File { name: file.name.clone(), bytes }
    };
    let changed: Vec<File> = files.iter().map(change).collect();
    assert_ne!(changed, files, "`{from}` is not in the manifest");
    changed
}

#[test]
fn frames_from_the_manifest_alone_are_the_denoisers_bits() {
    let Some(gpu) = gpu() else { return };
    let (settings, frames) = (Settings::default(), traced(3));
    let files = in_files(&settings, Contents::USUAL, Storage::default(), true);
    let expected = by_the_denoiser(&gpu, &settings, &frames);
    let found = by_the_manifest(&gpu, &files, &frames);
    assert_same(&expected, &found);
    assert_ne!(expected[1]["composite"], expected[2]["composite"]);

    gpu.check("the tests").expect("no error of validation");

    // What the comparison must see: history out of a texture that nobody wrote, a table of taps that stands still, another
    // value of a setting.
    for (from, to) in
        [("\"copies\": 2", "\"copies\": 3"), ("\"period\": 16", "\"period\": 1"), ("\"plain\": 0", "\"plain\": 1")]
    {
        let other = by_the_manifest(&gpu, &changed(&files, from, to), &frames);
        assert!(other[2]["composite"] != found[2]["composite"], "`{to}` for `{from}` went unseen");
    }
}

#[test]
fn frames_that_begin_with_the_hosts_guides_are_the_denoisers_bits() {
    let Some(gpu) = gpu() else { return };
    let settings = Settings::default();
    let frames: Vec<FrameBuf> = traced(3).into_iter().map(textures::as_renderers_have_it).collect();
    let contents = Contents { textures: true, counts: true, ..Contents::USUAL };
    let files = in_files(&settings, contents, Storage::default(), true);
    let (expected, repairs) = textures::by_the_denoiser(&gpu, &settings, &frames);
    let by_the_files = |files: &[File]| by_the_manifest_with(&gpu, files, &frames, &textures::inputs);
    let (found, counted) = by_the_files(&files);
    gpu.check("the tests").expect("no error of validation");
    assert_same(&expected, &found);
    assert_eq!(counted, repairs);
    assert!(counted.iter().any(|b| *b != 0), "nothing was repaired");
    // What the comparison must see: the normals' space, a plane that the host is not said to have, vectors' unit.
    for (from, to) in [
        ("\"normal_in_view\": 1", "\"normal_in_view\": 0"),
        ("\"there\": 16", "\"there\": 0"),
        // Half the width, y down.
        ("-35.0", "35.0"),
    ] {
        let (other, _) = by_the_files(&changed(&files, from, to));
        assert!(other[2]["composite"] != found[2]["composite"], "`{to}` for `{from}` went unseen");
    }
}

#[test]
fn what_the_manifest_says_is_there() {
    for (storage, fuse, textures) in [(Storage::Half, true, false), (Storage::Float, false, true)] {
        let contents = Contents { textures, counts: textures, ..Contents::USUAL };
        let files = in_files(&Settings::default(), contents, storage, fuse);
        let manifest = files.last().expect("the manifest");
        assert_eq!(manifest.name, MANIFEST);
        let value: serde_json::Value = serde_json::from_slice(&manifest.bytes).expect("JSON");
        let names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
        let resources = value["resources"].as_array().expect("a list");
        let known = |name: &serde_json::Value| resources.iter().any(|r| r["name"] == *name);
        let dispatches = value["dispatches"].as_array().expect("a list");
        assert_eq!(dispatches.len(), if fuse { 8 } else { 12 });
        let debug = &value["debug"];
        assert_eq!((&debug["views"]["depth"], &debug["views"]["weight_sum"]), (&1.into(), &16.into()));
        for dispatch in dispatches.iter().chain([debug]) {
            assert!(names.contains(&dispatch["file"].as_str().expect("a file")), "{dispatch}");
            for binding in dispatch["bindings"].as_array().expect("a list") {
                // The debug views' picture and what they show besides the guides are the host's to choose.
                let is_chosen = binding["resource"].is_null() && dispatch == debug;
                assert!(binding["kind"] == "uniform" || is_chosen || known(&binding["resource"]), "{binding}");
            }
        }
        for guide in resources.iter().filter(|r| r["optional"] == true) {
            assert!(known(&guide["if_absent"]) && guide["there"].as_u64() > Some(0), "{guide}");
        }
        // Every member of a uniform has a value, or comes with each frame.
        for uniform in value["uniforms"].as_array().expect("a list").iter().filter(|u| u["name"] != "frame") {
            let members = value["structs"][uniform["struct"].as_str().expect("a struct")]["members"].as_array();
            for member in members.expect("members") {
                let per_frame = uniform["per_frame"].as_array().is_some_and(|names| names.contains(&member["name"]));
                let has_value = !uniform["values"][member["name"].as_str().expect("a name")].is_null();
                assert!(per_frame != has_value, "{member}");
            }
        }
        for output in value["outputs"].as_object().expect("names").values() {
            assert!(known(output), "{output}");
        }
        for taps in resources.iter().filter(|r| r["role"] == "taps") {
            let table = files.iter().find(|f| taps["file"] == *f.name).expect("the table");
            let (bytes, period) = (taps["bytes"].as_u64().expect("bytes"), taps["period"].as_u64().expect("frames"));
            assert_eq!(table.bytes.len() as u64, bytes * period);
        }
        // The manifest and the debug views' shader.
        let files_named = 2 + dispatches.len() + resources.iter().filter(|r| r["role"] == "taps").count();
        assert_eq!(files.len(), files_named, "{names:?}");
    }
}
