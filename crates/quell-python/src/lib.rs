//! The part of the Python package `quell` that is compiled: the module `quell._quell`. What users call, its checks and its
//! docs lie in `python/quell/`; nothing here is a promise.
//!
//! ```text
//! buffers.rs   Python's buffers to planes, planes to bytearrays
//! listen.rs    work in a thread of its own while Python's signals are heard, until the interpreter ends
//! failure.rs   errors as the package's exceptions
//! sequence.rs  the sequence filter, frame by frame
//! realtime.rs  the real-time filter
//! files.rs     files to files, `doctor`, the command
//! tables.rs    every parameter
//! ```
//!
//! Python's lock (the GIL) is given back while anything is computed.

mod buffers;
mod failure;
mod files;
mod listen;
mod realtime;
mod sequence;
mod tables;

/// See `quell/__init__.py`.
#[pyo3::pymodule]
mod _quell {
    #[pymodule_export]
    use super::files::{denoise_files, doctor, run_command};
    #[pymodule_export]
    use super::listen::finish;
    #[pymodule_export]
    use super::realtime::{Realtime, perspective};
    #[pymodule_export]
    use super::sequence::Frames;
    #[pymodule_export]
    use super::tables::{parameters, version};
}
