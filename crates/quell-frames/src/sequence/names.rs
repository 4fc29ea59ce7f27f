//! From inputs to files, and from a file's name to its frame number.

use crate::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

/// A file's path around its frame number.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Stem {
    pub folder: PathBuf,
    pub before: String,
    pub after: String,
    pub numbered: bool,
}

impl std::fmt::Display for Stem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = if self.numbered { "####" } else { "" };
        write!(f, "{}", self.folder.join(format!("{}{digits}{}", self.before, self.after)).display())
    }
}

/// The files that an input means, in no order.
pub(super) fn expand(input: &Path) -> Result<Vec<PathBuf>, Error> {
    if input.is_dir() {
        let mut files = Vec::new();
        for path in list(input)? {
            if path.is_dir() && !hidden(&path) {
                files.extend(list(&path)?.into_iter().filter(|path| is_exr(path)));
            } else if is_exr(&path) {
                files.push(path);
            }
        }
        return Ok(files);
    }
    if input.exists() {
        return Ok(vec![input.to_owned()]);
    }
    if let Some((before, after)) = digits_pattern(input) {
        let folder = match input.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            return Ok(Vec::new());
        }
        let fits = |path: &PathBuf| {
            let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            name.strip_prefix(&before)
                .and_then(|rest| rest.strip_suffix(&after))
                .is_some_and(|digits| is_number(digits) && !path.is_dir())
        };
        return Ok(list(folder)?.into_iter().filter(fits).collect());
    }
    let text = input.to_string_lossy();
    // As shells do: what begins with a dot is not meant (unfinished files of ours begin so).
    let options = glob::MatchOptions { require_literal_leading_dot: true, ..glob::MatchOptions::new() };
    let Ok(found) = glob::glob_with(&text, options) else { return Ok(Vec::new()) };
    let mut files = Vec::new();
    for path in found {
        let path = path.map_err(|e| {
            let place = e.path().to_owned();
            Error::io(&place, "list", e.into())
        })?;
        if path.is_file() {
            files.push(path);
        }
    }
    Ok(files)
}

fn list(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let entries = fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
    entries.map(|entry| entry.map(|e| e.path()).map_err(|e| Error::io(folder, "list", e))).collect()
}

fn hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'))
}

/// quell's own unfinished files begin with a dot.
fn is_exr(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) && !hidden(path) && path.is_file()
}

/// What stands around the `####` or `%04d` of a pattern's file name.
fn digits_pattern(input: &Path) -> Option<(String, String)> {
    let name = input.file_name()?.to_str()?;
    if let Some(from) = name.find('#') {
        let to = from + name[from..].len() - name[from..].trim_start_matches('#').len();
        return Some((name[..from].to_owned(), name[to..].to_owned()));
    }
    let from = name.find('%')?;
    let (digits, after) = name[from + 1..].split_once('d')?;
    digits.chars().all(|c| c.is_ascii_digit()).then(|| (name[..from].to_owned(), after.to_owned()))
}

fn is_number(text: &str) -> bool {
    let digits = text.strip_prefix('-').unwrap_or(text);
    !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())
}

/// A file's stem and frame number: the last run of digits in the name before its extension, with a minus sign where
/// one stands at the name's beginning or after `.` or `_`. No digits: number 0.
pub(super) fn split(path: &Path) -> (Stem, i64) {
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let end = name.rfind('.').unwrap_or(name.len());
    let bytes = name.as_bytes();
    let mut to = end;
    while to > 0 {
        if !bytes[to - 1].is_ascii_digit() {
            to -= 1;
            continue;
        }
        let mut from = to;
        while from > 0 && bytes[from - 1].is_ascii_digit() {
            from -= 1;
        }
        // Digits with a letter behind them belong to a word (`4k`, `v2b`).
        let ends = to == end || matches!(bytes[to], b'.' | b'_' | b'-');
        let sign = from > 0 && bytes[from - 1] == b'-' && (from == 1 || matches!(bytes[from - 2], b'.' | b'_'));
        let start = from - usize::from(sign);
        if let (true, Ok(number)) = (ends, name[start..to].parse()) {
            let (before, after) = (name[..start].to_owned(), name[to..].to_owned());
            return (Stem { folder, before, after, numbered: true }, number);
        }
        to = from;
    }
    (Stem { folder, before: name, after: String::new(), numbered: false }, 0)
}
