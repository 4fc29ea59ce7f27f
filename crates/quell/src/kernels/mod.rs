//! What several stages share: the cross-bilateral weight, tap patterns, reprojection, the colour clamp, a little
//! mathematics.

pub mod clip;
pub mod edge;
pub mod math;
pub mod reproject;
pub mod spiral;
pub mod temporal;
