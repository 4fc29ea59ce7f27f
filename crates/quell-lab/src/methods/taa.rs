//! `METHOD+taa`: a method's pictures after quell's temporal anti-aliasing (`quell/src/stages/antialiasing`), for frames whose samples are
//! jittered. SVGF and BMFR end with such a filter in their papers too, and engines run one after any denoiser.

use super::{Input, Method};
use crate::error::Error;
use quell::{Denoiser, Frame, Plane, Rgb, Settings};

/// What follows a method's name.
pub const SUFFIX: &str = "+taa";

/// A method and the filter behind it.
pub struct Taa {
    method: Box<dyn Method>,
    denoiser: Option<Denoiser>,
}

impl Taa {
    /// Behind `method`; `None`: its pictures come late, when their frames are gone.
    pub fn behind(method: Box<dyn Method>) -> Option<Self> {
        (!method.looks_ahead()).then_some(Self { method, denoiser: None })
    }

    fn settings() -> Settings {
        let mut settings = Settings::default().without_denoising();
        settings.antialiasing.enabled = true;
        settings
    }
}

impl Method for Taa {
    fn name(&self) -> String {
        self.method.name() + SUFFIX
    }

    fn needs_halves(&self) -> bool {
        self.method.needs_halves()
    }

    fn reset(&mut self) {
        self.method.reset();
        if let Some(denoiser) = &mut self.denoiser {
            denoiser.reset();
        }
    }

    fn ran_on(&self) -> Option<(&'static str, String)> {
        self.method.ran_on()
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let picture = self.method.denoise(input)?;
        let denoiser = match self.denoiser.take().filter(|denoiser| denoiser.size() == input.frame.size) {
            Some(denoiser) => denoiser,
            None => Denoiser::new(input.frame.size, &Self::settings())?,
        };
        let denoiser = self.denoiser.insert(denoiser);
        let frame = Frame {
            direct: Some(picture.view()),
            matte: None,
            glossy: None,
            matte_weight: None,
            glossy_weight: None,
            direct_matte: None,
            direct_glossy: None,
            passes: &[],
            ..*input.frame
        };
        Ok(denoiser.denoise(&frame)?.composite.clone())
    }
}
