//! quell itself: `quell:PRESET`, then any number of `+ABLATION` and `+stage.parameter=value`.
//!
//! `quell:paper+no-virtual`, `quell:paper+glossy_temporal.alpha=0.8`.

use super::{Input, Method};
use crate::backend::{Backend, Denoiser};
use crate::error::Error;
use quell::sequence::SequencePreset;
pub use quell::settings::{ABLATIONS, Ablation};
use quell::{Plane, Preset, Rgb, Settings};

/// quell, by default on the fast back end of the CPU.
pub struct Quell {
    variant: String,
    settings: Settings,
    backend: Backend,
    denoiser: Option<Denoiser>,
}

impl Quell {
    /// `variant` is what follows `quell:`.
    ///
    /// # Errors
    /// [`Error::UnknownMethod`] for an unknown preset or ablation, [`Error::Quell`] for a bad parameter.
    pub fn parse(variant: &str) -> Result<Self, Error> {
        let unknown = |part: &str, candidates: &mut dyn Iterator<Item = &str>| Error::UnknownMethod {
            name: part.to_owned(),
            nearest: quell::settings::nearest(part, candidates),
        };
        let mut parts = variant.split('+');
        let preset = parts.next().unwrap_or_default();
        let mut settings = match preset.parse::<Preset>() {
            Ok(preset) => Settings::preset(preset),
            Err(_) => {
                let mut known =
                    Preset::ALL.iter().map(|p| p.name()).chain(SequencePreset::ALL.map(SequencePreset::name));
                return Err(unknown(preset, &mut known));
            }
        };
        for part in parts {
            if let Some((name, value)) = part.split_once('=') {
                settings.set(name, value)?;
            } else if let Some(ablation) = ABLATIONS.iter().find(|a| a.name == part) {
                settings = (ablation.apply)(settings);
            } else {
                return Err(unknown(part, &mut ABLATIONS.iter().map(|a| a.name)));
            }
        }
        let backend = Backend::Cpu(quell::Backend::Cpu);
        Ok(Self { variant: variant.to_owned(), settings, backend, denoiser: None })
    }

    /// The same on another back end.
    #[must_use]
    pub fn on(self, backend: &Backend) -> Self {
        Self { backend: backend.clone(), denoiser: None, ..self }
    }
}

impl Method for Quell {
    fn name(&self) -> String {
        format!("quell:{}", self.variant)
    }

    fn reset(&mut self) {
        if let Some(denoiser) = &mut self.denoiser {
            denoiser.reset();
        }
    }

    fn ran_on(&self) -> Option<(&'static str, String)> {
        let adapter = self.backend.adapter()?;
        let mut note = format!(
            "quell:{} ran on {adapter}, in half precision: its time is wall time of bringing a frame onto the device, \
             filtering it and reading it back",
            self.variant
        );
        if let Some(memory) = self.denoiser.as_ref().and_then(Denoiser::device_memory) {
            note.push_str(&format!("; its memory is this process's, without {memory} on the device"));
        }
        Some((self.backend.name(), note + "."))
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let denoiser = match &mut self.denoiser {
            Some(denoiser) => denoiser,
            none => none.insert(self.backend.denoiser(input.frame.size, &self.settings)?),
        };
        Ok(denoiser.denoise(input.frame)?.composite.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_presets_ablations_and_parameters() {
        for ablation in ABLATIONS {
            let quell = Quell::parse(&format!("paper+{}", ablation.name)).unwrap();
            assert_ne!(quell.settings, Settings::default(), "{} changes nothing", ablation.name);
        }
        let quell = Quell::parse("paper+glossy_temporal.alpha=0.5").unwrap();
        assert_eq!(quell.settings.get("glossy_temporal.alpha").unwrap(), "0.5");
        for wrong in ["papers", "paper+no-virtue", "paper+glossy_temporal.alpha=7"] {
            assert!(Quell::parse(wrong).is_err(), "{wrong}");
        }
    }
}
