//! What cannot be shown is refused in words, and what was shown stays.

use super::device::{choice, device, scene, sight};
use quell::Size;
use quell::gpu::wgpu;
use quell_live::{Choice, Engine, LiveError, Mode, Pane, Pilot, Shot, Sight, Stage, open};
use quell_trace::RenderOptions;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

#[test]
fn absurd_sizes_are_refused_and_the_old_one_stays() {
    let Some(device) = device() else { return };
    let mut engine = device.engine(Size::new(16, 9));
    for (width, height) in [(0, 0), (0, 9), (16, 0), (1 << 20, 9), (usize::MAX, usize::MAX)] {
        let error = engine.resize(Size::new(width, height)).unwrap_err();
        assert!(matches!(error, LiveError::Size { .. }), "{error}");
        assert_eq!(engine.size(), Size::new(16, 9));
    }
    for (width, height) in [(1, 1), (3, 1), (1, 7), (16, 9), (17, 9), (16, 9)] {
        engine.resize(Size::new(width, height)).unwrap();
        let sight = sight(&engine, 0.0);
        let made = device.show(&mut engine, &sight, &choice()).unwrap();
        assert_eq!((made.converged, made.had_history), (1, false));
        assert_eq!(device.picture(&engine).len(), 4 * width * height);
    }
}

#[test]
fn cameras_and_scenes_that_cannot_be_used_are_refused() {
    let Some(device) = device() else { return };
    let mut engine = Engine::new(device.gpu.device(), device.gpu.queue(), Size::new(16, 9)).unwrap();
    let scene = scene();
    let camera = Pilot::at(&scene, 1, 0.0, Mode::Path).unwrap().view(&scene, 0.0, engine.size()).unwrap();
    let good = Sight { camera, time: 0.0, pointer: [0; 2] };
    assert!(matches!(device.show(&mut engine, &good, &choice()), Err(LiveError::NoScene)));
    engine.set_stage(device.stage(scene, &engine));
    let mut bad = good;
    bad.camera.clip_from_world[3] = f32::NAN;
    let error = device.show(&mut engine, &bad, &choice()).unwrap_err();
    assert!(error.to_string().contains("camera"), "{error}");
    // The frame after is as if nothing had been asked.
    assert!(device.show(&mut engine, &good, &choice()).is_ok());

    assert!(open("cornel-box", None).unwrap_err().to_string().contains("did you mean cornell-box"));
    assert!(open("/nonexistent/room.glb", None).unwrap_err().to_string().contains("room.glb"));
}

#[test]
fn a_device_that_is_lost_ends_no_program() {
    if device().is_none() {
        return;
    }
    let Some((device, queue)) = small_device(128 << 20) else { return };
    let (lost, errors) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
    let heard = Arc::clone(&lost);
    device.set_device_lost_callback(move |_, _| heard.store(true, Ordering::Release));
    let noted = Arc::clone(&errors);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| noted.lock().unwrap().push(error.to_string())));
    let mut engine = Engine::new(&device, &queue, Size::new(16, 9)).unwrap();
    let kernels = Arc::clone(engine.kernels());
    let options = engine.options(choice().tracing);
    engine.set_stage(Stage::new(&device, &queue, &kernels, scene(), &options).unwrap());
    let sight = sight(&engine, 0.0);
    let encoder = || device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let wait = || drop(device.poll(wgpu::PollType::wait_indefinitely()));
    let mut good = encoder();
    engine.encode(&mut good, &sight, &choice()).unwrap();
    queue.submit([good.finish()]);
    wait();
    assert!(!lost.load(Ordering::Acquire) && errors.lock().unwrap().is_empty(), "{errors:?}");

    // Between a frame's commands and its submission; then all that a window may ask for before it hears of it.
    let mut last = encoder();
    engine.encode(&mut last, &sight, &choice()).unwrap();
    device.destroy();
    queue.submit([last.finish()]);
    wait();
    assert!(lost.load(Ordering::Acquire));
    for size in [engine.size(), Size::new(17, 9)] {
        let _ = engine.resize(size);
        let mut after = encoder();
        let all = Choice { panes: Pane::ALL.to_vec(), ..choice() };
        let _ = engine.encode(&mut after, &sight, &all);
        let shot = Shot::new(&device, &mut after, engine.picture().texture());
        let planes = engine.planes_of_last();
        queue.submit([after.finish()]);
        wait();
        // Nothing that is no frame is handed over.
        assert!(shot.take().is_none_or(|pixels| pixels.is_empty()));
        assert!(!planes.is_ok_and(|mut planes| planes.take().is_some_and(|planes| planes.is_ok())));
        assert!(engine.times().sum() >= 0.0);
    }
    let _ = Stage::new(&device, &queue, &kernels, scene(), &options);
    println!("said by the device that was lost: {errors:?}");
}

/// A device that gives as little to a buffer as this.
fn small_device(bytes: u64) -> Option<(wgpu::Device, wgpu::Queue)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = now(instance.enumerate_adapters(wgpu::Backends::all()));
    let required_limits = wgpu::Limits { max_storage_buffer_binding_size: bytes, ..wgpu::Limits::default() };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    now(adapters.first()?.request_device(&descriptor)).ok()
}

fn now<T>(future: impl Future<Output = T>) -> T {
    let mut future = std::pin::pin!(future);
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    loop {
        if let std::task::Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
    }
}

#[test]
fn a_scene_beyond_a_limit_is_refused_with_the_figure() {
    if device().is_none() {
        return;
    }
    let Some((device, queue)) = small_device(1024) else { return };
    let options = RenderOptions::new(Size::new(16, 9));
    let Err(error) = Stage::new(&device, &queue, &Arc::default(), scene(), &options) else {
        panic!("a scene fits into nothing")
    };
    let text = error.to_string();
    println!("{text}");
    assert!(text.contains("1024") && text.contains("bytes"), "{text}");
}
