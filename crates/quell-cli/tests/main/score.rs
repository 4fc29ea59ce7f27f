//! `quell score`: frames that anything made against references.

use crate::{Folder, err, out, run};
use serde_json::Value;
use std::path::Path;

/// Frames of a flat picture with some texture, as quell's files: `stem.0001.exr` and so on.
#[derive(Clone, Copy)]
struct Made<'a> {
    folder: &'a Path,
    stem: &'a str,
    size: quell::Size,
    /// First and last.
    numbers: (i64, i64),
    /// Multiplies all light.
    factor: f32,
    /// Relative amplitude of grain that differs from frame to frame and from half to half.
    grain: f32,
    halves: bool,
}

impl Made<'_> {
    fn write(&self) {
        let camera = quell::Camera::perspective([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 1.5);
        for number in self.numbers.0..=self.numbers.1 {
            let picture = |seed: u64| {
                quell::Plane::from_fn(self.size, |x, y| {
                    let texture = 0.4 + 0.1 * ((x * 7 + y * 13) % 5) as f32;
                    let mut bits = (seed << 40) ^ ((number as u64) << 24) ^ (y * self.size.width + x) as u64;
                    bits = bits.wrapping_mul(0x9e37_79b9_7f4a_7c15);
                    bits = (bits ^ (bits >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                    let grain = ((bits >> 40) as f32 / (1u64 << 24) as f32 - 0.5) * self.grain;
                    [self.factor * texture * (1.0 + grain); 3]
                })
            };
            let [a, b, all] = [1, 2, 3].map(picture);
            let mut frame = quell::FrameBuf::new(self.size, camera);
            frame.index = number;
            frame.view_depth = Some(quell::Plane::filled(self.size, 2.0));
            frame.normal = Some(quell::Plane::filled(self.size, [0.0, 0.0, 1.0]));
            frame.motion = Some(quell::Plane::filled(self.size, [0.0; 2]));
            let mut file = quell_frames::FrameToWrite::new(frame.frame(&[]));
            file.composite = Some(all.view());
            if self.halves {
                file.halves[0].composite = Some(a.view());
                file.halves[1].composite = Some(b.view());
            }
            let path = quell_frames::frame_path(self.folder, self.stem, number);
            quell_frames::write_frame(&path, &file, &quell_frames::WriteOptions::default()).expect("written");
        }
    }
}

#[test]
fn score_measures_frames_of_any_name_and_says_what_limits_the_figures() {
    let folder = Folder::new("score");
    let size = quell::Size::new(48, 32);
    let result = folder.0.join("mine");
    let reference = folder.0.join("out/reference");
    let made =
        Made { folder: &result, stem: "my.beauty", size, numbers: (1, 9), factor: 1.0, grain: 0.5, halves: false };
    made.write();
    Made { folder: &reference, stem: "reference", grain: 0.02, halves: true, ..made }.write();

    let output = run(&folder.0, &["score", "mine", "--reference", "out", "--json", "-q", "--report", "r.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let value: Value = serde_json::from_str(&out(&output)).expect("JSON");
    assert_eq!(std::fs::read_to_string(folder.0.join("r.json")).expect("the report"), out(&output));
    assert_eq!(value["metrics"][0]["method"], "mine");
    assert_eq!(value["scored"]["frames"].as_array().expect("a list").len(), 6);
    for name in ["rel_mse", "ssim", "ldr_flip", "hdr_flip", "energy", "fireflies"] {
        assert!(value["metrics"][0]["mean"][name].is_number(), "{name}");
    }
    for name in quell_lab::scorecard::Scores::NAMES {
        let score = &value["scorecard"][name];
        assert!(score["value"].is_number() != score["reason"].is_string(), "{name}: {score}");
    }
    assert!(value["scorecard"]["noise"]["value"].as_f64().expect("a number") > 0.004);
    let warnings = value["warnings"].to_string();
    assert!(warnings.contains("Nothing moves") && warnings.contains("from their halves"), "{warnings}");

    // The same without halves: floors. Brighter: another exposure. Fewer, with a gap: the longest run.
    let text = |arguments: &[&str]| {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        out(&output)
    };
    let single = folder.0.join("single");
    Made { folder: &single, stem: "r", grain: 0.02, factor: 0.4, ..made }.write();
    let found = text(&["score", "mine", "--reference", "single"]);
    assert!(found.contains("no halves") && found.contains("floor") && found.contains("2.5"), "{found}");
    std::fs::remove_file(single.join("r.0003.exr")).expect("removed");
    let found = text(&["score", "mine", "--reference", "single", "--warm-up", "0", "--name", "ours"]);
    assert!(found.contains("4 to 9") && found.contains("8 frames have a result") && found.contains("ours"), "{found}");
    let found = text(&["score", "mine", "--reference", "out", "--frames", "2-3", "--guides", "out/reference"]);
    assert!(found.contains("2 frames: ghosting looks back"), "{found}");
    // References as noisy as the result.
    Made { folder: &folder.0.join("noisy"), stem: "r", halves: true, ..made }.write();
    let found = text(&["score", "mine", "--reference", "noisy"]);
    assert!(found.contains("The references are noisy"), "{found}");
}

#[test]
fn score_names_what_does_not_fit() {
    let folder = Folder::new("score errors");
    let size = quell::Size::new(12, 8);
    let [mine, small, late, two] = ["mine", "small", "late", "two"].map(|name| folder.0.join(name));
    let made = Made { folder: &mine, stem: "a", size, numbers: (1, 2), factor: 1.0, grain: 0.0, halves: false };
    made.write();
    Made { folder: &small, size: quell::Size::new(6, 4), numbers: (1, 2), ..made }.write();
    Made { folder: &late, numbers: (8, 9), ..made }.write();
    Made { folder: &two, numbers: (1, 1), ..made }.write();
    Made { folder: &two, stem: "b", numbers: (1, 1), ..made }.write();
    std::fs::create_dir_all(folder.0.join("empty")).expect("made");
    std::fs::create_dir_all(folder.0.join("broken")).expect("made");
    std::fs::write(folder.0.join("broken/x.0001.exr"), "no EXR").expect("written");
    let cases: [(&[&str], i32, &[&str]); 8] = [
        (&["score", "mine"], 2, &["--reference"]),
        (&["score", "mine", "--reference", "small"], 1, &["a.0001.exr is 12x8", "6x4"]),
        (&["score", "mine", "--reference", "late"], 1, &["no frame has a reference", "1 to 2", "8 to 9"]),
        (&["score", "mine", "--reference", "two"], 1, &["two holds several sequences (a, b)"]),
        (&["score", "mine", "--reference", "empty"], 1, &["empty holds no frames"]),
        (&["score", "mine", "--reference", "missing"], 1, &["missing"]),
        (&["score", "mine", "--reference", "broken"], 1, &["broken", "x.0001.exr"]),
        (&["score", "mine", "--reference", "mine", "--warm-up", "2"], 2, &["--warm-up 2"]),
    ];
    for (arguments, status, expected) in cases {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", err(&output));
        for words in expected {
            assert!(err(&output).contains(words), "{arguments:?}: {}", err(&output));
        }
    }
    let output = run(&folder.0, &["score", "mine", "--reference", "mine", "--guides", "late"]);
    assert!(err(&output).contains("late holds no guides of frame 1"), "{}", err(&output));
}
