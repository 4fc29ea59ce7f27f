//! Where the frames of a sequence lie: files, folders, `####`, `%04d`, globs; one file a frame or one file a pass.

mod names;
mod passes;

use crate::error::Error;
use crate::image::ExrImage;
use crate::roles::Mapping;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One file of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSource {
    /// The file.
    pub path: PathBuf,
    /// The pass that its name says (`albedo` of `shot.albedo.1001.exr`); empty where frames have one file.
    pub pass: String,
}

/// The files of one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSources {
    /// Frame number; 0 where names have none.
    pub number: i64,
    /// Its files, in the same order in every frame.
    pub files: Vec<FrameSource>,
}

impl FrameSources {
    /// Reads what the frame's files hold, without samples.
    ///
    /// # Errors
    /// As [`crate::read_headers`].
    pub fn read_headers(&self) -> Result<Vec<ExrImage>, Error> {
        self.files.iter().map(|file| crate::image::read_headers(&file.path)).collect()
    }

    /// Reads the channels of the frame's files that a mapping needs.
    ///
    /// # Errors
    /// As [`crate::read_headers`].
    pub fn read(&self, mapping: &Mapping) -> Result<Vec<ExrImage>, Error> {
        let read =
            |(i, file): (usize, &FrameSource)| crate::image::read_channels(&file.path, crate::adapt::reads(mapping, i));
        self.files.iter().enumerate().map(read).collect()
    }

    /// Images with the pass that their file's name says, as [`crate::map_roles`] takes them.
    pub fn named<'i>(&self, images: &'i [ExrImage]) -> Vec<(String, &'i ExrImage)> {
        self.files.iter().map(|file| file.pass.clone()).zip(images).collect()
    }
}

/// A sequence, sorted by frame number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// The frames; at least one.
    pub frames: Vec<FrameSources>,
    /// Numbers missing between the first frame and the last: first and last of each gap.
    pub gaps: Vec<(i64, i64)>,
    /// Frames left out because one of their files is missing, with the name of the pass.
    pub incomplete: Vec<(i64, String)>,
}

impl Sequence {
    /// The frame of that number.
    pub fn frame(&self, number: i64) -> Option<&FrameSources> {
        let at = self.frames.binary_search_by_key(&number, |frame| frame.number).ok()?;
        self.frames.get(at)
    }
}

/// Finds the frames that `inputs` mean: files, folders (every `.exr` in them and one level below), patterns with
/// `####` or `%04d` (any number of digits, a sign before them), globs. A path that exists means itself, whatever signs
/// its name holds. Frames come in numeric order.
///
/// # Errors
/// [`Error::Invalid`] where an input means no file, where two files are the same frame, or where there are several
/// sequences whose names say no passes; [`Error::Io`] where a folder cannot be listed.
pub fn find_sequence(inputs: &[PathBuf]) -> Result<Sequence, Error> {
    let mut files: Vec<PathBuf> = Vec::new();
    for input in inputs {
        let before = files.len();
        files.extend(names::expand(input)?);
        if files.len() == before {
            let what = if input.is_dir() { "this folder holds no .exr files" } else { "no file has this name" };
            return Err(Error::invalid(input, what));
        }
    }
    files.sort();
    files.dedup();
    let mut groups: BTreeMap<names::Stem, BTreeMap<i64, PathBuf>> = BTreeMap::new();
    for file in files {
        let (stem, number) = names::split(&file);
        if let Some(twin) = groups.entry(stem).or_default().insert(number, file.clone()) {
            return Err(Error::invalid(&file, format!("{} is frame {number}, too", twin.display())));
        }
    }
    let first = inputs.first().map_or(Path::new(""), PathBuf::as_path);
    join(first, groups)
}

fn join(input: &Path, groups: BTreeMap<names::Stem, BTreeMap<i64, PathBuf>>) -> Result<Sequence, Error> {
    let stems: Vec<&names::Stem> = groups.keys().collect();
    let passes = match stems.as_slice() {
        [] => return Err(Error::invalid(input, "there are no frames")),
        [_] => vec![String::new()],
        several => passes::tell(several)?.ok_or_else(|| {
            let names: Vec<String> = several.iter().take(6).map(|stem| format!("`{stem}`")).collect();
            let reason = format!("{} sequences, and their names tell no passes: {}", several.len(), names.join(", "));
            Error::invalid(input, format!("{reason}; name one of them"))
        })?,
    };
    let mut frames: BTreeMap<i64, Vec<FrameSource>> = BTreeMap::new();
    for (pass, files) in passes.iter().zip(groups.values()) {
        for (number, path) in files {
            frames.entry(*number).or_default().push(FrameSource { path: path.clone(), pass: pass.clone() });
        }
    }
    let mut incomplete = Vec::new();
    frames.retain(|number, files| {
        let missing = passes.iter().find(|pass| !files.iter().any(|file| file.pass == **pass));
        incomplete.extend(missing.map(|pass| (*number, pass.clone())));
        missing.is_none()
    });
    if frames.is_empty() {
        let passes: Vec<String> = passes.iter().map(|pass| format!("`{pass}`")).collect();
        return Err(Error::invalid(input, format!("no frame has all of the passes {}", passes.join(", "))));
    }
    let numbers: Vec<i64> = frames.keys().copied().collect();
    let gaps = numbers
        .windows(2)
        .filter(|pair| pair[1].saturating_sub(pair[0]) > 1)
        .map(|pair| (pair[0] + 1, pair[1] - 1))
        .collect();
    let frames = frames.into_iter().map(|(number, files)| FrameSources { number, files }).collect();
    Ok(Sequence { frames, gaps, incomplete })
}
