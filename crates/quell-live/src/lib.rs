//! quell live: a path tracer and its denoiser on one GPU, frame after frame, in a window that one walks through.
//!
//! ```text
//! engine.rs   scene, tracer, denoiser and pictures on one device: a frame encoded, nothing read back
//! baselines/  the a-trous wavelet and SVGF, while a pane shows them
//! display.rs  the noisy sum, the mean of all frames while nothing moves, and the picture that is shown (display.wgsl)
//! stage.rs    a scene, checked, made ready and uploaded, on any thread; lamps that can be switched
//! pilot.rs    cameras: the scene's own, orbit, fly
//! choice.rs   what a frame is made with: settings, ablations, paths, panes
//! clock.rs    timestamps of the tracer's and the display's passes
//! shot.rs     pictures and a frame's planes read back, without waiting
//! error.rs    every error
//! window/     the program around it (feature `window`): egui
//! ```
//!
//! The engine is a host like any other: docs/integrating.md says what it has to know of quell, docs/live.md how to run it.

mod baselines;
mod choice;
mod clock;
mod display;
mod engine;
mod error;
mod pilot;
mod shot;
mod stage;
#[cfg(feature = "window")]
pub mod window;

pub use baselines::{
    AtrousConstants, BASELINE_CONSTANTS, BaselineConstant, BaselineConstants, MOST_LEVELS, SvgfConstants,
};
pub use choice::{Choice, DEBUG_VIEWS, Pane, Tracing};
pub use clock::{PassTime, Times};
pub use engine::{Engine, Made, Sight};
pub use error::LiveError;
pub use pilot::{Mode, Pilot, View};
pub use shot::{PlanesShot, Shot};
pub use stage::{Lamp, Stage, Surroundings, Turn, is_environment, is_file, open, open_bytes};
