//! A host whose guides are textures: device depth, normals of the camera's space, jittered vectors in clip space.

use super::camera::axes;
use super::runner::Input;
use super::{Gpu, SIZE};
use quell::gpu::wgpu::{self, TextureFormat as F};
use quell::gpu::{self, Convention, DepthKind, GuideTextures, NormalSpace, Options};
use quell::{FrameBuf, Plane, Rgb, Settings};
use std::collections::HashMap;

pub const CONVENTION: Convention = Convention {
    motion_has_jitter: true,
    depth: DepthKind::Device,
    normal_space: NormalSpace::View,
    ..Convention::NDC
};

/// Distance of the near plane of a reversed, infinite projection.
const NEAR: f32 = 0.1;

/// A camera with a row for depth, and values that the border repairs.
pub fn as_renderers_have_it(mut frame: FrameBuf) -> FrameBuf {
    for camera in [&mut frame.camera, &mut frame.previous_camera] {
        for column in 0..4 {
            camera.clip_from_world[4 * column + 2] = if column == 3 { NEAR } else { 0.0 };
        }
    }
    if let (Some(roughness), Some(matte)) = (&mut frame.roughness, &mut frame.matte) {
        roughness.data_mut()[77] = f32::NAN;
        matte.data_mut()[301] = [f32::INFINITY, 0.5, -1.0];
    }
    frame
}

fn floats<const N: usize>(format: F, at: impl Fn(usize, usize) -> [f32; N]) -> Input {
    let pixels = (0..SIZE.height).flat_map(|y| (0..SIZE.width).map(move |x| (x, y)));
    Input { format, bytes: pixels.flat_map(|(x, y)| at(x, y)).flat_map(f32::to_le_bytes).collect() }
}

/// The host's textures by the manifest's names. Trust in history is what this host has not.
pub fn inputs(frame: &FrameBuf) -> HashMap<&'static str, Input> {
    fn some<T>(plane: &Option<T>) -> &T {
        plane.as_ref().expect("the tracer makes it")
    }
    let colour = |plane: &Option<Plane<Rgb>>| {
        let plane = some(plane);
        floats(F::Rgba32Float, |x, y| {
            let [r, g, b] = plane.at(x, y);
            [r, g, b, 1.0]
        })
    };
    let number = |plane: &Option<Plane<f32>>| floats(F::R32Float, |x, y| [some(plane).at(x, y)]);
    let [right, up] = axes(&frame.camera);
    let m = frame.camera.clip_from_world;
    let length = (m[3] * m[3] + m[7] * m[7] + m[11] * m[11]).sqrt();
    let forward = [m[3], m[7], m[11]].map(|v| f64::from(v / length));
    let dot = |a: [f64; 3], n: [f32; 3]| (0..3).map(|i| a[i] * f64::from(n[i])).sum::<f64>() as f32;
    let normal = |x, y| {
        let n = some(&frame.normal).at(x, y);
        [dot(right, n), dot(up, n), -dot(forward, n), 0.0]
    };
    let (now, before) = (frame.camera.jitter, frame.previous_camera.jitter);
    let scale = [-0.5 * SIZE.width as f32, 0.5 * SIZE.height as f32];
    let motion = |x, y| {
        let moved = some(&frame.motion).at(x, y);
        [0, 1].map(|i| (moved[i] + now[i] - before[i]) / scale[i])
    };
    let ids = (0..SIZE.pixels()).flat_map(|i| some(&frame.surface_id).data()[i].to_le_bytes()).collect();
    HashMap::from([
        ("direct input", colour(&frame.direct)),
        ("matte input", colour(&frame.matte)),
        ("glossy input", colour(&frame.glossy)),
        ("matte weight", colour(&frame.matte_weight)),
        ("glossy weight", colour(&frame.glossy_weight)),
        ("view depth", floats(F::R32Float, |x, y| [NEAR / some(&frame.view_depth).at(x, y)])),
        ("normal", floats(F::Rgba32Float, normal)),
        ("motion", floats(F::Rg32Float, motion)),
        ("roughness", number(&frame.roughness)),
        ("glossy hit distance", number(&frame.glossy_hit_distance)),
        ("surface id", Input { format: F::R32Uint, bytes: ids }),
    ])
}

/// What the denoiser writes at each frame, by the manifest's names of outputs; and what it repaired of the last.
pub fn by_the_denoiser(
    gpu: &Gpu,
    settings: &Settings,
    frames: &[FrameBuf],
) -> (Vec<HashMap<&'static str, Vec<u8>>>, Vec<u8>) {
    let mut options = Options::new(settings);
    (options.composite, options.count_repairs) = (true, true);
    let mut denoiser = gpu::Denoiser::new(gpu.device(), SIZE, &options).expect("a denoiser");
    let mut repairs = Vec::new();
    let mut run = |frame: &FrameBuf| {
        let texture =
            |(name, input): (&'static str, Input)| (name, gpu.texture(name, SIZE, input.format, &input.bytes));
        let views: HashMap<&str, wgpu::TextureView> = inputs(frame).into_iter().map(texture).collect();
        let view = |name: &str| &views[name];
        let guides = GuideTextures {
            convention: CONVENTION,
            view_depth: Some(view("view depth")),
            normal: Some(view("normal")),
            motion: Some(view("motion")),
            roughness: Some(view("roughness").into()),
            glossy_hit_distance: Some(view("glossy hit distance").into()),
            surface_id: Some(view("surface id")),
            confidence_in: None,
        };
        let signal = |light, weight| Some(gpu::Signal { light: view(light), weight: Some(view(weight)), direct: None });
        let encoded = gpu::Frame {
            direct: Some(view("direct input")),
            matte: signal("matte input", "matte weight"),
            glossy: signal("glossy input", "glossy weight"),
            ..gpu::Frame::new(SIZE, frame.camera, frame.previous_camera, frame.index, guides)
        };
        let mut encoder = gpu.encoder("a test");
        let output = denoiser.encode(gpu.device(), &mut encoder, &encoded).expect("encoded");
        let counts = output.repairs.clone().expect("counted");
        let copy =
            gpu.buffer("counts", gpu::Repairs::BYTES, wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        encoder.copy_buffer_to_buffer(counts.buffer(), 0, &copy, 0, copy.size());
        gpu.run(encoder, "a test").expect("ran");
        copy.map_async(wgpu::MapMode::Read, .., |result| result.expect("mapped"));
        gpu.device().poll(wgpu::PollType::wait_indefinitely()).expect("it ends");
        repairs = copy.get_mapped_range(..).expect("a range").to_vec();
        super::outputs(gpu, output)
    };
    let outputs = frames.iter().map(&mut run).collect();
    (outputs, repairs)
}
