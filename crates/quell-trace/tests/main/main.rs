//! Tests of the tracer from outside: physics, agreement of estimators, determinism, bad input.

mod estimators;
mod gltf;
#[cfg(feature = "gpu")]
mod gpu;
mod guides;
mod mitsuba;
mod mitsuba_gltf;
mod robustness;
mod scenes;
mod textures;
