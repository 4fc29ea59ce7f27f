//! How many bytes a second a device moves: what floors of stages are reckoned with.

use crate::device::Gpu;
use crate::error::Error;
use quell::gpu::wgpu::BufferUsages;
use std::time::{Duration, Instant};

/// Beyond any cache; on devices with less in one buffer, as much as they take.
const BYTES: u64 = 512 << 20;
/// Long enough that what a submit costs does not show.
const LONG: Duration = Duration::from_millis(100);
/// As many copies in one submit at the most.
const MOST: u32 = 128;
/// The best of so many rounds: what else the machine does only slows.
const ROUNDS: u32 = 3;

/// Gigabytes a second, read and written together, that copying from buffer to buffer reaches.
///
/// # Errors
/// What the device reports.
pub fn copy_speed(gpu: &Gpu) -> Result<f64, Error> {
    let bytes = BYTES.min(gpu.device().limits().max_buffer_size) & !255;
    let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
    let [a, b] = ["quell copied from", "quell copied to"].map(|label| gpu.buffer(label, bytes, usage));
    let seconds = |copies: u32| {
        let mut encoder = gpu.encoder("quell copies");
        for _ in 0..copies {
            encoder.copy_buffer_to_buffer(&a, 0, &b, 0, bytes);
        }
        let begin = Instant::now();
        gpu.run(encoder, "measuring its bandwidth").map(|()| begin.elapsed().as_secs_f64())
    };
    // The first touches the memory.
    seconds(1)?;
    let once = seconds(1)?;
    let copies = (LONG.as_secs_f64() / once.max(1e-9)).clamp(1.0, f64::from(MOST)) as u32;
    let mut best = once;
    for _ in 0..ROUNDS {
        best = best.min(seconds(copies)? / f64::from(copies));
    }
    Ok(2.0 * bytes as f64 / best.max(1e-12) / 1e9)
}
