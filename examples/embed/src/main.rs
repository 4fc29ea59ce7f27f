//! A renderer that owns its device, its textures and its frame, and calls quell between tracing and showing.
//!
//!     cargo run --release -p embed -- picture.png
//!
//! No window is opened: the last frame is written as a PNG, on the left as traced, on the right as denoised. The renderer
//! itself is `renderer.wgsl`; what a host must know of quell is in `frame` below and in docs/integrating.md.

use quell::gpu::{self, Channel, Convention, GuideTextures, MotionUnit, Scalar, Signal};
use quell::{Camera, Preset, Settings, Size};
use std::error::Error;
use std::pin::pin;
use std::task::{Context, Poll, Waker};
use wgpu::TextureFormat::{R32Float, Rg32Float, Rgba8Unorm, Rgba16Float};

const SIZE: Size = Size { width: 384, height: 216 };
const FRAMES: i64 = 24;
/// Vertical, radians.
const FOV: f32 = 1.1;
/// What the renderer writes, in the order of its bindings.
/// Depth, normal with roughness, motion, matte weight; direct light, matte, glossy with hit distance, glossy weight.
const PLANES: [wgpu::TextureFormat; 8] =
    [R32Float, Rgba16Float, Rg32Float, Rgba16Float, Rgba16Float, Rgba16Float, Rgba16Float, Rgba16Float];

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "embed.png".to_owned());
    let renderer = Renderer::new()?;
    let (device, queue) = (&renderer.device, &renderer.queue);

    let mut options = gpu::Options::new(&Settings::preset(Preset::Quality));
    options.composite = true;
    let mut denoiser = gpu::Denoiser::new(device, SIZE, &options)?;
    for index in 0..FRAMES {
        let (camera, previous_camera) = (camera(index), camera(index - 1));
        queue.write_buffer(&renderer.view, 0, bytemuck::cast_slice(&view(index)));
        let mut encoder = device.create_command_encoder(&Default::default());
        renderer.trace(&mut encoder);
        let output = denoiser.encode(device, &mut encoder, &renderer.frame(camera, previous_camera, index))?;
        let composite = output.composite.ok_or("the composite was asked for")?;
        renderer.present(&mut encoder, &composite);
        queue.submit([encoder.finish()]);
    }
    renderer.save(&path)
}

struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    view: wgpu::Buffer,
    planes: [wgpu::TextureView; 8],
    picture: wgpu::Texture,
    /// Entry points of renderer.wgsl: `surfaces`, `light`, `present`.
    passes: [wgpu::ComputePipeline; 3],
}

impl Renderer {
    /// What quell is told of a frame: views of the renderer's own textures, and how to read them.
    fn frame(&self, camera: Camera, previous_camera: Camera, index: i64) -> gpu::Frame<'_> {
        let [depth, normal, motion, matte_weight, direct, matte, glossy, glossy_weight] = &self.planes;
        // Motion in shares of the picture, current minus previous; all else as quell has it.
        let convention = Convention { motion_scale: [-1.0; 2], motion_unit: MotionUnit::Extents, ..Convention::QUELL };
        let guides = GuideTextures {
            convention,
            view_depth: Some(depth),
            normal: Some(normal),
            motion: Some(motion),
            roughness: Some(Scalar { view: normal, channel: Channel::A }),
            glossy_hit_distance: Some(Scalar { view: glossy, channel: Channel::A }),
            ..GuideTextures::default()
        };
        let mut frame = gpu::Frame::new(SIZE, camera, previous_camera, index, guides);
        frame.direct = Some(direct);
        frame.matte = Some(Signal { light: matte, weight: Some(matte_weight), direct: None });
        frame.glossy = Some(Signal { light: glossy, weight: Some(glossy_weight), direct: None });
        frame
    }

    fn new() -> Result<Self, Box<dyn Error>> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapter = now(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
        println!("{}", adapter.get_info().name);
        let (device, queue) = now(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
        let texture = |width, format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width, height: SIZE.height as u32, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::STORAGE_BINDING,
                view_formats: &[],
            })
        };
        let module = device.create_shader_module(wgpu::include_wgsl!("renderer.wgsl"));
        let pipeline = |entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let (width, read) = (SIZE.width as u32, wgpu::TextureUsages::TEXTURE_BINDING);
        Ok(Self {
            view: buffer(&device, 4 * 48, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST),
            planes: PLANES.map(|format| texture(width, format, read).create_view(&Default::default())),
            picture: texture(2 * width, Rgba8Unorm, wgpu::TextureUsages::COPY_SRC),
            passes: ["surfaces", "light", "present"].map(pipeline),
            device,
            queue,
        })
    }

    fn trace(&self, encoder: &mut wgpu::CommandEncoder) {
        let [depth, normal, motion, matte_weight, direct, matte, glossy, glossy_weight] = &self.planes;
        self.run(encoder, 0, &[(0, depth), (1, normal), (2, motion), (3, matte_weight)]);
        self.run(encoder, 1, &[(4, direct), (5, matte), (6, glossy), (7, glossy_weight)]);
    }

    fn present(&self, encoder: &mut wgpu::CommandEncoder, denoised: &wgpu::TextureView) {
        let [.., matte_weight, direct, matte, glossy, glossy_weight] = &self.planes;
        let (picture, noisy) =
            (&self.picture.create_view(&Default::default()), [(8, direct), (9, matte), (10, glossy)]);
        let rest = [(11, matte_weight), (12, glossy_weight), (13, denoised), (14, picture)];
        self.run(encoder, 2, &[&noisy[..], &rest].concat());
    }

    fn run(&self, encoder: &mut wgpu::CommandEncoder, pass: usize, views: &[(u32, &wgpu::TextureView)]) {
        let pipeline = &self.passes[pass];
        let texture = |view| wgpu::BindingResource::TextureView(view);
        let entries = views.iter().map(|&(binding, v)| wgpu::BindGroupEntry { binding, resource: texture(v) });
        let entries: Vec<_> = entries.collect();
        let uniform = [wgpu::BindGroupEntry { binding: 0, resource: self.view.as_entire_binding() }];
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(pipeline);
        for (index, entries) in [(0, &uniform[..]), (1, &entries[..])] {
            let layout = &pipeline.get_bind_group_layout(index);
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries });
            pass.set_bind_group(index, &group, &[]);
        }
        pass.dispatch_workgroups(SIZE.width.div_ceil(8) as u32, SIZE.height.div_ceil(8) as u32, 1);
    }

    fn save(&self, path: &str) -> Result<(), Box<dyn Error>> {
        let extent = self.picture.size();
        let row = 4 * extent.width; // a multiple of 256, as copies want it
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let buffer = buffer(&self.device, u64::from(row * extent.height), usage);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(self.picture.as_image_copy(), to, extent);
        self.queue.submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |_| ());
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        let pixels = buffer.get_mapped_range(..)?.to_vec();
        let picture = image::RgbaImage::from_raw(extent.width, extent.height, pixels).ok_or("the picture is short")?;
        Ok(picture.save(path)?)
    }
}

fn buffer(device: &wgpu::Device, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}

/// Where the camera of a frame stands, and the direction that it looks in: a slow turn while walking.
fn pose(index: i64) -> ([f32; 3], [f32; 3]) {
    let t = index as f32 / FRAMES as f32;
    let angle: f32 = 0.35 - 0.5 * t;
    ([0.9 - 1.4 * t, -0.1, 3.6 - 0.6 * t], [angle.sin(), 0.0, -angle.cos()])
}

fn camera(index: i64) -> Camera {
    let (position, forward) = pose(index);
    Camera::perspective(position, forward, [0.0, 1.0, 0.0], FOV, SIZE.width as f32 / SIZE.height as f32)
}

/// The uniform `View` of renderer.wgsl: matrices, and the vectors that make rays.
fn view(index: i64) -> Vec<f32> {
    let ([x, y, z], [fx, fy, fz]) = pose(index);
    let (width, height, tan) = (SIZE.width as f32, SIZE.height as f32, (0.5 * FOV).tan());
    let aside = tan * width / height;
    let (now, before) = (camera(index).clip_from_world, camera(index - 1).clip_from_world);
    let rays = [fx, fy, fz, width, -fz * aside, 0.0, fx * aside, height, 0.0, tan, 0.0, 0.0];
    [&now[..], &before, &[x, y, z, index as f32], &rays].concat()
}

/// Waits for a future that is ready at once, as wgpu's are outside browsers.
fn now<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return value;
        }
    }
}
