//! The program `quell-live`: everything lies in the library beside it.

#[cfg(feature = "window")]
fn main() -> std::process::ExitCode {
    quell_live::window::run(std::env::args_os().skip(1))
}

#[cfg(not(feature = "window"))]
fn main() -> std::process::ExitCode {
    eprintln!("error: this quell-live was built without its window (feature `window`)");
    std::process::ExitCode::FAILURE
}
