//! Stages `stabilise` to `blend` of the sequence filter on the GPU, against the reference and the CPU: frame by frame on the same
//! pictures, over whole sequences, and in bands of rows.

use super::device::{Gpu, gpu, gpu_with_timestamps};
use super::wavelet::{random, without};
use super::window::{Seen, scene, settings};
use quell::gpu::wgpu::CommandEncoderDescriptor;
use quell::gpu::{Pass, SequenceKernels, SequenceWindow, Storage};
use quell::sequence::{
    AcceleratedWindow, Accelerator, EstimateJob, FinishJob, FinishedOnCpu, SequenceDenoiser, SequenceFrame,
    SequenceSettings, WaveletJob,
};
use quell::{Backend, Plane, Size};
use std::sync::{Arc, Mutex};

/// Largest difference, relative to the value plus the mean of its plane. Signatures are halves: a last bit of what they are made of
/// turns one to the next half, and weights fall fast with their distance. (The worst of all cases differs by 2e-6.)
const BOUND: f64 = 1e-4;
/// The same where a GPU contracts products and sums.
const OF_HARDWARE: f64 = 2e-3;

/// Of the stabilised picture, of shares with the expected error, and of gains with the coverage.
type Parts = [Seen; 3];

/// A host that estimates on the CPU and finishes on the device.
#[derive(Clone, Debug)]
struct Host {
    gpu: &'static Gpu,
    kernels: Arc<SequenceKernels>,
    compares: &'static [Backend],
    seen: Arc<Mutex<Parts>>,
    finished: Arc<Mutex<Vec<i64>>>,
    /// Of each frame that was finished.
    made: Arc<Mutex<Vec<[Vec<f32>; 3]>>>,
}

impl Host {
    fn new(gpu: &'static Gpu) -> Self {
        let kernels = Arc::new(SequenceKernels::new(&gpu.device));
        Self { gpu, kernels, compares: &[], seen: Arc::default(), finished: Arc::default(), made: Arc::default() }
    }
}

impl Accelerator for Host {
    fn name(&self) -> String {
        "test".to_owned()
    }

    fn wavelet(&self, _: &mut WaveletJob<'_>) -> Result<(), String> {
        Err("the frame was to be estimated on the CPU".to_owned())
    }

    fn window(&self) -> Option<Box<dyn AcceleratedWindow>> {
        let window = SequenceWindow::new(&self.gpu.device, Arc::clone(&self.kernels));
        Some(Box::new(Window { window, host: self.clone() }))
    }
}

#[derive(Debug)]
struct Window {
    host: Host,
    window: SequenceWindow,
}

fn three(values: &[f32]) -> Vec<f32> {
    values.chunks_exact(4).flat_map(|v| [v[0], v[1], v[2]]).collect()
}

fn fourth(values: &[f32]) -> Vec<f32> {
    values.chunks_exact(4).map(|v| v[3]).collect()
}

impl AcceleratedWindow for Window {
    /// On the CPU: both sides see the same pictures, to the bit.
    fn estimate(&mut self, job: &mut EstimateJob<'_>) -> Result<bool, String> {
        job.estimate_on_cpu();
        Ok(true)
    }

    fn finish(&mut self, job: &mut FinishJob<'_>) -> Result<bool, String> {
        let gpu = self.host.gpu;
        self.window.reserve_finish(&gpu.device, job).map_err(|e| e.to_string())?;
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let made = self.window.encode_finish(&gpu.device, &mut encoder, job).map_err(|e| e.to_string())?;
        self.host.kernels.resolve_timings(&gpu.device, &mut encoder);
        gpu.queue.submit([encoder.finish()]);
        let pixels = 4 * job.size().pixels();
        let read = gpu.read_buffers(&[made.steady, made.shares, made.gain]);
        let [steady, shares, gain] = [0, 1, 2].map(|k| &read[k][..pixels]);
        let mut seen = self.host.seen.lock().unwrap();
        let bound = if gpu.is_software { BOUND } else { OF_HARDWARE };
        for backend in self.host.compares {
            let FinishedOnCpu { steady: wanted, blend } = job.on_backend(*backend);
            seen[0].compare(wanted.data().as_flattened(), &three(steady), bound);
            seen[1].compare(blend.shares.data().as_flattened(), &three(shares), bound);
            seen[1].compare(blend.noise.data(), &fourth(shares), bound);
            let gains = blend.gain.unwrap_or_else(|| Plane::filled(job.size(), [1.0; 3]));
            seen[2].compare(gains.data().as_flattened(), &three(gain), bound);
            if let Some(alpha) = blend.alpha {
                seen[2].compare(alpha.data(), &fourth(gain), bound);
            }
        }
        let bytes = |numbers: &[f32]| numbers.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        job.store(&bytes(steady), &bytes(shares), &bytes(gain))?;
        self.host.made.lock().unwrap().push([steady, shares, gain].map(<[f32]>::to_vec));
        self.host.finished.lock().unwrap().push(job.frame(job.centre()).number);
        Ok(true)
    }
}

fn run(host: &Host, settings: &SequenceSettings, frames: impl IntoIterator<Item = SequenceFrame>) {
    let mut denoiser = SequenceDenoiser::with_accelerator(settings.clone(), Arc::new(host.clone())).unwrap();
    for frame in frames {
        denoiser.push(frame, true).unwrap();
    }
    denoiser.finish().unwrap();
}

/// With a coverage that varies.
fn with_alpha(mut frame: SequenceFrame) -> SequenceFrame {
    let t = frame.number;
    frame.alpha = Some(Plane::from_fn(frame.size, |x, y| if x % 7 < 4 { 1.0 } else { random(x, y, t, 60) }));
    frame
}

#[test]
fn the_stages_after_the_filtered_light_agree_whatever_a_frame_has() {
    let Some(gpu) = gpu() else { return };
    let host = Host::new(gpu);
    let size = Size::new(29, 17);
    let mut cases: Vec<(String, SequenceSettings, Vec<SequenceFrame>)> = Vec::new();
    let mut case = |name: &str, settings, frames| cases.push((name.to_owned(), settings, frames));
    let frames = |n: i64| (0..n).map(move |t| scene(size, t));
    case("all", settings(&[]), frames(4).collect());
    case("with coverage", settings(&[]), frames(3).map(with_alpha).collect());
    case("past alone", settings(&[("gather.future", "off")]), frames(4).collect());
    case("one neighbour", settings(&[("stabilise.frames", "1")]), frames(4).collect());
    case("more than are gathered", settings(&[("gather.frames", "1"), ("stabilise.frames", "4")]), frames(7).collect());
    case("little travel", settings(&[("gather.travel", "0.05")]), frames(4).collect());
    case("not corrected", settings(&[("residual.picture", "off")]), frames(3).collect());
    case("no kernel", settings(&[("blend.kernel", "0")]), frames(3).collect());
    for (w, h) in [(1, 1), (1, 9), (11, 1), (8, 8)] {
        case(&format!("{w}x{h}"), settings(&[]), (0..3).map(|t| scene(Size::new(w, h), t)).collect());
    }
    for what in 0..6 {
        case(&format!("without {what}"), settings(&[]), frames(3).map(|f| without(f, what)).collect());
    }
    let changed = |change: fn(&mut SequenceFrame)| {
        let mut frames: Vec<SequenceFrame> = frames(3).collect();
        frames.iter_mut().for_each(change);
        frames
    };
    case("without motion", settings(&[]), changed(|f| (f.motion_to_next, f.motion_to_previous) = (None, None)));
    case("motion of the camera", settings(&[]), changed(|f| f.camera_motion = true));
    let mut off = Vec::new();
    for (at, (name, settings, frames)) in cases.into_iter().enumerate() {
        // The reference, in double precision, takes the most of the time.
        let compares: &[Backend] = if at < 2 { &[Backend::Reference, Backend::Cpu] } else { &[Backend::Cpu] };
        let host = Host { compares, seen: Arc::default(), ..host.clone() };
        let count = frames.len() as i64;
        host.finished.lock().unwrap().clear();
        run(&host, &settings, frames);
        assert_eq!(*host.finished.lock().unwrap(), (0..count).collect::<Vec<_>>(), "{name}");
        let seen = *host.seen.lock().unwrap();
        println!(
            "{name}: {:?}, beyond {:?} of {:?}",
            seen.map(|s| format!("{:.1e}", s.most)),
            seen.map(|s| s.beyond),
            seen.map(|s| s.of)
        );
        if !seen.iter().all(Seen::agrees) {
            off.push(format!("{name}: {seen:?}"));
        }
    }
    assert!(off.is_empty(), "{off:#?}");
}

/// Changes planted in the shaders, each of which must be seen.
pub const PLANTED: &[(Pass, &str, &str)] = &[
    (Pass::SIGNATURE, "sign(v) * sqrt(abs(v))", "v"),
    (Pass::SIGNATURE, "0.0625 * f32(", "0.06 * f32("),
    (Pass::SIGNATURE, "albedo / inside", "albedo / 9.0"),
    (Pass::SIGNATURE, "if has(here, HAS_SEEN_NORMAL)", "if false"),
    (Pass::SIGNATURE, "return v[4]", "return v[3]"),
    (Pass::FOLLOW, "0.5 * dot(d, d)", "dot(d, d)"),
    (Pass::FOLLOW, "(input_of(there, q) - shown) * ratio", "(input_of(there, q) - shown)"),
    (Pass::FOLLOW, "<= DEPTH_STEP * max(a, b)", "<= 0.01 * DEPTH_STEP * max(a, b)"),
    (Pass::FOLLOW, "const LEAST_COSINE: f32 = 0.8", "const LEAST_COSINE: f32 = 0.999"),
    (Pass::FOLLOW, "most = max(most, brightest(there, q, true))", ""),
    (Pass::FOLLOW, "min(own / limit - 1.0, 1.0)", "1.0"),
    (Pass::FOLLOW, "own > other * settings.nearer", "false"),
    (Pass::FOLLOW, "is_mirror(here, pixel)", "false"),
    (Pass::BRIGHTNESS, "dy <= NOISE_NEAR", "dy < NOISE_NEAR"),
    (Pass::BRIGHTNESS, "0.5 * (picture +", "0.4 * (picture +"),
    (Pass::STABILISE, "max(b, vec4f(0.0))", "b"),
    (Pass::STABILISE, "share / (1.0 + share)", "share"),
    (Pass::STABILISE, "other > settings.nearer * nearest", "other < settings.nearer * nearest"),
    (Pass::STABILISE, "<= settings.departure", "< 0.0"),
    (Pass::STABILISE, "> settings.depth_change * depth", "> 0.01 * settings.depth_change * depth"),
    (Pass::STABILISE, "miss > may_miss +", "miss > 0.2 * may_miss +"),
    (Pass::STABILISE, "settings.round_trip + noisy * noisy", "settings.round_trip"),
    (Pass::STABILISE, "own.wide = judge / pixels;", ""),
    (Pass::STABILISE, "low - other.brightness", "-1.0"),
    (Pass::STABILISE, "let offset = vec2f(place) - visit.at", "let offset = vec2f(place - middle)"),
    (Pass::STABILISE, "dot(offset, offset) + away", "dot(offset, offset)"),
    (Pass::STABILISE, "max(believed, LEAST_OWN)", "1.0"),
    (Pass::STABILISE, "squared(high.wavelet) / HIGH_PASS", "squared(high.wavelet)"),
    (Pass::RESIDUAL_CELLS, "sums.squared += residual * residual", "sums.squared += residual"),
    (Pass::RESIDUAL_CHANGES, "if settings.begins == 0u", "if false"),
    (Pass::RESIDUAL_CHANGES, "around / whole", "around"),
    (Pass::RESIDUAL_CERTAINTY, "(side - f32(d)) / (side * side)", "1.0 / (side * side)"),
    (Pass::RESIDUAL_CERTAINTY, "(light * light * shown)", "(light * light)"),
    (Pass::RESIDUAL_CERTAINTY, "vec4f(ratio, 1.0 / variance)", "vec4f(ratio, 2.0 / variance)"),
    (Pass::RESIDUAL_AROUND, "RESIDUAL_MOST_SURE)", "4.0)"),
    (Pass::RESIDUAL_AROUND, "expected / (expected + 1.0)", "0.0"),
    (Pass::RESIDUAL_AROUND, "settings.around * whole", "whole"),
    (Pass::RESIDUAL_APPLY, "mix(above, below, y.z)", "above"),
    (Pass::RESIDUAL_APPLY, "if twice <= cell {", "if twice <= 0 {"),
    (Pass::BLEND_READ, "dy <= NOISE_NEAR", "dy < NOISE_NEAR"),
    (Pass::BLEND_READ, "min(max(min(noise_of(p, 0u), p.along.y)", "min(max(noise_of(p, 0u)"),
    (Pass::BLEND_READ, "p.along = vec2f(least_of(input_along[0])", "p.along = vec2f(input_along[0].x"),
    (Pass::BLEND_READ, "v / (1.0 + abs(v))", "v"),
    (Pass::BLEND_READ, "ratio(p.apart_wide.y, of_noise)", "ratio(p.apart_near.y, of_noise)"),
    (Pass::BLEND_READ, "add_three(31u, guide_normal(here, pixel));", ""),
    (Pass::BLEND_NET_FULL, "CONV_LEAK * v", "v"),
    (Pass::BLEND_NET_FULL, "pixel - vec2i(0, settings.above)", "pixel - vec2i(1, settings.above)"),
    (Pass::BLEND_NET_HALF, "0.25 * (a + b + c + d)", "a"),
    (Pass::BLEND_NET_QUARTER, "q + vec2i(1, 1)", "q"),
    (Pass::BLEND_NET_DEEP, "dy <= 1", "dy <= 0"),
    (Pass::BLEND_NET_UP, "pixel / 2, group - WHOLE", "pixel / 2, group - 7u"),
    (Pass::BLEND_OUTPUTS, "* LOG2_E", ""),
    (Pass::BLEND_OUTPUTS, "sqrt(z * z + 4.0)", "sqrt(z * z + 3.0)"),
    (Pass::BLEND_OUTPUTS, "kernel[4], kernel[5]", "kernel[5], kernel[4]"),
    (Pass::BLEND_MIX, "settings.guard_low + ", "0.1 * settings.guard_low + "),
    (Pass::BLEND_MIX, "settings.visible)", "0.0)"),
    (Pass::BLEND_MIX, "* judgement.w", "* 0.0"),
    (Pass::BLEND_CHANGE, "k % 3 - 1", "1 - k % 3"),
    (Pass::BLEND_CHANGE, "if bright > most {", "if false {"),
    (Pass::BLEND_GAIN, "let strong = noise /", "let strong = 0.9 * noise /"),
    // Of what they share, and of the passes themselves.
    (Pass::STABILISE, "let t = held - whole;", "let t = 0.0;"),
    (Pass::STABILISE, "return brightness[index_of(q)]", "return brightness[0]"),
    (Pass::STABILISE, "p.seen = vec2f(noise[0].y, noise[1].y);", "p.seen = vec2f(0.0);"),
    (Pass::FOLLOW, "textureLoad(inputs, pixel, there.picture, 0).xyz", "textureLoad(inputs, pixel, 0, 0).xyz"),
    (Pass::FOLLOW, "v - whole >= vec2f(0.5)", "v - whole >= vec2f(0.1)"),
    (Pass::FOLLOW, "vec4f(found.mean, found.change)", "vec4f(found.mean, 0.0)"),
    (Pass::SIGNATURE, "(there.has & what) != 0u", "false"),
    (Pass::SIGNATURE, "here.picture, found[1]", "here.picture, found[0]"),
    (Pass::BRIGHTNESS, "colour.x + colour.y + colour.z", "colour.x + colour.y"),
    (Pass::RESIDUAL_CELLS, "if settings.black != 0u", "if settings.black == 0u"),
    (Pass::RESIDUAL_APPLY, "corrected(pixel, before.xyz, before.xyz)", "before.xyz"),
    (Pass::BLEND_NET_FULL, "pixel, o, values[o]", "pixel, o, values[0]"),
    (Pass::BLEND_MIX, "clamp(v / bright,", "clamp(0.9 * v / bright,"),
];

/// Of joint planes, which only light has.
pub const PLANTED_IN_JOINT: (Pass, &str, &str) =
    (Pass::RESIDUAL_APPLY_JOINT, "corrected(pixel, filtered[p].xyz, before.xyz)", "0.9 * before.xyz");

/// What is kept of a picture for its neighbours is found once.
#[test]
fn signatures_are_found_once_a_picture() {
    let Some(gpu) = gpu_with_timestamps() else { return };
    let gpu: &'static Gpu = Box::leak(Box::new(gpu));
    let kernels = Arc::new(SequenceKernels::new(&gpu.device).with_timings(&gpu.device));
    let host = Host { kernels: Arc::clone(&kernels), ..Host::new(gpu) };
    let settings = settings(&[("gather.frames", "1"), ("stabilise.frames", "2")]);
    run(&host, &settings, (0..6).map(|t| scene(Size::new(16, 12), t)));
    let mut dispatches = Vec::new();
    while let Some(timings) = kernels.take_timings(&gpu.queue) {
        dispatches.extend(timings.into_iter().map(|timing| timing.pass));
    }
    let count = |pass: Pass| dispatches.iter().filter(|name| **name == pass.name).count();
    assert_eq!([Pass::STABILISE, Pass::SIGNATURE].map(count), [6, 6]);
}

#[test]
fn planted_differences_after_the_filtered_light_are_found() {
    let Some(gpu) = gpu() else { return };
    // The guards bind. Noise is so strong here that by default motion may miss by any distance, and a mirror's never gives way to
    // its surface's.
    let bind =
        [("blend.guard", "2"), ("blend.guard_low", "1"), ("blend.visible", "0.2"), ("stabilise.round_trip_noise", "8")];
    let settings = settings(&[&[("gather.frames", "1"), ("stabilise.frames", "2")], bind.as_slice()].concat());
    let frames = || (0..5).map(|t| bright_points(with_alpha(scene(Size::new(31, 19), t))));
    let whole = Host::new(gpu);
    // What comes out of the middle frame: the device's is compared with the same in every case.
    let parts = |host: &Host| {
        let host = Host { made: Arc::default(), ..host.clone() };
        let mut denoiser = SequenceDenoiser::with_accelerator(settings.clone(), Arc::new(host.clone())).unwrap();
        for frame in frames() {
            let is_middle = frame.number == 2;
            denoiser.push(frame, is_middle).unwrap();
        }
        denoiser.finish().unwrap();
        host.made.lock().unwrap().pop().unwrap()
    };
    let wanted = parts(&whole);
    assert_eq!(parts(&whole), wanted);
    let mut unseen = Vec::new();
    for &(pass, from, to) in PLANTED {
        let source = pass.source(Storage::Float, false);
        assert!(source.contains(from), "{} has no `{from}` any more", pass.name);
        let planted = whole.kernels.with_source(&gpu.device, pass, &source.replace(from, to));
        let found = parts(&Host { kernels: Arc::new(planted), ..whole.clone() });
        let mut seen = Parts::default();
        for ((seen, wanted), found) in seen.iter_mut().zip(&wanted).zip(&found) {
            seen.compare(wanted, found, BOUND);
        }
        println!("{}, {to}: {:?}", pass.name, seen.map(|s| (s.most, s.beyond)));
        if seen.iter().all(Seen::agrees) {
            unseen.push((pass.name, from, to));
        }
    }
    assert!(unseen.is_empty(), "{unseen:#?}");
}

/// With single pixels of rare bright paths, and lamps that only some frames have.
fn bright_points(mut frame: SequenceFrame) -> SequenceFrame {
    let (size, t) = (frame.size, frame.number);
    let lamp = t != 1;
    for light in &mut frame.lights {
        let before = light.light.clone();
        light.light = Plane::from_fn(size, |x, y| {
            let more = if random(x, y, t, 61) < 0.03 { 40.0 } else { 1.0 };
            let lit = if lamp && x > 20 && y < 9 { 3.0 } else { 1.0 };
            before.at(x, y).map(|v| v * more * lit)
        });
    }
    frame
}
