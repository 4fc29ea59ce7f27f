//! Where a sequence's frames lie, and files that are never half written.

use crate::error::Error;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Digits of a frame number in a file name; longer numbers take what they need.
const FRAME_DIGITS: usize = 4;

/// `folder/stem.0012.exr`: the file of frame 12. A negative number keeps its sign before the digits: `-0003`.
pub fn frame_path(folder: &Path, stem: &str, index: i64) -> PathBuf {
    let digits = index.unsigned_abs();
    let sign = if index < 0 { "-" } else { "" };
    folder.join(format!("{stem}.{sign}{digits:0FRAME_DIGITS$}.exr"))
}

/// The frames named like [`frame_path`] in a folder, sorted by number; empty where there are none.
///
/// # Errors
/// [`Error::Io`] where the folder cannot be listed.
pub fn find_frames(folder: &Path, stem: &str) -> Result<Vec<(i64, PathBuf)>, Error> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))? {
        let path = entry.map_err(|e| Error::io(folder, "list", e))?.path();
        let number = path
            .file_name()
            .and_then(|name| name.to_str())
            .and_then(|name| name.strip_prefix(stem)?.strip_prefix('.')?.strip_suffix(".exr"))
            .filter(|digits| digits.trim_start_matches('-').len() >= FRAME_DIGITS)
            .and_then(|digits| digits.parse::<i64>().ok());
        if let Some(number) = number {
            found.push((number, path));
        }
    }
    found.sort();
    Ok(found)
}

/// Writes a file beside its final place, then renames it there: whoever looks sees the old file or the whole new one.
///
/// Missing folders are made. `fill` gets a buffered writer that can seek. Where anything fails, the temporary file is
/// removed and what stood at `path` before stands there still.
///
/// # Errors
/// What `fill` returns, or [`Error::Io`] naming `path` or its folder.
pub fn write_whole<T>(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<T, Error>) -> Result<T, Error> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create folder", e))?;
    let name = path.file_name().ok_or_else(|| Error::invalid(path, "this path names no file"))?;
    let mut temporary_name = std::ffi::OsString::from(".");
    temporary_name.push(name);
    temporary_name.push(format!(".{}-{}.part", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed)));
    let temporary = Temporary { path: folder.join(temporary_name) };
    // Also for reading: what was written may be put in order before it is shown.
    let file = File::options().read(true).write(true).create_new(true).open(&temporary.path);
    let file = file.map_err(|e| Error::io(path, "write", e))?;
    let mut writer = BufWriter::new(file);
    let result = fill(&mut writer)?;
    writer.flush().map_err(|e| Error::io(path, "write", e))?;
    // Some file systems report a full disk only here.
    writer.get_ref().sync_data().map_err(|e| Error::io(path, "write", e))?;
    drop(writer);
    fs::rename(&temporary.path, path).map_err(|e| Error::io(path, "write", e))?;
    std::mem::forget(temporary);
    Ok(result)
}

/// [`write_whole`] for bytes that are already there.
///
/// # Errors
/// [`Error::Io`] naming `path` or its folder.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    write_whole(path, |writer| writer.write_all(bytes).map_err(|e| Error::io(path, "write", e)))
}

/// A file that is removed again unless it was renamed; by `Drop`, so that a panic or an early return removes it too.
struct Temporary {
    path: PathBuf,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Nothing more can be done where even this fails; the error that led here is the one to report.
        let _ = fs::remove_file(&self.path);
    }
}
