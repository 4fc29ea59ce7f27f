//! Denoiser for path-traced global illumination.
pub mod camera;
pub mod error;
pub mod frame;
pub mod plane;

pub use camera::{Camera, Projection};
pub use error::Error;
pub use frame::{Frame, FrameBuf, Pass, PassBuf, Rgb, Signal};
pub use plane::{Plane, PlaneRef, Size};
