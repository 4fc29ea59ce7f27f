//! `quell bench`: the time of each stage beside the paper's, with the floor of each; rays a second of a scene.

#[cfg(feature = "gpu")]
mod budget;
mod cycles;
mod device;
pub mod sequence;
mod synthetic;

use crate::args::BenchArgs;
use crate::args::environment::EnvironmentArgs;
use crate::args::scene::SceneArgs;
use crate::context::Context;
use crate::environment;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Progress;
use crate::scene;
use crate::sequence::FIRST_FRAME;
use crate::sequence::times::{StageClock, paper_number};
use quell::pipeline::Stage;
use quell::{FrameBuf, Size};
use quell_lab::backend::{Backend, DeviceMemory};
use quell_lab::report::document::Section;
use quell_lab::report::table::Table;
use quell_lab::report::{Machine, Spread, StageTime};
#[cfg(feature = "gpu")]
use quell_lab::tracer::TraceOn;
use quell_trace::{Control, RenderOptions, Tracer};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Beyond this, fewer frames are measured than asked for.
const LONGEST: Duration = Duration::from_secs(60);
/// A scene is traced again and again for about so long.
const TRACED_FOR: Duration = Duration::from_secs(8);
/// Fewer than these make no median.
const LEAST_FRAMES: usize = 3;
/// Frames that the table on a page is measured with.
const SECTION_FRAMES: u32 = 10;
/// Extent that the talk's table is for.
const PAPER_SIZE: Size = Size { width: 1280, height: 720 };

/// An environment lights a scene, and nothing else.
fn needs_a_scene_for_its_environment(args: &BenchArgs) -> Result<(), Failure> {
    if args.scene.is_none() && args.environment.environment.is_some() {
        return Err(Failure::Usage("--environment is for scenes; name one with --scene".to_owned()));
    }
    Ok(())
}

pub fn run(context: &Context, args: BenchArgs) -> Result<(), Failure> {
    needs_a_scene_for_its_environment(&args)?;
    let backend = context.backend()?;
    #[cfg(feature = "gpu")]
    if let Some(scene) = &args.scene
        && let TraceOn::Gpu(gpu, kernels) = context.tracer()?
    {
        return budget::run(context, &args, scene, &gpu, &kernels);
    }
    let mut report = context.report();
    let bandwidth = Bandwidth::of(backend, args.bandwidth)?;
    let mut text = String::new();
    let mut runs = Vec::new();
    for &size in &args.size {
        let mut rays = None;
        let mut frame = match &args.scene {
            Some(scene) => {
                let (frame, measured) = traced(context, scene, &args.environment, size)?;
                rays = Some(measured);
                frame
            }
            None => synthetic::frame(size),
        };
        let measured = measure(context, &mut frame, &args)?;
        let stages = with_floors(&measured, &bandwidth, size);
        let sum = |f: &dyn Fn(&StageTime) -> Option<f64>| stages.iter().filter_map(f).sum::<f64>();
        // An empty sum of floats is -0.
        let filters: f64 = 0.0 + sum(&|s| is_filter(&s.name).then_some(s.milliseconds.median));
        let whole: f64 = sum(&|s| Some(s.milliseconds.median));
        text.push_str(&format!(
            "{size}, {} frames, back end {}, {}\n\n",
            measured.frames,
            backend.name(),
            backend.adapter().unwrap_or_else(|| cpu(&report.machine)),
        ));
        if !stages.is_empty() {
            text.push_str(&format!("{}\n", table(&stages, size)));
        }
        text.push_str(&measured.sentence(filters, whole));
        let border = border_bytes(context).filter(|_| measured.frame.is_some());
        if let Some(bytes) = border {
            let floor = f64::from(bytes) * size.pixels() as f64 / (bandwidth.gigabytes_a_second * 1e6);
            text.push_str(&format!(
                "before them, in a renderer whose guides are textures: prepare, {bytes} bytes/pixel, floor {} ms\n",
                time(floor)
            ));
        }
        if let Some(memory) = &measured.device_memory {
            text.push_str(&format!("device memory: {memory}\n"));
        }
        for note in &measured.notes {
            text.push_str(&format!("{note}\n"));
        }
        if let Some(peak) = peak_memory() {
            text.push_str(&format!(
                "peak memory of the process so far: {:.2} GiB\n",
                peak as f64 / (1u64 << 30) as f64
            ));
        }
        if let Some(rays) = &rays {
            text.push_str(&format!(
                "tracer: {:.2} million rays a second, {:.1} rays a pixel, {:.0} ms a frame\n",
                rays.per_second / 1e6,
                rays.per_pixel,
                rays.milliseconds
            ));
        }
        if rays.is_some() && backend.is_software() {
            text.push_str(
                "the scene was traced on the CPU; --tracer gpu traces it on the adapter and times the whole frame\n",
            );
        }
        text.push('\n');
        runs.push(json!({
            "size": size.to_string(),
            "frames": measured.frames,
            "stages": stages,
            "stages_3_to_11_ms": filters,
            "frame_ms": measured.frame.map_or(whole, |frame| frame.median),
            "shared_passes": measured.shared,
            "bytes_per_pixel": measured.bytes.iter().map(|(stage, bytes)| (stage.name(), *bytes)).collect::<BTreeMap<_, _>>(),
            "prepare_bytes_per_pixel": border,
            "peak_memory_bytes": peak_memory(),
            "device_memory_bytes": measured.device_memory.map(|memory| memory.json()),
            "notes": measured.notes,
            "rays": rays.map(|r| json!({
                "per_second": r.per_second, "per_pixel": r.per_pixel, "milliseconds": r.milliseconds,
            })),
        }));
        if report.stages.is_empty() {
            report.stages = stages;
        }
    }
    text.push_str(&format!(
        "floor: the bytes that the {} back end reads and writes in a stage, each plane once for every pass over it, at the \
         {:.1} GB/s that {}.\npaper: a GPU of 2017 at {PAPER_SIZE}, from the talk.",
        backend.name(),
        bandwidth.gigabytes_a_second,
        if bandwidth.given { "were given" } else { "copying reaches here" }
    ));
    report.settings.insert("size".to_owned(), args.size.iter().map(Size::to_string).collect::<Vec<_>>().into());
    report.settings.insert("scene".to_owned(), args.scene.map_or(Value::Null, Value::from));
    let mut further = Map::new();
    further.insert("sizes".to_owned(), runs.into());
    let name = if bandwidth.given { "gigabytes_per_second" } else { "copy_gigabytes_per_second" };
    further.insert(name.to_owned(), bandwidth.gigabytes_a_second.into());
    context.finish(&report, further, &text)
}

/// The talk's table of stages at one extent, as a section of a page.
pub fn section(context: &Context, size: Size) -> Result<(Section, Vec<StageTime>), Failure> {
    let environment = EnvironmentArgs::default();
    let args = BenchArgs {
        scene: None,
        environment,
        size: vec![size],
        count: SECTION_FRAMES,
        jitter: false,
        bandwidth: None,
        sequence: false,
        against: None,
    };
    let measured = measure(context, &mut synthetic::frame(size), &args)?;
    let backend = context.backend()?;
    let stages = with_floors(&measured, &Bandwidth::of(backend, None)?, size);
    let section = Section {
        heading: "Stage times".to_owned(),
        text: vec![format!(
            "{size}, {} frames of made-up guides and noise, back end {}. The paper's times are of a GPU of 2017 at {PAPER_SIZE}.",
            measured.frames,
            backend.name()
        )],
        tables: vec![("Median, least and largest time of a frame.".to_owned(), table(&stages, size))],
        ..Section::default()
    };
    Ok((section, stages))
}

struct Measured {
    clock: StageClock,
    frames: usize,
    /// On a GPU: wall time of a frame from encoding to its end, milliseconds; uploading and reading back left out.
    frame: Option<Spread>,
    /// Bytes a pixel of each stage that runs, where they are counted.
    bytes: Vec<(Stage, u32)>,
    /// Passes that run several stages.
    shared: Vec<&'static str>,
    /// On a GPU.
    device_memory: Option<DeviceMemory>,
    /// What a reader should know of how frames ran.
    notes: Vec<String>,
}

impl Measured {
    fn sentence(&self, filters: f64, whole: f64) -> String {
        match self.frame {
            None => format!("stages 3 to 11: {filters:.1} ms a frame; with border and composite: {whole:.1} ms\n"),
            Some(frame) => {
                let stages = match filters {
                    0.0 => "this adapter has no timestamps".to_owned(),
                    some => format!("stages 3 to 11: {some:.3} ms a frame"),
                };
                let shared = match self.shared.as_slice() {
                    [] => String::new(),
                    some => {
                        format!("one pass each, whose time and bytes stand with its first stage: {}\n", some.join(", "))
                    }
                };
                let bytes: u32 = self.bytes.iter().filter(|(s, _)| is_3_to_10(*s)).map(|(_, b)| b).sum();
                format!(
                    "{stages}; from encoding to the end of a frame, without upload and read back: {:.3} ms ({:.3} to {:.3})\n\
                     bytes a pixel of stages 3 to 10: {bytes}\n{shared}",
                    frame.median, frame.min, frame.max
                )
            }
        }
    }
}

/// Stages 3 to 10, with what lies between them that the paper does not have.
fn is_3_to_10(stage: Stage) -> bool {
    !matches!(stage, Stage::DirectTaa | Stage::Composite | Stage::Antialiasing)
}

/// The same with stage 11.
fn is_filter(name: &str) -> bool {
    Stage::ALL.into_iter().any(|stage| stage.name() == name && !matches!(stage, Stage::Composite | Stage::Antialiasing))
}

/// Denoises the frame again and again as if it were a sequence; the first are not counted.
fn measure(context: &Context, frame: &mut FrameBuf, args: &BenchArgs) -> Result<Measured, Failure> {
    let mut denoiser = context.backend()?.denoiser(frame.size, &context.settings)?;
    let mut clock = StageClock::default();
    let mut walls = Vec::new();
    let warm_up = denoiser.warm_up_frames();
    let progress = Progress::new("frame", args.count as usize + warm_up, context.quiet);
    let begin = Instant::now();
    let mut frames = 0;
    for index in 0..args.count as usize + warm_up {
        if interrupt::asked() {
            return Err(Failure::Interrupted(format!("after {frames} of {} frames", args.count)));
        }
        frame.index = FIRST_FRAME + index as i64;
        // A GPU keeps the planes of the first: what a stage takes does not depend on the noise that it meets.
        let renewed = index == 0 || denoiser.is_cpu();
        if args.scene.is_none() {
            synthetic::renew(frame, renewed);
            if args.jitter {
                frame.camera.jitter = quell_trace::jitter_of(frame.index);
                frame.previous_camera.jitter = quell_trace::jitter_of(frame.index - 1);
            }
        }
        let (times, wall) = denoiser.time(&frame.frame(&[]), renewed)?;
        progress.done(index);
        if index >= warm_up {
            clock.add(&times);
            walls.extend(wall.map(|wall| wall.as_secs_f64() * 1e3));
            frames += 1;
            if begin.elapsed() > LONGEST && frames >= LEAST_FRAMES {
                break;
            }
        }
    }
    let counted = |stage| denoiser.bytes_per_pixel(stage).map(|bytes| (stage, bytes));
    let bytes = Stage::ALL.into_iter().filter_map(counted).collect();
    Ok(Measured {
        clock,
        frames,
        frame: Spread::of(walls),
        bytes,
        shared: denoiser.shared_passes(),
        device_memory: denoiser.device_memory(),
        notes: denoiser.notes(),
    })
}

/// Bytes a pixel that a GPU moves before the stages where guides come as a renderer's textures; here they come packed.
#[cfg(feature = "gpu")]
fn border_bytes(context: &Context) -> Option<u32> {
    use quell::gpu::{Contents, Program, Storage};
    let contents = Contents { textures: true, ..Contents::USUAL };
    let plan = quell::pipeline::Plan::new(&context.settings, contents.inputs());
    Some(Program::new(&plan, contents, Storage::default(), true).border_bytes_per_pixel())
}

#[cfg(not(feature = "gpu"))]
fn border_bytes(_: &Context) -> Option<u32> {
    None
}

struct Rays {
    per_second: f64,
    per_pixel: f64,
    milliseconds: f64,
}

/// One frame of a scene, and how fast it was traced.
fn traced(
    context: &Context,
    name: &str,
    environment: &EnvironmentArgs,
    size: Size,
) -> Result<(FrameBuf, Rays), Failure> {
    let mut scene = scene::open(context, name, &SceneArgs::default())?.scene;
    environment::surround(context, &mut scene, environment)?;
    let tracer = Tracer::new(&scene, FIRST_FRAME, 1)?;
    let progress = Progress::new("trace", 1, context.quiet);
    let notify = |share: f32| progress.within(0, share, "tracing");
    let control = Control { cancel: Some(interrupt::flag()), progress: Some(&notify) };
    // The best of a few rounds: what else the machine does only slows.
    let mut seconds = f64::INFINITY;
    let first = Instant::now();
    let rendered = loop {
        let begin = Instant::now();
        let rendered = tracer.render(&RenderOptions::new(size), &control)?;
        let latest = begin.elapsed();
        seconds = seconds.min(latest.as_secs_f64());
        if first.elapsed() + latest > TRACED_FOR {
            break rendered;
        }
    };
    let total = rendered.rays.total() as f64;
    let rays =
        Rays { per_second: total / seconds, per_pixel: total / size.pixels() as f64, milliseconds: seconds * 1e3 };
    Ok((rendered.frame, rays))
}

fn with_floors(measured: &Measured, bandwidth: &Bandwidth, size: Size) -> Vec<StageTime> {
    let with_floor = |mut stage: StageTime| {
        let known = measured.bytes.iter().find(|(s, _)| s.name() == stage.name);
        stage.bytes_per_pixel = known.map(|(_, bytes)| f64::from(*bytes));
        let milliseconds = |bytes: f64| bytes * size.pixels() as f64 / (bandwidth.gigabytes_a_second * 1e6);
        stage.floor_ms = stage.bytes_per_pixel.map(milliseconds);
        stage
    };
    // What comes before a GPU's stages is not among what it timed.
    let on_gpu = measured.frame.is_some();
    let stages =
        measured.clock.stages().into_iter().filter(|s| !on_gpu || Stage::ALL.iter().any(|k| k.name() == s.name));
    stages.map(with_floor).collect()
}

/// What floors are reckoned with.
struct Bandwidth {
    gigabytes_a_second: f64,
    /// By the user; else measured.
    given: bool,
}

impl Bandwidth {
    fn of(backend: &Backend, given: Option<f32>) -> Result<Self, Failure> {
        let gigabytes_a_second = match given {
            Some(given) => f64::from(given),
            None => backend.copy_speed()?.unwrap_or_else(copy_speed),
        };
        Ok(Self { gigabytes_a_second, given: given.is_some() })
    }
}

/// What the stages ran on, in words.
fn cpu(machine: &Machine) -> String {
    let s = if machine.threads == 1 { "" } else { "s" };
    format!("{} thread{s}, {}", machine.threads, machine.instruction_set)
}

/// The paper's table with ours beside it.
fn table(stages: &[StageTime], size: Size) -> Table {
    let paper_head = if size == PAPER_SIZE { "paper ms" } else { "paper ms at 1280x720" };
    let mut table = Table::new(["stage", "median ms", "min", "max", "bytes/pixel", "floor ms", paper_head]);
    let optional = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
    for stage in stages {
        let known = Stage::ALL.into_iter().find(|s| s.name() == stage.name);
        table.push([
            known.map_or(stage.name.clone(), |s| format!("{:<26}{}", s.paper_stage(), s.name())),
            time(stage.milliseconds.median),
            time(stage.milliseconds.min),
            time(stage.milliseconds.max),
            optional(stage.bytes_per_pixel, 0),
            stage.floor_ms.map_or("-".to_owned(), time),
            optional(known.and_then(Stage::paper_milliseconds).map(f64::from), 2),
        ]);
    }
    let filters = || Stage::ALL.into_iter().filter(|s| paper_number(*s).is_some());
    let sum = |f: fn(&StageTime) -> Option<f64>| stages.iter().filter_map(f).sum::<f64>();
    table.push([
        "sum".to_owned(),
        time(sum(|s| Some(s.milliseconds.median))),
        String::new(),
        String::new(),
        format!("{:.0}", sum(|s| s.bytes_per_pixel)),
        time(sum(|s| s.floor_ms)),
        format!("{:.2}", filters().filter_map(Stage::paper_milliseconds).map(f64::from).sum::<f64>()),
    ]);
    table
}

/// Milliseconds: a GPU's stages take microseconds.
fn time(milliseconds: f64) -> String {
    if milliseconds < 1.0 { format!("{milliseconds:.4}") } else { format!("{milliseconds:.2}") }
}

/// Gigabytes a second, read and written together, that copying reaches with all threads: the best of a few rounds.
fn copy_speed() -> f64 {
    use rayon::prelude::*;
    /// Beyond any cache.
    const BYTES: usize = 256 << 20;
    const CHUNK: usize = 1 << 20;
    let source = vec![1u8; BYTES];
    let mut target = vec![0u8; BYTES];
    let mut best = 0.0_f64;
    for _ in 0..4 {
        let begin = Instant::now();
        target.par_chunks_mut(CHUNK).zip(source.par_chunks(CHUNK)).for_each(|(t, s)| t.copy_from_slice(s));
        best = best.max(2.0 * BYTES as f64 / begin.elapsed().as_secs_f64() / 1e9);
        std::hint::black_box(&target);
    }
    best
}

/// The most memory that this process held at any time, in bytes; Linux only.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib * 1024)
}
