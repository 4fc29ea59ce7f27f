//! `quell explain`: the pipeline as it will run, every parameter; `quell explain SCENE`: what a scene holds.

use crate::args::ExplainArgs;
use crate::context::Context;
use crate::failure::Failure;
use crate::output;
use crate::sequence::FIRST_FRAME;
use crate::sequence::times::paper_number;
use quell::Settings;
use quell::pipeline::{Image, Inputs, Plan, Stage};
use quell::settings::{PARAMETERS, Parameter, parameters_markdown};
use quell_trace::{Tracer, builtin};
use serde_json::{Map, Value, json};

pub fn run(context: &Context, args: ExplainArgs) -> Result<(), Failure> {
    match args.scene {
        Some(scene) => explain_scene(context, &scene),
        None if args.markdown => output::print(&parameters_markdown()),
        None => explain_pipeline(context),
    }
}

fn explain_pipeline(context: &Context) -> Result<(), Failure> {
    let plan = Plan::new(&context.settings, Inputs::ALL);
    let mut text = format!(
        "The pipeline of preset `{}`{}, for a frame that has both signals and jittered samples:\n\n{plan}\n",
        context.preset.name(),
        if context.settings == Settings::preset(context.preset) { "" } else { " with your changes" },
    );
    text.push_str("\nParameters (set with --set NAME=VALUE; * differs from the preset; radii are meant at 720 rows)\n");
    let mut group = "";
    for parameter in PARAMETERS {
        if parameter.group != group {
            group = parameter.group;
            text.push('\n');
        }
        text.push_str(&described(parameter, context)?);
    }
    let names = |images: &[Image]| images.iter().map(|i| i.name()).collect::<Vec<_>>();
    let stages: Vec<Value> = Stage::ALL
        .into_iter()
        .map(|stage| {
            let step = plan.steps.iter().find(|s| s.stage == stage);
            let reads = step.map(|s| [&[s.input], s.also_reads.as_slice()].concat()).unwrap_or_default();
            let writes = step.map(|s| [&[s.output], s.also_writes.as_slice()].concat()).unwrap_or_default();
            json!({
                "name": stage.name(),
                "paper_stage": paper_number(stage),
                "runs": step.is_some(),
                "reads": names(&reads),
                "writes": names(&writes),
            })
        })
        .collect();
    let parameters = PARAMETERS.iter().map(|p| {
        Ok(json!({
            "name": p.name,
            "value": context.settings.get(p.name)?,
            "range": p.range(),
            "unit": p.unit,
            "meaning": p.doc,
            "higher": p.higher,
            "lower": p.lower,
            "source": p.source,
        }))
    });
    let parameters: Vec<Value> = parameters.collect::<Result<_, quell::Error>>()?;
    let mut further = Map::new();
    further.insert("pipeline".to_owned(), stages.into());
    further.insert("parameters".to_owned(), parameters.into());
    context.finish(&context.report(), further, &text)
}

/// Name, value, range and meaning; with `-v` also what moving it does, and its source.
fn described(parameter: &Parameter, context: &Context) -> Result<String, Failure> {
    let value = context.settings.get(parameter.name)?;
    let preset = Settings::preset(context.preset).get(parameter.name)?;
    let mark = if value == preset { ' ' } else { '*' };
    let unit = if parameter.unit.is_empty() { String::new() } else { format!(" {}", parameter.unit) };
    let left = format!("{mark} {} = {value}{unit}", parameter.name);
    let mut text = format!("{left:<46} {} ({})\n", parameter.doc, parameter.range());
    if context.verbose {
        for line in [parameter.higher, parameter.lower, parameter.source] {
            text.push_str(&format!("{:46} {line}\n", ""));
        }
    }
    Ok(text)
}

fn explain_scene(context: &Context, name: &str) -> Result<(), Failure> {
    let scene = builtin(name)?;
    let tracer = Tracer::new(&scene, FIRST_FRAME, 1)?;
    let stresses = quell_trace::builtin_scenes().iter().find(|s| s.name == name).map_or("", |s| s.stresses);
    let counts = [
        ("meshes", scene.meshes.len()),
        ("meshes that deform", scene.meshes.iter().filter(|m| m.deform.is_some()).count()),
        ("instances", scene.instances.len()),
        ("materials", scene.surfaces.len()),
        ("triangles in the world", tracer.triangles()),
        ("lights (triangles that emit, and lights without extent)", tracer.lights()),
        ("cameras", scene.cameras.len()),
        ("frames", scene.frames),
    ];
    let mut text = format!("{name}: {stresses}\n\n");
    for (what, count) in counts {
        text.push_str(&format!("{count:>9}  {what}\n"));
    }
    text.push_str(&format!("{:>9}  exposure\n", scene.exposure));
    text.push_str("\nNothing was ignored: built-in scenes are made by code.");
    let mut further = Map::new();
    let counted: Map<String, Value> = counts.into_iter().map(|(what, n)| (what.to_owned(), n.into())).collect();
    further.insert("scene".to_owned(), json!({"name": name, "stresses": stresses, "exposure": scene.exposure}));
    further.insert("holds".to_owned(), counted.into());
    further.insert("ignored".to_owned(), Value::Array(Vec::new()));
    context.finish(&context.report(), further, &text)
}
