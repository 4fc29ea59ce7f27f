//! `quell doctor` as a user meets it, on sequences that `quell render` made.

use super::{Folder, err, out, run};
use serde_json::Value;
use std::fs;

fn rendered(folder: &Folder) {
    let arguments =
        ["render", "cornell-box", "--size", "64x36", "--direct-samples", "2", "--frames", "1-4", "-o", "frames"];
    let output = run(&folder.0, &[&arguments[..], &["--no-denoise", "-q"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
}

#[test]
fn frames_of_our_own_are_well_and_the_page_shows_them() {
    let folder = Folder::new("doctor");
    rendered(&folder);
    let output = run(&folder.0, &["doctor", "frames/noisy", "-v", "--html", "doctor.html", "--report", "r.json"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", out(&output), err(&output));
    let text = out(&output);
    assert!(text.starts_with("frames 1-4, 64x36, quell"), "{text}");
    assert!(text.contains("0 faults, 0 warnings, 0 notes") && text.contains("good     frames"), "{text}");
    assert!(
        text.trim_end().lines().last().is_some_and(|l| l.starts_with("file://") && l.ends_with("doctor.html")),
        "{text}"
    );
    let page = fs::read_to_string(folder.0.join("doctor.html")).expect("the page");
    assert!(page.contains("data:image/png") && page.contains("The doctor found nothing") && !page.contains("{{"));
    let value: Value =
        serde_json::from_str(&fs::read_to_string(folder.0.join("r.json")).expect("the report")).expect("JSON");
    assert_eq!((&value["format"], &value["worst"]), (&1.into(), &Value::Null));
    assert!(value["passed"].as_array().is_some_and(|p| p.len() > 4));
    // A page of somebody else is not replaced.
    fs::write(folder.0.join("mine.html"), "mine").expect("written");
    let output = run(&folder.0, &["doctor", "frames/noisy", "--html", "mine.html"]);
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
}

#[test]
fn a_fault_is_status_4_and_says_how_to_fix_it() {
    let folder = Folder::new("doctor-fault");
    rendered(&folder);
    fs::copy(folder.0.join("frames/noisy/noisy.0002.exr"), folder.0.join("frames/noisy/noisy.0003.exr"))
        .expect("copied");
    let output = run(&folder.0, &["doctor", "frames/noisy/noisy.####.exr"]);
    assert_eq!(output.status.code(), Some(4), "{}", out(&output));
    let text = out(&output);
    assert!(text.contains("FAULT    frames.repeated") && text.contains("frame 3"), "{text}");
    assert!(text.contains("evidence ") && text.contains("spoils ") && text.contains("fix "), "{text}");
    assert!(text.contains("1 fault, "), "{text}");
    let output = run(&folder.0, &["doctor", "frames/noisy", "--json"]);
    assert_eq!(output.status.code(), Some(4));
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    assert_eq!(value["worst"], "fault");
    let finding = &value["findings"][0];
    assert_eq!((&finding["check"], &finding["frame"]), (&"frames.repeated".into(), &3.into()));
    for key in ["severity", "channel", "what", "evidence", "figures", "spoils", "remedy", "layer"] {
        assert!(!finding[key].is_null(), "{key}");
    }
    let ignored = run(&folder.0, &["doctor", "frames/noisy", "--ignore", "frames.repeated"]);
    assert_eq!(ignored.status.code(), Some(0), "{}", out(&ignored));
    for (arguments, status, expected) in [
        (&["doctor", "frames/noisy", "--ignore", "everything"][..], 2, "motion.sign"),
        (&["doctor", "nowhere.####.exr"], 1, "nowhere"),
        (&["doctor", "frames/noisy", "--motion", "sideways"], 1, "blender"),
        (&["doctor", "frames/noisy", "--map", "albedo=none-such"], 1, "none-such"),
        (&["doctor"], 2, "IN"),
    ] {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", err(&output));
        assert!(err(&output).contains(expected), "{arguments:?}: {}", err(&output));
    }
}
