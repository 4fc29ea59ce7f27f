//! One test binary.

mod adapt;
mod aov;
mod doctor;
mod driver;
mod frames;
mod layouts;
mod made;
mod replay;
mod rewrite;
mod roles;
mod sequences;
mod stream;

use std::fs;
use std::path::PathBuf;

/// A folder that is removed at the end of its test.
pub struct Folder(pub PathBuf);

impl Folder {
    /// Makes it, empty.
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("quell-frames-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A path in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// What lies in it, sorted.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(&self.0).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The frames of other renderers, where this machine has them beside the repository.
pub fn shared_frames() -> Option<PathBuf> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let places = [root.join("../shared/frames"), root.join("shared/frames")];
    let found = places.into_iter().find(|place| place.join("exr_aov/expect.json").is_file());
    if found.is_none() {
        println!("skipped: ../shared/frames is not there");
    }
    found
}
