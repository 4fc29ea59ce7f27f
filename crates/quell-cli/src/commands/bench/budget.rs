//! `quell bench --scene SCENE` with the tracer on a GPU: the whole frame, pass by pass, against a budget; and what fewer rays, direct
//! light at half the rate and two eyes would take.

use super::{Bandwidth, FIRST_FRAME, LEAST_FRAMES, PAPER_SIZE, time};
use crate::args::BenchArgs;
use crate::args::scene::SceneArgs;
use crate::context::Context;
use crate::environment;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Progress;
use crate::scene;
use quell::Size;
use quell::pipeline::Stage;
use quell_host::Gpu;
use quell_lab::report::Spread;
use quell_lab::report::table::Table;
use quell_lab::whole_frame::{FramePlan, PassCost, WholeFrame};
use quell_trace::gpu::Kernels;
use quell_trace::{RenderOptions, Scene};
use serde_json::{Map, Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The extent that the budget is for, and its milliseconds: 60 frames a second.
const BUDGET_SIZE: Size = Size { width: 1920, height: 1080 };
const BUDGET_MS: f64 = 16.6;
/// Of it the denoiser's.
const DENOISER_MS: f64 = 1.5;
/// Two eyes at 90 frames a second.
const EYE_SIZE: Size = Size { width: 1080, height: 1200 };
const EYES_MS: f64 = 1000.0 / 90.0;
/// Fewer frames are measured than asked for where a row takes longer.
const LONGEST: Duration = Duration::from_secs(20);
/// Frames before times are steady, on a GPU and on one in software.
const WARM_UP: [u32; 2] = [8, 1];

/// A row of the second table.
struct Row {
    what: &'static str,
    plan: FramePlan,
    /// The extent and the milliseconds that it is held against.
    budget: (Size, f64),
    rays_per_pixel: f64,
    passes: Vec<(PassCost, Option<Spread>)>,
    wall: Spread,
    /// Of tracer and denoiser, by the clock on the wall; where timestamps cannot be used.
    parts: Option<[f64; 2]>,
    memory: u64,
}

impl Row {
    /// Sum of medians, of the tracer or of the denoiser.
    fn milliseconds(&self, is_tracing: bool) -> Option<f64> {
        if let Some([tracer, denoiser]) = self.parts {
            return Some(if is_tracing { tracer } else { denoiser });
        }
        let of = self.passes.iter().filter(|(pass, _)| pass.is_tracing == is_tracing);
        of.map(|(_, spread)| spread.map(|s| s.median)).sum()
    }

    fn bytes(&self, is_tracing: bool) -> u32 {
        self.passes.iter().filter(|(p, _)| p.is_tracing == is_tracing).map(|(p, _)| p.bytes_per_pixel).sum()
    }

    /// Of the extent that was run.
    fn pixels(&self) -> f64 {
        (self.plan.views * self.plan.size.pixels()) as f64
    }

    /// Of the extent that the budget is for.
    fn budget_pixels(&self) -> f64 {
        (self.plan.views * self.budget.0.pixels()) as f64
    }

    /// Rays a second of the tracer's passes.
    fn rays_per_second(&self) -> Option<f64> {
        self.milliseconds(true).filter(|ms| *ms > 0.0).map(|ms| self.rays_per_pixel * self.pixels() / ms * 1e3)
    }

    fn json(&self, bandwidth: &Bandwidth) -> Value {
        let passes = self.passes.iter().map(|(pass, spread)| {
            json!({
                "name": pass.name,
                "of": if pass.is_tracing { "tracer" } else { "denoiser" },
                "milliseconds": spread,
                "bytes_per_pixel": pass.bytes_per_pixel,
                "floor_ms": floor(pass.bytes_per_pixel, self.budget_pixels(), bandwidth),
            })
        });
        json!({
            "what": self.what,
            "size": self.plan.size.to_string(),
            "views": self.plan.views,
            "paths": self.plan.options.samples,
            "bounces": self.plan.options.bounces,
            "shadow_rays": self.plan.options.direct_samples,
            "rays_per_pixel": self.rays_per_pixel,
            "rays_per_second": self.rays_per_second(),
            "tracer_ms": self.milliseconds(true),
            "denoiser_ms": self.milliseconds(false),
            "wall_ms": self.wall,
            "passes": passes.collect::<Vec<_>>(),
            "floor_size": self.budget.0.to_string(),
            "budget_ms": self.budget.1,
            "device_memory_bytes": self.memory,
        })
    }
}

/// Milliseconds that these bytes take at the least.
fn floor(bytes: u32, pixels: f64, bandwidth: &Bandwidth) -> f64 {
    f64::from(bytes) * pixels / (bandwidth.gigabytes_a_second * 1e6)
}

/// What is measured: the frame as it is usually traced first.
fn plans(size: Size) -> [(&'static str, FramePlan, (Size, f64)); 6] {
    let plan = |bounces, direct_samples| FramePlan {
        size,
        views: 1,
        options: RenderOptions { bounces, direct_samples, ..RenderOptions::new(size) },
    };
    let usual = RenderOptions::new(size);
    // The eyes' share of the extent that was asked for.
    let part = |of: usize, whole: usize, asked: usize| (of * asked).div_ceil(whole).max(1);
    let eye = Size::new(
        part(EYE_SIZE.width, BUDGET_SIZE.width, size.width),
        part(EYE_SIZE.height, BUDGET_SIZE.height, size.height),
    );
    let screen = (BUDGET_SIZE, BUDGET_MS);
    [
        ("as `render` traces", plan(usual.bounces, usual.direct_samples), screen),
        ("half the shadow rays", plan(usual.bounces, usual.direct_samples / 2), screen),
        ("1 bounce, 1 shadow ray", plan(1, 1), screen),
        ("1 bounce, 4 shadow rays", plan(1, 4), screen),
        ("2 bounces, 1 shadow ray", plan(2, 1), screen),
        ("two eyes, 1 bounce, 1 shadow ray", FramePlan { size: eye, views: 2, ..plan(1, 1) }, (EYE_SIZE, EYES_MS)),
    ]
}

/// The command.
pub fn run(
    context: &Context,
    args: &BenchArgs,
    name: &str,
    gpu: &Arc<Gpu>,
    kernels: &Arc<Kernels>,
) -> Result<(), Failure> {
    let backend = context.backend()?;
    let bandwidth = Bandwidth::of(backend, args.bandwidth)?;
    let mut scene = scene::open(context, name, &SceneArgs::default())?.scene;
    environment::surround(context, &mut scene, &args.environment)?;
    let mut text = String::new();
    let mut runs = Vec::new();
    for &size in &args.size {
        let all = plans(size);
        let progress = Progress::new("frame", all.len(), context.quiet);
        let mut rows = Vec::new();
        for (index, (what, plan, budget)) in all.into_iter().enumerate() {
            rows.push(measure(context, args.count, &scene, gpu, kernels, what, plan, budget)?);
            progress.done(index);
        }
        let Some(usual) = rows.first() else { continue };
        text.push_str(&format!(
            "{name}, {size}, tracer and denoiser on {}\n\n{}\n",
            backend.adapter().unwrap_or_default(),
            pass_table(usual, &bandwidth)
        ));
        text.push_str(&format!("{}\n", row_table(&rows, &bandwidth)));
        if backend.is_software() {
            text.push_str(
                "This adapter is a processor that plays a GPU, and its timestamps do not wait for its threads: tracer and denoiser are timed by \
                 the clock on the wall, no pass alone. That orders the rows, and says nothing of a GPU.\n",
            );
        }
        text.push('\n');
        runs.push(json!({
            "size": size.to_string(),
            "rows": rows.iter().map(|row| row.json(&bandwidth)).collect::<Vec<_>>(),
        }));
    }
    text.push_str(&format!(
        "bytes: what a pass reads and writes between passes, each plane once; of the tracer at the least, without nodes, triangles and \
         textures of the scene. floor: these bytes at {BUDGET_SIZE} (two eyes: 2 x {EYE_SIZE}) and the {:.1} GB/s that {}. budget: {BUDGET_MS} ms, \
         of which the denoiser's {DENOISER_MS}; two eyes {EYES_MS:.1} ms (90 a second). Direct light of half the pixels is not traced: \
         that row takes half of `trace direct` away from the first. paper: a GPU of 2017 at {PAPER_SIZE}, from the talk; it does not time its tracer.",
        bandwidth.gigabytes_a_second,
        if bandwidth.given { "were given" } else { "copying reaches here" }
    ));
    let mut report = context.report();
    report.settings.insert("size".to_owned(), args.size.iter().map(Size::to_string).collect::<Vec<_>>().into());
    report.settings.insert("scene".to_owned(), name.into());
    let mut further = Map::new();
    further.insert("budget".to_owned(), runs.into());
    let key = if bandwidth.given { "gigabytes_per_second" } else { "copy_gigabytes_per_second" };
    further.insert(key.to_owned(), bandwidth.gigabytes_a_second.into());
    context.finish(&report, further, &text)
}

#[expect(clippy::too_many_arguments, reason = "all of a row")]
fn measure(
    context: &Context,
    count: u32,
    scene: &Scene,
    gpu: &Arc<Gpu>,
    kernels: &Arc<Kernels>,
    what: &'static str,
    plan: FramePlan,
    budget: (Size, f64),
) -> Result<Row, Failure> {
    let mut whole = WholeFrame::new(gpu, kernels, scene, FIRST_FRAME, 1, &context.settings, &plan)?;
    let warm_up = WARM_UP[usize::from(gpu.adapter().is_software())];
    for _ in 0..warm_up {
        whole.run()?;
    }
    let mut costs = Vec::new();
    let begin = Instant::now();
    while costs.len() < count as usize && (begin.elapsed() < LONGEST || costs.len() < LEAST_FRAMES) {
        if interrupt::asked() {
            return Err(Failure::Interrupted(format!("in the row \"{what}\"")));
        }
        costs.push(whole.run()?);
    }
    let last = costs.last().map(|cost| cost.passes.clone()).unwrap_or_default();
    let passes = last.into_iter().enumerate().map(|(index, pass)| {
        let times = costs.iter().filter_map(|cost| cost.passes.get(index)?.milliseconds);
        (pass, Spread::of(times))
    });
    let passes = passes.collect();
    let wall = Spread::of(costs.iter().map(|cost| cost.wall.as_secs_f64() * 1e3));
    let part = |index: usize| {
        let times = costs.iter().filter_map(|cost| Some(cost.parts?[index].as_secs_f64() * 1e3));
        Spread::of(times).map(|spread| spread.median)
    };
    Ok(Row {
        what,
        parts: part(0).zip(part(1)).map(<[f64; 2]>::from),
        budget,
        rays_per_pixel: whole.rays_per_pixel()?,
        passes,
        wall: wall.unwrap_or(Spread { median: 0.0, min: 0.0, max: 0.0 }),
        memory: whole.memory().iter().map(|(_, bytes)| bytes).sum(),
        plan,
    })
}

fn optional(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), time)
}

/// The frame pass by pass.
fn pass_table(row: &Row, bandwidth: &Bandwidth) -> Table {
    let floor_head = format!("floor ms at {BUDGET_SIZE}");
    let mut table = Table::new(["pass", "median ms", "min", "max", "bytes/pixel", &floor_head, "paper ms"]);
    let pixels = row.budget_pixels();
    let paper = |stages: &[Stage]| -> Option<f64> {
        stages.iter().filter_map(|s| s.paper_milliseconds()).map(f64::from).reduce(|a, b| a + b)
    };
    for is_tracing in [true, false] {
        let mut of_paper = 0.0;
        for (pass, spread) in row.passes.iter().filter(|(pass, _)| pass.is_tracing == is_tracing) {
            of_paper += paper(pass.stages).unwrap_or(0.0);
            table.push([
                pass.name.to_owned(),
                optional(spread.map(|s| s.median)),
                optional(spread.map(|s| s.min)),
                optional(spread.map(|s| s.max)),
                pass.bytes_per_pixel.to_string(),
                time(floor(pass.bytes_per_pixel, pixels, bandwidth)),
                paper(pass.stages).map_or("-".to_owned(), |ms| format!("{ms:.2}")),
            ]);
        }
        let name = if is_tracing { "tracer" } else { "denoiser" };
        table.push([
            format!("sum: {name}"),
            optional(row.milliseconds(is_tracing)),
            String::new(),
            String::new(),
            row.bytes(is_tracing).to_string(),
            time(floor(row.bytes(is_tracing), pixels, bandwidth)),
            if of_paper > 0.0 { format!("{of_paper:.2}") } else { "-".to_owned() },
        ]);
    }
    table
}

/// What fewer rays and two eyes take.
fn row_table(rows: &[Row], bandwidth: &Bandwidth) -> Table {
    let mut table = Table::new([
        "frame",
        "extent",
        "rays/pixel",
        "tracer ms",
        "denoiser ms",
        "wall ms",
        "M rays/s",
        "bytes/pixel",
        "floor ms",
        "budget ms",
        "MiB",
    ]);
    for row in rows {
        let bytes = row.bytes(true) + row.bytes(false);
        let views = if row.plan.views == 1 { String::new() } else { format!("{} x ", row.plan.views) };
        table.push([
            row.what.to_owned(),
            format!("{views}{}", row.plan.size),
            format!("{:.1}", row.rays_per_pixel),
            optional(row.milliseconds(true)),
            optional(row.milliseconds(false)),
            time(row.wall.median),
            row.rays_per_second().map_or("-".to_owned(), |rays| format!("{:.2}", rays / 1e6)),
            bytes.to_string(),
            time(floor(bytes, row.budget_pixels(), bandwidth)),
            format!("{:.1}", row.budget.1),
            format!("{:.1}", row.memory as f64 / 1_048_576.0),
        ]);
    }
    if let Some(usual) = rows.first() {
        let direct = usual.passes.iter().find(|(pass, _)| pass.name == quell_trace::gpu::TIMED[2]);
        let saved = direct.and_then(|(_, spread)| Some(0.5 * (*spread)?.median));
        let tracer = usual.milliseconds(true).zip(saved).map(|(ms, saved)| ms - saved);
        table.push([
            "direct light of half the pixels (reckoned)".to_owned(),
            usual.plan.size.to_string(),
            "-".to_owned(),
            optional(tracer),
            optional(usual.milliseconds(false)),
            "-".to_owned(),
            "-".to_owned(),
            "-".to_owned(),
            "-".to_owned(),
            format!("{:.1}", usual.budget.1),
            "-".to_owned(),
        ]);
    }
    table
}
