//! The built program as a user meets it: help, usage errors, output on both streams, files, interrupts.

mod compare;
mod denoise;
mod doctor;
mod gltf;
#[cfg(feature = "gpu")]
mod gpu;
mod score;

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The program, away from the user's own cache and terminal settings.
fn quell(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quell"));
    command.current_dir(folder).env("QUELL_CACHE", folder.join("cache")).env_remove("NO_COLOR").stdin(Stdio::null());
    // Else `auto` would take the GPU of a machine that has one. OpenGL is not built in: no adapter is seen through it.
    command.env("WGPU_BACKEND", "gl");
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    quell(folder).args(arguments).output().expect("the program starts")
}

fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn err(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// A folder of its own for each test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        // Spaces and other letters in every path: they must not matter.
        let path = std::env::temp_dir().join(format!("quell cli ä {name} {}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).expect("the folder can be made");
        Self(path)
    }

    fn files(&self, below: &str) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.0.join(below)) else { return Vec::new() };
        let mut names: Vec<String> =
            entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

const COMMANDS: [&str; 11] =
    ["demo", "render", "denoise", "doctor", "compare", "score", "scenes", "bench", "reproduce", "explain", "shaders"];
/// The smallest run that has everything.
const SMALL: [&str; 6] = ["render", "cornell-box", "--size", "48x27", "--direct-samples", "2"];

#[test]
fn quell_alone_starts_a_newcomer_in_five_lines() {
    let folder = Folder::new("alone");
    let output = run(&folder.0, &[]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(out(&output).lines().count(), 5);
    assert!(out(&output).contains("quell demo"));
    assert_eq!(err(&output), "");
}

#[test]
fn help_of_every_command_begins_with_an_example() {
    let folder = Folder::new("help");
    for command in COMMANDS {
        let output = run(&folder.0, &[command, "--help"]);
        assert_eq!(output.status.code(), Some(0), "{command}");
        assert!(out(&output).starts_with(&format!("Example: quell {command}")), "{}", out(&output));
        for option in
            ["--json", "--report", "--threads", "--backend", "--device", "--preset", "--set", "--settings", "--quiet"]
        {
            assert!(out(&output).contains(option), "{command} {option}");
        }
    }
    let output = run(&folder.0, &["--help"]);
    for command in COMMANDS {
        assert!(out(&output).contains(&format!("  {command}")), "{command}");
    }
}

#[test]
fn usage_errors_name_the_thing_and_what_there_is() {
    let folder = Folder::new("usage");
    let cases: [(&[&str], &str); 22] = [
        (&["rendr"], "render"),
        (&["demo", "--nonsense"], "--nonsense"),
        (&["render", "cornel-box", "-o", "x"], "cornell-box"),
        (&["render", "zebra", "-o", "x"], "cornell-box"),
        (&["explain", "cornel-box"], "cornell-box"),
        (&["bench", "--scene", "zebra"], "cornell-box"),
        (&["bench", "--sequence", "--preset", "paper"], "there are: sequence, sequence-short"),
        (&["bench", "--sequence", "--environment", "sky.exr"], "--environment is for scenes"),
        (&["render", "cornell-box"], "--output"),
        (&["render", "cornell-box", "-o", "x", "--camera", "9"], "cameras 1 to 5"),
        (&["render", "cornell-box", "-o", "x", "--camera", "top"], "cameras 1 to 5"),
        (&["render", "cornell-box", "-o", "x", "--frames", "9-1"], "ends before it begins"),
        (&["render", "cornell-box", "-o", "x", "--frames", "a"], "1001-1100x2"),
        (&["render", "cornell-box", "-o", "x", "--size", "0x5"], "no pixels"),
        (&["render", "cornell-box", "-o", "x", "--spp", "0"], "at least 1"),
        (&["render", "cornell-box", "-o", "x", "--reference", "--frames", "1", "--reference-frames", "2"], "frame 2"),
        (&["explain", "--set", "matte_temporal.alhpa=0.5"], "matte_temporal.alpha"),
        (&["explain", "--set", "matte_temporal.alpha=7"], "a number from"),
        (&["explain", "--set", "matte_temporal.alpha"], "stage.parameter=value"),
        (&["explain", "--preset", "fast"], "there are: paper, quality (the other filter: sequence, sequence-short)"),
        (&["explain", "--backend", "cuda"], "auto, cpu, gpu, reference"),
        (&["explain", "--threads", "0"], "at least 1"),
    ];
    for (arguments, expected) in cases {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", err(&output));
        assert!(err(&output).contains(expected), "{arguments:?}: {}", err(&output));
        assert_eq!(out(&output), "", "{arguments:?}");
    }
    // None of them left anything behind.
    assert!(folder.files("").is_empty());
}

#[test]
fn version_and_completions() {
    let folder = Folder::new("version");
    let output = run(&folder.0, &["--version"]);
    assert_eq!(out(&output).trim(), format!("quell {}", env!("CARGO_PKG_VERSION")));
    let output = out(&run(&folder.0, &["--version", "-v"]));
    assert!(
        output.contains("instruction set: ") && output.contains("back ends: cpu,") && output.contains("adapters:"),
        "{output}"
    );
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let output = run(&folder.0, &["--completions", shell]);
        assert_eq!(output.status.code(), Some(0));
        assert!(out(&output).contains("explain") && out(&output).len() > 1000, "{shell}");
    }
}

#[test]
fn json_is_one_object_alone_on_standard_output() {
    let folder = Folder::new("json");
    for arguments in [["scenes", "--json"], ["explain", "--json"]] {
        let output = run(&folder.0, &arguments);
        let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
        assert_eq!(value["format"], 1);
        assert_eq!(value["command"], format!("quell {}", arguments.join(" ")));
        assert!(value["settings"]["matte_temporal.alpha"].is_string());
    }
    let output = run(&folder.0, &["explain", "cornell-box", "--json", "--report", "below/report.json"]);
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    assert!(value["holds"]["triangles in the world"].as_u64().expect("a count") > 10);
    let file = std::fs::read_to_string(folder.0.join("below/report.json")).expect("the report");
    assert_eq!(file, out(&output));
}

#[test]
fn settings_come_from_preset_file_and_command_line_in_this_order() {
    let folder = Folder::new("settings");
    let file = "preset = \"paper\"\n[matte_temporal]\nalpha = 0.5\n[firefly]\nenabled = false\n";
    std::fs::write(folder.0.join("my.toml"), file).expect("written");
    let arguments = ["explain", "--settings", "my.toml", "--set", "matte_temporal.alpha=0.25", "--json"];
    let value: Value = serde_json::from_str(&out(&run(&folder.0, &arguments))).expect("JSON");
    assert_eq!(value["settings"]["matte_temporal.alpha"], "0.25");
    assert_eq!(value["settings"]["firefly.enabled"], "off");
    let runs = |name: &str| {
        let stages = value["pipeline"].as_array().expect("a list").iter();
        stages.clone().find(|s| s["name"] == name).expect("the stage")["runs"].clone()
    };
    assert_eq!((runs("firefly"), runs("matte_temporal")), (Value::Bool(false), Value::Bool(true)));

    std::fs::write(folder.0.join("bad.toml"), "[matte_temporal]\nalhpa = 0.5\n").expect("written");
    let output = run(&folder.0, &["explain", "--settings", "bad.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("bad.toml") && err(&output).contains("matte_temporal.alpha"), "{}", err(&output));
    let output = run(&folder.0, &["explain", "--settings", "missing.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).contains("missing.toml"), "{}", err(&output));
}

#[test]
fn explain_shows_every_parameter_and_what_was_changed() {
    let folder = Folder::new("explain");
    let output = out(&run(&folder.0, &["explain", "--set", "firefly.enabled=off"]));
    for parameter in quell::settings::PARAMETERS {
        assert!(output.contains(&format!(" {} = ", parameter.name)), "{}", parameter.name);
    }
    assert!(output.contains("* firefly.enabled = off"), "{output}");
    let sequence = out(&run(&folder.0, &["explain", "--preset", "sequence", "--set", "wavelet.levels=3"]));
    for parameter in quell::sequence::SEQUENCE_PARAMETERS {
        assert!(sequence.contains(&format!(" {} = ", parameter.name)), "{}", parameter.name);
    }
    assert!(sequence.contains("* wavelet.levels = 3"), "{sequence}");
    let short = out(&run(&folder.0, &["explain", "--preset", "sequence-short"]));
    assert!(short.contains("  gather.frames = 3 ") && short.contains("depends on 4 frames"), "{short}");
    let changed = |line: &&str| line.starts_with("* ");
    assert_eq!(short.lines().find(changed), None);
    // Both say of each stage what it reads, what it writes, and how far it looks.
    for (text, stage) in [(&output, "7 Matte Bilateral"), (&sequence, "wavelet")] {
        let line = text.lines().find(|line| line.starts_with(stage)).expect("the stage");
        assert!(line.contains(" -> ") && line.contains("reach: "), "{line}");
    }
    let page = out(&run(&folder.0, &["explain", "--markdown"]));
    assert_eq!(page.trim_end(), quell::parameters_markdown().trim_end());
}

#[test]
fn render_writes_frames_a_page_and_scores() {
    let folder = Folder::new("render");
    let mut arguments = SMALL.to_vec();
    arguments.extend(["-o", "my frames", "--frames", "3-5", "--reference", "4", "--reference-frames", "5"]);
    arguments.extend(["--report", "report.json", "--threads", "2"]);
    let output = run(&folder.0, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    // Not a terminal: plain lines, one a frame.
    let lines: Vec<String> = err(&output).lines().filter(|l| l.starts_with('[')).map(str::to_owned).collect();
    assert_eq!(lines, ["[ 33%] frame 1 of 3", "[ 66%] frame 2 of 3", "[100%] frame 3 of 3"]);
    let text = out(&output);
    let url = text.lines().last().expect("a last line");
    assert!(url.starts_with("file:///") && url.ends_with("my%20frames/index.html"), "{url}");
    assert!(text.contains("noisy") && text.contains("quell:quality"), "{text}");

    for kind in ["noisy", "denoised"] {
        let expected: Vec<String> = (3..=5).map(|n| format!("{kind}.{n:04}.exr")).collect();
        assert_eq!(folder.files(&format!("my frames/{kind}")), expected);
    }
    assert_eq!(folder.files("my frames/reference"), ["reference.0005.exr"]);
    let noisy = quell_frames::read_frame(&folder.0.join("my frames/noisy/noisy.0004.exr")).expect("a frame");
    assert_eq!((noisy.frame.index, noisy.frame.size), (4, quell::Size::new(48, 27)));
    assert!(noisy.frame.matte.is_some() && noisy.frame.motion.is_some());
    let denoised = quell_frames::read_frame(&folder.0.join("my frames/denoised/denoised.0004.exr")).expect("a frame");
    assert!(denoised.metadata.settings.contains("[matte_temporal]"));
    assert_eq!(denoised.frame.view_depth, noisy.frame.view_depth);
    assert_ne!(denoised.frame.matte, noisy.frame.matte);
    assert!(denoised.history_length.is_some());

    let report = std::fs::read_to_string(folder.0.join("report.json")).expect("the report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["frames"].as_array().expect("a list").len(), 3);
    assert_eq!(report["metrics"][1]["method"], "quell:quality");
    assert!(report["metrics"][1]["mean"]["energy"].is_number());
    assert!(report["stages"].as_array().expect("a list").iter().any(|s| s["paper_stage"] == 7));
    assert_eq!(report["machine"]["threads"], 2);

    // The same again gives the same bits, whatever the number of threads; quell's own files are replaced.
    let read = || quell_frames::read_frame(&folder.0.join("my frames/denoised/denoised.0005.exr")).expect("a frame");
    let bits = |f: &quell_frames::FrameFile| {
        let composite = f.composite.as_ref().expect("a picture");
        composite.data().iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    let before = read();
    let last = arguments.len() - 1;
    arguments[last] = "1";
    assert_eq!(run(&folder.0, &arguments).status.code(), Some(0));
    assert!(bits(&before) == bits(&read()), "other bits at another number of threads");
}

#[test]
fn no_denoise_and_quiet_do_what_they_say() {
    let folder = Folder::new("quiet");
    let mut arguments = SMALL.to_vec();
    arguments.extend([
        "-o",
        "out",
        "--frames",
        "-2--1",
        "--no-denoise",
        "-q",
        "--json",
        "--half",
        "--estimator",
        "paper",
    ]);
    let output = run(&folder.0, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!(err(&output), "");
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    assert!(value["page"].as_str().expect("an address").starts_with("file://"));
    assert_eq!(folder.files("out/noisy"), ["noisy.-0001.exr", "noisy.-0002.exr"]);
    assert!(folder.files("out/denoised").is_empty());
}

#[test]
fn an_environment_from_a_file_lights_the_scene() {
    let folder = Folder::new("environment");
    let wrong = |arguments: &[&str], expected: &str, status: i32| {
        let output = run(&folder.0, &[&SMALL[..], &["-o", "frames", "--count", "1"], arguments].concat());
        assert_eq!(output.status.code(), Some(status), "{}", err(&output));
        assert!(err(&output).contains(expected), "{}", err(&output));
    };
    wrong(&["--environment", "none.hdr"], "none.hdr", 1);
    wrong(&["--environment", "sky.png"], "latitude-longitude picture in .hdr or .exr", 1);
    wrong(&["--environment-rotation", "90"], "--environment", 2);
    wrong(&["--environment", "sky.hdr", "--environment-strength", "0"], "no positive number", 2);
    // One texel, without run lengths: radiance 2 in each channel.
    std::fs::write(folder.0.join("sky.hdr"), b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x82")
        .expect("the file can be written");
    wrong(&["--environment", "sky.hdr", "--environment-rotation", "nan"], "no angle", 2);
    let mean = |name: &str, arguments: &[&str]| {
        let output = run(&folder.0, &[&SMALL[..], &["-o", name, "--count", "1", "--no-denoise"], arguments].concat());
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let path = quell_frames::frame_path(&folder.0.join(name).join("noisy"), "noisy", 0);
        let frame = quell_frames::read_frame(&path).expect("quell's own file").frame;
        frame.direct.expect("direct light").data().iter().flatten().sum::<f32>() / (48.0 * 27.0 * 3.0)
    };
    let (without, with) = (mean("without", &[]), mean("with", &["--environment", "sky.hdr"]));
    assert!(with > without + 0.05, "{without} without, {with} with the environment");
    let strong = mean("strong", &["--environment", "sky.hdr", "--environment-strength", "3"]);
    assert!(((strong - without) / (with - without) - 3.0).abs() < 0.3, "{without}, {with}, {strong}");
}

#[test]
fn more_than_one_sample_brings_two_halves_and_variances() {
    let folder = Folder::new("halves");
    for (spp, halves) in [("1", false), ("2", true)] {
        let mut arguments = SMALL.to_vec();
        arguments.extend(["-o", spp, "--spp", spp, "--frames", "3", "--no-denoise"]);
        let output = run(&folder.0, &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let path = quell_frames::frame_path(&folder.0.join(spp).join("noisy"), "noisy", 3);
        let file = quell_frames::read_frame(&path).expect("quell's own file");
        assert_eq!(file.frame.matte_variance.is_some(), halves);
        let [a, b] = file.halves.map(|h| h.matte);
        assert_eq!((a.is_some(), b.is_some()), (halves, halves));
        if let (Some(a), Some(b), Some(mean)) = (a, b, file.frame.matte) {
            let off = |i: usize| (0.5 * (a.data()[i][0] + b.data()[i][0]) - mean.data()[i][0]).abs();
            assert!((0..mean.data().len()).all(|i| off(i) <= 1e-4 * (1.0 + mean.data()[i][0].abs())));
        }
    }
}

/// Odd requests end with a picture or with a message, never with a panic.
#[test]
fn extremes_neither_panic_nor_fail() {
    let folder = Folder::new("extremes");
    let cases: [&[&str]; 6] = [
        &["--size", "1x1", "--reference", "2"],
        &["--size", "1x23", "--reference", "2", "--jitter"],
        &["--size", "37x1", "--spp", "3", "--bounces", "0"],
        &["--size", "5x3", "--exposure", "1e-30", "--reference", "2"],
        &["--size", "5x3", "--exposure", "1e30", "--seed", "18446744073709551615", "--half"],
        &["--size", "5x3", "--bounces", "4294967295", "--backend", "reference"],
    ];
    for (i, case) in cases.iter().enumerate() {
        let place = format!("out{i}");
        let mut arguments = vec!["render", "cornell-box", "-o", &place, "--direct-samples", "1", "--frames", "7-8"];
        arguments.extend(*case);
        let output = run(&folder.0, &arguments);
        assert_eq!(output.status.code(), Some(0), "{case:?}: {}", err(&output));
        assert!(folder.0.join(&place).join("index.html").is_file());
    }
    for frame in ["2147483647", "-2147483647"] {
        let output = run(&folder.0, &["render", "cornell-box", "-o", "ends", "--size", "4x4", "--frames", frame]);
        assert!(matches!(output.status.code(), Some(0 | 1)), "{frame}: {}", err(&output));
        assert!(!err(&output).contains("panicked"), "{}", err(&output));
    }
}

#[test]
fn reproduce_writes_one_page_with_all_parts() {
    let folder = Folder::new("reproduce");
    let small = ["--size", "24x16", "--offline-size", "24x16", "--stages-size", "32x18", "--count", "3"];
    let mut arguments = vec!["reproduce", "-o", "out", "--reference-spp", "2", "--json", "-q"];
    arguments.extend(small);
    let output = run(&folder.0, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    // Five scenes with the noisy picture and four methods each; three scenes with six ablations and the whole.
    assert_eq!(value["offline"].as_array().map(Vec::len), Some(25));
    assert_eq!(value["ablations"].as_array().map(Vec::len), Some(21));
    assert_eq!(value["paths"].as_array().map(Vec::len), Some(8));
    assert!(value["stages"][1]["milliseconds"]["median"].as_f64().expect("a time") > 0.0);
    let nfor = &value["offline"][3];
    assert_eq!(nfor["method"], "nfor");
    assert!(nfor["missing"].is_null() && nfor["hdr_flip"].is_number(), "{nfor}");
    let page = std::fs::read_to_string(folder.0.join("out/index.html")).expect("a page");
    for heading in ["Stage times", "Offline: one frame", "Ablations", "More paths, or a filter"] {
        assert!(page.contains(heading), "{heading}");
    }
    // An unknown part is a usage error that lists them.
    let files = run(&folder.0, &["reproduce", "-o", "out", "--only", "offline", "--scenes", "nowhere"]);
    assert_eq!(files.status.code(), Some(1));
    assert!(
        String::from_utf8_lossy(&files.stderr).contains("cornell_box.glb"),
        "the file that is missing is not named"
    );
    let again = run(&folder.0, &["reproduce", "-o", "out", "--only", "everything"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(err(&again).contains("ablations"), "{}", err(&again));
}

#[test]
fn bench_prints_the_papers_table() {
    let folder = Folder::new("bench");
    let output = run(&folder.0, &["bench", "--size", "64x36,33x17", "--count", "3", "-q"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    for expected in ["7 Matte Bilateral", "10 Glossy V. Bilateral", "3.36", "64x36", "33x17", "stages 3 to 11:"] {
        assert!(out(&output).contains(expected), "{expected}: {}", out(&output));
    }
    let output =
        run(&folder.0, &["bench", "--scene", "cornell-box", "--size", "32x18", "--count", "1", "-q", "--json"]);
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    assert!(value["sizes"][0]["rays"]["per_second"].as_f64().expect("a number") > 0.0);
    assert!(value["stages"][1]["floor_ms"].is_number());
    let sequence = ["bench", "--sequence", "--size", "32x18", "--count", "1", "-q", "--json", "--bandwidth", "20"];
    let output =
        run(&folder.0, &[&sequence[..], &["--preset", "sequence-short", "--set", "blend.choose=off"]].concat());
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    let (preset, frames) = (&value["settings"]["preset"], &value["settings"]["gather.frames"]);
    assert_eq!((preset, frames), (&"sequence-short".into(), &"3".into()));
    assert!(out(&output).contains("stabilise") && !out(&output).contains("\"blend\""), "{}", out(&output));
}

#[test]
fn a_folder_that_cannot_be_written_is_named_before_work_begins() {
    let folder = Folder::new("unwritable");
    std::fs::write(folder.0.join("file"), "x").expect("written");
    for place in ["file", "file/below"] {
        let mut arguments = SMALL.to_vec();
        arguments.extend(["-o", place]);
        let output = run(&folder.0, &arguments);
        assert_eq!(output.status.code(), Some(1), "{place}");
        assert!(err(&output).contains("file") && !err(&output).contains('%'), "{}", err(&output));
    }
    let output = run(&folder.0, &["scenes", "--report", "file/report.json"]);
    assert_eq!(output.status.code(), Some(1));
    // Somebody else's page stays.
    std::fs::create_dir(folder.0.join("site")).expect("made");
    std::fs::write(folder.0.join("site/index.html"), "my home page").expect("written");
    let mut arguments = SMALL.to_vec();
    arguments.extend(["-o", "site"]);
    let output = run(&folder.0, &arguments);
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).contains("not written by quell"), "{}", err(&output));
    assert_eq!(std::fs::read_to_string(folder.0.join("site/index.html")).expect("a file"), "my home page");
}

/// A frame that another program wrote stays; the frames before it are whole, and the exit status says so.
#[test]
fn a_foreign_file_in_the_way_ends_the_run_with_the_frames_before_it_written() {
    let folder = Folder::new("foreign");
    std::fs::create_dir_all(folder.0.join("out/noisy")).expect("made");
    std::fs::write(folder.0.join("out/noisy/noisy.0001.exr"), "not quell's").expect("written");
    let mut arguments = SMALL.to_vec();
    arguments.extend(["-o", "out", "--count", "3", "--report", "report.json"]);
    let output = run(&folder.0, &arguments);
    assert_eq!(output.status.code(), Some(3), "{}", err(&output));
    assert!(err(&output).contains("noisy.0001.exr") && err(&output).contains("1 of 3"), "{}", err(&output));
    assert_eq!(std::fs::read_to_string(folder.0.join("out/noisy/noisy.0001.exr")).expect("a file"), "not quell's");
    let report = std::fs::read_to_string(folder.0.join("report.json")).expect("the report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let statuses: Vec<&str> =
        report["frames"].as_array().expect("a list").iter().filter_map(|f| f["status"].as_str()).collect();
    assert_eq!(statuses, ["done", "failed", "skipped"]);
    arguments.push("--overwrite");
    assert_eq!(run(&folder.0, &arguments).status.code(), Some(0));
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_whole_files_and_says_how_far_it_came() {
    let folder = Folder::new("interrupt");
    for signal in ["-INT", "-TERM"] {
        let place = format!("out{signal}");
        let mut child = quell(&folder.0)
            .args(["render", "cornell-box", "--size", "160x90", "--count", "5000", "-o", &place, "--report", "r.json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let deadline = std::time::Instant::now() + std::time::Duration::from_secs(60);
        while folder.files(&format!("{place}/denoised")).is_empty() {
            assert!(std::time::Instant::now() < deadline, "no frame within a minute");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let killed = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("kill runs");
        assert!(killed.success());
        let status = child.wait().expect("it ends");
        let output = child.wait_with_output().expect("its output");
        assert_eq!(status.code(), Some(130), "{}", err(&output));
        assert!(err(&output).contains("nothing there is half written"), "{}", err(&output));
        for kind in ["noisy", "denoised"] {
            let names = folder.files(&format!("{place}/{kind}"));
            assert!(!names.is_empty());
            for name in names {
                let path = folder.0.join(&place).join(kind).join(&name);
                quell_frames::read_frame(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
            }
        }
        let report: Value =
            serde_json::from_str(&std::fs::read_to_string(folder.0.join("r.json")).expect("the report")).expect("JSON");
        assert_eq!(report["frames"].as_array().expect("a list").len(), 5000);
    }
}

#[test]
fn whoever_reads_half_of_it_gets_no_panic() {
    let folder = Folder::new("pipe");
    let mut child =
        quell(&folder.0).arg("explain").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!((output.status.code(), err(&output).as_str()), (Some(0), ""));
}

/// The demo as `cargo run --release -- demo` does it, smaller.
#[test]
fn a_small_demo_ends_with_the_address_of_its_page() {
    let folder = Folder::new("demo");
    let output = run(&folder.0, &["demo", "--size", "96x54", "--count", "3", "--exr", "--report", "report.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let last = out(&output).lines().last().expect("a last line").to_owned();
    assert!(last.starts_with("file:///") && last.ends_with("quell-demo/index.html"), "{last}");
    for kind in ["noisy", "denoised"] {
        let names = folder.files(&format!("quell-demo/{kind}"));
        assert_eq!(names.len(), 6, "{names:?}");
    }
    let page = std::fs::read_to_string(folder.0.join("quell-demo/index.html")).expect("the page");
    assert!(page.contains("glossy-room") && page.len() < 40_000_000);
    assert!(serde_json::from_slice::<Value>(&std::fs::read(folder.0.join("report.json")).expect("a file")).is_ok());
}
