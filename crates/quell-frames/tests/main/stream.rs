//! Frames in memory: the bits of files, shots, and what does not fit.

use crate::Folder;
use quell::Size;
use quell::sequence::SequenceSettings;
use quell_frames::arrays::{ArrayPass, filtered, image_of};
use quell_frames::driver::{Cleaned, Destination, Existing, Job, JobOptions, Stream, StreamOptions};
use quell_frames::image::read_image;
use quell_frames::{AdaptOptions, AttributeValue, ExrImage, MapOptions, MotionChoice, Role, Samples, frame_path};
use std::path::Path;
use std::sync::atomic::AtomicBool;

const FRAMES: i64 = 7;
const SIZE: Size = Size::new(12, 9);

fn settings() -> SequenceSettings {
    let mut settings = SequenceSettings::default();
    settings.gather.frames = 2;
    settings.stabilise.frames = 1;
    settings
}

fn options(map: MapOptions) -> StreamOptions {
    StreamOptions {
        map,
        adapt: AdaptOptions::default(),
        settings: settings(),
        cuts: None,
        backend: quell::Backend::default(),
        accelerator: None,
    }
}

/// What a file holds, without the file.
fn in_memory(image: &ExrImage, number: i64) -> ExrImage {
    let part = &image.parts()[0];
    let channels = part.channels().iter().map(|c| (c.name().to_owned(), c.samples().unwrap().clone()));
    let label = format!("frame {number}");
    let mut made = ExrImage::from_channels(Path::new(&label), part.size(), channels.collect()).unwrap();
    for (name, value) in part.attributes() {
        if let ("quell.clip_from_world", AttributeValue::Matrix4x4(_)) = (name.as_str(), &value) {
            made.set_attribute(&name, value).unwrap();
        }
    }
    made
}

#[test]
fn frames_in_memory_come_out_to_the_bit_as_files_do() {
    let folder = Folder::new("stream-bits");
    let numbers: Vec<i64> = (1..=FRAMES).filter(|n| *n != 4).collect();
    numbers.iter().for_each(|number| crate::driver::make(&folder.file("in"), *number));
    let job = Job::open(JobOptions {
        inputs: vec![folder.file("in")],
        destination: Destination::parse(&folder.file("out")).unwrap(),
        existing: Existing::Ours,
        frames: None,
        shot: None,
        cuts: Some(vec![6]),
        map: MapOptions::default(),
        adapt: AdaptOptions::default(),
        settings: settings(),
        max_memory: None,
        bands: None,
        backend: quell::Backend::default(),
        accelerator: None,
        measure_noise: false,
    });
    job.unwrap().run(&AtomicBool::new(false), &|_| {}).unwrap();

    let mut stream = Stream::new(StreamOptions { cuts: Some(vec![6]), ..options(MapOptions::default()) }).unwrap();
    let mut came: Vec<Cleaned> = Vec::new();
    let mut out = |cleaned: Cleaned| {
        came.push(cleaned);
        true
    };
    for number in &numbers {
        let image = read_image(&frame_path(&folder.file("in"), "shot", *number)).unwrap();
        stream.push(*number, in_memory(&image, *number), &mut out).unwrap();
    }
    stream.flush(&mut out).unwrap();
    assert_eq!(came.iter().map(|c| c.number).collect::<Vec<_>>(), numbers);
    let mut compared = 0;
    for cleaned in &came {
        let file = read_image(&frame_path(&folder.file("out"), "shot", cleaned.number)).unwrap();
        let input = read_image(&frame_path(&folder.file("in"), "shot", cleaned.number)).unwrap();
        for (i, channel) in cleaned.image.parts()[0].channels().iter().enumerate() {
            let Some(samples) = channel.samples() else { continue };
            assert!(channel.is_replaced());
            assert_eq!(Some(samples), file.samples(0, i), "frame {} {}", cleaned.number, channel.name());
            compared += usize::from(Some(samples) != input.samples(0, i));
        }
        assert!(cleaned.noise.as_ref().unwrap().data().iter().all(|v| v.is_finite()));
    }
    assert!(compared >= 3 * numbers.len(), "what is compared was filtered: {compared}");
}

fn noise(i: usize, seed: i64) -> f32 {
    let h = (i as u64 + 1).wrapping_mul(seed as u64 + 3).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32 / (1u64 << 24) as f32
}

fn colour(name: &str, role: Option<Role>, seed: i64, components: usize) -> ArrayPass {
    let plane = |c: usize| Samples::Float((0..SIZE.pixels()).map(|i| noise(7 * i + c, seed)).collect());
    ArrayPass { name: name.to_owned(), role, components: (0..components).map(plane).collect() }
}

fn image(number: i64, passes: Vec<ArrayPass>) -> (ExrImage, Vec<String>) {
    image_of(Path::new(&format!("frame {number}")), SIZE, passes, None).unwrap()
}

#[test]
fn passes_by_argument_and_by_a_renderers_name_are_found_and_come_back() {
    let passes = |number| {
        let four = |v: f32| Samples::Float(vec![v; SIZE.pixels()]);
        vec![
            colour("color", Some(Role::Beauty), number, 4),
            colour("AO", None, number, 1),
            ArrayPass {
                name: "Vector".to_owned(),
                role: None,
                components: vec![four(1.0), four(0.0), four(-1.0), four(0.0)],
            },
            ArrayPass { name: "depth".to_owned(), role: Some(Role::Depth), components: vec![four(3.0)] },
        ]
    };
    let (first, wishes) = image(1, passes(1));
    assert_eq!(wishes, ["beauty=color", "depth=depth"]);
    let map = MapOptions { map: wishes, renderer: Some("blender".to_owned()), ..MapOptions::default() };
    let mut stream = Stream::new(options(map)).unwrap();
    let mut came = Vec::new();
    let mut out = |cleaned| {
        came.push(cleaned);
        true
    };
    stream.push(1, first, &mut out).unwrap();
    assert_eq!(stream.mapping(), "", "the second frame decides, too");
    stream.push(2, image(2, passes(2)).0, &mut out).unwrap();
    let mapping = stream.mapping();
    for line in
        ["renderer = blender (asked for)", "motion = Vector", "steady_part = AO", "motion by the preset `blender`"]
    {
        assert!(mapping.contains(line), "{line}: {mapping}");
    }
    // One with other passes is left out, and the others stay.
    let error = stream.push(3, image(3, passes(3).split_off(2)).0, &mut out).unwrap_err().to_string();
    assert!(error.contains("frame 3: its passes are not those"), "{error}");
    // So is one whose number does not rise.
    for number in [2, 1] {
        let error = stream.push(number, image(number, passes(number)).0, &mut out).unwrap_err().to_string();
        assert!(error.contains(&format!("number {number} after 2; numbers rise")), "{error}");
    }
    stream.push(3, image(3, passes(3)).0, &mut out).unwrap();
    stream.flush(&mut out).unwrap();
    assert_eq!(came.iter().map(|c: &Cleaned| c.number).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(filtered(&came[0].image, "color", 4).unwrap().len(), 4);
    assert!(filtered(&came[0].image, "depth", 1).is_none() && filtered(&came[0].image, "AO", 1).is_none());
}

#[test]
fn what_does_not_fit_is_named() {
    let says = |passes: Vec<ArrayPass>| image_of(Path::new("frame 5"), SIZE, passes, None).unwrap_err().to_string();
    let error = says(vec![colour("bueaty", None, 1, 3)]);
    assert!(error.contains("frame 5: `bueaty`: no renderer calls") && error.contains("matte_direct"), "{error}");
    let error = says(vec![colour("normal", Some(Role::Normal), 1, 2)]);
    assert!(error.contains("`normal`: 2 channels, and normal has 3"), "{error}");
    let error = says(vec![colour("albedo", Some(Role::Albedo), 1, 4)]);
    assert!(error.contains("4 channels, and albedo has 1 to 3"), "{error}");
    let error = says(vec![colour("color", Some(Role::Beauty), 1, 3), colour("color", None, 1, 1)]);
    assert!(error.contains("two passes of this name"), "{error}");
    let error =
        says(vec![ArrayPass { name: "color".into(), role: None, components: vec![Samples::Float(vec![0.0; 7])] }]);
    assert!(error.contains("7 samples a channel, not 108"), "{error}");
    assert!(says(Vec::new()).contains("12x9 pixels, 0 channels"));

    let (first, _) = image(1, vec![colour("color", Some(Role::Beauty), 1, 3)]);
    let map = MapOptions { renderer: Some("blunder".to_owned()), ..MapOptions::default() };
    let mut stream = Stream::new(options(map)).unwrap();
    stream.push(1, first.clone(), &mut |_| true).unwrap();
    let error = stream.flush(&mut |_| true).unwrap_err().to_string();
    assert!(error.contains("there is no renderer `blunder`; there are `quell`, `blender`"), "{error}");
    // A single frame whose vectors nobody can understand is filtered by itself, and that is said.
    let motion = colour("motion", Some(Role::Motion), 1, 2);
    let (alone, wishes) = image(1, vec![colour("color", Some(Role::Beauty), 1, 3), motion]);
    let map = MapOptions { map: wishes, ..MapOptions::default() };
    let adapt = AdaptOptions { motion: MotionChoice::Auto, ..AdaptOptions::default() };
    let mut stream = Stream::new(StreamOptions { adapt, ..options(map) }).unwrap();
    stream.push(1, alone, &mut |_| true).unwrap();
    stream.decide(&mut |_| true).unwrap();
    assert!(stream.warnings().iter().any(|w| w.contains("one frame alone")), "{:?}", stream.warnings());
}
