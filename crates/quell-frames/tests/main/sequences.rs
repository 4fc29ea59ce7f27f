//! Frames are found in every spelling, in numeric order; what is missing or double is said.

use crate::Folder;
use quell_frames::sequence::{Sequence, find_sequence};
use std::fs;
use std::path::PathBuf;

fn folder(name: &str, files: &[&str]) -> Folder {
    let folder = Folder::new(name);
    for file in files {
        let path = folder.file(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, b"").unwrap();
    }
    folder
}

fn find(folder: &Folder, inputs: &[&str]) -> Result<Sequence, String> {
    let inputs: Vec<PathBuf> = inputs.iter().map(|i| folder.file(i)).collect();
    find_sequence(&inputs).map_err(|e| e.to_string())
}

fn numbers(sequence: &Sequence) -> Vec<i64> {
    sequence.frames.iter().map(|f| f.number).collect()
}

#[test]
fn folders_patterns_globs_and_files_mean_the_same_frames_in_numeric_order() {
    let files =
        ["a b.0009.exr", "a b.0010.exr", "a b.0011.exr", "a b.-0003.exr", "a b.10000.exr", "note.txt", ".a b.0012.exr"];
    let folder = folder("spellings", &files);
    let expected = [-3, 9, 10, 11, 10000];
    for input in ["", "a b.####.exr", "a b.%04d.exr", "a b.*.exr", "a b.#.exr", "*.exr"] {
        let found = find(&folder, &[input]).unwrap();
        assert_eq!(numbers(&found), expected, "{input}");
        assert_eq!(found.gaps[0], (-2, 8), "{input}");
    }
    let found = find(&folder, &["a b.0011.exr", "a b.0009.exr", "a b.0009.exr"]).unwrap();
    assert_eq!(numbers(&found), [9, 11]);
    assert_eq!(found.gaps, [(10, 10)]);
    assert_eq!(found.frame(11).unwrap().files[0].path, folder.file("a b.0011.exr"));
    assert!(found.frame(10).is_none());
}

#[test]
fn names_of_other_programs_are_understood() {
    for (name, number) in [
        ("Zürich_0042.exr", 42),
        ("frame12.exr", 12),
        ("shot-0007.exr", 7),
        ("shot_v002.1001.exr", 1001),
        ("shot.1001.final.exr", 1001),
        ("0005.exr", 5),
        ("-5.exr", -5),
        ("beauty_4k.exr", 0),
        ("beauty.exr", 0),
    ] {
        let folder = folder("names", &[name]);
        assert_eq!(numbers(&find(&folder, &[""]).unwrap()), [number], "{name}");
        assert_eq!(numbers(&find(&folder, &[name]).unwrap()), [number], "{name}");
    }
    // A name that looks like a pattern and exists means itself.
    let folder = folder("signs", &["shot[1].0001.exr", "shot[1].0002.exr"]);
    assert_eq!(numbers(&find(&folder, &["shot[1].0001.exr"]).unwrap()), [1]);
}

#[test]
fn files_of_one_frame_are_told_by_what_their_names_do_not_share() {
    let passes = |name: &str, files: &[&str]| -> Vec<String> {
        let folder = folder(name, files);
        let mut found: Vec<String> =
            find(&folder, &[""]).unwrap().frames[0].files.iter().map(|f| f.pass.clone()).collect();
        found.sort();
        found
    };
    assert_eq!(
        passes(
            "p1",
            &[
                "n.beauty.1001.exr",
                "n.diffuse_direct.1001.exr",
                "n.N.1001.exr",
                "n.beauty.1002.exr",
                "n.diffuse_direct.1002.exr",
                "n.N.1002.exr"
            ]
        ),
        ["N", "beauty", "diffuse_direct"]
    );
    assert_eq!(
        passes("p2", &["n_diffuse_direct.1001.exr", "n_diffuse_indirect.1001.exr"]),
        ["diffuse_direct", "diffuse_indirect"]
    );
    assert_eq!(passes("p3", &["n.1001.exr", "albedo/n.1001.exr", "N/n.1001.exr"]), ["", "N", "albedo"]);
    assert_eq!(passes("p4", &["hall.hdr.exr", "hall.alb.exr", "hall.nrm.exr"]), ["alb", "hdr", "nrm"]);
    assert_eq!(passes("p5", &["hall.0001.hdr.exr", "hall.0001.alb.exr"]), ["alb", "hdr"]);
    assert_eq!(passes("p6", &["n.1001.exr", "n_albedo.1001.exr"]), ["", "albedo"]);

    let folder = folder("incomplete", &["n.1.exr", "n_albedo.1.exr", "n.2.exr", "n.3.exr", "n_albedo.3.exr"]);
    let found = find(&folder, &[""]).unwrap();
    assert_eq!((numbers(&found), found.gaps), (vec![1, 3], vec![(2, 2)]));
    assert_eq!(found.incomplete, [(2, "albedo".to_owned())]);
}

#[test]
fn nothing_double_and_mixed_are_errors_that_name_files() {
    let folder = folder("errors", &["a.1.exr", "a.0001.exr", "x/one.1.exr", "x/two.1.exr"]);
    fs::create_dir(folder.file("empty")).unwrap();
    for (input, words) in [
        ("empty", &["empty", "no .exr"][..]),
        ("missing.####.exr", &["missing.####.exr", "no file"]),
        ("nowhere/*.exr", &["nowhere"]),
        ("a.#.exr", &["a.1.exr", "a.0001.exr", "frame 1"]),
        ("x", &["one.####.exr", "two.####.exr", "2 sequences"]),
    ] {
        let error = find(&folder, &[input]).unwrap_err();
        assert!(words.iter().all(|word| error.contains(word)), "{input}: {error}");
    }
    assert!(find_sequence(&[]).is_err());
}
