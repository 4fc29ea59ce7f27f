//! `quell bench`: the time of each stage beside the paper's, with the floor of each; rays a second of a scene.

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
use quell::pipeline::{Inputs, Plan, Stage};
use quell::{FrameBuf, Size};
use quell_lab::backend::Backend;
use quell_lab::report::StageTime;
use quell_lab::report::document::Section;
use quell_lab::report::table::Table;
use quell_trace::{Control, RenderOptions, Tracer};
use serde_json::{Map, Value, json};
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

pub fn run(context: &Context, args: BenchArgs) -> Result<(), Failure> {
    if args.scene.is_none() && args.environment.environment.is_some() {
        return Err(Failure::Usage("--environment is for scenes; name one with --scene".to_owned()));
    }
    let backend = context.backend()?;
    let mut report = context.report();
    let gigabytes_a_second = copy_speed();
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
        let stages = with_floors(measured.clock.stages(), context, backend, size, gigabytes_a_second);
        let sum = |f: &dyn Fn(&StageTime) -> Option<f64>| stages.iter().filter_map(f).sum::<f64>();
        let filters: f64 = sum(&|s| s.paper_stage.map(|_| s.milliseconds.median));
        let whole: f64 = sum(&|s| Some(s.milliseconds.median));
        text.push_str(&format!(
            "{size}, {} frames, back end {}, {} thread{}, {}\n\n{}\n",
            measured.frames,
            backend.name(),
            report.machine.threads,
            if report.machine.threads == 1 { "" } else { "s" },
            report.machine.instruction_set,
            table(&stages, size)
        ));
        text.push_str(&format!("stages 3 to 11: {filters:.1} ms a frame; with border and composite: {whole:.1} ms\n"));
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
        text.push('\n');
        runs.push(json!({
            "size": size.to_string(),
            "frames": measured.frames,
            "stages": stages,
            "stages_3_to_11_ms": filters,
            "frame_ms": whole,
            "peak_memory_bytes": peak_memory(),
            "rays": rays.map(|r| json!({
                "per_second": r.per_second, "per_pixel": r.per_pixel, "milliseconds": r.milliseconds,
            })),
        }));
        if report.stages.is_empty() {
            report.stages = stages;
        }
    }
    text.push_str(&format!(
        "floor: the bytes that the cpu back end reads and writes in a stage, each plane once for every pass over it, at the \
         {gigabytes_a_second:.1} GB/s that copying reaches here.\npaper: a GPU of 2017 at {PAPER_SIZE}, from the talk."
    ));
    report.settings.insert("size".to_owned(), args.size.iter().map(Size::to_string).collect::<Vec<_>>().into());
    report.settings.insert("scene".to_owned(), args.scene.map_or(Value::Null, Value::from));
    let mut further = Map::new();
    further.insert("sizes".to_owned(), runs.into());
    further.insert("copy_gigabytes_per_second".to_owned(), gigabytes_a_second.into());
    context.finish(&report, further, &text)
}

/// The talk's table of stages at one extent, as a section of a page.
pub fn section(context: &Context, size: Size) -> Result<(Section, Vec<StageTime>), Failure> {
    let args =
        BenchArgs { scene: None, environment: EnvironmentArgs::default(), size: vec![size], count: SECTION_FRAMES };
    let measured = measure(context, &mut synthetic::frame(size), &args)?;
    let backend = context.backend()?;
    let stages = with_floors(measured.clock.stages(), context, backend, size, copy_speed());
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
}

/// Denoises the frame again and again as if it were a sequence; the first is not counted.
fn measure(context: &Context, frame: &mut FrameBuf, args: &BenchArgs) -> Result<Measured, Failure> {
    let mut denoiser = context.backend()?.denoiser(frame.size, &context.settings)?;
    let mut clock = StageClock::default();
    let progress = Progress::new("frame", args.count as usize + 1, context.quiet);
    let begin = Instant::now();
    let mut frames = 0;
    for index in 0..=args.count as usize {
        if interrupt::asked() {
            return Err(Failure::Interrupted(format!("after {frames} of {} frames", args.count)));
        }
        frame.index = FIRST_FRAME + index as i64;
        if args.scene.is_none() {
            synthetic::renew(frame);
        }
        let times = denoiser.denoise(&frame.frame(&[]))?.report.times;
        progress.done(index);
        if index > 0 {
            clock.add(&times);
            frames += 1;
            if begin.elapsed() > LONGEST && frames >= LEAST_FRAMES {
                break;
            }
        }
    }
    Ok(Measured { clock, frames })
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
    let told = |share: f32| progress.within(0, share, "tracing");
    let control = Control { cancel: Some(interrupt::flag()), progress: Some(&told) };
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

fn with_floors(
    stages: Vec<StageTime>,
    context: &Context,
    backend: &Backend,
    size: Size,
    gigabytes_a_second: f64,
) -> Vec<StageTime> {
    let jitter = stages.iter().any(|s| s.name == Stage::DirectTaa.name());
    let plan = Plan::new(&context.settings, Inputs { jitter, ..Inputs::ALL });
    let with_floor = |mut stage: StageTime| {
        let known = Stage::ALL.into_iter().find(|s| s.name() == stage.name);
        let bytes = known.and_then(|s| backend.bytes_per_pixel(&plan, &context.settings, s));
        stage.bytes_per_pixel = bytes.map(f64::from);
        stage.floor_ms = stage.bytes_per_pixel.map(|b| b * size.pixels() as f64 / (gigabytes_a_second * 1e6));
        stage
    };
    stages.into_iter().map(with_floor).collect()
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
            format!("{:.2}", stage.milliseconds.median),
            format!("{:.2}", stage.milliseconds.min),
            format!("{:.2}", stage.milliseconds.max),
            optional(stage.bytes_per_pixel, 0),
            optional(stage.floor_ms, 2),
            optional(known.and_then(Stage::paper_milliseconds).map(f64::from), 2),
        ]);
    }
    let filters = || Stage::ALL.into_iter().filter(|s| paper_number(*s).is_some());
    let sum = |f: fn(&StageTime) -> Option<f64>| stages.iter().filter_map(f).sum::<f64>();
    table.push([
        "sum".to_owned(),
        format!("{:.2}", sum(|s| Some(s.milliseconds.median))),
        String::new(),
        String::new(),
        format!("{:.0}", sum(|s| s.bytes_per_pixel)),
        format!("{:.2}", sum(|s| s.floor_ms)),
        format!("{:.2}", filters().filter_map(Stage::paper_milliseconds).map(f64::from).sum::<f64>()),
    ]);
    table
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
