//! Frames are written and read to the bit; whatever is wrong with a file is an error, never a panic.

use crate::Folder;
use quell::{Camera, FrameBuf, PassBuf, Plane, Rgb, Signal, Size};
use quell_frames::{
    Content, Error, FrameFile, FrameToWrite, Half, HalfBuf, Metadata, Precision, WriteOptions, find_frames,
    frame_bytes, frame_path, read_frame, write_frame,
};
use std::fs;
use std::path::Path;

/// Numbers without a pattern, with everything a float can be.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let bits = (self.0 >> 32) as u32;
        match bits % 23 {
            0 => f32::INFINITY,
            1 => f32::NAN,
            2 => -0.0,
            3 => f32::MIN_POSITIVE / 4.0,
            4 => -1e30,
            _ => (bits >> 8) as f32 / 65536.0,
        }
    }

    fn plane<const N: usize>(&mut self, size: Size) -> Plane<[f32; N]> {
        Plane::from_fn(size, |_, _| std::array::from_fn(|_| self.next()))
    }

    fn float(&mut self, size: Size) -> Plane<f32> {
        Plane::from_fn(size, |_, _| self.next())
    }
}

fn camera(k: f32) -> Camera {
    let mut camera = Camera::perspective([k, 2.0, -3.0 * k], [0.1, -0.3, -1.0], [0.0, 1.0, 0.0], 0.7, 1.6);
    camera.jitter = [0.1 * k, -0.37];
    camera
}

fn full_file(size: Size) -> FrameFile {
    let mut n = Numbers(size.pixels() as u64);
    let mut frame = FrameBuf::new(size, camera(1.0));
    frame.previous_camera = camera(1.1);
    frame.index = -(1 << 40);
    for plane in [
        &mut frame.direct,
        &mut frame.matte,
        &mut frame.glossy,
        &mut frame.direct_matte,
        &mut frame.direct_glossy,
        &mut frame.matte_weight,
        &mut frame.glossy_weight,
    ] {
        *plane = Some(n.plane(size));
    }
    for plane in [
        &mut frame.view_depth,
        &mut frame.roughness,
        &mut frame.glossy_hit_distance,
        &mut frame.matte_hit_distance,
        &mut frame.alpha,
        &mut frame.matte_variance,
        &mut frame.glossy_variance,
        &mut frame.confidence_in,
    ] {
        *plane = Some(n.float(size));
    }
    frame.normal = Some(n.plane(size));
    frame.motion = Some(n.plane(size));
    frame.surface_id = Some(Plane::from_fn(size, |x, y| u32::MAX - (x * 7 + y) as u32));
    frame.passes = [("z first", Signal::Glossy), ("a.b.R", Signal::Matte), ("z first", Signal::Matte)]
        .map(|(name, signal)| PassBuf { name: name.to_owned(), signal, plane: n.plane(size) })
        .to_vec();
    FrameFile {
        composite: Some(n.plane(size)),
        confidence: Some(n.float(size)),
        history_length: Some(n.float(size)),
        next_motion: Some(n.plane(size)),
        halves: [
            HalfBuf { composite: Some(n.plane(size)), matte: Some(n.plane(size)), glossy: None },
            HalfBuf { composite: Some(n.plane(size)), matte: None, glossy: Some(n.plane(size)) },
        ],
        metadata: Metadata {
            content: Content::Denoised,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: "Zürich \u{1F3E0}, camera 2".to_owned(),
            scene_hash: "00ff".to_owned(),
            sampling: "1 sample".to_owned(),
            settings: "[matte]\nradius = 3\n".to_owned(),
            mapping: "DiffInd = matte".to_owned(),
            frames_per_second: 24.0,
            exposure: 0.3,
        },
        frame,
    }
}

fn write(path: &Path, file: &FrameFile, options: &WriteOptions) -> Result<quell_frames::Written, Error> {
    let passes = file.frame.pass_views();
    let rgb = |p: &Option<Plane<Rgb>>| p.as_ref().map(|p| PlaneHolder(p.clone()));
    let held: Vec<[Option<PlaneHolder>; 3]> =
        file.halves.iter().map(|h| [rgb(&h.composite), rgb(&h.matte), rgb(&h.glossy)]).collect();
    let half = |i: usize| Half {
        composite: held[i][0].as_ref().map(|p| p.0.view()),
        matte: held[i][1].as_ref().map(|p| p.0.view()),
        glossy: held[i][2].as_ref().map(|p| p.0.view()),
    };
    let frame = FrameToWrite {
        frame: file.frame.frame(&passes),
        composite: file.composite.as_ref().map(Plane::view),
        confidence: file.confidence.as_ref().map(Plane::view),
        history_length: file.history_length.as_ref().map(Plane::view),
        next_motion: file.next_motion.as_ref().map(Plane::view),
        halves: [half(0), half(1)],
        metadata: file.metadata.clone(),
    };
    write_frame(path, &frame, options)
}

struct PlaneHolder(Plane<Rgb>);

/// Equality to the bit, which `==` is not where there are NaN and negative zeros.
fn bits(file: &FrameFile) -> Vec<(String, Vec<u32>)> {
    let mut all = Vec::new();
    let f = &file.frame;
    let mut rgb = |name: &str, plane: Option<&Plane<Rgb>>| {
        all.push((
            name.to_owned(),
            plane.map_or(Vec::new(), |p| p.data().iter().flatten().map(|v| v.to_bits()).collect()),
        ));
    };
    rgb("composite", file.composite.as_ref());
    rgb("direct", f.direct.as_ref());
    rgb("matte", f.matte.as_ref());
    rgb("glossy", f.glossy.as_ref());
    rgb("direct_matte", f.direct_matte.as_ref());
    rgb("direct_glossy", f.direct_glossy.as_ref());
    rgb("matte_weight", f.matte_weight.as_ref());
    rgb("glossy_weight", f.glossy_weight.as_ref());
    rgb("normal", f.normal.as_ref());
    for pass in &f.passes {
        rgb(&format!("{:?} {}", pass.signal, pass.name), Some(&pass.plane));
    }
    for half in &file.halves {
        rgb("half composite", half.composite.as_ref());
        rgb("half matte", half.matte.as_ref());
        rgb("half glossy", half.glossy.as_ref());
    }
    let mut float = |name: &str, plane: Option<&Plane<f32>>| {
        all.push((name.to_owned(), plane.map_or(Vec::new(), |p| p.data().iter().map(|v| v.to_bits()).collect())));
    };
    float("view_depth", f.view_depth.as_ref());
    float("roughness", f.roughness.as_ref());
    float("glossy_hit_distance", f.glossy_hit_distance.as_ref());
    float("matte_hit_distance", f.matte_hit_distance.as_ref());
    float("alpha", f.alpha.as_ref());
    float("matte_variance", f.matte_variance.as_ref());
    float("glossy_variance", f.glossy_variance.as_ref());
    float("confidence_in", f.confidence_in.as_ref());
    float("confidence", file.confidence.as_ref());
    float("history", file.history_length.as_ref());
    for (name, plane) in [("motion", &f.motion), ("next", &file.next_motion)] {
        let values = plane.as_ref().map_or(Vec::new(), |p| p.data().iter().flatten().map(|v| v.to_bits()).collect());
        all.push((name.to_owned(), values));
    }
    all.push(("ids".to_owned(), f.surface_id.as_ref().map_or(Vec::new(), |p| p.data().to_vec())));
    all
}

#[track_caller]
fn assert_same(a: &FrameFile, b: &FrameFile) {
    for ((name, a), (other, b)) in bits(a).iter().zip(&bits(b)) {
        assert_eq!(name, other);
        assert!(a == b, "{name} differs");
    }
    assert_eq!(a.metadata, b.metadata);
    let head = |f: &FrameFile| (f.frame.size, f.frame.camera, f.frame.previous_camera, f.frame.index);
    assert_eq!(head(a), head(b));
}

#[test]
fn every_plane_comes_back_to_the_bit_at_odd_sizes() {
    let folder = Folder::new("round-trip");
    for size in [Size::new(1, 1), Size::new(1, 37), Size::new(67, 1), Size::new(31, 33)] {
        let file = full_file(size);
        let path = folder.file("a.exr");
        let written = write(&path, &file, &WriteOptions::default()).unwrap();
        assert_eq!(written.bytes, fs::metadata(&path).unwrap().len());
        let back = read_frame(&path).unwrap();
        assert_same(&file, &back);
        // The comparison can fail: one bit of one plane.
        let mut changed = back;
        let roughness = changed.frame.roughness.as_mut().unwrap();
        roughness.data_mut()[0] = f32::from_bits(roughness.data()[0].to_bits() ^ 1);
        assert_ne!(bits(&changed), bits(&file));
    }
    assert_eq!(folder.names(), ["a.exr"]);
}

#[test]
fn pixel_bytes_do_not_depend_on_the_number_of_threads() {
    let folder = Folder::new("threads");
    let file = full_file(Size::new(40, 131));
    let bytes = [1, 3].map(|threads| {
        let path = folder.file(&format!("{threads}.exr"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write(&path, &file, &WriteOptions::default())).unwrap();
        fs::read(&path).unwrap()
    });
    // exr keeps header attributes in a hash map, so their order varies from file to file; pixels come after.
    const LONGEST_HEADER: usize = 8192;
    assert!(bytes[0].len() > 2 * LONGEST_HEADER && bytes[0].len() == bytes[1].len());
    assert!(bytes[0][LONGEST_HEADER..] == bytes[1][LONGEST_HEADER..]);
}

#[test]
fn a_file_in_memory_is_the_file_on_disk() {
    let folder = Folder::new("bytes");
    let frame = full_file(Size::new(17, 33)).frame;
    let file = FrameToWrite::new(frame.frame(&[]));
    let [written, memory] = ["written.exr", "memory.exr"].map(|name| folder.0.join(name));
    write_frame(&written, &file, &WriteOptions::default()).unwrap();
    fs::write(&memory, frame_bytes(Path::new("memory"), &file, Precision::Float).unwrap()).unwrap();
    assert_same(&read_frame(&written).unwrap(), &read_frame(&memory).unwrap());
    let half = frame_bytes(Path::new("memory"), &file, Precision::Half).unwrap();
    assert!((half.len() as u64) < fs::metadata(&memory).unwrap().len());
}

#[test]
fn what_is_absent_stays_absent_and_the_composite_is_filled_in() {
    let folder = Folder::new("absent");
    let path = folder.file("a.exr");
    let size = Size::new(5, 4);
    let mut frame = FrameBuf::new(size, camera(1.0));
    frame.glossy = Some(Plane::filled(size, [0.5; 3]));
    frame.direct = Some(Plane::filled(size, [0.25; 3]));
    write_frame(&path, &FrameToWrite::new(frame.frame(&[])), &WriteOptions::default()).unwrap();
    let back = read_frame(&path).unwrap();
    assert_eq!(back.frame, frame);
    assert_eq!(back.composite.unwrap(), frame.composite());
    assert_eq!((back.confidence, back.next_motion, &back.halves[1]), (None, None, &HalfBuf::default()));
}

#[test]
fn half_rounds_colours_clamps_and_counts_and_keeps_guides() {
    let folder = Folder::new("half");
    let path = folder.file("a.exr");
    let size = Size::new(3, 1);
    let mut frame = FrameBuf::new(size, camera(1.0));
    frame.direct =
        Some(Plane::from_vec(size, vec![[1e6, -1e6, 0.1], [f32::INFINITY, 1.0, 65504.0], [0.0; 3]]).unwrap());
    frame.view_depth = Some(Plane::filled(size, 0.1));
    let options = WriteOptions { colours: Precision::Half, ..WriteOptions::default() };
    let written = write_frame(&path, &FrameToWrite::new(frame.frame(&[])), &options).unwrap();
    // Twice each: the composite is the direct light here.
    assert_eq!(written.clamped_to_half, 4);
    let back = read_frame(&path).unwrap().frame;
    let direct = back.direct.unwrap();
    assert_eq!(direct.at(0, 0)[..2], [65504.0, -65504.0]);
    assert!((direct.at(0, 0)[2] - 0.1).abs() < 5e-5 && direct.at(0, 0)[2] != 0.1);
    assert_eq!(direct.at(1, 0), [f32::INFINITY, 1.0, 65504.0]);
    assert_eq!(back.view_depth, frame.view_depth);
}

#[test]
fn a_file_cut_anywhere_or_damaged_is_an_error_and_no_panic() {
    let folder = Folder::new("cut");
    let whole_path = folder.file("whole.exr");
    write(&whole_path, &full_file(Size::new(19, 18)), &WriteOptions::default()).unwrap();
    let whole = fs::read(&whole_path).unwrap();
    let path = folder.file("damaged.exr");
    for length in (0..whole.len()).step_by(37).chain([whole.len() - 1]) {
        fs::write(&path, &whole[..length]).unwrap();
        match read_frame(&path) {
            Err(Error::Invalid { path: named, .. } | Error::NotSupported { path: named, .. }) => {
                assert_eq!(named, path);
            }
            other => panic!("cut at {length} of {}: {:?}", whole.len(), other.map(|_| ())),
        }
    }
    // Changed bytes may be harmless (texts, pixels); they must only never panic.
    for at in (0..6000).step_by(7).chain((6000..whole.len()).step_by(97)) {
        let mut damaged = whole.clone();
        damaged[at] = damaged[at].wrapping_add(129);
        fs::write(&path, &damaged).unwrap();
        let _ = read_frame(&path);
    }
}

#[test]
fn a_header_that_claims_more_than_the_file_can_hold_is_refused_before_allocating() {
    let folder = Folder::new("claims");
    let path = folder.file("a.exr");
    write(&path, &full_file(Size::new(2, 2)), &WriteOptions::default()).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let name = b"dataWindow\0box2i\0";
    let box_at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    for (i, value) in [0i32, 0, 60_000, 60_000].into_iter().enumerate() {
        bytes[box_at + 4 * i..][..4].copy_from_slice(&value.to_le_bytes());
    }
    fs::write(&path, &bytes).unwrap();
    let message = read_frame(&path).unwrap_err().to_string();
    assert!(message.contains("60001x60001") && message.contains("cannot hold"), "{message}");
}

#[test]
fn files_of_other_programs_are_neither_read_nor_overwritten() {
    let folder = Folder::new("foreign");
    let path = folder.file("a.exr");
    exr::prelude::write_rgb_file(&path, 4, 3, |_, _| (0.5f32, 0.5f32, 0.5f32)).unwrap();
    let before = fs::read(&path).unwrap();
    assert!(matches!(read_frame(&path), Err(Error::NotSupported { .. })));
    let file = full_file(Size::new(4, 3));
    assert!(matches!(write(&path, &file, &WriteOptions::default()), Err(Error::Foreign { .. })));
    assert_eq!(fs::read(&path).unwrap(), before);
    write(&path, &file, &WriteOptions { overwrite: true, ..WriteOptions::default() }).unwrap();
    // Its own file is replaced without a word.
    write(&path, &file, &WriteOptions::default()).unwrap();
    assert_same(&read_frame(&path).unwrap(), &file);
}

#[test]
fn failures_name_the_place_and_leave_nothing_behind() {
    let folder = Folder::new("failures");
    let file = full_file(Size::new(4, 3));
    // A file where a folder is needed.
    fs::write(folder.file("plain"), b"x").unwrap();
    let message = write(&folder.file("plain/a.exr"), &file, &WriteOptions::default()).unwrap_err().to_string();
    assert!(message.contains("plain"), "{message}");
    assert!(read_frame(&folder.file("missing.exr")).unwrap_err().to_string().contains("missing.exr"));
    assert!(matches!(read_frame(&folder.0), Err(Error::Invalid { .. } | Error::Io { .. })));
    // Planes of two extents.
    let mut wrong = file.clone();
    wrong.confidence = Some(Plane::filled(Size::new(9, 9), 1.0));
    let message = write(&folder.file("a.exr"), &wrong, &WriteOptions::default()).unwrap_err().to_string();
    assert!(message.contains("quell.confidence") && message.contains("9x9"), "{message}");
    let mut twice = file;
    twice.frame.passes[2].signal = Signal::Glossy;
    assert!(write(&folder.file("a.exr"), &twice, &WriteOptions::default()).is_err());
    // A writer that fails half way: what stood there stands there still, and no temporary file stays.
    let target = folder.file("kept.bin");
    fs::write(&target, b"old").unwrap();
    let failed: Result<(), Error> = quell_frames::files::write_whole(&target, |writer| {
        std::io::Write::write_all(writer, &[7; 100_000]).unwrap();
        Err(Error::io(&target, "write", std::io::ErrorKind::StorageFull.into()))
    });
    let message = failed.unwrap_err().to_string();
    assert!(message.contains("kept.bin") && message.contains("free some space"), "{message}");
    assert_eq!(fs::read(&target).unwrap(), b"old");
    assert_eq!(folder.names(), ["kept.bin", "plain"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_said_so() {
    // `/dev/full` answers every write with "no space"; the exr writer goes straight into it.
    let full = fs::OpenOptions::new().write(true).open("/dev/full");
    let Ok(full) = full else {
        eprintln!("skipped: this system has no /dev/full");
        return;
    };
    let mut full = std::io::BufWriter::with_capacity(1, full);
    let error = std::io::Write::write_all(&mut full, b"frame").unwrap_err();
    let message = Error::io(Path::new("out/noisy.0001.exr"), "write", error).to_string();
    assert!(message.contains("out/noisy.0001.exr") && message.contains("free some space"), "{message}");
}

#[test]
fn names_of_frames() {
    let folder = Folder::new("names");
    let path = |index| frame_path(&folder.0, "noisy", index);
    assert!(path(12).ends_with("noisy.0012.exr") && path(-3).ends_with("noisy.-0003.exr"));
    for index in [12, -3, 123_456] {
        fs::write(path(index), b"").unwrap();
    }
    for other in ["noisy.exr", "noisy.12.exr", "noisy.00x1.exr", "denoised.0012.exr", "noisy.0012.png"] {
        fs::write(folder.file(other), b"").unwrap();
    }
    let found: Vec<i64> = find_frames(&folder.0, "noisy").unwrap().into_iter().map(|(n, _)| n).collect();
    assert_eq!(found, [-3, 12, 123_456]);
    assert!(find_frames(&folder.file("nowhere"), "noisy").is_err());
}
