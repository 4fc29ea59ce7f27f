//! Frames made here, to try what no shared file holds: light groups, half buffers, several pictures, one seed, mixed
//! sizes.

use crate::Folder;
use exr::prelude::*;
use quell::sequence::SequenceFrame;
use quell_frames::driver::{Destination, Existing, Job, JobOptions};
use quell_frames::{AdaptOptions, Adapter, ExrImage, Links, MapOptions, Role, map_roles, read_image};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

const WIDTH: usize = 48;
const HEIGHT: usize = 32;

/// Noise between 0 and 1 from a place and a seed.
fn noise(x: usize, y: usize, seed: usize) -> f32 {
    let mut h = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    h = (h ^ (seed as u64).wrapping_mul(0x1656_67b1_9e37_79f9)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    h = (h ^ (h >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    (h >> 40) as f32 / (1u64 << 24) as f32
}

pub type Value<'f> = &'f dyn Fn(usize, usize) -> f32;

pub fn write(folder: &Folder, name: &str, size: (usize, usize), channels: &[(&str, Value<'_>)]) -> PathBuf {
    let channels: Vec<AnyChannel<FlatSamples>> = channels
        .iter()
        .map(|(name, value)| {
            let samples = (0..size.0 * size.1).map(|i| f16::from_f32(value(i % size.0, i / size.0))).collect();
            AnyChannel::new(*name, FlatSamples::F16(samples))
        })
        .collect();
    let layer =
        Layer::new(size, LayerAttributes::default(), Encoding::FAST_LOSSLESS, AnyChannels::sort(channels.into()));
    let path = folder.file(name);
    Image::from_layer(layer).write().non_parallel().to_file(&path).unwrap();
    path
}

fn adapter(path: &Path) -> (Adapter, Vec<ExrImage>) {
    let images = vec![read_image(path).unwrap()];
    let named = [(String::new(), &images[0])];
    let mapping = map_roles(&named, &MapOptions::default()).unwrap().swap_remove(0);
    (Adapter::new(mapping, images[0].full_window(), &images, None, &AdaptOptions::default()).unwrap(), images)
}

fn smoothed(frame: &SequenceFrame) -> Vec<quell::Plane<quell::Rgb>> {
    let smooth = |plane: &quell::Plane<quell::Rgb>| {
        quell::Plane::from_fn(plane.size(), |x, y| {
            let near = [(x.max(1) - 1, y), ((x + 1).min(WIDTH - 1), y), (x, y)];
            std::array::from_fn(|c| near.iter().map(|(u, v)| plane.at(*u, *v)[c]).sum::<f32>() / 3.0)
        })
    };
    frame.lights.iter().map(|light| smooth(&light.light)).collect()
}

fn values(images: &[ExrImage], name: &str) -> Vec<f32> {
    let part = &images[0].parts()[0];
    let channel = part.find(name).unwrap();
    images[0].samples(0, channel).unwrap().to_f32()
}

#[test]
fn light_groups_are_scaled_to_the_filtered_beauty_and_add_up_when_they_did_before() {
    let folder = Folder::new("groups");
    let key = |x: usize, y: usize| noise(x, y, 1);
    let fill = |x: usize, y: usize| 0.5 * noise(x, y, 2);
    let both = |x: usize, y: usize| key(x, y) + fill(x, y);
    let mut channels: Vec<(String, Value<'_>)> = Vec::new();
    for c in ["R", "G", "B"] {
        channels.push((format!("V.Combined.{c}"), &both));
        channels.push((format!("V.Combined_key.{c}"), &key));
        channels.push((format!("V.Combined_fill.{c}"), &fill));
    }
    let channels: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let (adapter, mut images) = adapter(&write(&folder, "g.exr", (WIDTH, HEIGHT), &channels));
    let frame = adapter.frame(1, &images, &mut Links::default()).unwrap().frame;
    assert_eq!(frame.lights.len(), 4, "beauty, two groups, what no group holds");
    assert_eq!(frame.lights.iter().filter(|l| l.in_beauty).count(), 1);
    let report = adapter.write_back(&mut images, &frame, &smoothed(&frame), None).unwrap();
    assert_eq!(report.normalised, ["V.Combined_fill", "V.Combined_key"]);
    let [beauty, key_after, fill_after] =
        ["Combined", "Combined_key", "Combined_fill"].map(|n| values(&images, &format!("V.{n}.G")));
    for i in 0..beauty.len() {
        // Three roundings, and the remainder that half rounding of the input left to no group.
        assert!((key_after[i] + fill_after[i] - beauty[i]).abs() < 4e-3 * beauty[i] + 1e-4, "{i}");
    }
    assert!(
        key_after.iter().zip(0..).any(|(k, i)| (k - key(i % WIDTH, i / WIDTH)).abs() > 0.05),
        "groups are filtered"
    );
}

#[test]
fn a_picture_beside_a_noisy_one_is_written_too() {
    let folder = Folder::new("twins");
    let noisy = |x: usize, y: usize| noise(x, y, 3);
    let clean = |_: usize, _: usize| 0.25;
    let mut channels: Vec<(String, Value<'_>)> = Vec::new();
    for c in ["R", "G", "B"] {
        channels.push((format!("V.Noisy Image.{c}"), &noisy));
        channels.push((format!("V.Combined.{c}"), &clean));
    }
    let channels: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let (adapter, mut images) = adapter(&write(&folder, "t.exr", (WIDTH, HEIGHT), &channels));
    assert_eq!(adapter.mapping().get(Role::Beauty).unwrap().name, "V.Noisy Image");
    let frame = adapter.frame(1, &images, &mut Links::default()).unwrap().frame;
    adapter.write_back(&mut images, &frame, &smoothed(&frame), None).unwrap();
    assert_eq!(values(&images, "V.Noisy Image.R"), values(&images, "V.Combined.R"));
    assert_ne!(values(&images, "V.Combined.R")[40], 0.25);
}

/// A picture of stripes, raw and (if `denoised`) as the renderer filtered it itself, without any guide; what the filter
/// makes of it. Returns mean squared errors against the stripes, noisy and filtered.
fn without_guides(name: &str, denoised: bool) -> ([f64; 2], Vec<String>) {
    let folder = Folder::new(name);
    let stripes = |x: usize, _: usize| if (x / 2).is_multiple_of(2) { 0.8 } else { 0.2 };
    let noisy = move |x: usize, y: usize| stripes(x, y) * (0.4 + 1.2 * noise(x, y, 3));
    let mut channels: Vec<(String, Value<'_>)> = Vec::new();
    for c in ["R", "G", "B"] {
        if denoised {
            channels.push((format!("V.Noisy Image.{c}"), &noisy));
            channels.push((format!("V.Combined.{c}"), &stripes));
        } else {
            channels.push((format!("V.Combined.{c}"), &noisy));
        }
    }
    let channels: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let path = write(&folder, "shot.0001.exr", (WIDTH, HEIGHT), &channels);
    let (adapter, images) = adapter(&path);
    let job = Job::open(JobOptions {
        inputs: vec![path],
        destination: Destination::parse(&folder.file("clean")).unwrap(),
        existing: Existing::Ours,
        frames: None,
        shot: None,
        cuts: None,
        map: MapOptions::default(),
        adapt: AdaptOptions::default(),
        settings: quell::sequence::SequenceSettings::default(),
        max_memory: None,
        bands: None,
        backend: quell::Backend::default(),
        accelerator: None,
        measure_noise: false,
    });
    assert_eq!(job.unwrap().run(&AtomicBool::new(false), &|_| {}).unwrap().written(), 1);
    let raw = if denoised { "V.Noisy Image.R" } else { "V.Combined.R" };
    let result = vec![read_image(&folder.file("clean").join("shot.0001.exr")).unwrap()];
    let off = |images: &[ExrImage]| {
        let differ = |(i, v): (usize, &f32)| f64::from(v - stripes(i % WIDTH, i / WIDTH)).powi(2);
        values(images, raw).iter().enumerate().map(differ).sum::<f64>()
    };
    ([off(&images), off(&result)], adapter.warnings().to_vec())
}

#[test]
fn what_the_renderer_denoised_itself_steers_where_there_is_no_guide_and_the_user_is_told() {
    let ([noisy, filtered], warnings) = without_guides("denoised", true);
    assert!(filtered < 0.1 * noisy, "{filtered} of {noisy}");
    let told = |words: &str| warnings.iter().any(|w| w.contains(words));
    assert!(
        told("`V.Combined` itself") && told("cycles.use_denoising") && told("the denoised picture alone"),
        "{warnings:?}"
    );
    // The same noise without that picture: stripes of two pixels are noise to the filter, and nothing claims otherwise.
    let ([noisy, filtered], warnings) = without_guides("undenoised", false);
    assert!(filtered > 0.1 * noisy, "{filtered} of {noisy}");
    assert!(warnings.iter().all(|w| !w.contains("denoised")), "{warnings:?}");
}

#[test]
fn variance_comes_from_the_file_or_from_halves_of_the_samples() {
    let folder = Folder::new("variance");
    // Two halves with deviation 0.2 each: their mean has variance 0.02.
    let half = |seed: usize| move |x: usize, y: usize| 1.0 + 0.2 * ((noise(x, y, seed) - 0.5) * 12f32.sqrt());
    let (a, b) = (half(5), half(6));
    let mean = |x: usize, y: usize| (a(x, y) + b(x, y)) * 0.5;
    let mut channels: Vec<(String, Value<'_>)> = Vec::new();
    for c in ["R", "G", "B"] {
        channels.push((c.to_owned(), &mean));
        channels.push((format!("half_a.{c}"), &a));
        channels.push((format!("half_b.{c}"), &b));
    }
    let list: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let (from_halves, images) = adapter(&write(&folder, "h.exr", (WIDTH, HEIGHT), &list));
    let variance = from_halves.frame(1, &images, &mut Links::default()).unwrap().frame.variance.unwrap();
    let found = variance.data().iter().sum::<f32>() / variance.data().len() as f32;
    assert!((found / 0.02 - 1.0).abs() < 0.15, "{found}");

    let known = |_: usize, _: usize| 0.03125;
    for c in ["R", "G", "B"] {
        channels.push((format!("variance.{c}"), &known));
    }
    let list: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let (from_file, images) = adapter(&write(&folder, "v.exr", (WIDTH, HEIGHT), &list));
    let variance = from_file.frame(1, &images, &mut Links::default()).unwrap().frame.variance.unwrap();
    assert!(variance.data().iter().all(|v| (v - 0.03125).abs() < 1e-5));
}

#[test]
fn one_seed_is_told_from_independent_noise_on_textures_and_in_still_scenes() {
    let folder = Folder::new("seed");
    let texture = |x: usize, y: usize| 0.3 + 0.3 * noise(x / 2, y / 2, 77);
    let frame_of = |shift: usize, seed: usize, name: &str| {
        let light = move |x: usize, y: usize| 0.3 + noise(x, y, seed) * 0.8 + (x + shift) as f32 * 0.002;
        let albedo = move |x: usize, y: usize| texture(x + shift, y);
        let picture = move |x: usize, y: usize| light(x, y) * albedo(x, y);
        let flat = |_: usize, _: usize| 4.0;
        let mut channels: Vec<(String, Value<'_>)> = vec![("Z".to_owned(), &flat)];
        for c in ["R", "G", "B"] {
            channels.push((c.to_owned(), &picture));
            channels.push((format!("albedo.{c}"), &albedo));
        }
        let list: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        write(&folder, name, (WIDTH * 3, HEIGHT * 4), &list)
    };
    let first = frame_of(0, 1, "1.exr");
    for (shift, seed, repeats) in [(0, 2, false), (0, 1, true), (4, 2, false), (4, 1, true)] {
        let second = frame_of(shift, seed, "2.exr");
        let (adapter, images) = adapter(&first);
        let mut links = Links::default();
        adapter.frame(1, &images, &mut links).unwrap();
        let next = vec![read_image(&second).unwrap()];
        let made = adapter.frame(2, &next, &mut links).unwrap();
        assert_eq!(made.frame.repeats_noise, repeats, "shift {shift}, seed {seed}");
        // After a gap nothing is compared.
        let mut links = Links::default();
        adapter.frame(1, &images, &mut links).unwrap();
        assert!(!adapter.frame(3, &next, &mut links).unwrap().frame.repeats_noise);
    }
}

/// A still picture with more detail than noise, as at many samples: detail that stands still is no seed.
#[test]
fn detail_that_stands_still_is_no_seed() {
    let folder = Folder::new("seed-detail");
    // A carpet in the lower third, which no guide shows; walls above.
    let light = |x: usize, y: usize, seed: usize| {
        let carpet = if y > HEIGHT * 8 / 3 { 0.5 * noise(x / 2, y / 2, 5) } else { 0.0 };
        0.3 + carpet + 0.1 * noise(x, y, seed)
    };
    let write_one = |seed: usize, name: &str| {
        let picture = move |x: usize, y: usize| light(x, y, seed);
        let flat = |_: usize, _: usize| 4.0;
        let grey = |_: usize, _: usize| 0.5;
        let mut channels: Vec<(String, Value<'_>)> = vec![("Z".to_owned(), &flat)];
        for c in ["R", "G", "B"] {
            channels.push((c.to_owned(), &picture));
            channels.push((format!("albedo.{c}"), &grey));
        }
        let list: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        write(&folder, name, (WIDTH * 3, HEIGHT * 4), &list)
    };
    let first = write_one(1, "1.exr");
    for (seed, repeats) in [(2, false), (1, true)] {
        let second = write_one(seed, "2.exr");
        let (adapter, images) = adapter(&first);
        let mut links = Links::default();
        adapter.frame(1, &images, &mut links).unwrap();
        let next = vec![read_image(&second).unwrap()];
        assert_eq!(adapter.frame(2, &next, &mut links).unwrap().frame.repeats_noise, repeats, "seed {seed}");
    }
}

#[test]
fn frames_of_other_sizes_and_files_without_the_channels_are_named() {
    let folder = Folder::new("mixed");
    let value = |x: usize, y: usize| noise(x, y, 9);
    let rgb: [(&str, Value<'_>); 3] = [("R", &value), ("G", &value), ("B", &value)];
    let (adapter, _) = adapter(&write(&folder, "a.exr", (WIDTH, HEIGHT), &rgb));
    let mut links = Links::default();
    let small = vec![read_image(&write(&folder, "small.exr", (WIDTH / 2, HEIGHT), &rgb)).unwrap()];
    let error = adapter.frame(2, &small, &mut links).unwrap_err().to_string();
    assert!(error.contains("small.exr") && error.contains("24x32") && error.contains("48x32"), "{error}");
    let grey = vec![read_image(&write(&folder, "grey.exr", (WIDTH, HEIGHT), &rgb[..1])).unwrap()];
    let error = adapter.frame(2, &grey, &mut links).unwrap_err().to_string();
    assert!(error.contains("grey.exr") && error.contains("channel"), "{error}");
    let unread = vec![quell_frames::read_headers(&folder.file("a.exr")).unwrap()];
    let error = adapter.frame(2, &unread, &mut links).unwrap_err().to_string();
    assert!(error.contains("a.exr") && error.contains("was not read"), "{error}");
    assert!(adapter.frame(2, &[], &mut links).is_err());
}

#[test]
fn frames_of_quell_have_their_cameras_in_the_header_and_move_by_them() {
    use quell::{Camera, FrameBuf, Plane, Size};
    use quell_frames::{FrameToWrite, WriteOptions, write_frame};
    let folder = Folder::new("own");
    let size = Size::new(WIDTH, HEIGHT);
    let camera = |k: f32| {
        Camera::perspective(
            [0.3 * k, 1.0, 4.0],
            [0.1 * k, -0.2, -1.0],
            [0.0, 1.0, 0.0],
            0.9,
            WIDTH as f32 / HEIGHT as f32,
        )
    };
    let depth = |x: usize, y: usize| if y < 4 { f32::INFINITY } else { 3.0 + x as f32 * 0.02 };
    for k in [1, 2] {
        let mut frame = FrameBuf::new(size, camera(k as f32));
        frame.matte = Some(Plane::from_fn(size, |x, y| [noise(x, y, k), 0.5, 0.25]));
        frame.matte_weight = Some(Plane::filled(size, [0.5, 0.25, 0.75]));
        frame.view_depth = Some(Plane::from_fn(size, depth));
        write_frame(
            &folder.file(&format!("q.{k:04}.exr")),
            &FrameToWrite::new(frame.frame(&[])),
            &WriteOptions::default(),
        )
        .unwrap();
    }
    let (adapter, first) = adapter(&folder.file("q.0001.exr"));
    assert_eq!(adapter.mapping().renderer.name, "quell");
    assert!(adapter.rule().complete && !adapter.rule().colour_inside, "{}", adapter.rule().describe());
    let mut links = Links::default();
    adapter.frame(1, &first, &mut links).unwrap();
    let second = vec![read_image(&folder.file("q.0002.exr")).unwrap()];
    let made = adapter.frame(2, &second, &mut links).unwrap();
    let found = made.camera.unwrap();
    assert!((0..3).all(|c| (found.eye[c] - camera(2.0).position[c]).abs() < 1e-4), "{:?}", found.eye);
    // The same by the denoiser's own cameras.
    let [before, now] = [camera(1.0), camera(2.0)].map(|c| c.projection(size).unwrap());
    let motion = made.frame.motion_to_previous.unwrap();
    for (x, y) in [(3, 9), (40, 20), (20, 30)] {
        let at = [x as f32 + 0.5, y as f32 + 0.5];
        let world = now.world(at.into(), depth(x, y));
        let there = before.pixel(world).unwrap();
        let expected = [there.x - at[0], there.y - at[1]];
        let v = motion.at(x, y);
        assert!((v[0] - expected[0]).hypot(v[1] - expected[1]) < 1e-2, "{v:?} {expected:?}");
    }
    assert!(motion.at(10, 1)[0].is_finite(), "the background turns with the camera");
}

#[test]
fn an_albedo_that_is_no_reflectance_is_left_out_and_the_user_is_told() {
    let folder = Folder::new("albedo");
    let beauty = |x: usize, y: usize| noise(x, y, 5);
    // Right but for one pixel, an estimator's; and noise around 1.
    let right = |x: usize, y: usize| if (x, y) == (7, 9) { 10.0 } else { 0.25 };
    let wrong = |x: usize, y: usize| 2.0 * noise(x, y, 6);
    let made = |name: &str, albedo: Value<'_>| {
        let channels = ["R", "G", "B"].map(|c| [(c.to_owned(), &beauty as Value<'_>), (format!("albedo.{c}"), albedo)]);
        let channels = channels.concat();
        let channels: Vec<(&str, Value<'_>)> = channels.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        let (adapter, images) = adapter(&write(&folder, name, (WIDTH, HEIGHT), &channels));
        let frame = adapter.frame(1, &images, &mut Links::default()).unwrap().frame;
        let said = adapter.warnings().iter().any(|warning| warning.contains("albedo is above 1"));
        (frame.lights[0].weight.as_ref().map(|weight| weight.at(7, 9)), said)
    };
    assert_eq!(made("right.exr", &right), (Some([1.0; 3]), false));
    assert_eq!(made("wrong.exr", &wrong), (None, true));
}
