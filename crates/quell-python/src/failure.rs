//! Errors as exceptions of the package.

use pyo3::prelude::*;

/// What went wrong, and which class of `quell._errors` says so.
#[derive(Debug)]
pub struct Failure {
    class: &'static str,
    message: String,
}

impl Failure {
    /// An argument cannot be used.
    pub fn input(message: impl Into<String>) -> Self {
        Self { class: "InputError", message: message.into() }
    }

    /// The object is at work in another thread.
    pub fn busy(what: &str) -> Self {
        Self {
            class: "Error",
            message: format!("this {what} is being used by another thread; each needs one of its own"),
        }
    }

    /// Something else.
    pub fn other(message: impl Into<String>) -> Self {
        Self { class: "Error", message: message.into() }
    }
}

impl From<quell::Error> for Failure {
    fn from(error: quell::Error) -> Self {
        match error {
            quell::Error::Accelerator { .. } => Self::other(error.to_string()),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<quell_lab::Error> for Failure {
    fn from(error: quell_lab::Error) -> Self {
        match error {
            quell_lab::Error::Quell(error) => error.into(),
            _ => Self::other(error.to_string()),
        }
    }
}

impl From<quell_frames::Error> for Failure {
    fn from(error: quell_frames::Error) -> Self {
        use quell_frames::Error;
        let message = error.to_string();
        match error {
            Error::Io { .. } | Error::Foreign { .. } => Self { class: "FileError", message },
            Error::Invalid { .. } | Error::NotSupported { .. } => Self::input(message),
            Error::Frame { source, .. } | Error::Filter(source) => source.into(),
            _ => Self::other(message),
        }
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| {
            let raised = || py.import("quell._errors")?.getattr(failure.class)?.call1((&failure.message,));
            raised().map_or_else(|error: PyErr| error, PyErr::from_value)
        })
    }
}
