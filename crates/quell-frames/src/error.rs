//! What can go wrong with a file. Invalid, not supported and I/O are kept apart because the user's next step differs.

use std::io;
use std::path::{Path, PathBuf};

/// Every error of reading and writing frames; each names the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The contents contradict themselves, are cut short, or lack what a frame needs.
    #[error("{}: {reason}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the quantity and the value.
        reason: String,
    },
    /// The file may be fine, but this version cannot read it.
    #[error("{}: not supported: {reason}", .path.display())]
    NotSupported {
        /// The file.
        path: PathBuf,
        /// What is not supported.
        reason: String,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {source}{}", .path.display(), advice(.source))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried: `read`, `write`, `create folder`.
        action: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// A file that quell did not write stands in the way.
    #[error(
        "{} exists and was not written by quell; choose another place, or allow overwriting",
        .path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The job does not fit in memory, in however many bands.
    #[error(
        "the job takes {} at the least, and the limit is {}; raise --max-memory, write fewer frames at a time, or look \
         less far (--set gather.frames=4)",
        crate::driver::in_words(*.needed),
        crate::driver::in_words(*.limit)
    )]
    Memory {
        /// Bytes.
        needed: u64,
        /// Bytes.
        limit: u64,
    },
    /// What another error said before.
    #[error("{0}")]
    Told(String),
    /// What the filter runs on failed: every frame would.
    #[error(transparent)]
    Filter(quell::Error),
    /// The planes to be written contradict each other; nothing was written.
    #[error("{} was not written: {source}", .path.display())]
    Frame {
        /// The file that was to be written.
        path: PathBuf,
        /// What contradicts.
        source: quell::Error,
    },
}

impl Error {
    pub(crate) fn invalid(path: &Path, reason: impl Into<String>) -> Self {
        Self::Invalid { path: path.to_owned(), reason: reason.into() }
    }

    pub(crate) fn not_supported(path: &Path, reason: impl Into<String>) -> Self {
        Self::NotSupported { path: path.to_owned(), reason: reason.into() }
    }

    /// True where the next frame would fail for the same reason: the disk is full, the folder cannot be written, the GPU
    /// is lost.
    pub fn is_lasting(&self) -> bool {
        use io::ErrorKind as Kind;
        if matches!(self, Self::Filter(_)) {
            return true;
        }
        let Self::Io { action, source, .. } = self else { return false };
        let lasting = [
            Kind::StorageFull,
            Kind::QuotaExceeded,
            Kind::PermissionDenied,
            Kind::ReadOnlyFilesystem,
            Kind::NotADirectory,
            Kind::WriteZero,
            // The largest size that the process may write.
            Kind::FileTooLarge,
        ];
        *action != "read" && lasting.contains(&source.kind())
    }

    /// An I/O error with what was tried.
    pub fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }

    pub(crate) fn from_exr(path: &Path, action: &'static str, error: exr::error::Error) -> Self {
        use exr::error::Error as Exr;
        match error {
            Exr::NotSupported(reason) => Self::not_supported(path, reason),
            Exr::Invalid(reason) => Self::invalid(path, format!("not a whole, valid EXR file: {reason}")),
            Exr::Io(source) if source.kind() == io::ErrorKind::UnexpectedEof => {
                Self::invalid(path, "the EXR file is cut short")
            }
            Exr::Io(source) => Self::io(path, action, source),
            Exr::Aborted => Self::invalid(path, "reading was aborted"),
        }
    }
}

fn advice(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; free some space or choose another folder (nothing half written was left behind)"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => "; choose a folder that can be written",
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => "; a file stands where a folder is needed",
        _ => "",
    }
}
