//! `quell explain`: a filter's pipeline as it will run, every parameter; `quell explain SCENE`: what a scene holds.

use crate::args::ExplainArgs;
use crate::commands::explain_scene;
use crate::context::Context;
use crate::failure::Failure;
use crate::output;
use crate::sequence::times::paper_number;
use quell::Settings;
use quell::pipeline::{Image, Inputs, Plan, Stage};
use quell::sequence::{SEQUENCE_PARAMETERS, SequencePlan, SequenceSettings, SequenceStage};
use quell::settings::{PARAMETERS, Parameter, REFERENCE_ROWS};
use serde_json::{Map, Value, json};

pub fn run(context: &Context, args: ExplainArgs) -> Result<(), Failure> {
    match args.source {
        Some(source) => explain_scene::run(context, &source, &args.scene, &args.environment),
        None if args.environment.environment.is_some() => {
            Err(Failure::Usage("--environment is for scenes; name one".to_owned()))
        }
        None if args.markdown => output::print(&quell::parameters_markdown()),
        None => explain_pipeline(context),
    }
}

/// The real-time filter's pipeline.
fn explain_pipeline(context: &Context) -> Result<(), Failure> {
    let plan = Plan::new(&context.settings, Inputs::ALL);
    let changed = context.settings != Settings::preset(context.preset);
    let mut text = heading(context.preset.name(), changed, "a frame that has both signals and jittered samples");
    text.push_str(&format!("{}\n", plan.listing(&context.settings, REFERENCE_ROWS as usize)));
    let preset = Settings::preset(context.preset);
    let table = Table {
        parameters: PARAMETERS,
        radii: "radii are given at 720 rows",
        value: &|name| context.settings.get(name),
        preset: &|name| preset.get(name),
    };
    table.add_to(&mut text, context.verbose)?;
    let names = |images: &[Image]| images.iter().map(|i| i.name()).collect::<Vec<_>>();
    let stages = Stage::ALL.into_iter().map(|stage| {
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
    });
    context.finish(&context.report(), further(stages.collect(), &table)?, &text)
}

/// The sequence filter's pipeline: `quell explain --preset sequence`.
pub fn sequence(context: &Context, settings: &SequenceSettings) -> Result<(), Failure> {
    let plan = SequencePlan::new(settings);
    let preset = SequenceSettings::preset(context.sequence_preset);
    let mut text = heading(context.sequence_preset.name(), *settings != preset, "each frame of a window");
    text.push_str(&format!("{plan}\n"));
    let table = Table {
        parameters: SEQUENCE_PARAMETERS,
        radii: "radii are in pixels of any picture",
        value: &|name| settings.get(name),
        preset: &|name| preset.get(name),
    };
    table.add_to(&mut text, context.verbose)?;
    let stages = SequenceStage::ALL.into_iter().map(|stage| {
        let runs = plan.runs(stage);
        let listed = |names: &[&str]| if runs { json!(names) } else { json!([]) };
        let (reads, writes) = (listed(stage.reads()), listed(stage.writes()));
        json!({ "name": stage.name(), "runs": runs, "reads": reads, "writes": writes })
    });
    context.finish(&context.sequence_report(settings), further(stages.collect(), &table)?, &text)
}

fn heading(preset: &str, changed: bool, of: &str) -> String {
    let changes = if changed { " with your changes" } else { "" };
    format!("The pipeline of preset `{preset}`{changes}, for {of}:\n\n")
}

/// The fields beside the report's.
fn further<S>(stages: Vec<Value>, table: &Table<'_, S>) -> Result<Map<String, Value>, Failure> {
    let mut further = Map::new();
    further.insert("pipeline".to_owned(), stages.into());
    further.insert("parameters".to_owned(), table.json()?.into());
    Ok(further)
}

type Get<'t> = &'t dyn Fn(&str) -> Result<String, quell::Error>;

/// The parameters of a filter, with the values in force and those of the preset.
struct Table<'t, S: 'static> {
    parameters: &'t [Parameter<S>],
    /// How the filter takes radii.
    radii: &'static str,
    value: Get<'t>,
    preset: Get<'t>,
}

impl<S> Table<'_, S> {
    fn add_to(&self, text: &mut String, verbose: bool) -> Result<(), Failure> {
        text.push_str(&format!(
            "\nParameters (set with --set NAME=VALUE; * differs from the preset; {})\n",
            self.radii
        ));
        let mut group = "";
        for parameter in self.parameters {
            if parameter.group != group {
                group = parameter.group;
                text.push('\n');
            }
            text.push_str(&self.described(parameter, verbose)?);
        }
        Ok(())
    }

    /// Name, value, range and meaning; with `verbose` also what moving it does, and its source.
    fn described(&self, parameter: &Parameter<S>, verbose: bool) -> Result<String, Failure> {
        let value = (self.value)(parameter.name)?;
        let mark = if value == (self.preset)(parameter.name)? { ' ' } else { '*' };
        let unit = if parameter.unit.is_empty() { String::new() } else { format!(" {}", parameter.unit) };
        let left = format!("{mark} {} = {value}{unit}", parameter.name);
        let mut text = format!("{left:<46} {} ({})\n", parameter.doc, parameter.range());
        if verbose {
            for line in [parameter.higher, parameter.lower, parameter.source] {
                text.push_str(&format!("{:46} {line}\n", ""));
            }
        }
        Ok(text)
    }

    fn json(&self) -> Result<Vec<Value>, Failure> {
        let parameters = self.parameters.iter().map(|p| {
            Ok(json!({
                "name": p.name,
                "value": (self.value)(p.name)?,
                "range": p.range(),
                "unit": p.unit,
                "meaning": p.doc,
                "higher": p.higher,
                "lower": p.lower,
                "source": p.source,
            }))
        });
        parameters.collect()
    }
}
