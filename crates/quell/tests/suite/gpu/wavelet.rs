//! The sequence filter's wavelet on the GPU against the reference and the CPU, on the same inputs.

use super::device::{Gpu, gpu};
use quell::gpu::wgpu::{BufferUsages, CommandEncoderDescriptor};
use quell::gpu::{Error, Pass, SequenceWavelet, Storage, WaveletBuffers};
use quell::sequence::{
    Accelerator, Filtered, Guide, Light, LightKind, SequenceDenoiser, SequenceFrame, SequenceSettings, WaveletJob,
};
use quell::{Backend, Plane, Rgb, Size};
use std::sync::Arc;

/// Largest difference of one frame, relative to the value plus its plane's mean. Five levels of sums of 9 terms, whose
/// weights are 16th powers of quotients: WGSL allows a quotient 2.5 units in the last place, and sums may be fused. The
/// luminance stop subtracts variances of like size, so it shows what they lost. Nothing is decided at a threshold: no pixel
/// may lie beyond. Lavapipe, which rounds every step as the CPU does, is 4e-7 away.
const WAVELET: f64 = 5e-5;
/// Of 30 frames with what follows on the CPU. No frame is made from a filtered one, but `stabilise` compares pixels by signatures in half
/// precision: a difference in the last bit moves one of them by 5e-4, and what comes out by up to a tenth of that (6e-5 on lavapipe;
/// 3e-7 without `stabilise`).
const SEQUENCE: f64 = 2e-4;

/// A host as small as can be.
#[derive(Debug)]
struct OnDevice {
    gpu: &'static Gpu,
    wavelet: SequenceWavelet,
    /// Pixels that a binding may hold.
    most_pixels: u64,
    fails: bool,
}

impl OnDevice {
    fn new(gpu: &'static Gpu) -> Self {
        Self { gpu, wavelet: SequenceWavelet::new(&gpu.device), most_pixels: 1 << 23, fails: false }
    }
}

impl Accelerator for OnDevice {
    fn name(&self) -> String {
        "test".to_owned()
    }

    fn wavelet(&self, job: &mut WaveletJob<'_>) -> Result<(), String> {
        if self.fails {
            return Err("planted".to_owned());
        }
        let (gpu, usage) = (self.gpu, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        for light in job.lights() {
            let bands = SequenceWavelet::bands_of(self.most_pixels, job.size(), light.levels);
            for (core, rows) in bands.map_err(|e| e.to_string())? {
                let size = Size::new(job.size().width, rows.len());
                let guide = |guide| gpu.buffer("guide", &job.guide(guide, rows.clone()), usage);
                let guides = [Guide::Geometry, Guide::Normal, light.colour_of, Guide::SeenNormal].map(guide);
                // NaN everywhere: what is not written shows.
                let empty = |stride: usize| gpu.buffer("own", &vec![0xff; stride * size.pixels()], usage);
                let compared = empty(16);
                let colours = |plane| gpu.buffer("light", &job.colours(light.light, plane, rows.clone()), usage);
                let planes: Vec<_> = (0..light.planes).map(|plane| [colours(plane), empty(16)]).collect();
                let buffers = WaveletBuffers {
                    geometry: &guides[0],
                    normals: &guides[1],
                    guide_colours: &guides[2],
                    seen_normals: &guides[3],
                    compared: &compared,
                    planes: &planes.iter().map(|pair| pair.each_ref()).collect::<Vec<_>>(),
                };
                let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
                let at = self.wavelet.encode(&gpu.device, &mut encoder, &light, &buffers, size);
                let at = at.map_err(|e| e.to_string())?;
                gpu.queue.submit([encoder.finish()]);
                for (plane, pair) in planes.iter().enumerate() {
                    let bytes: Vec<u8> =
                        gpu.read_buffers(&[&pair[at]])[0].iter().flat_map(|v| v.to_le_bytes()).collect();
                    let row = size.width * 16;
                    let kept = (core.start - rows.start) * row..(core.end - rows.start) * row;
                    job.store(light.light, plane, core.clone(), &bytes[kept])?;
                }
            }
        }
        Ok(())
    }
}

/// Numbers 0..1 that look random, from integers.
pub fn random(x: usize, y: usize, t: i64, k: u64) -> f32 {
    let mut h = (x as u64) ^ (y as u64) << 16 ^ (t as u64) << 32 ^ k << 56;
    for _ in 0..3 {
        h = (h ^ (h >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}

/// A slanted floor with bumps and a wall behind it, under a sky, with a mirror and a glass on them: every kind of light, and
/// guides that are noisy here and there. All of it slides to the left.
pub fn frame(size: Size, t: i64) -> SequenceFrame {
    let mut frame = SequenceFrame::new(t, size);
    // Of the pixel's surface: places move with it.
    let across = move |x: usize| x as f32 + t as f32;
    let sky = move |y: usize| size.height > 4 && y < size.height / 5;
    let mirror = move |x: usize, y: usize| (across(x) as usize / 9) % 3 == 1 && y % 11 > 4;
    let noisy = |k: u64, share: f32| {
        move |x: usize, y: usize| -> Rgb {
            let lit = if random(x, y, t, k) < 0.4 { 2.5 } else { 0.0 };
            let edge = if across(x) % 16.0 < 7.0 { 1.0 } else { 0.3 };
            [1.0, 0.8, 0.5].map(|c| share * c * edge * (lit + 0.1 * random(x, y, t, k + 1)))
        }
    };
    let kinds = [
        LightKind::MatteDirect,
        LightKind::MatteIndirect,
        LightKind::GlossyDirect,
        LightKind::GlossyIndirect,
        LightKind::Transmission,
        LightKind::Volume,
        LightKind::Beauty,
    ];
    for (k, kind) in (0u64..).zip(kinds) {
        frame.lights.push(Light::new("light", kind, Plane::from_fn(size, noisy(10 * k, 1.0 + k as f32))));
    }
    let half = |share: f32| Plane::from_fn(size, |x, y| noisy(10, 2.0)(x, y).map(|c| c * share));
    frame.lights[1].joint = vec![half(0.25), half(0.75)];
    let emission = Plane::from_fn(size, |x, _| [x as f32 * 0.01; 3]);
    frame.lights.push(Light::new("emission", LightKind::NoiseFree, emission));
    let weight = |in_mirror: f32, beside: f32| {
        Some(Arc::new(Plane::from_fn(size, |x, y| [if mirror(x, y) { in_mirror } else { beside }; 3])))
    };
    for (light, weight) in [(0, weight(0.0, 0.6)), (1, weight(0.0, 0.6)), (3, weight(0.9, 0.1)), (4, weight(0.8, 0.0))]
    {
        frame.lights[light].weight = weight;
    }
    let depth = |x: usize, y: usize| {
        let bump = if across(x) as usize % 13 < 6 { 0.4 } else { 0.0 };
        // Hair, blurred depth: guides as noisy as light.
        let rough = if across(x) as usize % 20 > 14 { 0.2 } else { 0.004 };
        4.0 + 0.12 * y as f32 + 0.02 * across(x) + bump + rough * random(x, y, t, 90)
    };
    frame.depth = Some(Plane::from_fn(size, |x, y| if sky(y) { f32::INFINITY } else { depth(x, y) }));
    let tilt = |x: usize, y: usize, k: u64| 0.3 * random(x / 5, y / 5, 0, k) + 0.06 * random(x, y, t, k + 1);
    let normal = |x: usize, y: usize| if sky(y) { [0.0; 3] } else { [tilt(x, y, 91), tilt(x, y, 93), 1.0] };
    frame.normal = Some(Plane::from_fn(size, normal));
    let tile =
        |x: usize, y: usize, k: u64| [0, 1, 2].map(|c| 0.2 + 0.6 * random(across(x) as usize / 4, y / 3, 0, k + c));
    frame.albedo = Some(Plane::from_fn(size, |x, y| tile(x, y, 100)));
    frame.seen_albedo = Some(Plane::from_fn(size, |x, y| tile(x, y, 110)));
    frame.seen_normal = Some(Plane::from_fn(size, |x, y| tile(x, y, 120)));
    frame.motion_to_previous = Some(Plane::filled(size, [1.0, 0.0]));
    frame.motion_to_next = Some(Plane::filled(size, [-1.0, 0.0]));
    frame
}

/// What the frame has besides light may be missing.
pub fn without(mut frame: SequenceFrame, what: usize) -> SequenceFrame {
    match what {
        0 => frame.seen_normal = None,
        1 => frame.seen_albedo = None,
        2 => frame.albedo = None,
        3 => frame.normal = None,
        4 => frame.depth = None,
        _ => (frame.depth, frame.normal, frame.albedo, frame.seen_albedo, frame.seen_normal) = Default::default(),
    }
    frame
}

/// The wavelet alone: neighbours in time take no part.
fn alone() -> SequenceSettings {
    let mut settings = SequenceSettings::default();
    settings.set("gather.frames", "0").unwrap();
    settings.set("stabilise.frames", "0").unwrap();
    settings
}

/// What a back end of this processor filters.
fn run_on(
    backend: Backend,
    settings: &SequenceSettings,
    frames: impl IntoIterator<Item = SequenceFrame>,
) -> Vec<Filtered> {
    filtered(SequenceDenoiser::with_backend(settings.clone(), backend).unwrap(), frames)
}

fn run(
    settings: &SequenceSettings,
    frames: impl IntoIterator<Item = SequenceFrame>,
    host: Option<&Arc<OnDevice>>,
) -> Vec<Filtered> {
    let denoiser = match host {
        None => SequenceDenoiser::new(settings.clone()).unwrap(),
        Some(host) => SequenceDenoiser::with_accelerator(settings.clone(), host.clone()).unwrap(),
    };
    filtered(denoiser, frames)
}

fn filtered(mut denoiser: SequenceDenoiser, frames: impl IntoIterator<Item = SequenceFrame>) -> Vec<Filtered> {
    let mut out = Vec::new();
    for frame in frames {
        out.extend(denoiser.push(frame, true).unwrap());
    }
    out.extend(denoiser.finish().unwrap());
    out
}

/// The largest difference of any value of any plane, relative to it plus the plane's mean.
pub fn difference(a: &[Filtered], b: &[Filtered]) -> f64 {
    assert_eq!(a.len(), b.len());
    let mut most = 0.0f64;
    for (a, b) in a.iter().zip(b) {
        assert_eq!((a.number, a.lights.len(), &a.alpha), (b.number, b.lights.len(), &b.alpha));
        for (a, b) in a.lights.iter().zip(&b.lights) {
            assert_eq!((a.planes.len(), &a.weight), (b.planes.len(), &b.weight));
            for (a, b) in a.planes.iter().zip(&b.planes) {
                let values = || a.data().iter().flatten().zip(b.data().iter().flatten());
                let mean = values().map(|(a, _)| f64::from(a.abs())).sum::<f64>() / values().count() as f64;
                for (a, b) in values().filter(|(a, b)| a != b) {
                    let d = f64::from((a - b).abs()) / (f64::from(a.abs().max(b.abs())) + mean);
                    most = most.max(if d.is_nan() { f64::INFINITY } else { d });
                }
            }
        }
    }
    most
}

#[test]
fn one_frame_agrees_at_every_size_and_with_any_guide_missing() {
    let Some(gpu) = gpu() else { return };
    let host = Arc::new(OnDevice::new(gpu));
    let mut frames: Vec<(String, SequenceFrame)> = [(1, 1), (1, 7), (13, 1), (31, 17), (70, 41)]
        .map(|(w, h)| (format!("{w}x{h}"), frame(Size::new(w, h), 3)))
        .into();
    let size = Size::new(31, 17);
    frames.extend((0..6).map(|what| (format!("without {what}"), without(frame(size, 3), what))));
    for light in 0..8 {
        let mut one = frame(size, 3);
        one.lights = vec![one.lights.swap_remove(light)];
        frames.push((format!("light {light} alone"), one));
    }
    for (name, frame) in frames {
        let found = run(&alone(), [frame.clone()], Some(&host));
        for backend in [Backend::Reference, Backend::Cpu] {
            let d = difference(&run_on(backend, &alone(), [frame.clone()]), &found);
            println!("{name}, {backend:?}: {d:.1e}");
            assert!(d <= WAVELET, "{name}, {backend:?}: {d:.1e}");
        }
    }
}

#[test]
fn thirty_frames_agree_and_passes_still_add_up() {
    let Some(gpu) = gpu() else { return };
    let host = Arc::new(OnDevice::new(gpu));
    let frames = || (0..30).map(|t| frame(Size::new(40, 24), t));
    let settings = SequenceSettings::default();
    let (cpu, found) = (run(&settings, frames(), None), run(&settings, frames(), Some(&host)));
    let d = difference(&cpu, &found);
    println!("30 frames: {d:.1e}");
    assert!(d <= SEQUENCE, "{d:.1e}");
    // They are not the same bits: this compared two programs.
    assert!(d > 0.0);
    let mut unsteady = settings.clone();
    unsteady.set("stabilise.frames", "0").unwrap();
    let d = difference(&run(&unsteady, frames(), None), &run(&unsteady, frames(), Some(&host)));
    println!("without stabilise: {d:.1e}");
    assert!(d <= WAVELET, "{d:.1e}");
    for frame in &found {
        let planes = &frame.lights[1].planes;
        for (i, whole) in planes[0].data().iter().enumerate() {
            for (c, whole) in whole.iter().enumerate() {
                let parts = planes[1].data()[i][c] + planes[2].data()[i][c];
                assert!((whole - parts).abs() <= 5e-4 * whole.abs() + 1e-5, "{whole} {parts}");
            }
        }
    }
    // Another setting is another picture, by more than the bound.
    let mut other = settings;
    other.set("wavelet.matte", "3.9").unwrap();
    let other = run(&other, frames().take(4 + 10), Some(&host));
    assert!(difference(&cpu[..4], &other[..4]) > SEQUENCE);
}

#[test]
fn bands_of_rows_give_the_bits_of_the_whole() {
    let Some(gpu) = gpu() else { return };
    let size = Size::new(9, 150);
    let whole = Arc::new(OnDevice::new(gpu));
    let banded = Arc::new(OnDevice { most_pixels: 9 * 79, ..OnDevice::new(gpu) });
    assert_eq!(WaveletJob::margin(5), 36);
    assert_eq!(SequenceWavelet::bands_of(9 * 79, size, 5).unwrap().len(), 22);
    let whole = run(&alone(), [frame(size, 0)], Some(&whole));
    assert_eq!(difference(&whole, &run(&alone(), [frame(size, 0)], Some(&banded))), 0.0);
}

#[test]
fn bands_cover_the_picture_once() {
    for (most, height, levels) in [(20u64, 40, 1), (7, 100, 1), (31, 31, 2), (30, 1000, 2)] {
        let bands = SequenceWavelet::bands_of(most * 3, Size::new(3, height), levels).unwrap();
        let margin = WaveletJob::margin(levels);
        let mut next = 0;
        for (core, rows) in bands {
            assert_eq!(core.start, next);
            next = core.end;
            assert!(rows.len() <= most as usize, "{rows:?}");
            assert_eq!(rows, core.start.saturating_sub(margin)..(core.end + margin).min(height));
        }
        assert_eq!(next, height);
    }
    let error = SequenceWavelet::bands_of(3 * 72, Size::new(3, 1000), 5).unwrap_err();
    assert!(matches!(error, Error::Size { .. }), "{error}");
}

/// Changes planted in the shader, each of which must be seen.
pub const PLANTED: &[(&str, &str)] = &[
    ("stops.reach.y * length", "1.1 * stops.reach.y * length"),
    ("(stops.reach.x +", "(1.1 * stops.reach.x +"),
    ("stops.slope_error * abs", "1.25 * stops.slope_error * abs"),
    ("const APART: f32 = 1000000000.0", "const APART: f32 = 1.0"),
    ("1.0 - distance * (1.0 / FARTHEST)", "1.0 - distance * (1.0 / 17.0)"),
    ("if stops.guided == 0u", "if stops.guided == 7u"),
    ("dot(p.geometry.xy, offset)", "dot(p.geometry.yx, offset)"),
    ("stops.noise * p.geometry.w", "p.geometry.w * 0.9"),
    ("1.0 - dot(p.normal.xyz, q.normal.xyz), has_normal", "0.0, has_normal"),
    ("stops.normal * p.normal.w", "p.normal.w"),
    ("stops.colour * dot(d, d)", "0.9 * stops.colour * dot(d, d)"),
    ("stops.seen_normal * (1.0", "stops.seen_normal * (0.9"),
    ("settings.least_contrast *", "30.0 * settings.least_contrast *"),
    ("vec3f(0.2126, 0.7152, 0.0722)", "vec3f(0.2126, 0.0722, 0.7152)"),
    ("let g = TENT[abs(dx)] *", "let g ="),
    ("var w = TENT[abs(dx)] *", "var w ="),
    ("TENT: vec2f = vec2f(2.0, 1.0)", "TENT: vec2f = vec2f(2.0, 1.1)"),
    ("spread += g * g * colour.w", "spread += g * colour.w"),
    ("spread /= total * total", "spread /= total"),
    ("settings.mirror_tolerance, here.colour.w > 0.0", "settings.mirror_tolerance, here.colour.w > 2.0"),
    ("vec2i(dx, dy) * settings.step", "vec2i(dx, dy)"),
    ("(mean.y + min(there.y, settings.variance_ratio * mean.y))", "mean.y"),
    ("settings.correlation *", "1.05 * settings.correlation *"),
    ("settings.variance_ratio *", "0.2 * settings.variance_ratio *"),
    ("settings.mean_step *", "0.5 * settings.mean_step *"),
    ("settings.low_noise *", "0.5 * settings.low_noise *"),
    ("min(settings.low_tolerance, squared)", "min(4.0 * settings.low_tolerance, squared)"),
    ("if settings.step == 1", "if settings.step >= 1"),
    ("mean.z * v + contrast", "mean.z * v * 1.01 + contrast"),
    ("scale * scale * sum.w", "scale * sum.w"),
    ("dy <= 1", "dy < 1"),
    ("dx <= 1", "dx < 1"),
    ("features.normal = normals[i];", "features.normal = geometry[i];"),
    ("u32(pixel.y) * settings.size.x + u32(pixel.x)", "u32(pixel.y) * settings.size.x + u32(pixel.y)"),
    ("compared[index_of(pixel)] = compared_mean(pixel)", "compared[index_of(pixel)] = 0.9 * compared_mean(pixel)"),
    ("filtered[index_of(pixel)] = filtered_level(pixel)", "filtered[index_of(pixel)] = light_at(index_of(pixel))"),
];

#[test]
fn planted_differences_are_found() {
    let Some(gpu) = gpu() else { return };
    let size = Size::new(31, 17);
    let wanted = run_on(Backend::Reference, &alone(), [frame(size, 3)]);
    let whole = SequenceWavelet::new(&gpu.device);
    for (from, to) in PLANTED {
        let passes = [Pass::WAVELET_COMPARE, Pass::WAVELET].map(|pass| (pass, pass.source(Storage::Float, false)));
        assert!(passes.iter().any(|(_, source)| source.contains(from)), "the shaders have no `{from}` any more");
        let wavelet = passes.iter().fold(whole.clone(), |wavelet, (pass, source)| {
            wavelet.with_source(&gpu.device, *pass, &source.replace(from, to))
        });
        let found = run(&alone(), [frame(size, 3)], Some(&Arc::new(OnDevice { wavelet, ..OnDevice::new(gpu) })));
        let d = difference(&wanted, &found);
        println!("{to}: {d:.1e}");
        assert!(d > WAVELET, "`{to}` for `{from}` is not seen: {d:.1e}");
    }
}

#[test]
fn what_cannot_run_is_an_error() {
    let Some(gpu) = gpu() else { return };
    let size = Size::new(12, 5);
    let host = Arc::new(OnDevice { fails: true, ..OnDevice::new(gpu) });
    let mut denoiser = SequenceDenoiser::with_accelerator(SequenceSettings::default(), host).unwrap();
    assert!(denoiser.push(frame(size, 0), true).unwrap().is_empty());
    assert_eq!(denoiser.finish().unwrap_err().to_string(), "test: planted");
    // What was inside is given up; nothing is filtered on the CPU in secret.
    assert!(denoiser.finish().unwrap().is_empty());
    let mut bright = frame(size, 0);
    bright.lights[0].light.data_mut()[7] = [1e17, 0.0, 0.0];
    let host = Arc::new(OnDevice::new(gpu));
    let mut denoiser = SequenceDenoiser::with_accelerator(SequenceSettings::default(), host).unwrap();
    assert!(denoiser.push(bright, true).unwrap().is_empty());
    let error = denoiser.finish().unwrap_err().to_string();
    assert!(error.contains("frame 0") && error.contains("--backend cpu"), "{error}");
}

#[test]
fn buffers_that_do_not_fit_are_named() {
    let Some(gpu) = gpu() else { return };
    let mut job = Recorder::default();
    let mut denoiser = SequenceDenoiser::with_accelerator(alone(), Arc::new(job.clone())).unwrap();
    denoiser.push(frame(Size::new(8, 8), 0), true).unwrap();
    let light = job.light();
    let wavelet = SequenceWavelet::new(&gpu.device);
    let storage = |bytes: usize| gpu.buffer("x", &vec![0; bytes], BufferUsages::STORAGE);
    let (large, small) = (storage(16 * 64), storage(16 * 63));
    let other = gpu.buffer("x", &[0; 16 * 64], BufferUsages::COPY_SRC);
    let try_with = |geometry, compared, planes: &[[&_; 2]], size| {
        let all = &large;
        let buffers =
            WaveletBuffers { geometry, normals: all, guide_colours: all, seen_normals: all, compared, planes };
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
        wavelet.encode(&gpu.device, &mut encoder, &light, &buffers, size).unwrap_err().to_string()
    };
    let (size, planes) = (Size::new(8, 8), [[&large, &large]]);
    for (error, wanted) in [
        (try_with(&small, &large, &planes, size), "geometry"),
        (try_with(&large, &other, &planes, size), "compared"),
        (try_with(&large, &large, &[[&large, &small]], size), "filtered"),
        (try_with(&large, &large, &[], size), "takes 1 resources"),
        (try_with(&large, &large, &planes, Size::new(0, 8)), "limits"),
        (try_with(&large, &large, &planes, Size::new(1 << 13, 1 << 13)), "max_storage_buffer_binding_size"),
    ] {
        assert!(error.contains(wanted), "{error}");
    }
}

/// Remembers what it was asked for, and leaves light as it is.
#[derive(Clone, Debug, Default)]
struct Recorder {
    asked: Arc<std::sync::Mutex<Vec<quell::sequence::WaveletLight>>>,
}

impl Recorder {
    fn light(&mut self) -> quell::sequence::WaveletLight {
        self.asked.lock().unwrap()[0]
    }
}

impl Accelerator for Recorder {
    fn name(&self) -> String {
        "recorder".to_owned()
    }

    fn wavelet(&self, job: &mut WaveletJob<'_>) -> Result<(), String> {
        let lights = job.lights();
        let light = lights[0];
        assert!(job.store(light.light, 0, 0..1, &[0; 3]).is_err());
        assert!(job.store(light.light, 99, 0..1, &[0; 8 * 16]).is_err());
        assert!(job.store(99, 0, 0..1, &[0; 8 * 16]).is_err());
        assert!(job.store(light.light, 0, 8..9, &[0; 8 * 16]).is_err());
        assert!(job.colours(99, 0, 0..1).is_empty());
        assert_eq!(job.guide(Guide::Normal, 7..99).len(), 8 * 16);
        self.asked.lock().unwrap().extend(lights);
        Ok(())
    }
}
