//! The denoiser as hosts use it: their textures, what they leave out, where they want results, changing sizes, views.

use super::agreement::{SEQUENCE, canaries, compare};
use super::device::{By, Gpu, Output, gpu};
use super::sequence::{agree, exact, on_reference, read};
use super::textures::{HostFrame, read_counts};
use crate::suite::frames::{
    Noise, Scene, box_before_wall, denoise, hash, mirror, moving, sphere, still, wall, with_radius,
};
use quell::frame::PassBuf;
use quell::gpu::wgpu::{self, CommandEncoder, CommandEncoderDescriptor, TextureUsages, TextureView};
use quell::gpu::{self, DebugTarget, DebugView, DebugViews, Options, Slot, Storage, Targets, Texel};
use quell::pipeline::Image;
use quell::{Backend, Denoiser, FrameBuf, Plane, Rgb, Settings, Signal, Size};

const SIZE: Size = Size::new(48, 31);

fn encoder(gpu: &Gpu) -> CommandEncoder {
    gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") })
}

/// Encodes a frame by itself, submits it, and reads what came out.
fn run(gpu: &Gpu, denoiser: &mut gpu::Denoiser, host: &HostFrame, targets: Targets<'_>) -> gpu::Output {
    let joint = host.joint();
    let mut open = encoder(gpu);
    let frame = gpu::Frame { targets, ..host.frame(&joint) };
    let output = denoiser.encode(&gpu.device, &mut open, &frame).unwrap();
    gpu.queue.submit([open.finish()]);
    output
}

fn on_textures(gpu: &Gpu, denoiser: &mut gpu::Denoiser, frame: &FrameBuf) -> Output {
    let output = run(gpu, denoiser, &HostFrame::new(gpu, frame), Targets::default());
    read(gpu, frame.size, &output)
}

fn settings() -> Settings {
    with_radius(Settings::default(), SIZE, 10.0)
}

#[test]
fn a_hosts_textures_are_filtered_as_the_reference_filters_them() {
    let Some(gpu) = gpu() else { return };
    // Compiled once; every scene begins with a reset.
    let mut b = gpu::Denoiser::new(&gpu.device, SIZE, &exact(&settings())).unwrap();
    for (name, scene) in [
        ("box", box_before_wall(moving, Noise::Sparse(0.4))),
        ("mirror", mirror(moving, true, Noise::Sparse(0.4))),
        ("sphere", sphere(moving, Noise::Uniform)),
    ] {
        let mut a = Denoiser::with_backend(SIZE, &settings(), Backend::Reference).unwrap();
        b.reset();
        for i in 0..4 {
            let mut frame = scene.frame(SIZE, i);
            // Colours that the border repairs wherever they are loaded, and planes that come and go.
            for plane in [&mut frame.matte, &mut frame.glossy, &mut frame.direct].into_iter().flatten() {
                plane.data_mut()[(97 * i + 5) as usize][1] = f32::NAN;
                plane.data_mut()[(31 * i + 7) as usize] = [f32::INFINITY, 0.5, -0.25];
            }
            match i {
                1 => frame.motion = None,
                2 => frame.surface_id = None,
                3 => frame.confidence_in = Some(Plane::from_fn(SIZE, |x, _| (x % 3) as f32 * 0.5)),
                _ => {}
            }
            let mut both = [on_reference(&mut a, &frame), on_textures(gpu, &mut b, &frame)];
            // Direct light that no stage filters is the host's own texture, as it is.
            both.iter_mut().for_each(|output| output.colours.retain(|(name, _)| *name != "direct"));
            agree(both, &format!("{name}, frame {i}"));
        }
    }
}

#[test]
fn repairs_of_a_frame_are_counted_where_they_are_asked_for() {
    let Some(gpu) = gpu() else { return };
    let mut frame = box_before_wall(moving, Noise::None).frame(SIZE, 0);
    frame.matte.as_mut().unwrap().data_mut()[9] = [f32::NAN, -1.0, 0.0];
    frame.normal.as_mut().unwrap().data_mut()[11] = [0.0, 2.0, 0.0];
    let wanted = Denoiser::new(SIZE, &settings()).unwrap().denoise(&frame.frame(&[])).unwrap().report.sanitised;
    assert_eq!(wanted.iter().count(), 3);
    for count_repairs in [true, false] {
        let mut options = Options::new(&settings());
        options.count_repairs = count_repairs;
        let mut denoiser = gpu::Denoiser::new(&gpu.device, SIZE, &options).unwrap();
        let output = run(gpu, &mut denoiser, &HostFrame::new(gpu, &frame), Targets::default());
        let counted = read_counts(gpu, &output.repairs.unwrap());
        assert_eq!(counted == wanted, count_repairs, "{:?}", counted.iter().collect::<Vec<_>>());
    }
}

/// Colours of a frame's outputs by name.
fn named(gpu: &Gpu, output: &gpu::Output) -> Vec<(&'static str, Plane<Rgb>)> {
    read(gpu, SIZE, output).colours
}

#[test]
fn what_is_absent_changes_nothing_of_the_rest() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let mut denoisers = [false, true].map(|composite| {
        let mut options = exact(&settings());
        options.composite = composite;
        gpu::Denoiser::new(&gpu.device, SIZE, &options).unwrap()
    });
    let mut last = |composite: bool, change: fn(&mut FrameBuf)| {
        let denoiser = &mut denoisers[usize::from(composite)];
        denoiser.reset();
        let outputs = (0..3).map(|i| {
            let mut frame = scene.frame(SIZE, i);
            frame.direct = frame.glossy.clone();
            change(&mut frame);
            run(gpu, denoiser, &HostFrame::new(gpu, &frame), Targets::default())
        });
        named(gpu, &outputs.last().unwrap())
    };
    let get = |planes: &[(&'static str, Plane<Rgb>)], name: &str| {
        planes.iter().find(|(n, _)| *n == name).map(|(_, p)| p.clone())
    };
    let all = last(true, |_| ());
    for name in ["composite", "direct", "matte", "glossy"] {
        assert!(get(&all, name).is_some(), "{name}");
    }
    let signals = last(false, |_| ());
    assert_eq!(get(&signals, "composite"), None);
    assert_eq!((get(&signals, "matte"), get(&signals, "glossy")), (get(&all, "matte"), get(&all, "glossy")));
    let no_glossy = last(true, |f| f.glossy = None);
    assert_eq!((get(&no_glossy, "matte"), get(&no_glossy, "glossy")), (get(&all, "matte"), None));
    let no_matte = last(true, |f| f.matte = None);
    assert_eq!((get(&no_matte, "matte"), get(&no_matte, "glossy")), (None, get(&all, "glossy")));
    // Without direct light the sum is of the rest.
    let dark = last(true, |f| f.direct = None);
    assert_eq!(get(&dark, "direct"), None);
    let black = last(true, |f| f.direct = Some(Plane::filled(f.size, [0.0; 3])));
    assert_eq!(get(&dark, "composite"), get(&black, "composite"));
    assert!(get(&dark, "composite") != get(&all, "composite"));
    // Nothing at all is no error.
    let nothing = last(true, |f| (f.direct, f.matte, f.glossy) = (None, None, None));
    assert!(nothing.is_empty());
}

fn target(gpu: &Gpu, size: Size) -> TextureView {
    let bytes = vec![0xff; Texel::Colour.bytes(Storage::Half) as usize * size.pixels()];
    let usages = TextureUsages::STORAGE_BINDING
        | TextureUsages::TEXTURE_BINDING
        | TextureUsages::COPY_SRC
        | TextureUsages::COPY_DST;
    gpu.texture_with("target", Texel::Colour.format(Storage::Half), size, &bytes, usages)
}

#[test]
fn targets_get_what_else_lies_in_the_denoiser() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let mut options = Options::new(&settings());
    options.composite = true;
    let [mut plain, mut aimed] = [(); 2].map(|()| gpu::Denoiser::new(&gpu.device, SIZE, &options).unwrap());
    // What is shown is remembered as well, or is not.
    for feedback in ["blend", "bilateral"] {
        let mut settings = settings();
        settings.set("pipeline.feedback", feedback).unwrap();
        for denoiser in [&mut plain, &mut aimed] {
            denoiser.set_settings(&settings).unwrap();
            denoiser.reset();
        }
        let views = [(); 3].map(|()| target(gpu, SIZE));
        let targets = Targets { composite: Some(&views[0]), matte: Some(&views[1]), glossy: Some(&views[2]) };
        for i in 0..3 {
            let host = HostFrame::new(gpu, &scene.frame(SIZE, i));
            let a = run(gpu, &mut plain, &host, Targets::default());
            let b = run(gpu, &mut aimed, &host, targets);
            let (a, b) = (named(gpu, &a), named(gpu, &b));
            assert_eq!(a, b, "{feedback}, frame {i}");
            let held = gpu.read(SIZE, &[&views[0], &views[1], &views[2]]);
            for (k, name) in ["composite", "matte", "glossy"].into_iter().enumerate() {
                let wanted = &a.iter().find(|(n, _)| *n == name).unwrap().1;
                let same = wanted.data().iter().flatten().eq(held[k].chunks_exact(4).flat_map(|c| &c[..3]));
                assert!(same, "{feedback}, frame {i}, {name}");
            }
        }
        let small = target(gpu, Size::new(47, 31));
        let host = HostFrame::new(gpu, &scene.frame(SIZE, 3));
        let targets = Targets { matte: Some(&small), ..Targets::default() };
        let frame = gpu::Frame { targets, ..host.frame(&[]) };
        let error = aimed.encode(&gpu.device, &mut encoder(gpu), &frame).unwrap_err();
        assert!(error.to_string().contains("`matte`"), "{error}");
    }
}

#[test]
fn no_trust_resets_its_pixel_alone_and_reset_all() {
    let Some(gpu) = gpu() else { return };
    let scene = wall(still, Noise::Uniform);
    let masked = |i: usize| i == 700 || i % 97 == 3;
    let mut denoiser = gpu::Denoiser::new(&gpu.device, SIZE, &Options::new(&settings())).unwrap();
    let mut last = |masks: bool, resets: bool| {
        denoiser.reset();
        for i in 0..5 {
            let mut frame = scene.frame(SIZE, i);
            if masks && i == 4 {
                frame.confidence_in = Some(Plane::from_fn(SIZE, |x, y| f32::from(!masked(y * SIZE.width + x))));
            }
            if resets && i == 4 {
                denoiser.reset();
            }
            let output = run(gpu, &mut denoiser, &HostFrame::new(gpu, &frame), Targets::default());
            if i == 4 {
                assert_eq!(output.had_history, !resets);
                return read(gpu, SIZE, &output).scalars[1].1.clone();
            }
        }
        panic!()
    };
    let (whole, holed, reset) = (last(false, false), last(true, false), last(false, true));
    assert!(whole.data().iter().all(|n| (n - 5.0).abs() < 1e-5));
    for (i, (n, all)) in holed.data().iter().zip(whole.data()).enumerate() {
        assert_eq!(*n, if masked(i) { 1.0 } else { *all }, "pixel {i}");
    }
    assert!(reset.data().iter().all(|n| *n == 1.0));
}

#[test]
fn shared_planes_give_the_same_bits_in_less_memory() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    for (fuse, composite) in [(true, true), (false, false)] {
        let mut options = Options::new(&settings());
        (options.fuse, options.composite) = (fuse, composite);
        let [mut shared, mut single] = [true, false].map(|share| {
            options.share_planes = share;
            gpu::Denoiser::new(&gpu.device, SIZE, &options).unwrap()
        });
        let before = single.memory();
        assert_eq!(before, single.program().memory(SIZE.pixels()));
        assert!(shared.memory().transient < before.transient);
        for i in 0..4 {
            let mut frame = scene.frame(SIZE, i);
            frame.camera.jitter = [0.25, -0.125 * i as f32];
            if i == 2 {
                split(&mut frame);
            }
            let host = HostFrame::new(gpu, &frame);
            let [a, b] = [&mut shared, &mut single].map(|d| run(gpu, d, &host, Targets::default()));
            assert_eq!(named(gpu, &a), named(gpu, &b), "fused {fuse}, frame {i}");
            let joint = |output: &gpu::Output| gpu.read(SIZE, &output.joint.iter().collect::<Vec<_>>());
            assert_eq!(joint(&a), joint(&b), "fused {fuse}, frame {i}");
            assert_eq!(a.joint.len(), frame.passes.len());
        }
        // What joint planes needed is counted, too.
        assert!(single.memory().transient > before.transient && single.memory().persistent > before.persistent);
        // What another image has overwritten is not shown.
        let slot = Slot::Image(Image::MattePrefiltered);
        assert!(single.plane(slot).is_some() && shared.plane(slot).is_none());
        let format = wgpu::TextureFormat::Rgba16Float;
        let views = DebugViews::new(&gpu.device, Storage::Half, format).unwrap();
        let view = target(gpu, SIZE);
        let show = |denoiser: &gpu::Denoiser, image| {
            let target = DebugTarget { view: &view, scale: 1.0 };
            denoiser.encode_debug(&gpu.device, &mut encoder(gpu), &views, DebugView::Light(image), target)
        };
        for image in [Image::MattePrefiltered, Image::MatteFiltered, Image::MatteInput] {
            assert_eq!(show(&single, image), Ok(()));
        }
        let error = show(&shared, Image::MattePrefiltered).unwrap_err().to_string();
        assert!(error.contains("share_planes"), "{error}");
        assert_eq!(show(&shared, Image::MatteFiltered), Ok(()));
    }
}

/// Mean confidence, and the relative difference (rms) of two signals.
fn quality(output: &Output, wanted: &Output) -> (f64, f64) {
    let confidence = &output.scalars[0].1;
    let mean = confidence.data().iter().map(|v| f64::from(*v)).sum::<f64>() / confidence.data().len() as f64;
    let find = |o: &Output| o.colours.iter().find(|(n, _)| *n == "matte").unwrap().1.clone();
    let (a, b) = (find(output), find(wanted));
    let (mut squares, mut sum) = (0.0, 0.0);
    for (p, q) in a.data().iter().flatten().zip(b.data().iter().flatten()) {
        squares += f64::from(p - q).powi(2);
        sum += f64::from(*q).powi(2);
    }
    (mean, (squares / sum).sqrt())
}

#[test]
fn a_render_size_that_changes_keeps_history() {
    let Some(gpu) = gpu() else { return };
    let full = Size::new(60, 40);
    let sizes = [full, Size::new(48, 32), full];
    let settings = with_radius(Settings::default(), full, 6.0);
    let make = || gpu::Denoiser::new(&gpu.device, full, &exact(&settings)).unwrap();
    let [mut denoiser, mut forgetful] = [make(), make()];
    for (name, scene) in
        [("still", box_before_wall(still, Noise::None)), ("moving", box_before_wall(moving, Noise::None))]
    {
        denoiser.reset();
        forgetful.reset();
        for (part, size) in sizes.into_iter().enumerate() {
            let mut reference = Denoiser::with_backend(size, &settings, Backend::Reference).unwrap();
            let mut at_first = 0.001;
            for k in 0..6 {
                let index = (6 * part + k) as i64;
                let mut frame = scene.frame(size, index);
                // The cameras' matrices hold the aspect, not the extent.
                frame.index = index;
                let wanted = on_reference(&mut reference, &frame);
                let got = on_textures(gpu, &mut denoiser, &frame);
                if k == 0 && part > 0 {
                    let (kept, off) = quality(&got, &wanted);
                    println!("{name}, {size}: confidence {kept:.3}, off by {off:.4}");
                    assert!(kept > 0.75, "{name}: history was lost at {size}: confidence {kept}");
                    // Edges of the picture, interpolated from the other size.
                    assert!(off < 0.06, "{name}: {off} from the reference at {size}");
                    at_first = off;
                    forgetful.reset();
                }
                let fresh = on_textures(gpu, &mut forgetful, &frame);
                if k == 0 && part > 0 {
                    assert!(quality(&fresh, &wanted).0 < 0.1, "lost history went unseen");
                }
                if k == 5 {
                    // What the other size left fades as history does.
                    let (_, off) = quality(&got, &wanted);
                    assert!(off < at_first, "{name}: {off} from the reference at {size}, at first {at_first}");
                }
            }
        }
    }
    let large = HostFrame::new(gpu, &box_before_wall(still, Noise::None).frame(Size::new(61, 40), 0));
    let error = denoiser.encode(&gpu.device, &mut encoder(gpu), &large.frame(&[])).unwrap_err();
    assert!(error.to_string().contains("61x40"), "{error}");
}

#[test]
fn two_views_in_one_submit_do_not_mix() {
    let Some(gpu) = gpu() else { return };
    let scenes = [box_before_wall(moving, Noise::Sparse(0.4)), sphere(moving, Noise::Uniform)];
    let make = || gpu::Denoiser::new(&gpu.device, SIZE, &Options::new(&settings())).unwrap();
    let hosts: Vec<[HostFrame; 2]> =
        (0..3).map(|i| scenes.each_ref().map(|s: &Scene| HostFrame::new(gpu, &s.frame(SIZE, i)))).collect();
    let mut eyes = [make(), make()];
    let mut together = Vec::new();
    let mut open = encoder(gpu);
    for frame in &hosts {
        together = Vec::new();
        for (eye, host) in eyes.iter_mut().zip(frame) {
            together.push(eye.encode(&gpu.device, &mut open, &host.frame(&[])).unwrap());
        }
    }
    gpu.queue.submit([open.finish()]);
    let together: Vec<_> = together.iter().map(|output| named(gpu, output)).collect();
    for (k, output) in together.iter().enumerate() {
        let alone = &mut eyes[1 - k];
        alone.reset();
        let single = hosts.iter().map(|frame| run(gpu, alone, &frame[k], Targets::default())).last().unwrap();
        assert_eq!(*output, named(gpu, &single), "eye {k}");
    }
    assert!(together[0] != together[1]);
}

/// Splits both signals into planes that add up to them.
fn split(frame: &mut FrameBuf) {
    let parts = [("a", Signal::Matte), ("b", Signal::Glossy), ("c", Signal::Matte), ("d", Signal::Glossy)];
    for (k, (name, signal)) in parts.into_iter().enumerate() {
        let light = if signal == Signal::Matte { frame.matte.as_ref() } else { frame.glossy.as_ref() };
        let Some(light) = light else { continue };
        let plane = Plane::from_fn(frame.size, |x, y| {
            let share = 0.2 + 0.6 * hash([x as u32, y as u32, signal as u32, frame.index as u32]) as f32;
            let share = if k < 2 { share } else { 1.0 - share };
            light.at(x, y).map(|v| v * share)
        });
        frame.passes.push(PassBuf { name: name.to_owned(), signal, plane });
    }
}

#[test]
fn planes_tied_to_a_signal_agree_and_still_add_up() {
    let Some(gpu) = gpu() else { return };
    for (name, scene, changes) in [
        ("box", box_before_wall(moving, Noise::Sparse(0.4)), [("matte_temporal.clip", "box"), ("firefly.plain", "on")]),
        (
            "mirror",
            mirror(moving, true, Noise::Sparse(0.4)),
            [("firefly.median", "luminance"), ("pipeline.feedback", "prefilter")],
        ),
    ] {
        let mut settings = settings();
        changes.iter().for_each(|(name, value)| settings.set(name, value).unwrap());
        let mut reference = Denoiser::with_backend(SIZE, &settings, Backend::Reference).unwrap();
        let mut denoiser = gpu::Denoiser::new(&gpu.device, SIZE, &exact(&settings)).unwrap();
        for i in 0..5 {
            let mut frame = scene.frame(SIZE, i);
            split(&mut frame);
            let kept = denoise(&mut reference, &frame);
            let output = run(gpu, &mut denoiser, &HostFrame::new(gpu, &frame), Targets::default());
            let planes = [&kept.matte_passes[0], &kept.glossy_passes[0], &kept.matte_passes[1], &kept.glossy_passes[1]];
            let names = ["a", "b", "c", "d"];
            let wanted = Output {
                by: By::Reference,
                colours: names.into_iter().zip(planes.map(Clone::clone)).collect(),
                scalars: Vec::new(),
            };
            let read = gpu.read(SIZE, &output.joint.iter().collect::<Vec<_>>());
            let plane = |floats: &Vec<f32>| {
                Plane::from_vec(SIZE, floats.chunks_exact(4).map(|c| [c[0], c[1], c[2]]).collect()).unwrap()
            };
            let found = Output {
                by: By::Gpu,
                colours: names.into_iter().zip(read.iter().map(plane)).collect(),
                scalars: Vec::new(),
            };
            if let Err(difference) = compare(&wanted, &found, SEQUENCE) {
                panic!("{name}, frame {i}: {difference}");
            }
            for (canary, planted) in canaries(&found) {
                assert!(compare(&wanted, &planted, SEQUENCE).is_err(), "{name}: {canary} went unseen");
            }
            // What added up before still does.
            let signals = named(gpu, &output);
            for (k, signal) in ["matte", "glossy"].into_iter().enumerate() {
                let whole = &signals.iter().find(|(n, _)| *n == signal).unwrap().1;
                let (a, b) = (&found.colours[k].1, &found.colours[k + 2].1);
                for (i, v) in whole.data().iter().enumerate() {
                    for c in 0..3 {
                        let sum = a.data()[i][c] + b.data()[i][c];
                        assert!(
                            (sum - v[c]).abs() <= 1e-4 * (1.0 + v[c].abs()),
                            "{name}, {signal}: {sum} and {}",
                            v[c]
                        );
                    }
                }
            }
        }
    }
}
