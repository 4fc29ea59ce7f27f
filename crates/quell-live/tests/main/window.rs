//! The window itself, under a display of its own: opened, driven by pointer and keys, its pictures and reports read. Without
//! Xvfb or a device the test says why it did nothing; with `QUELL_REQUIRE_WINDOW=1` it fails.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Set to 1, what is missing fails the test instead of skipping it.
const REQUIRE: &str = "QUELL_REQUIRE_WINDOW";

/// What is done, and what is read between.
const SCRIPT: &str = r#"
frames 2
report begin.json
window begin.png
click scene
click "scene disocclusion"
opened
frames 2
report chosen.json
open /nonexistent/room.glb
frames 1
report refused.json
click picture 0.25
drag "split 1" 0.5 0.3 4.0 0.3
report split.json
window split.png
click a-trous 0.1
click SVGF 0.1
frames 2
report baselines.json
window baselines.png
click baselines 0.1
click svgf:later
drag atrous.levels 0.2 0.5 0.02 0.5
frames 1
report constants.json
window constants.png
click baselines 0.1
click a-trous 0.1
click SVGF 0.1
click pictures 0.1
click matte_bilateral 0.1
drag matte_bilateral.taps 0.1 0.5 0.4 0.5
report slider.json
click matte_bilateral 0.1
click ablations 0.1
click no-denoising 0.05
frames 1
report ablation.json
window ablation.png
click paper
report preset.json
click fly
key W 2
report flown.json
click orbit
drag picture 0.45 0.2 0.6 0.25
report turned.json
frames 1
window turned.png
wheel picture 1
report nearer.json
click "save view"
frames 1
window nearer.png
click "record path"
key D 2
click "end path"
report recorded.json
click "write path"
written
report written.json
click "save PNG"
frames 2
click "save EXR"
frames 2
report saved.json
resize 420 260
frames 1
report larger.json
resize 0 0
frames 1
resize 320 180
frames 1
window end.png
report end.json
resize 300 150
resize 340 200
resize 1 1
resize 2000 30
resize 320 180
screen 1.5
frames 1
report screen.json
window screen.png
screen 1
frames 1
click pictures 0.1
click SVGF 0.1
open cornell-box
report before.json
lose
frames 2
report anew.json
window anew.png
close
"#;

/// A second window, later, with the same folder: the view is still there, and a picture surrounds the scene.
const LATER: &str = r#"
open disocclusion
frames 1
report found.json
key D 2
click "view 1"
report again.json
open sky.hdr
frames 2
report sky.json
window sky.png
open /nonexistent/sky.exr
frames 1
report cloudy.json
click "forget views"
report forgotten.json
close
"#;

fn found(name: &str) -> Option<PathBuf> {
    std::env::split_paths(&std::env::var_os("PATH")?).map(|folder| folder.join(name)).find(|path| path.is_file())
}

fn skipped(why: &str) {
    assert!(std::env::var_os(REQUIRE).is_none_or(|v| v != "1"), "{REQUIRE}=1, but {why}");
    println!("SKIPPED: {why} ({REQUIRE}=1 makes this an error)");
}

fn report(folder: &Path, name: &str) -> Value {
    let text = std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    serde_json::from_str(&text).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Mean brightness of the last pane, and how much neighbours differ there.
fn look(folder: &Path, name: &str, of: &Value) -> (f64, f64) {
    let picture = image::open(folder.join(name)).unwrap().into_luma8();
    let area = numbers(&of["marks"]["picture"]);
    let split = numbers(&of["splits"]).last().copied().unwrap_or(0.0);
    let at = |x: f64, y: f64| f64::from(picture.get_pixel(x as u32, y as u32).0[0]);
    let (mut sum, mut steps, mut count) = (0.0, 0.0, 0.0);
    let mut y = area[1] + 24.0;
    while y < area[3].min(f64::from(picture.height())) - 8.0 {
        let mut x = area[0] + split * (area[2] - area[0]) + 6.0;
        while x < area[2] - 8.0 {
            sum += at(x, y);
            // A picture's pixel is four of the window's.
            steps += (at(x, y) - at(x + 4.0, y)).abs();
            count += 1.0;
            x += 4.0;
        }
        y += 4.0;
    }
    (sum / count, steps / count)
}

#[test]
fn the_window_is_opened_clicked_through_and_closed() {
    let Some(xvfb) = found("xvfb-run") else { return skipped("there is no xvfb-run (Debian: xvfb, xauth)") };
    if super::device::device().is_none() {
        return skipped("there is no device");
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("live-window");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let run = |script: &str| {
        std::fs::write(folder.join("script.txt"), script).unwrap();
        let output = Command::new(&xvfb)
            .args(["-a", "-s", "-screen 0 1024x768x24", env!("CARGO_BIN_EXE_quell-live"), "cornell-box"])
            .args(["--window", "320x180", "--device", "llvmpipe", "--out", ".", "--script", "script.txt"])
            .current_dir(&folder)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        (output, said)
    };
    let (output, said) = run(SCRIPT);
    if !output.status.success() && said.contains("no adapter") {
        return skipped("lavapipe cannot show a window here");
    }
    assert!(output.status.success(), "{said}");
    let read = |name: &str| report(&folder, name);

    let begin = read("begin.json");
    assert_eq!(
        (&begin["scene"], &begin["camera"], &begin["error"]),
        (&"cornell-box".into(), &"Path".into(), &Value::Null)
    );
    assert!(begin["frame"].as_i64() >= Some(2));
    // The picture has the light of a lit room, and is no even grey.
    let (light, grain) = look(&folder, "begin.png", &begin);
    println!("begin: light {light:.1}, grain {grain:.1}");
    assert!(light > 40.0 && light < 220.0 && grain > 1.0);

    let chosen = read("chosen.json");
    assert_eq!(chosen["scene"], "disocclusion");
    let refused = read("refused.json");
    assert_eq!(refused["scene"], "disocclusion", "a refused scene keeps the last good one");
    assert!(refused["error"].as_str().unwrap().contains("room.glb: cannot be read"), "{refused}");
    assert!(refused["frame"].as_i64() > chosen["frame"].as_i64(), "and it goes on");

    assert_eq!(numbers(&refused["splits"]), [0.5]);
    let split = read("split.json");
    assert!(numbers(&split["splits"])[0] > 0.6, "{}", split["splits"]);
    assert_eq!(split["error"], Value::Null, "a click closes what was said");
    let (before, after) =
        (&split["settings"]["matte_bilateral.taps"], &read("slider.json")["settings"]["matte_bilateral.taps"]);
    assert_eq!(before, "24");
    assert_ne!(before, after);
    let ablation = read("ablation.json");
    assert_eq!(ablation["ablations"][0], true);
    let (filtered, bare) = (look(&folder, "split.png", &split).1, look(&folder, "ablation.png", &ablation).1);
    println!("grain: {filtered:.1}, without denoising {bare:.1}");
    assert!(bare > 1.3 * filtered);
    let preset = read("preset.json");
    assert_eq!((&preset["ablations"][0], &preset["settings"]["matte_bilateral.taps"]), (&false.into(), &"24".into()));

    let baselines = read("baselines.json");
    assert_eq!(baselines["error"], Value::Null);
    assert_eq!(baselines["panes"], serde_json::json!(["noisy", "a-trous", "SVGF", "quell"]));

    let constants = read("constants.json");
    let of = |report: &Value, name: &str| report["baselines"][name].as_f64().unwrap();
    assert_eq!((of(&baselines, "svgf.sigma_l"), of(&constants, "svgf.sigma_l")), (4.0, 10.0));
    assert!(of(&constants, "atrous.levels") < of(&baselines, "atrous.levels"), "{constants}");
    assert_eq!(constants["error"], Value::Null);

    let (flown, turned, nearer) = (read("flown.json"), read("turned.json"), read("nearer.json"));
    assert_eq!((&flown["camera"], &turned["camera"]), (&"Fly".into(), &"Orbit".into()));
    assert_ne!(flown["eye"], preset["eye"]);
    assert_ne!(turned["forward"], flown["forward"]);
    assert_eq!(nearer["forward"], turned["forward"]);
    assert_ne!(nearer["eye"], turned["eye"]);

    let saved = read("saved.json");
    assert!(saved["said"].as_str().unwrap().ends_with(".exr"), "{saved}");
    let mut written: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with("disocclusion-"))
        .collect();
    written.sort();
    // A recorded path: as many pictures as frames, of other places; then the camera is where it was.
    let (recorded, back) = (read("recorded.json"), read("written.json"));
    let frames = recorded["film"].as_u64().unwrap() as usize;
    let (path, written): (Vec<String>, Vec<String>) = written.into_iter().partition(|name| name.contains("-path-"));
    println!("a path of {frames} frames");
    assert!(frames > 2 && path.len() == frames, "{frames} {path:?}");
    let [first, last] = [&path[0], &path[frames - 1]].map(|name| image::open(folder.join(name)).unwrap().into_luma8());
    assert_ne!(first, last);
    assert_eq!((&back["eye"], &back["error"]), (&recorded["eye"], &Value::Null));
    let of = |extension: &str| written.iter().find(|name| name.ends_with(extension)).expect(extension);
    let picture = image::open(folder.join(of(".png"))).unwrap();
    assert_eq!(numbers(&saved["size"]), [f64::from(picture.width()), f64::from(picture.height())]);
    let planes = quell_frames::read_frame(&folder.join(of(".exr"))).unwrap();
    assert_eq!(planes.frame.size.width, picture.width() as usize);
    assert!(planes.frame.matte.is_some() && planes.frame.motion.is_some() && planes.metadata.scene == "disocclusion");

    // Windows without room keep the last picture.
    assert!(numbers(&read("larger.json")["size"])[0] > numbers(&begin["size"])[0]);
    let end = read("end.json");
    assert_eq!(numbers(&end["size"])[1], numbers(&begin["size"])[1]);
    let (light, _) = look(&folder, "end.png", &end);
    assert!(light > 20.0, "the picture has gone dark: {light}");

    // Another screen: as many pixels a point more, of the same window.
    let screen = read("screen.json");
    assert_eq!((&screen["error"], &screen["scene"]), (&Value::Null, &"disocclusion".into()));
    let width = |report: &Value| numbers(&report["marks"]["picture"])[2];
    assert!(width(&screen) < 0.8 * width(&end), "{} {}", screen["marks"], end["marks"]);

    // A lost device: another window with the same scene, view and choice.
    assert!(said.contains("the device was lost: Destroyed\nopening the window anew"), "{said}");
    let (before, anew) = (read("before.json"), read("anew.json"));
    assert_eq!(anew["scene"], "cornell-box");
    assert_eq!(anew["panes"], serde_json::json!(["noisy", "SVGF", "quell"]));
    for what in ["scene", "panes", "settings", "baselines", "error"] {
        assert_eq!(anew[what], before[what], "{what}");
    }
    assert!(anew["frame"].as_i64() >= Some(1));
    let (light, _) = look(&folder, "anew.png", &anew);
    assert!(light > 40.0, "the picture has gone dark: {light}");

    let sky = std::fs::File::create(folder.join("sky.hdr")).unwrap();
    let blue = [image::Rgb([0.2_f32, 0.4, 3.0]); 32];
    image::codecs::hdr::HdrEncoder::new(sky).encode(&blue, 8, 4).unwrap();
    let (output, said) = run(LATER);
    assert!(output.status.success(), "{said}");
    let (found, again) = (read("found.json"), read("again.json"));
    assert_eq!((&found["views"], &found["environment"]), (&1.into(), &Value::Null));
    for (a, b) in numbers(&again["eye"]).iter().zip(numbers(&nearer["eye"])) {
        assert!((a - b).abs() < 1e-3, "{} {}", again["eye"], nearer["eye"]);
    }
    let sky = read("sky.json");
    assert_eq!((&sky["scene"], &sky["environment"]), (&"disocclusion".into(), &"sky.hdr".into()));
    assert_eq!((&sky["error"], &sky["eye"]), (&Value::Null, &again["eye"]));
    let cloudy = read("cloudy.json");
    assert!(cloudy["error"].as_str().unwrap().starts_with("cannot read /nonexistent/sky.exr"), "{cloudy}");
    assert_eq!(cloudy["environment"], "sky.hdr", "a refused picture keeps the last good one");
    assert_eq!(read("forgotten.json")["views"], 0);
    println!("pictures of the window: {}", folder.display());
}
