//! `quell reproduce`: the talk's tables and figures, from the built-in scenes, on one page.

use super::bench;
use super::compare::contest::{Counted, program};
use crate::args::{ReproduceArgs, ReproducePart};
use crate::context::Context;
use crate::failure::Failure;
use crate::{interrupt, output};
use quell_lab::cache::Cache;
use quell_lab::report::document::{Document, Section, write};
use quell_lab::reproduce::{View, Workshop, ablations, offline, paths};
use quell_trace::{Scene, builtin};
use serde_json::{Map, Value};

/// Stand-ins for the talk's five scenes.
const OFFLINE_SCENES: [&str; 5] = ["cornell-box", "glossy-room", "mirror-hall", "disocclusion", "lights-out"];
/// Where the talk's artefacts show.
const ABLATION_SCENES: [&str; 3] = ["glossy-room", "disocclusion", "mirror-hall"];
/// Where more paths are compared with a filter.
const PATHS_SCENES: [&str; 2] = ["glossy-room", "disocclusion"];
/// The frame that is filtered offline: lamps and objects are where they are seen well.
const OFFLINE_FRAME: i64 = 24;

pub fn run(context: &Context, args: ReproduceArgs) -> Result<(), Failure> {
    output::check_folder(&args.output)?;
    let page = args.output.join("index.html");
    output::check_page(&page)?;
    let wanted = |part: ReproducePart| args.only.is_empty() || args.only.contains(&part);
    let cache = Cache::default_place();
    let told = |what: &str| context.note(what);
    let program = program();
    let shop = Workshop {
        folder: &args.output,
        cache: cache.as_ref(),
        program: &program,
        memory: &Counted,
        cancel: Some(interrupt::flag()),
        told: &told,
    };
    let reference_samples = args.reference_spp.div_ceil(2);
    let view = View { size: args.size, camera: args.camera, seed: args.seed, reference_samples };
    let frames: Vec<i64> = (0..i64::from(args.count)).collect();
    let mut sections: Vec<Section> = Vec::new();
    let mut further = Map::new();
    let mut report = context.report();
    if wanted(ReproducePart::Stages) {
        told("stage times");
        let (section, stages) = bench::section(context, args.stages_size)?;
        sections.push(section);
        report.stages = stages;
    }
    if wanted(ReproducePart::Offline) {
        let view = View { size: args.offline_size.unwrap_or(args.size), ..view };
        let scenes = scenes(&OFFLINE_SCENES, args.camera)?;
        let part = offline::offline(&shop, &scenes, &view, OFFLINE_FRAME).map_err(interrupted)?;
        further.insert("offline".to_owned(), json(&part.rows)?);
        sections.push(part.section);
    }
    if wanted(ReproducePart::Ablations) {
        let scenes = scenes(&ABLATION_SCENES, args.camera)?;
        let part = ablations::ablations(&shop, &scenes, &view, &frames).map_err(interrupted)?;
        further.insert("ablations".to_owned(), json(&part.rows)?);
        sections.push(part.section);
    }
    if wanted(ReproducePart::Paths) {
        let scenes = scenes(&PATHS_SCENES, args.camera)?;
        let part = paths::paths(&shop, &scenes, &view, &frames).map_err(interrupted)?;
        further.insert("paths".to_owned(), json(&part.rows)?);
        sections.push(part.section);
    }
    let mut text = String::new();
    for section in &sections {
        for (caption, table) in &section.tables {
            text.push_str(&format!("{caption}\n{table}\n"));
        }
        for note in &section.notes {
            text.push_str(&format!("{note}\n"));
        }
    }
    let document = Document {
        title: "Mara et al. 2017, reproduced".to_owned(),
        subtitle: format!(
            "Built-in scenes stand in for the talk's; {} threads, {}",
            report.machine.threads, report.machine.instruction_set
        ),
        sections,
        command: context.command.clone(),
    };
    write(&page, &document)?;
    text.push_str(&output::file_url(&page));
    for (name, value) in [
        ("size", Value::from(args.size.to_string())),
        ("camera", args.camera.into()),
        ("seed", args.seed.into()),
        ("frames", args.count.into()),
        ("reference_spp", args.reference_spp.into()),
    ] {
        report.settings.insert(name.to_owned(), value);
    }
    further.insert("page".to_owned(), output::file_url(&page).into());
    context.finish(&report, further, &text)
}

fn scenes(names: &[&str], camera: usize) -> Result<Vec<Scene>, Failure> {
    let scenes = names.iter().map(|name| builtin(name)).collect::<Result<Vec<_>, _>>()?;
    match scenes.iter().find(|s| !(1..=s.cameras.len()).contains(&camera)) {
        Some(scene) => Err(Failure::Usage(format!(
            "camera {camera} does not exist: scene `{}` has cameras 1 to {}",
            scene.name,
            scene.cameras.len()
        ))),
        None => Ok(scenes),
    }
}

fn json<R: serde::Serialize>(rows: &[R]) -> Result<Value, Failure> {
    serde_json::to_value(rows).map_err(|e| Failure::Failed(format!("cannot write the report as JSON: {e}")))
}

/// What was finished is kept: the same command goes on from there.
fn interrupted(error: quell_lab::Error) -> Failure {
    match error {
        quell_lab::Error::Trace(quell_trace::TraceError::Cancelled) => {
            Failure::Interrupted("the same command goes on from what is finished".to_owned())
        }
        other => other.into(),
    }
}
