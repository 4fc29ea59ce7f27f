//! The program around the engine: a window on the desktop.
//!
//! ```text
//! app.rs      what is open, what is shown, and the frame that is asked of the engine
//! panel.rs    controls: made from the table of parameters where they are parameters
//! picture.rs  the picture, its splits, and what mouse, keyboard and touch do in it
//! drive.rs    the window driven by a script, for tests: pointer and keys by the names of controls
//! native.rs   options, adapter, files
//! ```

mod app;
mod drive;
mod native;
mod panel;
mod picture;

pub use native::run;
