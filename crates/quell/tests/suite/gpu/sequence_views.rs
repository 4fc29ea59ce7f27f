//! Debug views of the sequence filter against what its buffers hold.

use super::device::{Gpu, gpu};
use super::window::scene;
use quell::Size;
use quell::gpu::wgpu::{CommandEncoderDescriptor, TextureFormat, TextureUsages, TextureView};
use quell::gpu::{
    DebugTarget, DebugViews, Error, Pass, SequenceKernels, SequenceStage, SequenceView, SequenceWindow, Storage,
};
use quell::sequence::{AcceleratedWindow, Accelerator, EstimateJob, SequenceDenoiser, SequenceSettings, WaveletJob};
use std::sync::{Arc, Mutex};

/// Largest difference of a channel, 0..1: a power and a logarithm, of which WGSL promises little, and counts that the CPU
/// gathered on its own.
const BOUND: f32 = 2e-3;
const SIZE: Size = Size::new(29, 18);
/// Not 1, so that a view without it is seen.
const SCALE: f32 = 1.3;
/// Of [`BOUND`], by view.
type Differences = Arc<Mutex<Vec<(String, f32)>>>;

#[derive(Clone, Debug)]
struct Viewer {
    gpu: &'static Gpu,
    kernels: Arc<SequenceKernels>,
    views: Arc<DebugViews>,
    seen: Differences,
}

impl Accelerator for Viewer {
    fn name(&self) -> String {
        "test".to_owned()
    }

    fn wavelet(&self, _: &mut WaveletJob<'_>) -> Result<(), String> {
        Ok(())
    }

    fn window(&self) -> Option<Box<dyn AcceleratedWindow>> {
        let window = SequenceWindow::new(&self.gpu.device, Arc::clone(&self.kernels));
        let usages = TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
        let bytes = vec![0; 16 * SIZE.pixels()];
        let target = self.gpu.texture_with("view", TextureFormat::Rgba32Float, SIZE, &bytes, usages);
        Some(Box::new(Window { viewer: self.clone(), window, target }))
    }
}

#[derive(Debug)]
struct Window {
    viewer: Viewer,
    window: SequenceWindow,
    target: TextureView,
}

fn encoded(v: f32) -> f32 {
    let c = v.clamp(0.0, 1.0);
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

fn heat(v: f32) -> [f32; 3] {
    [3.0 * v, 3.0 * v - 1.0, 3.0 * v - 2.0].map(|c| c.clamp(0.0, 1.0))
}

const NOWHERE: [f32; 3] = [0.05, 0.05, 0.12];

fn counted(count: f32) -> [f32; 3] {
    heat(count.max(1.0).log2() / 6.0)
}

fn light(v: &[f32]) -> [f32; 3] {
    [v[0], v[1], v[2]].map(|c| (c * SCALE).max(0.0)).map(|c| encoded(c / (1.0 + c)))
}

fn deviation(v: &[f32]) -> [f32; 3] {
    let (s, m) = (v[3].max(0.0).sqrt() * SCALE, quell::luminance([v[0], v[1], v[2]]).max(0.0));
    heat(if s > 0.0 { s / (s + m) } else { 0.0 })
}

fn depth(v: &[f32]) -> [f32; 3] {
    let doublings = -v[2].log2();
    if v[2] > 0.0 { [0.15 + 0.85 * (doublings - doublings.floor()); 3] } else { NOWHERE }
}

fn normal(v: &[f32]) -> [f32; 3] {
    if v[..3] == [0.0; 3] { NOWHERE } else { [v[0], v[1], v[2]].map(|c| 0.5 + 0.5 * c) }
}

/// Tone-mapped colours are at most 2; 8 sets mirrors apart.
fn seen_colour(v: &[f32]) -> [f32; 3] {
    [v[0] - 8.0 * v[3], v[1], v[2]].map(|c| encoded(0.5 * c))
}

impl Window {
    /// The largest difference of a view from what it should be, pixel by pixel.
    fn compare(&mut self, name: &str, view: SequenceView, expected: &[[f32; 3]]) -> Result<(), String> {
        let gpu = self.viewer.gpu;
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let target = DebugTarget { view: &self.target, scale: SCALE };
        let drawn = self.window.encode_debug(&gpu.device, &mut encoder, &self.viewer.views, view, target);
        drawn.map_err(|e| e.to_string())?;
        gpu.queue.submit([encoder.finish()]);
        let texels = gpu.read(SIZE, &[&self.target]).remove(0);
        assert_eq!(texels.len(), 4 * expected.len());
        let off = texels.chunks_exact(4).zip(expected).map(|(found, wanted)| {
            let pairs = || found.iter().zip(wanted.iter().chain(&[1.0]));
            // Where bands begin, a last bit is the whole range.
            let wraps = matches!(view, SequenceView::Depth) && pairs().any(|(a, b)| (a - b).abs() > 0.8);
            pairs().map(|(a, b)| (a - b).abs()).filter(|_| !wraps).fold(0.0, f32::max)
        });
        self.viewer.seen.lock().unwrap().push((name.to_owned(), off.fold(0.0, f32::max)));
        Ok(())
    }

    fn views(&mut self, job: &EstimateJob<'_>, until: SequenceStage) -> Result<(), String> {
        let gpu = self.viewer.gpu;
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let made = self.window.encode(&gpu.device, &mut encoder, job, until).map_err(|e| e.to_string())?;
        gpu.queue.submit([encoder.finish()]);
        let read = |buffer| gpu.read_buffers(&[buffer]).remove(0);
        let planes: Vec<_> = made.planes.iter().map(|(light, plane, b)| (*light, *plane, read(b))).collect();
        let features: Vec<_> = made.guides.iter().map(|(_, b)| read(b)).collect();
        let samples = made.samples.map(read).unwrap_or_default();
        let of =
            |numbers: &[f32], colour: fn(&[f32]) -> [f32; 3]| numbers.chunks_exact(4).map(colour).collect::<Vec<_>>();
        for (light_place, plane, numbers) in &planes {
            let view = SequenceView::Light { light: *light_place, plane: *plane };
            self.compare("light", view, &of(numbers, light))?;
            if *plane == 0 {
                let view = SequenceView::Deviation { light: *light_place };
                self.compare("deviation", view, &of(numbers, deviation))?;
            }
        }
        let noise = |(g, n): (&[f32], &[f32])| [g[3], n[3], 0.0].map(|v| (v * SCALE * 10.0).clamp(0.0, 1.0));
        let noise: Vec<_> = features[0].chunks_exact(4).zip(features[1].chunks_exact(4)).map(noise).collect();
        self.compare("depth", SequenceView::Depth, &of(&features[0], depth))?;
        self.compare("normal", SequenceView::Normal, &of(&features[1], normal))?;
        self.compare("noise", SequenceView::FeatureNoise, &noise)?;
        self.compare("seen colour", SequenceView::SeenColour, &of(&features[2], seen_colour))?;
        self.compare("seen normal", SequenceView::SeenNormal, &of(&features[3], normal))?;
        let largest: Vec<_> = samples.iter().map(|n| counted(*n)).collect();
        self.compare("samples", SequenceView::Samples, &largest)?;
        let (cpu, _) = job.on_cpu();
        for (asked, cpu) in job.lights().iter().zip(cpu) {
            let counts: Vec<_> = cpu.count.iter().map(|n| counted(*n)).collect();
            self.compare("counts", SequenceView::Counts { light: asked.wavelet.light }, &counts)?;
        }
        Ok(())
    }
}

impl AcceleratedWindow for Window {
    fn estimate(&mut self, job: &mut EstimateJob<'_>) -> Result<bool, String> {
        if job.frame(job.centre()).number == 0 {
            let nothing = self.compare("", SequenceView::Depth, &[]).unwrap_err();
            assert_eq!(nothing, Error::DebugImage { image: "frame" }.to_string());
        }
        self.window.reserve(&self.viewer.gpu.device, job).map_err(|e| e.to_string())?;
        for until in [SequenceStage::Gather, SequenceStage::Variance, SequenceStage::Wavelet] {
            self.views(job, until)?;
        }
        let none = self.compare("", SequenceView::Light { light: 99, plane: 0 }, &[]).unwrap_err();
        assert!(none.contains("such light"), "{none}");
        Ok(false)
    }
}

/// The largest difference of each view over two frames.
fn differences(gpu: &'static Gpu, kernels: &Arc<SequenceKernels>, views: DebugViews) -> Vec<(String, f32)> {
    let viewer = Viewer { gpu, kernels: Arc::clone(kernels), views: Arc::new(views), seen: Arc::default() };
    let mut settings = SequenceSettings::default();
    settings.set("gather.frames", "1").unwrap();
    let mut denoiser = SequenceDenoiser::with_accelerator(settings, Arc::new(viewer.clone())).unwrap();
    (0..2).for_each(|t| drop(denoiser.push(scene(SIZE, t), t == 0).unwrap()));
    denoiser.finish().unwrap();
    viewer.seen.lock().unwrap().clone()
}

/// Changes planted in the shader, each of which a view must show.
pub const PLANTED: &[(&str, &str)] = &[
    ("shown_light(v.xyz)", "shown_light(v.zyx)"),
    ("sqrt(max(v.w, 0.0)) * debug.scale", "sqrt(max(v.w, 0.0))"),
    ("count_colour(v[debug.place])", "count_colour(v.x)"),
    ("count_colour(numbers[p])", "count_colour(numbers[0])"),
    ("fract(-log2(v.z))", "fract(log2(v.z))"),
    ("vec3f(v.w, second[p].w, 0.0)", "vec3f(v.w, v.w, 0.0)"),
    ("DIVIDED * v.w", "0.0"),
    ("0.5 + 0.5 * normal", "normal"),
];

#[test]
fn views_show_what_the_buffers_hold() {
    let Some(gpu) = gpu() else { return };
    let kernels = Arc::new(SequenceKernels::new(&gpu.device));
    let views = || DebugViews::new(&gpu.device, Storage::Half, TextureFormat::Rgba32Float).unwrap();
    let found = differences(gpu, &kernels, views());
    assert!(found.len() > 100, "{}", found.len());
    for (name, off) in &found {
        assert!(*off <= BOUND, "{name}: {off:.1e}");
    }
    println!("largest: {:.1e}", found.iter().map(|(_, off)| *off).fold(0.0, f32::max));
    let source = Pass::DEBUG[1].source(Storage::Half, false).replace("rgba8unorm", "rgba32float");
    for (from, to) in PLANTED {
        assert!(source.contains(from), "the shader has no `{from}` any more");
        let planted = views().with_sequence_source(&gpu.device, &source.replace(from, to));
        let found = differences(gpu, &kernels, planted);
        assert!(found.iter().any(|(_, off)| *off > BOUND), "`{to}` for `{from}` is not seen");
    }
}
