//! The program `quell-live`: everything lies in the library beside it.

#[cfg(all(feature = "window", not(target_arch = "wasm32")))]
fn main() -> std::process::ExitCode {
    quell_live::window::run(std::env::args_os().skip(1))
}

// A page is begun by JavaScript (`quell_live::window::start`): the library is linked for what it exports.
#[cfg(all(feature = "window", target_arch = "wasm32"))]
use quell_live as _;

#[cfg(all(feature = "window", target_arch = "wasm32"))]
fn main() {}

#[cfg(not(feature = "window"))]
fn main() -> std::process::ExitCode {
    eprintln!("error: this quell-live was built without its window (feature `window`)");
    std::process::ExitCode::FAILURE
}
