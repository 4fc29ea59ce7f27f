//! The program around the engine: a window on the desktop, a canvas in a page.
//!
//! ```text
//! app.rs      what is open, what is shown, and the frame that is asked of the engine
//! opening.rs  a scene that is being opened while another one is shown
//! panel.rs    controls: made from the table of parameters where they are parameters
//! picture.rs  the picture, its splits, and what mouse, keyboard and touch do in it
//! views.rs    saved views that outlive the window
//! marks.rs    where controls are, for tests
//! adapter.rs  what is asked of a device; extents in words
//! film.rs     a camera's path, recorded and written as frames; windows only
//! native.rs   the window: options, adapter, files
//! drive.rs    the window driven by a script, for tests: pointer and keys by the names of controls
//! page.rs     the page: parameters of its address, files by fetch, drop and download
//! ```

mod adapter;
mod app;
#[cfg(not(target_arch = "wasm32"))]
mod drive;
#[cfg(not(target_arch = "wasm32"))]
mod film;
mod marks;
#[cfg(not(target_arch = "wasm32"))]
mod native;
mod opening;
#[cfg(target_arch = "wasm32")]
mod page;
mod panel;
mod picture;
mod views;

#[cfg(not(target_arch = "wasm32"))]
pub use native::run;
#[cfg(target_arch = "wasm32")]
pub use page::{QuellLive, start};
