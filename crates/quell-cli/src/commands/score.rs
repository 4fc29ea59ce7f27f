//! `quell score`: frames that anything made, against references: picture metrics and the scorecard.

use crate::args::ScoreArgs;
use crate::context::Context;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Progress;
use quell::{FrameBuf, Plane, Rgb, Size};
use quell_frames::{FrameFile, read_frame};
use quell_lab::metrics::{Exposures, FrameScores, mean_scores};
use quell_lab::references::halves_rel_mse;
use quell_lab::report::MethodScores;
use quell_lab::report::json::NumberedScores;
use quell_lab::report::table::{Table, metrics_table};
use quell_lab::scorecard::{Instruments, ReferenceFrame, Scores};
use quell_lab::tone::Tone;
use serde_json::{Map, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Digits of a frame number in a file name.
const FRAME_DIGITS: usize = 4;
/// The first frames of a long sequence are its start, not its steady state.
const START_FRAMES: usize = 16;
/// Frames that must be left to score before the whole start is left out.
const LEAST_STEADY: usize = 8;
/// Light may differ by this factor before exposures are suspected.
const MOST_LIGHT: f64 = 1.25;
/// A reference's own error above this part of the result's limits the figures (docs/scorecard.md).
const NOTABLE_ERROR: f64 = 0.05;
/// Ghosting looks back so many frames, slow boiling half as many.
const LOOKS_BACK: usize = 8;

/// A sequence in memory; one entry a frame.
#[derive(Default)]
struct Loaded {
    numbers: Vec<i64>,
    pictures: Vec<Plane<Rgb>>,
    guides: Vec<FrameBuf>,
    /// Brightness that the first frame with guides is meant for.
    exposure: Option<f32>,
    references: Vec<Plane<Rgb>>,
    /// A and B; empty unless every reference has them.
    halves: Vec<[Plane<Rgb>; 2]>,
    /// Direct term of the references.
    direct: Vec<Option<Plane<Rgb>>>,
    notes: Vec<String>,
}

pub fn run(context: &Context, args: ScoreArgs) -> Result<(), Failure> {
    let results = frames_in(&args.results, &["denoised"])?;
    let references = frames_in(&args.reference, &["reference"])?;
    let guides = args.guides.as_ref().map(|folder| frames_in(folder, &["noisy"])).transpose()?;
    let loaded = load(context, &args, &results, &references, guides.as_ref())?;
    let warm_up = args.warm_up.map_or_else(|| default_warm_up(loaded.numbers.len()), |n| n as usize);
    if warm_up >= loaded.numbers.len() {
        let count = loaded.numbers.len();
        return Err(Failure::Usage(format!("--warm-up {warm_up} leaves nothing to score of {count} frames")));
    }
    score(context, &args, loaded, warm_up)
}

/// Frames that serve as the past only: the start of a long sequence, a third of a short one.
fn default_warm_up(count: usize) -> usize {
    if count >= START_FRAMES + LEAST_STEADY { START_FRAMES } else { count / 3 }
}

/// The files `STEM.0012.exr` of a folder, whatever their stem; or those of one of its subfolders named `below`.
fn frames_in(folder: &Path, below: &[&str]) -> Result<BTreeMap<i64, PathBuf>, Failure> {
    let mut found = stems(folder)?;
    if found.is_empty() {
        for name in below {
            let inner = folder.join(name);
            if inner.is_dir() {
                found = stems(&inner)?;
            }
        }
    }
    // Of a folder that holds more, the name that it would have.
    let preferred = below.iter().find(|name| found.contains_key(**name)).map(|name| (*name).to_owned());
    if found.len() > 1 && preferred.is_none() {
        let names = found.into_keys().collect::<Vec<_>>().join(", ");
        let place = folder.display();
        return Err(Failure::Failed(format!("{place} holds several sequences ({names}); put each in its own folder")));
    }
    let frames = match preferred {
        Some(name) => found.remove(&name),
        None => found.into_values().next(),
    };
    frames.ok_or_else(|| Failure::Failed(format!("{} holds no frames: no files like name.0001.exr", folder.display())))
}

/// Frames by stem and number.
fn stems(folder: &Path) -> Result<BTreeMap<String, BTreeMap<i64, PathBuf>>, Failure> {
    let wrong = |e: std::io::Error| Failure::Failed(format!("cannot list {}: {e}", folder.display()));
    let mut found: BTreeMap<String, BTreeMap<i64, PathBuf>> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(wrong)? {
        let path = entry.map_err(wrong)?.path();
        let parts = path.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_suffix(".exr")?.rsplit_once('.'));
        let Some((stem, digits)) = parts else { continue };
        if digits.trim_start_matches('-').len() < FRAME_DIGITS {
            continue;
        }
        if let Ok(number) = digits.parse() {
            found.entry(stem.to_owned()).or_default().insert(number, path.clone());
        }
    }
    Ok(found)
}

fn load(
    context: &Context,
    args: &ScoreArgs,
    results: &BTreeMap<i64, PathBuf>,
    references: &BTreeMap<i64, PathBuf>,
    guides: Option<&BTreeMap<i64, PathBuf>>,
) -> Result<Loaded, Failure> {
    let mut loaded = Loaded::default();
    let numbers = chosen(args, results, references, &mut loaded.notes)?;
    let progress = Progress::new("read frame", numbers.len(), context.quiet);
    let mut size: Option<Size> = None;
    let mut halves = Some(Vec::new());
    for (done, number) in numbers.into_iter().enumerate() {
        stop_if_asked()?;
        let (Some(result_path), Some(reference_path)) = (results.get(&number), references.get(&number)) else {
            continue;
        };
        let guide_path = match guides {
            None => reference_path,
            Some(guides) => guides.get(&number).ok_or_else(|| {
                let folder = args.guides.as_deref().unwrap_or(Path::new("")).display();
                Failure::Failed(format!("{folder} holds no guides of frame {number}"))
            })?,
        };
        let result = read_frame(result_path)?;
        let reference = read_frame(reference_path)?;
        let expected = *size.get_or_insert(reference.frame.size);
        same_size(result_path, result.frame.size, expected)?;
        same_size(reference_path, reference.frame.size, expected)?;
        let (result_exposure, exposure) = (result.metadata.exposure, reference.metadata.exposure);
        if result_exposure != exposure && done == 0 {
            loaded.notes.push(format!(
                "The result was made for exposure {result_exposure}, the reference for {exposure}; pictures are compared as \
                 they are."
            ));
        }
        loaded.pictures.push(result.composite.unwrap_or_else(|| result.frame.composite()));
        let FrameFile { frame, composite, halves: [a, b], .. } = reference;
        loaded.references.push(composite.unwrap_or_else(|| frame.composite()));
        match (a.composite, b.composite, &mut halves) {
            (Some(a), Some(b), Some(all)) => all.push([a, b]),
            _ => halves = None,
        }
        loaded.direct.push(frame.direct.clone());
        let (frame, exposure) = if guides.is_some() {
            let guide = read_frame(guide_path)?;
            same_size(guide_path, guide.frame.size, expected)?;
            (guide.frame, guide.metadata.exposure)
        } else {
            (frame, exposure)
        };
        loaded.exposure.get_or_insert(exposure);
        // Signals are not read again; memory is better spent on frames.
        loaded.guides.push(FrameBuf { matte: None, glossy: None, passes: Vec::new(), ..frame });
        loaded.numbers.push(number);
        progress.done(done);
    }
    drop(progress);
    loaded.halves = halves.unwrap_or_default();
    Ok(loaded)
}

fn stop_if_asked() -> Result<(), Failure> {
    if interrupt::asked() {
        return Err(Failure::Interrupted("nothing was written".to_owned()));
    }
    Ok(())
}

fn same_size(path: &Path, found: Size, expected: Size) -> Result<(), Failure> {
    if found == expected {
        return Ok(());
    }
    Err(Failure::Failed(format!("{} is {found}, but the first reference is {expected}", path.display())))
}

/// Numbers of the frames that have both, in one run without gaps.
fn chosen(
    args: &ScoreArgs,
    results: &BTreeMap<i64, PathBuf>,
    references: &BTreeMap<i64, PathBuf>,
    notes: &mut Vec<String>,
) -> Result<Vec<i64>, Failure> {
    let wanted = |n: &i64| args.frames.as_ref().is_none_or(|f| f.numbers().contains(n));
    let common: Vec<i64> = results.keys().filter(|n| references.contains_key(n)).copied().filter(wanted).collect();
    let range = |list: &BTreeMap<i64, PathBuf>| match (list.first_key_value(), list.last_key_value()) {
        (Some((first, _)), Some((last, _))) => format!("{first} to {last}"),
        _ => "none".to_owned(),
    };
    let (own, given) = (range(results), range(references));
    if common.is_empty() {
        return Err(Failure::Failed(format!(
            "no frame has a reference: frames of {} are {own}, of {} are {given}",
            args.results.display(),
            args.reference.display()
        )));
    }
    if args.frames.is_none() && (common.len() < results.len() || common.len() < references.len()) {
        notes.push(format!(
            "{} frames have a result and a reference: results are {} ({own}), references {} ({given}).",
            common.len(),
            results.len(),
            references.len()
        ));
    }
    let mut runs: Vec<Vec<i64>> = Vec::new();
    for number in common {
        match runs.last_mut() {
            Some(run) if run.last().is_some_and(|last| last.checked_add(1) == Some(number)) => run.push(number),
            _ => runs.push(vec![number]),
        }
    }
    let gaps = runs.len() > 1;
    // The longest; of equals the last, which is the steadiest.
    let run = runs.into_iter().max_by_key(Vec::len).unwrap_or_default();
    if let (true, Some(first), Some(last)) = (gaps, run.first(), run.last()) {
        notes.push(format!("Frames are missing in between: of the longest run, {first} to {last}, alone is scored."));
    }
    Ok(run)
}

fn score(context: &Context, args: &ScoreArgs, loaded: Loaded, warm_up: usize) -> Result<(), Failure> {
    let Loaded { numbers, pictures, guides, exposure, references, halves, direct, mut notes } = loaded;
    let count = numbers.len();
    let scored = warm_up..count;
    let tone = Tone { exposure: exposure.unwrap_or(1.0) };
    let with_depth = scored.clone().map(|t| (&references[t], guides[t].view_depth.as_ref()));
    let exposures = Exposures::from_reference(with_depth)?;
    let progress = Progress::new("measured frame", scored.len(), context.quiet);
    let mut frames = Vec::new();
    for (done, t) in scored.clone().enumerate() {
        let (scores, _) = FrameScores::measure(&pictures[t], &references[t], tone, &exposures)?;
        frames.push(NumberedScores { frame: numbers[t], scores });
        progress.done(done);
        stop_if_asked()?;
    }
    drop(progress);
    let all: Vec<FrameScores> = frames.iter().map(|f| f.scores).collect();
    let mean = mean_scores(&all);

    let made: Vec<ReferenceFrame<'_>> = (0..count)
        .map(|t| {
            let (a, b) = match halves.get(t) {
                Some([a, b]) => (a, Some(b)),
                None => (&references[t], None),
            };
            ReferenceFrame {
                b,
                a_direct: direct[t].as_ref(),
                b_direct: direct[t].as_ref(),
                scored: t >= warm_up,
                ..ReferenceFrame::new(&guides[t], a)
            }
        })
        .collect();
    let instruments = Instruments::new(&made)?;
    let card = instruments.score(&pictures)?;

    let range = |first: Option<&i64>, last: Option<&i64>| match (first, last) {
        (Some(first), Some(last)) if first != last => format!("{first} to {last}"),
        (Some(first), _) => first.to_string(),
        _ => String::new(),
    };
    let scored_frames = range(numbers.get(warm_up), numbers.last());
    if warm_up > 0 {
        let past = range(numbers.first(), numbers.get(warm_up - 1));
        notes.push(format!("Frames {scored_frames} are scored; {past} serve as their past."));
    }
    if count <= LOOKS_BACK {
        notes.push(format!(
            "{count} frame{}: ghosting looks back up to {LOOKS_BACK} frames, slow boiling {}; what that leaves out is null or \
             too low.",
            if count == 1 { "" } else { "s" },
            LOOKS_BACK / 2
        ));
    }
    if guides.iter().all(|g| g.view_depth.is_none() && g.motion.is_none()) {
        notes.push(
            "The guides hold neither depth nor motion: surfaces cannot be followed. Give others with --guides.".into(),
        );
    } else if instruments.is_static() && count > 1 {
        notes.push("Nothing moves in this sequence: there is no ghosting and nothing fresh to measure.".to_owned());
    }
    light_note(&pictures, &references, &mut notes);
    reference_note(&halves, warm_up, mean.as_ref(), &mut notes);

    let name = args.name.clone().unwrap_or_else(|| folder_name(&args.results));
    let methods = [MethodScores { method: name, mean, frames }];
    let mut report = context.report();
    report.warnings.clone_from(&notes);
    let text = format!("{}\n{}\n{}", metrics_table(&methods), scorecard_table(&card), notes.join("\n"));
    report.metrics = methods.into();
    let mut further = Map::new();
    let wrong = |e: serde_json::Error| Failure::Failed(format!("cannot write the report as JSON: {e}"));
    further.insert("scorecard".to_owned(), serde_json::to_value(&card).map_err(wrong)?);
    further.insert(
        "scored".to_owned(),
        json!({
            "frames": &numbers[warm_up..],
            "warm_up": &numbers[..warm_up],
            "halves": instruments.has_halves(),
            "hdr_flip_stops": [exposures.start, exposures.stop],
            "tone_exposure": tone.exposure,
        }),
    );
    context.finish(&report, further, &text)
}

fn folder_name(folder: &Path) -> String {
    let name = folder.canonicalize().ok().and_then(|p| Some(p.file_name()?.to_string_lossy().into_owned()));
    name.unwrap_or_else(|| folder.display().to_string())
}

/// A factor between both is another exposure, or another scene.
fn light_note(pictures: &[Plane<Rgb>], references: &[Plane<Rgb>], notes: &mut Vec<String>) {
    let sum = |planes: &[Plane<Rgb>]| -> f64 {
        let values = planes.iter().flat_map(|p| p.data().iter().flatten());
        values.map(|v| f64::from(*v)).filter(|v| v.is_finite()).sum()
    };
    let ratio = sum(pictures) / sum(references);
    if ratio.is_finite() && !(1.0 / MOST_LIGHT..=MOST_LIGHT).contains(&ratio) {
        notes.push(format!(
            "The result holds {ratio:.3} of the references' light: have both the same exposure, scene and camera? The figures \
             are of little use otherwise."
        ));
    }
}

/// What the references' own noise does to the figures.
fn reference_note(halves: &[[Plane<Rgb>; 2]], warm_up: usize, mean: Option<&FrameScores>, notes: &mut Vec<String>) {
    if halves.is_empty() {
        notes.push(
            "The references have no halves: their own noise is in every figure, and floors say how much it may explain."
                .to_owned(),
        );
        return;
    }
    let errors: Vec<f64> = halves.iter().skip(warm_up).map(|[a, b]| halves_rel_mse(a, b)).collect();
    let own = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    let found = mean.map_or(0.0, |m| m.rel_mse_trimmed);
    notes.push(if own > NOTABLE_ERROR * found {
        let share = 100.0 * own / found.max(f64::MIN_POSITIVE);
        format!(
            "The references are noisy: their own trimmed relMSE of {own:.2e} is {share:.0} % of the result's and limits the \
             picture metrics. The scorecard's halves cancel it; give references of more samples."
        )
    } else {
        format!("The references' own trimmed relMSE is {own:.2e} (from their halves).")
    });
}

fn scorecard_table(scores: &Scores) -> Table {
    let floors = scores.iter().any(|(_, s)| s.floor.is_some());
    let mut table = Table { head: vec!["score".to_owned(), "value".to_owned()], rows: Vec::new() };
    if floors {
        table.head.push("floor".to_owned());
    }
    let number = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.4}"));
    for (name, score) in scores.iter() {
        let mut row = vec![name.replace('_', " "), number(score.value)];
        if floors {
            row.push(number(score.floor));
        }
        table.rows.push(row);
    }
    table
}
