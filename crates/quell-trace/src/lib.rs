//! Placeholder.
pub mod bsdf;
pub mod environment;
pub mod lights;
pub mod material;
pub mod sampler;
pub mod warp;

#[cfg(test)]
mod testing;
