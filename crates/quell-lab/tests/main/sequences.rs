//! Whole sequences, traced and denoised: the picture gets better, keeps its energy, and survives the way through a file.

use quell::{Denoiser, Frame, FrameBuf, Plane, Preset, Rgb, Settings, Size};
use quell_frames::{Content, FrameToWrite, Metadata, WriteOptions, read_frame, write_frame};
use quell_lab::metrics::{energy, energy_by_region, grid_regions, rel_mse};
use quell_lab::references::{ReferenceOf, ReferenceTarget, converge};
use quell_trace::{Control, PrimaryReplacement, RenderOptions, Tracer, builtin};
use std::path::Path;

/// Large enough for the filters' footprints, small enough for a test.
const SIZE: Size = Size::new(128, 72);
/// A fixed blend of 0.9 is steady after 30 frames; most of its gain is there after 16.
const FRAMES: i64 = 16;

fn denoised_sequence(scene: &str) -> (FrameBuf, Plane<Rgb>, Plane<Rgb>) {
    let scene = builtin(scene).unwrap();
    let options = RenderOptions::new(SIZE);
    let mut denoiser = Denoiser::new(SIZE, &Settings::preset(Preset::Paper)).unwrap();
    let mut last = None;
    for index in 0..FRAMES {
        let traced = Tracer::new(&scene, index, 1).unwrap().render(&options, &Control::default()).unwrap().frame;
        let composite = denoiser.denoise(&traced.frame(&[])).unwrap().composite.clone();
        last = Some((traced, composite));
    }
    let (traced, composite) = last.unwrap();
    let what = ReferenceOf { scene: &scene, camera: 1, frame: FRAMES - 1, options: &options };
    let target = ReferenceTarget { samples: 64, batch: 64, ..ReferenceTarget::default() };
    let reference = converge(None, &what, &target, &Control::default(), |_| {}).unwrap().mean().unwrap().beauty;
    (traced, composite, reference)
}

#[test]
fn the_cornell_box_gets_ten_times_better_and_keeps_its_energy() {
    let (traced, composite, reference) = denoised_sequence("cornell-box");
    let before = rel_mse(&traced.composite(), &reference).unwrap().trimmed;
    let after = rel_mse(&composite, &reference).unwrap().trimmed;
    let total = energy(&composite, &reference).unwrap();
    println!("trimmed relMSE {before:.4} to {after:.5}: {:.1} times; energy {total:.4}", before / after);
    assert!(before / after > 10.0, "trimmed relMSE {before} to {after}: only {} times better", before / after);
    assert!((total - 1.0).abs() < 0.03, "energy {total}");
    // Nowhere is light gathered at the cost of another place.
    for region in energy_by_region(&composite, &reference, &grid_regions(SIZE, 4, 3)).unwrap() {
        let ratio = region.ratio.unwrap();
        assert!((ratio - 1.0).abs() < 0.1, "region {}: {ratio}", region.region);
    }
}

/// Mean of a picture over the pixels that show a surface.
fn mean_over_surfaces(picture: &Plane<Rgb>, frame: &FrameBuf) -> [f64; 3] {
    let depth = frame.view_depth.as_ref().unwrap();
    let mut sum = [0.0; 3];
    let mut count = 0.0;
    for (c, z) in picture.data().iter().zip(depth.data()) {
        if z.is_finite() {
            for k in 0..3 {
                sum[k] += f64::from(c[k]);
            }
            count += 1.0;
        }
    }
    sum.map(|s| s / count)
}

/// Target 10 of the evaluation: known answers survive the filters within 0.5 %.
#[test]
fn the_furnace_keeps_its_answers_after_denoising() {
    let size = Size::new(96, 54);
    let scene = builtin("furnace").unwrap();
    // The mirror is a surface: else nothing would be filtered.
    let options = RenderOptions { primary_replacement: PrimaryReplacement::Glass, ..RenderOptions::new(size) };
    for camera in 1..=5 {
        let mut denoiser = Denoiser::new(size, &Settings::preset(Preset::Paper)).unwrap();
        let mut measured = Vec::new();
        for index in 0..12 {
            let frame =
                Tracer::new(&scene, index, camera).unwrap().render(&options, &Control::default()).unwrap().frame;
            let output = denoiser.denoise(&frame.frame(&[])).unwrap();
            measured = mean_over_surfaces(output.composite, &frame).to_vec();
            if index == 11 && camera < 5 {
                let what = ReferenceOf { scene: &scene, camera, frame: index, options: &options };
                let target = ReferenceTarget { samples: 96, batch: 96, ..ReferenceTarget::default() };
                let reference = converge(None, &what, &target, &Control::default(), |_| {}).unwrap().mean().unwrap();
                let expected = mean_over_surfaces(&reference.beauty, &frame);
                for k in 0..3 {
                    let ratio = measured[k] / expected[k];
                    assert!((ratio - 1.0).abs() < 5e-3, "camera {camera}, channel {k}: {ratio}");
                }
            }
        }
        if camera == 5 {
            // Walls of albedo 0.6 that emit 0.4: light scattered at most 4 times.
            let expected: f64 = (0..=options.bounces as i32 + 1).map(|k| 0.4 * 0.6_f64.powi(k)).sum();
            let ratio = measured[0] / expected;
            println!("closed box after denoising: {ratio:.5} of the series");
            assert!((ratio - 1.0).abs() < 5e-3, "closed box: {ratio}");
        }
    }
}

#[test]
fn a_denoised_frame_goes_through_a_file_to_the_bit_and_denoises_alike() {
    let scene = builtin("cornell-box").unwrap();
    let size = Size::new(48, 27);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("sequences");
    let mut direct = Denoiser::new(size, &Settings::preset(Preset::Paper)).unwrap();
    let mut through_files = direct.clone();
    for index in 0..3 {
        let options = RenderOptions::new(size);
        let traced = Tracer::new(&scene, index, 1).unwrap().render(&options, &Control::default()).unwrap().frame;
        let path = folder.join(format!("noisy.{index}.exr"));
        write_frame(&path, &FrameToWrite::new(traced.frame(&[])), &WriteOptions::default()).unwrap();
        let read = read_frame(&path).unwrap().frame;
        let output = direct.denoise(&traced.frame(&[])).unwrap();
        let other = through_files.denoise(&read.frame(&[])).unwrap();
        assert_eq!(output.composite, other.composite, "frame {index}");

        let filtered =
            Frame { matte: output.matte.map(Plane::view), glossy: output.glossy.map(Plane::view), ..traced.frame(&[]) };
        let file = FrameToWrite {
            composite: Some(output.composite.view()),
            confidence: Some(output.confidence.view()),
            history_length: Some(output.history_length.view()),
            metadata: Metadata { content: Content::Denoised, ..Metadata::default() },
            ..FrameToWrite::new(filtered)
        };
        let path = folder.join(format!("denoised.{index}.exr"));
        write_frame(&path, &file, &WriteOptions::default()).unwrap();
        let back = read_frame(&path).unwrap();
        assert_eq!(back.composite.as_ref(), Some(output.composite));
        assert_eq!(back.frame.matte.as_ref(), output.matte);
        assert_eq!(back.confidence.as_ref(), Some(output.confidence));
        assert_eq!(back.history_length.as_ref(), Some(output.history_length));
        assert_eq!(back.metadata.content, Content::Denoised);
        // Another program's sum of the passes is the picture.
        let sum = back.frame.composite();
        for (a, b) in sum.data().iter().flatten().zip(output.composite.data().iter().flatten()) {
            assert!((a - b).abs() <= 1e-5 * b.abs().max(1e-3), "{a} is not {b}");
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
