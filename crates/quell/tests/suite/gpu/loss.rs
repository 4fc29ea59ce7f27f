//! What only the device learns, while quell holds it: it is lost, or out of memory. Nothing panics, and the host hears of it by
//! its own callbacks and error scopes, as docs/integrating.md says.

use super::agreement::SIZE;
use super::device::{Gpu, gpu, now, open_with};
use super::sequence::{Uploaded, on_gpu};
use crate::suite::frames::{Noise, box_before_wall, moving, with_radius};
use quell::gpu::{self, DebugTarget, DebugView, DebugViews, Options, SequenceWavelet, Storage, wgpu};
use quell::{Settings, Size};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// A denoiser for frames of `size`, or of half as many rows and columns, again and again, until the device has memory for it.
async fn as_large_as_fits(
    device: &wgpu::Device,
    mut size: quell::Size,
    options: &gpu::Options,
) -> Result<gpu::Denoiser, gpu::Error> {
    loop {
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        // What was not made cannot be used: that is an error, too.
        let validity = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = gpu::Denoiser::new(device, size, options);
        let _ = validity.pop().await;
        if memory.pop().await.is_none() {
            return made;
        }
        size = quell::Size::new(size.width / 2, size.height / 2);
    }
}

/// Set when the device is lost: then make another device, and with it a denoiser. What was encoded is gone.
fn told_when_lost(device: &wgpu::Device) -> Arc<AtomicBool> {
    let lost = Arc::new(AtomicBool::new(false));
    let heard = Arc::clone(&lost);
    device.set_device_lost_callback(move |_reason, _message| heard.store(true, Ordering::Relaxed));
    lost
}

/// What reaches the host by itself, as text.
type Heard = Arc<Mutex<Vec<String>>>;

/// A device whose host listens.
fn listening(limits: impl FnOnce(&wgpu::Limits) -> wgpu::Limits) -> Option<(Gpu, Heard, Heard)> {
    gpu()?;
    let opened = open_with(wgpu::Features::empty(), limits).expect("a second device");
    let (lost, uncaptured) = (Heard::default(), Heard::default());
    let (for_lost, for_uncaptured) = (Arc::clone(&lost), Arc::clone(&uncaptured));
    opened.device.set_device_lost_callback(move |reason, _| for_lost.lock().unwrap().push(format!("{reason:?}")));
    opened.device.on_uncaptured_error(Arc::new(move |e| for_uncaptured.lock().unwrap().push(e.to_string())));
    Some((opened, lost, uncaptured))
}

fn options() -> Options {
    let mut options = Options::new(&with_radius(Settings::default(), SIZE, 12.0));
    options.composite = true;
    options
}

/// As much memory as it can take.
fn large() -> Options {
    let mut options = options();
    options.storage = Storage::Float;
    options
}

#[test]
fn a_lost_device_is_the_hosts_to_hear_of() {
    let Some((gpu, lost, uncaptured)) = listening(|_| wgpu::Limits::default()) else { return };
    let scene = box_before_wall(moving, Noise::Uniform);
    let mut denoiser = gpu::Denoiser::new(&gpu.device, SIZE, &options()).unwrap();
    let before = on_gpu(&gpu, &mut denoiser, &scene.frame(SIZE, 0));
    let uploaded = Uploaded::new(&gpu, &scene.frame(SIZE, 1), denoiser.storage());
    let views = DebugViews::new(&gpu.device, denoiser.storage(), wgpu::TextureFormat::Rgba8Unorm).unwrap();
    let target = gpu.texture_with(
        "target",
        wgpu::TextureFormat::Rgba8Unorm,
        SIZE,
        &vec![0; 4 * SIZE.pixels()],
        wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::RENDER_ATTACHMENT,
    );
    // An encoder that was begun while the device was there, and one that was not.
    let mut begun = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("begun") });
    denoiser.encode(&gpu.device, &mut begun, &uploaded.frame()).unwrap();

    gpu.device.destroy();
    let _ = gpu.device.poll(wgpu::PollType::Poll);

    let printed = |what: &str, result: Result<(), gpu::Error>| println!("{what}: {result:?}");
    let frame = Uploaded::frame(&uploaded);
    printed("encode into what was begun", denoiser.encode(&gpu.device, &mut begun, &frame).map(drop));
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("after") });
    printed("encode", denoiser.encode(&gpu.device, &mut encoder, &frame).map(drop));
    let target = DebugTarget { view: &target, scale: 1.0 };
    let shown = denoiser.encode_debug(&gpu.device, &mut encoder, &views, DebugView::Depth, target);
    printed("a debug view", shown);
    denoiser.resolve_timings(&gpu.device, &mut encoder);
    assert_eq!(denoiser.take_timings(&gpu.queue), None);
    printed("resize", denoiser.resize(&gpu.device, Size::new(40, 30)));
    printed("new", gpu::Denoiser::new(&gpu.device, SIZE, &options()).map(drop));
    printed("debug views", DebugViews::new(&gpu.device, Storage::Half, wgpu::TextureFormat::Rgba8Unorm).map(drop));
    let _ = SequenceWavelet::new(&gpu.device);
    // A host that does not know yet submits, too.
    gpu.queue.submit([begun.finish(), encoder.finish()]);
    let _ = gpu.device.poll(wgpu::PollType::Poll);

    println!("lost: {lost:?}\nuncaptured: {uncaptured:?}");
    assert_eq!(*lost.lock().unwrap(), ["Destroyed"]);
    // Nothing by quell itself; finishing what was begun before the loss is refused.
    assert!(uncaptured.lock().unwrap().iter().all(|e| e.contains("CommandEncoder, label = 'begun'")), "{uncaptured:?}");

    // A new device, a new denoiser: the same picture.
    let Some((gpu, _, uncaptured)) = listening(|_| wgpu::Limits::default()) else { return };
    let lost = told_when_lost(&gpu.device);
    let mut denoiser = gpu::Denoiser::new(&gpu.device, SIZE, &options()).unwrap();
    assert_eq!(on_gpu(&gpu, &mut denoiser, &scene.frame(SIZE, 0)).colours, before.colours);
    assert!(!lost.load(Ordering::Relaxed) && uncaptured.lock().unwrap().is_empty());
    gpu.device.destroy();
    let _ = gpu.device.poll(wgpu::PollType::Poll);
    assert!(lost.load(Ordering::Relaxed));
}

#[test]
fn running_out_of_memory_reaches_the_hosts_error_scope() {
    // As large as the device's textures may be.
    let largest = |most: &wgpu::Limits| wgpu::Limits {
        max_texture_dimension_2d: most.max_texture_dimension_2d,
        ..wgpu::Limits::default()
    };
    let Some((gpu, lost, uncaptured)) = listening(largest) else { return };
    let extent = gpu.device.limits().max_texture_dimension_2d as usize;
    let size = Size::new(extent, extent);
    let memory = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let validity = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
    let made = gpu::Denoiser::new(&gpu.device, size, &large());
    let invalid = now(validity.pop());
    let error = now(memory.pop());
    println!("{}", invalid.as_ref().map(ToString::to_string).unwrap_or_default());
    assert!(invalid.is_some(), "the guide says that there is one");
    println!("{size}: {:?}, {error:?}", made.as_ref().map(|d| d.memory()));
    println!("lost: {lost:?}\nuncaptured: {uncaptured:?}");
    assert!(matches!(error, Some(wgpu::Error::OutOfMemory { .. })), "{error:?}");
    drop(made);

    // What docs/integrating.md does then: smaller sizes on the same device, which works on.
    let fitting = now(as_large_as_fits(&gpu.device, size, &large())).unwrap();
    println!("{} fits", fitting.size());
    assert!(fitting.size().width < size.width);
    drop(fitting);
    let mut denoiser = gpu::Denoiser::new(&gpu.device, SIZE, &options()).unwrap();
    let scene = box_before_wall(moving, Noise::Uniform);
    let output = on_gpu(&gpu, &mut denoiser, &scene.frame(SIZE, 0));
    assert!(output.colours[0].1.data().iter().any(|c| c[0] > 0.0));
    assert!(lost.lock().unwrap().is_empty() && uncaptured.lock().unwrap().is_empty());
}

#[test]
fn the_code_that_hosts_copy_is_compiled_here() {
    // The guide lies outside this crate's package.
    let guide = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/integrating.md");
    let Ok(guide) = std::fs::read_to_string(guide) else { return };
    let shown = guide.split("```").find(|block| block.contains("push_error_scope")).expect("a block of code");
    let shown = shown.trim_start_matches("rust\n");
    let here = include_str!("loss.rs");
    assert!(here.contains(shown), "docs/integrating.md shows other code than this file:\n{shown}");
    assert!(!here.contains(&shown.replace("OutOfMemory", "Internal")));
}
