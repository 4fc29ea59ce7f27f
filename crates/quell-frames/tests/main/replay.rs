//! The corpus of the fuzz target `fuzz/fuzz_targets/exr.rs`, replayed, and its seeds, made by code.

use exr::prelude::*;
use quell_frames::{AdaptOptions, Adapter, Links, MapOptions, map_roles, read_image_from};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

fn corpus() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/exr")
}

/// What the fuzz target does; true where the bytes are a file with a picture.
fn try_all(bytes: &[u8]) -> bool {
    let Ok(image) = read_image_from(Cursor::new(bytes), Path::new("fuzz.exr")) else { return false };
    let window = image.full_window();
    if window.size.pixels() > 1 << 16 {
        return true;
    }
    let Ok(mappings) = map_roles(&[(String::new(), &image)], &MapOptions::default()) else { return false };
    let mut images = vec![image];
    for mapping in mappings {
        let Ok(adapter) = Adapter::new(mapping, window, &images, None, &AdaptOptions::default()) else { continue };
        let mut links = Links::default();
        let Ok(made) = adapter.frame(1, &images, &mut links) else { continue };
        let _ = adapter.frame(2, &images, &mut links);
        let lights: Vec<_> = made.frame.lights.iter().map(|light| light.light.clone()).collect();
        let _ = adapter.write_back(&mut images, &made.frame, &lights, made.frame.alpha.as_ref());
    }
    true
}

#[test]
fn the_corpus_does_no_harm() {
    let mut files: Vec<_> = std::fs::read_dir(corpus()).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 10, "the corpus is there");
    let mut whole = 0;
    for file in files {
        let bytes = std::fs::read(&file).unwrap();
        whole += usize::from(try_all(&bytes));
        for at in (0..bytes.len()).step_by(7) {
            let mut changed = bytes.clone();
            changed[at] ^= 1 << (at % 8);
            let _ = read_image_from(Cursor::new(&changed), Path::new("fuzz.exr"));
        }
    }
    assert!(whole >= 10, "{whole}");
}

/// Makes the seeds of the corpus anew: `cargo test -p quell-frames -- --ignored seeds_of_the_corpus`.
#[test]
#[ignore = "writes into the repository"]
fn seeds_of_the_corpus() {
    std::fs::create_dir_all(corpus()).unwrap();
    let scan = Blocks::ScanLines;
    for (name, compression, blocks, float) in [
        ("none", Compression::Uncompressed, scan, false),
        ("rle", Compression::RLE, scan, false),
        ("zips", Compression::ZIP1, scan, true),
        ("zip-tiles", Compression::ZIP16, Blocks::Tiles(Vec2(4, 3)), true),
        ("piz", Compression::PIZ, scan, false),
        ("pxr24", Compression::PXR24, scan, true),
        ("b44", Compression::B44, scan, false),
        ("b44a-tiles", Compression::B44A, Blocks::Tiles(Vec2(4, 4)), false),
        ("dwaa", Compression::DWAA(None), scan, false),
        ("dwab", Compression::DWAB(None), scan, true),
    ] {
        let names = ["R", "G", "B", "A", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "Z"];
        let layer = part("", &names, compression, blocks, float);
        Image::from_layer(layer).write().non_parallel().to_file(corpus().join(format!("{name}.exr"))).unwrap();
    }
    let zip = Compression::ZIP1;
    let blender = |pass: &str, components: &[&str]| {
        let names: Vec<String> = components.iter().map(|c| format!("L.{pass}.{c}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        part(&format!("L.{pass}"), &names, zip, scan, pass == "Position")
    };
    let rgb: &[&str] = &["R", "G", "B"];
    let parts = vec![
        blender("Combined", &["R", "G", "B", "A"]),
        blender("DiffDir", rgb),
        blender("DiffCol", rgb),
        blender("Position", &["X", "Y", "Z"]),
        blender("Vector", &["X", "Y", "Z", "W"]),
        blender("Combined_key", rgb),
        part("id", &["id"], zip, Blocks::Tiles(Vec2(5, 5)), true),
    ];
    let image = Image::from_layers(ImageAttributes::with_size((9, 7)), parts);
    image.write().non_parallel().to_file(corpus().join("parts.exr")).unwrap();
}

/// Mutates the corpus for `QUELL_FUZZ_SECONDS` (10 unless set), where no fuzzer is at hand:
/// `cargo test -p quell-frames --test main -- --ignored mutations_do_no_harm --nocapture`.
#[test]
#[ignore = "runs for as long as it is told to"]
fn mutations_do_no_harm() {
    let seconds = std::env::var("QUELL_FUZZ_SECONDS").ok().and_then(|s| s.parse().ok()).unwrap_or(10);
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut files: Vec<_> = std::fs::read_dir(corpus()).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    let seeds: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).unwrap()).collect();
    // Panics inside the crate `exr` are caught where quell calls it, and said by nobody; ours end the test.
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic.location().is_some_and(|place| place.file().contains("/exr-1.")) {
            report(panic);
        }
    }));
    let mut state = 0x9e37_79b9_7f4a_7c15_u64 ^ seconds;
    let mut below = move |limit: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % limit.max(1) as u64) as usize
    };
    let (mut runs, mut whole, mut longest) = (0_u64, 0_u64, Duration::ZERO);
    while Instant::now() < end {
        let mut bytes = seeds[below(seeds.len())].clone();
        for _ in 0..1 + below(4) {
            let at = below(bytes.len());
            match below(6) {
                0 => bytes[at] ^= 1 << below(8),
                1 => bytes[at] = below(256) as u8,
                2 => bytes.truncate(at.max(8)),
                3 => {
                    let other = &seeds[below(seeds.len())];
                    let from = below(other.len());
                    let count = below(64).min(other.len() - from);
                    let to = (at + count).min(bytes.len());
                    bytes.splice(at..to, other[from..from + count].iter().copied());
                }
                _ => {
                    let words = [0, 1, 8, 0x7f, 0xff, 0x7f80_0000, 0x7fc0_0000, u32::MAX, 0x7fff_ffff, 0x0001_0000];
                    let word = words[below(words.len())].to_le_bytes();
                    let to = (at + 4).min(bytes.len());
                    bytes[at..to].copy_from_slice(&word[..to - at]);
                }
            }
        }
        let begin = Instant::now();
        let Ok(read) = std::panic::catch_unwind(|| try_all(&bytes)) else {
            let found = std::env::temp_dir().join("quell-mutation.exr");
            std::fs::write(&found, &bytes).unwrap();
            panic!("run {runs} panicked; its file is {}", found.display());
        };
        whole += u64::from(read);
        longest = longest.max(begin.elapsed());
        runs += 1;
    }
    eprintln!("{runs} files in {seconds} s, {whole} of them read; the slowest took {longest:?}");
    assert!(longest < Duration::from_secs(20), "{longest:?}");
    assert!(whole > 0);
}

fn part(
    name: &str,
    names: &[&str],
    compression: Compression,
    blocks: Blocks,
    float: bool,
) -> Layer<AnyChannels<FlatSamples>> {
    let channels: Vec<AnyChannel<FlatSamples>> = names
        .iter()
        .enumerate()
        .map(|(k, name)| {
            let value = |i: usize| ((i * 37 + k * 11) % 23) as f32 / 7.0;
            let samples = if float {
                FlatSamples::F32((0..63).map(value).collect())
            } else {
                FlatSamples::F16((0..63).map(|i| f16::from_f32(value(i))).collect())
            };
            AnyChannel::new(*name, samples)
        })
        .collect();
    let attributes = if name.is_empty() { LayerAttributes::default() } else { LayerAttributes::named(name) };
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    Layer::new((9, 7), attributes, encoding, AnyChannels::sort(channels.into()))
}
