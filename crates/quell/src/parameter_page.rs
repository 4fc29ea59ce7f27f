//! The page of every parameter of both filters: `docs/parameters.md`.

use crate::parameter::Parameter;
use crate::sequence::{SEQUENCE_PARAMETERS, SequenceSettings};
use crate::settings::{PARAMETERS, Preset, Settings};
use std::fmt::Write as _;

/// The reference page of all parameters, as `docs/parameters.md` holds it.
pub fn parameters_markdown() -> String {
    let mut page = String::from(
        "# Parameters\n\nMade from `crates/quell/src/settings.rs` and `crates/quell/src/sequence/settings.rs` by `quell explain \
         --markdown`; a test keeps it current. Set any of them with `--set stage.parameter=value` or in a TOML file \
         (`--settings`). Radii in pixels are given at 720 rows and scale with the height. Marks: [S] the talk's slides, \
         [E] the authors' engine, [I] inferred, [O] open, a choice of ours (`docs/paper.md`).\n",
    );
    add_table(&mut page, PARAMETERS, &Settings::default());
    add_preset(&mut page, Preset::Quality);
    page.push_str(
        "\n# Parameters of the sequence filter\n\nPreset `sequence`, of `quell denoise` (`docs/sequence.md`). Radii are in pixels of \
         any picture.\n",
    );
    add_table(&mut page, SEQUENCE_PARAMETERS, &SequenceSettings::default());
    page
}

/// What a preset changes.
fn add_preset(page: &mut String, preset: Preset) {
    let settings = Settings::preset(preset);
    let _ = write!(
        page,
        "\n## Preset {0}\n\nWhat it changes (`docs/{0}.md`).\n\n| parameter | `paper` | `{0}` |\n|---|---|---|\n",
        preset.name()
    );
    for p in PARAMETERS {
        let (default, value) = ((p.get)(&Settings::default()), (p.get)(&settings));
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
