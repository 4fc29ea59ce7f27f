//! Errors as numbers with a sentence.

use crate::types::{QUELL_BUSY, QUELL_FAILED, QUELL_INVALID_ARGUMENT, QUELL_STOPPED, quell_status};

/// Why a call did not do what was asked.
#[derive(Debug)]
pub struct Failure {
    pub status: quell_status,
    pub message: String,
}

impl Failure {
    /// An argument cannot be used.
    pub fn argument(message: impl Into<String>) -> Self {
        Self { status: QUELL_INVALID_ARGUMENT, message: message.into() }
    }

    /// Another thread is inside.
    pub fn busy(word: &str) -> Self {
        let message = format!("this {word} is being used by another thread; each needs one of its own");
        Self { status: QUELL_BUSY, message }
    }

    /// The callback wanted no more.
    pub fn stopped() -> Self {
        Self { status: QUELL_STOPPED, message: "the callback asked to stop; what was inside is given up".to_owned() }
    }

    /// A panic ended here.
    pub fn panicked() -> Self {
        let message = "the filter failed; this is a defect of quell, please report it";
        Self { status: QUELL_FAILED, message: message.to_owned() }
    }
}

impl From<quell::Error> for Failure {
    fn from(error: quell::Error) -> Self {
        Self::argument(error.to_string())
    }
}

impl From<quell_frames::Error> for Failure {
    fn from(error: quell_frames::Error) -> Self {
        use quell_frames::Error;
        let message = error.to_string();
        match error {
            Error::Invalid { .. } | Error::NotSupported { .. } => Self::argument(message),
            Error::Frame { source, .. } | Error::Filter(source) => source.into(),
            _ => Self { status: QUELL_FAILED, message },
        }
    }
}
