//! What several stages share: the cross-bilateral weight, tap patterns, reprojection, the colour clamp, a little
//! mathematics.

pub(crate) mod bilinear;
pub mod clip;
#[cfg(feature = "cpu")]
pub(crate) mod clip_cpu;
pub mod edge;
#[cfg(feature = "cpu")]
pub(crate) mod edge_cpu;
pub mod guide_distance;
#[cfg(feature = "cpu")]
pub(crate) mod guide_distance_cpu;
pub mod math;
pub mod mirror_image;
#[cfg(feature = "cpu")]
pub(crate) mod mirror_image_cpu;
pub mod reproject;
#[cfg(feature = "cpu")]
pub(crate) mod reproject_cpu;
pub mod spiral;
pub mod temporal;
