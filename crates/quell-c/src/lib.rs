//! The C library: `include/quell.h` declares what is here, and says what it means. docs/c.md has examples.
//!
//! ```text
//! types.rs     the structs and numbers of the header
//! memory.rs    from C's pointers to Rust's values: the only place that reads them
//! status.rs    errors as numbers with a sentence
//! handle.rs    handles: one thread at a time, no panic across the border
//! sequence.rs  the sequence filter
//! realtime.rs  the real-time filter
//! ```
//!
//! Handles hold all state; nothing is global. No panic crosses the border: it becomes `QUELL_FAILED`.
#![allow(unsafe_code, reason = "C hands over pointers")]
#![allow(non_camel_case_types, reason = "the names of the header")]

mod handle;
mod memory;
mod realtime;
mod sequence;
mod status;
mod types;
