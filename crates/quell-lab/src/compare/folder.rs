//! A sequence from files that `quell render` (or `quell compare`) wrote.

use super::sequence::{NoisyFrame, ReferenceHalf, Sequence, SequenceReference, Stored, scored_of};
use crate::error::Error;
use crate::references::halves_rel_mse;
use crate::tone::Tone;
use quell::{Plane, Rgb};
use quell_frames::{FrameFile, find_frames, read_frame};
use quell_trace::HalfSignals;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Subfolder and stem of the references, as `quell render` names them.
pub const REFERENCE: &str = "reference";
/// Energies of the noisy frames and of their references may differ by this factor before exposures are suspected.
const MOST_ENERGY: f64 = 1.25;

/// Where the files lie.
pub struct FolderSource {
    /// Holds `noisy/noisy.0012.exr` and so on, or those files themselves.
    pub folder: PathBuf,
    /// Holds `reference.0012.exr` and so on, in itself or in its subfolder `reference`; absent: `folder`.
    pub references: Option<PathBuf>,
    /// Of all frames take these only.
    pub frames: Option<Vec<i64>>,
    /// Of all references take these only.
    pub reference_frames: Option<Vec<i64>>,
}

impl FolderSource {
    /// Finds the frames and reads the references. Noisy frames are read when they are asked for.
    ///
    /// # Errors
    /// [`Error::Empty`] where there are no frames, or no reference of any of them; [`Error::Size`] where extents
    /// differ; files that cannot be read.
    pub fn load(&self) -> Result<Sequence, Error> {
        let mut frames = frames_in(&self.folder, super::scene::NOISY)?;
        if let Some(chosen) = &self.frames {
            if let Some(missing) = chosen.iter().find(|n| !frames.iter().any(|(f, _)| f == *n)) {
                let what = format!("{} holds no frame {missing}", self.folder.display());
                return Err(Error::Empty { what });
            }
            frames.retain(|(number, _)| chosen.contains(number));
        }
        let place = self.references.as_ref().unwrap_or(&self.folder);
        let mut files = frames_in(place, REFERENCE)?;
        if let Some(chosen) = &self.reference_frames {
            files.retain(|(number, _)| chosen.contains(number));
        }
        let numbers: Vec<i64> = frames.iter().map(|(number, _)| *number).collect();
        let mut notes = Vec::new();
        let (fitting, others): (Vec<_>, Vec<_>) = files.into_iter().partition(|(n, _)| numbers.contains(n));
        if fitting.is_empty() {
            let range = |list: &[i64]| match (list.first(), list.last()) {
                (Some(first), Some(last)) => format!("{first} to {last}"),
                _ => "none".to_owned(),
            };
            let found: Vec<i64> = others.iter().map(|(n, _)| *n).collect();
            return Err(Error::Empty {
                what: format!(
                    "no frame has a reference: frames are {}, references in {} are {}",
                    range(&numbers),
                    place.display(),
                    range(&found)
                ),
            });
        }
        if !others.is_empty() {
            notes.push(format!("{} references belong to no frame of the sequence and are left out.", others.len()));
        }
        if fitting.len() < numbers.len() {
            notes.push(format!("{} of {} frames have references.", fitting.len(), numbers.len()));
        }
        let Some((_, first)) = frames.first() else {
            return Err(Error::Empty { what: format!("{} holds no frames", self.folder.display()) });
        };
        let first = read_frame(first)?;
        let size = first.frame.size;
        let mut references = BTreeMap::new();
        for (number, path) in &fitting {
            let file = read_frame(path)?;
            if file.frame.size != size {
                return Err(Error::Empty {
                    what: format!(
                        "{} is {}, but the noisy frames are {size}: references must have their extent",
                        path.display(),
                        file.frame.size
                    ),
                });
            }
            references.insert(*number, reference_of(file));
        }
        check_light(&frames, &references, &mut notes)?;
        let referenced: Vec<i64> = references.keys().copied().collect();
        let m = &first.metadata;
        Ok(Sequence {
            name: if m.scene.is_empty() { name_of(&self.folder) } else { m.scene.clone() },
            description: if m.sampling.is_empty() { self.folder.display().to_string() } else { m.sampling.clone() },
            size,
            scored: scored_of(&numbers, &referenced),
            tone: Tone { exposure: m.exposure },
            identity: identity(&frames, m)?,
            notes,
            numbers,
            stored: frames.into_iter().map(|(_, path)| Stored::File(path)).collect(),
            references,
        })
    }
}

/// The files `STEM.0012.exr` of a folder or of its subfolder `STEM`.
fn frames_in(folder: &Path, stem: &str) -> Result<Vec<(i64, PathBuf)>, Error> {
    for place in [folder.join(stem), folder.to_owned()] {
        if !place.is_dir() {
            continue;
        }
        let found = find_frames(&place, stem)?;
        if !found.is_empty() {
            return Ok(found);
        }
    }
    let advice = if stem == REFERENCE { "; `quell render --reference` makes them" } else { "" };
    Err(Error::Empty { what: format!("{} holds no files {stem}.0001.exr and so on{advice}", folder.display()) })
}

fn name_of(folder: &Path) -> String {
    folder.file_name().map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// Sizes and times of the files: whoever changes one has changed the sequence.
fn identity(frames: &[(i64, PathBuf)], metadata: &quell_frames::Metadata) -> Result<String, Error> {
    let mut text = format!("{} {}", metadata.scene_hash, metadata.sampling);
    for (number, path) in frames {
        let about = std::fs::metadata(path).map_err(|e| quell_frames::Error::io(path, "read", e))?;
        let changed = about.modified().ok().and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
        text.push_str(&format!(" {number}:{}:{}", about.len(), changed.map_or(0, |t| t.as_nanos())));
    }
    Ok(text)
}

/// A noisy frame from its file.
pub(super) fn noisy_frame(file: FrameFile) -> NoisyFrame {
    let [a, b] = file.halves;
    let signals = |half: quell_frames::HalfBuf| Some(HalfSignals { matte: half.matte?, glossy: half.glossy? });
    let halves = match (signals(a), signals(b)) {
        (Some(a), Some(b)) => Some([a, b]),
        _ => None,
    };
    NoisyFrame { frame: file.frame, halves }
}

fn reference_of(file: FrameFile) -> SequenceReference {
    let mean = file.composite.unwrap_or_else(|| file.frame.composite());
    let [a, b] = file.halves;
    let half = |half: quell_frames::HalfBuf| {
        Some(ReferenceHalf { beauty: half.composite?, direct: None, matte: half.matte, glossy: half.glossy })
    };
    let halves = match (half(a), half(b)) {
        (Some(a), Some(b)) => Some([a, b]),
        _ => None,
    };
    let own_error = halves.as_ref().map(|[a, b]| halves_rel_mse(&a.beauty, &b.beauty));
    SequenceReference { mean, halves, own_error }
}

/// Compares the light of the frames with that of their references: a factor is another exposure, or another scene.
fn check_light(
    frames: &[(i64, PathBuf)],
    references: &BTreeMap<i64, SequenceReference>,
    notes: &mut Vec<String>,
) -> Result<(), Error> {
    let sum = |plane: &Plane<Rgb>| -> f64 {
        plane.data().iter().flatten().map(|v| f64::from(*v)).filter(|v| v.is_finite()).sum()
    };
    let (mut noisy, mut converged): (f64, f64) = (0.0, 0.0);
    // Three frames are enough; reading all would take as long as a method.
    let step = references.len().div_ceil(3).max(1);
    for (number, reference) in references.iter().step_by(step) {
        let Some((_, path)) = frames.iter().find(|(n, _)| n == number) else { continue };
        let file = read_frame(path)?;
        Error::same_size("noisy frame", file.frame.size, reference.mean.size())?;
        noisy += sum(&file.frame.composite());
        converged += sum(&reference.mean);
    }
    let ratio = noisy / converged;
    if ratio.is_finite() && !(1.0 / MOST_ENERGY..=MOST_ENERGY).contains(&ratio) {
        notes.push(format!(
            "The noisy frames hold {ratio:.3} of the references' light: have both the same exposure, scene and camera? \
             Scores are of little use otherwise."
        ));
    }
    Ok(())
}
