//! glTF files on the command line.

use crate::{Folder, err, out, run};
use serde_json::Value;
use std::path::PathBuf;

/// A file with one of everything, from the fuzzer's corpus.
fn rich() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf/rich.glb")
}

#[test]
fn a_file_is_explained_and_rendered_like_a_scene() {
    let folder = Folder::new("gltf");
    std::fs::copy(rich(), folder.0.join("ein Zimmer.glb")).unwrap();
    let output = run(&folder.0, &["explain", "ein Zimmer.glb"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    for expected in
        ["glTF 2.0", "1  meshes that deform", "Cameras (--camera)", "move", "1 channels; plays", "13  frames"]
    {
        assert!(out(&output).contains(expected), "{expected}: {}", out(&output));
    }
    let output = run(&folder.0, &["explain", "ein Zimmer.glb", "--clip", "none", "--json"]);
    let json: Value = serde_json::from_str(&out(&output)).unwrap();
    assert_eq!(json["holds"]["frames"], 64);
    assert_eq!(json["file"]["clips"][0]["plays"], false);

    let small = ["--size", "24x14", "--direct-samples", "1", "--count", "2"];
    for camera in ["1", "orbit", "dolly", "still"] {
        let arguments = [&["render", "ein Zimmer.glb", "-o", camera, "--camera", camera][..], &small].concat();
        let output = run(&folder.0, &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        assert_eq!(folder.files(&format!("{camera}/noisy")).len(), 2, "{camera}");
    }
}

#[test]
fn what_a_file_lacks_is_a_usage_error_and_a_broken_file_is_named() {
    let folder = Folder::new("gltf broken");
    let bytes = std::fs::read(rich()).unwrap();
    std::fs::write(folder.0.join("room.glb"), &bytes).unwrap();
    std::fs::write(folder.0.join("cut.glb"), &bytes[..100]).unwrap();
    for (arguments, status, expected) in [
        (
            &["render", "room.glb", "-o", "x", "--camera", "attic"][..],
            2,
            "camera `attic` does not exist: scene `room` has cameras 1 to 1",
        ),
        (
            &["render", "room.glb", "-o", "x", "--clip", "run"],
            2,
            "room.glb: there is no clip `run`; there are: move, morph",
        ),
        (&["explain", "room.glb", "--scene", "cellar"], 2, "there is no scene `cellar`"),
        (&["render", "cornell-box", "-o", "x", "--clip", "run"], 2, "--clip is for glTF files; `cornell-box` is none"),
        (&["render", "cut.glb", "-o", "x"], 1, "cut.glb: is cut off: the container needs"),
        (&["compare", "missing.glb", "-o", "x"], 1, "missing.glb: cannot be read"),
    ] {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", err(&output));
        assert!(err(&output).contains(expected), "{arguments:?}: {}", err(&output));
    }
}

#[test]
fn a_file_gets_an_exposure_that_changes_pictures_only() {
    let folder = Folder::new("gltf exposure");
    std::fs::copy(rich(), folder.0.join("room.glb")).unwrap();
    let frame = |name: &str, more: &[&str]| {
        let small = ["render", "room.glb", "-o", name, "--size", "24x14", "--direct-samples", "1", "--count", "1"];
        let output = run(&folder.0, &[&small[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let path = quell_frames::frame_path(&folder.0.join(name).join("noisy"), "noisy", 0);
        (quell_frames::read_frame(&path).unwrap(), err(&output))
    };
    let (found, said) = frame("found", &[]);
    let (given, silent) = frame("given", &["--exposure", "0.125"]);
    assert!(said.contains(&format!("room.glb: exposure {} from its brightness", found.metadata.exposure)), "{said}");
    assert!(!silent.contains("from its brightness"), "{silent}");
    assert_eq!(given.metadata.exposure, 0.125);
    assert!(
        found.metadata.exposure > 0.0
            && found.metadata.exposure != given.metadata.exposure
            && found.metadata.exposure != 1.0
    );
    assert_eq!(found.frame.direct.unwrap().data(), given.frame.direct.unwrap().data());
    assert_eq!(found.frame.matte.unwrap().data(), given.frame.matte.unwrap().data());
    let explained = run(&folder.0, &["explain", "room.glb"]);
    assert!(out(&explained).contains("exposure, from the brightness of the first frame"), "{}", out(&explained));
}

#[test]
fn environments_surround_what_is_explained_too() {
    let folder = Folder::new("gltf environment");
    std::fs::copy(rich(), folder.0.join("room.glb")).unwrap();
    for (arguments, status, expected) in [
        (&["explain", "room.glb", "--environment", "none.hdr"][..], 1, "none.hdr"),
        (&["explain", "--environment", "none.hdr"], 2, "--environment is for scenes"),
        (&["bench", "--environment", "none.hdr"], 2, "--environment is for scenes"),
        (&["bench", "--scene", "room.glb", "--environment", "none.hdr"], 1, "none.hdr"),
        (&["compare", "room.glb", "-o", "x", "--environment", "none.hdr"], 1, "none.hdr"),
    ] {
        let output = run(&folder.0, arguments);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", err(&output));
        assert!(err(&output).contains(expected), "{arguments:?}: {}", err(&output));
    }
}
