//! The command `quell` as a library, for the program of that name and for packages that carry the command: parse, call,
//! report. What is computed, the crates beside this one compute.
//!
//! ```text
//! args/         what the user typed: options, ranges, sizes; no side effect
//! context.rs    what the program runs on: settings, threads, back end, where messages go
//! backend.rs    which back end runs, and why that one
//! failure.rs    how a run ends badly, and with which exit status
//! allocator.rs  memory that was freed is kept for the next plane, or goes back to the system where a limit was set
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
use std::ffi::OsString;
use std::path::PathBuf;

/// Counts what is allocated: `quell compare` says how much memory each method takes.
#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Does what a command line asks for and returns the exit status. Prints on standard output and standard error and takes over
/// Ctrl-C and SIGTERM: once a process.
///
/// `arguments` begin with the program's name; `program` is the file that holds this code, whose bytes tell one build from
/// another.
pub fn run(arguments: Vec<OsString>, program: PathBuf) -> u8 {
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Nobody listens where that fails.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    let started = Cli { common: args::Common { arguments, program, ..cli.common }, ..cli };
    match commands::run(started) {
        Ok(()) => 0,
        Err(failure) => {
            failure.tell();
            failure.exit_status()
        }
    }
}

/// What `quell doctor --json` says of what was found, as a JSON object.
pub fn diagnosis_as_json(found: &quell_frames::doctor::Diagnosis) -> String {
    serde_json::Value::Object(commands::doctor::further(found, None)).to_string()
}
