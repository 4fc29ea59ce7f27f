//! The corpus of the fuzz target `fuzz/fuzz_targets/gltf.rs`, replayed.

use crate::gltf::bad_input::{rich, try_all};
use crate::gltf::file::File;
use std::path::PathBuf;

fn corpus() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf")
}

#[test]
fn the_corpus_does_no_harm() {
    let mut files: Vec<_> = std::fs::read_dir(corpus()).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 2, "the corpus is there");
    for file in files {
        try_all(&std::fs::read(&file).unwrap());
    }
}

/// Makes the seeds of the corpus anew: `cargo test -p quell-trace -- --ignored seeds_of_the_corpus`.
#[test]
#[ignore = "writes into the repository"]
fn seeds_of_the_corpus() {
    std::fs::create_dir_all(corpus()).unwrap();
    for (name, bytes) in [
        ("triangle.glb", File::triangle().glb()),
        ("rich.glb", rich().glb()),
        ("rich.gltf", serde_json::to_vec(&rich().text(Some("data:application/octet-stream;base64,AAAA"))).unwrap()),
    ] {
        std::fs::write(corpus().join(name), bytes).unwrap();
    }
}
