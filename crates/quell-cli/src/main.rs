//! The program `quell`: everything lies in the library beside it.

use std::process::ExitCode;

fn main() -> ExitCode {
    let program = std::env::current_exe().unwrap_or_default();
    quell_cli::run(std::env::args_os().collect(), program).into()
}
