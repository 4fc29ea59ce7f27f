//! Open Image Denoise through quell against its own program. Needs python3 with the PyPI package `pyoidn`; a skip is
//! printed.

use quell::{Camera, FrameBuf, Plane, Rgb, Size};
use quell_lab::methods::oidn::Oidn;
use quell_lab::methods::{Input, Method, parse};
use std::path::Path;
use std::process::Command;

/// Two walls that meet in an edge, striped, one lit ten times brighter, under noise; odd extents.
fn frame(index: i64) -> FrameBuf {
    let size = Size::new(93, 61);
    let mut random = 3 + index as u64;
    let mut noise = move || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f32 / (1u64 << 24) as f32
    };
    let left = |x: usize| x < 40;
    let camera = Camera::perspective([0.0, 0.0, 4.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 1.5);
    let mut f = FrameBuf::new(size, camera);
    f.index = index;
    f.matte = Some(Plane::from_fn(size, |x, _| std::array::from_fn(|_| if left(x) { 20.0 } else { 2.0 } * noise())));
    f.matte_weight = Some(Plane::from_fn(size, |x, y| if (x + y) / 8 % 2 == 0 { [0.8, 0.6, 0.4] } else { [0.2; 3] }));
    f.normal = Some(Plane::from_fn(size, |x, _| if left(x) { [0.0, 0.0, 1.0] } else { [0.6, 0.0, 0.8] }));
    f.motion = Some(Plane::filled(size, [0.0; 2]));
    f
}

fn write_pfm(path: &Path, picture: &Plane<Rgb>) {
    let size = picture.size();
    let mut bytes = format!("PF\n{} {}\n-1.0\n", size.width, size.height).into_bytes();
    for y in (0..size.height).rev() {
        bytes.extend(picture.row(y).iter().flatten().flat_map(|v| v.to_le_bytes()));
    }
    std::fs::write(path, bytes).unwrap();
}

fn read_pfm(path: &Path, size: Size) -> Plane<Rgb> {
    let bytes = std::fs::read(path).unwrap();
    let values: Vec<f32> = bytes[bytes.len() - size.pixels() * 12..]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    let at = |x: usize, y: usize| 3 * ((size.height - 1 - y) * size.width + x);
    Plane::from_fn(size, |x, y| std::array::from_fn(|c| values[at(x, y) + c]))
}

fn largest_difference(a: &Plane<Rgb>, b: &Plane<Rgb>) -> f32 {
    let pairs = a.data().iter().flatten().zip(b.data().iter().flatten());
    pairs.map(|(a, b)| (a - b).abs() / (0.01 + b.abs())).fold(0.0, f32::max)
}

#[test]
fn it_equals_its_own_program() {
    let folder = std::env::temp_dir().join(format!("quell-oidn-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let frame = frame(0);
    let borrowed = frame.frame(&[]);
    let input = Input { frame: &borrowed, halves: None };
    write_pfm(&folder.join("color.pfm"), &input.composite());
    write_pfm(&folder.join("albedo.pfm"), &input.albedo());
    write_pfm(&folder.join("normal.pfm"), frame.normal.as_ref().unwrap());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts/oidn_reference.py");
    let mut pictures = Vec::new();
    for quality in ["fast", "balanced", "high"] {
        let Ok(done) = Command::new("python3").arg(&script).arg(&folder).arg(quality).output() else {
            println!("SKIPPED: there is no python3");
            return;
        };
        if done.status.code() == Some(77) {
            println!("SKIPPED: {}", String::from_utf8_lossy(&done.stderr));
            return;
        }
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let library = String::from_utf8(done.stdout).unwrap();
        let expected = read_pfm(&folder.join("output.pfm"), frame.size);
        let open = |name: &str| Oidn::parse(name).unwrap().with_library(Path::new(library.trim()));
        let mut method = open(&format!("oidn:{quality}"));
        // Twice: the second call sets the images of a filter in use anew.
        for _ in 0..2 {
            let found = method.denoise(&input).unwrap();
            let difference = largest_difference(&found, &expected);
            assert!(difference < 1e-4, "{quality}: {difference}");
            // Canaries: it is not the input, and not another quality's picture.
            assert!(largest_difference(&input.composite(), &expected) > 0.1);
            assert!(pictures.iter().all(|other| largest_difference(other, &expected) > 1e-3), "{quality}");
        }
        pictures.push(expected);
        // After accumulation it sees another picture in the second frame.
        if quality == "fast" {
            let mut after = open("temporal+oidn:fast");
            assert_eq!(after.name(), "temporal+oidn:fast");
            let second = self::frame(1);
            let alone = method.denoise(&Input { frame: &second.frame(&[]), halves: None }).unwrap();
            let both = [&frame, &second].map(|f| after.denoise(&Input { frame: &f.frame(&[]), halves: None }).unwrap());
            assert!(largest_difference(&both[0], &pictures[0]) < 1e-4);
            assert!(largest_difference(&both[1], &alone) > 1e-2);
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_missing_library_is_named() {
    let frame = frame(0);
    let borrowed = frame.frame(&[]);
    let mut method = Oidn::parse("oidn:high").unwrap().with_library(Path::new("no/such/library.so"));
    for _ in 0..2 {
        let error = method.denoise(&Input { frame: &borrowed, halves: None }).unwrap_err().to_string();
        assert!(error.starts_with("oidn:high: ") && error.contains("no/such/library.so"), "{error}");
        assert!(error.contains("QUELL_OIDN"), "{error}");
    }
    for wrong in ["oidn", "oidn:best", "temporal+oidn", "svgf+oidn:high"] {
        assert!(parse(wrong).is_err(), "{wrong}");
    }
    assert_eq!(parse("temporal+oidn:high").unwrap().name(), "temporal+oidn:high");
}
