//! `quell reproduce`: the talk's tables and figures, from built-in scenes or files, on one page.

use super::bench;
use super::compare::contest::{Counted, program};
use crate::args::scene::SceneArgs;
use crate::args::{ReproduceArgs, ReproducePart};
use crate::context::Context;
use crate::failure::Failure;
use crate::{interrupt, output, scene};
use quell_lab::cache::Cache;
use quell_lab::report::document::{Document, Section, write};
use quell_lab::reproduce::{View, Workshop, ablations, offline, paths};
use quell_trace::{Scene, builtin};
use serde_json::{Map, Value};
use std::path::Path;

/// Stand-ins for the talk's five scenes.
const OFFLINE_SCENES: [&str; 5] = ["cornell-box", "glossy-room", "mirror-hall", "disocclusion", "lights-out"];
/// Where the talk's artefacts show.
const ABLATION_SCENES: [&str; 3] = ["glossy-room", "disocclusion", "mirror-hall"];
/// Where more paths are compared with a filter.
const PATHS_SCENES: [&str; 2] = ["glossy-room", "disocclusion"];
/// The talk's scenes as files; the hall stands for the Horse Room.
const OFFLINE_FILES: [&str; 5] =
    ["cornell_box", "sponza_glossy", "modern_hall", "bathroom_salle_de_bain", "white_room"];
const PATHS_FILES: [&str; 2] = ["sponza_glossy", "white_room"];
/// Cameras by default: of built-in scenes one that nothing was fitted on, of files their first.
const BUILT_IN_CAMERA: usize = 4;
const FILE_CAMERA: usize = 1;
/// The frame that is filtered offline: lamps and objects are where they are seen well.
const OFFLINE_FRAME: i64 = 24;

pub fn run(context: &Context, args: ReproduceArgs) -> Result<(), Failure> {
    context.prefers_cpu();
    let backend = context.backend()?;
    output::check_folder(&args.output)?;
    let page = args.output.join("index.html");
    output::check_page(&page)?;
    let wanted = |part: ReproducePart| args.only.is_empty() || args.only.contains(&part);
    let cache = Cache::default_place();
    let notify = |what: &str| context.note(what);
    let program = program(&context.program);
    let on = context.tracer()?;
    let shop = Workshop {
        folder: &args.output,
        cache: cache.as_ref(),
        program: &program,
        backend,
        on: &on,
        memory: &Counted,
        cancel: Some(interrupt::flag()),
        notify: &notify,
    };
    let reference_samples = args.reference_spp.div_ceil(2);
    let camera = args.camera.unwrap_or(BUILT_IN_CAMERA);
    let view = View { size: args.size, camera, seed: args.seed, reference_samples };
    // The talk's own scenes where their files are given.
    let from = args.scenes.as_deref();
    let own_view = View { camera: args.camera.unwrap_or(from.map_or(BUILT_IN_CAMERA, |_| FILE_CAMERA)), ..view };
    let frames: Vec<i64> = (0..i64::from(args.count)).collect();
    let mut sections: Vec<Section> = Vec::new();
    let mut further = Map::new();
    let mut report = context.report();
    if wanted(ReproducePart::Stages) {
        notify("stage times");
        let (section, stages) = bench::section(context, args.stages_size)?;
        sections.push(section);
        report.stages = stages;
    }
    if wanted(ReproducePart::Offline) {
        let view = View { size: args.offline_size.unwrap_or(args.size), ..own_view };
        let names = from.map_or(&OFFLINE_SCENES, |_| &OFFLINE_FILES);
        let scenes = scenes(context, from, names, view.camera)?;
        let part = offline::offline(&shop, &scenes, &view, OFFLINE_FRAME).map_err(interrupted)?;
        further.insert("offline".to_owned(), json(&part.rows)?);
        sections.push(part.section);
    }
    if wanted(ReproducePart::Ablations) {
        let scenes = scenes(context, None, &ABLATION_SCENES, camera)?;
        let part = ablations::ablations(&shop, &scenes, &view, &frames).map_err(interrupted)?;
        further.insert("ablations".to_owned(), json(&part.rows)?);
        sections.push(part.section);
    }
    if wanted(ReproducePart::Paths) {
        let names = from.map_or(&PATHS_SCENES, |_| &PATHS_FILES);
        let scenes = scenes(context, from, names, own_view.camera)?;
        let part = paths::paths(&shop, &scenes, &own_view, &frames).map_err(interrupted)?;
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
            "{}; {} threads, {}",
            if from.is_some() {
                "The talk's scenes; ablations: built-in ones"
            } else {
                "Built-in scenes stand in for the talk's"
            },
            report.machine.threads,
            report.machine.instruction_set
        ),
        sections,
        command: context.command.clone(),
    };
    write(&page, &document)?;
    text.push_str(&output::file_url(&page));
    for (name, value) in [
        ("size", Value::from(args.size.to_string())),
        ("camera", camera.into()),
        ("offline_camera", own_view.camera.into()),
        ("seed", args.seed.into()),
        ("frames", args.count.into()),
        ("reference_spp", args.reference_spp.into()),
    ] {
        report.settings.insert(name.to_owned(), value);
    }
    further.insert("page".to_owned(), output::file_url(&page).into());
    context.finish(&report, further, &text)
}

/// Built-in scenes of these names, or the scenes in the files `NAME.glb` of the folder.
fn scenes(context: &Context, folder: Option<&Path>, names: &[&str], camera: usize) -> Result<Vec<Scene>, Failure> {
    let open = |name: &&str| match folder {
        None => Ok(builtin(name)?),
        Some(folder) => {
            let file = folder.join(format!("{name}.glb"));
            scene::open(context, &file.to_string_lossy(), &SceneArgs::default()).map(|opened| opened.scene)
        }
    };
    let scenes = names.iter().map(open).collect::<Result<Vec<_>, Failure>>()?;
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
