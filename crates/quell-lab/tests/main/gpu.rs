//! Frames filtered by the host of the GPU, against the CPU: the same types, and the same results within bounds.
//!
//! Without an adapter the tests print why they did nothing; with `QUELL_REQUIRE_GPU=1` they fail.

use quell::{FrameBuf, Output, PassBuf, Plane, PlaneRef, Preset, Rgb, Settings, Signal, Size};
use quell_host::{Gpu, Wanted};
use quell_lab::backend::Backend;
use quell_lab::methods::quell::ABLATIONS;
use quell_trace::{Control, RenderOptions, Tracer, builtin};
use std::sync::Arc;

const SIZE: Size = Size::new(72, 40);
/// Half storage against the CPU: a rounding of 2^-11 a plane, fed back for some frames. Beyond it lie values for which a
/// threshold flipped (stages 3, 6, 8), and reflections in curved mirrors, whose place in history is less sure.
const RELATIVE: f64 = 1e-2;
/// Largest share of values beyond it.
const FLIPS: f64 = 2e-2;

pub fn gpu() -> Option<Arc<Gpu>> {
    match Gpu::open(Wanted::Named("")) {
        Ok(gpu) => Some(Arc::new(gpu)),
        Err(why) => {
            let required = std::env::var_os("QUELL_REQUIRE_GPU").is_some_and(|v| v == "1");
            assert!(!required, "QUELL_REQUIRE_GPU is set, but {why}");
            println!("SKIPPED: {why}");
            None
        }
    }
}

/// The first frames of a scene with a moving camera, jittered, with noisy direct light.
pub fn traced(size: Size, count: i64) -> Vec<FrameBuf> {
    let scene = builtin("glossy-room").expect("a scene");
    let options = RenderOptions { jitter: true, direct_samples: 1, ..RenderOptions::new(size) };
    let render = |n| Tracer::new(&scene, n, 1).expect("a camera").render(&options, &Control::default());
    (0..count).map(|n| render(n).expect("a frame").frame).collect()
}

/// Each signal in two parts that differ from pixel to pixel; the third pass is of the other signal.
fn with_passes(mut frame: FrameBuf) -> FrameBuf {
    let width = frame.size.width;
    let part = |plane: &Option<Plane<Rgb>>, of: f32| {
        let plane = plane.as_ref().expect("a signal");
        let share = |i: usize| (of - ((i % width + i / width) % 5) as f32 * 0.2).abs();
        let data = plane.data().iter().enumerate().map(|(i, c)| c.map(|v| v * share(i))).collect();
        Plane::from_vec(plane.size(), data).expect("a plane")
    };
    let pass = |name: &str, signal, plane| PassBuf { name: name.to_owned(), signal, plane };
    frame.passes = vec![
        pass("sun", Signal::Matte, part(&frame.matte, 0.0)),
        pass("lamp", Signal::Glossy, part(&frame.glossy, 0.0)),
        pass("sky", Signal::Matte, part(&frame.matte, 1.0)),
    ];
    frame
}

/// Every plane of an output as numbers.
fn planes(output: &Output<'_>) -> Vec<(String, Vec<f32>)> {
    let colours = |plane: &Plane<Rgb>| plane.data().iter().flatten().copied().collect::<Vec<f32>>();
    let mut all =
        vec![("composite".to_owned(), colours(output.composite)), ("direct".to_owned(), colours(output.direct))];
    for (signal, plane) in [(Signal::Matte, output.matte), (Signal::Glossy, output.glossy)] {
        all.extend(plane.map(|p| (signal.name().to_owned(), colours(p))));
        let passes = output.passes(signal).iter().enumerate();
        all.extend(passes.map(|(k, p)| (format!("{} pass {k}", signal.name()), colours(p))));
    }
    all.push(("confidence".to_owned(), output.confidence.data().to_vec()));
    all.push(("history length".to_owned(), output.history_length.data().to_vec()));
    all
}

/// Which plane is beyond the bounds.
pub fn compare(a: &[(String, Vec<f32>)], b: &[(String, Vec<f32>)]) -> Result<(), String> {
    let names = |planes: &[(String, Vec<f32>)]| planes.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    if names(a) != names(b) {
        return Err(format!("{:?} against {:?}", names(a), names(b)));
    }
    for ((name, p), (_, q)) in a.iter().zip(b) {
        let mean = p.iter().map(|v| f64::from(v.abs())).sum::<f64>() / p.len() as f64;
        let is_off = |(p, q): (&f32, &f32)| {
            let scale = f64::from(p.abs().max(q.abs())) + mean;
            let difference = f64::from((p - q).abs());
            difference.is_nan() || difference > RELATIVE * scale
        };
        let off = p.iter().zip(q).filter(|pair| is_off(*pair)).count();
        if p.len() != q.len() || off as f64 > FLIPS * p.len() as f64 {
            return Err(format!("{name}: {off} of {} values differ", p.len()));
        }
    }
    Ok(())
}

type Shown = Vec<(String, Vec<f32>)>;

fn run(backend: &Backend, settings: &Settings, frames: &[FrameBuf]) -> Vec<Shown> {
    let mut denoiser = backend.denoiser(frames[0].size, settings).expect("a denoiser");
    let mut one = |frame: &FrameBuf| {
        let passes = frame.pass_views();
        let output = denoiser.denoise(&frame.frame(&passes)).expect("denoised");
        assert_eq!(output.report.had_history, frame.index > 0 && settings.matte_temporal.enabled);
        planes(&output)
    };
    frames.iter().map(&mut one).collect()
}

#[test]
fn joint_passes_are_the_cpus_and_still_add_up() {
    let Some(gpu) = gpu() else { return };
    let frames: Vec<FrameBuf> = traced(SIZE, 4).into_iter().map(with_passes).collect();
    let settings = Settings::default();
    let on_cpu = run(&Backend::Cpu(quell::Backend::Cpu), &settings, &frames);
    let on_gpu = run(&Backend::Gpu(gpu.clone()), &settings, &frames);
    for (index, (a, b)) in on_cpu.iter().zip(&on_gpu).enumerate() {
        assert_eq!(a.iter().filter(|(name, _)| name.contains("pass")).count(), 3);
        compare(a, b).unwrap_or_else(|difference| panic!("frame {index}: {difference}"));
        // What the comparison must see: each plane off by 5 %, and two passes in each other's place.
        for k in 0..b.len() {
            let mut changed = b.clone();
            changed[k].1.iter_mut().for_each(|v| *v = *v * 1.05 + 0.05 * f32::from(*v == 0.0));
            assert!(compare(a, &changed).is_err(), "frame {index}: {} off by 5 % went unseen", b[k].0);
        }
        let at = |name: &str| b.iter().position(|(n, _)| n == name).expect("a plane");
        let (first, second) = (at("matte pass 0"), at("matte pass 1"));
        let mut swapped = b.clone();
        let taken = swapped[first].1.clone();
        swapped[first].1 = std::mem::replace(&mut swapped[second].1, taken);
        assert!(compare(a, &swapped).is_err(), "frame {index}: swapped passes went unseen");

        let plane = |name: &str| &b[at(name)].1;
        let sum: Vec<f32> = plane("matte pass 0").iter().zip(plane("matte pass 1")).map(|(p, q)| p + q).collect();
        // |0 - s| + |1 - s| is 1 for every share.
        compare(&[("sum".to_owned(), sum)], &[("sum".to_owned(), plane("matte").clone())])
            .unwrap_or_else(|difference| panic!("frame {index}: passes do not add up: {difference}"));
    }
    // Other passes are a cut, as on the CPU.
    let mut denoiser = Backend::Gpu(gpu.clone()).denoiser(SIZE, &settings).expect("a denoiser");
    for (index, names) in [["sun", "sky"], ["sun", "sky"], ["sky", "sun"], ["sky", "sun"]].into_iter().enumerate() {
        let mut frame = frames[index].clone();
        frame.passes.retain(|pass| pass.signal == Signal::Matte);
        frame.passes.iter_mut().zip(names).for_each(|(pass, name)| pass.name = name.to_owned());
        let passes = frame.pass_views();
        let output = denoiser.denoise(&frame.frame(&passes)).expect("denoised");
        let remembers = output.history_length.data().iter().any(|n| *n > 1.0);
        assert_eq!(remembers, index == 1 || index == 3, "frame {index}");
    }
    gpu.check("the tests").expect("no error of validation");
}

#[test]
fn presets_and_ablations_are_the_cpus() {
    let Some(gpu) = gpu() else { return };
    let frames: Vec<FrameBuf> = traced(SIZE, 3);
    let presets = Preset::ALL.map(|preset| (preset.name(), Settings::preset(preset)));
    let ablations = ABLATIONS.iter().map(|a| (a.name, (a.apply)(Settings::default())));
    let mut seen: Vec<(&str, Shown)> = Vec::new();
    for (name, settings) in presets.into_iter().chain(ablations) {
        let on_cpu = run(&Backend::Cpu(quell::Backend::Cpu), &settings, &frames);
        let mut on_gpu = run(&Backend::Gpu(gpu.clone()), &settings, &frames);
        for (index, (a, b)) in on_cpu.iter().zip(&on_gpu).enumerate() {
            compare(a, b).unwrap_or_else(|difference| panic!("{name}, frame {index}: {difference}"));
        }
        let last = on_gpu.pop().expect("a frame");
        // A setting that is not handed on would make two of them alike.
        for (other, picture) in &seen {
            assert!(*picture != last, "{name} gives the bits of {other}");
        }
        seen.push((name, last));
    }
    gpu.check("the tests").expect("no error of validation");
}

/// What a frame may lack.
#[test]
fn frames_that_lack_planes_are_the_cpus() {
    let Some(gpu) = gpu() else { return };
    let whole: Vec<FrameBuf> = traced(SIZE, 2).into_iter().map(with_passes).collect();
    type Change = fn(&mut FrameBuf);
    let lacks: [(&str, Change); 4] = [
        ("glossy", |f| {
            (f.glossy, f.glossy_weight, f.direct_glossy) = (None, None, None);
            f.passes.retain(|p| p.signal == Signal::Matte);
        }),
        ("both signals", |f| {
            (f.matte, f.glossy) = (None, None);
            f.passes.clear();
        }),
        ("direct light", |f| f.direct = None),
        ("guides", |f| (f.roughness, f.glossy_hit_distance, f.motion, f.surface_id) = (None, None, None, None)),
    ];
    let settings = Settings::default();
    for (what, change) in lacks {
        let mut frames = whole.clone();
        frames.iter_mut().for_each(change);
        let on = |backend: &Backend| {
            let mut denoiser = backend.denoiser(SIZE, &settings).expect("a denoiser");
            let mut last = Vec::new();
            for frame in &frames {
                let passes = frame.pass_views();
                last = planes(&denoiser.denoise(&frame.frame(&passes)).expect("denoised"));
            }
            last
        };
        let (a, b) = (on(&Backend::Cpu(quell::Backend::Cpu)), on(&Backend::Gpu(gpu.clone())));
        compare(&a, &b).unwrap_or_else(|difference| panic!("without {what}: {difference}"));
    }
    gpu.check("the tests").expect("no error of validation");
}

#[test]
fn a_frame_that_breaks_the_contract_is_refused_as_on_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let frame = with_passes(traced(SIZE, 1).remove(0));
    let mut passes = frame.pass_views();
    let small = Plane::filled(Size::new(3, 3), [0.0; 3]);
    let view: PlaneRef<'_, Rgb> = small.view();
    passes[1].plane = view;
    let refused = |backend: &Backend| {
        let mut denoiser = backend.denoiser(SIZE, &Settings::default()).expect("a denoiser");
        denoiser.denoise(&frame.frame(&passes)).map(|_| ()).expect_err("a pass of another size").to_string()
    };
    let (a, b) = (refused(&Backend::Cpu(quell::Backend::Cpu)), refused(&Backend::Gpu(gpu)));
    assert!(a.contains("lamp") && b.contains("lamp"), "{a}; {b}");
}
