//! A device with WebGPU's default limits and no feature, and one pass run on it.

use quell::gpu::wgpu;
use quell::gpu::{Access, FrameUniforms, Kernel, Pass, SettingsUniforms};
use quell::{Plane, Rgb, Size};
use std::pin::pin;
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll, Waker};

/// A device of the machine that runs the tests.
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
}

/// Futures of native back ends are ready when they are made.
fn now<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return value;
        }
    }
}

fn open() -> Result<Gpu, String> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = now(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
        .map_err(|e| format!("there is no adapter: {e}"))?;
    let info = adapter.get_info();
    println!("GPU tests run on {} ({:?}, {})", info.name, info.backend, info.driver_info);
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("quell tests"),
        required_features: wgpu::Features::empty(),
        required_limits: wgpu::Limits::default(),
        ..Default::default()
    };
    let (device, queue) = now(adapter.request_device(&descriptor)).map_err(|e| format!("no device: {e}"))?;
    device.on_uncaptured_error(Arc::new(|error| panic!("wgpu's validation: {error}")));
    Ok(Gpu { device, queue })
}

/// The device, or `None` after saying why there is none.
pub fn gpu() -> Option<&'static Gpu> {
    static GPU: OnceLock<Result<Gpu, String>> = OnceLock::new();
    match GPU.get_or_init(open) {
        Ok(gpu) => Some(gpu),
        Err(why) => {
            let required = std::env::var_os("QUELL_REQUIRE_GPU").is_some_and(|v| v == "1");
            assert!(!required, "QUELL_REQUIRE_GPU is set, but {why}");
            println!("SKIPPED: {why}");
            None
        }
    }
}

/// Who computed an output: a back end always agrees with itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    Reference,
    Gpu,
}

/// What a pass wrote: colour planes, then scalar ones, each with its name.
#[derive(Clone)]
pub struct Output {
    pub by: By,
    pub colours: Vec<(&'static str, Plane<Rgb>)>,
    pub scalars: Vec<(&'static str, Plane<f32>)>,
}

/// A pass with everything that it is told, and what the reference makes of it.
pub struct Job {
    pub pass: Pass,
    pub size: Size,
    pub frame: FrameUniforms,
    pub settings: SettingsUniforms,
    /// One for each binding that is read, in their order.
    pub inputs: Vec<Vec<u8>>,
    pub expected: Output,
}

/// A colour plane as a storage buffer holds it. The unused fourth value must not matter.
pub fn colour_bytes(plane: &Plane<Rgb>) -> Vec<u8> {
    plane.data().iter().flat_map(|c| [c[0], c[1], c[2], f32::MAX]).flat_map(f32::to_le_bytes).collect()
}

/// Two scalar planes, interleaved.
pub fn state_bytes(confidence: &Plane<f32>, length: &Plane<f32>) -> Vec<u8> {
    confidence.data().iter().zip(length.data()).flat_map(|(c, n)| [*c, *n]).flat_map(f32::to_le_bytes).collect()
}

impl Gpu {
    /// A buffer that holds `bytes`.
    pub fn buffer(&self, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// What storage buffers hold once everything submitted has run.
    pub fn read(&self, buffers: &[&wgpu::Buffer]) -> Vec<Vec<f32>> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
        let copies: Vec<wgpu::Buffer> = buffers
            .iter()
            .map(|buffer| {
                let copy = self.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("copy"),
                    size: buffer.size(),
                    usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
                copy
            })
            .collect();
        self.queue.submit([encoder.finish()]);
        copies.iter().for_each(|copy| copy.map_async(wgpu::MapMode::Read, .., |result| result.unwrap()));
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let floats = |copy: &wgpu::Buffer| {
            let bytes = copy.get_mapped_range(..).unwrap();
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
        };
        copies.iter().map(floats).collect()
    }

    /// Runs a job on a compiled pass.
    pub fn run(&self, kernel: &Kernel, job: &Job) -> Output {
        let frame = self.buffer("frame", &job.frame.bytes(), wgpu::BufferUsages::UNIFORM);
        let settings = self.buffer("settings", &job.settings.bytes(), wgpu::BufferUsages::UNIFORM);
        let mut inputs = job.inputs.iter();
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let buffers: Vec<wgpu::Buffer> = job
            .pass
            .bindings
            .iter()
            .map(|binding| match binding.access {
                Access::Read => self.buffer(binding.name, inputs.next().unwrap(), storage),
                // NaN everywhere: a pixel that is not written shows.
                Access::Write => {
                    let bytes = vec![0xff; (binding.stride as usize) * job.size.pixels()];
                    self.buffer(binding.name, &bytes, storage)
                }
            })
            .collect();
        assert!(inputs.next().is_none(), "{}: an input too many", job.pass.name);
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("test") });
        let bound: Vec<&wgpu::Buffer> = buffers.iter().collect();
        kernel.encode(&self.device, &mut encoder, &frame, &settings, &bound, job.size).unwrap();
        self.queue.submit([encoder.finish()]);
        let written = || job.pass.bindings.iter().zip(&buffers).filter(|(b, _)| b.access == Access::Write);
        let contents = self.read(&written().map(|(_, buffer)| buffer).collect::<Vec<_>>());
        let mut output = Output { by: By::Gpu, colours: Vec::new(), scalars: Vec::new() };
        for ((binding, _), floats) in written().zip(contents) {
            let plane = |stride, k| Plane::from_vec(job.size, floats.iter().skip(k).step_by(stride).copied().collect());
            match binding.stride {
                16 => {
                    let colours = floats.chunks_exact(4).map(|c| [c[0], c[1], c[2]]).collect();
                    output.colours.push((binding.name, Plane::from_vec(job.size, colours).unwrap()));
                }
                8 => {
                    output.scalars.push(("confidence", plane(2, 0).unwrap()));
                    output.scalars.push(("history length", plane(2, 1).unwrap()));
                }
                _ => {} // a plane of the pass's own
            }
        }
        output
    }
}
