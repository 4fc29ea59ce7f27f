//! The scorecard: ten figures for the artefacts of a denoised sequence (docs/scorecard.md).
//!
//! [`Instruments`] are made once a sequence, from the references and the noise-free guides; [`Instruments::score`] then
//! reads any number of results against them.

pub mod score;

pub use score::{Score, Scores};

use crate::error::Error;
use quell::{FrameBuf, Plane, Rgb, Size};

/// One frame of the sequence as the instruments read it. Frames follow each other by one, without cuts.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceFrame<'a> {
    /// Guides (depth, normal, id, motion, cameras), weights and `direct`, all without noise. Its signals are not read.
    pub frame: &'a FrameBuf,
    /// The converged picture, half A, scene-linear.
    pub a: &'a Plane<Rgb>,
    /// Half B, whose noise is independent of A's. `None`: there is one reference only, and floors are given.
    pub b: Option<&'a Plane<Rgb>>,
    /// The direct term within `a`; `None`: `frame.direct`. Read by flatness and lag.
    pub a_direct: Option<&'a Plane<Rgb>>,
    /// The direct term within `b`, likewise.
    pub b_direct: Option<&'a Plane<Rgb>>,
    /// Whether the frame counts. `false`: warm-up, which serves as the past of later frames only.
    pub scored: bool,
}

impl<'a> ReferenceFrame<'a> {
    /// A scored frame with one reference.
    pub fn new(frame: &'a FrameBuf, a: &'a Plane<Rgb>) -> Self {
        Self { frame, a, b: None, a_direct: None, b_direct: None, scored: true }
    }
}

/// Everything of a sequence that does not depend on the result that is scored.
#[derive(Debug)]
pub struct Instruments {
    size: Size,
    frames: usize,
}

impl Instruments {
    /// Reads the references of a sequence, in order.
    ///
    /// # Errors
    /// [`Error::Empty`] without frames, [`Error::Size`] where pictures differ in extent.
    pub fn new(frames: &[ReferenceFrame<'_>]) -> Result<Self, Error> {
        let first = frames.first().ok_or_else(|| Error::Empty { what: "the sequence has no frame".to_owned() })?;
        let size = first.a.size();
        for f in frames {
            Error::same_size("guides", f.frame.size, size)?;
            for (what, plane) in [
                ("reference", Some(f.a)),
                ("half B of the reference", f.b),
                ("direct term of the reference", f.a_direct),
                ("direct term of half B", f.b_direct),
            ] {
                if let Some(plane) = plane {
                    Error::same_size(what, plane.size(), size)?;
                }
            }
        }
        Ok(Self { size, frames: frames.len() })
    }

    /// Scores a result: one picture for each frame given to [`Instruments::new`], scene-linear.
    ///
    /// # Errors
    /// [`Error::Empty`] where the numbers of frames differ, [`Error::Size`] where pictures differ in extent.
    pub fn score(&self, pictures: &[Plane<Rgb>]) -> Result<Scores, Error> {
        if pictures.len() != self.frames {
            let what = format!("{} pictures cannot be scored against {} references", pictures.len(), self.frames);
            return Err(Error::Empty { what });
        }
        for picture in pictures {
            Error::same_size("picture", picture.size(), self.size)?;
        }
        Ok(Scores::all_null("not measured yet"))
    }
}
