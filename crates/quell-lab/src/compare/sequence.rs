//! Noisy frames in order, and references of some of them.

use crate::error::Error;
use crate::methods::Input;
use crate::tone::Tone;
use quell::{FrameBuf, Plane, Rgb, Size};
use quell_trace::HalfSignals;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The first frames of a sequence are its start, not its steady state: a fixed blend of 0.9 needs some thirty.
pub const START_FRAMES: usize = 16;
/// Frames that are scored by default.
pub const SCORED_FRAMES: usize = 16;
/// Ghosting compares with the references of so many frames before (evaluation.md, section 3, h_t).
pub const FRAMES_BEFORE: usize = 8;

/// One noisy frame with its halves, where its samples came in two.
#[derive(Clone, Debug)]
pub struct NoisyFrame {
    /// Signals, weights and guides.
    pub frame: FrameBuf,
    /// The signals of two independent halves of the samples.
    pub halves: Option<[HalfSignals; 2]>,
}

impl NoisyFrame {
    /// Hands the frame to `f` as methods read it.
    pub fn with_input<R>(&self, f: impl FnOnce(&Input<'_>) -> R) -> R {
        let passes = self.frame.pass_views();
        let frame = self.frame.frame(&passes);
        let halves = self.halves.as_ref().map(|[a, b]| [a, b]);
        f(&Input { frame: &frame, halves })
    }
}

/// One of two independent estimates of a converged frame, scene-linear.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceHalf {
    /// The whole picture.
    pub beauty: Plane<Rgb>,
    /// The direct term within it, where it is known.
    pub direct: Option<Plane<Rgb>>,
    /// The matte signal without its weight, where it is known.
    pub matte: Option<Plane<Rgb>>,
    /// The glossy signal without its weight, where it is known.
    pub glossy: Option<Plane<Rgb>>,
}

/// A converged frame.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceReference {
    /// The picture from all samples.
    pub mean: Plane<Rgb>,
    /// Two independent halves; absent where there is one picture only, whose own noise is then unknown.
    pub halves: Option<[ReferenceHalf; 2]>,
    /// Trimmed relMSE of `mean` against the truth, from the halves.
    pub own_error: Option<f64>,
}

/// Where a noisy frame lies.
pub(super) enum Stored {
    /// With its file, where it lies in one as well.
    Memory(Box<NoisyFrame>, Option<PathBuf>),
    File(PathBuf),
}

/// Noisy frames in order, with references of some of them.
pub struct Sequence {
    /// The scene's or the folder's name.
    pub name: String,
    /// Which camera and how light was sampled, in words.
    pub description: String,
    /// Extent of every picture.
    pub size: Size,
    /// Numbers of the frames, ascending.
    pub numbers: Vec<i64>,
    /// Numbers of the frames that are scored: they have references, and where there are enough, so have the
    /// [`FRAMES_BEFORE`] frames before each. Ascending.
    pub scored: Vec<i64>,
    /// Brightness of pictures.
    pub tone: Tone,
    /// Stands for everything that the noisy frames depend on.
    pub identity: String,
    /// Sentences that a reader should know.
    pub notes: Vec<String>,
    pub(super) stored: Vec<Stored>,
    pub(super) references: BTreeMap<i64, SequenceReference>,
}

impl Sequence {
    /// Noisy frame number `index` of [`Sequence::numbers`], from memory or from its file.
    ///
    /// # Errors
    /// A file that cannot be read; [`Error::Empty`] where there is no such frame.
    pub fn frame(&self, index: usize) -> Result<Cow<'_, NoisyFrame>, Error> {
        match self.stored.get(index) {
            Some(Stored::Memory(frame, _)) => Ok(Cow::Borrowed(frame)),
            Some(Stored::File(path)) => {
                let file = quell_frames::read_frame(path)?;
                let found = super::folder::noisy_frame(file);
                Error::same_size("noisy frame", found.frame.size, self.size)?;
                Ok(Cow::Owned(found))
            }
            None => Err(Error::Empty { what: format!("there is no frame {index}: there are {}", self.numbers.len()) }),
        }
    }

    /// The file of a noisy frame, where it lies in one.
    pub fn file(&self, index: usize) -> Option<&std::path::Path> {
        match self.stored.get(index) {
            Some(Stored::File(path)) | Some(Stored::Memory(_, Some(path))) => Some(path),
            _ => None,
        }
    }

    /// The reference of frame `number`.
    pub fn reference(&self, number: i64) -> Option<&SequenceReference> {
        self.references.get(&number)
    }

    /// All references by frame number.
    pub fn references(&self) -> &BTreeMap<i64, SequenceReference> {
        &self.references
    }

    /// Place of a frame number in the sequence.
    pub fn index_of(&self, number: i64) -> Option<usize> {
        self.numbers.binary_search(&number).ok()
    }

    /// Whether the frame at `index` belongs to the steady state: [`START_FRAMES`] came before it without a gap.
    pub fn is_steady(&self, index: usize) -> bool {
        let Some(number) = self.numbers.get(index) else { return false };
        index >= START_FRAMES && self.numbers[index - START_FRAMES] == number - START_FRAMES as i64
    }

    /// Mean of the references' own trimmed relMSE; `None` without halves.
    pub fn reference_error(&self) -> Option<f64> {
        let errors: Vec<f64> = self.scored.iter().filter_map(|n| self.references.get(n)?.own_error).collect();
        (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
    }
}

/// Which frames get references and which of them are scored, unless the user says: the last steady ones in a row, and
/// [`FRAMES_BEFORE`] before them. Of a sequence that is too short to become steady, the later half.
pub fn default_choice(numbers: &[i64]) -> Vec<i64> {
    let count = numbers.len();
    let steady = count.saturating_sub(START_FRAMES);
    let scored = if steady > 0 { steady.min(SCORED_FRAMES) } else { count.div_ceil(2) };
    numbers[count - (scored + FRAMES_BEFORE).min(count)..].to_vec()
}

/// Of the frames with references those that are scored: the ones with [`FRAMES_BEFORE`] referenced frames right before
/// them, or all, where no frame has as many. Steady ones only, where there are any.
pub fn scored_of(numbers: &[i64], referenced: &[i64]) -> Vec<i64> {
    let has = |n: i64| referenced.binary_search(&n).is_ok();
    let known = |n: &i64| numbers.binary_search(n).is_ok() && has(*n);
    let preceded = |n: &i64| (1..=FRAMES_BEFORE as i64).all(|k| n.checked_sub(k).is_some_and(has));
    let steady = |n: &i64| numbers.binary_search(n).is_ok_and(|i| i >= START_FRAMES);
    let all: Vec<i64> = referenced.iter().copied().filter(known).collect();
    let narrowed = |list: Vec<i64>, keep: &dyn Fn(&i64) -> bool| {
        let kept: Vec<i64> = list.iter().copied().filter(|n| keep(n)).collect();
        if kept.is_empty() { list } else { kept }
    };
    narrowed(narrowed(all, &steady), &preceded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_steady_frames_are_scored_and_those_before_have_references() {
        let numbers: Vec<i64> = (0..64).collect();
        let referenced = default_choice(&numbers);
        assert_eq!((referenced[0], referenced.len()), (40, 24));
        assert_eq!(scored_of(&numbers, &referenced), (48..64).collect::<Vec<_>>());
        // Two dozen frames: eight are steady.
        let numbers: Vec<i64> = (100..124).collect();
        let referenced = default_choice(&numbers);
        assert_eq!(referenced, (108..124).collect::<Vec<_>>());
        assert_eq!(scored_of(&numbers, &referenced), (116..124).collect::<Vec<_>>());
        // Two frames: what there is.
        assert_eq!(default_choice(&[5, 6]), [5, 6]);
        assert_eq!(scored_of(&[5, 6], &[5, 6]), [5, 6]);
        // Every fourth: no frame has all before it, so all steady ones count.
        let numbers: Vec<i64> = (0..40).collect();
        let referenced: Vec<i64> = (0..40).step_by(4).collect();
        assert_eq!(scored_of(&numbers, &referenced), [16, 20, 24, 28, 32, 36]);
        // References of frames that there are not.
        assert_eq!(scored_of(&[1, 2], &[7, 8]), Vec::<i64>::new());
    }
}
