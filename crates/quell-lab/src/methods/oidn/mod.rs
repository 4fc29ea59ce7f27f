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
use quell::{Plane, Rgb, Size};
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
            let opened = Denoiser::open(self.library.as_deref(), frame.size, self.quality, true);
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
            colour: Some(noisy.data()),
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

/// The library as it does best on frames whose feature buffers have noise: albedo and normal are filtered first, each by itself, and
/// then the picture with what came out of them (`cleanAux`), as its documentation advises.
pub struct Prefiltered {
    albedo: Denoiser,
    normal: Denoiser,
    picture: Denoiser,
}

impl Prefiltered {
    /// Loads the library from `$QUELL_OIDN` or the usual places, for pictures of `size`.
    ///
    /// # Errors
    /// [`Error::Method`] where it is not there or refuses.
    pub fn open(size: Size, quality: Quality) -> Result<Self, Error> {
        let library = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty());
        let open = |hdr| {
            let opened = Denoiser::open(library.as_deref(), size, quality, hdr);
            let advice = format!("set {LIBRARY_VARIABLE} to its library or the folder that holds it");
            opened.map_err(|reason| Self::error(format!("{reason}; {advice}")))
        };
        Ok(Self { albedo: open(false)?, normal: open(false)?, picture: open(true)? })
    }

    /// The picture without noise: three filters one after the other. Colours are scene-linear, normals in world space.
    ///
    /// # Errors
    /// [`Error::Method`] for planes of another extent, or where the library fails.
    pub fn denoise(
        &mut self,
        colour: &Plane<Rgb>,
        albedo: &Plane<Rgb>,
        normal: &Plane<[f32; 3]>,
    ) -> Result<Plane<Rgb>, Error> {
        let size = self.picture.size();
        let [mut clean_albedo, mut clean_normal, mut out] = [(); 3].map(|()| Plane::filled(size, [0.0; 3]));
        let first = Images { colour: None, albedo: Some(albedo.data()), normal: None };
        self.albedo.denoise(&first, clean_albedo.data_mut()).map_err(Self::error)?;
        let second = Images { colour: None, albedo: None, normal: Some(normal.data()) };
        self.normal.denoise(&second, clean_normal.data_mut()).map_err(Self::error)?;
        let (albedo, normal) = (Some(clean_albedo.data()), Some(clean_normal.data()));
        let images = Images { colour: Some(colour.data()), albedo, normal };
        self.picture.denoise(&images, out.data_mut()).map_err(Self::error)?;
        Ok(out)
    }

    fn error(reason: String) -> Error {
        Error::Method { method: "oidn, feature buffers filtered first".to_owned(), reason }
    }
}
