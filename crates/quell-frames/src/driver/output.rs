//! Where filtered frames go, and what may stand there already.

use crate::Error;
use std::path::{Path, PathBuf};

/// What to do about files that exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Existing {
    /// Files that quell wrote are replaced; others are in the way.
    #[default]
    Ours,
    /// Frames whose file exists are left alone, whoever wrote it.
    Skip,
    /// Frames that quell wrote with the same settings are left alone; others of quell's are replaced.
    Resume,
    /// All are replaced.
    Overwrite,
}

/// Where frames are written: a folder, in which each file keeps its input's name, or a pattern with the frame's number in
/// it, `####` or `%04d`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Destination {
    folder: PathBuf,
    /// What stands before the number, its least digits, what stands after it.
    pattern: Option<(String, usize, String)>,
}

impl Destination {
    /// From what the user typed. A name that ends in `.exr` is a pattern and needs a number; anything else is a folder.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn parse(text: &Path) -> Result<Self, String> {
        let name = text.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if !name.to_ascii_lowercase().ends_with(".exr") {
            if number_place(name).is_some() {
                return Err(format!(
                    "the output `{}` has a place for the frame's number but does not end in .exr",
                    text.display()
                ));
            }
            return Ok(Self { folder: text.to_owned(), pattern: None });
        }
        let Some((before, digits, after)) = number_place(name) else {
            return Err(format!(
                "the output `{}` has no place for the frame's number; write #### or %04d, or name a folder",
                text.display()
            ));
        };
        let folder = text.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned();
        Ok(Self { folder, pattern: Some((before, digits, after)) })
    }

    /// The folder that files go to.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file of a frame whose input is `input`.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the input has no file name.
    pub fn path(&self, number: i64, input: &Path) -> Result<PathBuf, Error> {
        let name = match &self.pattern {
            None => {
                let name = input.file_name().ok_or_else(|| Error::invalid(input, "this path names no file"))?;
                return Ok(self.folder.join(name));
            }
            Some((before, digits, after)) => {
                let sign = if number < 0 { "-" } else { "" };
                format!("{before}{sign}{:0digits$}{after}", number.unsigned_abs())
            }
        };
        Ok(self.folder.join(name))
    }
}

/// Finds `####` or `%04d` (`%d`) in a name: what stands before, how many digits, what stands after.
fn number_place(name: &str) -> Option<(String, usize, String)> {
    if let Some(from) = name.find('#') {
        let count = name[from..].bytes().take_while(|b| *b == b'#').count();
        return Some((name[..from].to_owned(), count, name[from + count..].to_owned()));
    }
    let from = name.find('%')?;
    let rest = &name[from + 1..];
    let end = rest.find('d')?;
    let digits = &rest[..end];
    let width = digits.strip_prefix('0').unwrap_or(digits);
    let width = if digits.is_empty() { 1 } else { width.parse().ok().filter(|w| (1..=20).contains(w))? };
    Some((name[..from].to_owned(), width, rest[end + 1..].to_owned()))
}

/// The header attribute that names version, settings and mapping of the job that wrote a file.
pub const JOB_ATTRIBUTE: &str = "quell.job";

/// A short name for everything that decides what a job writes: the same on every machine (FNV-1a, 64 bits).
pub fn job_key<'t>(texts: impl IntoIterator<Item = &'t str>) -> String {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |byte: u8| hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    for text in texts {
        text.bytes().for_each(&mut add);
        add(0);
    }
    format!("{hash:016x}")
}

/// Whether a frame that would be written to `path` is there already, so that it need not be made.
///
/// `job` is its [`job_key`].
pub fn is_done(path: &Path, existing: Existing, job: &str) -> bool {
    match existing {
        Existing::Ours | Existing::Overwrite => false,
        Existing::Skip => path.exists(),
        Existing::Resume => crate::image::read_headers(path)
            .is_ok_and(|image| image.text(JOB_ATTRIBUTE).is_some_and(|written_by| written_by == job)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(text: &str, number: i64) -> String {
        let destination = Destination::parse(Path::new(text)).unwrap();
        destination.path(number, Path::new("in/shot.0007.exr")).unwrap().to_string_lossy().replace('\\', "/")
    }

    #[test]
    fn folders_keep_names_and_patterns_make_them() {
        assert_eq!(place("clean", 7), "clean/shot.0007.exr");
        assert_eq!(place("clean/a.####.exr", 7), "clean/a.0007.exr");
        assert_eq!(place("clean/a_%03d_x.exr", -7), "clean/a_-007_x.exr");
        assert_eq!(place("a.%d.EXR", 12), "./a.12.EXR");
        assert_eq!(place("a.#.exr", 12345), "./a.12345.exr");
    }

    #[test]
    fn patterns_without_a_number_are_refused() {
        let error = |text: &str| Destination::parse(Path::new(text)).unwrap_err();
        assert!(error("clean/a.exr").contains("####"));
        assert!(error("clean/####").contains(".exr"));
        assert!(error("clean/a.%q.exr").contains("####"));
    }

    #[test]
    fn the_key_tells_jobs_apart() {
        assert_eq!(job_key(["a", "b"]), job_key(["a", "b"]));
        assert_ne!(job_key(["a", "b"]), job_key(["ab", ""]));
        assert_eq!(job_key([]), "cbf29ce484222325");
    }
}
