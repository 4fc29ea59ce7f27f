//! The page of every parameter of both filters: `docs/parameters.md`.

use crate::parameter::Parameter;
use crate::sequence::{SEQUENCE_PARAMETERS, SequencePreset, SequenceSettings};
use crate::settings::{PARAMETERS, Preset, Settings};
use std::fmt::Write as _;

/// The reference page of all parameters, as `docs/parameters.md` holds it.
pub fn parameters_markdown() -> String {
    let mut page = String::from(
        "# Parameters\n\nMade from `crates/quell/src/settings.rs` and `crates/quell/src/sequence/settings.rs` by `quell explain \
         --markdown`; a test keeps it current. Set any of them with `--set stage.parameter=value` or in a TOML file \
         (`--settings`). Radii in pixels are given at 720 rows and scale with the height. Defaults are those of preset `paper`; programs run \
         preset `quality`, whose other values are listed under \"Preset quality\". Marks: [S] the talk's slides, \
         [E] the authors' engine, [I] inferred, [O] open, a choice of ours (`docs/paper.md`).\n",
    );
    add_table(&mut page, PARAMETERS, &Settings::default());
    let (names, page_of) = ((Preset::Paper.name(), Preset::Quality.name()), "quality");
    add_preset(&mut page, names, page_of, PARAMETERS, &Settings::default(), &Settings::preset(Preset::Quality));
    page.push_str(
        "\n# Parameters of the sequence filter\n\nPreset `sequence`, of `quell denoise` (`docs/sequence.md`). Radii are in pixels of \
         any picture.\n",
    );
    let (first, short) = (SequencePreset::Sequence, SequencePreset::Short);
    let (defaults, settings) = (SequenceSettings::preset(first), SequenceSettings::preset(short));
    add_table(&mut page, SEQUENCE_PARAMETERS, &defaults);
    add_preset(&mut page, (first.name(), short.name()), "sequence", SEQUENCE_PARAMETERS, &defaults, &settings);
    page
}

/// What a preset changes: `names` of the preset with the defaults and of this one, and the page of `docs` that describes it.
fn add_preset<S>(
    page: &mut String,
    names: (&str, &str),
    described: &str,
    parameters: &[Parameter<S>],
    defaults: &S,
    settings: &S,
) {
    let (first, name) = names;
    let _ = write!(
        page,
        "\n## Preset {name}\n\nWhat it changes (`docs/{described}.md`).\n\n| parameter | `{first}` | `{name}` |\n|---|---|---|\n"
    );
    for p in parameters {
        let (default, value) = ((p.get)(defaults), (p.get)(settings));
        if value != default {
            let _ = writeln!(page, "| `{}` | {default} | {value} |", p.name);
        }
    }
}

fn add_table<S>(page: &mut String, parameters: &[Parameter<S>], defaults: &S) {
    let mut group = "";
    for p in parameters {
        if p.group != group {
            group = p.group;
            let _ = write!(
                page,
                "\n## {group}\n\n| parameter | default | range | meaning | higher | lower | source |\n|---|---|---|---|---|---|---|\n"
            );
        }
        let range = if p.unit.is_empty() { p.range() } else { format!("{}, {}", p.range(), p.unit) };
        let short = p.name.rsplit('.').next().unwrap_or(p.name);
        let (value, doc, higher, lower, source) = ((p.get)(defaults), p.doc, p.higher, p.lower, p.source);
        let _ = writeln!(page, "| `{short}` | {value} | {range} | {doc} | {higher} | {lower} | {source} |");
    }
}
