//! The corpus of the fuzz target `fuzz/fuzz_targets/exr.rs`, replayed, and its seeds, made by code.

use exr::prelude::*;
use quell_frames::{AdaptOptions, Adapter, Links, MapOptions, map_roles, read_image_from};
use std::io::Cursor;
use std::path::{Path, PathBuf};

fn corpus() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/exr")
}

/// What the fuzz target does; true where the bytes are a file with a picture.
fn try_all(bytes: &[u8]) -> bool {
    let Ok(image) = read_image_from(Cursor::new(bytes), Path::new("fuzz.exr")) else { return false };
    let window = image.full_window();
    let Ok(mappings) = map_roles(&[(String::new(), &image)], &MapOptions::default()) else { return false };
    let mut images = vec![image];
    for mapping in mappings {
        let Ok(adapter) = Adapter::new(mapping, window, &images, None, &AdaptOptions::default()) else { continue };
        let mut links = Links::default();
        let made = adapter.frame(1, &images, &mut links).unwrap();
        adapter.frame(2, &images, &mut links).unwrap();
        let lights: Vec<_> = made.frame.lights.iter().map(|light| light.light.clone()).collect();
        adapter.write_back(&mut images, &made.frame, &lights, made.frame.alpha.as_ref()).unwrap();
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
