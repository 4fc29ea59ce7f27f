//! Every parameter of both filters, from the tables that declare them.

use crate::failure::Failure;
use pyo3::prelude::*;
use quell::sequence::{SEQUENCE_PARAMETERS, SequencePreset, SequenceSettings};
use quell::settings::PARAMETERS;
use quell::{Preset, Settings};

/// The version of quell.
#[pyfunction]
pub fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// Name, default, range, unit, what it is, what more and less of it does, source.
type Row = (&'static str, String, String, &'static str, &'static str, &'static str, &'static str, &'static str);

/// The parameters of a preset, in the order of its stages.
#[pyfunction]
pub fn parameters(preset: &str) -> PyResult<Vec<Row>> {
    if let Ok(preset) = preset.parse() {
        let settings = SequenceSettings::preset(preset);
        let row = |p: &quell::parameter::Parameter<SequenceSettings>| {
            let value = settings.get(p.name).map_err(Failure::from)?;
            Ok((p.name, value, p.range(), p.unit, p.doc, p.higher, p.lower, p.source))
        };
        return SEQUENCE_PARAMETERS.iter().map(row).collect();
    }
    let settings = realtime_settings(preset, &[])?;
    let row = |p: &quell::parameter::Parameter| {
        let value = settings.get(p.name).map_err(Failure::from)?;
        Ok((p.name, value, p.range(), p.unit, p.doc, p.higher, p.lower, p.source))
    };
    PARAMETERS.iter().map(row).collect()
}

/// The settings of the sequence filter.
pub fn sequence_settings(preset: &str, values: &[(String, String)]) -> Result<SequenceSettings, Failure> {
    let preset: SequencePreset = preset.parse().map_err(|error: quell::Error| match error {
        quell::Error::UnknownPreset { name, known } => Failure::input(format!(
            "preset: `{name}`; of sequences there are: {known} (and of `Denoiser`: {})",
            realtime()
        )),
        error => error.into(),
    })?;
    let mut settings = SequenceSettings::preset(preset);
    for (name, value) in values {
        settings.set(name, value)?;
    }
    Ok(settings)
}

/// Names of the real-time filter's presets.
fn realtime() -> String {
    Preset::ALL.map(Preset::name).join(", ")
}

/// The settings of the real-time filter.
pub fn realtime_settings(preset: &str, values: &[(String, String)]) -> Result<Settings, Failure> {
    let preset: Preset = preset.parse().map_err(|error: quell::Error| match error {
        quell::Error::UnknownPreset { name, known } => {
            let sequences = SequencePreset::ALL.map(SequencePreset::name).join(", ");
            Failure::input(format!("preset: unknown preset `{name}`; there are: {known}, {sequences}"))
        }
        error => error.into(),
    })?;
    let mut settings = Settings::preset(preset);
    for (name, value) in values {
        settings.set(name, value)?;
    }
    Ok(settings)
}
