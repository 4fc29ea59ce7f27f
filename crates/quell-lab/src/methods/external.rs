//! Methods of others: finished frames in a folder, or a command that makes them.
//!
//! `mine=DIR`: one EXR file a frame, its number last in the name (`any.0012.exr`), channels `R`, `G`, `B`, scene-linear.
//!
//! `mine='CMD {noisy} {out}'`: the command is run once through the system's shell, for the whole sequence. `{noisy}`
//! becomes a folder with the very frames that all methods get, `noisy.0012.exr`, all planes as `quell render` writes
//! them; `{out}` becomes an empty folder, where the command leaves frames as above. Its time is wall time over frames:
//! starting, reading and writing included.

use crate::error::Error;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What a command finds in place of these words.
pub const NOISY: &str = "{noisy}";
/// The folder for finished frames.
pub const OUT: &str = "{out}";
/// How often the command is looked after.
const LOOK: Duration = Duration::from_millis(20);
/// Lines of its output that a message quotes.
const QUOTED_LINES: usize = 4;

/// Something that takes part in a comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Competitor {
    /// One that [`super::parse`] knows.
    Method {
        /// As [`super::parse`] reads it.
        name: String,
    },
    /// Finished frames.
    Frames {
        /// As it is listed.
        name: String,
        /// Where they lie.
        folder: PathBuf,
    },
    /// A command that makes frames.
    Command {
        /// As it is listed.
        name: String,
        /// With `{noisy}` and `{out}`.
        command: String,
    },
}

impl Competitor {
    /// The name by which it is listed.
    pub fn name(&self) -> &str {
        match self {
            Self::Method { name } | Self::Frames { name, .. } | Self::Command { name, .. } => name,
        }
    }

    /// Reads a list as `--methods` has it: names divided by commas, `mine=DIR`; or alone, since commands hold commas,
    /// `mine=CMD {noisy} {out}`.
    ///
    /// # Errors
    /// [`Error::UnknownMethod`] with the nearest names, [`Error::Quell`] for a bad parameter, [`Error::Method`] for a
    /// command without `{out}` or an empty name. A method whose library is absent is no error here.
    pub fn list(text: &str) -> Result<Vec<Self>, Error> {
        if let Some((name, rest)) = external(text)
            && (rest.contains(OUT) || rest.contains(NOISY))
        {
            if !rest.contains(OUT) {
                let reason = format!("the command has no {OUT}, the folder where it shall leave its frames");
                return Err(Error::Method { method: name.to_owned(), reason });
            }
            return Ok(vec![Self::Command { name: name.to_owned(), command: rest.to_owned() }]);
        }
        let words = text.split(',').map(str::trim).filter(|word| !word.is_empty());
        words
            .map(|word| {
                if let Some((name, folder)) = external(word) {
                    if folder.contains(OUT) || folder.contains(NOISY) {
                        let reason = "a command may hold commas, so it stands alone: give it a --methods of its own";
                        return Err(Error::Method { method: name.to_owned(), reason: reason.to_owned() });
                    }
                    return Ok(Self::Frames { name: name.to_owned(), folder: PathBuf::from(folder) });
                }
                match super::parse(word) {
                    Err(error @ (Error::UnknownMethod { .. } | Error::Quell(_))) => Err(error),
                    _ => Ok(Self::Method { name: word.to_owned() }),
                }
            })
            .collect()
    }
}

/// `name=rest`, where the name is one word: `quell:paper+a.b=1` is none.
fn external(text: &str) -> Option<(&str, &str)> {
    let (name, rest) = text.split_once('=')?;
    let name = name.trim();
    let plain = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '-' || c == '_');
    (plain && !rest.trim().is_empty()).then_some((name, rest.trim()))
}

/// EXR files of a folder by the number at the end of their names: `any.0012.exr`, `any_0012.exr`, `0012.exr`; a minus
/// sign after a dot or at the start counts.
///
/// # Errors
/// A folder that cannot be listed; [`Error::Method`] where two files have one number, or none has any.
pub fn numbered_files(method: &str, folder: &Path) -> Result<BTreeMap<i64, PathBuf>, Error> {
    let list = |e| quell_frames::Error::io(folder, "list", e);
    let mut files: BTreeMap<i64, PathBuf> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(list)? {
        let path = entry.map_err(list)?.path();
        let Some(number) = number_of(&path) else { continue };
        if let Some(other) = files.insert(number, path.clone()) {
            let reason = format!("{} and {} both are frame {number}", other.display(), path.display());
            return Err(Error::Method { method: method.to_owned(), reason });
        }
    }
    if files.is_empty() {
        let reason = format!("{} holds no EXR file with a frame number, such as mine.0001.exr", folder.display());
        return Err(Error::Method { method: method.to_owned(), reason });
    }
    Ok(files)
}

fn number_of(path: &Path) -> Option<i64> {
    let name = path.file_name()?.to_str()?;
    let (stem, extension) = name.rsplit_once('.')?;
    if !extension.eq_ignore_ascii_case("exr") || name.starts_with('.') {
        return None;
    }
    let before = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let number: i64 = stem.get(before.len()..)?.parse().ok()?;
    let negative = before == "-" || before.ends_with(".-");
    Some(if negative { -number } else { number })
}

/// Runs a command for a whole sequence and waits for it. What it prints goes to the file `log`.
///
/// # Errors
/// [`Error::Method`] where it cannot be started or fails, with the end of what it printed;
/// [`quell_trace::TraceError::Cancelled`] after a stop.
pub fn run_command(
    name: &str,
    command: &str,
    noisy: &Path,
    out: &Path,
    log: &Path,
    cancel: Option<&AtomicBool>,
) -> Result<Duration, Error> {
    let failed = |reason: String| Error::Method { method: name.to_owned(), reason };
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let line = command.replace(NOISY, &quoted(&absolute(noisy))).replace(OUT, &quoted(&absolute(out)));
    let printed = std::fs::File::create(log).map_err(|e| quell_frames::Error::io(log, "write", e))?;
    let also = printed.try_clone().map_err(|e| quell_frames::Error::io(log, "write", e))?;
    let mut shell = if cfg!(windows) { Command::new("cmd") } else { Command::new("sh") };
    shell.arg(if cfg!(windows) { "/C" } else { "-c" }).arg(&line);
    shell.stdin(Stdio::null()).stdout(printed).stderr(also);
    let begin = Instant::now();
    let mut child = shell.spawn().map_err(|e| failed(format!("the command cannot be started: {e}")))?;
    let status = loop {
        match child.try_wait().map_err(|e| failed(format!("the command is lost: {e}")))? {
            Some(status) => break status,
            None if cancel.is_some_and(|c| c.load(Ordering::SeqCst)) => {
                // It has had the signal as well, where it came from a terminal; whatever is left ends here.
                let _ = child.kill();
                let _ = child.wait();
                return Err(quell_trace::TraceError::Cancelled.into());
            }
            None => std::thread::sleep(LOOK),
        }
    };
    let time = begin.elapsed();
    if status.success() { Ok(time) } else { Err(failed(why(status, log))) }
}

fn why(status: ExitStatus, log: &Path) -> String {
    let text = std::fs::read(log).map(|b| String::from_utf8_lossy(&b).into_owned()).unwrap_or_default();
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    let end = lines[lines.len().saturating_sub(QUOTED_LINES)..].join(" / ");
    let said = if end.is_empty() { "it said nothing".to_owned() } else { format!("it said: {end}") };
    format!("the command ended with {status}; {said}; all of it is in {}", log.display())
}

/// A path as one word of the shell.
fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    if cfg!(windows) { format!("\"{text}\"") } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_holds_methods_folders_and_commands() {
        let list = Competitor::list("none, quell:paper+no-virtual,mine=some/where").unwrap();
        let names: Vec<&str> = list.iter().map(Competitor::name).collect();
        assert_eq!(names, ["none", "quell:paper+no-virtual", "mine"]);
        assert_eq!(list[2], Competitor::Frames { name: "mine".to_owned(), folder: "some/where".into() });
        assert!(matches!(
            &Competitor::list("quell:paper+firefly.enabled=off").unwrap()[..],
            [Competitor::Method { .. }]
        ));
        let command = "mine=tool --a 1,2 {noisy} {out}";
        let list = Competitor::list(command).unwrap();
        assert_eq!(list, [Competitor::Command { name: "mine".to_owned(), command: command[5..].to_owned() }]);
        assert!(Competitor::list("mine=tool {noisy}").unwrap_err().to_string().contains("{out}"));
        assert!(Competitor::list("none,mine=tool {out}").unwrap_err().to_string().contains("stands alone"));
        let error = Competitor::list("none,quell:papr").unwrap_err();
        assert!(matches!(&error, Error::UnknownMethod { .. }), "{error}");
        assert!(Competitor::list("nome").unwrap_err().to_string().contains("did you mean none"));
    }

    #[test]
    fn numbers_stand_at_the_end_of_names() {
        let number = |name: &str| number_of(Path::new(name));
        assert_eq!(number("a.0012.exr"), Some(12));
        assert_eq!(number("shot3_v2_1001.EXR"), Some(1001));
        assert_eq!(number("a.-0003.exr"), Some(-3));
        assert_eq!(number("take-0003.exr"), Some(3));
        assert_eq!(number("7.exr"), Some(7));
        for other in ["a.exr", "a.0012.png", ".a.0012.exr", "a.0012.exr.part"] {
            assert_eq!(number(other), None, "{other}");
        }
    }
}
