//! `quell compare`: methods side by side on identical frames.
//!
//! ```text
//! mod.rs       from the command line to the report
//! source.rs    where frames and references come from: a scene, or a folder
//! contest.rs   every method over the frames of one seed, measured
//! summary.rs   figures over seeds
//! page.rs      the page
//! crops.rs     parts of pictures as PNG
//! ```

pub mod contest;
mod crops;
mod page;
mod source;
mod summary;

use crate::args::CompareArgs;
use crate::args::compare::Format;
use crate::context::Context;
use crate::failure::Failure;
use crate::output;
use contest::Contest;
use quell_lab::compare::judge;
use quell_lab::methods::external::Competitor;
use quell_lab::methods::parse;
use quell_lab::report::figures::{self, ComparedMethod};
use quell_lab::report::{FrameStatus, MethodScores, Report, Status};
use serde_json::{Map, Value};
use source::Source;
use std::path::Path;

/// What is compared by default, as far as this version has it and it runs on the frames.
const USUAL: [&str; 8] = ["none", "temporal", "quell:quality", "quell:paper", "atrous", "svgf", "nlm", "oidn:high"];

pub fn run(context: &Context, args: CompareArgs) -> Result<(), Failure> {
    context.prefers_cpu();
    context.backend()?;
    if context.method().contains("changed") {
        return Err(Failure::Usage(
            "--set and --settings belong to one denoiser; in a comparison write --methods \
             quell:paper+stage.parameter=value"
                .to_owned(),
        ));
    }
    let source = Source::new(context, &args)?;
    let competitors = competitors(&args.methods, source.has_halves())?;
    for crop in &args.crop {
        if let Some(size) = source.size() {
            crops::check(crop, size)?;
        }
    }
    output::check_folder(&args.output)?;
    output::check_page(&args.output.join("index.html"))?;

    let mut contests: Vec<Contest> = Vec::new();
    for turn in 0..u64::from(args.seeds) {
        let folder = match turn {
            0 => args.output.clone(),
            _ => args.output.join(format!("seed-{}", args.sampling.seed.wrapping_add(turn))),
        };
        // Finished frames in a folder belong to one seed.
        let takes_part = |c: &&Competitor| turn == 0 || !matches!(c, Competitor::Frames { .. });
        let now: Vec<Competitor> = competitors.iter().filter(takes_part).cloned().collect();
        if args.seeds > 1 {
            context.note(&format!("seed {} ({} of {})", args.sampling.seed.wrapping_add(turn), turn + 1, args.seeds));
        }
        let sequence = source.load(context, turn, &folder)?;
        contests.push(Contest::hold(context, sequence, &now, &folder, turn == 0)?);
    }
    let methods = summary::methods(&contests);
    let Some(first) = contests.first() else { return Ok(()) };
    if methods.iter().all(|m| m.mean.is_none()) {
        let reasons: Vec<String> =
            methods.iter().filter_map(|m| Some(format!("{}: {}", m.method, m.reason.as_ref()?))).collect();
        return Err(Failure::Failed(format!("no method could be measured; {}", reasons.join("; "))));
    }
    let best = methods.iter().filter_map(|m| m.value("rel_mse_trimmed")).reduce(f64::min);
    let mut notes = judge::caveats(&first.sequence, best)?;
    notes.extend(first.sequence.notes.iter().cloned());
    notes.extend(first.notes());
    if args.seeds > 1 {
        notes.push(format!(
            "Figures are means over {} seeds from {} on; behind ± half the 95 % interval (Student's t). References are \
             the same for all.",
            args.seeds, args.sampling.seed
        ));
    }
    for crop in &args.crop {
        crops::write(crop, first, &args.output.join("crops"))?;
    }
    let page = args.output.join("index.html");
    notes.extend(page::write(&page, first, &methods, &notes, &context.command)?);
    finish(context, &args, first, methods, notes)
}

/// Report, CSV, what is printed.
fn finish(
    context: &Context,
    args: &CompareArgs,
    first: &Contest,
    methods: Vec<ComparedMethod>,
    notes: Vec<String>,
) -> Result<(), Failure> {
    let csv = figures::csv(&methods);
    quell_frames::files::write_bytes(&args.output.join("scores.csv"), csv.as_bytes())?;
    let url = output::file_url(&args.output.join("index.html"));
    let printed = match args.format {
        Format::Csv => csv,
        Format::Latex => figures::latex(&methods),
        Format::Text => {
            let mut text = figures::text(&methods);
            for note in &notes {
                text.push_str(&format!("{note}\n"));
            }
            text.push_str(&format!("report.json and scores.csv in {}\n{url}\n", args.output.display()));
            text
        }
    };
    let mut report = context.report();
    report.settings.retain(|name, _| !name.contains('.'));
    report.settings.extend(settings(args, first));
    report.frames = statuses(first);
    report.metrics = methods
        .iter()
        .filter(|m| m.mean.is_some())
        .map(|m| MethodScores { method: m.method.clone(), mean: m.mean, frames: m.frames.clone() })
        .collect();
    report.warnings = methods.iter().filter_map(|m| Some(format!("{}: {}", m.method, m.reason.as_ref()?))).collect();
    report.methods = methods;
    let mut further = Map::new();
    further.insert("page".to_owned(), url.into());
    further.insert("output".to_owned(), args.output.to_string_lossy().into());
    further.insert("scored".to_owned(), first.sequence.scored.clone().into());
    further.insert("notes".to_owned(), notes.into());
    write_report(&args.output.join("report.json"), &report, &further)?;
    context.finish(&report, further, &printed)
}

fn write_report(path: &Path, report: &Report, further: &Map<String, Value>) -> Result<(), Failure> {
    let json = crate::context::with_further(report, further.clone())?;
    Ok(quell_frames::files::write_bytes(path, json.as_bytes())?)
}

fn settings(args: &CompareArgs, first: &Contest) -> Vec<(String, Value)> {
    let sequence = &first.sequence;
    let own: Vec<(&str, Value)> = vec![
        ("source", args.source.clone().into()),
        ("sequence", sequence.name.clone().into()),
        ("sampling", sequence.description.clone().into()),
        ("size", sequence.size.to_string().into()),
        ("seed", args.sampling.seed.into()),
        ("seeds", args.seeds.into()),
        ("spp", args.sampling.spp.into()),
        ("reference_spp", args.reference_spp.into()),
        ("reference_error", sequence.reference_error().into()),
        ("exposure", f64::from(sequence.tone.exposure).into()),
    ];
    own.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Every frame of the sequence was there for every method; what is scored the field `scored` says.
fn statuses(first: &Contest) -> Vec<FrameStatus> {
    first.sequence.numbers.iter().map(|&frame| FrameStatus { frame, status: Status::Done, reason: None }).collect()
}

/// From the lists that the user gave; each name once.
fn competitors(lists: &[String], halves: bool) -> Result<Vec<Competitor>, Failure> {
    let mut all: Vec<Competitor> = Vec::new();
    if lists.is_empty() {
        for name in USUAL {
            let known = match parse(name) {
                Err(quell_lab::Error::UnknownMethod { .. }) => false,
                Ok(method) => halves || !method.needs_halves(),
                // Its library is absent: the table says so.
                Err(_) => true,
            };
            if known {
                all.push(Competitor::Method { name: name.to_owned() });
            }
        }
        return Ok(all);
    }
    for list in lists {
        for one in Competitor::list(list)? {
            if all.iter().any(|other| other.name() == one.name()) {
                return Err(Failure::Usage(format!("--methods names `{}` twice", one.name())));
            }
            all.push(one);
        }
    }
    if all.is_empty() {
        return Err(Failure::Usage("--methods names nothing to compare".to_owned()));
    }
    Ok(all)
}
