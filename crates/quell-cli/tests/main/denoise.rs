//! `quell denoise` as a user meets it, on sequences that `quell render` made.

use super::{Folder, err, out, quell, run};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Frames 1 to `count` in `frames/noisy`.
fn rendered(folder: &Folder, size: &str, count: u32) -> PathBuf {
    let frames = format!("1-{count}");
    let arguments =
        ["render", "cornell-box", "--size", size, "--direct-samples", "2", "--frames", &frames, "-o", "frames"];
    let output = run(&folder.0, &[&arguments[..], &["--no-denoise", "-q"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    folder.0.join("frames/noisy")
}

fn cut_short(path: &Path) {
    let bytes = fs::read(path).expect("the frame");
    fs::write(path, &bytes[..bytes.len() / 2]).expect("written");
}

/// A short window, so that a test has frames outside of it.
const SMALL_WINDOW: [&str; 4] = ["--set", "gather.frames=2", "--set", "stabilise.frames=1"];

#[test]
fn frames_are_written_reported_and_left_alone_the_next_time() {
    let folder = Folder::new("denoise");
    rendered(&folder, "48x27", 4);
    let base = ["denoise", "frames/noisy/noisy.####.exr", "-o", "clean/x_%04d.exr"];
    let dry = run(&folder.0, &[&base[..], &["--dry-run"]].concat());
    assert_eq!(dry.status.code(), Some(0), "{}", err(&dry));
    assert!(out(&dry).contains("would write   4 frames: 1-4"), "{}", out(&dry));
    assert!(out(&dry).contains("matte"), "{}", out(&dry));
    assert!(!folder.0.join("clean").exists());
    let short = run(&folder.0, &[&base[..], &["--dry-run", "--json", "--preset", "sequence-short"]].concat());
    let value: Value = serde_json::from_str(&out(&short)).expect("JSON");
    assert_eq!((&value["settings"]["preset"], &value["reach"]), (&"sequence-short".into(), &4.into()));

    let output = run(&folder.0, &[&base[..], &["--json", "-v", "--report", "r.json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!(folder.files("clean"), ["x_0001.exr", "x_0002.exr", "x_0003.exr", "x_0004.exr"]);
    let lines: Vec<String> = err(&output).lines().filter(|l| l.starts_with('[')).map(str::to_owned).collect();
    assert_eq!(lines.len(), 4, "{}", err(&output));
    assert!(lines[3].starts_with("[100%] frame 4 of 4") && lines[3].contains("frames a second"), "{lines:?}");
    let told = err(&output);
    assert!(told.contains("processor seconds") && told.contains("renderer ="), "{told}");
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    assert_eq!(fs::read_to_string(folder.0.join("r.json")).expect("the report"), out(&output));
    assert_eq!((&value["format"], &value["settings"]["preset"]), (&1.into(), &"sequence".into()));
    assert!(value["settings"]["gather.frames"].is_string());
    assert!(value["frames"].as_array().expect("frames").iter().all(|f| f["status"] == "done"));
    assert!(value["times"]["wall_seconds"].as_f64().expect("a time") > 0.0);

    let again = run(&folder.0, &[&base[..], &["--resume"]].concat());
    assert_eq!(again.status.code(), Some(0), "{}", err(&again));
    assert!(err(&again).contains("every frame is there already"), "{}", err(&again));
}

#[test]
fn what_cannot_be_done_has_its_exit_status_and_names_the_file() {
    let folder = Folder::new("denoise-bad");
    rendered(&folder, "32x18", 6);
    let cases: [(&[&str], i32, &str); 8] = [
        (&["denoise", "nothing.####.exr", "-o", "x"], 1, "nothing"),
        (&["denoise", "frames/noisy", "-o", "x/one.exr"], 2, "####"),
        (&["denoise", "frames/noisy", "-o", "x", "--set", "gather.frame=2"], 2, "gather.frames"),
        (&["denoise", "frames/noisy", "-o", "x", "--preset", "paper"], 2, "sequence"),
        (&["denoise", "frames/noisy", "-o", "x", "--history", "future"], 2, "both, past"),
        (&["denoise", "frames/noisy", "-o", "x", "--motion", "sideways"], 1, "blender"),
        (&["denoise", "frames/noisy", "-o", "x", "--map", "albedo=nowhere"], 1, "nowhere"),
        (&["denoise", "frames/noisy", "-o", "frames/noisy"], 1, "never replaced"),
    ];
    for (arguments, status, expected) in cases {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", err(&output));
        assert!(err(&output).contains(expected), "{arguments:?}: {}", err(&output));
        assert!(!folder.0.join("x").exists(), "{arguments:?}");
    }
    cut_short(&folder.0.join("frames/noisy/noisy.0003.exr"));
    let base = [&["denoise", "frames/noisy", "-o", "clean"][..], &SMALL_WINDOW].concat();
    let output = run(&folder.0, &base);
    assert_eq!(output.status.code(), Some(3), "{}", err(&output));
    assert!(err(&output).contains("noisy.0003.exr") && err(&output).contains("5 of 6"), "{}", err(&output));
    assert_eq!(folder.files("clean").len(), 5);
    // Asked for by name and not there.
    let output = run(&folder.0, &[&base[..], &["--frames", "5-8"]].concat());
    assert_eq!(output.status.code(), Some(3), "{}", err(&output));
    assert!(err(&output).contains("frame 7"), "{}", err(&output));
    fs::remove_file(folder.0.join("frames/noisy/noisy.0003.exr")).expect("removed");
    let output = run(&folder.0, &[&base[..], &["--shot", "1-6"]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    assert!(err(&output).contains("missing: 3"), "{}", err(&output));
}

#[test]
fn ctrl_c_leaves_whole_files_and_resume_goes_on() {
    let folder = Folder::new("denoise-interrupt");
    rendered(&folder, "96x54", 40);
    let base = [&["denoise", "frames/noisy", "-o", "clean"][..], &SMALL_WINDOW].concat();
    let mut child =
        quell(&folder.0).args(&base).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts");
    let deadline = std::time::Instant::now() + std::time::Duration::from_secs(60);
    while !folder.files("clean").iter().any(|name| name.starts_with("noisy")) {
        assert!(std::time::Instant::now() < deadline, "no frame within a minute");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let killed = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().expect("kill runs");
    assert!(killed.success());
    let status = child.wait().expect("it ends");
    let output = child.wait_with_output().expect("its output");
    assert_eq!(status.code(), Some(130), "{}", err(&output));
    assert!(err(&output).contains("nothing there is half written"), "{}", err(&output));
    let before = folder.files("clean");
    assert!(!before.is_empty() && before.len() < 40, "{before:?}");
    for name in &before {
        quell_frames::read_image(&folder.0.join("clean").join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    let output = run(&folder.0, &[&base[..], &["--resume"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!(folder.files("clean").len(), 40);
    assert!(err(&output).contains(&format!("of {}", 40 - before.len())), "{}", err(&output));
}

#[test]
fn a_limit_of_memory_is_kept_in_bands_and_a_hopeless_one_is_a_usage_error() {
    let folder = Folder::new("denoise-memory");
    // Six copies of one frame stand for a sequence: only their size matters here.
    rendered(&folder, "120x1000", 1);
    let noisy = folder.0.join("frames/noisy");
    for number in 2..=6 {
        fs::copy(noisy.join("noisy.0001.exr"), noisy.join(format!("noisy.{number:04}.exr"))).expect("copied");
    }
    let narrow = ["--set", "wavelet.levels=1", "--set", "wavelet.transmission_levels=1"];
    let narrow = [&narrow[..], &SMALL_WINDOW].concat();
    let denoise = |to: &str, limit: &str| -> (Value, String) {
        let more = ["-o", to, "--json", "-v", "--threads", "2", "--max-memory", limit];
        let output = run(&folder.0, &[&["denoise", "frames/noisy"][..], &more, &narrow].concat());
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        (serde_json::from_str(&out(&output)).expect("JSON"), err(&output))
    };
    let (whole, _) = denoise("whole", "8G");
    assert_eq!(whole["memory"]["bands"], 1);
    let estimated = whole["memory"]["bytes"].as_u64().expect("an estimate");
    // Estimates are from above.
    if let Some(peak) = whole["memory"]["peak_bytes"].as_u64() {
        assert!(peak <= estimated, "{peak} {estimated}");
    }
    let limit = (96 << 20) + (estimated - (96 << 20)) * 6 / 10;
    let (banded, told) = denoise("banded", &limit.to_string());
    assert!(banded["memory"]["bands"].as_u64() > Some(1), "{}", banded["memory"]);
    assert!(told.contains("band 1 of"), "{told}");
    if let Some(peak) = banded["memory"]["peak_bytes"].as_u64() {
        assert!(peak <= limit, "{peak} {limit}");
        assert!(peak < whole["memory"]["peak_bytes"].as_u64().unwrap_or(0), "{peak}");
    }
    for name in folder.files("whole") {
        let bytes = |to: &str| fs::read(folder.0.join(to).join(&name)).expect("a frame");
        assert!(bytes("whole") == bytes("banded"), "{name}");
    }
    assert_eq!(folder.files("banded").len(), 6);

    let hopeless = ["denoise", "frames/noisy", "-o", "x", "--max-memory", "1M"];
    let output = run(&folder.0, &hopeless);
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(err(&output).contains("MiB at the least") && err(&output).contains("--max-memory"), "{}", err(&output));
    let dry = run(&folder.0, &[&hopeless[..4], &["--max-memory", "8G", "--dry-run"]].concat());
    assert!(out(&dry).contains("memory        at most") && out(&dry).contains("8.0 GiB"), "{}", out(&dry));
    assert!(!folder.0.join("x").exists());
}

#[test]
fn chosen_passes_are_filtered_and_the_others_stay() {
    let folder = Folder::new("denoise-passes");
    rendered(&folder, "32x18", 2);
    let denoise =
        |passes: &str| run(&folder.0, &["denoise", "frames/noisy", "-o", "clean", "--overwrite", "--passes", passes]);
    let output = denoise("beauty,diffind");
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(err(&output).contains("the sum of what is written and keeps the noise of"), "{}", err(&output));
    let image = |folder: &Path| quell_frames::read_image(&folder.join("noisy.0001.exr")).expect("a frame");
    let (before, after) = (image(&folder.0.join("frames/noisy")), image(&folder.0.join("clean")));
    let changed = |name: &str| {
        let at = before.parts()[0].find(name).unwrap_or_else(|| panic!("{name}"));
        before.samples(0, at) != after.samples(0, at)
    };
    assert!(changed("DiffInd.R") && changed("R"));
    assert!(!changed("GlossInd.R") && !changed("Depth.Z"));
    let output = denoise("sparkle");
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    assert!(err(&output).contains("sparkle") && err(&output).contains("matte"), "{}", err(&output));
}

/// The largest file that a process may write stands for a disk that is full: nothing is left of the frame that failed.
#[test]
#[cfg(unix)]
fn a_full_disk_leaves_nothing_half_written() {
    let folder = Folder::new("denoise-full");
    rendered(&folder, "96x54", 3);
    let program = quell(&folder.0).get_program().to_owned();
    for more in ["", "--set gather.frames=1"] {
        // Blocks of 512 bytes; the signal that comes with the error is ignored, as on a disk there is none.
        let line = format!("trap '' XFSZ; ulimit -f 8; exec \"$0\" denoise frames/noisy -o clean {more}");
        let output =
            Command::new("sh").args(["-c", &line]).arg(&program).current_dir(&folder.0).output().expect("a shell");
        assert_eq!(output.status.code(), Some(1), "{}", err(&output));
        assert!(err(&output).contains("cannot write"), "{}", err(&output));
        assert_eq!(folder.files("clean"), [""; 0], "{}", err(&output));
    }
}

/// The same two frames with the specification and with the fast back end: what is written says which, and agrees.
#[test]
fn the_reference_filters_two_small_frames() {
    let folder = Folder::new("denoise-reference");
    rendered(&folder, "24x14", 2);
    let pictures: Vec<Vec<quell::Plane<quell::Rgb>>> = ["reference", "cpu"]
        .into_iter()
        .map(|backend| {
            let base = ["denoise", "frames/noisy", "-o", backend, "--backend", backend, "--json"];
            let output = run(&folder.0, &[&base[..], &SMALL_WINDOW].concat());
            assert_eq!(output.status.code(), Some(0), "{}", err(&output));
            let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
            assert_eq!(value["settings"]["backend"], backend);
            let files = folder.files(backend);
            assert_eq!(files.len(), 2);
            let file = |name: &String| quell_frames::read_frame(&folder.0.join(backend).join(name)).expect("a frame");
            files.iter().map(|name| file(name).composite.expect("a picture")).collect()
        })
        .collect();
    let noisy = folder.files("frames/noisy").into_iter().map(|name| {
        let file = quell_frames::read_frame(&folder.0.join("frames/noisy").join(name)).expect("a frame");
        file.composite.expect("a picture")
    });
    for ((reference, cpu), noisy) in pictures[0].iter().zip(&pictures[1]).zip(noisy) {
        let apart = |a: &quell::Plane<quell::Rgb>, b: &quell::Plane<quell::Rgb>| {
            let pairs = a.data().iter().flatten().zip(b.data().iter().flatten());
            pairs.map(|(a, b)| (a - b).abs() / (0.01 + a.abs())).fold(0.0, f32::max)
        };
        // Sums in another order: rounding of f32 over a few hundred samples.
        assert!(apart(reference, cpu) < 1e-3, "{}", apart(reference, cpu));
        // The canary: the filter did something.
        assert!(apart(reference, &noisy) > 0.1);
    }
}
