//! The same frames on the GPU and on the CPU, and what is said where there is no GPU.
//!
//! Without an adapter the tests that need one print why they did nothing; with `QUELL_REQUIRE_GPU=1` they fail.

use super::{Folder, err, out, quell};
use quell::{Plane, Rgb};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

/// How far planes of the GPU may lie from the CPU's.
struct Bound {
    plane: &'static str,
    /// Largest difference, relative to the value plus the plane's mean magnitude.
    relative: f64,
    /// Share of values beyond it.
    flips: f64,
}

/// Half storage, as measured against `reference` by the denoiser's own tests, and twice as much, since the CPU's back end
/// lies as far from that: a rounding of 2^-11 a plane, fed back for some frames; thresholds that flip (stages 3, 6, 8).
/// Reflections in curved mirrors find their place in history less surely.
const BOUNDS: [Bound; 6] = [
    Bound { plane: "composite", relative: 1e-2, flips: 3e-2 },
    Bound { plane: "direct", relative: 4e-3, flips: 4e-3 },
    Bound { plane: "matte", relative: 4e-3, flips: 4e-3 },
    Bound { plane: "glossy", relative: 1e-2, flips: 3e-2 },
    Bound { plane: "confidence", relative: 4e-3, flips: 4e-3 },
    Bound { plane: "history length", relative: 4e-3, flips: 4e-3 },
];

/// The program with the adapters of this machine, which the other tests hide.
fn run(folder: &Path, arguments: &[&str]) -> Output {
    quell(folder).env_remove("WGPU_BACKEND").args(arguments).output().expect("the program starts")
}

/// The best adapter's name, or `None` after saying that there is none.
fn adapter(folder: &Path) -> Option<String> {
    let version = out(&run(folder, &["--version", "-v"]));
    let listed = version.lines().skip_while(|line| *line != "adapters:").nth(1);
    let name = listed.and_then(|line| line.trim().split(" (").next()).map(str::to_owned);
    if name.is_none() {
        let required = std::env::var_os("QUELL_REQUIRE_GPU").is_some_and(|v| v == "1");
        assert!(!required, "QUELL_REQUIRE_GPU is set, but there is no adapter: {version}");
        println!("SKIPPED: there is no adapter");
    }
    name
}

/// Every plane that denoising writes, as numbers, with its scale where that is not its own mean.
fn planes(path: &Path) -> Vec<(&'static str, Vec<f32>)> {
    let file = quell_frames::read_frame(path).expect("quell's own file");
    let colours = |plane: Option<Plane<Rgb>>| plane.expect("a plane").data().iter().flatten().copied().collect();
    let scalars = |plane: Option<Plane<f32>>| plane.expect("a plane").data().to_vec();
    vec![
        ("composite", colours(file.composite)),
        ("direct", colours(file.frame.direct)),
        ("matte", colours(file.frame.matte)),
        ("glossy", colours(file.frame.glossy)),
        ("confidence", scalars(file.confidence)),
        ("history length", scalars(file.history_length)),
    ]
}

/// The largest difference within the bounds, or which plane is beyond its own.
fn compare(cpu: &[(&str, Vec<f32>)], gpu: &[(&str, Vec<f32>)]) -> Result<f64, String> {
    let mut largest = 0.0f64;
    for (((name, p), (_, q)), bound) in cpu.iter().zip(gpu).zip(&BOUNDS) {
        assert_eq!(*name, bound.plane);
        let mean = p.iter().map(|v| f64::from(v.abs())).sum::<f64>() / p.len() as f64;
        let off = |(p, q): (&f32, &f32)| {
            let scale = f64::from(p.abs().max(q.abs())) + mean;
            let d = f64::from((p - q).abs()) / if scale > 0.0 { scale } else { 1.0 };
            if d.is_nan() { f64::INFINITY } else { d }
        };
        let differences: Vec<f64> = p.iter().zip(q).map(off).collect();
        let flipped = differences.iter().filter(|d| **d > bound.relative).count();
        if flipped as f64 > bound.flips * p.len() as f64 {
            let most = differences.iter().copied().fold(0.0, f64::max);
            return Err(format!("{name}: {flipped} of {} values differ, by up to {most:e}", p.len()));
        }
        largest = differences.into_iter().filter(|d| *d <= bound.relative).fold(largest, f64::max);
    }
    Ok(largest)
}

#[test]
fn render_gives_the_pictures_of_the_cpu() {
    let folder = Folder::new("gpu render");
    let Some(adapter) = adapter(&folder.0) else { return };
    let render = |output: &str, options: &[&str]| {
        let fixed =
            ["render", "glossy-room", "--size", "80x45", "--frames", "0-5", "--jitter", "--direct-samples", "1"];
        // With `--backend gpu` a real GPU would trace, too, and other paths.
        let fixed = [&fixed[..], &["--tracer", "cpu"]].concat();
        let done = run(&folder.0, &[&fixed[..], &["-o", output, "-v", "--report", "report.json"], options].concat());
        assert_eq!(done.status.code(), Some(0), "{}", err(&done));
        let report = std::fs::read_to_string(folder.0.join("report.json")).expect("the report");
        (err(&done), serde_json::from_str::<Value>(&report).expect("JSON"))
    };
    let (_, report) = render("cpu", &["--backend", "cpu"]);
    assert_eq!((&report["settings"]["backend"], &report["machine"]["adapter"]), (&"cpu".into(), &Value::Null));
    let (messages, report) = render("gpu", &["--backend", "gpu", "--device", &adapter.to_uppercase()]);
    assert_eq!(report["settings"]["backend"], "gpu");
    let named = report["machine"]["adapter"].as_str().expect("the adapter");
    assert!(named.starts_with(&adapter) && messages.contains(&format!("back end: gpu on {adapter}")), "{messages}");

    let file = |kind: &str, frame: i64| {
        planes(&quell_frames::frame_path(&folder.0.join(kind).join("denoised"), "denoised", frame))
    };
    for frame in [0, 1, 5] {
        let (cpu, gpu) = (file("cpu", frame), file("gpu", frame));
        match compare(&cpu, &gpu) {
            Ok(largest) => println!("frame {frame} on {adapter}: {largest:.1e}"),
            Err(difference) => panic!("frame {frame} on {adapter}: {difference}"),
        }
        // The first frame has no history to differ in.
        assert!(frame == 0 || cpu != gpu, "both ran on the same back end");
        // What the comparison must see: another frame, and each plane off by 3 %.
        assert!(compare(&cpu, &file("gpu", if frame == 0 { 1 } else { frame - 1 })).is_err());
        for k in 0..gpu.len() {
            let mut changed = gpu.clone();
            changed[k].1.iter_mut().for_each(|v| *v = *v * 1.03 + 0.03 * f32::from(*v == 0.0));
            assert!(compare(&cpu, &changed).is_err(), "{} off by 3 % went unseen", changed[k].0);
        }
    }
}

/// How far colours of `denoise` may lie from the CPU's: the wavelet alone runs on the device, and decides nothing at thresholds; the
/// files hold half floats, one step of which is 1e-3 of the value at the most.
const SEQUENCE: f64 = 1.1e-3;

#[test]
fn denoise_gives_the_files_of_the_cpu_and_signs_them() {
    let folder = Folder::new("gpu denoise");
    let Some(adapter) = adapter(&folder.0) else { return };
    let done = |arguments: &[&str]| {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", err(&output));
        err(&output)
    };
    let noisy = ["--frames", "1-4", "--direct-samples", "1", "--no-denoise", "-q", "-o", "frames"];
    done(&[&["render", "glossy-room", "--size", "64x36"][..], &noisy].concat());
    let denoise = ["denoise", "frames/noisy", "--report", "report.json", "-v", "-o"];
    let backend = || {
        let report = std::fs::read_to_string(folder.0.join("report.json")).expect("the report");
        serde_json::from_str::<Value>(&report).expect("JSON")["settings"]["backend"].clone()
    };
    // No GPU unless one is asked for: the bits must not depend on the machine.
    assert!(done(&[&denoise[..], &["cpu"]].concat()).contains("back end: cpu"));
    assert_eq!(backend(), "cpu");
    let on_gpu = [&denoise[..], &["gpu", "--backend", "gpu", "--device", &adapter]].concat();
    assert!(done(&on_gpu).contains(&format!("back end: gpu on {adapter}")));
    assert_eq!(backend(), "gpu");

    let image = |kind: &str, frame: i64| {
        let path = quell_frames::frame_path(&folder.0.join(kind), "noisy", frame);
        quell_frames::image::read_image(&path).expect("a file of quell's")
    };
    let values = |kind: &str, frame: i64| -> Vec<f32> {
        let image = image(kind, frame);
        let channels =
            (image.parts().iter().enumerate()).flat_map(|(i, part)| (0..part.channels().len()).map(move |c| (i, c)));
        channels.filter_map(|(part, c)| image.samples(part, c)).flat_map(|samples| samples.to_f32()).collect()
    };
    for frame in 1..=4 {
        let (cpu, gpu) = (values("cpu", frame), values("gpu", frame));
        let mean = cpu.iter().filter(|v| v.is_finite()).map(|v| f64::from(v.abs())).sum::<f64>() / cpu.len() as f64;
        let off = |(a, b): (&f32, &f32)| f64::from((a - b).abs()) / (f64::from(a.abs().max(b.abs())) + 0.01 * mean);
        let most = cpu.iter().zip(&gpu).filter(|(a, b)| a.to_bits() != b.to_bits()).map(off).fold(0.0, f64::max);
        println!("frame {frame} on {adapter}: {most:.1e}");
        assert!(cpu.len() == gpu.len() && most <= SEQUENCE, "frame {frame}: {most:.1e}");
        assert!(values("gpu", frame % 4 + 1) != gpu);
        let backend = |kind| image(kind, frame).text("quell.backend").unwrap_or_default();
        assert_eq!(backend("cpu"), "cpu");
        assert!(backend("gpu").starts_with(&format!("gpu: {adapter}")), "{}", backend("gpu"));
    }
    // What the GPU made is done; for the CPU it is another job.
    let wanted = |options: &[&str]| {
        let all = [&denoise[..], &["gpu", "--resume", "--dry-run"], options].concat();
        out(&run(&folder.0, &all)).lines().next().unwrap_or_default().to_owned()
    };
    assert!(wanted(&["--backend", "gpu", "--device", &adapter]).contains(" 0 frames"));
    assert!(wanted(&[]).contains(" 4 frames"), "{}", wanted(&[]));
}

#[test]
fn bench_has_times_bytes_and_floors() {
    let folder = Folder::new("gpu bench");
    let Some(adapter) = adapter(&folder.0) else { return };
    let sizes = ["bench", "--size", "64x36,128x72", "--count", "3", "--device", &adapter, "--json"];
    let bench = |options: &[&str]| {
        let output = run(&folder.0, &[&sizes[..], options].concat());
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        serde_json::from_str::<Value>(&out(&output)).expect("JSON")
    };
    // What a preset moves in stages 3 to 10 at most, as docs/gpu.md and docs/quality.md say.
    for (preset, most) in [("paper", 256.0), ("quality", 420.0)] {
        let runs = bench(&["--bandwidth", "100", "--preset", preset])["sizes"].clone();
        for run in runs.as_array().expect("a list") {
            let bytes = run["bytes_per_pixel"].as_object().expect("an object");
            let of_stages =
                bytes.iter().filter(|(name, _)| !["composite", "direct_taa", "antialiasing"].contains(&name.as_str()));
            let sum: f64 = of_stages.map(|(_, bytes)| bytes.as_f64().expect("a number")).sum();
            assert!(sum > 100.0 && sum <= most, "{preset}: {sum} bytes a pixel, {run}");
        }
    }
    let value = bench(&["--bandwidth", "100"]);
    assert_eq!(value["settings"]["backend"], "gpu");
    assert_eq!(value["gigabytes_per_second"], 100.0);
    let runs = value["sizes"].as_array().expect("a list");
    assert_eq!(runs.len(), 2);
    for (run, pixels) in runs.iter().zip([64.0 * 36.0, 128.0 * 72.0]) {
        assert!(run["frame_ms"].as_f64().expect("a time") > 0.0);
        // Guides made of textures come before the stages, and are not among them.
        assert_eq!(run["prepare_bytes_per_pixel"], 47);
        // Times of stages need timestamps; their floors follow from the bytes.
        for stage in run["stages"].as_array().expect("a list").iter().filter(|s| s["bytes_per_pixel"].is_number()) {
            let floor = stage["bytes_per_pixel"].as_f64().expect("bytes") * pixels / 100e9 * 1e3;
            assert!((stage["floor_ms"].as_f64().expect("a floor") - floor).abs() < 1e-9 * floor.max(1.0), "{stage}");
            assert!(stage["milliseconds"]["median"].as_f64().expect("a time") > 0.0, "{stage}");
        }
    }
    assert!(bench(&[])["copy_gigabytes_per_second"].as_f64().expect("a speed") > 0.0);
}

#[test]
fn a_device_that_is_not_there_is_named_with_those_that_are() {
    let folder = Folder::new("gpu names");
    let small = ["bench", "--size", "16x9", "--count", "1"];
    let with = |options: &[&str]| run(&folder.0, &[&small[..], options].concat());
    let known = adapter(&folder.0).unwrap_or_default();
    for options in [&["--device", "voodoo"][..], &["--backend", "gpu", "--device", "voodoo"]] {
        let output = with(options);
        assert_eq!(output.status.code(), Some(2), "{}", err(&output));
        assert!(err(&output).contains("`voodoo`") && err(&output).contains(&known), "{}", err(&output));
    }
    let output = with(&["--backend", "cpu", "--device", "voodoo"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("--device names a GPU"), "{}", err(&output));
}

#[test]
fn without_a_gpu_auto_takes_the_cpu_and_says_so() {
    let folder = Folder::new("gpu none");
    let small = ["bench", "--size", "16x9", "--count", "1"];
    // No adapter is seen through an API that this program was not built for.
    let with = |options: &[&str]| super::run(&folder.0, &[&small[..], options].concat());
    let output = with(&["-v", "--report", "report.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(err(&output).contains("back end: cpu (auto: there is no GPU"), "{}", err(&output));
    let report = std::fs::read_to_string(folder.0.join("report.json")).expect("the report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["settings"]["backend"], "cpu");
    assert!(report["settings"]["backend_why"].as_str().expect("a reason").contains("there is no GPU"));
    let output = with(&["--backend", "gpu"]);
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    assert!(err(&output).contains("there is no GPU"), "{}", err(&output));
}

#[test]
fn compare_runs_quell_on_the_gpu_and_says_so() {
    let folder = Folder::new("gpu compare");
    let Some(adapter) = adapter(&folder.0) else { return };
    let compared = |output: &str, options: &[&str]| {
        let fixed =
            ["compare", "glossy-room", "--size", "48x27", "--count", "6", "--reference-spp", "4", "--tracer", "cpu"];
        let methods = ["--methods", "none,quell:paper,quell:paper+no-firefly", "-o", output];
        let done = run(&folder.0, &[&fixed[..], &methods, options].concat());
        assert_eq!(done.status.code(), Some(0), "{}", err(&done));
        let report = std::fs::read_to_string(folder.0.join(output).join("report.json")).expect("the report");
        let csv = std::fs::read_to_string(folder.0.join(output).join("scores.csv")).expect("the figures");
        (out(&done), serde_json::from_str::<Value>(&report).expect("JSON"), csv)
    };
    let errors = |report: &Value| {
        let of = |m: &Value| m["mean"]["rel_mse_trimmed"].as_f64().expect("a figure");
        report["methods"].as_array().expect("methods").iter().map(of).collect::<Vec<f64>>()
    };
    // Nothing is asked for: the CPU, on every machine.
    let (text, on_cpu, csv) = compared("compared", &[]);
    assert_eq!((&on_cpu["settings"]["backend"], &on_cpu["methods"][1]["backend"]), (&"cpu".into(), &Value::Null));
    assert!(!text.contains("wall time of bringing") && !csv.contains("backend"), "{text}");
    // The same folder: pictures of the other back end must not be taken for this one's.
    let (text, on_gpu, csv) = compared("compared", &["--backend", "gpu", "--device", &adapter]);
    assert_eq!((&on_gpu["settings"]["backend"], &on_gpu["methods"][1]["backend"]), (&"gpu".into(), &"gpu".into()));
    assert_eq!((&on_gpu["methods"][0]["backend"], &on_gpu["methods"][1]["resumed"]), (&Value::Null, &false.into()));
    assert!(text.contains(&format!("quell:paper ran on {adapter}")) && text.contains("MiB"), "{text}");
    let ends = |line: &str, end: &str| csv.lines().any(|l| l.starts_with(line) && l.ends_with(end));
    assert!(ends("method,", ",backend,reason") && ends("none,", ",cpu,") && ends("quell:paper,", ",gpu,"), "{csv}");
    let (a, b) = (errors(&on_cpu), errors(&on_gpu));
    assert!(a[0] == b[0] && a[1] != b[1] && b[1] != b[2], "{a:?}, {b:?}");
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() < 0.02 * a, "{a:?}, {b:?}");
    }
}

#[test]
fn device_memory_is_told() {
    let folder = Folder::new("gpu memory");
    let Some(adapter) = adapter(&folder.0) else { return };
    let fixed = [
        "bench",
        "--preset",
        "paper",
        "--size",
        "64x36",
        "--count",
        "1",
        "--bandwidth",
        "100",
        "--report",
        "report.json",
    ];
    let bytes = |options: &[&str]| {
        let done = run(&folder.0, &[&fixed[..], options].concat());
        assert_eq!(done.status.code(), Some(0), "{}", err(&done));
        let report = std::fs::read_to_string(folder.0.join("report.json")).expect("the report");
        let report: Value = serde_json::from_str(&report).expect("JSON");
        (out(&done), report["sizes"][0]["device_memory_bytes"].clone())
    };
    let (text, memory) = bytes(&["--backend", "gpu", "--device", &adapter]);
    // As docs/gpu.md counts them, those of stage 11 included: `new` makes them before it knows what frames hold.
    assert_eq!(memory["persistent"], 88 * 64 * 36, "{memory}");
    assert!(memory["transient"].as_u64() > Some(0) && memory["uploaded"].as_u64() > Some(0), "{memory}");
    assert!(text.contains("device memory: "), "{text}");
    let (text, memory) = bytes(&["--backend", "cpu"]);
    assert!(memory == Value::Null && !text.contains("device memory"), "{text}");
}
