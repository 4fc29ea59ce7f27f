//! What the engine shows against what the same frames become by the way of memory: traced, read back, uploaded, denoised.

use super::device::{Device, choice, device, scene, sight};
use quell::{Plane, Rgb, Settings, Size};
use quell_host::{Gpu, Wanted};
use quell_lab::tone::Tone;
use quell_live::{Choice, Pane};
use quell_trace::{Control, Half, ReferenceKind, RenderOptions, Tracer};
use std::sync::Arc;

const SIZE: Size = Size::new(48, 27);

fn only(pane: Pane) -> Choice {
    Choice { panes: vec![pane], splits: vec![], ..choice() }
}

/// Share of the bytes that differ by more than `by`.
fn beyond(a: &[u8], b: &[u8], by: u8) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) > by).count() as f64 / a.len() as f64
}

/// Four bytes a pixel.
fn encoded(plane: &Plane<Rgb>, exposure: f32) -> Vec<u8> {
    let picture = Tone { exposure }.picture(plane);
    picture.rgb.chunks_exact(3).flat_map(|rgb| [rgb[0], rgb[1], rgb[2], 255]).collect()
}

#[test]
fn frames_on_the_device_are_those_of_the_way_through_memory() {
    let Some(device) = device() else { return };
    let mut engine = device.engine(SIZE);
    let mut settings = Settings::default();
    settings.set("matte_temporal.alpha", "0.9").unwrap();
    let choice = Choice { settings: settings.clone(), ..only(Pane::Quell) };
    let gpu = Arc::new(Gpu::open(Wanted::Named("")).unwrap());
    let mut through_memory = quell_host::Denoiser::new(gpu, SIZE, &settings).unwrap();
    let exposure = engine.stage().unwrap().scene().exposure;
    let before = device.picture(&engine);
    for frame in 0..3 {
        let sight = sight(&engine, f64::from(frame));
        let made = device.show(&mut engine, &sight, &choice).unwrap();
        assert_eq!((made.number, made.had_history), (i64::from(frame), frame > 0));
        assert_eq!(made.converged, 1, "the camera moves");
        let shown = device.picture(&engine);
        let planes = device.planes(&engine).frame;
        assert_eq!(planes.index, i64::from(frame));
        let output = through_memory.denoise(&planes.frame(&[])).unwrap();
        let expected = encoded(output.composite, exposure);
        let (few, more) = (beyond(&shown, &expected, 1), beyond(&shown, &expected, 4));
        println!("frame {frame}: {few:.4} of the values differ by more than 1 of 255, {more:.4} by more than 4");
        assert!(few < 0.02 && more < 0.005, "frame {frame}: {few} {more}");
        // A wrong exposure, as a test of the test.
        assert!(beyond(&shown, &encoded(output.composite, exposure * 1.1), 1) > 0.3);
        assert_ne!(shown, before);
    }
}

/// Root of the mean squared difference.
fn distance(a: &Plane<Rgb>, b: &Plane<Rgb>) -> f64 {
    let square = |(a, b): (&Rgb, &Rgb)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
    (a.data().iter().zip(b.data()).map(square).sum::<f64>() / a.data().len() as f64).sqrt()
}

#[test]
fn the_mean_converges_while_nothing_moves() {
    let Some(device) = device() else { return };
    let size = Size::new(32, 18);
    let mut engine = device.engine(size);
    let mut choice = only(Pane::Converged);
    // Frames that move their samples would converge to the anti-aliased picture.
    choice.tracing.jitter = false;
    let still = sight(&engine, 0.0);
    let scene = scene();
    let tracer = Tracer::new(&scene, 0, 1).unwrap();
    let options = RenderOptions { seed: 99, ..RenderOptions::new(size) };
    let reference = tracer.reference(&options, ReferenceKind::Factored, Half::A, 0..128, &Control::default()).unwrap();
    let mut distances = Vec::new();
    for frame in 1..=32 {
        let made = device.show(&mut engine, &still, &choice).unwrap();
        assert_eq!(made.converged, frame);
        if [1, 32].contains(&frame) {
            distances.push(distance(&device.converged(&engine), &reference.beauty));
        }
    }
    println!("distance to the reference after 1 and 32 frames: {distances:?}");
    assert!(distances[1] < 0.3 * distances[0], "{distances:?}");
    // Anything that changes light begins anew; what only changes the filter does not.
    choice.settings.set("firefly.enabled", "off").unwrap();
    choice.stops = 1.0;
    assert_eq!(device.show(&mut engine, &still, &choice).unwrap().converged, 33);
    choice.tracing.paths = 2;
    assert_eq!(device.show(&mut engine, &still, &choice).unwrap().converged, 1);
    assert_eq!(device.show(&mut engine, &still, &choice).unwrap().converged, 2);
    let later = sight(&engine, 1.0);
    assert_eq!(device.show(&mut engine, &later, &choice).unwrap().converged, 1);
}

#[test]
fn panes_show_what_they_say() {
    let Some(device) = device() else { return };
    let mut engine = device.engine(SIZE);
    let sight = sight(&engine, 0.0);
    let each = |device: &Device, engine: &mut quell_live::Engine, pane| {
        device.show(engine, &sight, &only(pane)).unwrap();
        device.picture(engine)
    };
    device.show(&mut engine, &sight, &only(Pane::Quell)).unwrap();
    // The samples of a frame depend on its number: each is begun anew from the same one.
    let whole: Vec<_> = Pane::ALL.map(|pane| each(device, &mut engine, pane)).to_vec();
    for (i, a) in whole.iter().enumerate() {
        for b in &whole[i + 1..] {
            assert!(beyond(a, b, 8) > 0.1, "two panes show the same");
        }
    }
    let mut choice = Choice { panes: vec![Pane::Debug, Pane::Quell], splits: vec![0.25], ..choice() };
    choice.tidy();
    device.show(&mut engine, &sight, &choice).unwrap();
    let split = device.picture(&engine);
    let column = |picture: &[u8], x: usize| -> Vec<u8> {
        (0..SIZE.height).flat_map(|y| picture[4 * (y * SIZE.width + x)..][..3].to_vec()).collect()
    };
    let view = whole.last().unwrap();
    // Depth does not depend on samples, but for jitter at edges.
    assert!(beyond(&column(&split, 5), &column(view, 5), 30) < 0.2);
    assert!(beyond(&column(&split, 30), &column(view, 30), 30) > 0.3);
    for debug in 0..quell_live::DEBUG_VIEWS.len() {
        let choice = Choice { debug, ..only(Pane::Debug) };
        device.show(&mut engine, &sight, &choice).unwrap();
    }
}

#[test]
fn lamps_are_switched_and_ablations_show() {
    let Some(device) = device() else { return };
    let mut engine = device.engine(SIZE);
    let sight = sight(&engine, 0.0);
    let light = |picture: &[u8]| picture.iter().map(|b| f64::from(*b)).sum::<f64>() / picture.len() as f64;
    let shown = |engine: &mut quell_live::Engine, choice: &Choice| {
        for _ in 0..2 {
            device.show(engine, &sight, choice).unwrap();
        }
        device.picture(engine)
    };
    let lit = shown(&mut engine, &only(Pane::Quell));
    let mut bare = only(Pane::Quell);
    bare.ablations[0] = true;
    let noisy = shown(&mut engine, &bare);
    assert!(beyond(&lit, &noisy, 8) > 0.1, "nothing was switched off");
    let count = engine.stage().unwrap().lamps().len();
    assert!(count > 0);
    for on in [false, true] {
        for lamp in 0..count {
            engine.stage_mut().unwrap().switch(lamp, on);
        }
        engine.reset();
        let made = device.show(&mut engine, &sight, &only(Pane::Quell)).unwrap();
        assert_eq!(made.converged, 1);
        let now = shown(&mut engine, &only(Pane::Quell));
        println!("lamps {on}: {:.1}, before {:.1}", light(&now), light(&lit));
        // Alpha alone is a quarter of the bytes.
        assert_eq!(light(&now) > 0.8 * light(&lit), on);
        assert_eq!(light(&now) < 64.0, !on);
    }
    engine.stage_mut().unwrap().switch(1000, false);
}

#[test]
fn passes_are_timed() {
    let Some(device) = device() else { return };
    let mut engine = device.engine(SIZE);
    let sight = sight(&engine, 0.0);
    for _ in 0..3 {
        device.show(&mut engine, &sight, &choice()).unwrap();
    }
    let times = engine.times();
    if !device.gpu.device().features().contains(quell::gpu::wgpu::Features::TIMESTAMP_QUERY) {
        println!("SKIPPED: the device has no timestamps");
        assert!(times.0.is_empty());
        return;
    }
    println!("{times:?}");
    for name in quell_trace::gpu::TIMED.into_iter().chain(["display", "composite"]) {
        assert!(times.0.iter().any(|pass| pass.name == name && pass.milliseconds > 0.0), "{name}");
    }
    assert!(times.sum() > 0.0);
}
