//! Stages 1 and 2 of the sequence filter on the GPU, with the frames of the window kept there, against the reference and the
//! CPU: stage by stage on the same frames, over whole sequences, and in bands of rows.

use super::device::{Gpu, gpu};
use super::finish::PLANTED_IN_JOINT;
use super::wavelet::{difference, frame, random, without};
use quell::gpu::wgpu::{Buffer, CommandEncoderDescriptor};
use quell::gpu::{Pass, SequenceKernels, SequenceStage, SequenceWindow, Storage};
use quell::sequence::{
    AcceleratedWindow, Accelerator, EstimateJob, Filtered, FinishJob, Guide, OnCpu, PreparedFrame, SEQUENCE_PARAMETERS,
    SequenceDenoiser, SequenceFrame, SequenceSettings, WaveletJob,
};
use quell::{Backend, Plane, Size};
use std::collections::HashMap;
use std::io::Cursor;
use std::sync::{Arc, Mutex};

/// A stage, and the largest differences from the CPU and from the reference, relative to the value plus the mean of its plane.
type Bound = (&'static str, [f64; 2]);
const BOUNDS: [Bound; 3] = [
    // A few sums and one quotient.
    ("features", [1e-5, 1e-5]),
    // Sums of up to 65 terms, in the CPU's order, by the reference in f64; the spread is a difference of numbers of like size,
    // and has lost what they lost.
    ("gather", [5e-5, 5e-5]),
    // Sums of 25 terms, weighted by 16th powers of quotients. The reference pools means of its own: where samples are few
    // their spread over the window, a difference of sums, multiplies what the means differ by.
    ("variance", [1e-4, 1e-3]),
];
/// Of the variance from the CPU, where a GPU contracts products and sums (H100: up to 7.1e-4 with windows of 3x3 pixels): a
/// difference of sums has lost what either has lost.
const VARIANCE_OF_HARDWARE: f64 = 1e-3;
/// Of whole sequences.
const SEQUENCE: f64 = 1e-4;
/// Share of values that may lie beyond: whether a pixel shows the same surface is decided at thresholds, and a last bit
/// can turn it. Lavapipe turns none.
const DECIDED: f64 = 2e-3;
/// The largest difference of a sequence where `stabilise` compares signatures: they wait in half precision, and a last bit of
/// the light can turn one to the next half, 1e-3 of the light it stands for.
const SIGNATURES: f64 = 1e-3;

/// Differences of one stage: the largest, and the share beyond a bound.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    pub most: f64,
    pub beyond: usize,
    pub of: usize,
}

impl Seen {
    pub fn compare(&mut self, cpu: &[f32], gpu: &[f32], bound: f64) {
        assert_eq!(cpu.len(), gpu.len());
        let mean = cpu.iter().map(|v| f64::from(v.abs())).sum::<f64>() / cpu.len().max(1) as f64;
        for (a, b) in cpu.iter().zip(gpu).filter(|(a, b)| a != b) {
            let d = f64::from((a - b).abs()) / (f64::from(a.abs().max(b.abs())) + mean);
            let d = if d.is_nan() { f64::INFINITY } else { d };
            self.most = self.most.max(d);
            self.beyond += usize::from(d > bound);
        }
        self.of += cpu.len();
    }

    pub fn agrees(&self) -> bool {
        self.beyond as f64 <= DECIDED * self.of as f64
    }
}

/// Of guides, stage 1 and stage 2.
type Stages = [Seen; 3];

/// The stages of each frame, by its number, as a back end in software computes them.
type Wanted = HashMap<i64, Arc<(Vec<OnCpu>, Vec<(Guide, Vec<u8>)>)>>;

/// A host as small as can be.
#[derive(Clone, Debug)]
struct Host {
    gpu: &'static Gpu,
    kernels: Arc<SequenceKernels>,
    /// Back ends with which every stage is compared.
    compares: &'static [Backend],
    /// From this frame on `estimate` says that it cannot.
    refuses: i64,
    seen: Arc<Mutex<Stages>>,
    /// Kept where the same frames are compared again and again, with one back end.
    wanted: Option<Arc<Mutex<Wanted>>>,
    estimated: Arc<Mutex<Vec<i64>>>,
}

impl Host {
    fn new(gpu: &'static Gpu) -> Self {
        Self::with(gpu, SequenceKernels::new(&gpu.device))
    }

    fn with(gpu: &'static Gpu, kernels: SequenceKernels) -> Self {
        let (seen, estimated) = (Arc::default(), Arc::default());
        Self { gpu, kernels: Arc::new(kernels), compares: &[], refuses: i64::MAX, seen, wanted: None, estimated }
    }
}

impl Accelerator for Host {
    fn name(&self) -> String {
        "test".to_owned()
    }

    fn wavelet(&self, _: &mut WaveletJob<'_>) -> Result<(), String> {
        Ok(())
    }

    fn window(&self) -> Option<Box<dyn AcceleratedWindow>> {
        Some(Box::new(Window {
            window: SequenceWindow::new(&self.gpu.device, Arc::clone(&self.kernels)),
            host: self.clone(),
        }))
    }
}

#[derive(Debug)]
struct Window {
    host: Host,
    window: SequenceWindow,
}

impl Window {
    /// Every buffer of a stage, as numbers.
    #[expect(clippy::type_complexity, reason = "what a test compares, in order")]
    fn run(
        &mut self,
        job: &EstimateJob<'_>,
        until: SequenceStage,
    ) -> Result<(Vec<(usize, usize, Vec<f32>)>, Vec<f32>, Vec<Vec<f32>>), String> {
        let gpu = self.host.gpu;
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let made = self.window.encode(&gpu.device, &mut encoder, job, until).map_err(|e| e.to_string())?;
        gpu.queue.submit([encoder.finish()]);
        let read = |buffer: &Buffer| gpu.read_buffers(&[buffer]).remove(0);
        let planes = made.planes.iter().map(|(light, plane, buffer)| (*light, *plane, read(buffer))).collect();
        let samples = made.samples.map(read).unwrap_or_default();
        Ok((planes, samples, made.guides.iter().map(|(_, buffer)| read(buffer)).collect()))
    }

    fn compare(&mut self, job: &EstimateJob<'_>) -> Result<(), String> {
        let (gathered, most, features) = self.run(job, SequenceStage::Gather)?;
        let (pooled, ..) = self.run(job, SequenceStage::Variance)?;
        let asked = job.lights();
        let place = |light: usize| asked.iter().position(|l| l.wavelet.light == light).unwrap();
        let mut seen = self.host.seen.lock().unwrap();
        for backend in self.host.compares {
            let mut bound = BOUNDS.map(|(_, bounds)| bounds[usize::from(*backend == Backend::Reference)]);
            if !self.host.gpu.is_software {
                bound[2] = bound[2].max(VARIANCE_OF_HARDWARE);
            }
            let number = job.frame(job.centre()).number;
            let known = self.host.wanted.as_ref().map(|wanted| wanted.lock().unwrap());
            let wanted = match known {
                Some(mut known) => {
                    Arc::clone(known.entry(number).or_insert_with(|| Arc::new(job.on_backend(*backend))))
                }
                None => Arc::new(job.on_backend(*backend)),
            };
            let (lights, guides) = &*wanted;
            for ((_, bytes), found) in guides.iter().zip(&features) {
                let wanted: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
                seen[0].compare(&wanted, found, bound[0]);
            }
            for (light, plane, found) in &gathered {
                let wanted = &lights[place(*light)];
                let colours: Vec<f32> = found.chunks_exact(4).flat_map(|v| [v[0], v[1], v[2]]).collect();
                seen[1].compare(wanted.means[*plane].as_flattened(), &colours, bound[1]);
                if *plane == 0 {
                    let spread: Vec<f32> = found.chunks_exact(4).map(|v| v[3]).collect();
                    seen[1].compare(&wanted.spread, &spread, bound[1]);
                }
            }
            let largest = |i: usize| lights.iter().map(|light| light.count[i]).fold(1.0, f32::max);
            seen[1].compare(&(0..most.len()).map(largest).collect::<Vec<_>>(), &most, bound[1]);
            for (light, _, found) in pooled.iter().filter(|(_, plane, _)| *plane == 0) {
                let variance: Vec<f32> = found.chunks_exact(4).map(|v| v[3]).collect();
                seen[2].compare(&lights[place(*light)].variance, &variance, bound[2]);
            }
        }
        Ok(())
    }
}

impl AcceleratedWindow for Window {
    fn estimate(&mut self, job: &mut EstimateJob<'_>) -> Result<bool, String> {
        let number = job.frame(job.centre()).number;
        if job.unfit().is_some() || number >= self.host.refuses {
            return Ok(false);
        }
        self.window.reserve(&self.host.gpu.device, job).map_err(|e| e.to_string())?;
        if !self.host.compares.is_empty() {
            self.compare(job)?;
            return Ok(false);
        }
        let bytes = |numbers: &[f32]| numbers.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let (planes, samples, _) = self.run(job, SequenceStage::Residual)?;
        for (light, plane, numbers) in planes {
            job.store(light, plane, &bytes(&numbers))?;
        }
        assert_eq!(samples.is_empty(), job.lights().is_empty());
        if !samples.is_empty() {
            job.store_samples(&bytes(&samples))?;
        }
        self.host.estimated.lock().unwrap().push(number);
        Ok(true)
    }

    fn finish(&mut self, job: &mut FinishJob<'_>) -> Result<bool, String> {
        let number = job.frame(job.centre()).number;
        if !self.host.estimated.lock().unwrap().contains(&number) {
            return Ok(false);
        }
        let gpu = self.host.gpu;
        self.window.reserve_finish(&gpu.device, job).map_err(|e| e.to_string())?;
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let made = self.window.encode_finish(&gpu.device, &mut encoder, job).map_err(|e| e.to_string())?;
        gpu.queue.submit([encoder.finish()]);
        let read = gpu.read_buffers(&[made.steady, made.shares, made.gain]);
        let bytes = |numbers: &[f32]| numbers.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        job.store(&bytes(&read[0]), &bytes(&read[1]), &bytes(&read[2]))?;
        Ok(true)
    }
}

/// The wavelet's scene with places in the world, and motion of all kinds: a floor that stands before a sliding camera,
/// things that move by themselves and some of which come from nowhere, noise of the motion, and nothing known of the
/// sky.
pub fn scene(size: Size, t: i64) -> SequenceFrame {
    let mut frame = frame(size, t);
    let (depth, w) = (frame.depth.clone().unwrap(), size.width as f32);
    let position = |x: usize, y: usize| {
        let z = depth.at(x, y);
        if !z.is_finite() {
            return [f32::INFINITY; 3];
        }
        let moves = if (x / 7) % 3 == 2 { 0.4 * t as f32 } else { 0.0 };
        [(x as f32 + 1.3 * t as f32 - w / 2.0) * 0.02 * z + moves, y as f32 * -0.02 * z, z]
    };
    frame.position = Some(Plane::from_fn(size, position));
    // Foliage: normals that do not agree on one plane.
    let normal = frame.normal.clone().unwrap();
    let leaf = |x: usize, y: usize| random(x, y, t, 80) < 0.2 && normal.at(x, y) != [0.0; 3];
    let tilt = |x: usize, y: usize, k: u64| 1.6 * random(x, y, t, k) - 0.8;
    let rough = |x: usize, y: usize| if leaf(x, y) { [tilt(x, y, 81), tilt(x, y, 82), 1.0] } else { normal.at(x, y) };
    frame.normal = Some(Plane::from_fn(size, rough));
    let motion = |sign: f32| {
        move |x: usize, y: usize| {
            if size.height > 4 && y < size.height / 5 && x % 5 < 3 {
                return [f32::NAN; 2];
            }
            let wrong = if random(x, y, t, 70) < 0.05 { 3.0 } else { 0.0 };
            let noise = 0.3 * random(x, y, t, 71);
            [sign * (1.3 + noise + wrong), sign * (0.2 + 0.5 * random(x / 3, y / 3, t, 72))]
        }
    };
    frame.motion_to_previous = Some(Plane::from_fn(size, motion(1.0)));
    frame.motion_to_next = Some(Plane::from_fn(size, motion(-1.0)));
    frame.variance =
        Some(Plane::from_fn(size, |x, y| if x % 3 == 0 { f32::NAN } else { 0.1 * (x % 7) as f32 + y as f32 * 0.01 }));
    frame
}

pub fn settings(changes: &[(&str, &str)]) -> SequenceSettings {
    let mut settings = SequenceSettings::default();
    for (name, value) in changes {
        settings.set(name, value).unwrap();
    }
    settings
}

/// The stages that a device runs, alone.
fn of_device() -> SequenceSettings {
    settings(&[("stabilise.frames", "0"), ("blend.choose", "false")])
}

fn run(
    settings: &SequenceSettings,
    frames: impl IntoIterator<Item = SequenceFrame>,
    host: Option<&Host>,
) -> Vec<Filtered> {
    run_wanted(settings, frames, host, |_| true)
}

/// The frames that are `wanted`, by their numbers; the others only help.
fn run_wanted(
    settings: &SequenceSettings,
    frames: impl IntoIterator<Item = SequenceFrame>,
    host: Option<&Host>,
    wanted: impl Fn(i64) -> bool,
) -> Vec<Filtered> {
    let mut denoiser = match host {
        None => SequenceDenoiser::new(settings.clone()).unwrap(),
        Some(host) => SequenceDenoiser::with_accelerator(settings.clone(), Arc::new(host.clone())).unwrap(),
    };
    let mut out = Vec::new();
    for frame in frames {
        let wanted = wanted(frame.number);
        out.extend(denoiser.push(frame, wanted).unwrap());
    }
    out.extend(denoiser.finish().unwrap());
    out
}

/// Every stage of these frames, compared with these back ends.
fn stages(
    host: &Host,
    compares: &'static [Backend],
    settings: &SequenceSettings,
    frames: impl IntoIterator<Item = SequenceFrame>,
) -> Stages {
    let host = Host { compares, seen: Arc::default(), ..host.clone() };
    run(settings, frames, Some(&host));
    *host.seen.lock().unwrap()
}

#[test]
fn every_stage_agrees_whatever_a_frame_has() {
    let Some(gpu) = gpu() else { return };
    let host = Host::new(gpu);
    let size = Size::new(37, 21);
    let mut cases: Vec<(String, SequenceSettings, Vec<SequenceFrame>)> = Vec::new();
    let mut case = |name: &str, settings, frames| cases.push((name.to_owned(), settings, frames));
    let frames = |n: i64| (0..n).map(move |t| scene(size, t));
    case("all", settings(&[]), frames(5).collect());
    case("past alone", settings(&[("gather.future", "off")]), frames(4).collect());
    case("one neighbour", settings(&[("gather.frames", "1"), ("variance.radius", "1")]), frames(5).collect());
    case("little travel", settings(&[("gather.travel", "0.05"), ("gather.round_trip", "1.5")]), frames(5).collect());
    for (w, h) in [(1, 1), (1, 9), (11, 1), (8, 8)] {
        case(&format!("{w}x{h}"), settings(&[]), (0..3).map(|t| scene(Size::new(w, h), t)).collect());
    }
    for what in 0..6 {
        case(&format!("without {what}"), settings(&[]), frames(3).map(|f| without(f, what)).collect());
    }
    let changed = |change: fn(&mut SequenceFrame)| {
        let mut frames: Vec<SequenceFrame> = frames(4).collect();
        frames.iter_mut().for_each(change);
        frames
    };
    case("without motion to the next", settings(&[]), changed(|f| f.motion_to_next = None));
    case("without motion", settings(&[]), changed(|f| (f.motion_to_next, f.motion_to_previous) = (None, None)));
    case("without places", settings(&[]), changed(|f| f.position = None));
    case("repeats noise", settings(&[]), changed(|f| f.repeats_noise = true));
    // Lights that come and go; what is steady is not where there is fog.
    let black = |f: &mut SequenceFrame| {
        let (light, size) = ((f.number * 3 % 5) as usize, f.size);
        f.lights[light].light = Plane::filled(size, [0.0; 3]);
        f.lights[light].joint.iter_mut().for_each(|plane| *plane = Plane::filled(size, [0.0; 3]));
        if f.number == 2 {
            f.lights[5].light = Plane::filled(size, [0.0; 3]);
        }
    };
    case("lights come and go", settings(&[]), changed(black));
    for light in 0..8 {
        let one = |mut f: SequenceFrame| {
            f.lights = vec![f.lights.swap_remove(light)];
            f
        };
        case(&format!("light {light} alone"), settings(&[]), frames(3).map(one).collect());
    }
    let mut off = Vec::new();
    for (name, settings, frames) in cases {
        let seen = stages(&host, &[Backend::Reference, Backend::Cpu], &settings, frames);
        println!(
            "{name}: {:.1e} {:.1e} {:.1e}, beyond {:?}",
            seen[0].most,
            seen[1].most,
            seen[2].most,
            seen.map(|s| s.beyond)
        );
        if !seen.iter().all(Seen::agrees) {
            off.push(format!("{name}: {seen:?}"));
        }
    }
    assert!(off.is_empty(), "{off:#?}");
}

#[test]
fn thirty_frames_agree() {
    let Some(gpu) = gpu() else { return };
    let host = Host::new(gpu);
    let frames = || (0..30).map(|t| scene(Size::new(40, 24), t));
    let (cpu, found) = (run(&settings(&[]), frames(), None), run(&settings(&[]), frames(), Some(&host)));
    let d = difference(&cpu, &found);
    println!("30 frames: {d:.1e}");
    assert!(d <= SIGNATURES && d > 0.0, "{d:.1e}");
    assert!(share_beyond(&cpu, &found) <= DECIDED);
    assert_eq!(*host.estimated.lock().unwrap(), (0..30).collect::<Vec<_>>());
    // What the device makes, and no more: no value is further off.
    let d = difference(&run(&of_device(), frames(), None), &run(&of_device(), frames(), Some(&host)));
    println!("up to the wavelet: {d:.1e}");
    assert!(d <= SEQUENCE && d > 0.0, "{d:.1e}");
    for (cpu, found) in cpu.iter().zip(&found) {
        let mut seen = Seen::default();
        seen.compare(cpu.samples.data(), found.samples.data(), BOUNDS[1].1[0]);
        seen.compare(cpu.confidence.data(), found.confidence.data(), BOUNDS[1].1[0]);
        assert!(seen.agrees(), "{seen:?}");
        for (i, whole) in found.lights[1].planes[0].data().iter().enumerate() {
            for (c, whole) in whole.iter().enumerate() {
                let parts = found.lights[1].planes[1].data()[i][c] + found.lights[1].planes[2].data()[i][c];
                assert!((whole - parts).abs() <= 5e-4 * whole.abs() + 1e-5, "{whole} {parts}");
            }
        }
    }
    // Other settings are other pictures, by more than the bound.
    for change in [("gather.matte_decay", "0.96"), ("variance.trusted_samples", "11.0")] {
        let other = run(&settings(&[change]), frames().take(12), Some(&host));
        assert!(difference(&cpu[..2], &other[..2]) > SEQUENCE, "{change:?}");
    }
}

/// Frames that were there for a shot are not taken for those of the next.
#[test]
fn cuts_begin_afresh_and_frames_that_are_left_out_do_no_harm() {
    let Some(gpu) = gpu() else { return };
    let host = Host::new(gpu);
    let size = Size::new(24, 15);
    let mut second: Vec<SequenceFrame> = (20..26).map(|t| scene(size, t)).collect();
    second.iter_mut().for_each(|f| f.number -= 18);
    let frames = || (0..4).map(|t| scene(size, t)).chain(second.clone());
    // What the device makes, and no more: where `stabilise` compares signatures, a last bit decides (`SIGNATURES`).
    let settings = of_device();
    let whole = run(&settings, frames(), Some(&host));
    let cpu = run(&settings, frames(), None);
    let d = difference(&cpu, &whole);
    println!("a shot and the next: {d:.1e}");
    assert!(d <= SEQUENCE, "{d:.1e}");
    // Had the cut gone unseen, the two would lie further apart.
    let one_shot = frames().zip(0..).map(|(frame, number)| SequenceFrame { number, ..frame });
    let mut unseen = run(&settings, one_shot, Some(&host));
    unseen.iter_mut().zip(&cpu).for_each(|(frame, cpu)| frame.number = cpu.number);
    assert!(difference(&cpu, &unseen) > SEQUENCE);
    let mut denoiser = SequenceDenoiser::with_accelerator(settings.clone(), Arc::new(host.clone())).unwrap();
    let mut out = Vec::new();
    for t in 0..14 {
        out.extend(denoiser.push(scene(size, t), t == 0 || t == 11).unwrap());
    }
    out.extend(denoiser.finish().unwrap());
    let all = run(&settings, (0..14).map(|t| scene(size, t)), Some(&host));
    assert_eq!(out, [all[0].clone(), all[11].clone()]);
}

/// Planes that are scaled with a light are corrected with it.
#[test]
fn a_planted_difference_in_joint_planes_is_found() {
    let Some(gpu) = gpu() else { return };
    let frames = || (0..3).map(|t| scene(Size::new(24, 15), t));
    let settings = of_device();
    let cpu = run(&settings, frames(), None);
    let whole = Host::new(gpu);
    assert!(difference(&cpu, &run(&settings, frames(), Some(&whole))) <= SEQUENCE);
    let (pass, from, to) = PLANTED_IN_JOINT;
    let source = pass.source(Storage::Float, false);
    assert!(source.contains(from), "{} has no `{from}` any more", pass.name);
    let planted = Host::with(gpu, whole.kernels.with_source(&gpu.device, pass, &source.replace(from, to)));
    assert!(difference(&cpu, &run(&settings, frames(), Some(&planted))) > SEQUENCE);
}

/// Without the future, frames that only helped are estimated when later ones are there already: those must not take their layers.
#[test]
fn frames_that_look_back_alone_do_not_depend_on_which_are_wanted() {
    let Some(gpu) = gpu() else { return };
    let host = Host::new(gpu);
    let settings = settings(&[("gather.future", "off"), ("gather.frames", "2"), ("stabilise.frames", "2")]);
    let frames = || (0..8).map(|t| scene(Size::new(24, 15), t));
    let all = run(&settings, frames(), Some(&host));
    let mut denoiser = SequenceDenoiser::with_accelerator(settings.clone(), Arc::new(host)).unwrap();
    let mut out = Vec::new();
    for frame in frames() {
        let is_wanted = frame.number >= 6;
        out.extend(denoiser.push(frame, is_wanted).unwrap());
    }
    out.extend(denoiser.finish().unwrap());
    assert_eq!(out, all[6..]);
    let cpu = run(&settings, frames(), None);
    assert!(difference(&cpu[6..], &out) <= SIGNATURES);
}

#[test]
fn bands_of_rows_give_the_bits_of_the_whole() {
    let Some(gpu) = gpu() else { return };
    let host = Host::new(gpu);
    let settings = settings(&[("wavelet.levels", "2"), ("wavelet.transmission_levels", "1")]);
    let size = Size::new(20, 208);
    let frames: Vec<SequenceFrame> = (0..4).map(|t| scene(size, t)).collect();
    let whole = run(&settings, frames.clone(), Some(&host));
    let mut prepared: Vec<PreparedFrame> =
        frames.into_iter().map(|f| PreparedFrame::new(f, &settings).unwrap()).collect();
    for i in 1..prepared.len() {
        let (a, b) = prepared.split_at_mut(i);
        a[i - 1].followed_by(&mut b[0], &settings, Backend::Cpu);
    }
    let moved = prepared.iter().flat_map(PreparedFrame::rows_moved).fold(0.0, f32::max);
    let margin = SequenceDenoiser::new(settings.clone()).unwrap().margin(moved, size.height);
    let mut files: Vec<_> = (prepared.into_iter())
        .map(|frame| {
            let mut file = Cursor::new(Vec::new());
            (frame.spool(&mut file).unwrap(), file)
        })
        .collect();
    let (from, to): (usize, usize) = (188, 198);
    let first = from - margin;
    assert!(first > 0, "{margin}");
    let mut denoiser = SequenceDenoiser::with_accelerator(settings, Arc::new(host.clone())).unwrap();
    let mut out = Vec::new();
    for (frame, file) in &mut files {
        let rows = frame.rows(file, first..to + margin).unwrap();
        denoiser
            .push_to(rows, true, &mut |filtered| {
                out.push(filtered);
                true
            })
            .unwrap();
    }
    out.extend(denoiser.finish().unwrap());
    assert_eq!(out.len(), whole.len());
    for (band, whole) in out.iter().zip(&whole) {
        for (band, whole) in band.lights.iter().zip(&whole.lights) {
            for (band, whole) in band.planes.iter().zip(&whole.planes) {
                for y in from..to {
                    assert_eq!(band.row(y - first), whole.row(y), "{y}");
                }
            }
        }
    }
}

#[test]
fn what_is_not_for_the_device_is_filtered_as_before() {
    let Some(gpu) = gpu() else { return };
    let host = Host { refuses: 2, ..Host::new(gpu) };
    let size = Size::new(16, 12);
    let mut frames: Vec<SequenceFrame> = (0..4).map(|t| scene(size, t)).collect();
    run(&settings(&[]), frames.clone(), Some(&host));
    assert_eq!(*host.estimated.lock().unwrap(), [0, 1]);
    // What half precision does not hold.
    frames[1].lights[0].light.data_mut()[7] = [1e6, 0.0, 0.0];
    let host = Host::new(gpu);
    let near = settings(&[("gather.frames", "1")]);
    run(&near, frames.clone(), Some(&host));
    assert_eq!(*host.estimated.lock().unwrap(), [3]);
    // What was never reserved, and a picture beyond the limits.
    let asked = Host { refuses: 0, ..Host::new(gpu) };
    run(&near, (0..2).map(|t| scene(Size::new(8193, 1), t)), Some(&asked));
    let host = Host::new(gpu);
    let mut denoiser = SequenceDenoiser::with_accelerator(near, Arc::new(host)).unwrap();
    denoiser.push(scene(Size::new(8193, 1), 0), true).unwrap();
    let error = denoiser.finish().unwrap_err().to_string();
    assert!(error.contains("max_texture_dimension_2d"), "{error}");
}

/// Share of values of two filtered sequences that lie further apart than [`SEQUENCE`].
fn share_beyond(a: &[Filtered], b: &[Filtered]) -> f64 {
    assert_eq!(a.len(), b.len());
    let mut seen = Seen::default();
    for (a, b) in a.iter().zip(b).flat_map(|(a, b)| a.lights.iter().zip(&b.lights)) {
        for (a, b) in a.planes.iter().zip(&b.planes) {
            seen.compare(a.data().as_flattened(), b.data().as_flattened(), SEQUENCE);
        }
    }
    seen.beyond as f64 / seen.of as f64
}

#[test]
fn every_parameter_is_the_devices_too() {
    let Some(gpu) = gpu() else { return };
    let host = Host::new(gpu);
    let frames: Vec<SequenceFrame> = (0..3).map(|t| scene(Size::new(16, 12), t)).collect();
    // What the device makes, and no more.
    let alone = settings(&[("stabilise.frames", "0"), ("blend.choose", "false")]);
    // The one in the middle alone, which has neighbours on both sides.
    let run = |settings: &SequenceSettings, host: Option<&Host>| run_wanted(settings, frames.clone(), host, |t| t == 1);
    let base = run(&alone, None);
    let of_device = |name: &str| ["gather.", "variance.", "wavelet."].iter().any(|group| name.starts_with(group));
    // At the ends a parameter lies at its threshold (a depth that may differ by 0, equal normals whose cosine must exceed 1),
    // where a GPU's last bit decides: three of the 192 pixels on an H200 (`gather.moving_depth`, `light_contrast`; without levels
    // of the wavelet nothing averages them).
    let decided = if gpu.is_software { DECIDED } else { 2e-2 };
    let (mut moved, mut still, mut beyond) = (0, Vec::new(), Vec::new());
    for parameter in SEQUENCE_PARAMETERS.iter().filter(|p| of_device(p.name)) {
        let mut shows = false;
        // The ends and the middle: the device compiles nothing, but runs every frame again.
        for value in parameter.samples().into_iter().step_by(2) {
            let mut changed = alone.clone();
            changed.set(parameter.name, &value).unwrap();
            if changed == alone {
                continue;
            }
            let cpu = run(&changed, None);
            let found = run(&changed, Some(&host));
            let off = share_beyond(&cpu, &found);
            if off > decided {
                beyond.push(format!("{} = {value}: {off:.1e}", parameter.name));
            }
            // Were the device to ignore it, that would be seen.
            shows |= share_beyond(&base, &cpu) > decided;
        }
        if shows { moved += 1 } else { still.push(parameter.name) }
    }
    println!("{moved} parameters move the picture; not here: {still:?}");
    assert!(beyond.is_empty(), "{beyond:#?}");
    assert!(moved > 30, "{still:?}");
}

/// Changes planted in the shaders, each of which must be seen.
pub const PLANTED: &[(Pass, &str, &str)] = &[
    (Pass::FEATURE_NOISE, "DIVIDED: f32 = 8.0", "DIVIDED: f32 = 7.0"),
    (Pass::FEATURE_NOISE, "select(b, a, abs(a) < abs(b))", "a"),
    (Pass::FEATURE_NOISE, "case 3: { along = vec2i(1, -1); }", ""),
    (Pass::FEATURE_NOISE, "/ (2.0 * here)", "/ here"),
    (Pass::FEATURE_NOISE, "0.5 * dot(d, d)", "dot(d, d)"),
    (Pass::FEATURE_NOISE, "vec4f(colour + vec3f(DIVIDED * facing.w, 0.0, 0.0), facing.w)", "vec4f(colour, 0.0)"),
    (Pass::FEATURE_NOISE, "slope(pixel, vec2i(0, 1), here)", "slope(pixel, vec2i(1, 0), here)"),
    (Pass::GATHER, "settings.moving_weight, same", "1.014 * settings.moving_weight, same"),
    (Pass::GATHER, ">= settings.standing_normal", ">= 0.999"),
    (Pass::GATHER, ">= settings.moving_normal", ">= 0.999"),
    (Pass::GATHER, "> settings.plane_normal", "> 0.99999"),
    (Pass::GATHER, "settings.standing_reach *", "0.5 *"),
    (Pass::GATHER, "settings.round_trip_share *", "0.5 *"),
    (Pass::GATHER, "<= settings.moving_depth", "<= 0.01"),
    (Pass::GATHER, "share < settings.least_share", "share < 0.3"),
    (Pass::GATHER, "const APART: f32 = 1000000000.0", "const APART: f32 = 0.0"),
    (Pass::GATHER, "power *= settings.decay", "power *= 0.99 * settings.decay"),
    (Pass::GATHER, "abs(at.y - origin.y) > settings.farthest", "abs(at.y - origin.y) > 0.5 * settings.farthest"),
    (Pass::GATHER, "any(q < vec2i(0))", "any(q < vec2i(1))"),
    (Pass::GATHER, "let has_back = has_motion(there, !forward)", "let has_back = false"),
    (Pass::GATHER, "reflected && has(there, HAS_REFLECTION_TO_NEXT)", "false"),
    (Pass::GATHER, "reflected && has(there, HAS_REFLECTION_TO_PREVIOUS)", "false"),
    (Pass::GATHER, "if best_alike && share <= best {", "if best > 0.0 && share >= best {"),
    (Pass::GATHER, ">= settings.seen_alike", ">= 0.0"),
    (Pass::GATHER, "trust = found", "trust = 1.0"),
    (Pass::GATHER, "vec2f(around.x, max(around.y, 0.0))", "light_here[k]"),
    (Pass::GATHER, "settings.seen_normal * bend", "0.5 * settings.seen_normal * bend"),
    (Pass::GATHER, "settings.light_noise * mean", "0.5 * settings.light_noise * mean"),
    (Pass::GATHER, "let low = settings.light_deviations", "let low = 0.5 * settings.light_deviations"),
    (Pass::GATHER, "let high = settings.light_deviations_high", "let high = 0.9 * settings.light_deviations_high"),
    (Pass::GATHER, "return left * left", "return left"),
    (Pass::GATHER, "textureLoad(light_1", "textureLoad(light_0"),
    (Pass::GATHER, "dot(d, d) * 0.5", "dot(d, d) * 0.45"),
    (Pass::GATHER, "squares += weights * weights", "squares += weights"),
    (Pass::GATHER, "count / (count - 1.0)", "1.0"),
    (Pass::GATHER, "- mean * mean, 0.0)", "- 0.9 * mean * mean, 0.0)"),
    (Pass::GATHER, "if !(pixel_size > 0.0 && off_plane(s, tracked)", "if (pixel_size > 0.0 && off_plane(s, tracked)"),
    (Pass::GATHER, "largest = max(largest, result.counts[k])", "largest = result.counts[k]"),
    (Pass::GATHER, "if settings.begins == 0u", "if settings.begins == 7u"),
    (Pass::GATHER, "if settings.future != 0u", "if settings.future == 7u"),
    (Pass::VARIANCE, "counts[i][settings.place]", "counts[i].x"),
    (Pass::VARIANCE, "max(second / total - mean * mean, 0.0) * count", "max(second / total - mean * mean, 0.0)"),
    (Pass::VARIANCE, "settings.given == 0u", "settings.given != 7u"),
    (Pass::VARIANCE, "min(freedom / settings.trusted_samples, 1.0)", "1.0"),
    (Pass::VARIANCE, "/ max(count, 1.0)", ""),
    (Pass::VARIANCE, "if total - 1.0 < settings.least_window", "if false"),
    (Pass::VARIANCE, "spread += free * colour.w", "spread += g * colour.w"),
    (Pass::VARIANCE, "first += g * mean", "first += mean"),
    (Pass::VARIANCE, "dy <= radius", "dy < radius"),
];

#[test]
fn planted_differences_are_found() {
    let Some(gpu) = gpu() else { return };
    let size = Size::new(31, 17);
    let frames: Vec<SequenceFrame> = (0..3).map(|t| scene(size, t)).collect();
    let settings = settings(&[("gather.travel", "0.1"), ("stabilise.frames", "0"), ("blend.choose", "false")]);
    let whole = SequenceKernels::new(&gpu.device);
    let wanted = Some(Arc::default());
    let mut unseen = Vec::new();
    for &(pass, from, to) in PLANTED {
        let source = pass.source(Storage::Float, false);
        assert!(source.contains(from), "{} has no `{from}` any more", pass.name);
        let planted = whole.with_source(&gpu.device, pass, &source.replace(from, to));
        let host = Host { wanted: wanted.clone(), ..Host::with(gpu, planted) };
        let seen = stages(&host, &[Backend::Reference], &settings, frames.clone());
        println!("{to}: {:?}", seen.map(|s| (s.most, s.beyond)));
        let at = Pass::SEQUENCE.iter().position(|p| p.name == pass.name).unwrap();
        if seen[at].agrees() {
            unseen.push((from, to));
        }
    }
    assert!(unseen.is_empty(), "{unseen:#?}");
}
