//! What a command runs on: settings, back end, where messages go, what is reported.

use crate::args::Common;
use crate::args::values::TracerChoice;
use crate::backend::Choice;
use crate::failure::Failure;
use crate::output;
use quell::sequence::{SEQUENCE_PARAMETERS, SequencePreset, SequenceSettings};
use quell::settings::PARAMETERS;
use quell::{Preset, Settings};
use quell_lab::backend::Backend;
use quell_lab::report::Report;
use quell_lab::tracer::TraceOn;
use serde_json::{Map, Value};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The error of a preset that one filter lacks, with what the other has: a command runs one of the two.
fn no_preset(name: &str, filter: &str, known: String, others: String) -> Failure {
    Failure::Usage(format!("no preset `{name}` for {filter}; there are: {known} (the other filter: {others})"))
}

fn real_time() -> String {
    Preset::ALL.map(Preset::name).join(", ")
}

fn sequence() -> String {
    SequencePreset::ALL.map(SequencePreset::name).join(", ")
}

/// Resolved from the common options.
#[derive(Clone, Debug)]
pub struct Context {
    pub verbose: bool,
    pub quiet: bool,
    pub json: bool,
    pub report_file: Option<PathBuf>,
    pub settings: Settings,
    pub preset: Preset,
    /// For commands that run the sequence filter.
    pub sequence_preset: SequencePreset,
    choice: Choice,
    tracer: Option<TracerChoice>,
    /// The command line as it was typed.
    pub command: String,
    /// The file that holds this program.
    pub program: PathBuf,
}

impl Context {
    /// Reads the settings file, resolves names, checks that the report can be written. `default`: the preset where none is asked for.
    pub fn new(common: &Common, default: Preset) -> Result<Self, Failure> {
        let file = common.settings.as_deref().map(SettingsFile::read).transpose()?.unwrap_or_default();
        let preset_name = common.preset.as_deref().or(file.preset.as_deref());
        let preset = match preset_name {
            Some(name) => name.parse().map_err(|_| no_preset(name, "the real-time filter", real_time(), sequence()))?,
            None => default,
        };
        let mut settings = Settings::preset(preset);
        for (name, value) in &file.values {
            let place = |e: quell::Error| Failure::Usage(format!("{}: {e}", file.path.display()));
            settings.set(name, value).map_err(place)?;
        }
        for setting in &common.set {
            settings.set(&setting.name, &setting.value)?;
        }
        if let Some(report) = &common.report {
            output::check_file(report)?;
        }
        Ok(Self {
            verbose: common.verbose,
            quiet: common.quiet,
            json: common.json,
            report_file: common.report.clone(),
            settings,
            preset,
            sequence_preset: SequencePreset::default(),
            choice: Choice::new(common.backend, common.device.clone())?,
            tracer: common.tracer,
            command: command_line(&common.arguments),
            program: common.program.clone(),
        })
    }

    /// Whether the options ask for a preset of the sequence filter.
    pub fn asks_for_sequences(common: &Common) -> Result<bool, Failure> {
        let file = common.settings.as_deref().map(SettingsFile::read).transpose()?.unwrap_or_default();
        let name = common.preset.as_deref().or(file.preset.as_deref());
        Ok(name.is_some_and(|name| name.parse::<SequencePreset>().is_ok()))
    }

    /// For the sequence filter, which has parameters of its own: what a command without them runs on, and those.
    pub fn for_sequences(common: &Common) -> Result<(Self, SequenceSettings), Failure> {
        let file = common.settings.as_deref().map(SettingsFile::read).transpose()?.unwrap_or_default();
        let sequence_preset = match common.preset.as_deref().or(file.preset.as_deref()) {
            Some(name) => name.parse().map_err(|_| no_preset(name, "sequences", sequence(), real_time()))?,
            None => SequencePreset::default(),
        };
        let mut settings = SequenceSettings::preset(sequence_preset);
        for (name, value) in &file.values {
            let place = |e: quell::Error| Failure::Usage(format!("{}: {e}", file.path.display()));
            settings.set(name, value).map_err(place)?;
        }
        for setting in &common.set {
            settings.set(&setting.name, &setting.value)?;
        }
        let plain = Common { preset: None, set: Vec::new(), settings: None, ..common.clone() };
        let context = Self { sequence_preset, ..Self::new(&plain, Preset::default())? };
        context.prefers_cpu();
        Ok((context, settings))
    }

    /// A report with the settings of the filter of sequences.
    pub fn sequence_report(&self, settings: &SequenceSettings) -> Report {
        let mut report = self.report();
        report.settings.retain(|name, _| name.starts_with("backend"));
        report.settings.insert("preset".to_owned(), self.sequence_preset.name().into());
        for parameter in SEQUENCE_PARAMETERS {
            if let Ok(value) = settings.get(parameter.name) {
                report.settings.insert(parameter.name.to_owned(), value.into());
            }
        }
        report
    }

    /// The back end that filters; looked for at the first call, and named with `-v`.
    pub fn backend(&self) -> Result<&Backend, Failure> {
        let known = self.choice.found().is_some();
        let chosen = self.choice.get()?;
        if !known {
            let backend = &chosen.backend;
            let on = backend.adapter().map_or(String::new(), |adapter| format!(" on {adapter}"));
            self.detail(&format!("back end: {}{on} ({})", backend.name(), chosen.why));
        }
        Ok(&chosen.backend)
    }

    /// What traces frames and references: the CPU, unless a GPU is asked for by name. `auto` gives the same bits on every
    /// machine, and a GPU in software traces several times slower than the CPU does.
    pub fn tracer(&self) -> Result<TraceOn, Failure> {
        let on = match self.tracer {
            Some(TracerChoice::Cpu) => TraceOn::Cpu,
            Some(TracerChoice::Gpu) => match TraceOn::backend(self.backend()?) {
                TraceOn::Cpu => {
                    let why = self.choice.found().map_or("", |chosen| &chosen.why);
                    return Err(Failure::Usage(format!(
                        "--tracer gpu needs a GPU, and the back end is the CPU ({why})"
                    )));
                }
                #[cfg(feature = "gpu")]
                on @ TraceOn::Gpu(..) => on,
            },
            None if self.choice.asks_for_gpu() && !self.backend()?.is_software() => TraceOn::backend(self.backend()?),
            None => TraceOn::Cpu,
        };
        self.detail(&format!("tracer: {}", on.name()));
        Ok(on)
    }

    /// No GPU unless one is asked for.
    pub fn prefers_cpu(&self) {
        self.choice.prefers_cpu();
        if let Some(chosen) = self.choice.found() {
            self.detail(&format!("back end: {} ({})", chosen.backend.name(), chosen.why));
        }
    }

    /// The same without messages.
    pub fn silenced(&self) -> Self {
        Self { quiet: true, verbose: false, ..self.clone() }
    }

    /// Something that the user should know; on standard error.
    pub fn note(&self, message: &str) {
        if !self.quiet {
            eprintln!("{message}");
        }
    }

    /// Something that the user wants to know with `-v`.
    pub fn detail(&self, message: &str) {
        if self.verbose {
            eprintln!("{message}");
        }
    }

    /// What denoised frames are called in tables: `quell:paper`, and whether parameters were changed.
    pub fn method(&self) -> String {
        let changed = if self.settings == Settings::preset(self.preset) { "" } else { ", changed" };
        format!("quell:{}{changed}", self.preset.name())
    }

    /// A report with the settings in force.
    pub fn report(&self) -> Report {
        let mut report = Report::new(self.command.clone());
        report.machine.instruction_set = instruction_set();
        report.settings.insert("preset".to_owned(), self.preset.name().into());
        report.settings.insert("backend".to_owned(), self.choice.name().into());
        if let Some(chosen) = self.choice.found() {
            report.settings.insert("backend_why".to_owned(), chosen.why.as_str().into());
            report.machine.adapter = chosen.backend.adapter();
        }
        for parameter in PARAMETERS {
            if let Ok(value) = self.settings.get(parameter.name) {
                report.settings.insert(parameter.name.to_owned(), value.into());
            }
        }
        report
    }

    /// Writes the report where the user wants it: `text` for a person, or JSON on standard output; and the file.
    /// `further` are fields beside those of the report.
    pub fn finish(&self, report: &Report, further: Map<String, Value>, text: &str) -> Result<(), Failure> {
        let json = with_further(report, further)?;
        if let Some(file) = &self.report_file {
            quell_frames::files::write_bytes(file, json.as_bytes())?;
        }
        output::print(if self.json { &json } else { text })
    }
}

/// The report as JSON, with further fields behind its own.
pub fn with_further(report: &Report, further: Map<String, Value>) -> Result<String, Failure> {
    let wrong = |e: serde_json::Error| Failure::Failed(format!("cannot write the report as JSON: {e}"));
    if further.is_empty() {
        return Ok(report.to_json()?);
    }
    let mut value = serde_json::to_value(report).map_err(wrong)?;
    if let Value::Object(object) = &mut value {
        object.extend(further);
    }
    serde_json::to_string_pretty(&value).map(|text| text + "\n").map_err(wrong)
}

/// The command line, words with spaces in quotes.
fn command_line(arguments: &[OsString]) -> String {
    let quoted = |word: &OsString| {
        let word = word.to_string_lossy().into_owned();
        let plain = !word.is_empty() && !word.contains(|c: char| c.is_whitespace() || c == '"' || c == '\'');
        if plain { word } else { format!("'{}'", word.replace('\'', r"'\''")) }
    };
    std::iter::once("quell".to_owned()).chain(arguments.iter().skip(1).map(quoted)).collect::<Vec<_>>().join(" ")
}

/// The widest vector instructions of this machine that matter here.
pub fn instruction_set() -> String {
    #[cfg(target_arch = "x86_64")]
    {
        let level = if std::arch::is_x86_feature_detected!("avx512f") {
            "avx512"
        } else if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            "avx2"
        } else if std::arch::is_x86_feature_detected!("sse4.2") {
            "sse4.2"
        } else {
            "sse2"
        };
        format!("x86_64 {level}")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        std::env::consts::ARCH.to_owned()
    }
}

/// A TOML file of parameters: one table a group, and `preset` above them.
#[derive(Debug, Default)]
struct SettingsFile {
    path: PathBuf,
    preset: Option<String>,
    values: Vec<(String, String)>,
}

impl SettingsFile {
    fn read(path: &Path) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path)
            .map_err(|e| Failure::Failed(format!("cannot read {}: {e}", path.display())))?;
        Self::parse(&text, path).map_err(|e| Failure::Usage(format!("{}: {e}", path.display())))
    }

    fn parse(text: &str, path: &Path) -> Result<Self, String> {
        let table: toml::Table = text.parse().map_err(|e: toml::de::Error| e.to_string().trim_end().to_owned())?;
        let mut file = Self { path: path.to_owned(), ..Self::default() };
        for (group, value) in table {
            match value {
                toml::Value::String(name) if group == "preset" => file.preset = Some(name),
                toml::Value::Table(parameters) => {
                    for (name, value) in parameters {
                        let full = format!("{group}.{name}");
                        let text = match value {
                            toml::Value::String(text) => text,
                            toml::Value::Integer(number) => number.to_string(),
                            toml::Value::Float(number) => number.to_string(),
                            toml::Value::Boolean(on) => if on { "on" } else { "off" }.to_owned(),
                            other => return Err(format!("`{full}` is a {}, not a value", other.type_str())),
                        };
                        file.values.push((full, text));
                    }
                }
                _ => {
                    return Err(format!(
                        "`{group}` stands outside a table; write [stage] and under it parameter = value"
                    ));
                }
            }
        }
        Ok(file)
    }
}

/// Settings as a file that `--settings` takes.
pub fn settings_toml(preset: Preset, settings: &Settings) -> String {
    let mut text = format!("preset = \"{}\"\n", preset.name());
    let mut group = "";
    for parameter in PARAMETERS {
        let Ok(value) = settings.get(parameter.name) else { continue };
        if parameter.group != group {
            group = parameter.group;
            text.push_str(&format!("\n[{group}]\n"));
        }
        let short = parameter.name.rsplit('.').next().unwrap_or(parameter.name);
        let plain = value.parse::<f64>().is_ok_and(f64::is_finite);
        text.push_str(&if plain { format!("{short} = {value}\n") } else { format!("{short} = \"{value}\"\n") });
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_the_file() {
        let mut settings = Settings::preset(Preset::Paper);
        for parameter in PARAMETERS {
            // The last sample differs from most defaults.
            settings.set(parameter.name, parameter.samples().last().unwrap()).unwrap();
        }
        let text = settings_toml(Preset::Paper, &settings);
        let file = SettingsFile::parse(&text, Path::new("x.toml")).unwrap();
        assert_eq!(file.preset.as_deref(), Some("paper"));
        assert_eq!(file.values.len(), PARAMETERS.len());
        let mut back = Settings::preset(Preset::Paper);
        file.values.iter().for_each(|(name, value)| back.set(name, value).unwrap());
        assert_eq!(back, settings);
    }

    #[test]
    fn a_bad_file_says_what_is_wrong() {
        let error = |text: &str| SettingsFile::parse(text, Path::new("x.toml")).unwrap_err();
        assert!(error("alpha = 0.5").contains("outside a table"));
        assert!(error("[a]\nb = [1]").contains("a.b"));
        assert!(error("[a\n").contains("line 1"));
        let file = SettingsFile::parse("[firefly]\nenabled = false\n[x]\ny = 2", Path::new("x.toml")).unwrap();
        assert!(file.values.contains(&("firefly.enabled".to_owned(), "off".to_owned())));
    }

    #[test]
    fn further_fields_stand_beside_the_report() {
        let mut further = Map::new();
        further.insert("scenes".to_owned(), Value::Array(Vec::new()));
        let json = with_further(&Report::new("quell scenes"), further).unwrap();
        let value: Value = serde_json::from_str(&json).unwrap();
        assert_eq!(value["format"], 1);
        assert!(value["scenes"].is_array());
    }
}
