//! `quell explain`: the pipeline as it will run, every parameter; `quell explain SCENE`: what a scene holds.

use crate::args::ExplainArgs;
use crate::commands::explain_scene;
use crate::context::Context;
use crate::failure::Failure;
use crate::output;
use crate::sequence::times::paper_number;
use quell::Settings;
use quell::pipeline::{Image, Inputs, Plan, Stage};
use quell::settings::{PARAMETERS, Parameter, REFERENCE_ROWS, parameters_markdown};
use serde_json::{Map, Value, json};

pub fn run(context: &Context, args: ExplainArgs) -> Result<(), Failure> {
    match args.source {
        Some(source) => explain_scene::run(context, &source, &args.scene, &args.environment),
        None if args.environment.environment.is_some() => {
            Err(Failure::Usage("--environment is for scenes; name one".to_owned()))
        }
        None if args.markdown => output::print(&parameters_markdown()),
        None => explain_pipeline(context),
    }
}

fn explain_pipeline(context: &Context) -> Result<(), Failure> {
    let plan = Plan::new(&context.settings, Inputs::ALL);
    let listing = plan.listing(&context.settings, REFERENCE_ROWS as usize);
    let mut text = format!(
        "The pipeline of preset `{}`{}, for a frame that has both signals and jittered samples:\n\n{listing}\n",
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
