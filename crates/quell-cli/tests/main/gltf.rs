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
