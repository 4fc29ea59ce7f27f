//! Everything that is compared: the noisy input, quell, and the baselines, each from its own paper.
//!
//! ```text
//! none.rs      the noisy input as it is
//! external.rs  methods of others: finished frames, or a command
//! quell.rs     quell with a preset, and the talk's ablations
//! sequence.rs  quell's filter of whole sequences
//! atrous.rs    Dammertz et al. 2010
//! temporal.rs  accumulation alone
//! svgf/        Schied et al. 2017
//! bmfr.rs      blockwise regression on features: Koskela et al. 2019
//! oidn/        Open Image Denoise, loaded at run time
//! taa.rs       any of them before quell's temporal anti-aliasing
//! surface.rs   what the temporal ones share: which pixels of the frame before show the same surface
//! wavelet.rs   the pattern of the a-trous wavelet
//! nlm.rs       non-local means, with features or of colour alone: Rousselle et al. 2013, 2012
//! wlr/         weighted local regression: Moon et al. 2014
//! nfor.rs      first-order regression on features, weights from colour: Bitterli et al. 2016
//! offline/     what the offline ones share: halves, features, non-local means, least squares
//! ```
//!
//! All methods get the same frames and guides in the same order, keep what they like between frames, and answer with
//! the finished picture. [`parse`] finds a method by its name.

pub mod atrous;
pub mod bmfr;
pub mod external;
pub mod nfor;
pub mod nlm;
pub mod none;
pub mod offline;
pub mod oidn;
pub mod quell;
pub mod sequence;
mod surface;
pub mod svgf;
pub mod taa;
pub mod temporal;
mod wavelet;
pub mod wlr;

use crate::backend::Backend;
use crate::error::Error;
use ::quell::{Frame, Plane, PlaneRef, Rgb};
use quell_trace::HalfSignals;

/// What a method reads of one frame.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Signals (means over all samples of both halves), weights and guides.
    pub frame: &'a Frame<'a>,
    /// The signals of two independent halves of the samples, A and B; absent where the frame has one sample a pixel.
    pub halves: Option<[&'a HalfSignals; 2]>,
}

impl Input<'_> {
    /// The noisy picture from all samples, scene-linear.
    pub fn composite(&self) -> Plane<Rgb> {
        self.frame.composite()
    }

    /// The noisy pictures from halves A and B; they share the direct term.
    pub fn half_composites(&self) -> Option<[Plane<Rgb>; 2]> {
        let halves = self.halves?;
        Some(halves.map(|h| composite(self.frame, Some(h.matte.view()), Some(h.glossy.view()))))
    }

    /// Albedo as a feature: the sum of both weights, per channel at most 1; 0 where there is no surface.
    pub fn albedo(&self) -> Plane<Rgb> {
        Plane::from_fn(self.frame.size, |x, y| {
            if self.frame.view_depth.is_some_and(|d| !d.at(x, y).is_finite()) {
                return [0.0; 3];
            }
            let of = |p: Option<PlaneRef<'_, Rgb>>| p.map_or([0.0; 3], |p| p.at(x, y));
            let (m, g) = (of(self.frame.matte_weight), of(self.frame.glossy_weight));
            std::array::from_fn(|c| (m[c] + g[c]).clamp(0.0, 1.0))
        })
    }
}

/// The frame's picture with other signals in place of its own; see [`Frame::composite`].
pub fn composite(frame: &Frame<'_>, matte: Option<PlaneRef<'_, Rgb>>, glossy: Option<PlaneRef<'_, Rgb>>) -> Plane<Rgb> {
    Frame { matte, glossy, ..*frame }.composite()
}

/// A way to a clean picture.
pub trait Method: Send {
    /// The name by which it is asked for and listed: `svgf`, `quell:paper`.
    fn name(&self) -> String;

    /// Whether it works only on frames with two halves ([`Input::halves`]).
    fn needs_halves(&self) -> bool {
        false
    }

    /// Forgets all earlier frames.
    fn reset(&mut self) {}

    /// The back end that it ran on, where that is not this processor, and what a reader must know of its figures.
    fn ran_on(&self) -> Option<(&'static str, String)> {
        None
    }

    /// The clean picture of the next frame, scene-linear. Frames come in order; one whose number does not follow is
    /// a cut.
    ///
    /// # Errors
    /// What the method misses or cannot do, in a sentence.
    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error>;

    /// Whether a picture also depends on frames that come after it. Then [`Method::push`] gives pictures late.
    fn looks_ahead(&self) -> bool {
        false
    }

    /// Takes the next frame of a sequence and gives the pictures that are finished, in order.
    ///
    /// # Errors
    /// As [`Method::denoise`].
    fn push(&mut self, input: &Input<'_>) -> Result<Vec<FinishedPicture>, Error> {
        Ok(vec![FinishedPicture { number: input.frame.index, picture: self.denoise(input)? }])
    }

    /// No frame follows: gives the pictures that are left.
    ///
    /// # Errors
    /// As [`Method::denoise`].
    fn finish(&mut self) -> Result<Vec<FinishedPicture>, Error> {
        Ok(Vec::new())
    }
}

/// A picture of [`Method::push`].
#[derive(Clone, Debug, PartialEq)]
pub struct FinishedPicture {
    /// Number of its frame.
    pub number: i64,
    /// Scene-linear.
    pub picture: Plane<Rgb>,
}

/// Finds a method by its name.
///
/// # Errors
/// [`Error::UnknownMethod`] with the nearest names.
pub fn parse(name: &str) -> Result<Box<dyn Method>, Error> {
    if let Some(behind) = name.strip_suffix(taa::SUFFIX) {
        return antialiased(name, parse(behind)?);
    }
    if name == "none" {
        return Ok(Box::new(none::None));
    }
    if name == "atrous" {
        return Ok(Box::new(atrous::Atrous::default()));
    }
    if let Some(method) = oidn::Oidn::parse(name) {
        return Ok(Box::new(method));
    }
    if name == "temporal" {
        return Ok(Box::new(temporal::Temporal::default()));
    }
    if let Some((_, constants)) = svgf::VARIANTS.iter().find(|(variant, _)| *variant == name) {
        return Ok(Box::new(svgf::Svgf::new(name, *constants)));
    }
    match name {
        "bmfr" => return Ok(Box::new(bmfr::Bmfr::default())),
        "nlm" | "nlm:colour" => return Ok(Box::new(nlm::Nlm::new(name == "nlm"))),
        "wlr" => return Ok(Box::new(wlr::Wlr::default())),
        "nfor" => return Ok(Box::new(nfor::Nfor::default())),
        _ => {}
    }
    if name.starts_with("quell:") {
        return parse_on(name, &Backend::Cpu(::quell::Backend::Cpu));
    }
    Err(Error::UnknownMethod {
        name: name.to_owned(),
        nearest: ::quell::settings::nearest(name, NAMES.iter().copied()),
    })
}

fn antialiased(name: &str, method: Box<dyn Method>) -> Result<Box<dyn Method>, Error> {
    let nearest = vec![method.name()];
    // quell's own has the stage itself: `quell:paper+antialiasing.enabled=on`. Twice would be a filter of its own.
    match taa::Taa::behind(method).filter(|_| !name.starts_with("quell:")) {
        Some(method) => Ok(Box::new(method)),
        None => Err(Error::UnknownMethod { name: name.to_owned(), nearest }),
    }
}

/// Finds a method by its name; quell's own filters run on this back end.
///
/// # Errors
/// As [`parse`].
pub fn parse_on(name: &str, backend: &Backend) -> Result<Box<dyn Method>, Error> {
    if let Some(behind) = name.strip_suffix(taa::SUFFIX) {
        return antialiased(name, parse_on(behind, backend)?);
    }
    match name.strip_prefix("quell:") {
        Some(variant) => Ok(match sequence::Sequence::parse(variant)? {
            Some(method) => Box::new(method.on(backend)),
            None => Box::new(self::quell::Quell::parse(variant)?.on(backend)),
        }),
        None => parse(name),
    }
}

/// Names that [`parse`] knows.
pub const NAMES: &[&str] = &[
    "none",
    "temporal",
    "quell:quality",
    "quell:paper",
    "quell:sequence",
    "atrous",
    "svgf",
    "svgf:later",
    "bmfr",
    "nlm",
    "nlm:colour",
    "wlr",
    "nfor",
    "oidn:fast",
    "oidn:balanced",
    "oidn:high",
    "temporal+oidn:high",
];
