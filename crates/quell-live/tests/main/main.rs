//! The engine on any Vulkan device, one in software if need be. Without one the tests say so; with `QUELL_REQUIRE_GPU=1` they
//! fail.

mod baselines;
mod device;
mod engine;
mod page;
mod refusals;
#[cfg(feature = "window")]
mod window;
