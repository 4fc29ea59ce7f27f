//! The tracer in WGSL against the one on the CPU, on any Vulkan device, lavapipe if need be.

mod canaries;
mod device;
mod everything;
mod mirrors;
mod pixels;
mod statistics;
