//! Open Image Denoise (Intel, version 2), loaded at run time from `$QUELL_OIDN` (its library, or the folder that holds
//! it), else from the usual places. It is no part of quell and nothing of it is built.
//!
//! Filter `RT`, HDR, on the whole composite, with albedo and normal as auxiliary images. These are free of noise, so
//! `cleanAux` is set. Each frame by itself, or after temporal accumulation.

mod library;

pub use library::Quality;

use super::temporal::Temporal;
use super::{Input, Method};
use crate::error::Error;
use library::{Denoiser, Images};
use quell::{Plane, Rgb};
use std::ffi::OsString;
use std::path::Path;

/// Names the library, or the folder that holds it.
pub const LIBRARY_VARIABLE: &str = "QUELL_OIDN";

/// The method.
pub struct Oidn {
    quality: Quality,
    library: Option<OsString>,
    temporal: Option<Temporal>,
    denoiser: Option<Denoiser>,
}

impl Oidn {
    /// `oidn:fast`, `oidn:balanced`, `oidn:high`; `temporal+oidn:high` and so on after accumulation. `None` for other
    /// names. The library is loaded at the first frame.
    pub fn parse(name: &str) -> Option<Self> {
        let (temporal, name) = match name.strip_prefix("temporal+") {
            Some(name) => (Some(Temporal::default()), name),
            None => (None, name),
        };
        let quality = match name.strip_prefix("oidn:")? {
            "fast" => Quality::Fast,
            "balanced" => Quality::Balanced,
            "high" => Quality::High,
            _ => return None,
        };
        let library = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty());
        Some(Self { quality, library, temporal, denoiser: None })
    }

    /// Loads the library from here, whatever the environment says.
    #[must_use]
    pub fn with_library(self, path: &Path) -> Self {
        Self { library: Some(path.as_os_str().to_owned()), denoiser: None, ..self }
    }

    fn error(&self, reason: String) -> Error {
        let advice = format!("set {LIBRARY_VARIABLE} to its library or the folder that holds it");
        let reason = if self.denoiser.is_some() { reason } else { format!("{reason}; {advice}") };
        Error::Method { method: self.name(), reason }
    }
}

impl Method for Oidn {
    fn name(&self) -> String {
        let quality = match self.quality {
            Quality::Fast => "fast",
            Quality::Balanced => "balanced",
            Quality::High => "high",
        };
        format!("{}oidn:{quality}", if self.temporal.is_some() { "temporal+" } else { "" })
    }

    fn reset(&mut self) {
        if let Some(temporal) = &mut self.temporal {
            temporal.reset();
        }
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let frame = input.frame;
        if self.denoiser.as_ref().is_none_or(|d| d.size() != frame.size) {
            self.denoiser = None;
            let opened = Denoiser::open(self.library.as_deref(), frame.size, self.quality);
            self.denoiser = Some(opened.map_err(|reason| self.error(reason))?);
        }
        let mut noisy = match &mut self.temporal {
            Some(temporal) => temporal.denoise(input)?,
            None => input.composite(),
        };
        for value in noisy.data_mut().iter_mut().flatten().filter(|v| !v.is_finite()) {
            *value = 0.0;
        }
        // Without weights there is no albedo, and without albedo the library takes no normal.
        let has_albedo = frame.matte_weight.is_some() || frame.glossy_weight.is_some();
        let albedo = has_albedo.then(|| input.albedo());
        let normal = frame.normal.filter(|_| has_albedo).map(|n| n.to_plane());
        let images = Images {
            colour: noisy.data(),
            albedo: albedo.as_ref().map(Plane::data),
            normal: normal.as_ref().map(Plane::data),
        };
        let mut out = Plane::filled(frame.size, [0.0; 3]);
        let done = match &mut self.denoiser {
            Some(denoiser) => denoiser.denoise(&images, out.data_mut()),
            None => Err("the library is not loaded".to_owned()),
        };
        done.map_err(|reason| self.error(reason))?;
        Ok(out)
    }
}
