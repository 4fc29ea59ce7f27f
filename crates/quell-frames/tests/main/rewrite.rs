//! Images are written back with everything that was not replaced as it was; bad files are errors that name what is bad.

use crate::aov::expectations;
use crate::{Folder, shared_frames};
use quell_frames::{
    Error, ExrImage, ImageWriteOptions, SampleKind, Samples, read_headers, read_image, read_image_from,
};
use std::fs;
use std::io::Cursor;
use std::path::Path;
use std::process::Command;

fn bits(samples: &Samples) -> Vec<u32> {
    match samples {
        Samples::Half(v) => v.iter().map(|v| u32::from(v.to_bits())).collect(),
        Samples::Float(v) => v.iter().map(|v| v.to_bits()).collect(),
        Samples::Uint(v) => v.clone(),
    }
}

fn same(a: &ExrImage, b: &ExrImage, name: &str) {
    assert_eq!(a.display_window(), b.display_window(), "{name}");
    assert_eq!(a.pixel_aspect(), b.pixel_aspect(), "{name}");
    assert_eq!(a.parts().len(), b.parts().len(), "{name}");
    for (a, b) in a.parts().iter().zip(b.parts()) {
        assert_eq!((a.name(), a.view(), a.data_window()), (b.name(), b.view(), b.data_window()), "{name}");
        assert_eq!((a.tiles(), a.bottom_up()), (b.tiles(), b.bottom_up()), "{name}");
        let other: Vec<_> = b.attributes().into_iter().filter(|(name, _)| !name.starts_with("quell.")).collect();
        let ours: Vec<_> = a.attributes().into_iter().filter(|(name, _)| !name.starts_with("quell.")).collect();
        assert_eq!(ours, other, "{name}");
        assert_eq!(a.channels().len(), b.channels().len(), "{name}");
        for (a, b) in a.channels().iter().zip(b.channels()) {
            assert_eq!((a.name(), a.kind()), (b.name(), b.kind()), "{name}");
            assert!(bits(a.samples().unwrap()) == bits(b.samples().unwrap()), "{name} {}", a.name());
        }
    }
}

#[test]
fn every_file_survives_reading_and_writing() {
    let Some(frames) = shared_frames() else { return };
    let folder = Folder::new("rewrite");
    let mut written = Vec::new();
    for name in expectations(&frames).keys() {
        let path = frames.join("exr_aov").join(name);
        let before = read_image(&path).unwrap();

        // Nothing replaced: blocks are copied, so even lossy compressions keep every bit.
        let copy = folder.file(&format!("copy-{}", name.replace('/', "-")));
        let mut image = read_headers(&path).unwrap();
        image.set_text("quell.version", "test").unwrap();
        let report = image.write(&copy, &ImageWriteOptions::default()).unwrap();
        assert!(report.notes.is_empty(), "{name}: {:?}", report.notes);
        let after = read_image(&copy).unwrap();
        same(&before, &after, name);
        for (a, b) in before.parts().iter().zip(after.parts()) {
            assert_eq!(a.compression(), b.compression(), "{name}");
        }
        assert_eq!(after.text("quell.version").as_deref(), Some("test"));

        // One channel of every part replaced: parts are encoded anew, without loss.
        let anew = folder.file(&format!("anew-{}", name.replace('/', "-")));
        let mut image = read_headers(&path).unwrap();
        for p in 0..image.parts().len() {
            image.replace(p, 0, before.samples(p, 0).unwrap().clone()).unwrap();
        }
        image.set_text("quell.version", "test").unwrap();
        image.write(&anew, &ImageWriteOptions::default()).unwrap();
        same(&before, &read_image(&anew).unwrap(), name);
        written.extend([copy, anew]);
    }
    read_back_with_openexr(&frames, &written);
}

/// The reference library reads the same numbers from what was written as from the originals.
fn read_back_with_openexr(frames: &Path, written: &[std::path::PathBuf]) {
    let has = Command::new("python3").args(["-c", "import OpenEXR, numpy"]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        println!("skipped: python3 with OpenEXR is not there");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts/same_pixels.py");
    let output =
        Command::new("python3").arg(script).arg(frames.join("exr_aov")).args(written).output().expect("python3 starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
}

#[test]
fn a_replaced_channel_comes_back_and_nothing_else_changes() {
    let Some(frames) = shared_frames() else { return };
    let folder = Folder::new("replace");
    let path = frames.join("exr_aov/blender50_multipart_dwaa.exr");
    let before = read_image(&path).unwrap();
    let mut image = read_headers(&path).unwrap();
    let (part, channel) = (5, 2);
    let changed: Vec<f32> = before.samples(part, channel).unwrap().to_f32().iter().map(|v| v * 0.5 + 0.25).collect();
    let (samples, clamped) = Samples::from_f32(changed, SampleKind::Half);
    assert_eq!(clamped, 0);
    image.replace(part, channel, samples.clone()).unwrap();
    let out = folder.file("out.exr");
    let report = image.write(&out, &ImageWriteOptions::default()).unwrap();
    assert_eq!(report.notes.len(), 1);
    assert!(report.notes[0].contains("ViewLayer.Diffuse Direct") && report.notes[0].contains("DWAA"));
    let after = read_image(&out).unwrap();
    for (p, part_read) in after.parts().iter().enumerate() {
        assert_eq!(part_read.compression(), if p == part { "ZIP" } else { "DWAA" });
        for (c, channel_read) in part_read.channels().iter().enumerate() {
            let expected = if (p, c) == (part, channel) { &samples } else { before.samples(p, c).unwrap() };
            assert!(
                bits(channel_read.samples().unwrap()) == bits(expected),
                "{} {}",
                part_read.name(),
                channel_read.name()
            );
        }
    }
    // A foreign file and the input itself are left alone.
    assert!(matches!(image.write(&out, &ImageWriteOptions::default()), Err(Error::Foreign { .. })));
    image.write(&out, &ImageWriteOptions { overwrite: true }).unwrap();
    let own = folder.file("own.exr");
    fs::copy(&path, &own).unwrap();
    let itself = read_headers(&own).unwrap();
    let refused = itself.write(&own, &ImageWriteOptions { overwrite: true }).unwrap_err().to_string();
    assert!(refused.contains("own.exr") && refused.contains("input"), "{refused}");
    // The input changes between header and write.
    let mut stale = read_headers(&own).unwrap();
    fs::write(&own, b"gone").unwrap();
    assert!(stale.load(|_, _| true).is_err());
    let error = stale.write(&folder.file("never.exr"), &ImageWriteOptions::default()).unwrap_err().to_string();
    assert!(error.contains("changed"), "{error}");
    assert!(!folder.file("never.exr").exists());
    fs::remove_file(&own).unwrap();
    assert!(matches!(stale.load(|_, _| true), Err(Error::Io { .. })));
}

/// A small file made from code: two parts, half and uint, tiled and not.
fn small(folder: &Folder) -> Vec<u8> {
    use exr::prelude::*;
    let tile = Blocks::Tiles(Vec2(4, 4));
    let part = |name: &str, blocks, channels: Vec<AnyChannel<FlatSamples>>| {
        Layer::new(
            (9, 7),
            LayerAttributes::named(name),
            Encoding { compression: Compression::ZIP16, blocks, line_order: LineOrder::Increasing },
            AnyChannels::sort(channels.into()),
        )
    };
    let half: Vec<f16> = (0..63).map(|i| f16::from_f32(i as f32)).collect();
    let image = Image::from_layers(
        ImageAttributes::with_size((9, 7)),
        vec![
            part("beauty", tile, vec![AnyChannel::new("R", FlatSamples::F16(half))]),
            part("id", Blocks::ScanLines, vec![AnyChannel::new("id", FlatSamples::U32((0..63).collect()))]),
        ],
    );
    let path = folder.file("small.exr");
    image.write().non_parallel().to_file(&path).unwrap();
    fs::read(path).unwrap()
}

#[test]
fn a_file_cut_short_anywhere_or_changed_anywhere_is_an_error_or_a_picture_and_never_a_panic() {
    let folder = Folder::new("cut-image");
    let bytes = small(&folder);
    let label = Path::new("small.exr");
    read_image_from(Cursor::new(&bytes), label).unwrap();
    for length in 0..bytes.len() {
        let error = read_image_from(Cursor::new(&bytes[..length]), label).unwrap_err();
        assert!(error.to_string().contains("small.exr"), "{error}");
    }
    for at in 0..bytes.len() {
        for value in [0, 1, 0x7f, 0xff, bytes[at] ^ 0x10] {
            let mut changed = bytes.clone();
            changed[at] = value;
            if let Ok(image) = read_image_from(Cursor::new(&changed), label) {
                let pixels: usize = image.parts().iter().map(|p| p.size().pixels()).sum();
                assert!(pixels < 1 << 20);
            }
        }
    }
}

#[test]
fn bad_headers_are_named() {
    let folder = Folder::new("bad");
    let bytes = small(&folder);
    let read = |bytes: &[u8]| read_image_from(Cursor::new(bytes), Path::new("x.exr")).unwrap_err().to_string();
    let mut magic = bytes.clone();
    magic[0] = 0;
    assert!(read(&magic).contains("not a whole, valid EXR file"), "{}", read(&magic));

    // The first data window claims a thousand million pixels.
    let at = bytes.windows(10).position(|w| w == b"dataWindow").unwrap() + 10 + 1 + 6 + 4;
    assert_eq!(&bytes[at - 10..at - 4], b"box2i\0");
    let mut huge = bytes.clone();
    huge[at..at + 16].copy_from_slice(&[0i32, 0, 999_999, 999].map(i32::to_le_bytes).concat());
    let message = read(&huge);
    assert!(message.contains("1000000x1000") && message.contains("part `beauty`"), "{message}");

    // The channel is subsampled: its last eight bytes.
    let at = bytes.windows(8).position(|w| w == b"channels").unwrap() + 8 + 1 + 7 + 4;
    let name = at;
    assert_eq!(&bytes[name..name + 2], b"R\0");
    let mut subsampled = bytes.clone();
    subsampled[name + 2 + 8..name + 2 + 16].copy_from_slice(&[2i32, 2].map(i32::to_le_bytes).concat());
    let message = read(&subsampled);
    assert!(message.contains("not supported") && message.contains("`R`"), "{message}");

    // The first part claims to be deep.
    let at = bytes.windows(10).position(|w| w == b"tiledimage").unwrap();
    let mut deep = bytes.clone();
    // `tiledimage` and `deeptile` differ in length, so the attribute's length changes too.
    deep[at - 4..at].copy_from_slice(&8i32.to_le_bytes());
    deep.splice(at..at + 10, b"deeptile".iter().copied());
    let message = read(&deep);
    assert!(message.contains("deep data") && message.contains("`R`"), "{message}");

    let missing = read_headers(&folder.file("missing.exr")).unwrap_err().to_string();
    assert!(missing.contains("missing.exr"), "{missing}");
    let is_folder = read_headers(&folder.0).unwrap_err();
    assert!(matches!(is_folder, Error::Invalid { .. } | Error::Io { .. }), "{is_folder}");
}

#[test]
fn a_channel_is_added_to_every_layout_and_nothing_else_changes() {
    let Some(frames) = shared_frames() else { return };
    let folder = Folder::new("added");
    let (mut single, mut several) = (0, 0);
    for name in expectations(&frames).keys() {
        let path = frames.join("exr_aov").join(name);
        let before = read_image(&path).unwrap();
        let mut image = read_headers(&path).unwrap();
        let (part, channel) = image.add_channel(0, "Layer.quell.noise", "Layer.quell.noise.Y").unwrap();
        let kind = image.parts()[part].channels()[channel].kind();
        let count = image.parts()[part].size().pixels();
        let values: Vec<f32> = (0..count).map(|i| (i % 97) as f32 * 0.25).collect();
        image.replace(part, channel, Samples::from_f32(values.clone(), kind).0).unwrap();
        // Asked for again it is the same one.
        assert_eq!(image.add_channel(0, "x", "Layer.quell.noise.Y").unwrap(), (part, channel));
        let out = folder.file(&format!("added-{}", name.replace('/', "-")));
        image.write(&out, &ImageWriteOptions::default()).unwrap();
        let after = read_image(&out).unwrap();
        if before.parts().len() > 1 {
            several += 1;
            assert_eq!(after.parts().len(), before.parts().len() + 1, "{name}");
            assert_eq!(after.parts()[part].name(), "Layer.quell.noise", "{name}");
        } else {
            single += 1;
            assert_eq!(after.parts().len(), 1, "{name}");
        }
        assert_eq!(after.samples(part, channel).unwrap().to_f32(), values, "{name}");
        for (p, old) in before.parts().iter().enumerate() {
            for c in old.channels() {
                let at = after.parts()[p].find(c.name()).unwrap_or_else(|| panic!("{name} {}", c.name()));
                let new = after.samples(p, at).unwrap();
                assert!(bits(new) == bits(c.samples().unwrap()), "{name} {}", c.name());
            }
        }
    }
    assert!(single >= 3 && several >= 3, "{single} {several}");
}
