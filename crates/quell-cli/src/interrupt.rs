//! Ctrl-C and SIGTERM: the frame in hand is given up, what is written is whole, and a message says how far it came.

use crate::failure::Failure;
use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Exit status after a second Ctrl-C, as shells count signal 2.
const INTERRUPTED: i32 = 130;

/// Takes the signals over. The first asks the program to end; a second ends it at once, which may leave one hidden
/// `.part` file beside the frames, but no half frame under its own name.
pub fn install() -> Result<(), Failure> {
    ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::SeqCst) {
            std::process::exit(INTERRUPTED);
        }
        eprintln!("\nending after what is being written (again to end at once)");
    })
    .map_err(|e| Failure::Failed(format!("cannot listen for Ctrl-C: {e}")))
}

/// The flag that long computations look at.
pub fn flag() -> &'static AtomicBool {
    &ASKED
}

/// Whether the user wants the program to end.
pub fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}
