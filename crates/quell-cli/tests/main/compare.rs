//! `quell compare`: figures, page, files, resuming, methods of others, bad input.

use crate::{Folder, err, out, quell, run};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// The smallest comparison that has everything.
const SMALL: [&str; 11] = [
    "compare",
    "cornell-box",
    "--size",
    "48x27",
    "--direct-samples",
    "2",
    "--count",
    "4",
    "--reference-spp",
    "4",
    "-q",
];

fn compare(folder: &Folder, place: &str, more: &[&str]) -> std::process::Output {
    let mut arguments = SMALL.to_vec();
    arguments.extend(["-o", place]);
    arguments.extend(more);
    run(&folder.0, &arguments)
}

fn report(folder: &Folder, place: &str) -> Value {
    let text = std::fs::read_to_string(folder.0.join(place).join("report.json")).expect("the report");
    serde_json::from_str(&text).expect("JSON")
}

/// The entry of a method.
fn entry<'v>(report: &'v Value, name: &str) -> &'v Value {
    let methods = report["methods"].as_array().expect("a list");
    methods.iter().find(|m| m["method"] == name).unwrap_or_else(|| panic!("no {name}"))
}

#[test]
fn every_output_holds_every_method_and_the_same_command_resumes() {
    let folder = Folder::new("compare");
    let copying = "mine=cp {noisy}/* {out}";
    let more = [
        "--spp",
        "2",
        "--methods",
        "none,quell:paper,quell:paper+no-spatial",
        "--methods",
        copying,
        "--methods",
        "bad=echo something is wrong; exit 7 # {out}",
        "--methods",
        "gone=nowhere",
        "--crop",
        "8,4,16,12",
    ];
    let output = compare(&folder, "out", &more);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let text = out(&output);
    for expected in ["quell:paper+no-spatial", "HDR-FLIP", "MiB", "of paper's", "- bad: the command ended", "Scored: "]
    {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    assert!(text.lines().last().expect("a line").ends_with("out/index.html"), "{text}");

    let first = report(&folder, "out");
    assert!(first["warnings"].to_string().contains("something is wrong"), "{}", first["warnings"]);
    assert!(entry(&first, "gone")["reason"].as_str().expect("a reason").contains("nowhere"));
    let paper = entry(&first, "quell:paper");
    assert_eq!(paper["time_ratio"], 1.0);
    assert!(paper["milliseconds"]["median"].as_f64().expect("a time") > 0.0);
    // It keeps at least the pictures of its history.
    assert!(paper["peak_bytes"].as_u64().expect("bytes") > 48 * 27 * 12, "{}", paper["peak_bytes"]);
    assert!(paper["scorecard"]["noise"].is_object());
    assert_eq!(first["metrics"].as_array().expect("a list").len(), 4);
    // A command that copies its input is the noisy input: the same errors but for half float.
    let error = |name: &str| entry(&first, name)["mean"]["hdr_flip"].as_f64().expect("a figure");
    assert!((error("mine") - error("none")).abs() < 1e-3, "{} {}", error("mine"), error("none"));
    assert!(error("quell:paper") < error("none"));

    let csv = std::fs::read_to_string(folder.0.join("out/scores.csv")).expect("the table");
    assert_eq!(csv.lines().count(), 7);
    let page = std::fs::read_to_string(folder.0.join("out/index.html")).expect("the page");
    assert!(page.contains("quell:paper+no-spatial") && page.len() < 40_000_000);
    let crops = folder.files("out/crops");
    assert_eq!(crops.len(), 9, "{crops:?}");
    assert!(crops.contains(&"quell_paper.0003.x8y4.flip.png".to_owned()), "{crops:?}");

    // Again: nothing is rendered or run anew, and the figures are the same.
    let changed = |path: &str| std::fs::metadata(folder.0.join(path)).expect("a file").modified().expect("a time");
    let files = ["out/noisy/noisy.0002.exr", "out/methods/quell_paper/picture.0003.exr", "out/methods/mine/log.txt"];
    let before = files.map(changed);
    let mut again = more.to_vec();
    again.extend(["--format", "csv"]);
    let output = compare(&folder, "out", &again);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!(files.map(changed), before);
    assert_eq!(out(&output), csv);
    let second = report(&folder, "out");
    assert_eq!(entry(&second, "quell:paper")["resumed"], true);
    // A method that another build, or a killed one, left unfinished is run once more.
    std::fs::remove_file(folder.0.join("out/methods/quell_paper/done.json")).expect("removed");
    let output = compare(&folder, "out", &["--spp", "2", "--methods", "quell:paper", "--format", "latex"]);
    assert!(out(&output).contains("\\begin{tabular}"), "{}", out(&output));
    let third = report(&folder, "out");
    assert_eq!(entry(&third, "quell:paper")["resumed"], false);
    assert_eq!(entry(&third, "quell:paper")["mean"], entry(&second, "quell:paper")["mean"]);
}

#[test]
fn several_seeds_have_intervals_and_share_references() {
    let folder = Folder::new("compare seeds");
    let more = ["--seeds", "3", "--seed", "5", "--methods", "none,quell:paper", "--frames", "2-3"];
    let count = SMALL.iter().position(|a| *a == "--count").expect("--count and its value");
    let mut arguments = [&SMALL[..count], &SMALL[count + 2..]].concat();
    arguments.extend(["-o", "out"]);
    arguments.extend(more);
    let output = run(&folder.0, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(out(&output).contains('±') && out(&output).contains("3 seeds from 5"), "{}", out(&output));
    let report = report(&folder, "out");
    let interval = &entry(&report, "none")["intervals"]["rel_mse_trimmed"];
    assert_eq!(interval["seeds"], 3);
    assert!(interval["half_width"].as_f64().expect("a width") > 0.0);
    assert_eq!(folder.files("out/seed-7/noisy").len(), 2);
    // Two frames, two halves: references of one seed only.
    let places = folder.files("cache/references");
    assert_eq!(places.len(), 1, "{places:?}");
    assert_eq!(folder.files(&format!("cache/references/{}", places[0])).len(), 4);
}

#[test]
fn a_folder_of_frames_is_compared() {
    let folder = Folder::new("compare folder");
    let mut render = crate::SMALL.to_vec();
    render.extend(["-o", "frames", "--frames", "3-5", "--reference", "4", "--reference-frames", "4-5", "--no-denoise"]);
    assert_eq!(run(&folder.0, &render).status.code(), Some(0));
    let output = run(&folder.0, &["compare", "frames", "-o", "out", "--methods", "none,quell:paper", "-q"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(out(&output).contains("Scored: frames 4 to 5 of frames 3 to 5"), "{}", out(&output));
    // Finished frames of somebody.
    let output = run(
        &folder.0,
        &["compare", "frames", "-o", "out", "--methods", "none,ours=frames/noisy,few=frames/reference", "-q"],
    );
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let both = report(&folder, "out");
    assert_eq!(entry(&both, "ours")["milliseconds"], Value::Null);
    let difference = |name: &str| entry(&both, name)["mean"]["psnr"].as_f64().expect("a figure");
    assert!((difference("ours") - difference("none")).abs() < 0.01);
    assert!(entry(&both, "few")["reason"].as_str().expect("a reason").contains("no frame 3"));

    let output = run(&folder.0, &["compare", "frames/noisy", "-o", "out", "-q"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).contains("quell render --reference"), "{}", err(&output));
}

#[test]
fn slips_are_named_before_anything_is_rendered() {
    let folder = Folder::new("compare usage");
    let cases: [(&[&str], &str); 10] = [
        (&["--methods", "none,quell:papr"], "paper"),
        (&["--methods", "nnone"], "did you mean none"),
        (&["--methods", "none,none"], "twice"),
        (&["--methods", "quell:paper+matte_temporal.alhpa=1"], "matte_temporal.alpha"),
        (&["--methods", "mine=tool {noisy}"], "{out}"),
        (&["--crop", "40,20,16,16"], "beyond the picture of 48x27"),
        (&["--format", "html"], "text, csv, latex"),
        (&["--reference-frames", "9"], "frame 9"),
        (&["--set", "firefly.enabled=off"], "quell:paper+stage.parameter=value"),
        (&["--reference", "there"], "--reference-spp"),
    ];
    for (more, expected) in cases {
        let output = compare(&folder, "out", more);
        assert!(matches!(output.status.code(), Some(1 | 2)), "{more:?}: {}", err(&output));
        assert!(err(&output).contains(expected), "{more:?}: {}", err(&output));
    }
    let output = run(&folder.0, &["compare", "glossy-rom", "-o", "out"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("glossy-room") && err(&output).contains("folder"), "{}", err(&output));
    assert!(folder.files("").is_empty(), "{:?}", folder.files(""));
}

/// Whatever is asked for, there is a table or a message.
#[test]
fn extremes_end_with_a_table() {
    let folder = Folder::new("compare extremes");
    let cases: [&[&str]; 4] = [
        &["--size", "1x1"],
        &["--size", "37x1", "--spp", "3"],
        &["--size", "5x3", "--exposure", "1e-30"],
        &["--size", "9x7", "--reference-frames", "1,3"],
    ];
    for (i, case) in cases.iter().enumerate() {
        let place = format!("out{i}");
        let mut arguments: Vec<&str> = SMALL.iter().copied().filter(|a| !["--size", "48x27"].contains(a)).collect();
        arguments.extend(["-o", &place, "--methods", "none,quell:paper"]);
        arguments.extend(*case);
        let output = run(&folder.0, &arguments);
        assert!(!err(&output).contains("panicked"), "{case:?}: {}", err(&output));
        assert_eq!(output.status.code(), Some(0), "{case:?}: {}", err(&output));
    }
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_whole_files_and_says_how_to_go_on() {
    let folder = Folder::new("compare interrupt");
    let more = ["--methods", "none", "--methods", "slow=sleep 600 # {out}"];
    let mut arguments = SMALL.to_vec();
    arguments.extend(["-o", "out"]);
    arguments.extend(more);
    let mut child = quell(&folder.0)
        .args(&arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let deadline = std::time::Instant::now() + std::time::Duration::from_secs(120);
    let log = folder.0.join("out/methods/slow/log.txt");
    while !log.is_file() {
        assert!(std::time::Instant::now() < deadline, "it never came so far");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs").success());
    let status = child.wait().expect("it ends");
    let output = child.wait_with_output().expect("its output");
    assert_eq!(status.code(), Some(130), "{}", err(&output));
    assert!(err(&output).contains("1 of 2 methods") && err(&output).contains("goes on from here"), "{}", err(&output));
    let everything = walk(&folder.0.join("out"));
    assert!(everything.iter().all(|f| !f.ends_with(".part")), "{everything:?}");
    for file in everything.iter().filter(|f| f.ends_with(".exr")) {
        quell_frames::read_picture(Path::new(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
    }
    assert!(folder.0.join("out/methods/none/done.json").is_file());
}

fn walk(folder: &Path) -> Vec<String> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() { files.extend(walk(&path)) } else { files.push(path.to_string_lossy().into_owned()) }
    }
    files
}
