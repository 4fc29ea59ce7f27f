//! What several stages share.
//!
//! | file | what | of which filter |
//! |---|---|---|
//! | `reproject` | where a surface was in the frame before, and whether it is the same: disocclusion | real-time |
//! | `mirror_image` | where the image in a mirror was | real-time |
//! | `temporal`, `clip` | the blend with history; its clamp to the neighbourhood | real-time |
//! | `change` | where light has changed: a fast history beside the long one | real-time |
//! | `edge`, `spiral` | cross-bilateral weights; sparse tap patterns | real-time |
//! | `guide_distance` | edge-stopping functions of feature buffers | sequence |
//! | `net`, `conv` | small nets: of a pixel's statistics; convolutional | sequence |
//! | `bilinear`, `math`, `halves` | footprints; functions with the same bits on every machine | both |
//! | `lanes`, `lit_blocks` | sixteen pixels of a row on vectors; where they hold light at all | sequence |
//! | `motion`, `bands` | motion of eight or sixteen pixels; some rows of an image, and means over windows of it | sequence |
//!
//! `*_cpu.rs` are twins on vectors, `*.wgsl` on the GPU.

#[cfg(feature = "cpu")]
pub(crate) mod bands_cpu;
pub(crate) mod bilinear;
pub mod change;
#[cfg(feature = "cpu")]
pub(crate) mod change_cpu;
pub mod clip;
#[cfg(feature = "cpu")]
pub(crate) mod clip_cpu;
pub(crate) mod conv;
pub mod edge;
#[cfg(feature = "cpu")]
pub(crate) mod edge_cpu;
pub mod guide_distance;
#[cfg(feature = "cpu")]
pub(crate) mod guide_distance_cpu;
pub(crate) mod halves;
#[cfg(feature = "cpu")]
pub(crate) mod lanes;
#[cfg(feature = "cpu")]
pub(crate) mod lit_blocks;
pub mod math;
pub mod mirror_image;
#[cfg(feature = "cpu")]
pub(crate) mod mirror_image_cpu;
#[cfg(feature = "cpu")]
pub(crate) mod motion_cpu;
pub(crate) mod net;
pub mod reproject;
#[cfg(feature = "cpu")]
pub(crate) mod reproject_cpu;
pub mod spiral;
pub mod temporal;
