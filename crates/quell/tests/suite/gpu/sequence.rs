//! The GPU's denoiser against the reference over whole sequences.

use super::agreement::{SEQUENCE, SIZE, canaries, compare, scenes};
use super::device::{By, Gpu, Output, colour_bytes, gpu};
use crate::suite::frames::{Noise, box_before_wall, denoise, guides, moving, with_radius};
use quell::gpu::wgpu::{CommandEncoderDescriptor, TextureFormat, TextureUsages, TextureView};
use quell::gpu::{self, Options, Storage, Texel, pack_guides};
use quell::{Backend, Camera, Denoiser, FrameBuf, Plane, Preset, Rgb, Settings, Size};

/// A frame's planes on the GPU, colours as 32-bit floats.
pub struct Uploaded {
    frame: FrameBuf,
    guides: [TextureView; 3],
    direct: TextureView,
    /// Light, weight, noisy direct light.
    signals: [Option<[Option<TextureView>; 3]>; 2],
}

impl Uploaded {
    pub fn new(gpu: &Gpu, frame: &FrameBuf, storage: Storage) -> Self {
        let size = frame.size;
        let colour = |plane: &Plane<Rgb>| gpu.texture("colour", TextureFormat::Rgba32Float, size, &colour_bytes(plane));
        let black = Plane::filled(size, [0.0; 3]);
        let signal = |light: &Option<Plane<Rgb>>, rest: [&Option<Plane<Rgb>>; 2]| {
            light.as_ref().map(|l| [Some(colour(l)), rest[0].as_ref().map(colour), rest[1].as_ref().map(colour)])
        };
        let texels = pack_guides(&guides(frame), storage);
        let guide = |texel: Texel, bytes: &[u8]| gpu.texture("guide", texel.format(storage), size, bytes);
        Self {
            guides: [
                guide(Texel::Geometry, &texels.geometry),
                guide(Texel::Surface, &texels.surface),
                guide(Texel::Moving, &texels.moving),
            ],
            direct: colour(frame.direct.as_ref().unwrap_or(&black)),
            signals: [
                signal(&frame.matte, [&frame.matte_weight, &frame.direct_matte]),
                signal(&frame.glossy, [&frame.glossy_weight, &frame.direct_glossy]),
            ],
            frame: frame.clone(),
        }
    }

    pub fn frame(&self) -> gpu::Frame<'_> {
        let signal = |k: usize| {
            let [light, weight, direct] = self.signals[k].as_ref()?;
            Some(gpu::Signal { light: light.as_ref()?, weight: weight.as_ref(), direct: direct.as_ref() })
        };
        let [geometry, surface, moving] = &self.guides;
        let f = &self.frame;
        let guides = gpu::PackedGuides {
            geometry,
            surface,
            moving,
            has_roughness: f.roughness.is_some(),
            has_glossy_hit: f.glossy_hit_distance.is_some(),
        };
        gpu::Frame {
            direct: Some(&self.direct),
            matte: signal(0),
            glossy: signal(1),
            ..gpu::Frame::new(f.size, f.camera, f.previous_camera, f.index, guides)
        }
    }
}

pub fn colours(size: Size, floats: &[f32]) -> Plane<Rgb> {
    Plane::from_vec(size, floats.chunks_exact(4).map(|c| [c[0], c[1], c[2]]).collect()).unwrap()
}

/// What both denoisers are compared by.
pub fn read(gpu: &Gpu, size: Size, output: &gpu::Output) -> Output {
    let planes: Vec<(&'static str, &TextureView)> = output
        .composite
        .iter()
        .map(|b| ("composite", b))
        .chain(output.direct.iter().map(|b| ("direct", b)))
        .chain(output.matte.iter().map(|b| ("matte", b)))
        .chain(output.glossy.iter().map(|b| ("glossy", b)))
        .collect();
    let mut views: Vec<&TextureView> = planes.iter().map(|(_, b)| *b).collect();
    views.extend(output.confidence.iter().chain(&output.history_length));
    let contents = gpu.read(size, &views);
    let colours = planes.iter().zip(&contents).map(|((name, _), floats)| (*name, colours(size, floats))).collect();
    let mut scalars = Vec::new();
    if let [confidence, length] = &contents[planes.len()..] {
        let magnitude = confidence.iter().skip(3).step_by(4).map(|a| a.abs()).collect();
        scalars.push(("confidence", Plane::from_vec(size, magnitude).unwrap()));
        scalars.push(("history length", Plane::from_vec(size, length.clone()).unwrap()));
    }
    Output { by: By::Gpu, colours, scalars }
}

pub fn on_reference(denoiser: &mut Denoiser, frame: &FrameBuf) -> Output {
    let kept = denoise(denoiser, frame);
    let mut colours = vec![("composite", kept.composite), ("direct", kept.direct)];
    colours.extend(kept.matte.map(|p| ("matte", p)));
    colours.extend(kept.glossy.map(|p| ("glossy", p)));
    let scalars = vec![("confidence", kept.confidence), ("history length", kept.history)];
    Output { by: By::Reference, colours, scalars }
}

pub fn on_gpu(gpu: &Gpu, denoiser: &mut gpu::Denoiser, frame: &FrameBuf) -> Output {
    let uploaded = Uploaded::new(gpu, frame, denoiser.storage());
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
    let output = denoiser.encode(&gpu.device, &mut encoder, &uploaded.frame()).unwrap();
    gpu.queue.submit([encoder.finish()]);
    read(gpu, frame.size, &output)
}

/// Everything exact.
pub fn exact(settings: &Settings) -> Options {
    let mut options = Options::new(settings);
    options.storage = Storage::Float;
    options.composite = true;
    options
}

fn both(gpu: &Gpu, settings: &Settings, frames: &[FrameBuf]) -> [Output; 2] {
    let size = frames[0].size;
    let mut reference = Denoiser::with_backend(size, settings, Backend::Reference).unwrap();
    let mut other = gpu::Denoiser::new(&gpu.device, size, &exact(settings)).unwrap();
    let run = |frame| [on_reference(&mut reference, frame), on_gpu(gpu, &mut other, frame)];
    frames.iter().map(run).last().unwrap()
}

pub fn agree([a, b]: [Output; 2], what: &str) {
    match compare(&a, &b, SEQUENCE) {
        Ok(seen) => println!("{what:<20} {seen:.1e} of {:.0e}", SEQUENCE.relative),
        Err(difference) => panic!("{what}: {difference}"),
    }
    for (canary, planted) in canaries(&b) {
        let seen = compare(&a, &planted, SEQUENCE).is_err();
        assert!(seen, "{what}: {canary} went unseen");
    }
}

#[test]
fn sequences_of_thirty_frames_agree() {
    let Some(gpu) = gpu() else { return };
    for (name, scene) in scenes() {
        for feedback in ["blend", "prefilter", "quality"] {
            let mut settings = with_radius(Settings::default(), SIZE, 12.0);
            match feedback {
                "quality" => settings = with_radius(Settings::preset(Preset::Quality), SIZE, 12.0),
                _ => settings.set("pipeline.feedback", feedback).unwrap(),
            }
            let frames: Vec<FrameBuf> = (0..30).map(|i| scene.frame(SIZE, i)).collect();
            agree(both(gpu, &settings, &frames), &format!("{name}, {feedback}"));
        }
    }
}

#[test]
fn every_feedback_and_switch_agrees() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let size = Size::new(37, 23);
    let mut frames: Vec<FrameBuf> = (0..4).map(|i| scene.frame(size, i)).collect();
    for (i, frame) in frames.iter_mut().enumerate() {
        // Jitter for stage 11, noisy direct light for the composite, and no weight for one signal.
        frame.camera.jitter = [0.25, -0.125 * i as f32];
        (frame.direct_matte, frame.direct_glossy) = (frame.glossy.clone(), frame.matte.clone());
        frame.glossy_weight = None;
    }
    for (name, value) in [
        ("pipeline.feedback", "temporal"),
        ("pipeline.feedback", "firefly"),
        ("pipeline.feedback", "bilateral"),
        ("matte_temporal.enabled", "off"),
        ("matte_prefilter.enabled", "off"),
        ("disocclusion.enabled", "off"),
        ("firefly.enabled", "off"),
        ("firefly.input", "temporal"),
        ("matte_bilateral.enabled", "off"),
        ("glossy_temporal.enabled", "off"),
        ("glossy_bilateral.enabled", "off"),
        ("direct_taa.enabled", "off"),
        ("antialiasing.enabled", "on"),
    ] {
        let mut settings = Settings::default();
        settings.set(name, value).unwrap();
        agree(both(gpu, &settings, &frames), &format!("{name} {value}"));
    }
}

#[test]
fn a_cut_a_resize_and_planes_that_come_and_go_agree() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let settings = Settings::default();
    let mut a = Denoiser::with_backend(Size::new(8, 8), &settings, Backend::Reference).unwrap();
    let mut b = gpu::Denoiser::new(&gpu.device, Size::new(8, 8), &exact(&settings)).unwrap();
    let mut size = Size::new(8, 8);
    for (i, index) in [(0, 0), (1, 1), (2, 7), (3, 8), (4, 9), (5, 10), (6, 11), (7, 10), (8, 11)] {
        let wanted = if i < 6 { Size::new(37, 23) } else { Size::new(5, 41) };
        if wanted != size {
            a.resize(wanted).unwrap();
            b.resize(&gpu.device, wanted).unwrap();
            size = wanted;
        }
        let mut frame = scene.frame(size, index);
        match i {
            1 => frame.glossy_hit_distance = None,
            3 => frame.glossy = None,
            4 => (frame.surface_id, frame.roughness, frame.motion) = (None, None, None),
            5 => (frame.matte, frame.normal, frame.direct) = (None, None, None),
            8 => (a.reset(), b.reset()).0,
            _ => frame.confidence_in = Some(Plane::from_fn(size, |x, _| (x % 3) as f32 * 0.5)),
        }
        agree([on_reference(&mut a, &frame), on_gpu(gpu, &mut b, &frame)], &format!("frame {i}"));
    }
    // A cut that one of the two had overlooked.
    let frames: Vec<FrameBuf> = (0..3).map(|i| scene.frame(Size::new(37, 23), i)).collect();
    let mut cut = frames.clone();
    cut[2].index = 9;
    let [a, _] = both(gpu, &settings, &frames);
    let [_, b] = both(gpu, &settings, &cut);
    assert!(compare(&a, &b, SEQUENCE).is_err(), "a cut went unseen");
}

#[test]
fn frames_encoded_before_one_submit_are_as_if_submitted_singly() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let (size, settings) = (Size::new(37, 23), Settings::default());
    let uploaded: Vec<Uploaded> = (0..3).map(|i| Uploaded::new(gpu, &scene.frame(size, i), Storage::Half)).collect();
    let last = uploaded[2].frame();
    // `overwritten`: every frame reads the uniforms of the last one, as if all read one buffer after all had written it.
    let run = |together: bool, count: usize, overwritten: bool| {
        let mut denoiser = gpu::Denoiser::new(&gpu.device, size, &Options::new(&settings)).unwrap();
        let encoder = || gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
        let mut open = encoder();
        let mut output = None;
        for frame in &uploaded[..count] {
            let mut frame = frame.frame();
            if overwritten {
                (frame.camera, frame.previous_camera) = (last.camera, last.previous_camera);
            }
            output = Some(denoiser.encode(&gpu.device, &mut open, &frame).unwrap());
            if !together {
                gpu.queue.submit([std::mem::replace(&mut open, encoder()).finish()]);
            }
        }
        gpu.queue.submit([open.finish()]);
        read(gpu, size, &output.unwrap()).colours
    };
    let right = run(false, 3, false);
    assert_eq!(run(true, 3, false), right);
    assert_ne!(run(true, 2, false), right, "the same frame again");
    assert_ne!(run(false, 3, true), right, "uniforms of a frame do not show");
}

#[test]
fn textures_that_change_places_are_seen_though_bindings_are_kept() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let (size, settings) = (Size::new(37, 23), Settings::default());
    let uploaded: Vec<Uploaded> = (0..6).map(|i| Uploaded::new(gpu, &scene.frame(size, i), Storage::Half)).collect();
    // The host's textures: the same ones at every frame, every other, every third, new ones.
    let run = |period: usize, starts_anew: bool| {
        let make = || gpu::Denoiser::new(&gpu.device, size, &Options::new(&settings)).unwrap();
        let mut denoiser = make();
        let mut outputs = Vec::new();
        for index in 0..6 {
            if starts_anew {
                denoiser = make();
            }
            let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
            let frame = gpu::Frame { index: index as i64, ..uploaded[index % period].frame() };
            let output = denoiser.encode(&gpu.device, &mut encoder, &frame).unwrap();
            gpu.queue.submit([encoder.finish()]);
            outputs.push(read(gpu, size, &output).colours);
        }
        outputs
    };
    let all = [1, 2, 3, 6].map(|period| run(period, false));
    // Up to where the textures come back it is the same sequence; from there on another.
    for (k, period) in [1, 2, 3].into_iter().enumerate() {
        assert_eq!(all[k][..period], all[3][..period]);
        assert_ne!(all[k][period], all[3][period], "period {period}");
    }
    assert_ne!(run(6, true)[5], all[3][5], "history does not show");
}

#[test]
fn what_cannot_be_encoded_is_an_error_and_changes_nothing() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let (size, settings) = (Size::new(37, 23), Settings::default());
    let uploaded = Uploaded::new(gpu, &scene.frame(size, 0), Storage::Half);
    let options = Options::new(&settings);
    let mut denoiser = gpu::Denoiser::new(&gpu.device, size, &options).unwrap();
    let mut encode = |frame: &gpu::Frame<'_>| {
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
        denoiser.encode(&gpu.device, &mut encoder, frame).map(|output| output.had_history)
    };
    let few = Size::new(4, 4);
    let small = gpu.texture("small", TextureFormat::Rgba16Float, few, &[0; 128]);
    let private = gpu.texture_with("private", TextureFormat::Rgba16Float, few, &[0; 128], TextureUsages::COPY_SRC);
    let good = uploaded.frame();
    assert_eq!(encode(&good), Ok(false));
    let gpu::Guides::Packed(packed) = good.guides else { panic!() };
    let guides = gpu::PackedGuides { geometry: &small, ..packed };
    let error = encode(&gpu::Frame { guides: guides.into(), ..good }).unwrap_err();
    assert!(error.to_string().contains("geometry"), "{error}");
    let error = encode(&gpu::Frame { direct: Some(&small), ..good }).unwrap_err();
    assert!(error.to_string().contains("`direct`"), "{error}");
    let error = encode(&gpu::Frame { direct: Some(&private), ..good }).unwrap_err();
    assert!(error.to_string().contains("TEXTURE_BINDING"), "{error}");
    let camera = Camera { clip_from_world: [0.0; 16], ..good.camera };
    let error = encode(&gpu::Frame { camera, ..good }).unwrap_err();
    assert!(error.to_string().contains("camera"), "{error}");
    assert_eq!(encode(&gpu::Frame { index: 1, ..good }), Ok(true), "history was lost by an error");
    for bad in [Size::new(0, 4), Size::new(1 << 20, 1), Size::new(32768, 32768)] {
        assert!(gpu::Denoiser::new(&gpu.device, bad, &options).is_err(), "{bad}");
    }
}
