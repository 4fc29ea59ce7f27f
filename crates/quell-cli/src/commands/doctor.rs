//! `quell doctor`: what is wrong with a sequence, and how to fix it.

use crate::args::DoctorArgs;
use crate::context::Context;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::{interrupt, output};
use quell_frames::adapt::MotionChoice;
use quell_frames::doctor::{Diagnosis, DoctorOptions, Finding, Severity, examine};
use quell_frames::driver::ranges;
use quell_frames::roles::MapOptions;
use quell_lab::report::doctor as page;
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

/// Pairs of frames that the page shows.
const EXHIBITS: usize = 3;
/// Characters of a line of text.
const WIDTH: usize = 110;

pub fn run(context: &Context, args: DoctorArgs) -> Result<(), Failure> {
    if let Some(html) = &args.html {
        output::check_file(html)?;
        output::check_page(html)?;
    }
    let known = |name: &String| quell_frames::doctor::CHECKS.iter().any(|c| c == name);
    if let Some(unknown) = args.ignore.iter().find(|name| !known(name)) {
        let all = quell_frames::doctor::CHECKS.join(", ");
        return Err(Failure::Usage(format!("`{unknown}` is no check; there are {all}")));
    }
    let (ignore, html) = (args.ignore.clone(), args.html.clone());
    let found = look(context, options(args))?;
    context.detail(found.mapping.trim_end());
    if let Some(html) = &html {
        page::write(html, &found, &context.command)?;
    }
    let text = text(context, &found, html.as_deref());
    context.finish(&context.report(), further(&found, html.as_deref()), &text)?;
    let faults: Vec<&Finding> = found
        .findings
        .iter()
        .filter(|f| f.severity == Severity::Fault && !ignore.iter().any(|i| i == f.check))
        .collect();
    if faults.is_empty() { Ok(()) } else { Err(Failure::Faults) }
}

fn options(args: DoctorArgs) -> DoctorOptions {
    let aliases = args.aliases.or_else(|| std::env::var_os("QUELL_ALIASES").filter(|v| !v.is_empty()).map(Into::into));
    DoctorOptions {
        inputs: args.inputs,
        frames: args.frames.map(|frames| frames.numbers().to_vec()),
        map: MapOptions { layer: args.view_layer, view: args.view, map: args.map, aliases, renderer: None },
        motion: match args.motion.as_deref() {
            None => MotionChoice::Renderer,
            Some("auto") => MotionChoice::Auto,
            Some("none") => MotionChoice::None,
            Some(name) => MotionChoice::Preset(name.to_owned()),
        },
        exhibits: if args.html.is_some() { EXHIBITS } else { 0 },
    }
}

fn look(context: &Context, options: DoctorOptions) -> Result<Diagnosis, Failure> {
    let progress: Mutex<Option<Progress>> = Mutex::new(None);
    let notify = |done: usize, of: usize| {
        // Nothing in here panics, so the lock is never poisoned.
        let Ok(mut progress) = progress.lock() else { return };
        let progress = progress.get_or_insert_with(|| Progress::new("frame", of, context.quiet));
        progress.done_with(done, "");
    };
    let stop = interrupt::flag();
    let found = examine(&options, &notify, stop);
    if stop.load(Ordering::Relaxed) {
        return Err(Failure::Interrupted("nothing was examined to the end".to_owned()));
    }
    Ok(found?)
}

/// What a person reads.
fn text(context: &Context, found: &Diagnosis, html: Option<&Path>) -> String {
    let mut text = String::new();
    let out = &mut text;
    // Writing to a string never fails.
    let _ = writeln!(out, "{}", summary(found));
    if let Some(line) = noise(found, context.verbose) {
        paragraph(out, "noise", &line);
    }
    for f in &found.findings {
        let place = [f.layer.clone(), f.frame.map_or_else(String::new, |n| format!("frame {n}")), f.channel.clone()];
        let place: Vec<String> = place.into_iter().filter(|p| !p.is_empty()).collect();
        let _ = writeln!(out, "\n{:<8} {:<20} {}", f.severity.name().to_uppercase(), f.check, place.join(", "));
        paragraph(out, "", &f.what);
        for (word, sentence) in [("evidence", &f.evidence), ("spoils", &f.spoils), ("fix", &f.remedy)] {
            if !sentence.is_empty() {
                paragraph(out, word, sentence);
            }
        }
    }
    if !found.not_examined.is_empty() {
        let _ = writeln!(out);
        for n in &found.not_examined {
            paragraph(out, "", &format!("could not examine {}, because {}", n.what, n.why));
        }
    }
    let _ = writeln!(out);
    if context.verbose {
        for p in &found.passed {
            let _ = writeln!(out, "good     {:<20} {}", p.check, p.text);
        }
    }
    let count = |severity, one: &str| {
        let n = found.count(severity);
        format!("{n} {one}{}", if n == 1 { "" } else { "s" })
    };
    let _ = writeln!(
        out,
        "{}, {}, {}; {} checks passed{}",
        count(Severity::Fault, "fault"),
        count(Severity::Warning, "warning"),
        count(Severity::Note, "note"),
        found.passed.len(),
        if context.verbose || found.passed.is_empty() { "" } else { " (-v lists them)" }
    );
    if let Some(html) = html {
        let _ = writeln!(out, "{}", output::file_url(html));
    }
    text
}

/// How much noise there is: of the picture, and where wanted of each light.
fn noise(found: &Diagnosis, all: bool) -> Option<String> {
    let percent =
        |share: f64| if share < 0.1 { format!("{:.1} %", 100.0 * share) } else { format!("{:.0} %", 100.0 * share) };
    let name = |pass: &str| if pass.is_empty() { "the picture".to_owned() } else { format!("`{pass}`") };
    let shown = found.noise.iter().take(if all { usize::MAX } else { 1 });
    let parts: Vec<String> =
        shown.map(|level| format!("{} of {}", percent(level.relative), name(&level.pass))).collect();
    (!parts.is_empty()).then(|| format!("deviates by {} (median over pixels)", parts.join(", ")))
}

fn summary(found: &Diagnosis) -> String {
    let size = found.display.map_or_else(String::new, |w| format!(", {}x{}", w.size.width, w.size.height));
    let renderer = if found.renderer.is_empty() { String::new() } else { format!(", {}", found.renderer) };
    let looked = if found.examined.is_empty() {
        "; no pixels were looked at".to_owned()
    } else {
        format!("; pixels of {} were looked at", ranges(&found.examined))
    };
    let frames =
        if found.frames.is_empty() { "no frames".to_owned() } else { format!("frames {}", ranges(&found.frames)) };
    format!("{frames}{size}{renderer}{looked}")
}

/// A sentence in lines of at most `WIDTH` characters, set in behind a word.
fn paragraph(out: &mut String, word: &str, sentence: &str) {
    let mut line = format!("  {word:<9}");
    let mut empty = true;
    for part in sentence.split_whitespace() {
        if !empty && line.chars().count() + 1 + part.chars().count() > WIDTH {
            let _ = writeln!(out, "{}", line.trim_end());
            line = " ".repeat(11);
            empty = true;
        }
        if !empty {
            line.push(' ');
        }
        line.push_str(part);
        empty = false;
    }
    let _ = writeln!(out, "{}", line.trim_end());
}

/// Fields beside those that every report has.
pub fn further(found: &Diagnosis, html: Option<&Path>) -> Map<String, Value> {
    let findings: Vec<Value> = (found.findings.iter())
        .map(|f| {
            let figures: Vec<Value> =
                f.figures.iter().map(|g| json!({ "name": g.name, "value": g.value, "unit": g.unit })).collect();
            json!({
                "check": f.check, "severity": f.severity.name(), "layer": f.layer, "frame": f.frame, "channel": f.channel,
                "what": f.what, "evidence": f.evidence, "figures": figures, "spoils": f.spoils, "remedy": f.remedy,
            })
        })
        .collect();
    let passed: Vec<Value> = found.passed.iter().map(|p| json!({ "check": p.check, "text": p.text })).collect();
    let not: Vec<Value> = found.not_examined.iter().map(|n| json!({ "what": n.what, "why": n.why })).collect();
    let mut further = Map::new();
    further.insert("findings".to_owned(), findings.into());
    further.insert("passed".to_owned(), passed.into());
    further.insert("not_examined".to_owned(), not.into());
    let noise: Vec<Value> =
        found.noise.iter().map(|n| json!({ "pass": n.pass, "relative_deviation": n.relative })).collect();
    further.insert("noise".to_owned(), noise.into());
    further.insert("worst".to_owned(), found.worst().map(Severity::name).into());
    further.insert("frames_found".to_owned(), found.frames.clone().into());
    further.insert("frames_examined".to_owned(), found.examined.clone().into());
    further.insert("renderer".to_owned(), found.renderer.clone().into());
    further.insert("mapping".to_owned(), found.mapping.clone().into());
    if let Some(html) = html {
        further.insert("page".to_owned(), html.to_string_lossy().into());
    }
    further
}
