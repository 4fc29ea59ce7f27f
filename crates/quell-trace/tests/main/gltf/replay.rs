//! The corpus of the fuzz target `fuzz/fuzz_targets/gltf.rs`, replayed.

use crate::gltf::bad_input::{rich, try_all};
use crate::gltf::file::File;
use serde_json::Value;
use std::path::PathBuf;
use std::time::{Duration, Instant};

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

/// Mutates the seeds for `QUELL_FUZZ_SECONDS` (10 unless set), bytes and JSON values alike, where no fuzzer is at hand:
/// `cargo test --release -p quell-trace --test main -- --ignored mutations_do_no_harm --nocapture`.
#[test]
#[ignore = "runs for as long as it is told to"]
fn mutations_do_no_harm() {
    let seconds = std::env::var("QUELL_FUZZ_SECONDS").ok().and_then(|s| s.parse().ok()).unwrap_or(10);
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut random = Random(0x9e37_79b9_7f4a_7c15 ^ seconds);
    let (mut runs, mut loaded, mut longest) = (0_u64, 0_u64, Duration::ZERO);
    while Instant::now() < end {
        let mut file = if random.below(4) == 0 { File::triangle() } else { rich() };
        for _ in 0..random.below(4) {
            mutate_json(&mut file.json, &mut random);
        }
        let mut bytes = file.glb();
        for _ in 0..random.below(4) {
            let at = random.below(bytes.len());
            match random.below(3) {
                0 => bytes[at] ^= 1 << random.below(8),
                1 => bytes[at] = random.below(256) as u8,
                _ => {
                    let word = [0, 1, 0x7f80_0000, 0x7fc0_0000, 0xff80_0000, u32::MAX, 0x7fff_ffff, 0x7f7f_ffff];
                    let word = word[random.below(word.len())].to_le_bytes();
                    let end = (at + 4).min(bytes.len());
                    bytes[at..end].copy_from_slice(&word[..end - at]);
                }
            }
        }
        let begin = Instant::now();
        let Ok(harmless) = std::panic::catch_unwind(|| try_all(&bytes)) else {
            let found = std::env::temp_dir().join("quell-mutation.glb");
            std::fs::write(&found, &bytes).unwrap();
            panic!("run {runs} panicked; its file is {}", found.display());
        };
        loaded += u64::from(harmless);
        longest = longest.max(begin.elapsed());
        runs += 1;
    }
    eprintln!("{runs} files in {seconds} s, {loaded} of them loaded; the slowest took {longest:?}");
    assert!(longest < Duration::from_secs(20), "{longest:?}");
    assert!(loaded > 0);
}

/// A small generator: variety, not quality.
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % count.max(1)
    }
}

/// Replaces, removes or doubles one value somewhere.
fn mutate_json(json: &mut Value, random: &mut Random) {
    let mut value = json;
    for depth in 0.. {
        let count = match value {
            Value::Object(fields) => fields.len(),
            Value::Array(items) => items.len(),
            _ => 0,
        };
        if count == 0 || (depth > 0 && random.below(8) == 0) {
            break;
        }
        let index = random.below(count);
        let list_operation = random.below(12);
        match value {
            Value::Array(items) if list_operation == 0 => {
                items.remove(index);
                return;
            }
            Value::Array(items) if list_operation == 1 => {
                let item = items[index].clone();
                items.push(item);
                return;
            }
            Value::Object(fields) if list_operation == 0 => {
                let name = fields.keys().nth(index).cloned().unwrap_or_default();
                fields.remove(&name);
                return;
            }
            _ => {}
        }
        value = match value {
            Value::Array(items) => &mut items[index],
            Value::Object(fields) => fields.values_mut().nth(index).unwrap(),
            _ => return,
        };
    }
    let number = [0.0, 1.0, 2.0, 3.0, 5.0, -1.0, 1e9, 1e-40, 1e38, 1e39, 1e300, 5121.0, 5123.0, 5125.0, 0.5, -1e20];
    *value = match random.below(6) {
        0 => Value::from(u64::MAX),
        1 => Value::from(random.below(12)),
        2 => Value::from(random.below(70_000)),
        3 => ["", "VEC2", "VEC4", "SCALAR", "BLEND", "STEP", "CUBICSPLINE", "spot", "scale"][random.below(9)].into(),
        _ => Value::from(number[random.below(number.len())]),
    };
}
