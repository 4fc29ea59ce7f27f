//! Every parameter of both filters, from the tables that declare them.

use crate::failure::Failure;
use pyo3::prelude::*;
use quell::sequence::{SEQUENCE_PARAMETERS, SequenceSettings};
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
    if preset == "sequence" {
        let settings = SequenceSettings::default();
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
pub fn sequence_settings(values: &[(String, String)]) -> Result<SequenceSettings, Failure> {
    let mut settings = SequenceSettings::default();
    for (name, value) in values {
        settings.set(name, value)?;
    }
    Ok(settings)
}

/// The settings of the real-time filter.
pub fn realtime_settings(preset: &str, values: &[(String, String)]) -> Result<Settings, Failure> {
    let preset: Preset = preset.parse().map_err(|error: quell::Error| match error {
        quell::Error::UnknownPreset { name, known } => {
            Failure::input(format!("preset: unknown preset `{name}`; there are: {known}, sequence"))
        }
        error => error.into(),
    })?;
    let mut settings = Settings::preset(preset);
    for (name, value) in values {
        settings.set(name, value)?;
    }
    Ok(settings)
}
