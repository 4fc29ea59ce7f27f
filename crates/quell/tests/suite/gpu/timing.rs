//! Times of dispatches, and that nothing waits for them.

use super::device::{gpu, gpu_with_timestamps};
use super::sequence::Uploaded;
use super::textures::HostFrame;
use crate::suite::frames::{Noise, box_before_wall, moving};
use quell::gpu::wgpu::{CommandEncoderDescriptor, PollType};
use quell::gpu::{self, Options, Storage};
use quell::{Settings, Size};
use std::time::{Duration, Instant};

#[test]
fn every_dispatch_is_timed_once_the_host_has_polled() {
    let Some(gpu) = gpu_with_timestamps() else { return };
    let (size, mut options) = (Size::new(37, 23), Options::new(&Settings::default()));
    options.timings = true;
    let mut denoiser = gpu::Denoiser::new(&gpu.device, size, &options).unwrap();
    let frame = box_before_wall(moving, Noise::Sparse(0.4)).frame(size, 0);
    let uploaded = Uploaded::new(&gpu, &frame, Storage::Half);
    let encoder = || gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
    assert_eq!(denoiser.take_timings(&gpu.queue), None);
    // One that is never submitted does not keep the next one back.
    let mut lost = encoder();
    denoiser.encode(&gpu.device, &mut lost, &uploaded.frame()).unwrap();
    denoiser.resolve_timings(&gpu.device, &mut lost);
    drop(lost);
    denoiser.reset();
    let mut open = encoder();
    denoiser.encode(&gpu.device, &mut open, &uploaded.frame()).unwrap();
    denoiser.resolve_timings(&gpu.device, &mut open);
    assert_eq!(denoiser.take_timings(&gpu.queue), None, "before it was submitted");
    gpu.queue.submit([open.finish()]);
    gpu.device.poll(PollType::wait_indefinitely()).unwrap();
    let timings = denoiser.take_timings(&gpu.queue).expect("the host has polled");
    let passes: Vec<&str> = denoiser.program().dispatches.iter().map(|d| d.pass.name).collect();
    assert_eq!(timings.iter().map(|t| t.pass).collect::<Vec<_>>(), passes);
    assert!(timings.iter().all(|t| t.milliseconds >= 0.0 && t.milliseconds < 1e4), "{timings:?}");
    assert!(timings.iter().map(|t| t.milliseconds).sum::<f64>() > 0.0, "{timings:?}");
    assert_eq!(denoiser.take_timings(&gpu.queue), None, "they were taken");
}

#[test]
fn without_the_option_there_are_none() {
    let Some(gpu) = gpu_with_timestamps() else { return };
    let options = Options::new(&Settings::default());
    let mut denoiser = gpu::Denoiser::new(&gpu.device, Size::new(8, 8), &options).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
    denoiser.resolve_timings(&gpu.device, &mut encoder);
    assert_eq!(denoiser.take_timings(&gpu.queue), None);
}

#[test]
#[ignore = "measures"]
fn what_encoding_costs() {
    let Some(gpu) = gpu() else { return };
    let (size, mut options) = (Size::new(64, 36), Options::new(&Settings::default()));
    options.composite = true;
    let mut denoiser = gpu::Denoiser::new(&gpu.device, size, &options).unwrap();
    let mut frame = box_before_wall(moving, Noise::Sparse(0.4)).frame(size, 0);
    frame.camera.jitter = [0.25, 0.125];
    let host = HostFrame::new(gpu, &frame);
    let mut took: [Vec<Duration>; 2] = Default::default();
    for index in 0..600 {
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
        let begin = Instant::now();
        let output = denoiser.encode(&gpu.device, &mut encoder, &gpu::Frame { index, ..host.frame(&[]) }).unwrap();
        let encoded = begin.elapsed();
        let commands = encoder.finish();
        let both = begin.elapsed();
        // Not submitted: only what the CPU does is looked at.
        drop((commands, output));
        gpu.device.poll(PollType::Poll).unwrap();
        if index >= 100 {
            took[0].push(encoded);
            took[1].push(both);
        }
    }
    for (what, mut took) in ["encode", "encode and finish"].into_iter().zip(took) {
        took.sort();
        let at = |share: f64| took[(share * took.len() as f64) as usize].as_secs_f64() * 1e6;
        println!("{what}: median {:.0} us, a tenth below {:.0} us", at(0.5), at(0.1));
    }
}
