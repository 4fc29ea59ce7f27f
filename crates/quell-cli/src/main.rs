//! The command `quell`: parse, call, report. What is computed, the crates beside this one compute.
//!
//! ```text
//! args/         what the user typed: options, ranges, sizes; no side effect
//! context.rs    what the program runs on: settings, threads, back end, where messages go
//! backend.rs    which back end runs, and why that one
//! failure.rs    how a run ends badly, and with which exit status
//! allocator.rs  memory that was freed goes back to the system, where a limit was set
//! interrupt.rs  Ctrl-C and SIGTERM
//! progress.rs   bars on a terminal, plain lines without one
//! output.rs     folders that can be written, addresses of pages, standard output
//! scene.rs      scenes by name or from files, and their cameras
//! sequence/     a scene traced, denoised, scored and shown, frame by frame: what `demo` and `render` share
//! commands/     one file a command
//! ```

mod allocator;
mod args;
mod backend;
mod commands;
mod context;
mod environment;
mod failure;
mod interrupt;
mod output;
mod progress;
mod scene;
mod sequence;

use args::Cli;
use clap::Parser;
use peak_alloc::PeakAlloc;
use std::process::ExitCode;

/// Counts what is allocated: `quell compare` says how much memory each method takes.
#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

fn main() -> ExitCode {
    match commands::run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.tell();
            failure.exit_code()
        }
    }
}
