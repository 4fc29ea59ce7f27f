//! A device with WebGPU's default limits and no feature, and one pass run on it.

use quell::gpu::wgpu;
use quell::gpu::{
    Bindable, BindingKind, FrameUniforms, Kernel, Pass, PerFrameUniforms, SettingsUniforms, Storage, Texel, parted,
};
use quell::{Plane, Rgb, Size};
use std::pin::pin;
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll, Waker};

/// A device of the machine that runs the tests.
#[derive(Debug)]
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// A processor that plays a GPU. Its arithmetic is the CPU's; a GPU contracts products and sums, and its quotients,
    /// roots and powers have some units of the last place more.
    pub is_software: bool,
}

/// Futures of native back ends are ready when they are made.
pub fn now<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return value;
        }
    }
}

fn open(features: wgpu::Features) -> Result<Gpu, String> {
    open_with(features, |_| wgpu::Limits::default())
}

/// A device with these features, and limits made from the adapter's. A device is lost for all who hold it: tests that
/// lose one take one of their own.
pub fn open_with(features: wgpu::Features, limits: impl FnOnce(&wgpu::Limits) -> wgpu::Limits) -> Result<Gpu, String> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = now(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
        .map_err(|e| format!("there is no adapter: {e}"))?;
    if !adapter.features().contains(features) {
        return Err(format!("the adapter has not {features:?}"));
    }
    let info = adapter.get_info();
    println!("GPU tests run on {} ({:?}, {})", info.name, info.backend, info.driver_info);
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("quell tests"),
        required_features: features,
        required_limits: limits(&adapter.limits()),
        ..Default::default()
    };
    let (device, queue) = now(adapter.request_device(&descriptor)).map_err(|e| format!("no device: {e}"))?;
    device.on_uncaptured_error(Arc::new(|error| panic!("wgpu's validation: {error}")));
    Ok(Gpu { device, queue, is_software: info.device_type == wgpu::DeviceType::Cpu })
}

/// The device, or `None` after saying why there is none.
pub fn gpu() -> Option<&'static Gpu> {
    static GPU: OnceLock<Result<Gpu, String>> = OnceLock::new();
    match GPU.get_or_init(|| open(wgpu::Features::empty())) {
        Ok(gpu) => Some(gpu),
        Err(why) => {
            let required = std::env::var_os("QUELL_REQUIRE_GPU").is_some_and(|v| v == "1");
            assert!(!required, "QUELL_REQUIRE_GPU is set, but {why}");
            println!("SKIPPED: {why}");
            None
        }
    }
}

/// A device with timestamps, or `None` after saying why there is none.
pub fn gpu_with_timestamps() -> Option<Gpu> {
    gpu()?;
    open(wgpu::Features::TIMESTAMP_QUERY).map_err(|why| println!("SKIPPED: {why}")).ok()
}

/// Who computed an output: a back end always agrees with itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    Reference,
    Gpu,
    /// The GPU with one stage a pass.
    Unfused,
}

/// What a pass wrote: colour planes, then scalar ones, each with its name.
#[derive(Clone)]
pub struct Output {
    pub by: By,
    pub colours: Vec<(&'static str, Plane<Rgb>)>,
    pub scalars: Vec<(&'static str, Plane<f32>)>,
}

/// A pass with everything that it reads, and what the reference makes of it.
pub struct Job {
    pub pass: Pass,
    pub storage: Storage,
    pub size: Size,
    pub frame: FrameUniforms,
    pub settings: SettingsUniforms,
    /// One for each binding that is read, in their order; colours and numbers as 32-bit floats.
    pub inputs: Vec<Vec<u8>>,
    pub expected: Output,
}

/// A colour plane as an rgba32float texture holds it. The unused fourth value must not matter.
pub fn colour_bytes(plane: &Plane<Rgb>) -> Vec<u8> {
    plane.data().iter().flat_map(|c| [c[0], c[1], c[2], f32::MAX]).flat_map(f32::to_le_bytes).collect()
}

/// The same with a fourth value.
pub fn colour_and_bytes(plane: &Plane<Rgb>, fourth: &Plane<f32>) -> Vec<u8> {
    let texels = plane.data().iter().zip(fourth.data()).flat_map(|(c, a)| [c[0], c[1], c[2], *a]);
    texels.flat_map(f32::to_le_bytes).collect()
}

/// A plane of numbers.
pub fn number_bytes(plane: &Plane<f32>) -> Vec<u8> {
    plane.data().iter().copied().flat_map(f32::to_le_bytes).collect()
}

fn extent(size: Size) -> wgpu::Extent3d {
    wgpu::Extent3d { width: size.width as u32, height: size.height as u32, depth_or_array_layers: 1 }
}

/// The value of a half.
pub fn half(bits: u16) -> f32 {
    let (sign, exponent, mantissa) = (bits >> 15, (bits >> 10) & 31, f32::from(bits & 1023));
    let size = match exponent {
        0 => mantissa * 2.0f32.powi(-24),
        31 => f32::NAN,
        _ => (1.0 + mantissa / 1024.0) * 2.0f32.powi(i32::from(exponent) - 15),
    };
    if sign == 1 { -size } else { size }
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

    /// A texture that holds `bytes`, row by row.
    pub fn texture(&self, label: &str, format: wgpu::TextureFormat, size: Size, bytes: &[u8]) -> wgpu::TextureView {
        let usages = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::TEXTURE_BINDING;
        self.texture_with(label, format, size, bytes, usages)
    }

    /// [`Gpu::texture`] with these usages.
    pub fn texture_with(
        &self,
        label: &str,
        format: wgpu::TextureFormat,
        size: Size,
        bytes: &[u8],
        usages: wgpu::TextureUsages,
    ) -> wgpu::TextureView {
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: extent(size),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: usages | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let row = format.block_copy_size(None).unwrap() * size.width as u32;
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        self.queue.write_texture(texture.as_image_copy(), bytes, layout, extent(size));
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    }

    /// What textures of `size` hold once everything submitted has run, texel by texel: four numbers of a colour, or one.
    pub fn read(&self, size: Size, views: &[&wgpu::TextureView]) -> Vec<Vec<f32>> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
        let copies: Vec<(wgpu::Buffer, wgpu::TextureFormat, u32)> = views
            .iter()
            .map(|view| {
                let format = view.texture().format();
                let row = format.block_copy_size(None).unwrap() * size.width as u32;
                let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
                let copy = self.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("copy"),
                    size: u64::from(padded) * size.height as u64,
                    usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                let layout =
                    wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
                let to = wgpu::TexelCopyBufferInfo { buffer: &copy, layout };
                encoder.copy_texture_to_buffer(view.texture().as_image_copy(), to, extent(size));
                (copy, format, row)
            })
            .collect();
        self.queue.submit([encoder.finish()]);
        copies.iter().for_each(|(copy, ..)| copy.map_async(wgpu::MapMode::Read, .., |result| result.unwrap()));
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let floats = |(copy, format, row): &(wgpu::Buffer, wgpu::TextureFormat, u32)| {
            let bytes = copy.get_mapped_range(..).unwrap();
            let rows = bytes.chunks_exact(bytes.len() / size.height).map(|r| &r[..*row as usize]);
            let is_half = *format == wgpu::TextureFormat::Rgba16Float;
            let mut out = Vec::new();
            for row in rows {
                if is_half {
                    out.extend(row.chunks_exact(2).map(|b| half(u16::from_le_bytes([b[0], b[1]]))));
                } else {
                    out.extend(row.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
                }
            }
            out
        };
        copies.iter().map(floats).collect()
    }

    /// What storage buffers hold once everything submitted has run.
    pub fn read_buffers(&self, buffers: &[&wgpu::Buffer]) -> Vec<Vec<f32>> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
        let copy_of = |buffer: &&wgpu::Buffer| {
            let copy = self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("copy"),
                size: buffer.size(),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
            copy
        };
        let copies: Vec<wgpu::Buffer> = buffers.iter().map(copy_of).collect();
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
        let pixels = job.size.pixels();
        let mut planes: Vec<Option<wgpu::TextureView>> = Vec::new();
        let mut taps: Vec<wgpu::Buffer> = Vec::new();
        for binding in job.pass.bindings {
            planes.push(match binding.kind {
                BindingKind::Sampled(texel) => {
                    // Colours and numbers are the host's: exact, whatever the storage.
                    let stored = if texel.component() == "u32" { job.storage } else { Storage::Float };
                    Some(self.texture(binding.name, texel.format(stored), job.size, inputs.next().unwrap()))
                }
                // NaN everywhere: a pixel that is not written shows.
                BindingKind::Stored(texel) => {
                    let bytes = vec![0xff; texel.bytes(job.storage) as usize * pixels];
                    let usages = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::STORAGE_BINDING;
                    Some(self.texture_with(binding.name, texel.format(job.storage), job.size, &bytes, usages))
                }
                BindingKind::Taps => {
                    taps.push(self.buffer(binding.name, inputs.next().unwrap(), wgpu::BufferUsages::STORAGE));
                    None
                }
                _ => panic!("no stage has one"),
            });
        }
        assert!(inputs.next().is_none(), "{}: an input too many", job.pass.name);
        let bound: Vec<Bindable<'_>> =
            planes.iter().map(|p| p.as_ref().map_or_else(|| Bindable::Taps(&taps[0]), Bindable::Plane)).collect();
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("test") });
        let uniforms = PerFrameUniforms { frame: &frame, settings: &settings };
        kernel.encode(&self.device, &mut encoder, uniforms, &bound, job.size).unwrap();
        self.queue.submit([encoder.finish()]);
        let written: Vec<(&'static str, Texel, &wgpu::TextureView)> = (job.pass.bindings.iter().zip(&planes))
            .filter_map(|(b, plane)| match b.kind {
                BindingKind::Stored(texel) => Some((b.name, texel, plane.as_ref()?)),
                _ => None,
            })
            .collect();
        let contents = self.read(job.size, &written.iter().map(|(.., view)| *view).collect::<Vec<_>>());
        let mut output = Output { by: By::Gpu, colours: Vec::new(), scalars: Vec::new() };
        for ((name, texel, _), floats) in written.into_iter().zip(contents) {
            if texel == Texel::Number {
                let both = job.expected.scalars.iter().any(|(name, _)| *name == "fast history");
                let plane = |values: Vec<f32>| Plane::from_vec(job.size, values).unwrap();
                if both {
                    let (length, fast) = floats.iter().map(|t| parted(*t)).map(|(n, f)| (n, f.unwrap_or(-1.0))).unzip();
                    output.scalars.extend([("history length", plane(length)), ("fast history", plane(fast))]);
                } else {
                    output.scalars.push(("history length", plane(floats)));
                }
                continue;
            }
            let colours = floats.chunks_exact(4).map(|c| [c[0], c[1], c[2]]).collect();
            output.colours.push((name, Plane::from_vec(job.size, colours).unwrap()));
            if job.expected.scalars.len() > output.scalars.len() {
                let confidence = floats.iter().skip(3).step_by(4).map(|a| a.abs()).collect();
                output.scalars.push(("confidence", Plane::from_vec(job.size, confidence).unwrap()));
            }
        }
        output
    }
}
