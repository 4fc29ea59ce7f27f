//! quell removes the noise from path-traced global illumination: Mara, McGuire, Bitterli and Jarosz, "An Efficient
//! Denoising Algorithm for Global Illumination" (HPG 2017).
//!
//! Indirect light comes as two signals, matte and glossy, each with its material factored out; they are filtered jointly
//! in space and time, guided by depth, normals and motion, and multiplied back.
//!
//! ```
//! use quell::{Camera, Denoiser, Frame, Plane, Preset, Settings, Size};
//!
//! let size = Size::new(64, 36);
//! let camera = Camera::perspective([0.0, 0.0, 3.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 64.0 / 36.0);
//! let mut denoiser = Denoiser::new(size, &Settings::preset(Preset::Quality))?;
//! for index in 0..3 {
//!     let noisy = Plane::from_fn(size, |x, y| [((x * 7 + y * 13 + index * 5) % 11) as f32 * 0.1; 3]);
//!     let depth = Plane::filled(size, 3.0);
//!     let mut frame = Frame::new(size, camera); // every plane that is left out has a meaning: see `Frame`
//!     frame.index = index as i64;
//!     frame.matte = Some(noisy.view());
//!     frame.view_depth = Some(depth.view());
//!     let output = denoiser.denoise(&frame)?;
//!     assert_eq!(output.composite.size(), size);
//! }
//! # Ok::<(), quell::Error>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`frame`] | the contract of what goes in: planes, spaces, units, signs, special values |
//! | [`plane`], [`camera`] | images, and the map between pixels and the world |
//! | [`settings`] | every parameter, declared once; presets |
//! | [`pipeline`] | the order of the stages: a list that can be printed |
//! | [`stages`] | the algorithm, one folder a stage, the twins side by side: of each the specification, `reference::run` |
//! | [`border`] | the contract enforced: what is repaired, and counted |
//! | [`denoiser`] | the public face: [`Denoiser`], [`Output`] |
//! | [`sequence`] | the filter of whole sequences, offline: its contract, settings, stages in order, [`sequence::SequenceDenoiser`] |
//! | `cpu` | the fast back end (feature `cpu`) |
//! | `gpu` | the back end on the caller's wgpu device (feature `gpu`) |
//!
//! With the feature `internals`, which changes without notice: `kernels` (what stages share), `window` (frames of a sequence as its
//! stages read them) and those stages, `history`, `reference` (the back end that is the specification), and the parts of a GPU
//! program. `public-names.txt` lists what is reachable without it.

#![cfg_attr(not(feature = "internals"), allow(dead_code, reason = "the feature `internals` shows it"))]

pub mod border;
pub mod camera;
#[cfg(feature = "cpu")]
mod cpu;
pub mod denoiser;
pub mod error;
pub mod frame;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(feature = "internals")]
pub mod history;
#[cfg(not(feature = "internals"))]
mod history;
#[cfg(feature = "internals")]
pub mod kernels;
#[cfg(not(feature = "internals"))]
mod kernels;
mod memory;
mod par;
pub mod parameter;
mod parameter_page;
#[cfg(feature = "cpu")]
mod phased;
pub mod pipeline;
pub mod plane;
#[cfg(feature = "internals")]
pub mod reach;
#[cfg(not(feature = "internals"))]
mod reach;
#[cfg(feature = "internals")]
pub mod reference;
#[cfg(not(feature = "internals"))]
mod reference;
pub mod report;
pub mod sequence;
pub mod settings;
#[cfg(feature = "cpu")]
mod simd;
pub mod stages;
#[cfg(feature = "internals")]
pub mod window;
#[cfg(not(feature = "internals"))]
mod window;

pub use camera::{Camera, Projection};
pub use denoiser::{Backend, Denoiser, Output, OutputBuf};
pub use error::Error;
pub use frame::{Frame, FrameBuf, Pass, PassBuf, Rgb, Signal};
pub use kernels::math::luminance;
pub use parameter_page::parameters_markdown;
pub use plane::{Plane, PlaneRef, Size};
pub use report::Report;
pub use settings::{Preset, Settings};
