//! `quell bench --sequence`: processor time of each stage of the sequence filter, on one thread and on all, with its floor.

use super::{Bandwidth, cycles, device, peak_memory};
use crate::args::{BenchArgs, Rival};
use crate::context::Context;
use crate::failure::Failure;
use crate::interrupt;
use quell::sequence::{PreparedFrame, SequenceDenoiser, SequenceFrame, SequenceSettings};
use quell::{Plane, Size};
use quell_frames::driver::clock::{pool_seconds, process_seconds};
use quell_lab::backend::Backend;
use quell_lab::methods::oidn::{Prefiltered, Quality};
use quell_lab::report::table::Table;
use serde_json::{Map, json};
use std::time::Instant;

/// Colour planes with light of the frames that are made.
const PLANES: usize = cycles::LIT;
/// Frames at least that are compared with other denoisers.
const LEAST_COMPARED: usize = 3;

/// What one stage takes of a frame.
struct Taken {
    name: &'static str,
    seconds: f64,
}

/// What the stages take on so many threads.
struct Column {
    threads: usize,
    /// Processor seconds.
    processor: Vec<Taken>,
    /// Seconds by the clock.
    clock: Vec<Taken>,
}

fn of(taken: &[Taken], name: &str) -> f64 {
    taken.iter().filter(|t| t.name == name).map(|t| t.seconds).sum()
}

fn sum(taken: &[Taken]) -> f64 {
    taken.iter().map(|t| t.seconds).sum()
}

pub fn run(context: &Context, settings: &SequenceSettings, args: &BenchArgs) -> Result<(), Failure> {
    super::needs_a_scene_for_its_environment(args)?;
    let bandwidth = Bandwidth::of(&Backend::Cpu(quell::Backend::Cpu), args.bandwidth)?;
    let backend = context.backend()?;
    let report = context.sequence_report(settings);
    let all = rayon::current_num_threads();
    let mut counts = vec![1, all];
    counts.dedup();
    let mut text = String::new();
    let mut runs = Vec::new();
    for &size in &args.size {
        let mut columns = Vec::new();
        for &threads in &counts {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|e| Failure::Usage(format!("{threads} threads cannot be started: {e}")))?;
            columns.push(pool.install(|| measure(size, settings, args.count as usize, threads))?);
        }
        let mut rivals = match args.against {
            Some(Rival::Oidn) => Others::oidn(size)?,
            None => Others::default(),
        };
        let beside = if rivals.each.is_empty() {
            None
        } else {
            Some(compare(size, settings, args.count as usize, &mut rivals)?)
        };
        let mut head = vec!["stage".to_owned()];
        head.extend(counts.iter().map(|n| format!("ms, {n} thread{}", if *n == 1 { "" } else { "s" })));
        head.extend(counts.iter().skip(1).flat_map(|n| [format!("by the clock, {n} threads"), "faster".to_owned()]));
        head.extend(["ns/pixel", "bytes/pixel", "floor ms"].map(str::to_owned));
        let mut table = Table { head, rows: Vec::new() };
        let ms = |seconds: f64| format!("{:.1}", seconds * 1e3);
        let floor = |bytes: usize| bytes as f64 * size.pixels() as f64 / (bandwidth.gigabytes_a_second * 1e9);
        let first = &columns[0];
        let row = |name: &str, seconds: &dyn Fn(&[Taken]) -> f64, bytes: Option<usize>| {
            let (processor, clock) = (seconds(&first.processor), seconds(&first.clock));
            let mut row = vec![name.to_owned()];
            row.extend(columns.iter().map(|column| ms(seconds(&column.processor))));
            let faster = |column: &Column| {
                let here = seconds(&column.clock);
                [ms(here), format!("{:.1} times", clock / here.max(1e-9))]
            };
            row.extend(columns.iter().skip(1).flat_map(faster));
            row.push(format!("{:.1}", processor * 1e9 / size.pixels() as f64));
            row.push(bytes.map_or("-".to_owned(), |bytes| bytes.to_string()));
            row.push(bytes.map_or("-".to_owned(), |bytes| ms(floor(bytes))));
            row
        };
        for Taken { name, .. } in &first.processor {
            let bytes = bytes_per_pixel(name, settings.gather.frames as usize, settings.wavelet.levels as usize);
            table.rows.push(row(name, &|taken| of(taken, name), bytes));
        }
        table.rows.push(row("sum", &sum, None));
        text.push_str(&format!("{size}, processor time of a frame, and its time by the clock\n\n{table}\n"));
        for column in &columns {
            let (threads, clock) = (column.threads, sum(&column.clock));
            text.push_str(&format!("by the clock, {threads} threads: {:.1} ms a frame\n", clock * 1e3));
        }
        if let Some(own) = &beside {
            text.push_str(&format!("\n{}\n", rivals.table(own)));
        }
        let on_device = device::measure(backend, size, settings, args)?;
        if let Some(measured) = &on_device {
            text.push_str(&format!("\n{measured}"));
        }
        let peak = peak_memory();
        if let Some(peak) = peak {
            text.push_str(&format!(
                "peak memory of the process so far: {:.2} GiB\n",
                peak as f64 / (1u64 << 30) as f64
            ));
        }
        text.push('\n');
        let stages = |column: &[Taken]| {
            column.iter().map(|t| (t.name.to_owned(), json!(t.seconds * 1e3))).collect::<Map<_, _>>()
        };
        runs.push(json!({
            "size": size.to_string(),
            "peak_memory_bytes": peak,
            "against": beside.as_ref().map(|own| rivals.json(own)),
            "device": on_device.as_ref().map(device::Measured::json),
            "threads": columns.iter().map(|column| json!({
                "threads": column.threads,
                "processor_ms": stages(&column.processor),
                "clock_ms": sum(&column.clock) * 1e3,
                "clock_ms_of_stages": stages(&column.clock),
            })).collect::<Vec<_>>(),
        }));
    }
    text.push_str(&format!(
        "{PLANES} colour planes with light; ns/pixel: on one thread. floor: the least that a stage must read and write, each value \
         once, at the {:.1} GB/s that copying reaches with all threads.",
        bandwidth.gigabytes_a_second
    ));
    let further = Map::from_iter([("sequence".to_owned(), json!(runs))]);
    context.finish(&report, further, &text)
}

/// What each stage takes of a frame whose window is whole, in a pool of so many threads.
fn measure(size: Size, settings: &SequenceSettings, count: usize, threads: usize) -> Result<Column, Failure> {
    let mut processor = stages(size, settings, count, || pool_seconds().unwrap_or(0.0))?;
    processor.retain(|t| t.seconds > 0.0);
    let clock = stages(size, settings, count, wall)?;
    Ok(Column { threads, processor, clock })
}

fn wall() -> f64 {
    static BEGIN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    BEGIN.get_or_init(Instant::now).elapsed().as_secs_f64()
}

fn stages(size: Size, settings: &SequenceSettings, count: usize, clock: fn() -> f64) -> Result<Vec<Taken>, Failure> {
    let mut denoiser = SequenceDenoiser::new(settings.clone())?;
    denoiser.time_stages(clock);
    let reach = denoiser.reach();
    let (mut preparing, frames) = (0.0, 2 * reach + count);
    for t in 0..frames {
        if interrupt::asked() {
            return Err(Failure::Interrupted(format!("after {t} of {frames} frames")));
        }
        let frame = cycles::frame(t as i64, size);
        let begin = clock();
        let frame = PreparedFrame::new(frame, settings)?;
        preparing += clock() - begin;
        // Those before and behind only help.
        denoiser.push_to(frame, t >= reach && t < reach + count, &mut |_| true)?;
    }
    let mut taken = vec![Taken { name: "prepare", seconds: preparing / frames as f64 }];
    let each = |(name, seconds, calls): (&'static str, f64, usize)| Taken { name, seconds: seconds / calls as f64 };
    taken.extend(denoiser.take_stage_times().into_iter().map(each));
    Ok(taken)
}

/// What one frame takes.
#[derive(Clone, Copy, Default)]
pub(super) struct Cost {
    /// Processor seconds of the process, and seconds by the clock.
    pub(super) processor: f64,
    pub(super) clock: f64,
}

impl Cost {
    /// Of `work`.
    pub(super) fn of<T>(work: impl FnOnce() -> T) -> (T, Self) {
        let (processor, clock) = (process_seconds().unwrap_or(0.0), wall());
        let done = work();
        (done, Self { processor: process_seconds().unwrap_or(0.0) - processor, clock: wall() - clock })
    }

    /// Medians, of either by itself.
    pub(super) fn median(costs: &[Self]) -> Self {
        let middle = |of: &dyn Fn(&Self) -> f64| {
            let mut sorted: Vec<f64> = costs.iter().map(of).collect();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
        };
        Self { processor: middle(&|c| c.processor), clock: middle(&|c| c.clock) }
    }
}

/// Other denoisers, and what each frame took.
#[derive(Default)]
struct Others {
    each: Vec<(&'static str, Prefiltered, Vec<Cost>)>,
}

impl Others {
    fn oidn(size: Size) -> Result<Self, Failure> {
        let named = [("fast", Quality::Fast), ("balanced", Quality::Balanced), ("high", Quality::High)];
        let open = |(name, quality)| Ok((name, Prefiltered::open(size, quality)?, Vec::new()));
        Ok(Self { each: named.into_iter().map(open).collect::<Result<_, Failure>>()? })
    }

    /// Every one filters the frame; one's first frame, in which it builds its filter, does not count.
    fn filter(&mut self, frame: &SequenceFrame) -> Result<(), Failure> {
        let colour = frame.beauty();
        let black = || Plane::filled(frame.size, [0.0; 3]);
        let albedo = frame.lights.first().and_then(|light| light.weight.as_deref()).cloned().unwrap_or_else(black);
        let normal = frame.normal.clone().unwrap_or_else(black);
        for (_, denoiser, costs) in &mut self.each {
            if costs.is_empty() {
                denoiser.denoise(&colour, &albedo, &normal)?;
            }
            let (done, cost) = Cost::of(|| denoiser.denoise(&colour, &albedo, &normal));
            done?;
            costs.push(cost);
        }
        Ok(())
    }

    /// Each with its medians.
    fn medians(&self) -> impl Iterator<Item = (&'static str, Cost)> {
        self.each.iter().map(|(name, _, costs)| (*name, Cost::median(costs)))
    }

    fn table(&self, own: &Cost) -> Table {
        let words = ["a frame, all threads", "processor ms", "ms by the clock", "quell: processor", "quell: clock"];
        let mut table = Table { head: words.map(str::to_owned).to_vec(), rows: Vec::new() };
        let ms = |seconds: f64| format!("{:.1}", seconds * 1e3);
        let ratio = |a: f64, b: f64| if b > 0.0 { format!("{:.2} times", a / b) } else { "-".to_owned() };
        let mut row = |name: String, cost: &Cost, ratios: [String; 2]| {
            let [processor, clock] = ratios;
            table.rows.push(vec![name, ms(cost.processor), ms(cost.clock), processor, clock]);
        };
        row("quell".to_owned(), own, [String::new(), String::new()]);
        for (name, cost) in self.medians() {
            let ratios = [ratio(own.processor, cost.processor), ratio(own.clock, cost.clock)];
            row(format!("Open Image Denoise, {name}, feature buffers filtered first"), &cost, ratios);
        }
        table
    }

    fn json(&self, own: &Cost) -> serde_json::Value {
        let cost = |cost: &Cost| json!({ "processor_ms": cost.processor * 1e3, "clock_ms": cost.clock * 1e3 });
        let others = self.medians().map(|(name, found)| (format!("oidn:{name}"), cost(&found)));
        json!({ "quell": cost(own), "others": others.collect::<Map<_, _>>() })
    }
}

/// What quell takes of a frame whose window is whole, on all threads, with the others on the same frames in turn.
fn compare(size: Size, settings: &SequenceSettings, count: usize, others: &mut Others) -> Result<Cost, Failure> {
    let denoiser = SequenceDenoiser::new(settings.clone())?;
    steady(denoiser, settings, (size, count.max(LEAST_COMPARED)), |frame| others.filter(frame))
}

/// What `denoiser` takes of each of `count` frames whose window is whole, on all threads, in the median. `before`: called with every such frame.
pub(super) fn steady(
    mut denoiser: SequenceDenoiser,
    settings: &SequenceSettings,
    (size, count): (Size, usize),
    mut before: impl FnMut(&SequenceFrame) -> Result<(), Failure>,
) -> Result<Cost, Failure> {
    let reach = denoiser.reach();
    // The first frame that goes out makes the estimates around it; from then on each that comes in makes one, and one goes out.
    let (first, mut costs) = (2 * reach + 1, Vec::new());
    for t in 0..first + count {
        if interrupt::asked() {
            return Err(Failure::Interrupted(format!("after {t} frames")));
        }
        let frame = cycles::frame(t as i64, size);
        let whole = t >= first;
        if whole {
            before(&frame)?;
        }
        let (done, cost) = Cost::of(|| {
            let frame = PreparedFrame::new(frame, settings)?;
            denoiser.push_to(frame, t >= reach, &mut |_| true)
        });
        done?;
        if whole {
            costs.push(cost);
        }
    }
    Ok(Cost::median(&costs))
}

/// Bytes a pixel that a stage must read and write at least, each value once: halves and floats as they are kept.
fn bytes_per_pixel(stage: &str, around: usize, levels: usize) -> Option<usize> {
    // Surface, motion both ways, what mirrors show; light and the means that it is compared by.
    let (surface, motion, seen, light) = (28, 16, 12, 10 * PLANES);
    // Slopes, depth, normal, both noises; albedo and normal seen in mirrors.
    let local = 4 * (8 + 6);
    Some(match stage {
        "prepare" => surface + motion + seen + light + 2 * (12 * PLANES + 60),
        "reflection_motion" => 2 * (seen + motion) + motion,
        "gather" => (2 * around + 1) * (surface + motion + seen + light) + 20 * PLANES,
        "feature_noise" => surface + seen + local,
        "variance" => 24 * PLANES + local,
        "wavelet" => levels * (2 * 16 * PLANES + local),
        // Each of three levels reads light as it came and filtered, and writes the latter.
        "residual" => 3 * (6 + 12 + 12) * PLANES,
        "residual: picture" => 3 * (12 + 12 + 12),
        "recombine: sum" => 12 * PLANES + 6 * PLANES + 18 + 24,
        "stabilise: signature" => 12 + seen + 26,
        "blend: trajectories" => 5 * (24 + motion + surface) + 20,
        "stabilise" => 7 * (12 + 26 + motion + 4) + 20 + 12,
        "blend" => 3 * 12 + 20 + surface + seen + 2 * 12 + 4,
        "recombine: rescale" => 12 * PLANES + 36 + 12 * PLANES,
        _ => return None,
    })
}
