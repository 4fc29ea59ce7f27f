//! Tests of the tracer from outside: physics, agreement of estimators, determinism, bad input.

mod estimators;
mod guides;
mod mitsuba;
mod robustness;
mod scenes;
mod textures;
