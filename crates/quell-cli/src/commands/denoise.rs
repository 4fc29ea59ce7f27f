//! `quell denoise`: an EXR sequence of any renderer, filtered.

use crate::args::DenoiseArgs;
use crate::args::denoise::{History, Passes};
use crate::args::ranges::Frames;
use crate::context::Context;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::{allocator, interrupt, output};
use quell::sequence::SequenceSettings;
use quell_frames::adapt::{AdaptOptions, FrameNoise, MotionChoice};
use quell_frames::driver::{Destination, Event, Existing, Fate, Job, JobOptions, Outcome, StageTime, Times, in_words};
use quell_frames::roles::MapOptions;
use quell_lab::report::{FrameStatus, Status};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Instant;

/// Said once where there are warnings.
const DOCTOR: &str = "`quell doctor` on the same frames explains more, and how to fix it";

pub fn run(context: &Context, settings: SequenceSettings, args: DenoiseArgs) -> Result<(), Failure> {
    let dry_run = args.dry_run;
    let chosen = context.backend()?;
    let accelerator = chosen.accelerator()?;
    let backend = chosen.on_this_processor();
    let measure_noise = context.verbose || context.json;
    let job =
        Job::open(JobOptions { backend, accelerator: accelerator.clone(), measure_noise, ..options(settings, args)? })?;
    // A dry run describes it anyway.
    if !dry_run {
        context.detail(job.mapping().trim_end());
    }
    for note in job.notes() {
        context.note(&format!("warning: {note}"));
    }
    if !job.notes().is_empty() {
        context.note(DOCTOR);
    }
    if dry_run {
        // What the run would refuse is refused now.
        job.measure(interrupt::flag())?;
        let text = job.describe();
        return context.finish(&report(context, &job, None, &[]), further(&job, None), &text);
    }
    if job.plan().wanted() == 0 && job.plan().missing.is_empty() {
        context.note("nothing to do: every frame is there already");
        return context.finish(&report(context, &job, None, &[]), further(&job, None), "");
    }
    output::check_folder(job.folder())?;
    // Bands are there because memory is short.
    if job.memory()?.bands > 1 {
        allocator::give_back_at_once();
    }
    let (outcome, warnings) = filter(context, &job)?;
    if let Some(accelerator) = accelerator {
        accelerator.notes(false).iter().for_each(|note| context.note(note));
        let refused = accelerator.notes(false);
        accelerator.notes(true).iter().filter(|note| !refused.contains(note)).for_each(|note| context.detail(note));
    }
    if job.notes().is_empty() && !warnings.is_empty() {
        context.note(DOCTOR);
    }
    finish(context, &job, &outcome, warnings)
}

/// From what the user typed to what the driver takes.
fn options(mut settings: SequenceSettings, args: DenoiseArgs) -> Result<JobOptions, Failure> {
    if args.history == History::Past {
        settings.gather.future = false;
    }
    if let Some(strength) = args.strength {
        settings.set("blend.strength", &strength.to_string())?;
    }
    let destination = Destination::parse(&args.output).map_err(Failure::Usage)?;
    let existing = match (args.skip_existing, args.resume, args.overwrite) {
        (true, ..) => Existing::Skip,
        (_, true, _) => Existing::Resume,
        (_, _, true) => Existing::Overwrite,
        _ => Existing::Ours,
    };
    let aliases = args.aliases.or_else(|| std::env::var_os("QUELL_ALIASES").filter(|v| !v.is_empty()).map(Into::into));
    let numbers = |frames: &Frames| frames.numbers().to_vec();
    Ok(JobOptions {
        inputs: args.inputs,
        destination,
        existing,
        frames: args.frames.as_ref().map(numbers),
        shot: args.shot.as_ref().map(numbers),
        cuts: args.cuts.map(|cuts| cuts.0),
        map: MapOptions { layer: args.view_layer, view: args.view, map: args.map, aliases, renderer: None },
        adapt: AdaptOptions {
            motion: match args.motion.as_deref() {
                None => MotionChoice::Renderer,
                Some("auto") => MotionChoice::Auto,
                Some("none") => MotionChoice::None,
                Some(name) => MotionChoice::Preset(name.to_owned()),
            },
            beauty_only: args.passes == Passes::Beauty,
            passes: match args.passes {
                Passes::List(names) => Some(names),
                Passes::All | Passes::Beauty => None,
            },
            noise_pass: args.noise_pass,
        },
        settings,
        max_memory: args.max_memory.map(|bytes| bytes.0),
        bands: None,
        backend: quell::Backend::default(),
        accelerator: None,
        measure_noise: false,
    })
}

/// Runs the job; what the user should know comes back, each sentence once.
fn filter(context: &Context, job: &Job) -> Result<(Outcome, Vec<String>), Failure> {
    let wanted = job.plan().wanted();
    let progress = Progress::new("frame", wanted, context.quiet);
    let begin = Instant::now();
    let heard: Mutex<(usize, Vec<String>)> = Mutex::default();
    let notify = |event: Event| {
        // Nothing in here panics, so the lock is never poisoned.
        let Ok(mut heard) = heard.lock() else { return };
        match event {
            Event::Read(_) => {}
            Event::Written(number) => {
                let done = heard.0;
                heard.0 += 1;
                let rate = (done + 1) as f64 / begin.elapsed().as_secs_f64().max(1e-6);
                let left = (wanted - heard.0.min(wanted)) as f64 / rate;
                progress.done_with(done, &format!("({number}), {rate:.2} frames a second, {left:.0} s left"));
            }
            Event::Band(band, bands) => {
                if !context.quiet {
                    progress.say(&format!("band {} of {bands}: frames are written after the last one", band + 1));
                }
            }
            Event::Cut(number) => {
                if !context.quiet {
                    progress.say(&format!("a new shot begins with frame {number}"));
                }
            }
            Event::Failed(number, reason) => {
                heard.0 += 1;
                progress.say(&format!("warning: frame {number} failed: {reason}"));
            }
            Event::Note(note) => {
                // The same of every frame is said once.
                let plain = |text: &str| text.replace(|c: char| c.is_ascii_digit(), "");
                if !heard.1.iter().any(|old| plain(old) == plain(&note)) {
                    if !context.quiet {
                        progress.say(&format!("warning: {note}"));
                    }
                    heard.1.push(note);
                }
            }
        }
    };
    let outcome = job.run(interrupt::flag(), &notify)?;
    drop(progress);
    let warnings = heard.into_inner().map(|heard| heard.1).unwrap_or_default();
    Ok((outcome, warnings))
}

/// The report, and how the run ended.
fn finish(context: &Context, job: &Job, outcome: &Outcome, warnings: Vec<String>) -> Result<(), Failure> {
    for line in noise(&outcome.noise) {
        context.detail(&line);
    }
    for line in costs(&outcome.times) {
        context.detail(&line);
    }
    if let Some(peak) = peak() {
        context.detail(&format!("memory    {} at the peak", in_words(peak)));
    }
    let written = outcome.written();
    let wanted = outcome.frames.len() + job.plan().missing.len();
    let summary = format!("{written} of {wanted} frames are written to {}", job.folder().display());
    let report = report(context, job, Some(outcome), &warnings);
    context.finish(&report, further(job, Some(outcome)), &summary)?;
    let failed = outcome.frames.iter().find_map(|(number, fate)| match fate {
        Fate::Failed(reason) => Some(format!("frame {number}: {reason}")),
        _ => None,
    });
    if outcome.ended.as_deref() == Some("") {
        return Err(Failure::Interrupted(format!("{summary}; nothing there is half written")));
    }
    let missing = job.plan().missing.first().map(|number| format!("frame {number}: there is no file of it"));
    match outcome.ended.clone().or(failed).or(missing) {
        None => Ok(()),
        Some(why) if written == 0 => Err(Failure::Failed(why)),
        Some(why) => Err(Failure::SomeFrames(format!("{why}; {summary}"))),
    }
}

/// How much noise was found and removed, frame by frame.
fn noise(frames: &[(i64, FrameNoise)]) -> Vec<String> {
    let line = |(number, noise): &(i64, FrameNoise)| {
        let removed = 1.0 - (noise.left / noise.found.max(1e-12)).powi(2);
        format!(
            "noise     frame {number}: {:.1} % of the brightness found, {:.1} % left ({:.0} % of its power removed)",
            100.0 * noise.found,
            100.0 * noise.left,
            100.0 * removed
        )
    };
    frames.iter().map(line).collect()
}

/// What the three steps cost, for a person.
fn costs(times: &Times) -> Vec<String> {
    let cores = rayon::current_num_threads();
    let line = |name: &str, stage: &StageTime| {
        let cpu = stage.cpu.map_or_else(|| "unknown".to_owned(), |cpu| format!("{cpu:.2}"));
        format!("{name:<9} {cpu:>9} processor seconds, {:.2} s by the clock", stage.busy)
    };
    let mut lines =
        vec![line("reading", &times.reading), line("filtering", &times.filtering), line("writing", &times.writing)];
    let bound = times.bound(cores).map_or_else(String::new, |bound| {
        format!(", {:.2} times the least for {cores} cores ({bound:.2} s)", times.wall / bound.max(1e-9))
    });
    lines.push(format!("together  {:.2} s by the clock{bound}", times.wall));
    lines
}

fn report(context: &Context, job: &Job, outcome: Option<&Outcome>, warnings: &[String]) -> quell_lab::report::Report {
    let mut report = context.sequence_report(job.settings());
    let mut frames: BTreeMap<i64, (Status, Option<String>)> = BTreeMap::new();
    for &number in job.done_before() {
        frames.insert(number, (Status::Skipped, Some("it was there already".to_owned())));
    }
    for &number in &job.plan().missing {
        frames.insert(number, (Status::Failed, Some("there is no file of it".to_owned())));
    }
    for (number, fate) in outcome.iter().flat_map(|outcome| &outcome.frames) {
        let status = match fate {
            Fate::Written => (Status::Done, None),
            Fate::Failed(reason) => (Status::Failed, Some(reason.clone())),
            Fate::Skipped => (Status::Skipped, Some("the run ended before".to_owned())),
        };
        frames.insert(*number, status);
    }
    report.frames = frames.into_iter().map(|(frame, (status, reason))| FrameStatus { frame, status, reason }).collect();
    report.warnings = job.notes().iter().chain(warnings).cloned().collect();
    report
}

/// The most memory that the process has held so far, where the system reports it.
fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? * 1024)
}

/// Fields beside those that every report has.
fn further(job: &Job, outcome: Option<&Outcome>) -> Map<String, Value> {
    let mut further = Map::new();
    further.insert("output".to_owned(), job.folder().to_string_lossy().into());
    further.insert("mapping".to_owned(), job.mapping().into());
    further.insert("reach".to_owned(), job.reach().into());
    if let Ok(memory) = job.memory() {
        let limit = memory.limit.map(|limit| limit.0);
        further.insert(
            "memory".to_owned(),
            json!({
                "bytes": memory.bytes,
                "whole_bytes": memory.whole,
                "bands": memory.bands,
                "limit_bytes": limit,
                "peak_bytes": peak(),
            }),
        );
    }
    if let Some(outcome) = outcome {
        let times = &outcome.times;
        let stage = |stage: &StageTime| json!({ "cpu_seconds": stage.cpu, "busy_seconds": stage.busy });
        let noise: Vec<Value> = (outcome.noise.iter())
            .map(|(frame, noise)| json!({ "frame": frame, "found": noise.found, "left": noise.left }))
            .collect();
        further.insert("noise".to_owned(), noise.into());
        further.insert("cuts".to_owned(), outcome.cuts.clone().into());
        further.insert(
            "times".to_owned(),
            json!({
                "reading": stage(&times.reading),
                "filtering": stage(&times.filtering),
                "writing": stage(&times.writing),
                "wall_seconds": times.wall,
                "bound_seconds": times.bound(rayon::current_num_threads()),
            }),
        );
    }
    further
}
